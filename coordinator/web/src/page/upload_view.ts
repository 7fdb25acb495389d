// Uploads of scenes.

import { html, nothing, type TemplateResult } from 'lit-html';
import { repeat } from 'lit-html/directives/repeat.js';
import type { Option } from '../service/options';
import { optionsForm } from './options_form';

/** A file that is being uploaded. */
export interface Upload {
  /** Idempotency key of the submission. */
  key: string;
  name: string;
  step: 'reading' | 'sending' | 'failed';
  part: number;
  failure: string;
  stop: AbortController;
}

/** Actions on files. */
export interface UploadActions {
  bake(files: Iterable<File>): void;
  view(file: File): void;
  dismiss(upload: Upload): void;
}

const STEPS = { reading: 'reading', sending: 'uploading', failed: 'failed' };

/** The drop zone, the options of a bake, and uploads in progress. */
export function uploadView(options: Option[], uploads: Upload[], isOver: boolean, actions: UploadActions): TemplateResult {
  return html`
    <section class="upload" aria-labelledby="upload">
      <h2 id="upload">Bake a scene</h2>
      <div class="drop" ?data-over=${isOver}>
        <p>Drop a <code>.glb</code> or a self-contained <code>.gltf</code> here.</p>
        ${picker('Choose a file', 'bake', true, (files) => actions.bake(files))}
      </div>
      <details class="options">
        <summary>Quality</summary>
        ${optionsForm(options)}
      </details>
      ${picker('View a lit file', 'view', false, ([file]) => file && actions.view(file))}
      ${uploads.length
        ? html`<ul class="uploads">${repeat(uploads, ({ key }) => key, (upload) => uploadItem(upload, actions))}</ul>`
        : nothing}
    </section>
  `;
}

function uploadItem(upload: Upload, actions: UploadActions): TemplateResult {
  const failed = upload.step === 'failed';
  return html`<li>
    <div class="line"><span>${upload.name}</span> <span class="state">${STEPS[upload.step]}</span></div>
    ${failed
      ? html`<p class="failure" role="alert">${upload.failure}</p>`
      : html`<progress aria-label="Uploading ${upload.name}" max="1" value=${upload.part}></progress>`}
    <div class="actions"><button type="button" @click=${() => actions.dismiss(upload)}>${failed ? 'Dismiss' : 'Cancel'}</button></div>
  </li>`;
}

function picker(label: string, name: string, multiple: boolean, chosen: (files: File[]) => void): TemplateResult {
  return html`<label class="picker">
    <span>${label}</span>
    <input type="file" name=${name} accept=".glb,.gltf,model/gltf-binary,model/gltf+json" ?multiple=${multiple}
      @change=${(event: Event) => {
        const input = event.target as HTMLInputElement;
        const files = [...(input.files ?? [])];
        input.value = ''; // The same file may be chosen again.
        chosen(files);
      }} />
  </label>`;
}
