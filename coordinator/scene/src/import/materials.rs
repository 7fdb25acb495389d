//! Reflectance, emission and opacity of materials.
//!
//! | in the material | taken as |
//! |---|---|
//! | metallic-roughness | base colour x (1 - metallic) |
//! | KHR_materials_pbrSpecularGlossiness | diffuse x (1 - largest channel of specular); it goes before metallic-roughness where both are there |
//! | KHR_materials_unlit | base colour, and no emission: what a viewer shows is a colour of a surface, not light from it |
//! | KHR_materials_specular | no change: what its coat mirrors is taken from diffuse light to a few percent only, as without it |
//! | KHR_materials_transmission | that part of the base colour passes through instead of being reflected |
//! | emission | pi x factor x strength x texture |
//! | alpha MASK, BLEND | opacity, by which reflectance and exitance are multiplied |

use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::PI;
use std::sync::Arc;

use glam::DVec3;
use gltf::Material;
use gltf::material::{AlphaMode, Transmission};

use super::extremes::MOST;
use super::tally::Tally;
use crate::appearance::{Layer, MAX_REFLECTANCE, Pattern};
use crate::means::{AreaMeans, Composed, Dimming, Opacity};
use document::ImportProblem;
use document::images::{Images, image_of};
use document::labels::material_label;
use document::texture::Mapping;

/// Cutoff of a mask that states none.
const CUTOFF: f32 = 0.5;

/// A texture and how it is mapped.
struct Textured<'a> {
    texture: gltf::Texture<'a>,
    mapping: Mapping,
}

impl<'a> Textured<'a> {
    fn new(info: &gltf::texture::Info<'a>) -> Self {
        Self { texture: info.texture(), mapping: Mapping::new(info) }
    }
}

/// Factors and textures of a material that affect diffuse light, whichever its workflow.
struct Inputs<'a> {
    /// Diffuse colour without metal or mirror.
    base: [f32; 4],
    base_texture: Option<Textured<'a>>,
    dims: Dims,
    dims_texture: Option<Textured<'a>>,
    /// The part of what is neither metal nor mirror that passes through.
    transmission: f32,
    transmission_texture: Option<Textured<'a>>,
    emits: bool,
}

/// The part of the light that is not reflected diffusely.
enum Dims {
    Metal(f32),
    Specular([f32; 3]),
    Nothing,
}

impl<'a> Inputs<'a> {
    fn new(material: &Material<'a>) -> Self {
        let plain = material.pbr_metallic_roughness();
        if let Some(glossy) = material.pbr_specular_glossiness().filter(|_| !material.unlit()) {
            return Self {
                base: glossy.diffuse_factor(),
                base_texture: glossy.diffuse_texture().as_ref().map(Textured::new),
                dims: Dims::Specular(glossy.specular_factor()),
                dims_texture: glossy.specular_glossiness_texture().as_ref().map(Textured::new),
                transmission: 0.0,
                transmission_texture: None,
                emits: true,
            };
        }
        let metal = plain.metallic_roughness_texture();
        let transmission = material.transmission().filter(|_| !material.unlit());
        let transmission_texture = transmission.as_ref().and_then(Transmission::transmission_texture);
        Self {
            base: plain.base_color_factor(),
            base_texture: plain.base_color_texture().as_ref().map(Textured::new),
            dims: if material.unlit() { Dims::Nothing } else { Dims::Metal(plain.metallic_factor()) },
            dims_texture: metal.filter(|_| !material.unlit()).as_ref().map(Textured::new),
            transmission: transmission.map_or(0.0, |transmission| transmission.transmission_factor()),
            transmission_texture: transmission_texture.as_ref().map(Textured::new),
            emits: !material.unlit(),
        }
    }

    /// The textures that affect diffuse light, given the factors: base colour, metal or specular, transmission, emission.
    fn textures(&self, material: &Material<'a>) -> [Option<Textured<'a>>; 4] {
        let copy = |textured: &Option<Textured<'a>>| {
            textured.as_ref().map(|own| Textured { texture: own.texture.clone(), mapping: own.mapping })
        };
        let is_dimmed = match self.dims {
            Dims::Metal(factor) => factor != 0.0,
            Dims::Specular(factor) => factor != [0.0; 3],
            Dims::Nothing => false,
        };
        let shines = self.emits && material.emissive_factor() != [0.0; 3];
        let is_black = self.base[..3] == [0.0; 3];
        [
            copy(&self.base_texture).filter(|_| !is_black || material.alpha_mode() != AlphaMode::Opaque),
            copy(&self.dims_texture).filter(|_| is_dimmed && !is_black),
            copy(&self.transmission_texture).filter(|_| self.transmission != 0.0 && !is_black),
            material.emissive_texture().as_ref().map(Textured::new).filter(|_| shines),
        ]
    }
}

/// Images that a material needs.
pub(super) fn needed_images(material: &Material) -> BTreeSet<usize> {
    let textures = Inputs::new(material).textures(material);
    textures.iter().flatten().filter_map(|textured| image_of(&textured.texture)).collect()
}

/// Materials in use, each evaluated and warned about once.
pub(super) struct Materials {
    images: Images,
    /// Images ready for means, each composition once.
    composed: Vec<Arc<AreaMeans<Composed>>>,
    by_index: BTreeMap<Option<usize>, Arc<Pattern>>,
}

impl Materials {
    /// No materials yet; textures take these images.
    pub(super) fn new(images: Images) -> Self {
        Self { images, composed: vec![], by_index: BTreeMap::new() }
    }

    /// The pattern of a material.
    ///
    /// # Errors
    /// When a factor is out of range.
    pub(super) fn pattern(
        &mut self,
        material: &Material,
        tally: &mut Tally,
        warnings: &mut Vec<String>,
    ) -> Result<Arc<Pattern>, ImportProblem> {
        if let Some(known) = self.by_index.get(&material.index()) {
            return Ok(known.clone());
        }
        let factors = Factors::read(material, warnings)?;
        let pattern = Arc::new(self.textured(material, &factors));
        count(material, &pattern, tally);
        self.by_index.insert(material.index(), pattern.clone());
        Ok(pattern)
    }

    fn textured(&mut self, material: &Material, factors: &Factors) -> Pattern {
        let inputs = Inputs::new(material);
        let [base, dims, transmission, emission] = inputs.textures(material).map(|textured| {
            let textured = textured?;
            let image = self.images.get(&image_of(&textured.texture)?)?.clone();
            Some((image, textured.mapping))
        });
        let dimming = dims.map(|(image, mapping)| match inputs.dims {
            Dims::Specular(factor) => {
                (Dimming::Specular(image, DVec3::from_array(factor.map(f64::from))), mapping)
            }
            Dims::Metal(factor) => (Dimming::Metal(image, f64::from(factor)), mapping),
            Dims::Nothing => (Dimming::Metal(image, 0.0), mapping),
        });
        // The factor of what dims is in the texture's own values where there is one.
        let rest = if dimming.is_some() { 1.0 } else { factors.rest };
        let opacity = factors.opacity;
        let base_alpha = match (opacity, &base) {
            (Opacity::Opaque, _) | (_, None) => None,
            (_, Some((image, _))) => Some((image.clone(), opacity)),
        };
        let base_mapping = base.as_ref().map(|(_, mapping)| *mapping);
        let (joined, apart) = match (dimming, base_mapping) {
            (Some((dimming, mapping)), Some(own)) if mapping != own => (None, Some((dimming, mapping))),
            (dimming, _) => (dimming, None),
        };
        let mapping = base_mapping.or(joined.as_ref().map(|(_, mapping)| *mapping));
        let whole = mapping.map(|_| {
            let colour = base.as_ref().map(|(image, _)| image.clone());
            let dimming = joined.into_iter().map(|(dimming, _)| dimming).collect();
            Composed::new(colour, dimming, base_alpha.clone())
        });
        let alone = |dimming: Dimming| Composed::new(None, vec![dimming], None);
        let dimming = apart.map(|(dimming, mapping)| Layer { image: self.means(alone(dimming)), mapping });
        let mut transmitting_has_colour = false;
        let transmitting = transmission.map(|(image, own)| {
            let dimming = Dimming::Transmission(image, factors.transmission);
            let composed = match &whole {
                Some(whole) if mapping == Some(own) => {
                    transmitting_has_colour = true;
                    whole.dimmed(dimming)
                }
                _ => alone(dimming),
            };
            Layer { image: self.means(composed), mapping: own }
        });
        let reflecting =
            whole.zip(mapping).map(|(whole, mapping)| Layer { image: self.means(whole), mapping });
        let mut emitting_has_opacity = false;
        let emitting = emission.map(|(image, mapping)| {
            let alpha = base_alpha.filter(|_| base_mapping == Some(mapping));
            emitting_has_opacity = alpha.is_some();
            Layer { image: self.means(Composed::new(Some(image), vec![], alpha)), mapping }
        });
        let pattern = Pattern {
            reflecting,
            dimming,
            transmitting,
            transmitting_has_colour,
            emitting,
            emitting_has_opacity,
            reflectance: factors.base * rest,
            exitance: factors.exitance,
            opacity,
            transmission: factors.transmission,
        };
        without_constants(pattern)
    }

    fn means(&mut self, composed: Composed) -> Arc<AreaMeans<Composed>> {
        if let Some(known) = self.composed.iter().find(|known| known.raster().is(&composed)) {
            return known.clone();
        }
        let means = Arc::new(AreaMeans::new(composed));
        self.composed.push(means.clone());
        means
    }
}

/// Images of one colour become factors, so that the surface is uniform.
fn without_constants(mut pattern: Pattern) -> Pattern {
    let constant = |layer: &Option<Layer>| layer.as_ref().and_then(|layer| layer.image.constant());
    if pattern.opacity == Opacity::Opaque
        && !pattern.transmitting_has_colour
        && let Some(colour) = constant(&pattern.reflecting)
    {
        pattern.reflectance *= colour.truncate();
        pattern.reflecting = None;
    }
    if let Some(colour) = constant(&pattern.dimming) {
        pattern.reflectance *= colour.truncate();
        pattern.dimming = None;
    }
    if !pattern.transmitting_has_colour
        && let Some(left) = constant(&pattern.transmitting)
    {
        pattern.transmission = 1.0 - left.x;
        pattern.transmitting = None;
    }
    if !pattern.emitting_has_opacity
        && let Some(colour) = constant(&pattern.emitting)
    {
        pattern.exitance *= colour.truncate();
        pattern.emitting = None;
    }
    pattern
}

/// Checked factors of a material.
struct Factors {
    base: DVec3,
    /// The part of it that is reflected diffusely.
    rest: f64,
    transmission: f64,
    exitance: DVec3,
    opacity: Opacity,
}

impl Factors {
    fn read(material: &Material, warnings: &mut Vec<String>) -> Result<Self, ImportProblem> {
        let label = material_label(material);
        let factor = |name, value: f32, max: f32, expected| {
            if value.is_finite() && (0.0..=max).contains(&value) {
                return Ok(f64::from(value));
            }
            Err(ImportProblem::Factor { place: label.clone(), factor: name, value, expected })
        };
        let colour = |name, value: [f32; 3]| -> Result<DVec3, ImportProblem> {
            let channel = |value| factor(name, value, f32::MAX, "finite and not negative");
            Ok(DVec3::new(channel(value[0])?, channel(value[1])?, channel(value[2])?))
        };
        let inputs = Inputs::new(material);
        let [red, green, blue, alpha] = inputs.base;
        let rest = match inputs.dims {
            Dims::Specular(specular) => 1.0 - colour("specularFactor", specular)?.max_element().min(1.0),
            Dims::Metal(metallic) => 1.0 - factor("metallicFactor", metallic, 1.0, "from 0 to 1")?,
            Dims::Nothing => 1.0,
        };
        let base_name =
            if matches!(inputs.dims, Dims::Specular(_)) { "diffuseFactor" } else { "baseColorFactor" };
        let base = colour(base_name, [red, green, blue])?;
        let transmission = factor("transmissionFactor", inputs.transmission, 1.0, "from 0 to 1")?;
        let strength = material.emissive_strength().unwrap_or(1.0);
        let strength = factor("emissiveStrength", strength, f32::MAX, "finite and not negative")?;
        let emission = PI * strength * colour("emissiveFactor", material.emissive_factor())?;
        if emission.max_element() > MOST {
            return Err(ImportProblem::TooBright { place: label, value: emission.max_element() });
        }
        let exitance = if inputs.emits { emission } else { DVec3::ZERO };
        let opacity = match material.alpha_mode() {
            AlphaMode::Opaque => Opacity::Opaque,
            AlphaMode::Mask => {
                let cutoff = material.alpha_cutoff().unwrap_or(CUTOFF);
                let cutoff = factor("alphaCutoff", cutoff, f32::MAX, "finite and not negative")?;
                Opacity::Mask { factor: factor(base_name, alpha, 1.0, "from 0 to 1 in its alpha")?, cutoff }
            }
            AlphaMode::Blend => {
                Opacity::Blend { factor: factor(base_name, alpha, 1.0, "from 0 to 1 in its alpha")? }
            }
        };

        let is_textured = inputs.base_texture.is_some();
        let left = if inputs.transmission_texture.is_some() { 1.0 } else { 1.0 - transmission };
        let reflectance = base * rest * left;
        if reflectance.max_element() >= 1.0 && !is_textured || base.max_element() > 1.0 && is_textured {
            warnings.push(format!(
                "{label}: reflectance clamped from {:.3} to {MAX_REFLECTANCE}",
                reflectance.max_element()
            ));
        }
        let is_metal = matches!(inputs.dims, Dims::Metal(1.0)) && inputs.dims_texture.is_none();
        if is_metal && base != DVec3::ZERO && exitance == DVec3::ZERO {
            let default = if material.index().is_none() { ", as glTF's default material is" } else { "" };
            warnings.push(format!(
                "{label}: fully metallic{default}, so it reflects no diffuse light; set metallicFactor to 0 if it should"
            ));
        }
        if material.unlit() && emission != DVec3::ZERO {
            warnings.push(format!(
                "{label}: unlit, so its emission is left out; remove KHR_materials_unlit if it is a light"
            ));
        }
        Ok(Self { base, rest, transmission, exitance, opacity })
    }
}

/// Counts the parts of a material that are modelled or ignored.
fn count(material: &Material, pattern: &Pattern, tally: &mut Tally) {
    let inputs = Inputs::new(material);
    let is_glossy = matches!(inputs.dims, Dims::Specular(_));
    let named = inputs.textures(material).map(|textured| textured.is_some());
    let kinds = if is_glossy {
        ["diffuse texture", "specular-glossiness texture (its specular colour)"]
    } else {
        ["base colour texture", "metallic-roughness texture (its metal)"]
    };
    let kinds = kinds.into_iter().chain(["transmission texture", "emissive texture"]);
    kinds.zip(named).filter(|(_, there)| *there).for_each(|(kind, _)| tally.modelled(kind));
    match pattern.opacity {
        Opacity::Opaque => {}
        Opacity::Mask { .. } => tally.modelled("material with an alpha mask"),
        Opacity::Blend { .. } => tally.modelled("material with alpha blending"),
    }
    if inputs.transmission > 0.0 {
        tally.modelled("material with transmission");
    }
    if material.unlit() {
        tally.modelled("unlit material, taken for its colour");
    }
    if material.normal_texture().is_some() {
        tally.ignored("normal texture");
    }
    if material.occlusion_texture().is_some() {
        tally.ignored("occlusion texture");
    }
    if material.specular().is_some() {
        tally.ignored("material with KHR_materials_specular");
    }
    for name in material.extensions().into_iter().flatten().map(|(name, _)| name) {
        tally.ignored(&format!("material with {name}"));
    }
}
