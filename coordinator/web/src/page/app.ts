// The page: its state, its actions, and its rendering.

import { html, render } from 'lit-html';
import type { Job } from '../messages/radiosity/v1/radiosity_pb';
import { client, explain, wantsToken } from '../service/client';
import { isUnderWay, Jobs } from '../service/jobs';
import { fetchOptions, type Option } from '../service/options';
import { fetchResult, save } from '../service/result';
import { submit } from '../service/submit';
import { PHASES, STATES } from './format';
import { jobsView } from './jobs_view';
import { wanted } from './options_form';
import { SceneState } from './scene';
import { sceneView } from './scene_view';
import { tokenDialog } from './token_dialog';
import { uploadView, type Upload } from './upload_view';

/** Renders the page into an element, and keeps it up to date. */
export class App {
  readonly #root: HTMLElement;
  readonly #jobs = new Jobs(() => this.#changed());
  readonly #scene = new SceneState(() => this.#changed(), (text) => this.#announce(text));
  #options: Option[] = [];
  #uploads: Upload[] = [];
  #failure = '';
  #announcement = '';
  #announced = '';
  #isOver = false;
  #isDue = false;

  constructor(root: HTMLElement) {
    this.#root = root;
    addEventListener('hashchange', () => this.#route());
    this.#watchDrops();
    this.#route();
    void this.#jobs.ask();
    void this.#try(async () => {
      this.#options = await fetchOptions();
      this.#changed();
    });
  }

  #changed(): void {
    if (this.#isDue) return;
    this.#isDue = true;
    // Not by animation frames: a hidden tab has none, and must not fall behind.
    queueMicrotask(() => {
      this.#isDue = false;
      const job = this.#open();
      if (job) this.#follow(job);
      this.#draw(job);
    });
  }

  #open(): Job | undefined {
    return this.#scene.job ? this.#jobs.find(this.#scene.job) : undefined;
  }

  #follow(job: Job): void {
    this.#scene.follow(job);
    const phase = isUnderWay(job) && job.progress ? `, ${PHASES[job.progress.phase]}` : '';
    const text = `${job.name}: ${STATES[job.state]}${phase}`;
    // Only changes of state and phase are worth interrupting for.
    if (text !== this.#announced) {
      this.#announced = text;
      this.#announcement = text;
    }
  }

  #announce(text: string): void {
    this.#announcement = text;
    this.#changed();
  }

  #draw(job: Job | undefined): void {
    document.title = job ? `${job.name || job.id} – Halflight` : 'Halflight';
    this.#root.dataset['view'] = this.#scene.job || this.#scene.title ? 'scene' : 'list';
    render(
      html`
        <header class="bar">
          <h1 class="unseen">Halflight: baked light</h1>
          <a class="brand" href="#/"><img src="./halflight.svg" alt="" width="24" height="24" />Halflight</a>
          <span class="spacer"></span>
          ${tokenDialog(this.#jobs.isLocked, () => void this.#jobs.ask())}
        </header>
        <main>
          <div class="side">
            ${this.#failure
              ? html`<p class="failure" role="alert">${this.#failure} <button type="button" @click=${() => this.#fail('')}>Dismiss</button></p>`
              : ''}
            ${uploadView(this.#options, this.#uploads, this.#isOver, {
              bake: (files) => this.#bake(files),
              view: (file) => void this.#view(file),
              dismiss: (upload) => this.#dismiss(upload),
            })}
            ${jobsView(this.#jobs, this.#scene.job, {
              download: (job) => void this.#try(() => this.#download(job)),
              cancel: (job) => void this.#try(async () => this.#jobs.put(await client.cancelJob({ id: job.id }))),
              remove: (job) => void this.#try(() => this.#remove(job)),
            })}
          </div>
          ${sceneView(this.#scene, job)}
        </main>
        <p class="unseen" role="status" aria-live="polite">${this.#announcement}</p>
      `,
      this.#root,
    );
  }

  #route(): void {
    const id = decodeURIComponent(/^#\/job\/(.+)$/.exec(location.hash)?.[1] ?? '');
    if (id !== this.#scene.job || id === '') {
      if (id) this.#scene.open(id);
      else this.#scene.close();
    }
    void this.#jobs.watch(id);
    this.#changed();
  }

  #bake(files: Iterable<File>): void {
    for (const file of files) void this.#upload(file);
  }

  async #upload(file: File): Promise<void> {
    // Also the idempotency key. crypto.randomUUID is only for secure origins.
    const key = crypto.getRandomValues(new Uint32Array(4)).join('-');
    const upload: Upload = { key, name: file.name, step: 'reading', part: 0, failure: '', stop: new AbortController() };
    const advance = (values: Partial<Upload>): void => {
      Object.assign(upload, values);
      this.#changed();
    };
    this.#uploads = [upload, ...this.#uploads];
    try {
      const name = file.name.replace(/\.(glb|gltf)$/i, '');
      const header = Object.assign(wanted(this.#options), { name, idempotencyKey: key });
      const job = await submit(file, header, (step, part) => advance({ step, part }), upload.stop.signal);
      this.#uploads = this.#uploads.filter((other) => other !== upload);
      this.#jobs.put(job);
      location.hash = `#/job/${encodeURIComponent(job.id)}`;
      void this.#jobs.ask();
    } catch (error) {
      this.#jobs.isLocked ||= wantsToken(error);
      advance({ step: 'failed', failure: explain(error) });
    }
  }

  #dismiss(upload: Upload): void {
    upload.stop.abort();
    this.#uploads = this.#uploads.filter((other) => other !== upload);
    this.#changed();
  }

  async #view(file: File): Promise<void> {
    if (location.hash !== '#/') history.replaceState(null, '', '#/');
    void this.#jobs.watch('');
    await this.#scene.openFile(file);
  }

  async #download(job: Job): Promise<void> {
    save(await fetchResult(job.id, false, () => {}, new AbortController().signal));
  }

  async #remove(job: Job): Promise<void> {
    if (!confirm(`Delete ${job.name || job.id} and its lit file?`)) return;
    await client.deleteJob({ id: job.id });
    this.#jobs.remove(job.id);
    if (this.#scene.job === job.id) location.hash = '#/';
  }

  async #try(action: () => Promise<void>): Promise<void> {
    try {
      await action();
    } catch (error) {
      this.#jobs.isLocked ||= wantsToken(error);
      this.#fail(explain(error));
    }
  }

  #fail(failure: string): void {
    this.#failure = failure;
    this.#changed();
  }

  // The whole page accepts drops: the browser would open a file that misses a small drop zone.
  #watchDrops(): void {
    const over = (isOver: boolean) => (event: DragEvent) => {
      event.preventDefault();
      if (this.#isOver !== isOver) {
        this.#isOver = isOver;
        this.#changed();
      }
    };
    addEventListener('dragover', over(true));
    addEventListener('dragleave', (event) => event.relatedTarget === null && over(false)(event));
    addEventListener('drop', (event) => {
      over(false)(event);
      this.#bake(event.dataTransfer?.files ?? []);
    });
  }
}
