use std::collections::HashSet;

use glam::DVec3;

use super::RelightError;
use super::kept::KeptLight;
use crate::light_parts::{LightGroup, LightPart};
use crate::stages::{Origin, SKY, listed, names_of};
use scene::Scene;

/// A new intensity or colour of a light.
#[derive(Debug, Clone, PartialEq)]
pub struct LightChange {
    /// Name of the light: of the node of a light; of the node or the material of an emissive surface; `sky`.
    pub light: String,
    /// Factor of its light, per channel.
    pub factor: DVec3,
}

/// The new light. By default that of the bake.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct NewLight {
    /// Lights that change; others stay. Where several are names of one source, their factors are multiplied.
    pub changes: Vec<LightChange>,
    /// Radiance of the sky, where it changes.
    pub sky: Option<DVec3>,
    /// The part of the light in the output.
    pub only: LightPart,
    /// Light sources whose light is output separately as well.
    pub groups: Vec<LightGroup>,
}

impl NewLight {
    /// Factor of a light with these names.
    pub(super) fn factor<'a>(&self, names: impl Iterator<Item = &'a str>) -> DVec3 {
        let names: Vec<&str> = names.collect();
        let meant = self.changes.iter().filter(|change| names.contains(&change.light.as_str()));
        meant.map(|change| change.factor).product()
    }

    /// Factor of a light source of the scene.
    pub(super) fn factor_of(&self, scene: &Scene, origin: Origin) -> DVec3 {
        self.factor(names_of(scene, origin))
    }

    /// Radiance of the sky, which was this.
    pub(super) fn sky(&self, as_baked: DVec3) -> DVec3 {
        self.sky.unwrap_or(as_baked) * self.factor([SKY].into_iter())
    }

    /// Factor of each kept part.
    ///
    /// # Errors
    /// When a light does not exist, or a factor makes no sense.
    pub(super) fn factors(&self, kept: &KeptLight) -> Result<Vec<DVec3>, RelightError> {
        let known: HashSet<&str> = kept.lights().into_iter().collect();
        let named = self.changes.iter().map(|change| &change.light);
        let mut named = named.chain(self.groups.iter().flat_map(|group| &group.lights));
        if let Some(light) = named.find(|light| !known.contains(light.as_str())) {
            return Err(RelightError::UnknownLight { light: light.clone(), known: listed(&kept.lights()) });
        }
        let is_light = |light: DVec3| light.is_finite() && light.min_element() >= 0.0;
        if let Some(change) = self.changes.iter().find(|change| !is_light(change.factor)) {
            return Err(RelightError::Factor(change.light.clone()));
        }
        if self.sky.is_some_and(|sky| !is_light(sky)) {
            return Err(RelightError::Factor(SKY.into()));
        }
        if self.sky.is_some_and(|sky| sky != DVec3::ZERO) && kept.sky() == DVec3::ZERO {
            return Err(RelightError::NoSky);
        }
        let factor = |part: &super::kept::KeptPart| {
            if part.is_sky {
                self.sky(kept.sky())
            } else {
                self.factor(part.names.iter().map(String::as_str))
            }
        };
        Ok(kept.parts.iter().map(factor).collect())
    }
}
