//! Which light an output has.

use glam::DVec3;
use serde::Serialize;

/// A part of the light.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum LightPart {
    /// All of it.
    #[default]
    All,
    /// Light straight from its sources.
    Direct,
    /// Light that surfaces have reflected.
    Indirect,
}

impl LightPart {
    /// Returns true for all light.
    #[must_use]
    pub fn is_all(&self) -> bool {
        *self == Self::All
    }

    /// This part of an irradiance, given the direct part.
    fn of(self, all: DVec3, direct: DVec3) -> DVec3 {
        match self {
            Self::All => all,
            Self::Direct => direct,
            Self::Indirect => all - direct,
        }
    }

    /// This part of the irradiance at each vertex, given the direct part.
    pub fn of_all(self, all: &[DVec3], direct: &[DVec3]) -> Vec<DVec3> {
        all.iter().zip(direct).map(|(all, direct)| self.of(*all, *direct)).collect()
    }
}

/// A group of light sources whose light is output separately.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct LightGroup {
    /// Name of the group.
    pub name: String,
    /// Names of its lights: of the node of a light; of the node or the material of an emissive surface; `sky`.
    pub lights: Vec<String>,
}
