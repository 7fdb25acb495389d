// Walking through a scene as one who stands in it: look by dragging, move by keys, wheel or two fingers.

import { Euler, Vector2, Vector3, type PerspectiveCamera } from 'three';

// A drag over the height of the view turns by this angle.
const TURN = Math.PI / 2;
const STEEPEST = Math.PI / 2 - 0.01;
// Seconds to cross the scene on foot; running is faster by RUN.
const CROSSING_SECONDS = 8;
const RUN = 3;

// Right, up, forward.
const DIRECTIONS: Record<string, [number, number, number]> = {
  KeyW: [0, 0, 1],
  ArrowUp: [0, 0, 1],
  KeyS: [0, 0, -1],
  ArrowDown: [0, 0, -1],
  KeyA: [-1, 0, 0],
  ArrowLeft: [-1, 0, 0],
  KeyD: [1, 0, 0],
  ArrowRight: [1, 0, 0],
  KeyE: [0, 1, 0],
  PageUp: [0, 1, 0],
  KeyQ: [0, -1, 0],
  PageDown: [0, -1, 0],
};

/** First-person control of a camera. */
export class Walk {
  /** Length that is crossed in CROSSING_SECONDS. */
  extent = 1;
  enabled = false;
  readonly #held = new Set<string>();
  readonly #pointers = new Map<number, Vector2>();
  readonly #camera: PerspectiveCamera;
  readonly #element: HTMLElement;
  readonly #changed: () => void;

  constructor(camera: PerspectiveCamera, element: HTMLElement, changed: () => void) {
    [this.#camera, this.#element, this.#changed] = [camera, element, changed];
    element.addEventListener('pointerdown', (event) => this.enabled && this.#press(event));
    element.addEventListener('pointermove', (event) => this.enabled && this.#drag(event));
    for (const end of ['pointerup', 'pointercancel'] as const) {
      element.addEventListener(end, ({ pointerId }) => this.#pointers.delete(pointerId));
    }
    element.addEventListener('wheel', (event) => this.enabled && this.#wheel(event), { passive: false });
    element.addEventListener('keydown', (event) => this.enabled && this.#key(event));
    element.addEventListener('keyup', ({ code }) => this.#held.delete(code));
    element.addEventListener('blur', () => this.#held.clear());
  }

  /** Moves on by what keys are held, after this time; whether it moved. */
  step(seconds: number): boolean {
    if (!this.enabled || this.#held.size === 0) return false;
    const move = new Vector3();
    for (const code of this.#held) move.add(new Vector3(...(DIRECTIONS[code] ?? [0, 0, 0])));
    const running = this.#held.has('ShiftLeft') || this.#held.has('ShiftRight');
    this.#move(move.multiplyScalar(((this.extent * seconds) / CROSSING_SECONDS) * (running ? RUN : 1)));
    return move.lengthSq() > 0;
  }

  /** Forgets what is held. */
  release(): void {
    this.#held.clear();
    this.#pointers.clear();
  }

  // By right, up, forward: forward is level, as feet go.
  #move({ x, y, z }: Vector3): void {
    const heading = new Euler(0, this.#angles().y, 0);
    this.#camera.position.add(new Vector3(x, y, -z).applyEuler(heading));
  }

  #angles(): Euler {
    return new Euler().setFromQuaternion(this.#camera.quaternion, 'YXZ');
  }

  #turn(by: Vector2): void {
    const angles = this.#angles();
    const scale = TURN / this.#element.clientHeight;
    const pitch = Math.min(Math.max(angles.x + by.y * scale, -STEEPEST), STEEPEST);
    this.#camera.quaternion.setFromEuler(new Euler(pitch, angles.y + by.x * scale, 0, 'YXZ'));
  }

  #press(event: PointerEvent): void {
    this.#element.setPointerCapture(event.pointerId);
    this.#pointers.set(event.pointerId, new Vector2(event.clientX, event.clientY));
  }

  #drag(event: PointerEvent): void {
    const before = this.#pointers.get(event.pointerId);
    if (!before) return;
    const now = new Vector2(event.clientX, event.clientY);
    const other = [...this.#pointers].find(([id]) => id !== event.pointerId)?.[1];
    const by = now.clone().sub(before);
    if (other) {
      // Each finger does half: apart is forward, together is back, along is sideways.
      const scale = this.extent / this.#element.clientHeight;
      const apart = now.distanceTo(other) - before.distanceTo(other);
      this.#move(new Vector3(-by.x / 2, by.y / 2, apart).multiplyScalar(scale));
    } else {
      this.#turn(by);
    }
    this.#pointers.set(event.pointerId, now);
    this.#changed();
  }

  #wheel(event: WheelEvent): void {
    event.preventDefault();
    // A notch, whatever unit the browser counts in, is a step.
    this.#move(new Vector3(0, 0, (-Math.sign(event.deltaY) * this.extent) / 40));
    this.#changed();
  }

  #key(event: KeyboardEvent): void {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.code.startsWith('Shift')) this.#held.add(event.code);
    if (!(event.code in DIRECTIONS)) return;
    event.preventDefault();
    this.#held.add(event.code);
    this.#changed();
  }
}
