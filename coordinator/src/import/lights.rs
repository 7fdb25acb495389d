//! KHR_lights_punctual point lights.

use glam::DVec3;
use gltf::khr_lights_punctual::Kind;

use super::error::ImportProblem;
use super::nodes::{PlacedNode, node_label};
use crate::scene::{Frame, PointLight};

/// A point light before the frame is known.
pub(super) struct WorldLight {
    name: String,
    /// World position.
    pub(super) position: DVec3,
    /// Intensity x colour.
    pub(super) intensity: DVec3,
}

impl WorldLight {
    /// The light in the frame.
    pub(super) fn place(self, frame: &Frame) -> PointLight {
        PointLight { name: self.name, position: frame.to_frame(self.position), intensity: self.intensity }
    }
}

/// The point light at a node, if there is one. Other kinds are left out with a warning.
pub(super) fn read(
    placed: &PlacedNode,
    warnings: &mut Vec<String>,
) -> Result<Option<WorldLight>, ImportProblem> {
    let Some(light) = placed.node.light() else { return Ok(None) };
    let name = node_label(&placed.node);
    let kind = match light.kind() {
        Kind::Point => None,
        Kind::Directional => Some("directional"),
        Kind::Spot { .. } => Some("spot"),
    };
    if let Some(kind) = kind {
        warnings.push(format!(
            "{name}: {kind} light left out, not modelled yet; use a point light or an emissive surface"
        ));
        return Ok(None);
    }
    let factor = |factor, value: f32| {
        if value.is_finite() && value >= 0.0 {
            return Ok(f64::from(value));
        }
        let place = format!("the light of {name}");
        Err(ImportProblem::Factor { place, factor, value, expected: "finite and not negative" })
    };
    let [red, green, blue] = light.color();
    let colour = DVec3::new(factor("color", red)?, factor("color", green)?, factor("color", blue)?);
    let intensity = factor("intensity", light.intensity())? * colour;
    Ok(Some(WorldLight { name, position: placed.world.translation, intensity }))
}
