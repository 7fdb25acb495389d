// What baked.mjs runs in the browser: squares with baked light under a lamp, with the plugin and without it.
import * as THREE from 'three';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
import { Probes, halflight } from 'halflight-three';
import { BRIGHT, decoded } from '/ktx2.mjs';

// Irradiance at all vertices.
const IRRADIANCE = [3, 2, 1];

// Irradiance that 1 stands for in the lightmaps, and what their texels stand for.
const SCALE = 8;
const HALF = 188;
const HALF_LINEAR = ((HALF / 255 + 0.055) / 1.055) ** 2.4;
const MULTIPLIER = 128;
const GREY = Array(3).fill(SCALE * HALF_LINEAR);

const COLOUR = [0.8, 0.5, 0.2];
const PAINT = [204, 102, 51];
const painted = PAINT.map((byte) => ((byte / 255 + 0.055) / 1.055) ** 2.4);

const pbr = (more) => ({ baseColorFactor: [...COLOUR, 1], metallicFactor: 0, roughnessFactor: 1, ...more });

const mapped = (page) => ({
  pbrMetallicRoughness: pbr(),
  extensions: { MOZ_lightmap: { index: page, texCoord: 1, intensity: SCALE } },
});

// The right half of a page whose left half is dark.
const instance = mapped(3);
instance.extensions.MOZ_lightmap.extensions = { KHR_texture_transform: { offset: [0.625, 0], scale: [0.25, 1] } };

// The part above on the left of six texels by eight: its middle is 3.4 texels from the left, and dark begins at 4.
const corner = mapped(1);
corner.extensions.MOZ_lightmap.extensions = {
  KHR_texture_transform: { offset: [0.46, 0.125], scale: [0.2, 0.25] },
};

// A page as a file beside the glTF, and the largest light of the lightmap.
const paged = (file, scale = SCALE) => ({ material: mapped(1), encoding: 'srgb', file, scale, albedo: COLOUR });

// Of each kind its material, the light at its vertices, the encoding of its lightmap and the file with its page, what of the light it
// reflects, and what the page says.
const KINDS = [
  { name: 'rough', material: { pbrMetallicRoughness: pbr() }, light: IRRADIANCE, albedo: COLOUR },
  {
    name: 'metal',
    material: { pbrMetallicRoughness: pbr({ metallicFactor: 0.5, roughnessFactor: 0.6 }) },
    light: IRRADIANCE,
    albedo: COLOUR.map((value) => value / 2),
  },
  {
    name: 'textured',
    material: { pbrMetallicRoughness: { baseColorTexture: { index: 0 }, metallicFactor: 0, roughnessFactor: 1 } },
    light: IRRADIANCE,
    albedo: painted,
  },
  { name: 'sRGB page', material: mapped(1), encoding: 'srgb', albedo: COLOUR, read: GREY },
  { name: 'part of a page', material: instance, encoding: 'srgb', albedo: COLOUR, read: GREY },
  { name: 'PNG in place of a missing file', ...paged('missing.ktx2'), read: GREY },
  { name: 'PNG in place of half a file', ...paged('cut.ktx2'), read: GREY },
  { name: 'PNG of light beyond half floats', ...paged('whole #1.ktx2', 1e5), read: GREY },
  { name: 'KTX2 page', ...paged('whole #1.ktx2'), read: BRIGHT.map(decoded) },
  { name: 'part of a KTX2 page', ...paged('corner.ktx2'), material: corner, read: BRIGHT.map(decoded) },
  { name: 'RGBM page', material: mapped(2), encoding: 'rgbm', albedo: COLOUR, read: Array(3).fill((SCALE * MULTIPLIER) / 255) },
];

async function picture(colour, left = colour) {
  const canvas = new OffscreenCanvas(4, 4);
  const context = canvas.getContext('2d');
  context.fillStyle = colour;
  context.fillRect(2, 0, 2, 4);
  context.fillStyle = left;
  context.fillRect(0, 0, 2, 4);
  const bytes = new Uint8Array(await (await canvas.convertToBlob()).arrayBuffer());
  return `data:image/png;base64,${btoa(String.fromCharCode(...bytes))}`;
}

// A square of two triangles before the camera, as a document.
async function square({ material, light, encoding, file, scale }) {
  const files = file && ['other.ktx2', file];
  const corners = [[-1, -1], [1, -1], [1, 1], [-1, 1]];
  const sets = [
    corners.flatMap(([x, y]) => [x, y, 0]),
    corners.flatMap(() => [0, 0, 1]),
    corners.flatMap(([x, y]) => [(x + 1) / 2, (y + 1) / 2]),
    corners.flatMap(() => light ?? IRRADIANCE),
  ];
  const floats = new Float32Array([...sets.flat()]);
  const indices = new Uint16Array([0, 1, 2, 0, 2, 3]);
  const bytes = new Uint8Array(floats.byteLength + indices.byteLength);
  bytes.set(new Uint8Array(floats.buffer));
  bytes.set(new Uint8Array(indices.buffer), floats.byteLength);
  let offset = 0;
  const view = (byteLength) => ({ buffer: 0, byteOffset: (offset += byteLength) - byteLength, byteLength });
  const vector = (bufferView, type) => ({ bufferView, componentType: 5126, count: 4, type });
  const images = [
    `rgb(${PAINT.join(' ')})`,
    `rgb(${HALF} ${HALF} ${HALF})`,
    `rgb(255 255 255 / ${MULTIPLIER / 255})`,
    [`rgb(${HALF} ${HALF} ${HALF})`, 'black'],
  ];
  const attributes = { POSITION: 0, NORMAL: 1, TEXCOORD_0: 2, TEXCOORD_1: 2 };
  if (light) attributes._IRRADIANCE = 3;
  return JSON.stringify({
    asset: { version: '2.0', extras: { halflight: { lightmap: { encoding, scale, textures: [3, 1], files } } } },
    extensionsUsed: ['KHR_texture_transform'],
    scene: 0,
    scenes: [{ nodes: [0] }],
    nodes: [{ mesh: 0 }],
    meshes: [{ primitives: [{ attributes, indices: 4, material: 0 }] }],
    materials: [material],
    textures: images.map((_, source) => ({ source })),
    images: await Promise.all(images.map(async (colours) => ({ uri: await picture(...[colours].flat()) }))),
    accessors: [
      { ...vector(0, 'VEC3'), min: [-1, -1, 0], max: [1, 1, 0] },
      vector(1, 'VEC3'),
      vector(2, 'VEC2'),
      vector(3, 'VEC3'),
      { bufferView: 4, componentType: 5123, count: 6, type: 'SCALAR' },
    ],
    bufferViews: [...sets.map((set) => view(4 * set.length)), view(indices.byteLength)],
    buffers: [
      {
        byteLength: bytes.length,
        uri: `data:application/octet-stream;base64,${btoa(String.fromCharCode(...bytes))}`,
      },
    ],
  });
}

// The radiance in the middle of the picture.
async function radiance(loader, document, renderer, more = []) {
  const { scene } = await loader.parseAsync(document, '');
  const lamp = new THREE.DirectionalLight(0xffffff, 2);
  lamp.position.set(0.5, 0.5, 2);
  scene.add(lamp, ...more);
  return shown(scene, renderer);
}

function shown(scene, renderer) {
  const eye = new THREE.OrthographicCamera(-0.5, 0.5, 0.5, -0.5, 0.1, 10);
  eye.position.z = 3;
  const target = new THREE.WebGLRenderTarget(8, 8, { type: THREE.FloatType });
  renderer.setRenderTarget(target);
  renderer.render(scene, eye);
  const pixel = new Float32Array(4);
  renderer.readRenderTargetPixels(target, 4, 4, 1, 1, pixel);
  return [...pixel.subarray(0, 3)];
}

// Probes on a line, whose radiance in a direction is the first number + the others x (x, y, xy, 3z^2 - 1).
const FIELDS = [
  [0.8, 0.3, -0.2, 0.4, 0.1],
  [2.4, -0.5, 0.4, -0.2, 0.3],
];
const SCALES = [[0, 0.282095], [3, 0.488603], [1, 0.488603], [4, 1.092548], [6, 0.315392]];

const probes = new Probes({
  positions: [[0, 0, 0], [2, 0, 0]],
  inside: [false, false],
  coefficients: FIELDS.map((field) => {
    const all = Array(27).fill(0);
    SCALES.forEach(([band, scale], i) => [0, 1, 2].forEach((rgb) => (all[3 * band + rgb] = field[i] / scale)));
    return all;
  }),
  grid: { origin: [0, 0, 0], spacing: 2, size: [2, 1, 1] },
});

// Irradiance of a normal under a field, by summing over directions.
function summed([even, alongX, alongY, saddle, zonal], normal) {
  const count = 200_000;
  let sum = 0;
  for (let i = 0; i < count; i++) {
    const z = 1 - (2 * i + 1) / count;
    const turn = i * Math.PI * (3 - Math.sqrt(5));
    const [x, y] = [Math.cos(turn), Math.sin(turn)].map((value) => value * Math.sqrt(1 - z * z));
    const cosine = Math.max(0, x * normal.x + y * normal.y + z * normal.z);
    sum += cosine * (even + alongX * x + alongY * y + saddle * x * y + zonal * (3 * z * z - 1));
  }
  return (4 * Math.PI * sum) / count;
}

// What a square under a probe alone shows, turned in several ways, a quarter of the way between both probes.
function underProbe(renderer) {
  const field = FIELDS[0].map((value, i) => 0.75 * value + 0.25 * FIELDS[1][i]);
  return [[0, 0, 1], [1, 0, 1], [-1, 1, 0.5], [0.2, -1, 0.3]].map((direction) => {
    const normal = new THREE.Vector3(...direction).normalize();
    const material = new THREE.MeshLambertMaterial({ color: new THREE.Color(...COLOUR) });
    const mesh = new THREE.Mesh(new THREE.PlaneGeometry(8, 8), material);
    mesh.lookAt(normal);
    const scene = new THREE.Scene().add(mesh, probes.at(new THREE.Vector3(0.5, 9, 0)));
    const expected = COLOUR.map((albedo) => (albedo * summed(field, normal)) / Math.PI);
    return { name: `probe, normal ${direction}`, shown: shown(scene, renderer), direct: Array(3).fill(0), expected };
  });
}

globalThis.measure = async () => {
  const renderer = new THREE.WebGLRenderer();
  const found = [];
  for (const kind of KINDS) {
    const document = await square(kind);
    const direct = await radiance(new GLTFLoader(), document, renderer);
    // The probe is not for those with light of their own.
    const probe = probes.at(new THREE.Vector3());
    const shown = await radiance(new GLTFLoader().register(halflight({ renderer })), document, renderer, [probe]);
    const irradiance = kind.light ?? kind.read;
    const expected = kind.albedo.map((albedo, i) => (albedo * irradiance[i]) / Math.PI);
    found.push({ name: kind.name, shown, direct, expected });
  }
  return [...found, ...underProbe(renderer)];
};
