use std::path::Path;

use glam::{DVec2, DVec3};
use kernel::picture::{Encoding, Part, PictureScene};
use serde_json::Value;

use super::cameras::{FileCamera, read_cameras};
use super::images::Images;
use super::materials::{Appearance, Mapped};
use document::{ImportError, ReadOptions};
use scene::Frame;
use scene::{LitDocument, LitPrimitive, import_lit};

/// Largest rounding in the frame: vertices of files that are rounded more than a two-thousandth of the scene apart stay apart.
const LARGEST_ROUNDING: f64 = 1.0;

/// A lit file, ready for pictures.
#[derive(Debug, Clone)]
pub struct LitFile {
    /// Its surfaces.
    pub scene: PictureScene,
    /// How the frame of the scene relates to the file's coordinates.
    pub frame: Frame,
    /// Its cameras, in the order of its nodes.
    pub cameras: Vec<FileCamera>,
    /// Display value per unit of irradiance, if the file states it.
    pub exposure: Option<f64>,
    /// Radiance of the sky of its bake, if the file states it.
    pub sky: Option<DVec3>,
    /// What holds its light.
    pub light: LightOfFile,
    /// Warnings for the user.
    pub warnings: Vec<String>,
}

/// What holds the light of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LightOfFile {
    /// `_IRRADIANCE`.
    Irradiance,
    /// Lightmaps of its materials.
    Lightmaps,
    /// `COLOR_0`, clamped, with the exposure that the file states.
    ExposedColours,
    /// None: its colours are shown as they are.
    None,
}

/// Reads a lit file; one that is not lit gets a warning.
///
/// # Errors
/// When the file cannot be read, or has no triangles.
pub fn read_lit(path: &Path, options: &ReadOptions) -> Result<LitFile, ImportError> {
    let document = import_lit(path, options)?;
    let extras = halflight_extras(&document);
    let exposure = extras["exposure"].as_f64().filter(|exposure| exposure.is_finite() && *exposure > 0.0);
    let of_lightmaps = match extras["lightmap"]["encoding"].as_str() {
        Some("rgbm") => Encoding::Rgbm,
        _ => Encoding::Srgb,
    };
    let mut images = Images::new(&document);
    let appearance = |material| Appearance::new(&document.document, &material, &mut images, of_lightmaps);
    let materials: Vec<Appearance> = document.document.materials().map(appearance).collect();
    let fallback = Appearance::default_material();
    let appearance_of = |primitive: &LitPrimitive| {
        primitive.material.and_then(|index| materials.get(index)).unwrap_or(&fallback)
    };
    let has = |what: fn(&LitPrimitive) -> bool| document.primitives.iter().any(what);
    let light = if has(|primitive| primitive.irradiance.is_some()) {
        LightOfFile::Irradiance
    } else if document.primitives.iter().any(|primitive| appearance_of(primitive).names_lightmap) {
        LightOfFile::Lightmaps
    } else if exposure.is_some() && has(|primitive| primitive.colours.is_some()) {
        LightOfFile::ExposedColours
    } else {
        LightOfFile::None
    };
    let mut warnings = document.warnings.clone();
    match light {
        LightOfFile::Irradiance | LightOfFile::Lightmaps => {}
        LightOfFile::ExposedColours => warnings.push(
            "the file has no _IRRADIANCE: its light is taken from COLOR_0, where it is clamped".to_owned(),
        ),
        LightOfFile::None => warnings.push(
            "the file has no light: its colours are shown as they are; light it with `coordinator solve`"
                .to_owned(),
        ),
    }
    let is_dark = |primitive: &&LitPrimitive| {
        let appearance = appearance_of(primitive);
        primitive.irradiance.is_none()
            && appearance.names_lightmap
            && lightmap_of(primitive, appearance).is_none()
    };
    let dark = document.primitives.iter().filter(is_dark).count();
    if dark > 0 {
        let primitives = if dark == 1 { "primitive is" } else { "primitives are" };
        warnings.push(format!(
            "{dark} {primitives} without light: the lightmap, or the place on it, cannot be read"
        ));
    }
    let scale = exposure.filter(|_| light == LightOfFile::ExposedColours).map_or(1.0, f64::recip);
    let part = |primitive: &LitPrimitive| part(primitive, appearance_of(primitive), light, scale);
    let parts = document.primitives.iter().map(part).collect();
    let rounding = document.primitives.iter().map(|primitive| primitive.rounding).fold(0.0, f64::max);
    Ok(LitFile {
        // Two vertices of the same place may be rounded away from each other.
        scene: PictureScene {
            parts,
            images: images.finish(),
            rounding: (2.0 * rounding).min(LARGEST_ROUNDING),
        },
        cameras: read_cameras(&document),
        frame: document.frame,
        exposure: if light == LightOfFile::None { Some(1.0) } else { exposure },
        sky: sky(&extras),
        light,
        warnings,
    })
}

/// The exporter's description of the bake, or null.
fn halflight_extras(document: &LitDocument) -> Value {
    let extras = document.document.as_json().asset.extras.as_ref();
    let extras: Value =
        extras.and_then(|extras| serde_json::from_str(extras.get()).ok()).unwrap_or(Value::Null);
    extras["halflight"].clone()
}

/// The radiance of the sky among the settings of a bake.
fn sky(extras: &Value) -> Option<DVec3> {
    let sky = extras["sky"].as_array()?;
    let channel = |place: usize| sky.get(place)?.as_f64().filter(|value| (0.0..1e30).contains(value));
    (sky.len() == 3).then_some(())?;
    Some(DVec3::new(channel(0)?, channel(1)?, channel(2)?))
}

/// A primitive for the renderer.
fn part(primitive: &LitPrimitive, appearance: &Appearance, light: LightOfFile, scale: f64) -> Part {
    let count = primitive.positions.len();
    let coordinates = |mapped: &Option<Mapped>| match mapped {
        None => vec![],
        Some(Mapped { mapping, .. }) => match primitive.coordinates.get(&mapping.set) {
            None => vec![[0.0; 2]; count],
            Some(values) => {
                let place = |uv: &[f32; 2]| {
                    let uv = DVec2::new(uv[0].into(), uv[1].into());
                    finite(mapping.transform.transform_point2(uv).as_vec2().to_array())
                };
                values.iter().map(place).collect()
            }
        },
    };
    let has_its_own = matches!(light, LightOfFile::Irradiance | LightOfFile::Lightmaps);
    let light_of = |colour: &[f32; 4]| {
        let [red, green, blue, _] = *colour;
        positive([red, green, blue].map(|value| (f64::from(value) * scale) as f32))
    };
    let lightmap = lightmap_of(primitive, appearance);
    let shows_colours = appearance.unlit && !appearance.names_lightmap;
    let irradiance = match (&primitive.irradiance, &primitive.colours) {
        (Some(irradiance), _) => irradiance.iter().copied().map(positive).collect(),
        (None, _) if let Some((_, intensity)) = lightmap => vec![[intensity; 3]; count],
        // A file that is lit elsewhere has no light here, unless the colours are meant to be shown.
        (None, _) if has_its_own && !shows_colours => vec![],
        (None, Some(colours)) => colours.iter().map(light_of).collect(),
        (None, None) => vec![[scale as f32; 3]; count],
    };
    // COLOR_0 has this factor in it already.
    let shows_diffuse = primitive.irradiance.is_some() || lightmap.is_some() && !appearance.unlit;
    let diffuse = if shows_diffuse { appearance.diffuse } else { 1.0 };
    let lightmap = lightmap.map(|(mapped, _)| mapped);
    let [red, green, blue, alpha] = appearance.base;
    Part {
        positions: primitive.positions.iter().map(|position| position.to_array()).collect(),
        triangles: primitive.triangles.clone(),
        irradiance,
        irradiance_coordinates: coordinates(&lightmap),
        irradiance_texture: lightmap.map(|mapped| mapped.texture),
        colours: if lightmap.is_some() { own_colours(primitive) } else { tint(primitive) },
        base_coordinates: coordinates(&appearance.base_texture),
        emission_coordinates: coordinates(&appearance.emission_texture),
        base: [red * diffuse, green * diffuse, blue * diffuse, alpha],
        base_texture: appearance.base_texture.map(|mapped| mapped.texture),
        emission: appearance.emission,
        emission_texture: appearance.emission_texture.map(|mapped| mapped.texture),
        alpha: appearance.alpha,
        double_sided: appearance.double_sided,
    }
}

/// The lightmap of a primitive that has no other light, and the irradiance that 1 stands for there.
fn lightmap_of(primitive: &LitPrimitive, appearance: &Appearance) -> Option<(Mapped, f32)> {
    let is_placed = |(mapped, _): &(Mapped, f32)| primitive.coordinates.contains_key(&mapped.mapping.set);
    appearance.lightmap.filter(|_| primitive.irradiance.is_none()).filter(is_placed)
}

/// The factor of base colour per vertex where light is in lightmaps: COLOR_0, as it was.
fn own_colours(primitive: &LitPrimitive) -> Vec<[f32; 4]> {
    primitive.colours.iter().flatten().map(|colour| colour.map(can_be)).collect()
}

/// The factor of base colour per vertex: the file's colours before it was lit, or only their alpha if these are lost.
fn tint(primitive: &LitPrimitive) -> Vec<[f32; 4]> {
    match (&primitive.tint, &primitive.colours) {
        (Some(tint), colours) if primitive.irradiance.is_some() => {
            // The alpha is that of COLOR_0, which has it from the same colours.
            let alpha = |vertex: usize, own: f32| match colours {
                Some(colours) => colours.get(vertex).map_or(own, |colour| colour[3]),
                None => own,
            };
            let colour = |(vertex, &[red, green, blue, own]): (usize, &[f32; 4])| {
                [red, green, blue, alpha(vertex, own)].map(can_be)
            };
            tint.iter().enumerate().map(colour).collect()
        }
        (_, Some(colours)) if colours.iter().any(|colour| colour[3] != 1.0) => {
            colours.iter().map(|&[.., alpha]| [1.0, 1.0, 1.0, can_be(alpha)]).collect()
        }
        _ => vec![],
    }
}

/// A factor that can be: 1 in place of what is no number.
fn can_be(value: f32) -> f32 {
    if value.is_finite() { value.max(0.0) } else { 1.0 }
}

fn finite(values: [f32; 2]) -> [f32; 2] {
    values.map(|value| if value.is_finite() { value } else { 0.0 })
}

/// Light that can be: what is negative or no number is none.
fn positive(values: [f32; 3]) -> [f32; 3] {
    values.map(|value| if value.is_finite() { value.max(0.0) } else { 0.0 })
}
