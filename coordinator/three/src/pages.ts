/** Pages of a lightmap as KTX2 files of BC6H, as `--lightmap-format ktx2` writes them beside its output. */
import { CompressedTexture, HalfFloatType, LinearFilter, RGB_BPTC_UNSIGNED_Format } from 'three';
import type { Texture } from 'three';

/** The WebGL extension that has the format. */
export const BPTC = 'EXT_texture_compression_bptc';

/** The largest light that BC6H holds, as half floats do. */
export const MOST_LIGHT = 65504;

const IDENTIFIER = [0xab, 0x4b, 0x54, 0x58, 0x20, 0x32, 0x30, 0xbb, 0x0d, 0x0a, 0x1a, 0x0a];

/** Bytes of the header and the place of the first level. */
const HEADER_BYTES = 104;

/** `VK_FORMAT_BC6H_UFLOAT_BLOCK`. */
const BC6H = 143;

/** Edge of a block, in texels. */
const BLOCK = 4;

const BLOCK_BYTES = 16;

/**
 * The first layer of a file: all light. Its texels are irradiance in the file's unit. WebGL takes whole blocks only, so `repeat` leaves
 * out what is beyond the page.
 */
export function readPage(file: ArrayBuffer): CompressedTexture {
  const header = new DataView(file);
  const isKtx2 = file.byteLength >= HEADER_BYTES && IDENTIFIER.every((byte, i) => header.getUint8(i) === byte);
  const number = (offset: number) => header.getUint32(offset, true);
  const isFlat = isKtx2 && number(28) === 0 && number(36) === 1;
  if (!isFlat || number(12) !== BC6H || number(44) !== 0) throw new Error('not a KTX2 file of BC6H, flat and without supercompression');

  const [width, height] = [number(20), number(24)];
  const [across, down] = [Math.ceil(width / BLOCK), Math.ceil(height / BLOCK)];
  const start = Number(header.getBigUint64(80, true));
  const length = BLOCK_BYTES * across * down;
  // A copy: the other layers need no memory then.
  const data = new Uint8Array(file.slice(start, start + length));
  if (length === 0 || data.length !== length) throw new Error(`no ${width} x ${height} texels in ${file.byteLength} bytes`);

  const whole = { width: BLOCK * across, height: BLOCK * down };
  const level = { data, ...whole };
  const texture = new CompressedTexture([level], whole.width, whole.height, RGB_BPTC_UNSIGNED_Format, HalfFloatType);
  texture.repeat.set(width / whole.width, height / whole.height);
  texture.minFilter = LinearFilter;
  texture.needsUpdate = true;
  return texture;
}

/** The part of a page that an instance has: `KHR_texture_transform`. */
export interface Part {
  offset?: [number, number];
  scale?: [number, number];
  /** Lightmaps have none. */
  rotation?: number;
}

/** A texture of its own for a part of a page, by this set of texture coordinates. The page is uploaded once. */
export function partOf(page: Texture, texCoord: number, part: Part = {}): Texture {
  const texture = page.clone();
  texture.channel = texCoord;
  texture.offset.fromArray(part.offset ?? [0, 0]).multiply(page.repeat);
  texture.repeat.fromArray(part.scale ?? [1, 1]).multiply(page.repeat);
  return texture;
}
