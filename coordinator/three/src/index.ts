/**
 * Baked light of Halflight in three.js.
 *
 *     const loader = new GLTFLoader().register(halflight());
 *
 * Light at vertices (`_IRRADIANCE`) and in lightmaps (`MOZ_lightmap`) is added to the indirect diffuse light of the file's own materials,
 * so that lamps, shadows and reflections of the scene stay. Light probes are for the rest: `Probes.of(gltf)?.at(position)`.
 */
import { LoaderUtils, Mesh, MeshStandardMaterial, ShaderChunk, SRGBColorSpace } from 'three';
import type { Object3D, Texture, WebGLProgramParametersWithUniforms, WebGLRenderer } from 'three';
import type { GLTF, GLTFLoaderPlugin, GLTFParser } from 'three/addons/loaders/GLTFLoader.js';
import { BPTC, MOST_LIGHT, partOf, readPage } from './pages.js';
import type { Part } from './pages.js';

export { Probes } from './probes.js';
export type { ProbeData } from './probes.js';

/** What the plugin does. */
export interface Options {
  /** Factor of the baked light [default: 1]. The file's unit of irradiance times it is what lamps of the scene give. */
  intensity?: number;
  /** Renderer of the scene: pages as KTX2 beside the file are then read in place of PNGs, if its graphics hardware has their format. */
  renderer?: WebGLRenderer;
}

/** What the file says of its lightmap. */
interface Lightmap {
  encoding?: string;
  /** Irradiance that 1 stands for in the PNGs: the largest. */
  scale?: number;
  /** Textures of the pages. */
  textures?: number[];
  /** Names of the pages beside the file. */
  files?: string[];
}

/** A material's link to its lightmap. */
interface Link {
  index: number;
  texCoord?: number;
  intensity?: number;
  /** The part of the page that an instance has. */
  extensions?: { KHR_texture_transform?: Part };
}

/** Materials that reflect diffuse light. */
type Lit = MeshStandardMaterial;

/** Name of the attribute in three.js, which makes custom ones lower-case. */
const ATTRIBUTE = '_irradiance';

const EXTENSION = 'MOZ_lightmap';

/** The plugin, for `GLTFLoader.register`. */
export function halflight(options: Options = {}): (parser: GLTFParser) => GLTFLoaderPlugin {
  return (parser) => new BakedLight(parser, options);
}

class BakedLight implements GLTFLoaderPlugin {
  readonly name = EXTENSION;
  /** The copy of each material for meshes without light at their vertices, and for those with it. */
  private readonly copies = [new Map<Lit, Lit>(), new Map<Lit, Lit>()] as const;
  /** The pages that were read from files, by name; `undefined` where that failed. */
  private readonly pages = new Map<string, Promise<Texture | undefined>>();

  constructor(
    private readonly parser: GLTFParser,
    private readonly options: Options,
  ) {}

  /** Gives a material its lightmap. */
  async extendMaterialParams(index: number, params: Record<string, unknown>): Promise<void> {
    const material = this.parser.json.materials?.[index];
    const link: Link | undefined = material?.extensions?.[EXTENSION];
    if (!link || material.extensions.KHR_materials_unlit) return;
    const page = await this.pageBeside(link);
    if (page) {
      const { scale = 1 } = this.lightmap;
      params['lightMap'] = partOf(page, link.texCoord ?? 0, link.extensions?.KHR_texture_transform);
      params['lightMapIntensity'] = (link.intensity ?? scale) / scale;
      return;
    }
    const texture = { index: link.index, texCoord: link.texCoord, extensions: link.extensions };
    const isSrgb = this.lightmap.encoding === 'srgb';
    await this.parser.assignTexture(params, 'lightMap', texture, isSrgb ? SRGBColorSpace : undefined);
    params['lightMapIntensity'] = link.intensity ?? 1;
  }

  /** Gives meshes with baked light materials that show it. */
  async afterRoot({ scenes }: GLTF): Promise<void> {
    for (const scene of scenes) scene.traverse((object) => this.light(object));
  }

  private get lightmap(): Lightmap {
    return this.parser.json.asset.extras?.halflight?.lightmap ?? {};
  }

  /** The page of a link out of its file beside the glTF, if there is one that holds its light and that the graphics hardware can read. */
  private async pageBeside({ index, extensions }: Link): Promise<Texture | undefined> {
    const { files, textures, scale = 1 } = this.lightmap;
    const name = files?.[textures?.indexOf(index) ?? -1];
    const isTurned = Boolean(extensions?.KHR_texture_transform?.rotation);
    const canRead = this.options.renderer?.extensions?.has(BPTC) && scale <= MOST_LIGHT && !isTurned;
    if (!name?.endsWith('.ktx2') || !canRead) return undefined;
    const page = this.pages.get(name) ?? this.load(name);
    this.pages.set(name, page);
    return page;
  }

  private async load(name: string): Promise<Texture | undefined> {
    try {
      const address = LoaderUtils.resolveURL(encodeURIComponent(name), this.parser.options.path);
      return readPage((await this.parser.fileLoader.loadAsync(address)) as ArrayBuffer);
    } catch (error) {
      console.warn(`halflight: PNG in place of ${name}:`, error);
      return undefined;
    }
  }

  private light(object: Object3D): void {
    if (!(object instanceof Mesh) || !(object.material instanceof MeshStandardMaterial)) return;
    const hasVertices = object.geometry.hasAttribute(ATTRIBUTE);
    if (hasVertices || object.material.lightMap) object.material = this.copy(object.material, hasVertices);
  }

  private copy(material: Lit, hasVertices: boolean): Lit {
    const copies = this.copies[hasVertices ? 1 : 0];
    const made = copies.get(material);
    if (made) return made;
    const copy = material.clone();
    const hasMultiplier = this.lightmap.encoding === 'rgbm';
    const intensity = { value: this.options.intensity ?? 1 };
    copy.onBeforeCompile = (shader) => addLight(shader, intensity, hasVertices, hasMultiplier);
    copy.customProgramCacheKey = () => `halflight ${hasVertices} ${hasMultiplier}`;
    copies.set(material, copy);
    return copy;
  }
}

/** What light probes add, which stand for the light that these meshes have of their own. */
const PROBE = 'irradiance += getLightProbeIrradiance( lightProbe, geometryNormal );';

/** Adds base colour x (1 - metalness) x irradiance / pi to what a shader shows, below ambient occlusion. */
function addLight(
  shader: WebGLProgramParametersWithUniforms,
  intensity: { value: number },
  hasVertices: boolean,
  hasMultiplier: boolean,
): void {
  const texel = `lightMapTexel.rgb${hasMultiplier ? ' * lightMapTexel.a' : ''}`;
  const maps = ShaderChunk.lights_fragment_maps.replace(
    'irradiance += lightMapIrradiance;',
    `baked += ${texel} * lightMapIntensity;`,
  );
  shader.uniforms['bakedIntensity'] = intensity;
  shader.fragmentShader = shader.fragmentShader
    .replace('#include <common>', '#include <common>\nuniform float bakedIntensity;')
    .replace('#include <lights_fragment_begin>', ShaderChunk.lights_fragment_begin.replace(PROBE, ''))
    .replace('#include <lights_fragment_maps>', `vec3 baked = vec3( 0.0 );\n${maps}`)
    .replace(
      '#include <lights_fragment_end>',
      `#include <lights_fragment_end>
reflectedLight.indirectDiffuse +=
  bakedIntensity * baked * RECIPROCAL_PI * diffuseColor.rgb * ( 1.0 - metalnessFactor );`,
    );
  if (!hasVertices) return;
  shader.vertexShader = shader.vertexShader
    .replace('#include <common>', `#include <common>\nattribute vec3 ${ATTRIBUTE};\nvarying vec3 vBaked;`)
    .replace('#include <begin_vertex>', `#include <begin_vertex>\nvBaked = ${ATTRIBUTE};`);
  shader.fragmentShader = shader.fragmentShader
    .replace('#include <common>', '#include <common>\nvarying vec3 vBaked;')
    .replace('vec3 baked = vec3( 0.0 );', 'vec3 baked = vBaked;');
}
