//! Lights at nodes: point, spot and directional ones of KHR_lights_punctual, area lights of EXT_lights_area.
//!
//! EXT_lights_area is a draft (KhronosGroup/glTF, pull request 2525), read here as commit 174a2ab of its branch has it: all of
//! [`AreaEntry`] may change, and so may the rule that the largest scale of a node, whichever axis it belongs to, scales the light
//! evenly. A light that states no `type` or another one is an error: earlier drafts had `shape`, `width`, `height` and `radius`.

use std::collections::BTreeSet;
use std::f64::consts::PI;

use glam::{DAffine3, DVec3};
use gltf::Document;
use gltf::khr_lights_punctual::Kind;
use kernel::geometry::PlaneId;
use kernel::row::Spot;
use serde::Deserialize;
use serde_json::Value;

use crate::frame::Frame;
use crate::light::{AreaLight, AreaShape, DEFAULT_LUMINANCE, Light, LightEntry, LightKind};
use document::EXT_LIGHTS_AREA;
use document::labels::node_label;
use document::nodes::PlacedNode;
use document::{ImportProblem, LightUnit};

/// The factor that turns the intensity of a file into one per steradian or per square metre.
fn intensity_factor(unit: LightUnit, kind: &Kind) -> f64 {
    match (unit, kind) {
        (LightUnit::Candela | LightUnit::BlenderUnitless, _) | (LightUnit::Watt, Kind::Directional) => 1.0,
        (LightUnit::Blender, _) => 1.0 / LightUnit::LUMENS_PER_WATT,
        (LightUnit::Watt, Kind::Point | Kind::Spot { .. }) => 1.0 / (4.0 * PI),
    }
}

/// A light before the frame is known: with its position in the world.
pub(super) struct WorldLight(Light);

impl WorldLight {
    /// The light with its numbers in the world.
    pub(super) fn inner(&self) -> &Light {
        &self.0
    }

    /// The light in the frame; `None`, with a warning, where its numbers leave nothing of it there.
    pub(super) fn place(self, frame: &Frame, warnings: &mut Vec<String>) -> Option<Light> {
        let light = Light { kind: self.0.kind.to_frame(frame), ..self.0 };
        if !light.kind.is_valid() {
            let name = &light.name;
            warnings.push(format!("{name}: light left out, it is too small, too large or too far away"));
            return None;
        }
        Some(light)
    }
}

/// The lights at a node: one of each extension at most. `ranged` are those that were warned about.
pub(super) fn read(
    document: &Document,
    placed: &PlacedNode,
    unit: LightUnit,
    ranged: &mut BTreeSet<usize>,
    warnings: &mut Vec<String>,
) -> Result<impl Iterator<Item = WorldLight> + use<>, ImportProblem> {
    let name = node_label(&placed.node);
    let punctual =
        placed.node.light().map(|light| punctual(&light, placed, unit, ranged, warnings)).transpose()?;
    let area = placed.node.extension_value(EXT_LIGHTS_AREA);
    let area = area.map(|reference| area_light(document, reference, placed)).transpose()?;
    let node = placed.node.index();
    let found: Vec<WorldLight> = [punctual, area]
        .into_iter()
        .flatten()
        .filter_map(|Found { kind, intensity, entry }| {
            if kind.is_none() {
                warnings
                    .push(format!("{name}: light left out, its node is scaled to zero and has no direction"));
            }
            Some(WorldLight(Light { node, name: name.clone(), kind: kind?, intensity, entry }))
        })
        .collect();
    Ok(found.into_iter())
}

/// A light of the file; without a kind where its node gives it no direction.
struct Found {
    kind: Option<LightKind>,
    intensity: DVec3,
    entry: LightEntry,
}

fn problem(placed: &PlacedNode, factor: &'static str, value: f32, expected: &'static str) -> ImportProblem {
    let place = format!("the light of {}", node_label(&placed.node));
    ImportProblem::Factor { place, factor, value, expected }
}

/// The intensity in all channels.
fn intensity(
    placed: &PlacedNode,
    intensity: f32,
    colour: [f32; 3],
    unit: f64,
) -> Result<DVec3, ImportProblem> {
    let factor = |factor, value: f32| {
        if value.is_finite() && value >= 0.0 {
            return Ok(f64::from(value));
        }
        Err(problem(placed, factor, value, "finite and not negative"))
    };
    let [red, green, blue] = colour;
    let colour = DVec3::new(factor("color", red)?, factor("color", green)?, factor("color", blue)?);
    Ok(factor("intensity", intensity)? * unit * colour)
}

fn punctual(
    light: &gltf::khr_lights_punctual::Light,
    placed: &PlacedNode,
    unit: LightUnit,
    ranged: &mut BTreeSet<usize>,
    warnings: &mut Vec<String>,
) -> Result<Found, ImportProblem> {
    let kind = light.kind();
    let intensity = intensity(placed, light.intensity(), light.color(), intensity_factor(unit, &kind))?;
    if light.range().is_some() && ranged.insert(light.index()) {
        let which = light
            .name()
            .map_or_else(|| format!("light {}", light.index()), |name| format!("light \"{name}\""));
        warnings.push(format!(
            "{which}: range ignored, light falls off with the square of the distance and has no end"
        ));
    }
    let position = placed.world.translation;
    let along = axis(&placed.world);
    let kind = match kind {
        Kind::Point => Some(LightKind::Point { position }),
        Kind::Directional => along.map(|along| LightKind::Directional { along }),
        Kind::Spot { inner_cone_angle, outer_cone_angle } => {
            if !(0.0..=std::f32::consts::FRAC_PI_2).contains(&outer_cone_angle) || outer_cone_angle == 0.0 {
                return Err(problem(
                    placed,
                    "outerConeAngle",
                    outer_cone_angle,
                    "above 0 and at most pi / 2",
                ));
            }
            if !(0.0..=outer_cone_angle).contains(&inner_cone_angle) {
                return Err(problem(placed, "innerConeAngle", inner_cone_angle, "from 0 to outerConeAngle"));
            }
            // The largest angle is rounded up to f32.
            let [inner_cosine, outer_cosine] =
                [inner_cone_angle, outer_cone_angle].map(|angle| f64::from(angle).cos().max(0.0));
            along.map(|direction| LightKind::Spot(Spot { position, direction, inner_cosine, outer_cosine }))
        }
    };
    Ok(Found { kind, intensity, entry: LightEntry::Punctual(light.index()) })
}

/// A light of the draft: `extensions.EXT_lights_area.lights[]` of the document.
#[derive(Deserialize)]
#[serde(default, expecting = "an object")]
struct AreaEntry {
    /// Linear RGB.
    color: [f32; 3],
    /// Luminance, cd/m^2.
    intensity: f32,
    /// The shape; must be there.
    #[serde(rename = "type")]
    shape: Option<ShapeName>,
    /// Height of a rectangle, along the node's y axis; diameter of a disk.
    size: f32,
    rect: Rect,
}

#[derive(Deserialize, Clone, Copy)]
#[serde(rename_all = "lowercase")]
enum ShapeName {
    Rect,
    Disk,
}

#[derive(Deserialize)]
#[serde(default, expecting = "an object")]
struct Rect {
    /// Width over height.
    aspect: f32,
}

impl Default for AreaEntry {
    fn default() -> Self {
        let (color, rect) = ([1.0; 3], Rect::default());
        Self { color, intensity: DEFAULT_LUMINANCE, shape: None, size: 1.0, rect }
    }
}

impl Default for Rect {
    fn default() -> Self {
        Self { aspect: 1.0 }
    }
}

/// What a node's own extension object refers to.
fn area_light(document: &Document, reference: &Value, placed: &PlacedNode) -> Result<Found, ImportProblem> {
    let wrong = |detail: String| ImportProblem::Light {
        place: format!("the light of {}", node_label(&placed.node)),
        extension: EXT_LIGHTS_AREA,
        detail,
    };
    let index = reference.get("light").and_then(Value::as_u64).and_then(|index| usize::try_from(index).ok());
    let index = index.ok_or_else(|| wrong("its node does not say which light it holds".into()))?;
    let lights =
        document.extension_value(EXT_LIGHTS_AREA).and_then(|lights| lights.get("lights")?.as_array());
    let lights = lights.ok_or_else(|| wrong("the file has no list of such lights".into()))?;
    let light = lights.get(index).ok_or_else(|| wrong(format!("it is light {index} of {}", lights.len())))?;
    let entry = AreaEntry::deserialize(light).map_err(|error| wrong(error.to_string()))?;
    let shape = match entry.shape {
        Some(ShapeName::Rect) => AreaShape::Rectangle,
        Some(ShapeName::Disk) => AreaShape::Disk,
        None => return Err(wrong("its type is missing, expected `rect` or `disk`".into())),
    };
    for (factor, value) in [("size", entry.size), ("aspect", entry.rect.aspect)] {
        if !(value > 0.0 && value.is_finite()) {
            return Err(problem(placed, factor, value, "finite and above 0"));
        }
    }
    let half = f64::from(entry.size) / 2.0;
    let aspect = match shape {
        AreaShape::Rectangle => f64::from(entry.rect.aspect),
        AreaShape::Disk => 1.0,
    };
    let placed_at = |[across, along]: [DVec3; 2]| {
        let matrix = placed.world.matrix3;
        let scale =
            [matrix.x_axis, matrix.y_axis, matrix.z_axis].map(DVec3::length).into_iter().fold(0.0, f64::max);
        LightKind::Area(AreaLight {
            shape,
            centre: placed.world.translation,
            across: across * (half * scale * aspect),
            along: along * (half * scale),
            plane: PlaneId(0),
        })
    };
    Ok(Found {
        kind: axes(&placed.world).map(placed_at),
        intensity: intensity(placed, entry.intensity, entry.color, 1.0)?,
        entry: LightEntry::Area(index),
    })
}

/// Where a light at a node shines: along its -Z axis, whatever the scale. `None` where that is scaled to nothing.
fn axis(world: &DAffine3) -> Option<DVec3> {
    unit(-world.matrix3.z_axis)
}

/// Unit vectors along the width and the height of a flat light at a node; their cross product is where it shines. `None` where
/// the scale of the node leaves less than two axes.
fn axes(world: &DAffine3) -> Option<[DVec3; 2]> {
    let front = axis(world)?;
    let flat = |axis: DVec3| unit(axis)?.reject_from_normalized(front).try_normalize();
    let across = flat(world.matrix3.x_axis).or_else(|| Some(flat(world.matrix3.y_axis)?.cross(front)))?;
    Some([across, front.cross(across)])
}

fn unit(vector: DVec3) -> Option<DVec3> {
    // The largest component first: squares of very small ones would vanish.
    (vector / vector.abs().max_element()).try_normalize()
}
