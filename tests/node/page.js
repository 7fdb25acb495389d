// What picture.mjs runs in the browser: loads the scene and draws it once.
import * as THREE from 'three';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';

globalThis.takePicture = async ({ camera, target, size: [width, height], fov, points }) => {
  const { scene, cameras } = await new GLTFLoader().loadAsync('/scene.glb');
  const box = new THREE.Box3().setFromObject(scene);
  scene.updateMatrixWorld(true);
  const eye = points ? cameras[0] : new THREE.PerspectiveCamera(fov, width / height, 1e-3 * diagonal(box), 10 * diagonal(box));
  const from = camera ? vector(camera) : insideEnd(box);
  const to = target ? vector(target) : middle(box);
  if (points) {
    eye.aspect = width / height;
    eye.updateProjectionMatrix();
  } else {
    eye.position.copy(from);
    eye.lookAt(to);
  }

  const renderer = new THREE.WebGLRenderer({ antialias: true, preserveDrawingBuffer: true });
  renderer.outputColorSpace = THREE.SRGBColorSpace;
  renderer.toneMapping = THREE.NoToneMapping;
  renderer.setSize(width, height, false);
  renderer.setClearColor(0x202020);
  renderer.render(scene, eye);
  const url = renderer.domElement.toDataURL('image/png');
  const gl = renderer.getContext();
  const found = points?.map(({ x, y }) => {
    const pixel = new Uint8Array(4);
    gl.readPixels(x, height - 1 - y, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
    return [...pixel.subarray(0, 3)];
  });
  return { url, camera: from.toArray(), target: to.toArray(), found };
};

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
