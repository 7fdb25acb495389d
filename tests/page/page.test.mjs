// The page of the service in a headless browser, with the real service behind it: node --test
import assert from 'node:assert/strict';
import { mkdtemp, rm, writeFile } from 'node:fs/promises';
import { tmpdir } from 'node:os';
import path from 'node:path';
import { after, before, test } from 'node:test';
import { barriers, brightness, difference, drop, middle, openPage, overflow, startBrowser } from './browser.mjs';
import { scene, startService } from './service.mjs';

const PHONE = { viewport: { width: 360, height: 740 }, isMobile: true, hasTouch: true, deviceScaleFactor: 2 };
// A job that would take far longer than a test.
const LONG = { file: 'table', error: '0.02' };

let browser;
let service;
before(async () => {
  // Where there is no service, no browser is left behind.
  service = await startService();
  browser = await startBrowser();
});
after(async () => {
  await browser?.close();
  await service?.end();
});

const item = (page, name, state) => page.locator(`.job[data-state=${state}]`, { hasText: name }).first();
const whole = (page) => page.waitForSelector('.scene[data-file=whole]');

// Opens the page and looks at a job of cornell; the service bakes it once.
async function openCornell(settings) {
  const opened = await openPage(browser, service.origin, settings);
  await opened.page.setInputFiles('input[name=bake]', scene('cornell'));
  await whole(opened.page);
  return opened;
}

async function bakeLong(page) {
  await page.locator('.options summary').click();
  await page.fill('input[name=error]', LONG.error);
  await page.setInputFiles('input[name=bake]', scene(LONG.file));
}

test('a dropped scene is baked, and its light is shown', async () => {
  const { page, faults, close } = await openPage(browser, service.origin);
  const empty = await middle(page);
  await drop(page, scene('cornell'));
  await item(page, 'cornell', 'done').waitFor();
  await whole(page);
  const picture = await middle(page);
  assert.ok(brightness(picture) > 40, `${brightness(picture)}`);
  assert.ok(difference(picture, empty) > 0.5);
  assert.match(await page.locator('.job .metrics').first().textContent(), /MB|kB/);
  assert.deepEqual(faults, []);
  await close();
});

test('the light of a compressed scene is shown, which stays compressed', async () => {
  const { page, faults, close } = await openPage(browser, service.origin);
  const empty = await middle(page);
  await page.setInputFiles('input[name=bake]', path.join(scene('cornell'), '../../fixtures/compressed/meshopt_filtered.glb'));
  await item(page, 'meshopt_filtered', 'done').waitFor();
  await whole(page);
  assert.ok(difference(await middle(page), empty) > 0.1);
  assert.deepEqual(faults, []);
  await close();
});

test('a scene that the service has is not uploaded again', async () => {
  const { page, faults, close } = await openPage(browser, service.origin);
  const lengths = [];
  page.on('request', (request) => {
    if (request.url().endsWith('/SubmitScene')) lengths.push(request.postDataBuffer()?.length ?? 0);
  });
  await page.setInputFiles('input[name=bake]', scene('cornell'));
  await whole(page);
  assert.equal(lengths.length, 1);
  assert.ok(lengths[0] < 1000, `${lengths[0]} bytes`);
  assert.deepEqual(faults, []);
  await close();
});

test('exposure, false colours and mesh change the picture', async () => {
  const { page, faults, close } = await openCornell();
  const asBaked = await middle(page);
  await page.locator('#exposure').fill('-3');
  const darker = await middle(page);
  assert.ok(brightness(darker) < 0.6 * brightness(asBaked), `${brightness(darker)} of ${brightness(asBaked)}`);
  await page.locator('#exposure').fill('3');
  assert.ok(brightness(await middle(page)) > 1.3 * brightness(asBaked));
  await page.getByRole('button', { name: 'Reset exposure' }).click();
  assert.equal(difference(await middle(page), asBaked), 0);
  await page.getByLabel('Irradiance').check();
  const falseColours = await middle(page);
  assert.ok(difference(falseColours, asBaked) > 0.5);
  assert.match(await page.locator('.legend').getAttribute('aria-label'), /Irradiance, W\/m²: colours from [\d.]+ to [\d.]+/);
  await page.getByLabel('Logarithmic').uncheck();
  const linear = await middle(page);
  assert.ok(difference(linear, falseColours) > 0.1);
  await page.locator('#high').fill('10');
  await page.locator('#high').blur();
  assert.ok(difference(await middle(page), linear) > 0.5);
  await page.getByRole('button', { name: 'Fit' }).click();
  assert.equal(difference(await middle(page), linear), 0);
  await page.getByRole('checkbox', { name: 'Mesh', exact: true }).check();
  assert.ok(difference(await middle(page), linear) > 0.1);
  assert.deepEqual(faults, []);
  await close();
});

test('a tap measures the light', async () => {
  const { page, faults, close } = await openCornell();
  await page.locator('canvas').click();
  const reading = page.locator('.reading');
  await reading.waitFor();
  // What is measured is what the camera sees now, not what was drawn last: both keys fall between two pictures.
  const at = () => reading.locator('dd').last().textContent();
  const press = (...codes) =>
    page.evaluate((codes) => {
      for (const code of codes) document.querySelector('canvas').dispatchEvent(new KeyboardEvent('keydown', { code, bubbles: true }));
    }, codes);
  await press('ArrowLeft', 'KeyP');
  const turned = await at();
  await middle(page);
  await press('KeyP');
  assert.equal(await at(), turned);
  const text = await reading.textContent();
  assert.match(text, /Irradiance\s*[\d.]+\s*W\/m²/);
  assert.match(text, /red, green, blue/);
  await page.locator('canvas').press('Escape');
  await reading.waitFor({ state: 'detached' });
  assert.deepEqual(faults, []);
  await close();
});

test('a job is seen at work, and can be cancelled and deleted', async () => {
  const { page, faults, close } = await openPage(browser, service.origin);
  const empty = await middle(page);
  await bakeLong(page);
  const running = item(page, LONG.file, 'running');
  await running.waitFor();
  await running.locator('progress[value]').waitFor();
  // Previews appear before it is done.
  await page.waitForSelector('.scene[data-file=preview]');
  const lit = await middle(page);
  assert.ok(difference(lit, empty) > 0.3);
  await page.getByLabel('Unshot').check();
  assert.ok(difference(await middle(page), lit) > 0.3);
  // The next preview appears, and the camera stays.
  const place = async () => {
    await page.locator('canvas').press('p');
    return page.locator('.reading dd').last().textContent();
  };
  await page.locator('canvas').press('ArrowLeft');
  const before = await place();
  const last = Number(await page.getAttribute('.scene', 'data-preview'));
  await page.waitForFunction((last) => Number(document.querySelector('.scene').dataset.preview) > last, last);
  assert.equal(await place(), before);
  assert.equal(await running.count(), 1);
  await running.getByRole('button', { name: `Cancel ${LONG.file}` }).click();
  const cancelled = item(page, LONG.file, 'cancelled');
  await cancelled.waitFor();
  assert.equal(await cancelled.locator('progress').count(), 0);
  await cancelled.getByRole('button', { name: `Delete ${LONG.file}` }).click();
  await cancelled.waitFor({ state: 'detached' });
  assert.deepEqual(faults, []);
  await close();
});

test('a file that is not a scene is refused with a reason', async () => {
  const { page, faults, close } = await openPage(browser, service.origin);
  await page.setInputFiles('input[name=bake]', { name: 'poem.glb', mimeType: 'model/gltf-binary', buffer: Buffer.from('no scene') });
  const failure = page.locator('.job[data-state=failed] .failure, .uploads .failure').first();
  await failure.waitFor();
  assert.ok((await failure.textContent()).length > 10);
  assert.deepEqual(faults, []);
  await close();
});

test('everything can be done by keyboard', async () => {
  const { page, faults, close } = await openCornell();
  const press = async (key, times = 1) => {
    for (let i = 0; i < times; i++) await page.keyboard.press(key);
  };
  // Each stop shows where the focus is, and has a name.
  const stops = [];
  await page.locator('.brand').focus();
  for (let i = 0; i < 60; i++) {
    const stop = await page.evaluate(() => {
      const { activeElement: element } = document;
      const shown = [element, element.parentElement?.querySelector('span')].filter(Boolean);
      return {
        what: `${element.localName} ${element.getAttribute('name') ?? element.id ?? ''} ${element.textContent.trim().slice(0, 20)}`,
        isVisible: shown.some((one) => getComputedStyle(one).outlineStyle !== 'none'),
        isEnd: element === document.body,
      };
    });
    if (stop.isEnd || stops.some(({ what }) => what === stop.what && what.startsWith('canvas'))) break;
    stops.push(stop);
    await press('Tab');
  }
  assert.deepEqual(stops.filter(({ isVisible }) => !isVisible), []);
  for (const wanted of ['input bake', 'a  cornell', 'canvas', 'input shown', 'input exposure', 'input motion', 'button  Whole scene']) {
    assert.ok(stops.some(({ what }) => what.startsWith(wanted)), `${wanted}: ${stops.map(({ what }) => what).join('; ')}`);
  }
  const first = await middle(page);
  await page.locator('canvas').focus();
  await press('ArrowLeft', 6);
  const turned = await middle(page);
  assert.ok(difference(turned, first) > 0.2);
  await press('+', 3);
  assert.ok(difference(await middle(page), turned) > 0.2);
  await page.locator('input[name=motion][value=orbit]').focus();
  await press('ArrowRight');
  assert.ok(await page.locator('input[name=motion][value=walk]').isChecked());
  const standing = await middle(page);
  await page.locator('canvas').focus();
  // Until it is seen: how fast pictures follow is the machine's business.
  await page.keyboard.down('w');
  while (difference(await middle(page), standing) < 0.1);
  await page.keyboard.up('w');
  await press('p');
  await page.locator('.reading').waitFor();
  assert.deepEqual(faults, []);
  await close();
});

test('the page fits a phone, and fingers move the camera', async () => {
  const { page, faults, close } = await openPage(browser, service.origin, PHONE);
  assert.equal(await overflow(page), 0);
  await page.setInputFiles('input[name=bake]', scene('cornell'));
  await whole(page);
  assert.equal(await overflow(page), 0);
  const devtools = await page.context().newCDPSession(page);
  const { x, y, width, height } = await page.locator('canvas').boundingBox();
  const touch = (type, ...points) => devtools.send('Input.dispatchTouchEvent', { type, touchPoints: points.map(([dx, dy], id) => ({ x: x + dx * width, y: y + dy * height, id })) });
  for (const motion of ['Orbit', 'Walk']) {
    await page.getByLabel(motion).check();
    const before = await middle(page);
    await touch('touchStart', [0.3, 0.5]);
    for (const at of [0.4, 0.5, 0.6]) await touch('touchMove', [at, 0.5]);
    await touch('touchEnd');
    const turned = await middle(page);
    assert.ok(difference(turned, before) > 0.1, `${motion}, one finger`);
    await touch('touchStart', [0.4, 0.5], [0.6, 0.5]);
    for (const at of [0.1, 0.2, 0.3]) await touch('touchMove', [0.4 - at, 0.5], [0.6 + at, 0.5]);
    await touch('touchEnd');
    assert.ok(difference(await middle(page), turned) > 0.1, `${motion}, two fingers`);
  }
  assert.equal(await overflow(page), 0);
  await page.getByRole('link', { name: 'Jobs' }).tap();
  await page.locator('.jobs').waitFor();
  assert.deepEqual(faults, []);
  await close();
});

test('the page has no accessibility barriers', async () => {
  for (const settings of [{ colorScheme: 'light' }, { colorScheme: 'dark' }, { ...PHONE, colorScheme: 'dark' }]) {
    const { page, faults, close } = await openPage(browser, service.origin, settings);
    await page.locator('.jobs').waitFor();
    assert.deepEqual(await barriers(page), []);
    await page.setInputFiles('input[name=bake]', scene('cornell'));
    await whole(page);
    await page.getByLabel('Irradiance').check();
    await page.locator('canvas').click();
    await page.locator('.reading').waitFor();
    assert.deepEqual(await barriers(page), []);
    assert.deepEqual(faults, []);
    await close();
  }
});

test('a service with clients asks for a token, which stays in the tab', async () => {
  const folder = await mkdtemp(path.join(tmpdir(), 'halflight-clients-'));
  const file = path.join(folder, 'clients');
  const secret = 'a-secret-of-thirty-two-characters';
  await writeFile(file, `somebody ${secret}\n`, { mode: 0o600 });
  const guarded = await startService('--clients', file);
  try {
    const { page, faults, close } = await openPage(browser, guarded.origin);
    const dialog = page.getByRole('dialog', { name: 'Token' });
    await dialog.waitFor();
    assert.deepEqual(await barriers(page), []);
    await page.getByLabel('Bearer token').fill('another-secret-of-thirty-two-char');
    await page.keyboard.press('Enter');
    await page.getByText('does not know this token').waitFor();
    await page.getByLabel('Bearer token').fill(secret);
    await page.keyboard.press('Enter');
    await dialog.waitFor({ state: 'detached' });
    await page.getByText('No jobs yet').waitFor();
    const kept = await page.evaluate(() => [Object.values(sessionStorage), localStorage.length, document.cookie]);
    assert.deepEqual(kept, [[secret], 0, '']);
    await drop(page, scene('cornell'));
    await whole(page);
    await page.getByRole('button', { name: 'Forget token' }).click();
    await dialog.waitFor();
    assert.deepEqual(faults, []);
    await close();
  } finally {
    await guarded.end();
    await rm(folder, { recursive: true });
  }
});
