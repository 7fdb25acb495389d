// Materials that show the light of a lit file: as a picture, or as false colours of a quantity.
//
// `COLOR_0` ends at 1. A picture that can be made darker is of `_IRRADIANCE` instead, which does not:
//
//   shown = tone mapping(exposure x (base colour x diffuse part x _COLOR_0 x _IRRADIANCE + pi x emitted radiance))
//
// which is base colour x COLOR_0 where nothing is clamped.

import {
  DataTexture,
  LinearFilter,
  Matrix3,
  MeshBasicMaterial,
  MeshStandardMaterial,
  SRGBColorSpace,
  type Material,
  type Mesh,
  type Texture,
} from 'three';
import { interpolateViridis } from 'd3-scale-chromatic';
import { ATTRIBUTE, diffusePart } from './lit_file';
import { LUMINANCE } from './spread';

/** What all materials of a viewer have in common. Changing a value needs no new shader. */
export interface Paint {
  /** 0: picture; 1: irradiance; 2: unshot. */
  quantity: { value: number };
  /** Ends of the scale. */
  low: { value: number };
  high: { value: number };
  isLogarithmic: { value: boolean };
  colours: { value: Texture };
}

// Colours of the scale's texture.
const STEPS = 256;

/** A colour of the scale, by its place from 0 to 1. */
export const colourAt: (place: number) => string = interpolateViridis;

/** Settings to paint with, of a picture at first. */
export function newPaint(): Paint {
  const texels = new Uint8Array(4 * STEPS).fill(255);
  for (let i = 0; i < STEPS; i++) {
    const hex = parseInt(colourAt(i / (STEPS - 1)).slice(1), 16);
    texels.set([hex >> 16, (hex >> 8) & 255, hex & 255], 4 * i);
  }
  const colours = new DataTexture(texels, STEPS, 1);
  colours.colorSpace = SRGBColorSpace;
  colours.minFilter = colours.magFilter = LinearFilter;
  colours.needsUpdate = true;
  return {
    quantity: { value: 0 },
    low: { value: 0 },
    high: { value: 1 },
    isLogarithmic: { value: true },
    colours: { value: colours },
  };
}

const VERTEX_HEAD = /* glsl */ `
attribute vec3 _irradiance;
varying vec3 vIrradiance;
#ifdef HAS_UNSHOT
  attribute UNSHOT_TYPE _unshot;
  varying UNSHOT_TYPE vUnshot;
#endif
#ifdef HAS_TINT
  attribute vec4 _color_0;
  varying vec4 vTint;
#endif
#ifdef EMISSION_UV
  uniform mat3 emissionTransform;
  varying vec2 vEmissionUv;
#endif
#if defined( EMISSION_OF_UV1 ) && ! defined( USE_UV1 )
  attribute vec2 uv1;
#endif
void main() {
  vIrradiance = _irradiance;
  #ifdef HAS_UNSHOT
    vUnshot = _unshot;
  #endif
  #ifdef HAS_TINT
    vTint = _color_0;
  #endif
  #ifdef EMISSION_UV
    vEmissionUv = ( emissionTransform * vec3( EMISSION_UV, 1.0 ) ).xy;
  #endif
`;

const FRAGMENT_HEAD = /* glsl */ `
uniform int quantity;
uniform float low;
uniform float high;
uniform bool isLogarithmic;
uniform sampler2D colours;
uniform float diffusePart;
uniform vec3 emission;
varying vec3 vIrradiance;
#ifdef HAS_UNSHOT
  varying UNSHOT_TYPE vUnshot;
#endif
#ifdef HAS_TINT
  varying vec4 vTint;
#endif
#ifdef EMISSION_UV
  uniform sampler2D emissionMap;
  varying vec2 vEmissionUv;
#endif
const vec3 LUMINANCE = vec3( ${LUMINANCE.join(', ')} );
float scalar( float value ) { return value; }
float scalar( vec3 value ) { return dot( value, LUMINANCE ); }
vec3 falseColour( float value ) {
  float place = isLogarithmic ? log( max( value, 1e-30 ) / low ) / log( high / low ) : ( value - low ) / ( high - low );
  // From the middle of the first texel to that of the last.
  float inner = ( clamp( place, 0.0, 1.0 ) * ${STEPS - 1}.0 + 0.5 ) / ${STEPS}.0;
  return texture2D( colours, vec2( inner, 0.5 ) ).rgb;
}
void main() {
`;

// Before alpha is tested: the input's vertex colours may have some.
const TINTED = /* glsl */ `
#ifdef HAS_TINT
  diffuseColor *= vTint;
#endif
`;

const LIT = /* glsl */ `
outgoingLight *= max( vIrradiance, 0.0 ) * diffusePart;
vec3 emitted = emission;
#ifdef EMISSION_UV
  emitted *= texture2D( emissionMap, vEmissionUv ).rgb;
#endif
outgoingLight += PI * emitted;
#include <opaque_fragment>
`;

const MAPPED = /* glsl */ `
if ( quantity == 0 ) {
  #include <tonemapping_fragment>
} else if ( quantity == 1 ) {
  gl_FragColor.rgb = falseColour( scalar( vIrradiance ) );
} else {
  #ifdef HAS_UNSHOT
    gl_FragColor.rgb = falseColour( scalar( vUnshot ) );
  #endif
}
`;

/** The material that shows the light of a mesh. */
export function paint(mesh: Mesh, exposure: number, paint: Paint): Material {
  const source = mesh.material as MeshBasicMaterial | MeshStandardMaterial;
  const { geometry } = mesh;
  const glowing = source instanceof MeshStandardMaterial ? source : undefined;
  const material = new MeshBasicMaterial({
    color: source.color,
    map: source.map,
    alphaTest: source.alphaTest,
    transparent: source.transparent,
    opacity: source.opacity,
    depthWrite: source.depthWrite,
    side: source.side,
  });
  const unshot = geometry.hasAttribute(ATTRIBUTE.unshot) ? geometry.getAttribute(ATTRIBUTE.unshot) : undefined;
  const emissionMap = glowing?.emissiveMap ?? null;
  emissionMap?.updateMatrix();
  material.defines = {
    ...(unshot ? { HAS_UNSHOT: '', UNSHOT_TYPE: unshot.itemSize >= 3 ? 'vec3' : 'float' } : {}),
    ...(geometry.hasAttribute('_color_0') ? { HAS_TINT: '' } : {}),
    ...(emissionMap ? { EMISSION_UV: emissionMap.channel === 1 ? 'uv1' : 'uv' } : {}),
    ...(emissionMap?.channel === 1 ? { EMISSION_OF_UV1: '' } : {}),
  };
  // What glows has no part of its base colour taken away in COLOR_0; black, for what is unlit shows no emission.
  const own = {
    diffusePart: { value: diffusePart(geometry, exposure) },
    emission: { value: glowing ? glowing.emissive.clone().multiplyScalar(glowing.emissiveIntensity) : [0, 0, 0] },
    emissionMap: { value: emissionMap },
    emissionTransform: { value: emissionMap?.matrix ?? new Matrix3() },
  };
  material.onBeforeCompile = (shader) => {
    Object.assign(shader.uniforms, paint, own);
    shader.vertexShader = shader.vertexShader.replace('void main() {', VERTEX_HEAD);
    shader.fragmentShader = shader.fragmentShader
      .replace('void main() {', FRAGMENT_HEAD)
      .replace('#include <color_fragment>', TINTED)
      .replace('#include <opaque_fragment>', LIT)
      .replace('#include <tonemapping_fragment>', MAPPED);
  };
  source.dispose();
  return material;
}

