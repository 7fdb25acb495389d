// Draws a lit file, and moves around in it. Draws only when something has changed.

import {
  LinearToneMapping,
  Mesh,
  MeshBasicMaterial,
  NeutralToneMapping,
  PerspectiveCamera,
  Raycaster,
  Scene,
  Vector2,
  Vector3,
  WebGLRenderer,
  type Material,
} from 'three';
import type { OrbitControls } from 'three/addons/controls/OrbitControls.js';
import { dispose, type LitFile, type Quantity } from './lit_file';
import { orbit } from './orbit';
import { newPaint, paint } from './paint';
import { measure, type Reading } from './probe';
import { Walk } from './walk';

/** What is shown. */
export type Shown = 'lit' | Quantity;

/** How one moves. */
export type Motion = 'orbit' | 'walk';

/** How what is brighter than the screen is brought down to it: by what `coordinator render --tone-map` calls it. */
export type ToneMap = 'linear' | 'neutral';

/** Who is told what happens in the picture. */
export interface ViewerListener {
  /** A tap has met this, or nothing, here: from the upper left corner, in parts of the picture. */
  picked(reading: Reading | undefined, at: Vector2): void;
  /** The camera has moved. */
  moved(): void;
}

const FIELD_OF_VIEW = 50;
// Direction from which a scene without cameras is seen: from in front, a little from above and the side.
const OUTLOOK = new Vector3(0.22, 0.16, 1).normalize();
const MIDDLE = new Vector2(0.5, 0.5);
// A tap may slip by so many pixels.
const TAP = 5;
// Between two pictures while a key is held, at most: after a pause the first step is no leap.
const LONGEST_STEP = 0.1;

/** A view of a scene on a canvas. */
export class Viewer {
  file: LitFile | undefined;
  readonly #renderer: WebGLRenderer;
  readonly #scene = new Scene();
  readonly #camera = new PerspectiveCamera(FIELD_OF_VIEW);
  readonly #paint = newPaint();
  readonly #orbit: OrbitControls;
  readonly #walk: Walk;
  readonly #edges: Mesh[] = [];
  readonly #edgeMaterial = new MeshBasicMaterial({
    wireframe: true,
    transparent: true,
    opacity: 0.5,
    toneMapped: false,
    polygonOffset: true,
    polygonOffsetFactor: -1,
    polygonOffsetUnits: -1,
  });
  #showsMesh = false;
  #exposure = 1;
  #exposureSteps = 0;
  #frame = 0;
  #last = 0;

  readonly #listener: ViewerListener;

  /** Throws where the browser has no WebGL 2. */
  constructor(canvas: HTMLCanvasElement, listener: ViewerListener) {
    this.#listener = listener;
    this.#renderer = new WebGLRenderer({ canvas, antialias: true, alpha: true });
    this.#renderer.toneMapping = LinearToneMapping;
    this.#renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.#orbit = orbit(this.#camera, canvas, () => this.#moved());
    this.#walk = new Walk(this.#camera, canvas, () => this.#moved());
    new ResizeObserver(() => this.#resize()).observe(canvas.parentElement!);
    canvas.addEventListener('webglcontextrestored', () => this.draw());
    this.#watchTaps(canvas);
    this.#resize();
  }

  /**
   * Shows another file; the camera stays where it is if the file is of the same scene. An exposure that is kept lets the light of
   * one file be seen beside that of the next, where each has an exposure of its own.
   */
  show(file: LitFile, isSameScene: boolean, keepsExposure: boolean): void {
    const before = this.file;
    if (before) {
      this.#scene.remove(before.root);
      dispose(before);
    }
    for (const mesh of file.meshes) {
      if (mesh.geometry.hasAttribute('_irradiance')) mesh.material = paint(mesh, file.exposure, this.#paint);
    }
    this.file = file;
    if (!before || !keepsExposure) this.#exposure = file.exposure;
    this.#scene.add(file.root);
    this.#setEdges();
    this.setExposure(this.#exposureSteps);
    if (!isSameScene || !before) this.reset();
    this.draw();
  }

  /** Shows nothing. */
  clear(): void {
    if (!this.file) return;
    this.#scene.remove(this.file.root);
    dispose(this.file);
    this.file = undefined;
    this.#setEdges();
    this.draw();
  }

  /** Brighter than the file's own exposure by so many steps, each twice as bright. */
  setExposure(steps: number): void {
    this.#exposureSteps = steps;
    this.#renderer.toneMappingExposure = this.#exposure * 2 ** steps;
    this.draw();
  }

  setToneMap(toneMap: ToneMap): void {
    this.#renderer.toneMapping = toneMap === 'linear' ? LinearToneMapping : NeutralToneMapping;
    this.draw();
  }

  setShown(shown: Shown): void {
    this.#paint.quantity.value = ['lit', 'irradiance', 'unshot'].indexOf(shown);
    // Blue is not in most scenes; white is not in the scale of false colours.
    this.#edgeMaterial.color.set(shown === 'lit' ? 0x2f8fff : 0xffffff);
    this.draw();
  }

  /** Ends of the scale of false colours. */
  setScale(low: number, high: number, isLogarithmic: boolean): void {
    this.#paint.low.value = low;
    this.#paint.high.value = high;
    this.#paint.isLogarithmic.value = isLogarithmic;
    this.draw();
  }

  setMesh(isShown: boolean): void {
    this.#showsMesh = isShown;
    this.#setEdges();
    this.draw();
  }

  setMotion(motion: Motion): void {
    const walks = motion === 'walk';
    if (!walks && this.#walk.enabled) this.#aim();
    this.#walk.release();
    this.#walk.enabled = walks;
    this.#orbit.enabled = !walks;
    this.draw();
  }

  /** To the file's first camera, or to where the whole scene is seen. */
  reset(): void {
    if (this.file?.cameras.length) this.lookThrough(0);
    else this.overview();
  }

  /** To where the whole scene is seen. */
  overview(): void {
    const [centre, size] = this.#extent();
    const angle = Math.min(FIELD_OF_VIEW, 2 * (180 / Math.PI) * Math.atan(Math.tan((FIELD_OF_VIEW * Math.PI) / 360) * this.#camera.aspect));
    this.#camera.fov = FIELD_OF_VIEW;
    this.#camera.position.copy(centre).addScaledVector(OUTLOOK, (size / 2 / Math.sin((angle * Math.PI) / 360)) * 0.95);
    this.#camera.lookAt(centre);
    this.#settle(centre);
  }

  /** Through a camera of the file. */
  lookThrough(index: number): void {
    const camera = this.file?.cameras[index]?.camera;
    if (!camera) return;
    camera.matrixWorld.decompose(this.#camera.position, this.#camera.quaternion, new Vector3());
    this.#camera.fov = camera.fov;
    this.#aim();
  }

  /** What is seen at a place of the picture: from the upper left corner, in parts of the picture. */
  measure(at: Vector2): Reading | undefined {
    // Both may have changed since the last picture was drawn, which is when three.js works out where they are.
    this.#camera.updateMatrixWorld();
    this.file?.root.updateMatrixWorld();
    const ray = new Raycaster();
    ray.setFromCamera(new Vector2(2 * at.x - 1, 1 - 2 * at.y), this.#camera);
    return this.file && measure(ray, this.file);
  }

  /** Draws soon. */
  draw(): void {
    this.#frame ||= requestAnimationFrame((now) => {
      this.#frame = 0;
      const moved = this.#walk.step(Math.min((now - this.#last) / 1000, LONGEST_STEP));
      this.#last = now;
      this.#renderer.render(this.#scene, this.#camera);
      if (moved) this.#moved();
    });
  }

  #moved(): void {
    this.#listener.moved();
    this.draw();
  }

  // Turns around what is in the middle of the picture.
  #aim(): void {
    const [centre, size] = this.#extent();
    const forward = this.#camera.getWorldDirection(new Vector3());
    const distance = this.measure(MIDDLE)?.distance ?? this.#camera.position.distanceTo(centre);
    this.#settle(this.#camera.position.clone().addScaledVector(forward, Math.max(distance, size / 100)));
  }

  #settle(target: Vector3): void {
    const [, size] = this.#extent();
    this.#orbit.target.copy(target);
    this.#orbit.minDistance = size / 1000;
    this.#orbit.maxDistance = size * 10;
    this.#walk.extent = size;
    [this.#camera.near, this.#camera.far] = [size / 2000, size * 20];
    this.#camera.updateProjectionMatrix();
    if (this.#orbit.enabled) this.#orbit.update();
    this.#moved();
  }

  #extent(): [Vector3, number] {
    const bounds = this.file?.bounds;
    if (!bounds || bounds.isEmpty()) return [new Vector3(), 1];
    return [bounds.getCenter(new Vector3()), bounds.getSize(new Vector3()).length()];
  }

  // A second mesh of the same geometry, for lines over the picture.
  #setEdges(): void {
    for (const edge of this.#edges.splice(0)) edge.removeFromParent();
    if (!this.#showsMesh) return;
    for (const mesh of this.file?.meshes ?? []) {
      this.#edgeMaterial.side = (mesh.material as Material).side;
      const edge = new Mesh(mesh.geometry, this.#edgeMaterial);
      mesh.add(edge);
      this.#edges.push(edge);
    }
  }

  #resize(): void {
    const { clientWidth, clientHeight } = this.#renderer.domElement.parentElement!;
    if (clientWidth === 0 || clientHeight === 0) return;
    this.#renderer.setSize(clientWidth, clientHeight, false);
    this.#camera.aspect = clientWidth / clientHeight;
    this.#camera.updateProjectionMatrix();
    this.draw();
  }

  #watchTaps(canvas: HTMLCanvasElement): void {
    let start: Vector2 | undefined;
    canvas.addEventListener('pointerdown', ({ clientX, clientY, isPrimary }) => {
      start = isPrimary ? new Vector2(clientX, clientY) : undefined;
    });
    canvas.addEventListener('pointerup', ({ clientX, clientY }) => {
      if (!start || start.distanceTo(new Vector2(clientX, clientY)) > TAP) return;
      const { left, top, width, height } = canvas.getBoundingClientRect();
      const at = new Vector2((clientX - left) / width, (clientY - top) / height);
      this.#listener.picked(this.measure(at), at);
    });
    canvas.addEventListener('keydown', ({ code }) => {
      if (code === 'Enter' || code === 'KeyP') this.#listener.picked(this.measure(MIDDLE), MIDDLE);
      if (code === 'Escape') this.#listener.picked(undefined, MIDDLE);
    });
  }
}
