// A picture of a lit GLB, by three.js in a headless browser:
//   node picture.mjs FILE.glb OUT.png [--camera x,y,z --target x,y,z --size 900x600 --fov 75]
// Without a camera: from inside one end of the scene along its longest horizontal axis, as suits a closed room.
// With --expect POINTS.json, as expected.mjs writes it: from the file's first camera, and every point's colour must be the expected one.
// With --other OTHER.png, as `coordinator render` makes it of the file's first camera: every pixel must have the other's colour, but for
// emission, holes, panes, and the borders of surfaces and texels.
// With --baked: by the plugin of coordinator/three, which must be built, beside the lamps of the file and their shadows, for files with
// materials kept; from the file's first camera where none is given. --exposure NUMBER takes the place of the file's.
// Colours are linear inside and sRGB in the picture, without tone mapping. Everything is served from loopback.
// CHROMIUM names the browser; /usr/bin/chromium where it is not set.
import { readFile, writeFile } from 'node:fs/promises';
import path from 'node:path';
import { parseArgs } from 'node:util';
import { IMPORTS, onPage } from './served.mjs';

const USAGE =
  'usage: node picture.mjs FILE.glb OUT.png [--camera x,y,z --target x,y,z --size 900x600 --fov 75 | --expect POINTS.json | --other OTHER.png | --baked --exposure NUMBER]';

// Largest difference of a channel from what is expected, of 255: rounding of the picture, of the texture and in between.
const TOLERANCE = 2;

const { values: options, positionals } = parseArgs({
  allowPositionals: true,
  options: {
    camera: { type: 'string' },
    target: { type: 'string' },
    size: { type: 'string', default: '900x600' },
    fov: { type: 'string', default: '75' },
    expect: { type: 'string' },
    other: { type: 'string' },
    baked: { type: 'boolean', default: false },
    exposure: { type: 'string' },
  },
});
if (positionals.length !== 2) {
  console.error(USAGE);
  process.exit(2);
}
const [scene, out] = positionals;
const view = {
  camera: numbers(options.camera, ',', 3),
  target: numbers(options.target, ',', 3),
  size: numbers(options.size, 'x', 2),
  fov: numbers(options.fov, ',', 1)[0],
  baked: options.baked,
  exposure: numbers(options.exposure, ',', 1)?.[0],
};

const expected = options.expect && JSON.parse(await readFile(options.expect));
if (expected) {
  view.size = [expected.width, expected.height];
  view.points = expected.points;
}

const other = options.other && (await readFile(options.other));
if (other) {
  view.size = [other.readUInt32BE(16), other.readUInt32BE(20)];
  view.other = true;
}

function numbers(text, separator, count) {
  if (text === undefined) return undefined;
  const found = text.split(separator).map(Number);
  if (found.length === count && found.every(Number.isFinite)) return found;
  console.error(`${text} is not ${count} numbers\n${USAGE}`);
  process.exit(2);
}

const sources = new Map([
  ['/', { type: 'text/html', read: () => PAGE }],
  ['/page.js', { type: 'text/javascript', read: () => readFile(path.join(import.meta.dirname, 'page.js')) }],
  ['/scene.glb', { type: 'model/gltf-binary', read: () => readFile(scene) }],
  ['/other.png', { type: 'image/png', read: () => other }],
]);
const PAGE = `<!doctype html><link rel="icon" href="data:,">${IMPORTS}
<script type="module" src="/page.js"></script>`;

// As the picture holds it: sRGB of 255.
function encoded(linear) {
  const value = Math.min(Math.max(linear, 0), 1);
  return 255 * (value <= 0.0031308 ? 12.92 * value : 1.055 * value ** (1 / 2.4) - 0.055);
}

// Part of the picture that must be comparable, lest nothing be compared.
const LEAST_COMPARED = 0.3;

function compareWith(pairs, [width, height]) {
  let worst = 0;
  let wrong = 0;
  for (const { x, y, own, other } of pairs) {
    const off = Math.max(...own.map((value, i) => Math.abs(value - other[i])));
    worst = Math.max(worst, off);
    if (off > TOLERANCE && ++wrong <= 5) console.error(`at ${x},${y}: ${own}, the other has ${other}`);
  }
  const part = pairs.length / (width * height);
  console.log(`${pairs.length} pixels (${(100 * part).toFixed(0)} %), ${wrong} wrong, largest difference ${worst} of 255`);
  if (wrong > 0 || part < LEAST_COMPARED) process.exitCode = 1;
}

function compare(points, found) {
  let worst = 0;
  let wrong = 0;
  points.forEach(({ x, y, node, colour }, i) => {
    const off = Math.max(...colour.map((value, channel) => Math.abs(encoded(value) - found[i][channel])));
    worst = Math.max(worst, off);
    if (off > TOLERANCE && ++wrong <= 5) {
      console.error(`${node} at ${x},${y}: ${found[i]}, not ${colour.map((value) => encoded(value).toFixed(1))}`);
    }
  });
  console.log(`${points.length} points, ${wrong} wrong, largest difference ${worst.toFixed(1)} of 255`);
  if (wrong > 0 || points.length === 0) process.exitCode = 1;
}

try {
  await readFile(scene); // A missing file is told by name before a browser starts.
} catch (error) {
  console.error(error.message);
  process.exit(1);
}
await onPage(sources, 'takePicture', async (page) => {
  const { url, camera, target, found, pairs } = await page.evaluate((view) => globalThis.takePicture(view), view);
  await writeFile(out, Buffer.from(url.split(',')[1], 'base64'));
  console.log(`${out}: camera ${camera.join(',')}, target ${target.join(',')}`);
  if (expected) compare(expected.points, found);
  if (pairs) compareWith(pairs, view.size);
});
