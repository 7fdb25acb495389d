use std::f64::consts::{FRAC_PI_2, PI};

use glam::{DMat4, DVec3};
use gltf::khr_lights_punctual::Kind;

/// A light without an area.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlainLight {
    /// Where it is and where it shines.
    pub kind: PlainLightKind,
    /// Radiant intensity, W/sr, of a point or spot light; irradiance across a directional one, W/m^2.
    pub intensity: DVec3,
}

/// The kinds of lights without an area, in the world.
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
}

impl PlainLight {
    /// The light of a node that stands like this; intensities may be radiant watts. `None` where it has no direction.
    pub(super) fn read(
        light: &gltf::khr_lights_punctual::Light<'_>,
        world: DMat4,
        in_watts: bool,
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
        let of_sphere = in_watts && !matches!(kind, PlainLightKind::Directional { .. });
        let unit = if of_sphere { 1.0 / (4.0 * PI) } else { 1.0 };
        let intensity = DVec3::from_array(light.color().map(f64::from)) * f64::from(light.intensity()) * unit;
        Some(Self { kind, intensity })
    }
}
