// The plugin of coordinator/three in a headless browser: baked light is added to the light of a lamp, as albedo x E / pi, and so is
// that of light probes where there is no other.
//   node baked.mjs
// CHROMIUM names the browser; /usr/bin/chromium where it is not set. The plugin must be built.
import { readFile } from 'node:fs/promises';
import path from 'node:path';
import { BRIGHT, DARK, ktx2 } from './ktx2.mjs';
import { IMPORTS, onPage } from './served.mjs';

// Largest relative difference from what is expected.
const TOLERANCE = 0.01;

const here = import.meta.dirname;
const PAGE = `<!doctype html><link rel="icon" href="data:,">${IMPORTS}
<script type="module" src="/baked.js"></script>`;
const script = (file) => ({ type: 'text/javascript', read: () => readFile(path.join(here, file)) });
// The files that the page asked for.
const asked = new Set();
const file = (name, content) => [
  `/${name}`,
  {
    type: 'image/ktx2',
    read: () => {
      asked.add(name);
      return content();
    },
  },
];
const sources = new Map([
  ['/', { type: 'text/html', read: () => PAGE }],
  ['/baked.js', script('baked.js')],
  ['/ktx2.mjs', script('ktx2.mjs')],
  // A light group follows.
  file('whole%20%231.ktx2', () => ktx2([4, 4], [[BRIGHT], [DARK]])),
  // Bright above on the left; the right edge ends within a block.
  file('corner.ktx2', () => ktx2([6, 8], [[BRIGHT, DARK, DARK, DARK]])),
  file('cut.ktx2', () => ktx2([6, 8], [[BRIGHT, DARK, DARK, DARK]]).subarray(0, 150)),
  file('missing.ktx2', () => {
    throw new Error('missing');
  }),
]);

await onPage(sources, 'measure', async (page) => {
  const found = await page.evaluate(() => globalThis.measure());
  for (const { name, shown, direct, expected } of found) {
    const off = Math.max(...shown.map((value, i) => Math.abs(value / (direct[i] + expected[i]) - 1)));
    const isLit = expected.every((value) => value > 0);
    console.log(`${name}: ${shown.map((value) => value.toFixed(4))}, off by ${(100 * off).toFixed(2)} %`);
    if (!(off <= TOLERANCE) || !isLit) process.exitCode = 1;
  }
  if (found.length === 0) process.exitCode = 1;
  if (asked.size !== 4) {
    console.error(`the plugin asked only for ${[...asked]}`);
    process.exitCode = 1;
  }
});
