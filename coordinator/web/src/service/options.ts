// The options that the form offers, as the service declares them.

import { BASE_URL } from './client';

/** One option. */
export interface Option {
  /** Field of the submission, such as `bake.error`. */
  path: string;
  label: string;
  help: string;
  unit: string;
  /** What holds where nothing is chosen, in words. */
  default: string;
  kind: 'number' | 'fraction' | 'whole' | 'choice';
  range: [number, number] | null;
  choices: { value: number; label: string }[] | null;
}

/** Fetches the options. */
export async function fetchOptions(): Promise<Option[]> {
  const response = await fetch(`${BASE_URL}/options.json`);
  if (!response.ok) throw new Error(`the service has no options (${response.status})`);
  return (await response.json()) as Option[];
}
