/** Pages of a lightmap as KTX2 files of BC6H, as `--lightmap-format ktx2` writes them beside its output. */
import { CompressedTexture, HalfFloatType, LinearFilter, RGB_BPTC_UNSIGNED_Format } from 'three';
import type { Texture } from 'three';

/** The WebGL extension that has the format. */
export const BPTC = 'EXT_texture_compression_bptc';

const IDENTIFIER = [0xab, 0x4b, 0x54, 0x58, 0x20, 0x32, 0x30, 0xbb, 0x0d, 0x0a, 0x1a, 0x0a];

/** `VK_FORMAT_BC6H_UFLOAT_BLOCK`. */
const BC6H = 143;

/** Edge of a block, in texels. */
const BLOCK = 4;

const BLOCK_BYTES = 16;

/** The first layer of a file: all light. Its texels are irradiance in the file's unit. WebGL takes whole blocks only, so it repeats less than
 * once where an edge ends within one. */
export function page(file: ArrayBuffer): CompressedTexture {
  const header = new DataView(file);
  const [format, width, height] = [12, 20, 24].map((offset) => header.getUint32(offset, true)) as [number, number, number];
  const hasLevelsOnly = header.getUint32(44, true) === 0;
  if (!IDENTIFIER.every((byte, i) => header.getUint8(i) === byte) || format !== BC6H || !hasLevelsOnly) {
    throw new Error('no KTX2 file of BC6H');
  }
  const start = Number(header.getBigUint64(80, true));
  const [across, down] = [Math.ceil(width / BLOCK), Math.ceil(height / BLOCK)];
  const whole = { width: BLOCK * across, height: BLOCK * down };
  const level = { data: new Uint8Array(file, start, BLOCK_BYTES * across * down), ...whole };
  const texture = new CompressedTexture([level], whole.width, whole.height, RGB_BPTC_UNSIGNED_Format, HalfFloatType);
  texture.repeat.set(width / whole.width, height / whole.height);
  texture.minFilter = LinearFilter;
  texture.needsUpdate = true;
  return texture;
}

/** The part of a page that an instance has: `KHR_texture_transform` without rotation, as lightmaps have it. */
export interface Part {
  offset?: [number, number];
  scale?: [number, number];
}

/** A texture of its own for a part of a page, by this set of texture coordinates. The page is uploaded once. */
export function partOf(page: Texture, texCoord: number, part: Part = {}): Texture {
  const texture = page.clone();
  texture.channel = texCoord;
  texture.offset.fromArray(part.offset ?? [0, 0]).multiply(page.repeat);
  texture.repeat.fromArray(part.scale ?? [1, 1]).multiply(page.repeat);
  return texture;
}
