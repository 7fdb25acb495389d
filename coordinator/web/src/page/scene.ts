// What is looked at: a job, as its light arrives, or a file of this machine.

import type { Vector2 } from 'three';
import type { Viewer, Motion, Shown, ToneMap } from '../viewer/viewer';
import type { LitFile } from '../viewer/lit_file';
import type { Reading } from '../viewer/probe';
import { State, type Job } from '../messages/radiosity/v1/radiosity_pb';
import { explain } from '../service/client';
import { fetchResult } from '../service/result';

const GLB = 'model/gltf-binary';

/** Ends of the scale of false colours. */
export interface Scale {
  low: number;
  high: number;
  isLogarithmic: boolean;
  /** Follows the file. */
  isAutomatic: boolean;
}

/** What is looked at, and how. */
export class SceneState {
  /** The job, if it is one. */
  job = '';
  /** What it is called. */
  title = '';
  /** What hinders: instead of a picture, or beside an old one. */
  message = '';
  /** The part of a file that has arrived, while one is on its way. */
  arriving: number | undefined;
  /** The present state that is shown; 0 for a result or nothing. */
  present = 0n;
  isResult = false;
  file: LitFile | undefined;
  shown: Shown = 'lit';
  motion: Motion = 'orbit';
  toneMap: ToneMap = 'linear';
  hasMesh = false;
  exposure = 0;
  scale: Scale = { low: 0.1, high: 1, isLogarithmic: true, isAutomatic: true };
  /** What was measured last. */
  reading: Reading | undefined;
  /** Where in the picture, as long as that is still the place. */
  readingAt: Vector2 | undefined;
  viewer: Viewer | undefined;

  #canvas: HTMLCanvasElement | undefined;
  #loading: AbortController | undefined;
  readonly #changed: () => void;
  readonly #announce: (text: string) => void;

  constructor(changed: () => void, announce: (text: string) => void) {
    [this.#changed, this.#announce] = [changed, announce];
  }

  /** The canvas to draw on, once it is there. */
  attach(canvas: Element | undefined): void {
    this.#canvas = canvas as HTMLCanvasElement | undefined;
  }

  /** Leaves what is looked at. */
  close(): void {
    this.#loading?.abort();
    this.#loading = undefined;
    this.viewer?.clear();
    Object.assign(this, { job: '', title: '', message: '', arriving: undefined, present: 0n, isResult: false });
    Object.assign(this, { file: undefined, reading: undefined, readingAt: undefined });
  }

  /** Turns to a job. */
  open(job: string): void {
    this.close();
    this.job = job;
  }

  /** Shows a lit file of this machine. */
  async openFile(file: File): Promise<void> {
    this.close();
    this.title = file.name;
    this.job = '';
    await this.#load(() => file.arrayBuffer());
  }

  /** Fetches what is new of the job. */
  follow(job: Job): void {
    this.title = job.name;
    if (this.#loading) return;
    if (job.state === State.DONE && !this.isResult) {
      this.isResult = true;
      void this.#fetch(job, false);
    } else if (job.state === State.RUNNING && (job.progress?.present ?? 0n) > this.present) {
      // Not asked for again if it cannot be shown; the next one may.
      this.present = job.progress!.present;
      void this.#fetch(job, true);
    }
  }

  /** Asks again for what could not be shown. */
  retry(): void {
    Object.assign(this, { message: '', isResult: false });
    this.#changed();
  }

  async #fetch(job: Job, present: boolean): Promise<void> {
    await this.#load(async (signal) => {
      const fetched = await fetchResult(job.id, present, (part) => this.#arrive(part), signal);
      if (fetched.mediaType !== GLB) throw new Error('the result is no GLB, which could be shown: download it');
      this.present = fetched.present;
      return fetched.bytes.buffer;
    });
    // The job may have ended meanwhile: then its result comes next.
    if (present) this.message = '';
    if (this.job === job.id && this.file && !this.message) {
      this.#announce(present ? `Present state ${this.present} of ${job.name} is shown` : `${job.name} is shown`);
    }
  }

  async #load(source: (signal: AbortSignal) => Promise<ArrayBuffer>): Promise<void> {
    const loading = (this.#loading = new AbortController());
    this.#arrive(0);
    try {
      const [bytes, { Viewer }, { readLitFile }] = await Promise.all([
        source(loading.signal),
        import('../viewer/viewer'),
        import('../viewer/lit_file'),
      ]);
      const file = await readLitFile(bytes);
      if (loading.signal.aborted) return;
      if (!file.spreads.irradiance) throw new Error('this file has no light at its vertices: bake it first');
      this.viewer ??= this.#newViewer(Viewer);
      const isSameScene = this.file !== undefined;
      this.file = file;
      // The light is seen to grow; what comes out of a job in the end is shown as it is.
      this.viewer.show(file, isSameScene, this.present > 0n);
      this.message = '';
      // What is looked at gets brighter under the mark.
      this.reading = this.readingAt && this.viewer.measure(this.readingAt);
      if (!file.spreads.unshot && this.shown === 'unshot') this.shown = 'lit';
      this.apply();
    } catch (error) {
      if (loading.signal.aborted) return;
      this.message = explain(error);
    } finally {
      if (this.#loading === loading) {
        this.#loading = undefined;
        this.arriving = undefined;
      }
      this.#changed();
    }
  }

  #newViewer(Kind: typeof Viewer): Viewer {
    try {
      return new Kind(this.#canvas!, {
        picked: (reading, at) => {
          this.reading = reading;
          this.readingAt = reading && at;
          if (reading) this.#announce(`${reading.name}: ${this.#inWords(reading)}`);
          this.#changed();
        },
        moved: () => {
          if (!this.readingAt) return;
          this.readingAt = undefined;
          this.#changed();
        },
      });
    } catch {
      throw new Error('this browser has no WebGL 2, which the picture needs; the file can be downloaded');
    }
  }

  #inWords({ values }: Reading): string {
    const value = values.irradiance?.luminance;
    return value === undefined ? 'no light of its own' : `${value.toPrecision(3)} ${this.file!.unit}`;
  }

  #arrive(part: number): void {
    this.arriving = part;
    this.#changed();
  }

  /** Hands the settings to the viewer. */
  apply(): void {
    const { viewer, file, scale } = this;
    if (!viewer) return;
    const spread = this.shown === 'lit' ? undefined : file?.spreads[this.shown];
    if (spread && scale.isAutomatic) [scale.low, scale.high] = spread.range();
    viewer.setShown(this.shown);
    viewer.setScale(scale.low, scale.high, scale.isLogarithmic);
    viewer.setExposure(this.exposure);
    viewer.setToneMap(this.toneMap);
    viewer.setMesh(this.hasMesh);
    viewer.setMotion(this.motion);
    this.#changed();
  }
}
