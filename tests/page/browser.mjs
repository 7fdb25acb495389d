// A headless browser that tells what is wrong with a page.
import assert from 'node:assert/strict';
import { readFile } from 'node:fs/promises';
import { createRequire } from 'node:module';
import path from 'node:path';
import { chromium } from 'playwright-core';
import { LAUNCH } from '../chromium.mjs';

const axe = await readFile(createRequire(import.meta.url).resolve('axe-core/axe.min.js'), 'utf8');

export function startBrowser() {
  return chromium.launch(LAUNCH);
}

/** Opens the page; `faults` gathers errors, violations of the policy, and requests that leave the origin. */
export async function openPage(browser, origin, settings = {}) {
  const context = await browser.newContext({ viewport: { width: 1280, height: 800 }, ...settings });
  const page = await context.newPage();
  page.setDefaultTimeout(60_000);
  const faults = [];
  page.on('console', (message) => message.type() === 'error' && faults.push(message.text()));
  page.on('pageerror', (error) => faults.push(error.message));
  page.on('request', (request) => {
    if (!request.url().startsWith(origin) && !request.url().startsWith('blob:')) faults.push(`left: ${request.url()}`);
  });
  page.on('dialog', (dialog) => dialog.accept());
  const answer = await page.goto(origin);
  assert.match(answer.headers()['content-security-policy'], /^default-src 'none'; script-src 'self';/);
  assert.equal(await page.locator('#page').count(), 1, 'the program has the plain page: build it with HALFLIGHT_PAGE=required');
  return { page, faults, close: () => context.close() };
}

/** Lets files fall onto the page. */
export async function drop(page, ...files) {
  const dropped = await Promise.all(
    files.map(async (file) => ({ name: path.basename(file), base64: (await readFile(file)).toString('base64') })),
  );
  const transfer = await page.evaluateHandle((dropped) => {
    const transfer = new DataTransfer();
    for (const { name, base64 } of dropped) {
      const bytes = Uint8Array.from(atob(base64), (character) => character.charCodeAt(0));
      transfer.items.add(new File([bytes], name));
    }
    return transfer;
  }, dropped);
  await page.dispatchEvent('.drop', 'dragover', { dataTransfer: transfer });
  await page.dispatchEvent('.drop', 'drop', { dataTransfer: transfer });
}

/** The middle of the picture, RGBA by rows, without what stands over it: half of its width and a third of its height. */
export async function middle(page) {
  // What was asked for last has been drawn then.
  await page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))));
  const { x, y, width, height } = await page.locator('canvas').boundingBox();
  const clip = { x: x + width / 4, y: y + height / 3, width: width / 2, height: height / 3 };
  const png = await page.screenshot({ clip });
  // Decoded where the page's policy is not in the way.
  const other = await page.context().newPage();
  try {
    const pixels = await other.evaluate(async (base64) => {
      const bytes = Uint8Array.from(atob(base64), (character) => character.charCodeAt(0));
      const image = await createImageBitmap(new Blob([bytes]));
      const canvas = new OffscreenCanvas(image.width, image.height).getContext('2d');
      canvas.drawImage(image, 0, 0);
      const { data } = canvas.getImageData(0, 0, image.width, image.height);
      let binary = '';
      for (const value of data) binary += String.fromCharCode(value);
      return btoa(binary);
    }, png.toString('base64'));
    return Buffer.from(pixels, 'base64');
  } finally {
    await other.close();
  }
}

/** Mean of red, green and blue over a picture, 0 to 255. */
export function brightness(picture) {
  let sum = 0;
  for (let i = 0; i < picture.length; i += 4) sum += picture[i] + picture[i + 1] + picture[i + 2];
  return sum / (0.75 * picture.length);
}

/** Part of the pixels that differ visibly between two pictures of one size. */
export function difference(a, b) {
  let different = 0;
  for (let i = 0; i < a.length; i += 4) {
    if ([0, 1, 2].some((channel) => Math.abs(a[i + channel] - b[i + channel]) > 8)) different++;
  }
  return (4 * different) / a.length;
}

/** What hinders people of whom the page should be usable too, by the rules of axe. */
export async function barriers(page) {
  await page.evaluate(axe);
  const { violations } = await page.evaluate(() => globalThis.axe.run());
  return violations.map(({ id, nodes }) => `${id}: ${nodes.map(({ html }) => html.slice(0, 200)).join(' | ')}`);
}

/** How far the page is wider than the window. */
export function overflow(page) {
  return page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
}
