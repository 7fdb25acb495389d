// The scale of false colours, as a drawing: its parts are placed by attributes, which the content security policy allows.

import { svg, type SVGTemplateResult } from 'lit-html';
import { scaleLinear, scaleLog } from 'd3-scale';
import { interpolateViridis } from 'd3-scale-chromatic';
import { digits } from './format';
import type { Scale } from './scene';

const WIDTH = 280;
const BAR = 14;
const MARGIN = 18;
const STOPS = 16;
// Ticks that are nearer than this would write over each other.
const TICK_ROOM = 42;

/** A bar of colours with ticks, called `title`. */
export function legend({ low, high, isLogarithmic }: Scale, title: string): SVGTemplateResult {
  const range: [number, number] = [MARGIN, WIDTH - MARGIN];
  const place = isLogarithmic ? scaleLog([low, high], range) : scaleLinear([low, high], range);
  let last = -Infinity;
  const ticks = place.ticks(4).filter((value) => {
    const fits = (!isLogarithmic || isRound(value)) && place(value) - last >= TICK_ROOM;
    if (fits) last = place(value);
    return fits;
  });
  const stops = Array.from({ length: STOPS + 1 }, (_, i) => i / STOPS);
  return svg`<svg class="legend" viewBox="0 0 ${WIDTH} 56" role="img"
      aria-label="${title}: colours from ${digits(low, 3)} to ${digits(high, 3)}">
    <defs><linearGradient id="scale">
      ${stops.map((stop) => svg`<stop offset=${stop} stop-color=${interpolateViridis(stop)}></stop>`)}
    </linearGradient></defs>
    <text x=${MARGIN} y="12">${title}</text>
    <rect x=${MARGIN} y="19" width=${WIDTH - 2 * MARGIN} height=${BAR} rx="2" fill="url(#scale)"></rect>
    ${ticks.map(
      (value) => svg`<line x1=${place(value)} x2=${place(value)} y1="33" y2="37"></line>
        <text x=${place(value)} y="49" text-anchor="middle">${digits(value, 3)}</text>`,
    )}
  </svg>`;
}

/** 1, 2 or 5 times a power of ten. */
function isRound(value: number): boolean {
  return ['1', '2', '5'].includes(value.toExponential(0)[0]!);
}
