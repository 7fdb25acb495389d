// The list of jobs.

import { html, nothing, type TemplateResult } from 'lit-html';
import { repeat } from 'lit-html/directives/repeat.js';
import { State, type Job } from '../messages/radiosity/v1/radiosity_pb';
import { isUnderWay, type Jobs } from '../service/jobs';
import { ago, bytes, count, duration, percent, PHASES, short, STATES } from './format';

/** Actions on a job. */
export interface JobActions {
  download(job: Job): void;
  cancel(job: Job): void;
  remove(job: Job): void;
}

/** The list, with the open job marked. */
export function jobsView(jobs: Jobs, open: string, actions: JobActions): TemplateResult {
  const empty = jobs.isKnown ? 'No jobs yet.' : jobs.failure ? '' : 'Loading…';
  return html`
    <section class="jobs" aria-labelledby="jobs">
      <h2 id="jobs">Jobs</h2>
      ${jobs.failure ? html`<p class="failure" role="alert">${jobs.failure}. <button type="button" @click=${() => void jobs.ask()}>Try again</button></p>` : nothing}
      ${jobs.list.length === 0
        ? html`<p class="fine">${empty}</p>`
        : html`<ul>
            ${repeat(jobs.list, ({ id }) => id, (job) => jobItem(job, job.id === open, actions))}
          </ul>`}
      ${jobs.hasMore ? html`<button type="button" @click=${() => jobs.more()}>More</button>` : nothing}
    </section>
  `;
}

function jobItem(job: Job, isOpen: boolean, actions: JobActions): TemplateResult {
  const name = job.name || job.id;
  return html`
    <li class="job" data-job=${job.id} data-state=${STATES[job.state]}>
      <div class="line">
        <a href="#/job/${encodeURIComponent(job.id)}" aria-current=${isOpen ? 'true' : nothing}>${name}</a>
        <span class="state">${STATES[job.state]}</span>
      </div>
      ${progressBar(job)} ${metrics(job)}
      ${job.failure ? html`<p class="failure">${job.failure}</p>` : nothing}
      ${job.outcome?.warnings.length
        ? html`<details class="warnings">
            <summary>${count(job.outcome.warnings.length)} ${job.outcome.warnings.length === 1 ? 'warning' : 'warnings'}</summary>
            <ul>${job.outcome.warnings.map((warning) => html`<li>${warning}</li>`)}</ul>
          </details>`
        : nothing}
      <div class="actions">
        ${job.state === State.DONE
          ? html`<button type="button" aria-label="Download ${name}" @click=${() => actions.download(job)}>Download</button>`
          : nothing}
        ${isUnderWay(job)
          ? html`<button type="button" aria-label="Cancel ${name}" @click=${() => actions.cancel(job)}>Cancel</button>`
          : html`<button type="button" aria-label="Delete ${name}" @click=${() => actions.remove(job)}>Delete</button>`}
      </div>
    </li>
  `;
}

/** The progress bar of an unfinished job. */
export function progressBar(job: Job): TemplateResult | typeof nothing {
  if (!isUnderWay(job)) return nothing;
  const { rows = 0n, rowsNeeded = 0n } = job.progress ?? {};
  const label = `Rows of ${job.name || job.id}`;
  // A bar without a value is indeterminate.
  return rowsNeeded > 0n
    ? html`<progress aria-label=${label} max="1" value=${Math.min(Number(rows) / Number(rowsNeeded), 1)}></progress>`
    : html`<progress aria-label=${label}></progress>`;
}

/** The metrics of a job, in one line. */
export function metrics(job: Job): TemplateResult {
  return html`<p class="metrics">${parts(job).filter(Boolean).join(' · ')}</p>`;
}

function parts(job: Job): (string | false | undefined)[] {
  const { progress, outcome } = job;
  if (job.state === State.QUEUED) {
    return [job.ahead > 0 ? `${count(job.ahead)} ${job.ahead === 1 ? 'job' : 'jobs'} ahead` : 'next'];
  }
  if (job.state === State.RUNNING && progress) {
    return [
      PHASES[progress.phase],
      progress.rowsNeeded > 0n && `${count(progress.rows)} of ${count(progress.rowsNeeded)} rows`,
      progress.unshot > 0 && `${percent(progress.unshot)} unshot`,
      progress.error !== undefined && `error ${percent(progress.error)}`,
      progress.vertices > 0n && `${count(progress.vertices)} vertices`,
      progress.rowsPerSecond > 0 && `${short(progress.rowsPerSecond)} rows/s`,
      progress.raysPerSecond > 0 && `${short(progress.raysPerSecond)} rays/s`,
      progress.workers > 0 && `${count(progress.workers)} ${progress.workers === 1 ? 'worker' : 'workers'}`,
      progress.timeLeft && `${duration(progress.timeLeft)} left`,
    ];
  }
  return [outcome && bytes(outcome.size), outcome?.took && `in ${duration(outcome.took)}`, job.submitted && ago(job.submitted)];
}
