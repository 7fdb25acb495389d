/** Light probes of Halflight: light at points in space, for things that move. */
import { LightProbe, Vector3 } from 'three';
import type { GLTF } from 'three/addons/loaders/GLTFLoader.js';

/** What `asset.extras.halflight.probes` holds, and the file of probes. */
export interface ProbeData {
  positions: [number, number, number][];
  inside: boolean[];
  /** Harmonics of each probe: red, green and blue of nine. */
  coefficients: number[][];
  grid?: { origin: [number, number, number]; spacing: number; size: [number, number, number] };
}

/** The probes of a file. */
export class Probes {
  constructor(private readonly data: ProbeData) {}

  /** The probes of a loaded file, if it has any. */
  static of(gltf: GLTF): Probes | undefined {
    const data: ProbeData | undefined = gltf.asset.extras?.['halflight']?.probes;
    return data && new Probes(data);
  }

  /**
   * Sets a light probe to the light at a place, in the file's coordinates: of a grid what lies between the probes around it, else what
   * the nearest probe has that is not inside of a wall.
   */
  at(position: Vector3, target = new LightProbe()): LightProbe {
    const sum = target.sh.zero();
    for (const [probe, weight] of this.data.grid ? this.around(position) : this.nearest(position)) {
      const values = this.data.coefficients[probe]!;
      sum.coefficients.forEach((band, index) => {
        band.x += weight * values[3 * index]!;
        band.y += weight * values[3 * index + 1]!;
        band.z += weight * values[3 * index + 2]!;
      });
    }
    return target;
  }

  /** The probes at the corners of the grid's cell, with weights that sum to 1. */
  private around(position: Vector3): [number, number][] {
    const { origin, spacing, size } = this.data.grid!;
    let all: [number, number][] = [[0, 1]];
    let step = 1;
    position.toArray().forEach((coordinate, axis) => {
      const count = size[axis]!;
      const place = Math.min(Math.max((coordinate - origin[axis]!) / spacing, 0), count - 1);
      const low = Math.min(Math.floor(place), Math.max(count - 2, 0));
      const part = place - low;
      const ends: [number, number][] = count > 1 ? [[low, 1 - part], [low + 1, part]] : [[0, 1]];
      all = all.flatMap(([probe, weight]) =>
        ends.map(([index, own]): [number, number] => [probe + index * step, weight * own]),
      );
      step *= count;
    });
    return all;
  }

  private nearest(position: Vector3): [number, number][] {
    const { positions, inside } = this.data;
    let found: [number, number][] = [];
    let least = Infinity;
    positions.forEach((own, probe) => {
      const distance = position.distanceToSquared(new Vector3(...own));
      if (!inside[probe] && distance < least) [least, found] = [distance, [[probe, 1]]];
    });
    return found;
  }
}
