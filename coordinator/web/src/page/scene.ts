// The open scene: a job, with previews while it runs, or a local file.

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

/** The open scene, and how it is shown. */
export class SceneState {
  /** The job, empty for a local file. */
  job = '';
  /** Its name. */
  title = '';
  /** Why there is no picture, or no newer one. */
  message = '';
  /** The fraction of a file that has arrived, while one is loading. */
  arriving: number | undefined;
  /** Number of the preview shown; 0 for a result or nothing. */
  preview = 0n;
  isResult = false;
  file: LitFile | undefined;
  shown: Shown = 'lit';
  motion: Motion = 'orbit';
  toneMap: ToneMap = 'linear';
  hasMesh = false;
  exposure = 0;
  scale: Scale = { low: 0.1, high: 1, isLogarithmic: true, isAutomatic: true };
  /** The last reading. */
  reading: Reading | undefined;
  /** Where in the picture it was taken, until the camera moves. */
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

  /** Closes the scene. */
  close(): void {
    this.#loading?.abort();
    this.#loading = undefined;
    this.viewer?.clear();
    Object.assign(this, { job: '', title: '', message: '', arriving: undefined, preview: 0n, isResult: false });
    Object.assign(this, { file: undefined, reading: undefined, readingAt: undefined });
  }

  /** Opens a job. */
  open(job: string): void {
    this.close();
    this.job = job;
  }

  /** Opens a local lit file. */
  async openFile(file: File): Promise<void> {
    this.close();
    this.title = file.name;
    this.job = '';
    await this.#load(() => file.arrayBuffer());
  }

  /** Fetches the job's result or its next preview. */
  follow(job: Job): void {
    this.title = job.name;
    if (this.#loading) return;
    if (job.state === State.DONE && !this.isResult) {
      this.isResult = true;
      void this.#fetch(job, false);
    } else if (job.state === State.RUNNING && (job.progress?.present ?? 0n) > this.preview) {
      // Not fetched again if it cannot be shown; the next one may.
      this.preview = job.progress!.present;
      void this.#fetch(job, true);
    }
  }

  /** Fetches again what could not be shown. */
  retry(): void {
    Object.assign(this, { message: '', isResult: false });
    this.#changed();
  }

  async #fetch(job: Job, isPreview: boolean): Promise<void> {
    await this.#load(async (signal) => {
      const fetched = await fetchResult(job.id, isPreview, (part) => this.#arrive(part), signal);
      if (fetched.mediaType !== GLB) throw new Error('only GLB files can be shown: download this result');
      this.preview = fetched.preview;
      return fetched.bytes.buffer;
    });
    // The job may have ended meanwhile: then its result comes next.
    if (isPreview) this.message = '';
    if (this.job === job.id && this.file && !this.message) {
      this.#announce(isPreview ? `Preview ${this.preview} of ${job.name} is shown` : `${job.name} is shown`);
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
      if (!file.spreads.irradiance) throw new Error('this file has no baked light: bake it first');
      this.viewer ??= this.#newViewer(Viewer);
      const isSameScene = this.file !== undefined;
      this.file = file;
      // Previews keep one exposure, so that the light grows; a result has its own.
      this.viewer.show(file, isSameScene, this.preview > 0n);
      this.message = '';
      // The light under the mark may have changed.
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
      throw new Error('the viewer needs WebGL 2, which this browser lacks: download the file');
    }
  }

  #inWords({ values }: Reading): string {
    const value = values.irradiance?.luminance;
    return value === undefined ? 'no baked light' : `${value.toPrecision(3)} ${this.file!.unit}`;
  }

  #arrive(part: number): void {
    this.arriving = part;
    this.#changed();
  }

  /** Applies the settings to the viewer. */
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
