// The viewer with its overlays and controls.

import { html, nothing, type TemplateResult } from 'lit-html';
import { live } from 'lit-html/directives/live.js';
import { ref } from 'lit-html/directives/ref.js';
import { State, type Job } from '../messages/radiosity/v1/radiosity_pb';
import { count, digits } from './format';
import { metrics, progressBar } from './jobs_view';
import { legend } from './legend';
import type { Reading } from '../viewer/probe';
import type { SceneState } from './scene';

const STEPS = 10;
const SHOWN = { lit: 'Lit', irradiance: 'Irradiance', unshot: 'Unshot' } as const;
const MOTIONS = { orbit: 'Orbit', walk: 'Walk' } as const;

/** The open scene, and its job. */
export function sceneView(scene: SceneState, job: Job | undefined): TemplateResult {
  return html`
    <section class="scene" aria-label="Viewer" 
      data-file=${scene.file ? (scene.preview > 0n ? 'preview' : 'whole') : 'none'} data-preview=${scene.preview}>
      <div class="stage">
        <canvas
          tabindex="0"
          role="application"
          aria-label=${scene.file ? `View of ${scene.title}` : 'View: no scene yet'}
          aria-describedby="keys"
          ${ref((canvas) => scene.attach(canvas))}
        ></canvas>
        <div class="over top">
          <a class="back" href="#/">Jobs</a>
          <h2>${scene.title || 'No scene'}</h2>
          ${job ? html`<div class="now">${progressBar(job)}${metrics(job)}</div>` : nothing}
        </div>
        ${notice(scene, job)} ${scene.readingAt ? mark(scene.readingAt) : nothing}
        <div class="low">
          ${scene.file && scene.reading ? readingBox(scene.reading, scene.file.unit) : nothing}
          ${scene.file && scene.shown !== 'lit' ? html`<div class="over bottom">${legend(scene.scale, titleOf(scene))}</div>` : nothing}
        </div>
      </div>
      ${controls(scene)}
    </section>
  `;
}

function titleOf({ shown, file }: SceneState): string {
  return shown === 'unshot' ? `Unshot radiosity, ${file!.unit}` : `Irradiance, ${file!.unit}`;
}

function notice(scene: SceneState, job: Job | undefined): TemplateResult | typeof nothing {
  const box = (text: string, part?: number): TemplateResult => html`<div class="over notice">
    <p>${text}</p>
    ${scene.message && scene.job ? html`<button type="button" @click=${() => scene.retry()}>Try again</button>` : nothing}
    ${part === undefined ? nothing : html`<progress aria-label="Loading the file" .value=${part}></progress>`}
  </div>`;
  if (scene.message) return box(scene.message);
  if (scene.file) return nothing;
  if (scene.arriving !== undefined) return box('Loading the scene', scene.arriving);
  if (job?.state === State.QUEUED) return box('The job is queued');
  if (job?.state === State.RUNNING) return box('The light appears here while the job runs');
  if (job?.state === State.FAILED || job?.state === State.CANCELLED) return box('This job has no lit file');
  return box('Drop a scene anywhere to bake it, or choose a job');
}

// Placed by SVG attributes: the content security policy forbids inline styles.
function mark({ x, y }: NonNullable<SceneState['readingAt']>): TemplateResult {
  const point = `M${100 * x} ${100 * y}h0`;
  return html`<svg class="mark" viewBox="0 0 100 100" preserveAspectRatio="none" aria-hidden="true">
    <path class="rim" d=${point}></path>
    <path class="dot" d=${point}></path>
  </svg>`;
}

function readingBox({ name, point, values }: Reading, unit: string): TemplateResult {
  const rows = Object.entries(values).map(
    ([quantity, { rgb, luminance }]) => html`
      <dt>${quantity === 'unshot' ? 'Unshot' : 'Irradiance'}</dt>
      <dd><strong>${digits(luminance)}</strong> ${unit}</dd>
      <dt>red, green, blue</dt>
      <dd>${rgb.map((value) => digits(value)).join(', ')}</dd>
    `,
  );
  return html`<div class="over reading">
    <h3>${name || 'Unnamed surface'}</h3>
    ${rows.length ? nothing : html`<p>No baked light</p>`}
    <dl>
      ${rows}
      <dt>at</dt>
      <dd>${point.toArray().map((value) => digits(value)).join(', ')}</dd>
    </dl>
  </div>`;
}

function controls(scene: SceneState): TemplateResult {
  const change = (values: Partial<SceneState>): void => {
    Object.assign(scene, values);
    scene.apply();
  };
  return html`
    <form class="controls" aria-label="Display options" @submit=${(event: Event) => event.preventDefault()}>
      <fieldset class="choice" ?disabled=${!scene.file}>
        <legend>Show</legend>
        ${choices('shown', SHOWN, scene.shown, (shown) => change({ shown }), (shown) => shown !== 'unshot' || !!scene.file?.spreads.unshot)}
      </fieldset>
      ${scene.shown === 'lit' ? exposure(scene, change) : scaleEnds(scene, change)}
      <label class="check">
        <input type="checkbox" ?disabled=${!scene.file} .checked=${live(scene.hasMesh)}
          @change=${(event: Event) => change({ hasMesh: (event.target as HTMLInputElement).checked })} />
        Mesh
      </label>
      <fieldset class="choice" ?disabled=${!scene.file}>
        <legend>Move</legend>
        ${choices('motion', MOTIONS, scene.motion, (motion) => change({ motion }))}
      </fieldset>
      <fieldset class="views" ?disabled=${!scene.file}>
        <legend>View</legend>
        <button type="button" @click=${() => scene.viewer?.overview()}>Whole scene</button>
        ${scene.file?.cameras.map(
          ({ name }, i) => html`<button type="button" @click=${() => scene.viewer?.lookThrough(i)}>${name}</button>`,
        )}
      </fieldset>
      <details>
        <summary>Keys and gestures</summary>
        <p id="keys">
          ${scene.motion === 'walk'
            ? 'Arrow keys or W A S D walk, Q and E move down and up, Shift runs. Drag or use one finger to look around, two fingers to move.'
            : 'Arrow keys orbit, plus and minus zoom. Drag or use one finger to orbit; use the wheel or two fingers to zoom and pan.'}
          Click or tap to measure the light at a point; press P or Enter to measure in the middle.
        </p>
      </details>
      ${scene.file ? html`<p class="fine">${count(scene.file.triangles)} triangles</p>` : nothing}
    </form>
  `;
}

function choices<K extends string>(
  name: string,
  all: Readonly<Record<K, string>>,
  chosen: K,
  choose: (key: K) => void,
  isThere: (key: K) => boolean = () => true,
): TemplateResult[] {
  return (Object.keys(all) as K[]).filter(isThere).map(
    (key) => html`<label>
      <input type="radio" name=${name} value=${key} .checked=${live(chosen === key)} @change=${() => choose(key)} />
      <span>${all[key]}</span>
    </label>`,
  );
}

type Change = (values: Partial<SceneState>) => void;

function exposure(scene: SceneState, change: Change): TemplateResult {
  const factor = 2 ** scene.exposure;
  return html`
    <div class="field">
      <label for="exposure">Exposure</label>
      <output for="exposure">× ${digits(factor, 3)}</output>
      <button type="button" aria-label="Reset exposure" ?disabled=${scene.exposure === 0} @click=${() => change({ exposure: 0 })}>Reset</button>
      <input id="exposure" type="range" min=${-STEPS} max=${STEPS} step="0.1" ?disabled=${!scene.file} .value=${live(String(scene.exposure))}
        aria-valuetext=${`times ${digits(factor, 3)}`}
        @input=${(event: Event) => change({ exposure: (event.target as HTMLInputElement).valueAsNumber })} />
    </div>
    <div class="row">
      <label for="tone">Highlights</label>
      <select id="tone" ?disabled=${!scene.file}
        @change=${(event: Event) => change({ toneMap: (event.target as HTMLSelectElement).value as SceneState['toneMap'] })}>
        <option value="linear" ?selected=${scene.toneMap === 'linear'}>Clipped</option>
        <option value="neutral" ?selected=${scene.toneMap === 'neutral'}>Compressed</option>
      </select>
    </div>
  `;
}

function scaleEnds(scene: SceneState, change: Change): TemplateResult {
  const { scale } = scene;
  const set = (values: Partial<typeof scale>): void => {
    const next = { ...scale, isAutomatic: false, ...values };
    // Ignores ends that are not a valid scale yet.
    if (next.high > next.low && next.low > (next.isLogarithmic ? 0 : -Infinity)) change({ scale: next });
  };
  const end = (name: 'low' | 'high', label: string): TemplateResult => html`
    <div class="field end">
      <label for=${name}>${label}</label>
      <input id=${name} type="number" step="any" .value=${live(digits(scale[name]))}
        @change=${(event: Event) => set({ [name]: (event.target as HTMLInputElement).valueAsNumber })} />
    </div>
  `;
  return html`
    <div class="ends">${end('low', 'From')} ${end('high', 'To')}</div>
    <div class="row">
      <label class="check">
        <input type="checkbox" .checked=${live(scale.isLogarithmic)}
          @change=${(event: Event) => set({ isLogarithmic: (event.target as HTMLInputElement).checked, isAutomatic: scale.isAutomatic })} />
        Logarithmic
      </label>
      <button type="button" ?disabled=${scale.isAutomatic} @click=${() => change({ scale: { ...scale, isAutomatic: true } })}>Fit</button>
    </div>
  `;
}

