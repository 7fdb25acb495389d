// Writes a room that has one of everything that a lit file must carry on, as kinds.gltf with its files beside it:
//   node kinds.mjs FOLDER
// Textures (external and embedded, with samplers and a transform), vertex colours with alpha, a metal, alpha MASK and BLEND, an
// emissive texture, clearcoat, two scenes, cameras, an animation, names, extras, attributes of its own, an unknown extension.
import { mkdir, writeFile } from 'node:fs/promises';
import path from 'node:path';
import { crc32, deflateSync } from 'node:zlib';

if (process.argv.length !== 3) {
  console.error('usage: node kinds.mjs FOLDER');
  process.exit(2);
}
const folder = process.argv[2];

const chunks = [];
const bufferViews = [];
const accessors = [];

function view(bytes, fields = {}) {
  const offset = chunks.reduce((sum, chunk) => sum + chunk.length, 0);
  bufferViews.push({ buffer: 0, byteOffset: offset, byteLength: bytes.length, ...fields });
  chunks.push(bytes, Buffer.alloc((4 - (bytes.length % 4)) % 4));
  return bufferViews.length - 1;
}

function floats(rows) {
  const width = rows[0].length;
  const column = (pick) => rows[0].map((_, i) => Math.fround(pick(...rows.map((row) => row[i]))));
  accessors.push({
    bufferView: view(Buffer.from(new Float32Array(rows.flat()).buffer)),
    componentType: 5126,
    count: rows.length,
    type: ['SCALAR', 'VEC2', 'VEC3', 'VEC4'][width - 1],
    min: column(Math.min),
    max: column(Math.max),
  });
  return accessors.length - 1;
}

function bytes(rows) {
  accessors.push({
    bufferView: view(Buffer.from(rows.flat()), { target: 34962 }),
    componentType: 5121,
    normalized: true,
    count: rows.length,
    type: 'VEC4',
  });
  return accessors.length - 1;
}

function indices(list) {
  accessors.push({
    bufferView: view(Buffer.from(new Uint16Array(list).buffer)),
    componentType: 5123,
    count: list.length,
    type: 'SCALAR',
  });
  return accessors.length - 1;
}

// A quad from a corner along two edges, lit where they turn counter-clockwise.
function quad([x, y, z], [ax, ay, az], [bx, by, bz], fields = {}, more = {}) {
  const corners = [[0, 0], [1, 0], [1, 1], [0, 1]];
  const at = ([s, t]) => [x + s * ax + t * bx, y + s * ay + t * by, z + s * az + t * bz];
  const attributes = { POSITION: floats(corners.map(at)), TEXCOORD_0: floats(corners), ...more };
  return { attributes, indices: indices([0, 1, 2, 0, 2, 3]), ...fields };
}

// A PNG of RGBA rows.
function png(rows) {
  const chunk = (type, data) => {
    const body = Buffer.concat([Buffer.from(type), data]);
    const out = Buffer.alloc(body.length + 8);
    out.writeUInt32BE(data.length, 0);
    body.copy(out, 4);
    out.writeUInt32BE(crc32(body), body.length + 4);
    return out;
  };
  const header = Buffer.alloc(13);
  header.writeUInt32BE(rows[0].length, 0);
  header.writeUInt32BE(rows.length, 4);
  header.set([8, 6, 0, 0, 0], 8);
  const pixels = Buffer.concat(rows.map((row) => Buffer.from([0, ...row.flat()])));
  const signature = Buffer.from([0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a]);
  return Buffer.concat([signature, chunk('IHDR', header), chunk('IDAT', deflateSync(pixels)), chunk('IEND', Buffer.alloc(0))]);
}

const checks = png([
  [[230, 60, 40, 255], [60, 200, 90, 255]],
  [[50, 80, 220, 255], [220, 210, 80, 255]],
]);
const leaves = png([
  [[90, 160, 70, 255], [90, 160, 70, 0]],
  [[90, 160, 70, 0], [90, 160, 70, 255]],
]);
const glow = png([
  [[0, 0, 0, 255], [0, 0, 0, 255]],
  [[0, 0, 0, 255], [255, 160, 60, 255]],
]);

const grey = (value) => ({ baseColorFactor: [value, value, value, 1], metallicFactor: 0 });
const materials = [
  { name: 'checks', pbrMetallicRoughness: { baseColorTexture: { index: 0 }, metallicFactor: 0 }, extras: { from: 'the shop' } },
  { name: 'painted', pbrMetallicRoughness: { ...grey(0.9) } },
  { name: 'brass', pbrMetallicRoughness: { baseColorFactor: [0.9, 0.6, 0.2, 1], metallicFactor: 0.5 } },
  {
    name: 'tiles',
    pbrMetallicRoughness: {
      baseColorTexture: { index: 0, extensions: { KHR_texture_transform: { scale: [2, 1], offset: [0.5, 0] } } },
      metallicFactor: 0,
    },
    extensions: { KHR_materials_clearcoat: { clearcoatFactor: 0.5 }, KHR_materials_ior: { ior: 1.4 } },
  },
  { name: 'white', pbrMetallicRoughness: grey(0.7) },
  {
    name: 'lamp',
    pbrMetallicRoughness: grey(0.5),
    emissiveFactor: [1, 0.9, 0.7],
    extensions: { KHR_materials_emissive_strength: { emissiveStrength: 9 } },
  },
  {
    name: 'leaves',
    pbrMetallicRoughness: { baseColorTexture: { index: 1 }, metallicFactor: 0 },
    alphaMode: 'MASK',
    alphaCutoff: 0.5,
    doubleSided: true,
  },
  { name: 'veil', pbrMetallicRoughness: { ...grey(0.8), baseColorFactor: [0.8, 0.8, 0.8, 0.4] }, alphaMode: 'BLEND', doubleSided: true },
  { name: 'radio', pbrMetallicRoughness: grey(0.4), emissiveFactor: [0.05, 0.05, 0.05], emissiveTexture: { index: 2 } },
];

// Of the shape of what the program adds: Blender's importer (4.5) mixes up attributes of different shapes.
const wear = () => floats([[0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0]]);
const tangent = () => floats(Array(4).fill([1, 0, 0, 1]));
const up = () => floats(Array(4).fill([0, 1, 0]));
const second = () => floats([[0.25, 0.5], [0.5, 0.5], [0.5, 0.75], [0.25, 0.75]]);
const colours = () => bytes([[255, 40, 40, 255], [40, 255, 40, 255], [40, 40, 255, 255], [255, 255, 255, 255]]);
const part = (name, primitive, fields = {}) => ({ name, mesh: { name, primitives: [primitive] }, ...fields });

const parts = [
  part('floor', quad([0, 0, 0], [0, 0, 4], [4, 0, 0], { material: 0 }, { TEXCOORD_1: second(), NORMAL: up(), TANGENT: tangent(), _WEAR: wear() })),
  part('left', quad([0, 0, 4], [0, 0, -4], [0, 3, 0], { material: 1 }, { COLOR_0: colours() })),
  part('right', quad([4, 0, 0], [0, 0, 4], [0, 3, 0], { material: 2 })),
  part('back', quad([0, 0, 0], [4, 0, 0], [0, 3, 0], { material: 3 })),
  part('ceiling', quad([0, 3, 0], [4, 0, 0], [0, 0, 4], { material: 4 })),
  part('lamp', quad([1.5, 2.9, 1.5], [1, 0, 0], [0, 0, 1], { material: 5 })),
  part('plant', quad([0.4, 0.1, 1.2], [0.8, 0, 0], [0, 0.8, 0], { material: 6 })),
  part('veil', quad([2.9, 0.1, 1.6], [0.8, 0, 0], [0, 1.2, 0], { material: 7 })),
  part('radio', quad([1.8, 0.05, 1.4], [0.7, 0, 0], [0, 0.5, 0], { material: 8 }), {
    extras: { owner: 'the tenant' },
    extensions: { ACME_tag: { text: 'kept' } },
  }),
  part('annex floor', quad([10, 0, 0], [0, 0, 1], [1, 0, 0], { material: 4 })),
];
const meshes = parts.map(({ mesh }) => mesh);
const nodes = parts.map((node, mesh) => ({ ...node, mesh }));
const eye = nodes.push({ name: 'eye', camera: 0, translation: [2, 1.5, 6.2] }) - 1;
const bulb = nodes.push({ name: 'bulb', translation: [3, 2, 3], extensions: { KHR_lights_punctual: { light: 0 } } }) - 1;
const spinner = nodes.push({ name: 'spinner', children: [] }) - 1;
delete nodes[spinner].children;
const times = floats([[0], [1]]);
const turns = floats([[0, 0, 0, 1], [0, 1, 0, 0]]);
const annex = parts.length - 1;
const embedded = view(leaves);

await mkdir(path.join(folder, 'maps'), { recursive: true });
const document = {
  asset: { version: '2.0', generator: 'kinds.mjs', copyright: 'nobody' },
  extensionsUsed: [
    'ACME_tag',
    'KHR_lights_punctual',
    'KHR_materials_clearcoat',
    'KHR_materials_emissive_strength',
    'KHR_materials_ior',
    'KHR_texture_transform',
  ],
  extensions: { KHR_lights_punctual: { lights: [{ name: 'bulb', type: 'point', intensity: 6, color: [0.6, 0.8, 1] }] } },
  scene: 0,
  scenes: [
    { name: 'room', nodes: [...parts.keys()].filter((node) => node !== annex).concat(eye, bulb, spinner) },
    { name: 'annex', nodes: [annex, bulb] },
  ],
  nodes,
  meshes,
  materials,
  cameras: [{ name: 'eye', type: 'perspective', perspective: { yfov: 0.9, aspectRatio: 1.5, znear: 0.1, zfar: 100 } }],
  animations: [
    {
      name: 'spin',
      samplers: [{ input: times, output: turns }],
      channels: [{ sampler: 0, target: { node: spinner, path: 'rotation' } }],
    },
  ],
  samplers: [{ magFilter: 9728, minFilter: 9728, wrapS: 10497, wrapT: 10497 }],
  images: [
    { name: 'checks', uri: 'maps/checks%201.png' },
    { name: 'leaves', bufferView: embedded, mimeType: 'image/png' },
    { name: 'glow', uri: `data:image/png;base64,${glow.toString('base64')}` },
  ],
  textures: [0, 1, 2].map((source) => ({ source, sampler: 0 })),
  accessors,
  bufferViews,
};
const binary = Buffer.concat(chunks);
document.buffers = [{ byteLength: binary.length, uri: 'kinds.bin' }];
await writeFile(path.join(folder, 'maps', 'checks 1.png'), checks);
await writeFile(path.join(folder, 'kinds.bin'), binary);
await writeFile(path.join(folder, 'kinds.gltf'), JSON.stringify(document));
