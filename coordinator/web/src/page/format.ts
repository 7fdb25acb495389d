// Numbers and states in words.

import type { Duration, Timestamp } from '@bufbuild/protobuf/wkt';
import { timestampDate } from '@bufbuild/protobuf/wkt';
import { Phase, State } from '../messages/radiosity/v1/radiosity_pb';

const COUNT = new Intl.NumberFormat('en', { maximumFractionDigits: 0 });
const SHORT = new Intl.NumberFormat('en', { notation: 'compact', maximumSignificantDigits: 3 });
const AGO = new Intl.RelativeTimeFormat('en', { numeric: 'auto' });

export const STATES: Record<State, string> = {
  [State.UNSPECIFIED]: 'unknown',
  [State.QUEUED]: 'queued',
  [State.RUNNING]: 'running',
  [State.DONE]: 'done',
  [State.FAILED]: 'failed',
  [State.CANCELLED]: 'cancelled',
};

export const PHASES: Record<Phase, string> = {
  [Phase.UNSPECIFIED]: 'starting',
  [Phase.IMPORT]: 'reading the scene',
  [Phase.LIGHT]: 'direct light',
  [Phase.SHOOT]: 'shooting',
  [Phase.REFINE]: 'refining the mesh',
  [Phase.MEASURE]: 'measuring the error',
  [Phase.FINAL_SOLVE]: 'final solve',
  [Phase.GROUPS]: 'light groups',
  [Phase.LIGHTMAP]: 'lightmap',
  [Phase.PROBES]: 'probes',
  [Phase.EXPORT_MESH]: 'making the mesh of the file',
  [Phase.EXPORT]: 'writing the file',
};

/** 12,345 */
export function count(value: number | bigint): string {
  return COUNT.format(value);
}

/** 12.3K */
export function short(value: number | bigint): string {
  return SHORT.format(value);
}

/** Four digits that matter, whatever the size: 0.001234, 12.34, 1.234e+7. */
export function digits(value: number, significant = 4): string {
  if (value === 0) return '0';
  const size = Math.abs(value);
  if (size >= 1e6 || size < 1e-4) return value.toExponential(significant - 1);
  return String(Number(value.toPrecision(significant)));
}

/** 1.2 % */
export function percent(part: number): string {
  return `${digits(100 * part, 2)} %`;
}

/** 3.4 MB */
export function bytes(length: number | bigint): string {
  const [size, unit] = [Number(length), ['B', 'kB', 'MB', 'GB', 'TB']];
  const power = size < 1000 ? 0 : Math.min(Math.floor(Math.log10(size) / 3), unit.length - 1);
  return `${digits(size / 1000 ** power, 3)} ${unit[power]}`;
}

/** 1 h 5 min */
export function duration({ seconds, nanos }: Duration): string {
  const exact = Number(seconds) + nanos / 1e9;
  if (exact < 10) return `${digits(exact, 2)} s`;
  const whole = Math.round(exact);
  if (whole < 60) return `${whole} s`;
  if (whole < 3600) return `${Math.floor(whole / 60)} min ${whole % 60} s`;
  return `${Math.floor(whole / 3600)} h ${Math.floor((whole % 3600) / 60)} min`;
}

/** 5 minutes ago */
export function ago(time: Timestamp): string {
  const minutes = (timestampDate(time).getTime() - Date.now()) / 60_000;
  if (minutes > -1) return 'just now';
  if (minutes > -60) return AGO.format(Math.round(minutes), 'minute');
  if (minutes > -60 * 24) return AGO.format(Math.round(minutes / 60), 'hour');
  return AGO.format(Math.round(minutes / 60 / 24), 'day');
}
