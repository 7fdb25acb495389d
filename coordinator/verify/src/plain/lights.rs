use std::f64::consts::{FRAC_PI_2, PI};

use document::{EXT_LIGHTS_AREA, LightUnit};
use glam::{DMat4, DVec3};
use gltf::Document;
use gltf::khr_lights_punctual::Kind;
use serde_json::Value;

/// A light that is no surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlainLight {
    /// Where it is and where it shines.
    pub kind: PlainLightKind,
    /// Radiant intensity, W/sr, of a point or spot light; irradiance across a directional one, W/m^2; radiance of an area light,
    /// W/(m^2 sr).
    pub intensity: DVec3,
}

/// The kinds of lights that are no surface, in the world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PlainLightKind {
    /// Shines into all directions alike.
    Point {
        /// Where it stands.
        position: DVec3,
    },
    /// Shines into a cone.
    Spot {
        /// Where it stands.
        position: DVec3,
        /// Unit vector along the axis of the cone.
        along: DVec3,
        /// What the cosine of the angle to the axis is multiplied with, and what is added, to give the root of the intensity's part
        /// between both cones: `lightAngleScale` and `lightAngleOffset` of KHR_lights_punctual.
        ramp: [f64; 2],
    },
    /// Comes from infinitely far.
    Directional {
        /// Unit vector along which it travels.
        along: DVec3,
    },
    /// Shines from one side of a flat shape, from all of it alike. Experimental: `EXT_lights_area` is a draft.
    Area {
        /// Its middle.
        centre: DVec3,
        /// From the middle to those of two sides of a rectangle, or to the rim of a disk, at right angles; the first crossed with
        /// the second points to where it shines.
        half: [DVec3; 2],
        /// Whether it is a disk.
        is_round: bool,
    },
}

impl PlainLight {
    /// The light of a node that stands like this; intensities are of this unit. `None` where it has no direction.
    pub(super) fn read(
        light: &gltf::khr_lights_punctual::Light<'_>,
        world: DMat4,
        unit: LightUnit,
    ) -> Option<Self> {
        let position = world.transform_point3(DVec3::ZERO);
        let axis = || {
            let axis = world.transform_vector3(DVec3::NEG_Z);
            (axis / axis.abs().max_element()).try_normalize()
        };
        let kind = match light.kind() {
            Kind::Point => PlainLightKind::Point { position },
            Kind::Directional => PlainLightKind::Directional { along: axis()? },
            Kind::Spot { inner_cone_angle, outer_cone_angle } => {
                let [inner, outer] = [inner_cone_angle, outer_cone_angle]
                    .map(|angle| f64::from(angle).clamp(0.0, FRAC_PI_2).cos());
                // A cone without a soft edge has a ramp that no renderer tells from a step.
                let scale = 1.0 / (inner - outer).max(1e-9);
                PlainLightKind::Spot { position, along: axis()?, ramp: [scale, -outer * scale] }
            }
        };
        let factor = match (unit, kind) {
            (LightUnit::Watt, PlainLightKind::Point { .. } | PlainLightKind::Spot { .. }) => 1.0 / (4.0 * PI),
            (LightUnit::Blender, _) => 1.0 / LightUnit::LUMENS_PER_WATT,
            (LightUnit::Candela | LightUnit::Watt | LightUnit::BlenderUnitless, _) => 1.0,
        };
        let intensity =
            DVec3::from_array(light.color().map(f64::from)) * f64::from(light.intensity()) * factor;
        Some(Self { kind, intensity })
    }

    /// The area light that a node's extension object refers to. `None` where the node leaves it no direction.
    ///
    /// # Errors
    /// What is wrong with it, in words.
    pub(super) fn read_area(
        document: &Document,
        reference: &Value,
        world: DMat4,
    ) -> Result<Option<Self>, String> {
        let lights = document.extension_value(EXT_LIGHTS_AREA).map(|lights| &lights["lights"]);
        let index = reference["light"].as_u64().and_then(|index| usize::try_from(index).ok());
        let light = lights.zip(index).and_then(|(lights, index)| lights.get(index));
        let light = light.ok_or("the light that its node refers to is not in the file")?;
        let number = |value: Option<&Value>, default: f64| match value {
            None => Ok(default),
            Some(value) => value.as_f64().ok_or_else(|| format!("{value} is no number")),
        };
        let is_round = match light["type"].as_str() {
            Some("rect") => false,
            Some("disk") => true,
            _ => return Err(format!("its type is {}, not rect or disk", light["type"])),
        };
        let height = number(light.get("size"), 1.0)?;
        let aspect = number(light.get("rect").and_then(|rect| rect.get("aspect")), 1.0)?;
        let width = if is_round { height } else { height * aspect };
        if !(height > 0.0 && aspect > 0.0) {
            return Err(format!("its size is {height} and its aspect {aspect}, both must be above 0"));
        }
        let part = |axis: usize| number(light.get("color").and_then(|colour| colour.get(axis)), 1.0);
        let intensity = DVec3::new(part(0)?, part(1)?, part(2)?) * number(light.get("intensity"), 1000.0)?;
        let axes = [DVec3::X, DVec3::Y, DVec3::NEG_Z].map(|axis| world.transform_vector3(axis));
        let scale = axes.iter().map(|axis| axis.length()).fold(0.0, f64::max);
        let [x, y, front] = axes.map(|axis| (axis / axis.abs().max_element()).try_normalize());
        let Some(front) = front else { return Ok(None) };
        let Some(x) = x.or_else(|| Some(y?.cross(front))) else { return Ok(None) };
        let Some(x) = x.reject_from_normalized(front).try_normalize() else { return Ok(None) };
        let half = [x * (width * scale / 2.0), front.cross(x) * (height * scale / 2.0)];
        let centre = world.transform_point3(DVec3::ZERO);
        Ok(Some(Self { kind: PlainLightKind::Area { centre, half, is_round }, intensity }))
    }
}
