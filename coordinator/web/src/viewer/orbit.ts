// Turning a scene like a thing on a table.

import { Spherical, Vector3, type PerspectiveCamera } from 'three';
import { OrbitControls } from 'three/addons/controls/OrbitControls.js';

// What a key does at a time.
const TURN = Math.PI / 36;
const NEARER = 0.9;

// Angle around the vertical, angle from it, factor of the distance: by place on the keyboard, or by what the key writes.
const KEYS: Record<string, [number, number, number]> = {
  ArrowLeft: [-TURN, 0, 1],
  ArrowRight: [TURN, 0, 1],
  ArrowUp: [0, -TURN, 1],
  ArrowDown: [0, TURN, 1],
  KeyA: [-TURN, 0, 1],
  KeyD: [TURN, 0, 1],
  KeyW: [0, -TURN, 1],
  KeyS: [0, TURN, 1],
  '+': [0, 0, NEARER],
  '=': [0, 0, NEARER],
  '-': [0, 0, 1 / NEARER],
};

/** Orbiting controls of a camera, by pointer, fingers and keys. */
export function orbit(camera: PerspectiveCamera, element: HTMLElement, changed: () => void): OrbitControls {
  const controls = new OrbitControls(camera, element);
  controls.addEventListener('change', changed);
  element.addEventListener('keydown', (event) => {
    const key = KEYS[event.code] ?? KEYS[event.key];
    if (!controls.enabled || !key || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    const place = new Spherical().setFromVector3(new Vector3().subVectors(camera.position, controls.target));
    place.set(place.radius * key[2], place.phi + key[1], place.theta + key[0]).makeSafe();
    camera.position.setFromSpherical(place).add(controls.target);
    controls.update();
    changed();
  });
  return controls;
}
