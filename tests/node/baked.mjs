// The plugin of coordinator/three in a headless browser: baked light is added to the light of a lamp, as albedo x E / pi, and so is
// that of light probes where there is no other.
//   node baked.mjs
// CHROMIUM names the browser; /usr/bin/chromium where it is not set. The plugin must be built.
import { readFile } from 'node:fs/promises';
import path from 'node:path';
import { BRIGHT, DARK, ktx2 } from './ktx2.mjs';
import { onPage } from './served.mjs';

// Largest relative difference from what is expected.
const TOLERANCE = 0.01;

const here = import.meta.dirname;
const PAGE = `<!doctype html><link rel="icon" href="data:,"><script type="importmap">
{"imports": {"three": "/three/build/three.module.js", "three/addons/": "/three/examples/jsm/", "halflight-three": "/plugin.js"}}
</script><script type="module" src="/baked.js"></script>`;
const script = (file) => ({ type: 'text/javascript', read: () => readFile(path.join(here, file)) });
const page = (size, ...layers) => ({ type: 'image/ktx2', read: () => ktx2(size, layers) });
const sources = new Map([
  ['/', { type: 'text/html', read: () => PAGE }],
  ['/baked.js', script('baked.js')],
  ['/ktx2.mjs', script('ktx2.mjs')],
  // A light group follows.
  ['/whole.ktx2', page([4, 4], [BRIGHT], [DARK])],
  // Bright above on the left; the right edge ends within a block.
  ['/corner.ktx2', page([6, 8], [BRIGHT, DARK, DARK, DARK])],
  ['/plugin.js', script('../../coordinator/three/dist/index.js')],
  ['/pages.js', script('../../coordinator/three/dist/pages.js')],
  ['/probes.js', script('../../coordinator/three/dist/probes.js')],
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
});
