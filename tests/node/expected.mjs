// What a lit GLB should look like at some pixels of its first camera, from the bytes of the file and nothing else:
//   node expected.mjs FILE.glb OUT.json [--size 300x200 --step 12]
// A ray for each pixel; where it meets an opaque unlit triangle first, and its neighbours meet the same kind of place in much the same
// light (the picture takes the mean over a pixel),
// base colour x texture x COLOR_0, linear. PNG textures of RGBA with nearest sampling only: those of kinds.mjs.
import { readFile, writeFile } from 'node:fs/promises';
import { parseArgs } from 'node:util';
import { inflateSync } from 'node:zlib';

const { values: options, positionals } = parseArgs({
  allowPositionals: true,
  options: { size: { type: 'string', default: '300x200' }, step: { type: 'string', default: '12' } },
});
if (positionals.length !== 2) {
  console.error('usage: node expected.mjs FILE.glb OUT.json [--size 300x200 --step 12]');
  process.exit(2);
}
const [file, out] = positionals;
const [width, height] = options.size.split('x').map(Number);
const step = Number(options.step);

const glb = await readFile(file);
const jsonLength = glb.readUInt32LE(12);
const gltf = JSON.parse(glb.subarray(20, 20 + jsonLength));
const binary = glb.subarray(20 + jsonLength + 8);

function bytesOf(view) {
  const { byteOffset = 0, byteLength } = gltf.bufferViews[view];
  return binary.subarray(byteOffset, byteOffset + byteLength);
}

function rows(accessor) {
  const { bufferView, byteOffset = 0, componentType, count, type } = gltf.accessors[accessor];
  const components = { SCALAR: 1, VEC2: 2, VEC3: 3, VEC4: 4 }[type];
  const bytes = bytesOf(bufferView);
  const [size, read] = { 5123: [2, 'readUInt16LE'], 5125: [4, 'readUInt32LE'], 5126: [4, 'readFloatLE'] }[componentType];
  return Array.from({ length: count }, (_, row) =>
    Array.from({ length: components }, (_, i) => bytes[read](byteOffset + (row * components + i) * size)));
}

// RGBA rows of a PNG without filters, as kinds.mjs writes it.
function pixelsOf(image) {
  const { bufferView, uri } = gltf.images[image];
  const png = uri === undefined ? bytesOf(bufferView) : Buffer.from(uri.split(',')[1], 'base64');
  const columns = png.readUInt32BE(16);
  const data = [];
  for (let at = 8; at < png.length; at += 12 + png.readUInt32BE(at)) {
    if (png.toString('latin1', at + 4, at + 8) === 'IDAT') data.push(png.subarray(at + 8, at + 8 + png.readUInt32BE(at)));
  }
  const lines = inflateSync(Buffer.concat(data));
  return Array.from({ length: png.readUInt32BE(20) }, (_, y) =>
    Array.from({ length: columns }, (_, x) => [...lines.subarray(y * (1 + columns * 4) + 1 + x * 4).subarray(0, 4)]));
}

const linear = (value) => (value <= 0.04045 ? value / 12.92 : ((value + 0.055) / 1.055) ** 2.4);
const add = (a, b, s = 1) => a.map((value, i) => value + s * b[i]);
const encoded = (value) => (value <= 0.0031308 ? 12.92 * value : 1.055 * value ** (1 / 2.4) - 0.055);
const dot = (a, b) => a.reduce((sum, value, i) => sum + value * b[i], 0);
const cross = ([a, b, c], [d, e, f]) => [b * f - c * e, c * d - a * f, a * e - b * d];

// kinds.mjs moves no mesh, so nodes' coordinates are the world's.
const triangles = [];
for (const index of gltf.scenes[gltf.scene ?? 0].nodes) {
  const node = gltf.nodes[index];
  if (node.mesh === undefined) continue;
  for (const primitive of gltf.meshes[node.mesh].primitives) {
    const material = gltf.materials[primitive.material];
    const attributes = Object.fromEntries(Object.entries(primitive.attributes).map(([name, at]) => [name, rows(at)]));
    const list = rows(primitive.indices).flat();
    for (let i = 0; i < list.length; i += 3) {
      const corners = list.slice(i, i + 3);
      const [a, b, c] = corners.map((corner) => attributes.POSITION[corner]);
      triangles.push({ a, ab: add(b, a, -1), ac: add(c, a, -1), corners, attributes, material, node: node.name });
    }
  }
}
const pictures = (gltf.images ?? []).map((_, image) => pixelsOf(image));

function hit(origin, direction) {
  let nearest;
  for (const triangle of triangles) {
    const p = cross(direction, triangle.ac);
    const determinant = dot(triangle.ab, p);
    if (Math.abs(determinant) < 1e-12 || (determinant < 0 && !triangle.material.doubleSided)) continue;
    const from = add(origin, triangle.a, -1);
    const u = dot(from, p) / determinant;
    const q = cross(from, triangle.ab);
    const v = dot(direction, q) / determinant;
    const distance = dot(triangle.ac, q) / determinant;
    if (u < 0 || v < 0 || u + v > 1 || distance < 1e-6) continue;
    if (!nearest || distance < nearest.distance) nearest = { triangle, u, v, distance };
  }
  return nearest;
}

function shown({ triangle, u, v }) {
  const { material, corners, attributes } = triangle;
  const unlit = material.extensions?.KHR_materials_unlit !== undefined;
  if (!unlit || (material.alphaMode ?? 'OPAQUE') !== 'OPAQUE') return undefined;
  const at = (name) => {
    const [a, b, c] = corners.map((corner) => attributes[name][corner]);
    return a.map((value, i) => value * (1 - u - v) + b[i] * u + c[i] * v);
  };
  const pbr = material.pbrMetallicRoughness ?? {};
  let colour = (pbr.baseColorFactor ?? [1, 1, 1, 1]).slice(0, 3);
  let texel = '';
  if (pbr.baseColorTexture) {
    const { index, texCoord = 0, extensions } = pbr.baseColorTexture;
    const transform = extensions?.KHR_texture_transform ?? {};
    const [s, t] = at(`TEXCOORD_${transform.texCoord ?? texCoord}`)
      .map((value, i) => value * (transform.scale?.[i] ?? 1) + (transform.offset?.[i] ?? 0));
    const picture = pictures[gltf.textures[index].source];
    const y = Math.floor((t - Math.floor(t)) * picture.length);
    const x = Math.floor((s - Math.floor(s)) * picture[0].length);
    texel = `${x},${y}`;
    colour = colour.map((value, i) => value * linear(picture[y][x][i] / 255));
  }
  return { place: `${triangle.node} ${texel}`, node: triangle.node, colour: colour.map((value, i) => value * at('COLOR_0')[i]) };
}

const eye = gltf.nodes.find((node) => node.camera !== undefined);
const { yfov } = gltf.cameras[eye.camera].perspective;
const half = Math.tan(yfov / 2);
const look = (x, y) => {
  const direction = [((2 * x) / width - 1) * half * (width / height), (1 - (2 * y) / height) * half, -1];
  const found = hit(eye.translation, direction);
  return found && shown(found);
};
// Largest difference to a neighbour, of 255.
const SMOOTH = 5;
const alike = (one, other) =>
  one.place === other?.place &&
  one.colour.every((value, i) => 255 * Math.abs(encoded(value) - encoded(other.colour[i])) <= SMOOTH);

const points = [];
for (let y = step >> 1; y < height; y += step) {
  for (let x = step >> 1; x < width; x += step) {
    const middle = look(x + 0.5, y + 0.5);
    const around = [[-2, 0], [2, 0], [0, -2], [0, 2]].map(([dx, dy]) => look(x + 0.5 + dx, y + 0.5 + dy));
    if (middle && around.every((other) => alike(middle, other))) {
      points.push({ x, y, node: middle.node, colour: middle.colour });
    }
  }
}
// Largest component of each node's irradiance: what a tool that keeps a high dynamic range finds again.
const brightest = {};
for (const { node, attributes } of triangles) {
  if (attributes._IRRADIANCE && !(node in brightest)) {
    brightest[node] = attributes._IRRADIANCE.flat().reduce((most, value) => Math.max(most, value), 0);
  }
}
await writeFile(out, JSON.stringify({ width, height, points, brightest }, null, 1));
console.log(`${out}: ${points.length} points on ${new Set(points.map(({ node }) => node)).size} nodes`);
