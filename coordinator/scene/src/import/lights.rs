//! KHR_lights_punctual: point, spot and directional lights.

use std::f64::consts::PI;

use glam::{DAffine3, DVec3};
use gltf::khr_lights_punctual::Kind;
use kernel::row::Spot;

use crate::model::{Frame, Light, LightKind};
use document::nodes::{PlacedNode, node_label};
use document::{ImportProblem, LightUnit};

/// The factor that turns the intensity of a file into one per steradian or per square metre.
pub(crate) fn intensity_factor(unit: LightUnit, kind: &Kind) -> f64 {
    match (unit, kind) {
        (LightUnit::Candela, _) | (LightUnit::Watt, Kind::Directional) => 1.0,
        (LightUnit::Watt, Kind::Point | Kind::Spot { .. }) => 1.0 / (4.0 * PI),
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
    let intensity = factor("intensity", light.intensity())? * intensity_factor(unit, &kind) * colour;
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
