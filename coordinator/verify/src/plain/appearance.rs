//! The material of a primitive at a point: textures, vertex colours, alpha.

use std::collections::{BTreeSet, HashMap};
use std::f64::consts::PI;
use std::sync::Arc;

use glam::{DVec2, DVec3, DVec4};
use gltf::accessor::Dimensions;
use gltf::material::AlphaMode;
use gltf::{Material, Node, Primitive, Semantic, Texture};

use super::PlainError;
use super::source::PlainDocument;
use document::LEAST_OF_GLASS;
use document::images::image_of;
use document::texture::{Encoding, Image, Mapping, Sampler, decode};

/// Largest reflectance, as in the bake: at 1, a closed scene would never absorb its light.
pub(super) const MAX_REFLECTANCE: f64 = 0.999;

/// The material of a primitive, or of a point of it; linear RGB.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlainMaterial {
    /// Diffuse reflectance, base colour without what is mirrored, under 1.
    pub reflectance: DVec3,
    /// Emitted exitance, pi x emissive factor x strength, W/m^2.
    pub exitance: DVec3,
    /// Whether the back reflects and emits like the front, or not at all.
    pub double_sided: bool,
    /// Part of the light that does not pass through.
    pub opacity: f64,
}

/// Factors, textures and colours of a primitive.
#[derive(Debug, Clone)]
pub struct PlainAppearance {
    base: DVec4,
    mirrored: Mirrored,
    /// Exitance where the emissive texture is white.
    pub(super) exitance: DVec3,
    alpha: Alpha,
    /// Part of what is not mirrored that passes through, where its texture is red.
    transmission: f64,
    double_sided: bool,
    base_texture: Option<Layer>,
    mirrored_texture: Option<Layer>,
    transmission_texture: Option<Layer>,
    emissive_texture: Option<Layer>,
    /// COLOR_0 of each vertex; empty where there is none.
    colours: Vec<DVec4>,
}

/// The part of the light that is not reflected diffusely, where its texture is white.
#[derive(Debug, Clone, Copy)]
enum Mirrored {
    /// Metal, by metallic-roughness.
    Metal(f64),
    /// The largest channel, by KHR_materials_pbrSpecularGlossiness.
    Specular(DVec3),
    /// None: KHR_materials_unlit.
    Nothing,
}

impl Mirrored {
    fn part(self, texel: DVec4) -> f64 {
        match self {
            Self::Metal(metal) => metal * texel.z,
            Self::Specular(specular) => (specular * texel.truncate()).max_element().min(1.0),
            Self::Nothing => 0.0,
        }
    }
}

#[derive(Debug, Clone, Copy)]
enum Alpha {
    Opaque,
    /// Holes where alpha is less.
    Mask(f64),
    Blend,
}

/// An image on a primitive.
#[derive(Debug, Clone)]
struct Layer {
    image: Arc<Image>,
    sampler: Sampler,
    encoding: Encoding,
    /// Place of each vertex on the image.
    places: Vec<DVec2>,
}

/// Between the values of three vertices.
fn between<T>(values: &[T], vertices: [usize; 3], weights: DVec3) -> T
where
    T: Copy + std::ops::Mul<f64, Output = T> + std::ops::Add<Output = T>,
{
    let [a, b, c] = vertices.map(|vertex| values[vertex]);
    a * weights.x + b * weights.y + c * weights.z
}

impl Layer {
    fn at(&self, vertices: [usize; 3], weights: DVec3) -> DVec4 {
        self.sampler.look_up(&self.image, self.encoding, between(&self.places, vertices, weights))
    }
}

impl PlainAppearance {
    /// Whether all points have the same material.
    pub(super) fn is_uniform(&self) -> bool {
        let textures =
            [&self.base_texture, &self.mirrored_texture, &self.transmission_texture, &self.emissive_texture];
        self.colours.is_empty() && textures.iter().all(|texture| texture.is_none())
    }

    /// The material at a point of a triangle, given by its vertices and barycentric coordinates.
    pub(super) fn at(&self, vertices: [usize; 3], weights: DVec3) -> PlainMaterial {
        let white =
            |layer: &Option<Layer>| layer.as_ref().map_or(DVec4::ONE, |layer| layer.at(vertices, weights));
        let colour =
            if self.colours.is_empty() { DVec4::ONE } else { between(&self.colours, vertices, weights) };
        let base = self.base * white(&self.base_texture) * colour;
        let mirrored = self.mirrored.part(white(&self.mirrored_texture));
        let there = match self.alpha {
            Alpha::Opaque => 1.0,
            Alpha::Mask(cutoff) => f64::from(u8::from(base.w >= cutoff)),
            Alpha::Blend => base.w.clamp(0.0, 1.0),
        };
        let diffuse = base.truncate() * (1.0 - mirrored);
        let transmitted = self.transmission * white(&self.transmission_texture).x;
        let most = DVec3::splat(MAX_REFLECTANCE);
        let unparted = PlainMaterial {
            reflectance: diffuse.clamp(DVec3::ZERO, most),
            exitance: self.exitance * white(&self.emissive_texture).truncate(),
            double_sided: self.double_sided,
            opacity: there,
        };
        if transmitted == 0.0 || there == 0.0 {
            return unparted;
        }
        // A grey part of what is there passes. All of the reflection and the glow come from the rest.
        let through = transmitted * diffuse.clamp(DVec3::ZERO, DVec3::ONE).element_sum() / 3.0;
        let left = (1.0 - through).max(LEAST_OF_GLASS);
        PlainMaterial {
            reflectance: (diffuse * ((1.0 - transmitted) / left)).clamp(DVec3::ZERO, most),
            exitance: unparted.exitance / left,
            opacity: there * left,
            ..unparted
        }
    }

    /// Reflectance by factors alone, as the file has it: it may be out of range.
    pub(super) fn reflectance(&self) -> DVec3 {
        self.base.truncate() * (1.0 - self.mirrored.part(DVec4::ONE))
    }

    /// The material by its factors alone.
    pub(super) fn plain(&self) -> PlainMaterial {
        let bare = Self {
            base_texture: None,
            mirrored_texture: None,
            transmission_texture: None,
            emissive_texture: None,
            colours: vec![],
            ..self.clone()
        };
        bare.at([0; 3], DVec3::X)
    }
}

/// Reads appearances, each image once.
#[derive(Default)]
pub(super) struct Appearances {
    images: HashMap<usize, Option<Arc<Image>>>,
}

impl Appearances {
    /// Reads the appearance of a primitive with this number of vertices.
    pub(super) fn read(
        &mut self,
        document: &PlainDocument,
        node: &Node<'_>,
        primitive: &Primitive<'_>,
        vertices: usize,
        warnings: &mut BTreeSet<String>,
    ) -> Result<PlainAppearance, PlainError> {
        let material = primitive.material();
        let name = material_name(&material);
        let is_unlit = material.unlit();
        let (factor, textures, mirrored) = base_and_mirrored(&material);
        let strength = f64::from(material.emissive_strength().unwrap_or(1.0));
        if material.normal_texture().is_some() || material.occlusion_texture().is_some() {
            warnings.insert(format!("{name}: normal and occlusion textures ignored"));
        }
        let mut layer = |texture: Option<Mapped<'_>>, encoding| -> Result<_, PlainError> {
            let Some((texture, mapping)) = texture else { return Ok(None) };
            let Some(image) = self.image(document, &texture) else {
                warnings.insert(format!("{name}: a texture ignored, its image is missing"));
                return Ok(None);
            };
            let at = |place| mapping.transform.transform_point2(place);
            let places = if let Some(accessor) = primitive.get(&Semantic::TexCoords(mapping.set)) {
                document.check(node, &accessor, vertices, &[Dimensions::Vec2], "TEXCOORD")?;
                let reader = primitive.reader(|buffer| document.bytes(&buffer));
                let Some(places) = reader.read_tex_coords(mapping.set) else { return Ok(None) };
                places.into_f32().map(|uv| at(DVec2::from_array(uv.map(f64::from)))).collect()
            } else {
                warnings.insert(format!(
                    "{name}: a primitive has no TEXCOORD_{}, which a texture needs: it shows the texel at (0, 0) everywhere",
                    mapping.set
                ));
                vec![at(DVec2::ZERO); vertices]
            };
            Ok(Some(Layer { image, sampler: mapping.sampler, encoding, places }))
        };
        let [base_texture, mirrored_texture] = textures;
        let base_texture = layer(base_texture, Encoding::Srgb)?;
        let encoding =
            if matches!(mirrored, Mirrored::Specular(_)) { Encoding::Srgb } else { Encoding::Linear };
        let mirrored_texture = layer(mirrored_texture, encoding)?;
        let is_glossy = material.pbr_specular_glossiness().is_some();
        let transmission = material.transmission().filter(|_| !is_unlit && !is_glossy);
        let transmission_texture = transmission.as_ref().and_then(|it| it.transmission_texture());
        let transmission_texture = layer(mapped(transmission_texture), Encoding::Linear)?;
        let emissive_texture = material.emissive_texture().filter(|_| !is_unlit);
        let emissive_texture = layer(mapped(emissive_texture), Encoding::Srgb)?;
        let emissive_factor = if is_unlit { [0.0; 3] } else { material.emissive_factor() };
        let colours = match primitive.get(&Semantic::Colors(0)) {
            None => vec![],
            Some(accessor) => {
                document.check(
                    node,
                    &accessor,
                    vertices,
                    &[Dimensions::Vec3, Dimensions::Vec4],
                    "COLOR_0",
                )?;
                let reader = primitive.reader(|buffer| document.bytes(&buffer));
                let colours = reader.read_colors(0).map(|colours| {
                    colours.into_rgba_f32().map(|rgba| DVec4::from_array(rgba.map(f64::from))).collect()
                });
                colours.unwrap_or_default()
            }
        };
        Ok(PlainAppearance {
            base: DVec4::from_array(factor.map(f64::from)),
            mirrored,
            exitance: DVec3::from_array(emissive_factor.map(f64::from)) * strength * PI,
            transmission: transmission.map_or(0.0, |it| f64::from(it.transmission_factor())),
            alpha: match material.alpha_mode() {
                AlphaMode::Opaque => Alpha::Opaque,
                AlphaMode::Mask => Alpha::Mask(material.alpha_cutoff().map_or(0.5, f64::from)),
                AlphaMode::Blend => Alpha::Blend,
            },
            double_sided: material.double_sided(),
            base_texture,
            mirrored_texture,
            transmission_texture,
            emissive_texture,
            colours,
        })
    }

    fn image(&mut self, document: &PlainDocument, texture: &Texture<'_>) -> Option<Arc<Image>> {
        let index = image_of(texture)?;
        let image = document.document.images().nth(index)?;
        let read = || Some(Arc::new(decode(&document.image_bytes(&image)?).ok()?));
        self.images.entry(index).or_insert_with(read).clone()
    }
}

/// Base colour, its texture and that of what is mirrored, and how that is told.
fn base_and_mirrored<'a>(material: &Material<'a>) -> ([f32; 4], [Option<Mapped<'a>>; 2], Mirrored) {
    if let Some(glossy) = material.pbr_specular_glossiness().filter(|_| !material.unlit()) {
        let specular = DVec3::from_array(glossy.specular_factor().map(f64::from));
        let textures = [glossy.diffuse_texture(), glossy.specular_glossiness_texture()].map(mapped);
        return (glossy.diffuse_factor(), textures, Mirrored::Specular(specular));
    }
    let pbr = material.pbr_metallic_roughness();
    let [base, metal] = [pbr.base_color_texture(), pbr.metallic_roughness_texture()].map(mapped);
    if material.unlit() {
        return (pbr.base_color_factor(), [base, None], Mirrored::Nothing);
    }
    (pbr.base_color_factor(), [base, metal], Mirrored::Metal(f64::from(pbr.metallic_factor())))
}

/// A texture with its mapping.
type Mapped<'a> = (Texture<'a>, Mapping);

fn mapped<'a>(info: Option<gltf::texture::Info<'a>>) -> Option<Mapped<'a>> {
    info.map(|info| (info.texture(), Mapping::new(&info)))
}

/// A material's name in messages.
pub(super) fn material_name(material: &Material<'_>) -> String {
    match (material.name(), material.index()) {
        (Some(name), _) => format!("material {name}"),
        (None, Some(index)) => format!("material {index}"),
        (None, None) => "the default material".to_owned(),
    }
}
