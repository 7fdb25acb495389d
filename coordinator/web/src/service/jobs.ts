// The client's jobs, kept up to date.
//
// The list is polled every few seconds; only the open job is watched by a stream: browsers open at most six connections to a
// server, and more streams would use them up.

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
  /** Why the last request failed. */
  failure = '';
  /** Whether the service requires another token. */
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

  /** The job of this identifier, as last seen. */
  find(id: string): Job | undefined {
    return this.list.find((job) => job.id === id);
  }

  /** Fetches the list now, and again later. */
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
    // A hidden tab fetches again when it becomes visible.
    if (!document.hidden && !this.isLocked) {
      this.#timer = setTimeout(() => void this.ask(), this.list.some(isUnderWay) ? BUSY_MS : IDLE_MS);
    }
  }

  /** Shows more of the list. */
  more(): void {
    this.#shown += PAGE;
    void this.ask();
  }

  /** Adds or updates a job. */
  put(job: Job): void {
    const i = this.list.findIndex(({ id }) => id === job.id);
    if (i >= 0) this.list[i] = newest(this.list[i], job);
    else this.list.unshift(job);
    this.#changed();
  }

  /** Removes a job. */
  remove(id: string): void {
    this.list = this.list.filter((job) => job.id !== id);
    this.#changed();
  }

  /** Watches one job until it ends or another is watched; none if `id` is empty. */
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
        // Retries while the job is in the list, which reports a lasting failure.
        await new Promise((resolve) => setTimeout(resolve, BUSY_MS));
        const job = this.find(id);
        if (!job || !isUnderWay(job)) break;
      }
    }
    if (this.#watched === id) this.#watched = '';
  }
}

/** The newer of two states: responses may overtake each other, and the list omits some fields. */
function newest(known: Job | undefined, told: Job): Job {
  return known && known.revision >= told.revision ? known : told;
}
