// A page in a headless browser. It is served from loopback, with three.js beside it.
import { createServer } from 'node:http';
import { readFile } from 'node:fs/promises';
import path from 'node:path';
import { chromium } from 'playwright-core';
import { LAUNCH } from '../chromium.mjs';

const packages = path.join(import.meta.dirname, 'node_modules');

/**
 * Opens '/' of `sources` (by path: a type and how it is read), waits for the global function `ready`, and hands the page to `use`.
 */
export async function onPage(sources, ready, use) {
  const server = createServer(async (request, response) => {
    const { pathname } = new URL(request.url, 'http://localhost');
    const library = pathname.startsWith('/three/') && path.join(packages, path.normalize(pathname));
    const source = library ? { type: 'text/javascript', read: () => readFile(library) } : sources.get(pathname);
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
