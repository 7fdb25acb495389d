// The client's jobs, kept up to date.
//
// The list is asked for every few seconds, and only the job that is looked at is watched by a stream of its own: a browser opens
// six connections to a server at most, and streams would use them up.

import { State, type Job } from '../messages/radiosity/v1/radiosity_pb';
import { client, explain, wantsToken } from './client';

const PAGE = 50;
const BUSY_MS = 1500;
const IDLE_MS = 8000;

/** Whether a job may still change. */
export function isUnderWay({ state }: Job): boolean {
  return state === State.QUEUED || state === State.RUNNING;
}

/** The client's jobs. */
export class Jobs {
  /** Newest first. */
  list: Job[] = [];
  /** Whether there are more than `list`. */
  hasMore = false;
  /** Whether the service has answered yet. */
  isKnown = false;
  /** Why the last question failed. */
  failure = '';
  /** Whether the service wants a token that it knows. */
  isLocked = false;

  #shown = PAGE;
  #timer: ReturnType<typeof setTimeout> | undefined;
  #asking: AbortController | undefined;
  #watching: AbortController | undefined;
  #watched = '';
  readonly #changed: () => void;

  /** `changed` is called after every change. */
  constructor(changed: () => void) {
    this.#changed = changed;
    document.addEventListener('visibilitychange', () => !document.hidden && void this.ask());
  }

  /** The job of this name, as it was last seen. */
  find(id: string): Job | undefined {
    return this.list.find((job) => job.id === id);
  }

  /** Asks for the list now, and again later. */
  async ask(): Promise<void> {
    clearTimeout(this.#timer);
    this.#asking?.abort();
    const asking = (this.#asking = new AbortController());
    try {
      const found: Job[] = [];
      let pageToken = '';
      do {
        const page = await client.listJobs({ pageSize: PAGE, pageToken }, { signal: asking.signal });
        found.push(...page.jobs);
        pageToken = page.nextPageToken;
      } while (pageToken !== '' && found.length < this.#shown);
      const known = new Map(this.list.map((job) => [job.id, job]));
      this.list = found.map((job) => newest(known.get(job.id), job));
      this.hasMore = pageToken !== '';
      [this.failure, this.isLocked, this.isKnown] = ['', false, true];
    } catch (error) {
      if (asking.signal.aborted) return;
      this.isLocked = wantsToken(error);
      this.failure = this.isLocked ? '' : explain(error);
    }
    this.#changed();
    // A hidden tab asks again when it is seen.
    if (!document.hidden && !this.isLocked) {
      this.#timer = setTimeout(() => void this.ask(), this.list.some(isUnderWay) ? BUSY_MS : IDLE_MS);
    }
  }

  /** Shows more of the list. */
  more(): void {
    this.#shown += PAGE;
    void this.ask();
  }

  /** Takes in what a call has answered. */
  put(job: Job): void {
    const i = this.list.findIndex(({ id }) => id === job.id);
    if (i >= 0) this.list[i] = newest(this.list[i], job);
    else this.list.unshift(job);
    this.#changed();
  }

  /** Forgets a job. */
  remove(id: string): void {
    this.list = this.list.filter((job) => job.id !== id);
    this.#changed();
  }

  /** Follows one job closely until it ends or another is watched; none if the name is empty. */
  async watch(id: string): Promise<void> {
    if (this.#watched === id) return;
    this.#watched = id;
    this.#watching?.abort();
    if (id === '') return;
    const { signal } = (this.#watching = new AbortController());
    while (!signal.aborted) {
      try {
        for await (const job of client.watchJob({ id }, { signal })) this.put(job);
        break; // The stream ends with the job.
      } catch {
        if (signal.aborted) return;
        // The list says what is wrong, if it lasts; the stream is tried again as long as the job is in it.
        await new Promise((resolve) => setTimeout(resolve, BUSY_MS));
        const job = this.find(id);
        if (!job || !isUnderWay(job)) break;
      }
    }
    if (this.#watched === id) this.#watched = '';
  }
}

/** Answers may overtake each other. The list leaves out what only a question for the one job brings. */
function newest(known: Job | undefined, told: Job): Job {
  return known && known.revision >= told.revision ? known : told;
}
