// The form of options.

import { html, type TemplateResult } from 'lit-html';
import { fromJson, type JsonObject } from '@bufbuild/protobuf';
import { SubmitSceneHeaderSchema, type SubmitSceneHeader } from '../messages/radiosity/v1/radiosity_pb';
import type { Option } from '../service/options';

/** Fractions are shown in percent. */
const scale = ({ kind }: Option): number => (kind === 'fraction' ? 100 : 1);

const nameOf = ({ path }: Option): string => path.split('.').pop()!;

/** A field for each option. */
export function optionsForm(options: Option[]): TemplateResult {
  return html`<form id="options" @submit=${(event: Event) => event.preventDefault()}>
    ${options.map((option) => {
      const unit = option.kind === 'fraction' ? '%' : option.unit;
      return html`<label title=${option.help}>${option.label}${unit && `, ${unit}`} ${field(option)}</label>`;
    })}
  </form>`;
}

function field(option: Option): TemplateResult {
  const name = nameOf(option);
  if (option.choices) {
    return html`<select name=${name}>
      <option value="">${option.default}</option>
      ${option.choices.map(({ value, label }) => html`<option value=${value}>${label}</option>`)}
    </select>`;
  }
  const [least, most] = (option.range ?? [-Infinity, Infinity]).map((bound) => bound * scale(option));
  // What no number of JavaScript holds exactly is no limit that a form could check.
  const bound = (value: number): string => (Math.abs(value) <= Number.MAX_SAFE_INTEGER ? String(value) : '');
  return html`<input name=${name} type="number" min=${bound(least!)} max=${bound(most!)}
    step=${option.kind === 'whole' ? '1' : 'any'} placeholder=${option.default} />`;
}

/** The submission that the form asks for. */
export function wanted(options: Option[]): SubmitSceneHeader {
  const form = document.querySelector<HTMLFormElement>('#options');
  const values = form ? new FormData(form) : new FormData();
  const header: JsonObject = {};
  for (const option of options) {
    const text = String(values.get(nameOf(option)) ?? '');
    if (text === '') continue;
    const number = Number(text) / scale(option);
    const [message, name] = option.path.includes('.') ? option.path.split('.') : [undefined, option.path];
    const part = message === undefined ? header : ((header[message] ??= {}) as JsonObject);
    part[name!] = option.kind === 'whole' ? Math.trunc(number) : number;
  }
  return fromJson(SubmitSceneHeaderSchema, header);
}
