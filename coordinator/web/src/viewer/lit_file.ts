// Lit files, as the program writes them (docs/output.md).

import { Box3, DataTexture, Light, Mesh, PerspectiveCamera, type BufferGeometry, type Group, type Object3D } from 'three';
import type { KTX2Loader } from 'three/addons/loaders/KTX2Loader.js';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
// The decoder that needs no WebAssembly, which the page's policy does not allow; it comes without types.
// @ts-expect-error
import { MeshoptDecoder } from '../../node_modules/meshoptimizer/meshopt_decoder_reference.js';
import { Spread } from './spread';

/** What a file can be coloured by. */
export type Quantity = 'irradiance' | 'unshot';

/** Name of the attribute that has a quantity: as the loader has it, in lower case. */
export const ATTRIBUTE: Record<Quantity, string> = { irradiance: '_irradiance', unshot: '_unshot' };

/** A lit scene. */
export interface LitFile {
  root: Group;
  meshes: Mesh[];
  cameras: { name: string; camera: PerspectiveCamera }[];
  bounds: Box3;
  /** What `COLOR_0` was multiplied by. */
  exposure: number;
  /** Unit of the irradiance. */
  unit: string;
  /** How each quantity that the file has is spread over its surfaces. */
  spreads: Partial<Record<Quantity, Spread>>;
  triangles: number;
}

// KTX2 images are white: their decoder is WebAssembly. Surfaces show light and colour factors alone.
const whiteImages = {
  isKTX2Loader: true,
  parse: (_: ArrayBuffer, loaded: (texture: DataTexture) => void) => {
    const white = new DataTexture(new Uint8Array(4).fill(255), 1, 1);
    white.needsUpdate = true;
    loaded(white);
  },
};

/** Reads a lit GLB. */
export async function readLitFile(bytes: ArrayBuffer): Promise<LitFile> {
  const loader = new GLTFLoader()
    .setMeshoptDecoder(MeshoptDecoder)
    .setKTX2Loader(whiteImages as unknown as KTX2Loader);
  const { asset, scene: root, cameras } = await loader.parseAsync(bytes, '');
  const noted = (asset.extras as { halflight?: { exposure?: unknown; unit?: unknown } } | undefined)?.halflight;
  // Unlit materials take no notice of lights.
  root.getObjectsByProperty('isLight', true).forEach((light) => (light as Light).removeFromParent());
  root.updateMatrixWorld(true);
  const meshes: Mesh[] = [];
  root.traverse((node: Object3D) => node instanceof Mesh && meshes.push(node));
  const file: LitFile = {
    root,
    meshes,
    cameras: cameras
      .filter((camera): camera is PerspectiveCamera => camera instanceof PerspectiveCamera)
      .map((camera, i) => ({ name: camera.name || `Camera ${i + 1}`, camera })),
    bounds: new Box3().setFromObject(root, true),
    exposure: typeof noted?.exposure === 'number' && noted.exposure > 0 ? noted.exposure : 1,
    unit: typeof noted?.unit === 'string' ? noted.unit.replace('^2', '²') : 'W/m²',
    spreads: {},
    triangles: meshes.reduce((sum, { geometry }) => sum + corners(geometry) / 3, 0),
  };
  for (const quantity of ['irradiance', 'unshot'] as const) {
    const having = meshes.filter(({ geometry }) => geometry.hasAttribute(ATTRIBUTE[quantity]));
    if (having.length === 0) continue;
    const spread = (file.spreads[quantity] = new Spread());
    for (const { geometry, matrixWorld } of having) {
      spread.add(geometry, geometry.getAttribute(ATTRIBUTE[quantity]), Math.abs(matrixWorld.determinant()) ** (2 / 3));
    }
  }
  return file;
}

function corners(geometry: BufferGeometry): number {
  return geometry.index?.count ?? geometry.getAttribute('position').count;
}

/**
 * What `_IRRADIANCE` x exposure x `_COLOR_0` is multiplied by in `COLOR_0`: the part of the base colour that reflects diffusely.
 *
 * It is the same at all vertices of a primitive, so any one tells it whose colour is not clamped; of these the brightest.
 */
export function diffusePart(geometry: BufferGeometry, exposure: number): number {
  const colour = geometry.getAttribute('color');
  const irradiance = geometry.getAttribute(ATTRIBUTE.irradiance);
  const tint = geometry.getAttribute('_color_0');
  if (!colour) return 1;
  let [shown, whole] = [0, 0];
  for (let vertex = 0; vertex < colour.count; vertex++) {
    for (const channel of [0, 1, 2]) {
      const value = colour.getComponent(vertex, channel);
      if (value >= 0.99 || value < shown) continue;
      const full = irradiance.getComponent(vertex, channel) * exposure * (tint?.getComponent(vertex, channel) ?? 1);
      if (full > 0) [shown, whole] = [value, full];
    }
  }
  return whole > 0 ? Math.min(shown / whole, 1) : 1;
}

/** Frees what the graphics card holds of a file. */
export function dispose({ meshes }: LitFile): void {
  for (const { geometry, material } of meshes) {
    geometry.dispose();
    for (const one of Array.isArray(material) ? material : [material]) {
      for (const value of Object.values(one)) if ((value as { isTexture?: boolean } | null)?.isTexture) value.dispose();
      one.dispose();
    }
  }
}

