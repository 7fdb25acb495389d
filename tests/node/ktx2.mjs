// KTX2 files of BC6H with blocks of one colour each, as pages of a lightmap.

const FORMAT = 143;
const IDENTIFIER = [0xab, 0x4b, 0x54, 0x58, 0x20, 0x32, 0x30, 0xbb, 0x0d, 0x0a, 0x1a, 0x0a];
const HEADER_BYTES = 104;

/** End points of a bright block: red, green and blue in ten bits. */
export const BRIGHT = [560, 520, 470];

/** No light. */
export const DARK = [0, 0, 0];

/** What a decoder makes of an end point: unquantized to 16 bits, then the bits of a half float. */
export function decoded(value) {
  const half = (((value === 0 ? 0 : ((value << 16) + 0x8000) >> 10) * 31) >> 6) & 0xffff;
  return 2 ** ((half >> 10) - 15) * (1 + (half & 1023) / 1024);
}

/** A block of mode 11: two end points of ten bits a channel, here the same, and indices, here all 0. */
function block(colour) {
  const bits = [[3, 5], ...[...colour, ...colour].map((value) => [value, 10])];
  let [all, at] = [0n, 0n];
  for (const [value, count] of bits) {
    all |= BigInt(value) << at;
    at += BigInt(count);
  }
  return Array.from({ length: 16 }, (_, i) => Number((all >> BigInt(8 * i)) & 255n));
}

/** A file with these blocks of each layer, from the top row down. */
export function ktx2([width, height], layers) {
  const data = layers.flat().flatMap(block);
  const file = new Uint8Array(HEADER_BYTES + 8 + data.length);
  const header = new DataView(file.buffer);
  file.set(IDENTIFIER);
  // Format, size of its type, width, height, depth, layers, faces, levels.
  const numbers = [FORMAT, 1, width, height, 0, layers.length > 1 ? layers.length : 0, 1, 1];
  numbers.forEach((value, i) => header.setUint32(12 + 4 * i, value, true));
  header.setBigUint64(80, BigInt(HEADER_BYTES + 8), true);
  [88, 96].forEach((at) => header.setBigUint64(at, BigInt(data.length), true));
  file.set(data, HEADER_BYTES + 8);
  return file;
}
