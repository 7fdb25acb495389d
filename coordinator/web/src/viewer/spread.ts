// How a quantity is spread over a surface, for the ends of a scale that a few extreme points do not decide.

import type { BufferAttribute, BufferGeometry, InterleavedBufferAttribute } from 'three';

type Attribute = BufferAttribute | InterleavedBufferAttribute;

/** Weights of relative luminance for linear sRGB primaries (IEC 61966-2-1). */
export const LUMINANCE = [0.2126, 0.7152, 0.0722] as const;

// Bins of the histogram: 16 to an octave, from 2^-40 to 2^40 of a unit.
const OCTAVES = 80;
const BINS_PER_OCTAVE = 16;

/** Luminance of a vertex: of its three channels, or of its only one. */
export function luminanceAt(values: Attribute, vertex: number): number {
  if (values.itemSize < 3) return values.getX(vertex);
  const [r, g, b] = LUMINANCE;
  return r * values.getX(vertex) + g * values.getY(vertex) + b * values.getZ(vertex);
}

/** A histogram of luminance by area, over octaves. */
export class Spread {
  readonly #bins = new Float64Array(OCTAVES * BINS_PER_OCTAVE);
  #area = 0;

  /** Adds the triangles of a geometry: each with the mean of its vertices, by its area, where `scale` is that of the node. */
  add(geometry: BufferGeometry, values: Attribute, scale: number): void {
    const positions = geometry.getAttribute('position');
    const count = geometry.index?.count ?? positions.count;
    const vertex = (corner: number): number => geometry.index?.getX(corner) ?? corner;
    for (let corner = 0; corner + 2 < count; corner += 3) {
      const [a, b, c] = [vertex(corner), vertex(corner + 1), vertex(corner + 2)];
      const mean = (luminanceAt(values, a) + luminanceAt(values, b) + luminanceAt(values, c)) / 3;
      const area = triangleArea(positions, a, b, c) * scale;
      if (!(mean > 0) || !(area > 0)) continue;
      const bin = Math.floor((Math.log2(mean) + OCTAVES / 2) * BINS_PER_OCTAVE);
      this.#bins[Math.min(Math.max(bin, 0), this.#bins.length - 1)]! += area;
      this.#area += area;
    }
  }

  /** The value under which this part of the lit area is; nothing where no area is lit. */
  quantile(part: number): number | undefined {
    let below = 0;
    for (const [i, area] of this.#bins.entries()) {
      below += area;
      if (area > 0 && below >= part * this.#area) return 2 ** ((i + 0.5) / BINS_PER_OCTAVE - OCTAVES / 2);
    }
    return undefined;
  }

  /** Ends of a scale: without the darkest and the brightest hundredth of the area, and never empty. */
  range(): [number, number] {
    const [low, high] = [this.quantile(0.01) ?? 0.1, this.quantile(0.99) ?? 1];
    return high > low * 1.01 ? [low, high] : [low / 2, low * 2];
  }
}

function triangleArea(positions: Attribute, a: number, b: number, c: number): number {
  const [x, y, z] = [positions.getX(a), positions.getY(a), positions.getZ(a)];
  const [ux, uy, uz] = [positions.getX(b) - x, positions.getY(b) - y, positions.getZ(b) - z];
  const [vx, vy, vz] = [positions.getX(c) - x, positions.getY(c) - y, positions.getZ(c) - z];
  return Math.hypot(uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx) / 2;
}
