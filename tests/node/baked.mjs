// The plugin of coordinator/three in a headless browser: baked light is added to the light of a lamp, as albedo x E / pi.
//   node baked.mjs
// CHROMIUM names the browser; /usr/bin/chromium where it is not set. The plugin must be built.
import { createServer } from 'node:http';
import { readFile } from 'node:fs/promises';
import path from 'node:path';
import { chromium } from 'playwright-core';
import { LAUNCH } from '../chromium.mjs';

// Largest relative difference from what is expected.
const TOLERANCE = 0.01;

const here = import.meta.dirname;
const PAGE = `<!doctype html><link rel="icon" href="data:,"><script type="importmap">
{"imports": {"three": "/three/build/three.module.js", "three/addons/": "/three/examples/jsm/", "halflight-three": "/plugin.js"}}
</script><script type="module" src="/baked.js"></script>`;
const files = new Map([
  ['/baked.js', path.join(here, 'baked.js')],
  ['/plugin.js', path.join(here, '../../coordinator/three/dist/index.js')],
]);
const server = createServer(async (request, response) => {
  const { pathname } = new URL(request.url, 'http://localhost');
  const library = pathname.startsWith('/three/') && path.join(here, 'node_modules', path.normalize(pathname));
  try {
    const isPage = pathname === '/';
    const body = isPage ? PAGE : await readFile(library || files.get(pathname));
    response.writeHead(200, { 'content-type': isPage ? 'text/html' : 'text/javascript' }).end(body);
  } catch {
    response.writeHead(404).end();
  }
});
await new Promise((resolve) => server.listen(0, '127.0.0.1', resolve));
const browser = await chromium.launch(LAUNCH);
try {
  const page = await browser.newPage();
  page.on('console', (message) => console.error(`page: ${message.text()}`));
  page.on('pageerror', (error) => console.error(`page: ${error.message}`));
  await page.goto(`http://127.0.0.1:${server.address().port}/`);
  await page.waitForFunction(() => globalThis.measure, { timeout: 30_000 });
  const found = await page.evaluate(() => globalThis.measure());
  for (const { name, shown, direct, expected } of found) {
    const off = Math.max(...shown.map((value, i) => Math.abs(value / (direct[i] + expected[i]) - 1)));
    const isLit = direct.every((value) => value > 0) && expected.every((value) => value > 0);
    console.log(`${name}: ${shown.map((value) => value.toFixed(4))}, off by ${(100 * off).toFixed(2)} %`);
    if (!(off <= TOLERANCE) || !isLit) process.exitCode = 1;
  }
  if (found.length === 0) process.exitCode = 1;
} finally {
  await browser.close();
  server.close();
}
