//! KHR_lights_punctual: point, spot and directional lights.

use std::f64::consts::PI;

use glam::{DAffine3, DVec3};
use gltf::khr_lights_punctual::Kind;
use serde::Serialize;
use shared::row::Spot;

use super::error::ImportProblem;
use super::nodes::{PlacedNode, node_label};
use crate::scene::{Frame, Light, LightKind};

/// How the numbers of a file's lights are meant.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum LightUnit {
    /// As KHR_lights_punctual says: candela for point and spot lights, lux for directional ones. They are taken as they are: in
    /// whatever unit they are meant, irradiance comes out in the one that belongs to it.
    #[default]
    Candela,
    /// Radiant watts for point and spot lights, as some exporters write them: over 4 pi they are an intensity in W/sr, that of a
    /// spot light too, whose cone only cuts it off. Directional lights are taken as W/m^2, as they are.
    Watt,
}

impl LightUnit {
    /// What the intensity of a file times this is, per steradian or per square metre.
    pub(crate) fn factor(self, kind: &Kind) -> f64 {
        match (self, kind) {
            (Self::Candela, _) | (Self::Watt, Kind::Directional) => 1.0,
            (Self::Watt, Kind::Point | Kind::Spot { .. }) => 1.0 / (4.0 * PI),
        }
    }
}

/// A light before the frame is known: with its position in the world.
pub(super) struct WorldLight(Light);

impl WorldLight {
    /// The light in the frame.
    pub(super) fn place(self, frame: &Frame) -> Light {
        let kind = match self.0.kind {
            LightKind::Point { position } => LightKind::Point { position: frame.to_frame(position) },
            LightKind::Spot(spot) => {
                LightKind::Spot(Spot { position: frame.to_frame(spot.position), ..spot })
            }
            directional @ LightKind::Directional { .. } => directional,
        };
        Light { kind, ..self.0 }
    }

    /// True where it gives no light.
    pub(super) fn is_dark(&self) -> bool {
        self.0.intensity == DVec3::ZERO
    }
}

/// The light at a node, if there is one.
pub(super) fn read(
    placed: &PlacedNode,
    unit: LightUnit,
    warnings: &mut Vec<String>,
) -> Result<Option<WorldLight>, ImportProblem> {
    let Some(light) = placed.node.light() else { return Ok(None) };
    let name = node_label(&placed.node);
    let problem = |factor, value, expected| {
        let place = format!("the light of {name}");
        ImportProblem::Factor { place, factor, value, expected }
    };
    let factor = |factor, value: f32| {
        if value.is_finite() && value >= 0.0 {
            return Ok(f64::from(value));
        }
        Err(problem(factor, value, "finite and not negative"))
    };
    let [red, green, blue] = light.color();
    let colour = DVec3::new(factor("color", red)?, factor("color", green)?, factor("color", blue)?);
    let kind = light.kind();
    let intensity = factor("intensity", light.intensity())? * unit.factor(&kind) * colour;
    if light.range().is_some() {
        let which = light
            .name()
            .map_or_else(|| format!("light {}", light.index()), |name| format!("light \"{name}\""));
        let warning =
            format!("{which}: range ignored, light falls off with the square of the distance and has no end");
        if !warnings.contains(&warning) {
            warnings.push(warning);
        }
    }
    let position = placed.world.translation;
    let along = axis(&placed.world);
    let kind = match kind {
        Kind::Point => Some(LightKind::Point { position }),
        Kind::Directional => along.map(|along| LightKind::Directional { along }),
        Kind::Spot { inner_cone_angle, outer_cone_angle } => {
            if !(0.0..=std::f32::consts::FRAC_PI_2).contains(&outer_cone_angle) || outer_cone_angle == 0.0 {
                return Err(problem("outerConeAngle", outer_cone_angle, "above 0 and at most pi / 2"));
            }
            if !(0.0..=outer_cone_angle).contains(&inner_cone_angle) {
                return Err(problem("innerConeAngle", inner_cone_angle, "from 0 to outerConeAngle"));
            }
            // The largest angle is rounded up to f32.
            let [inner_cosine, outer_cosine] =
                [inner_cone_angle, outer_cone_angle].map(|angle| f64::from(angle).cos().max(0.0));
            along.map(|direction| LightKind::Spot(Spot { position, direction, inner_cosine, outer_cosine }))
        }
    };
    if kind.is_none() {
        warnings.push(format!("{name}: light left out, its node is scaled to zero and has no direction"));
    }
    Ok(kind.map(|kind| WorldLight(Light { node: placed.node.index(), name, kind, intensity })))
}

/// Where a light at a node shines: along its -Z axis, whatever the scale. `None` where that is scaled to nothing.
fn axis(world: &DAffine3) -> Option<DVec3> {
    let axis = -world.matrix3.z_axis;
    // The largest component first: squares of very small ones would vanish.
    (axis / axis.abs().max_element()).try_normalize()
}
