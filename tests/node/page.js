// What picture.mjs runs in the browser: loads the scene, draws it once, and looks where another picture of it differs.
import * as THREE from 'three';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
import { MeshoptDecoder } from 'three/addons/libs/meshopt_decoder.module.js';

globalThis.takePicture = async ({ camera, target, size: [width, height], fov, points, other, baked, exposure }) => {
  const loader = new GLTFLoader().setMeshoptDecoder(MeshoptDecoder);
  if (baked) loader.register((await import('halflight-three')).halflight());
  const { scene, cameras, asset } = await loader.loadAsync('/scene.glb');
  const box = new THREE.Box3().setFromObject(scene);
  scene.updateMatrixWorld(true);
  const isOwn = points || other || (baked && !camera && cameras.length > 0);
  const eye = isOwn ? cameras[0] : new THREE.PerspectiveCamera(fov, width / height, 1e-3 * diagonal(box), 10 * diagonal(box));
  const from = camera ? vector(camera) : insideEnd(box);
  const to = target ? vector(target) : middle(box);
  if (isOwn) {
    eye.aspect = width / height;
    eye.updateProjectionMatrix();
  } else {
    eye.position.copy(from);
    eye.lookAt(to);
  }

  const renderer = new THREE.WebGLRenderer({ antialias: true, preserveDrawingBuffer: true });
  renderer.outputColorSpace = THREE.SRGBColorSpace;
  renderer.toneMapping = THREE.NoToneMapping;
  if (baked) showLamps(renderer, scene, exposure ?? asset.extras?.halflight?.exposure ?? 1);
  renderer.setSize(width, height, false);
  renderer.setClearColor(0x202020);
  renderer.render(scene, eye);
  const url = renderer.domElement.toDataURL('image/png');
  const gl = renderer.getContext();
  const pixels = () => {
    const all = new Uint8Array(4 * width * height);
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, all);
    return (x, y) => all.subarray(4 * ((height - 1 - y) * width + x)).subarray(0, 3);
  };
  const shown = pixels();
  const found = points?.map(({ x, y }) => [...shown(x, y)]);
  let pairs;
  if (other) {
    paintComparable(scene);
    renderer.setClearColor(0x000000);
    renderer.render(scene, eye);
    pairs = comparable(shown, pixels(), await otherPixels(width, height), width, height);
  }
  return { url, camera: from.toArray(), target: to.toArray(), found, pairs };
};

// The lamps of the file with their shadows, as bright as baked light is shown.
function showLamps(renderer, scene, exposure) {
  renderer.toneMapping = THREE.LinearToneMapping;
  renderer.toneMappingExposure = Math.PI * exposure;
  renderer.shadowMap.enabled = true;
  scene.traverse((object) => {
    // A shadow map knows no panes.
    object.castShadow = object.isMesh ? !object.material.transparent : object.isLight === true;
    object.receiveShadow = object.isMesh;
    // Sheets cast shadows whichever side a lamp sees.
    if (object.isMesh) object.material.shadowSide = THREE.DoubleSide;
    if (!object.isLight) return;
    object.shadow?.mapSize.set(2048, 2048);
    if (object.shadow) object.shadow.normalBias = 0.02;
    if (object.isDirectionalLight) {
      Object.assign(object.shadow.camera, { left: -6, right: 6, top: 6, bottom: -6, near: -10, far: 20 });
    }
  });
}

// White where only reflected light shows, the light that the file holds. Black where emission does, which this library does not expose;
// where holes or panes do, which a browser blends in encoded colours; and towards vertices whose COLOR_0 is clipped: the other picture
// clips what is interpolated.
function paintComparable(scene) {
  scene.traverse((object) => {
    if (!object.isMesh) return;
    const { isMeshBasicMaterial, transparent, alphaTest, side } = object.material;
    const color = isMeshBasicMaterial && !transparent && alphaTest === 0 ? 0xffffff : 0x000000;
    const { color: colours } = object.geometry.attributes;
    if (colours) {
      const isWhole = (vertex) => Math.max(colours.getX(vertex), colours.getY(vertex), colours.getZ(vertex)) < 1;
      const whole = Array.from({ length: colours.count }, (_, vertex) => Array(3).fill(isWhole(vertex) ? 1 : 0));
      object.geometry.setAttribute('color', new THREE.Float32BufferAttribute(whole.flat(), 3));
    }
    object.material = new THREE.MeshBasicMaterial({ color, side, vertexColors: colours !== undefined });
  });
}

async function otherPixels(width, height) {
  const picture = await createImageBitmap(await (await fetch('/other.png')).blob(), { colorSpaceConversion: 'none' });
  const canvas = new OffscreenCanvas(width, height).getContext('2d');
  canvas.drawImage(picture, 0, 0);
  const { data } = canvas.getImageData(0, 0, width, height);
  return (x, y) => data.subarray(4 * (y * width + x)).subarray(0, 3);
}

// Largest difference to a neighbour, of 255: both pictures take means over a pixel, but of other samples, so that borders of surfaces and
// of texels differ.
const SMOOTH = 5;

// Both colours of all pixels that can be compared: what is around them is of the comparable kind and smooth.
function comparable(shown, mask, other, width, height) {
  const pairs = [];
  const differ = (a, b) => Math.max(...a.map((value, i) => Math.abs(value - b[i]))) > SMOOTH;
  for (let y = 1; y < height - 1; y += 1) {
    for (let x = 1; x < width - 1; x += 1) {
      const own = [...shown(x, y)];
      let isClear = true;
      for (let i = 0; i < 9 && isClear; i += 1) {
        const [nx, ny] = [x - 1 + (i % 3), y - 1 + Math.floor(i / 3)];
        isClear = mask(nx, ny).every((value) => value === 255) && !differ(own, shown(nx, ny));
      }
      if (isClear) pairs.push({ x, y, own, other: [...other(x, y)] });
    }
  }
  return pairs;
}

function vector(numbers) {
  return new THREE.Vector3(...numbers);
}

function middle(box) {
  return box.getCenter(new THREE.Vector3());
}

function diagonal(box) {
  return box.getSize(new THREE.Vector3()).length();
}

// Just inside the end of the longer horizontal axis, at the middle of the others.
function insideEnd(box) {
  const axis = box.max.x - box.min.x > box.max.z - box.min.z ? 'x' : 'z';
  const from = middle(box);
  from[axis] = THREE.MathUtils.lerp(box.min[axis], box.max[axis], 0.98);
  return from;
}
