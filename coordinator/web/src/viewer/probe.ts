// What the light is at a point that is seen.

import { Mesh, Triangle, Vector3, type BufferAttribute, type Raycaster } from 'three';
import { ATTRIBUTE, type LitFile, type Quantity } from './lit_file';
import { LUMINANCE } from './spread';

/** Light at a point. */
export interface Reading {
  /** What the surface is called. */
  name: string;
  /** In the world. */
  point: Vector3;
  /** From the camera. */
  distance: number;
  /** Linear RGB of each quantity that the surface has, and its luminance. */
  values: Partial<Record<Quantity, { rgb: [number, number, number]; luminance: number }>>;
}

/** What a ray meets first, interpolated between the vertices. */
export function measure(ray: Raycaster, { meshes }: LitFile): Reading | undefined {
  const hit = ray.intersectObjects(meshes, false)[0];
  if (!hit?.face || !(hit.object instanceof Mesh)) return undefined;
  const { object, face, point, distance } = hit;
  const vertices = [face.a, face.b, face.c];
  const corners = vertices.map((vertex) => object.getVertexPosition(vertex, new Vector3()));
  const inside = object.worldToLocal(point.clone());
  const weights = Triangle.getBarycoord(inside, corners[0]!, corners[1]!, corners[2]!, new Vector3());
  const reading: Reading = { name: nameOf(object), point, distance, values: {} };
  for (const quantity of ['irradiance', 'unshot'] as const) {
    if (!weights || !object.geometry.hasAttribute(ATTRIBUTE[quantity])) continue;
    const values = object.geometry.getAttribute(ATTRIBUTE[quantity]) as BufferAttribute;
    // A quantity of one number is the same in all channels.
    const channel = (i: number): number =>
      vertices.reduce((sum, vertex, corner) => {
        return sum + weights.getComponent(corner) * values.getComponent(vertex, Math.min(i, values.itemSize - 1));
      }, 0);
    const rgb: [number, number, number] = [channel(0), channel(1), channel(2)];
    reading.values[quantity] = { rgb, luminance: rgb.reduce((sum, value, i) => sum + value * LUMINANCE[i]!, 0) };
  }
  return reading;
}

/** The node's name: a primitive of several is called by its parent. */
function nameOf(mesh: Mesh): string {
  return (mesh.userData['name'] as string | undefined) ?? (mesh.parent?.type === 'Group' && mesh.parent.name ? mesh.parent.name : mesh.name);
}
