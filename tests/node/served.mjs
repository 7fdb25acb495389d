// A page in a headless browser. It is served from loopback, with three.js and the built plugin of coordinator/three beside it.
import { createServer } from 'node:http';
import { readFile } from 'node:fs/promises';
import path from 'node:path';
import { chromium } from 'playwright-core';
import { LAUNCH } from '../chromium.mjs';

const FOLDERS = new Map([
  ['/three/', path.join(import.meta.dirname, 'node_modules/three')],
  ['/plugin/', path.join(import.meta.dirname, '../../coordinator/three/dist')],
]);

/** Where a page finds both. */
export const IMPORTS = `<script type="importmap">{"imports": {
"three": "/three/build/three.module.js", "three/addons/": "/three/examples/jsm/", "halflight-three": "/plugin/index.js"}}</script>`;

/** A script out of these folders. */
function library(pathname) {
  const prefix = [...FOLDERS.keys()].find((prefix) => pathname.startsWith(prefix));
  if (!prefix) return undefined;
  const file = path.join(FOLDERS.get(prefix), path.normalize(pathname.slice(prefix.length - 1)));
  return { type: 'text/javascript', read: () => readFile(file) };
}

/**
 * Opens '/' of `sources` (by path: a type and how it is read), waits for the global function `ready`, and hands the page to `use`.
 */
export async function onPage(sources, ready, use) {
  const server = createServer(async (request, response) => {
    const { pathname } = new URL(request.url, 'http://localhost');
    const source = library(pathname) ?? sources.get(pathname);
    try {
      const body = await source.read();
      response.writeHead(200, { 'content-type': source.type }).end(body);
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
    await page.waitForFunction((name) => globalThis[name], ready, { timeout: 30_000 });
    await use(page);
  } finally {
    await browser.close();
    server.close();
  }
}
