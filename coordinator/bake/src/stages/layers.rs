//! Parts of the light by themselves: that of some sources, that which comes straight from them, that which was reflected.
//!
//! Light is linear, and so is all that is done with it once the mesh is there: what the rows give, the means of the shares,
//! the solution, and the best fit with what the whole light chose. So the parts are solved for on the mesh of the whole, with
//! its rows, and sum to it.

use std::collections::HashSet;

use glam::DVec3;
use serde::Serialize;

use super::light::{self, LightSource, Origin};
use super::{Bake, BakeError, Phase};
use crate::lit::LitLayer;
use crate::solver::fit::best_fit_of_part;
use scene::Scene;

/// Most bytes of names that a message lists.
const LISTED_BYTES: usize = 1000;

/// What the sky is called among the lights.
pub(super) const SKY: &str = "sky";

/// The parts are solved so much more exactly than the whole, that their sum is off by what the whole is.
pub(super) const TOLERANCE: f64 = 0.1;

/// Which of the light is wanted.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum LightPart {
    /// All of it.
    #[default]
    All,
    /// What comes straight from its sources.
    Direct,
    /// What surfaces have reflected.
    Indirect,
}

impl LightPart {
    /// Whether this is all light.
    #[must_use]
    pub fn is_all(&self) -> bool {
        *self == Self::All
    }

    /// This part of an irradiance, of which so much is direct.
    fn of(self, all: DVec3, direct: DVec3) -> DVec3 {
        match self {
            Self::All => all,
            Self::Direct => direct,
            Self::Indirect => all - direct,
        }
    }

    /// This part of the irradiance of each vertex, of which so much is direct.
    pub(super) fn of_all(self, all: &[DVec3], direct: &[DVec3]) -> Vec<DVec3> {
        all.iter().zip(direct).map(|(all, direct)| self.of(*all, *direct)).collect()
    }
}

/// Light sources whose light is wanted by itself.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct LightGroup {
    /// What the group is called.
    pub name: String,
    /// Names of its lights: of the node of a light; of the node or the material of an emissive surface; `sky`.
    pub lights: Vec<String>,
}

/// Finds out whether each group's lights are lights of the scene: to be asked before a long bake.
///
/// # Errors
/// When a name is not that of a light. The error lists those that are.
pub fn check_groups(scene: &Scene, groups: &[LightGroup]) -> Result<(), BakeError> {
    let known = light_names(scene);
    for group in groups {
        for light in &group.lights {
            if !known.contains(light) {
                return Err(BakeError::UnknownLight {
                    group: group.name.clone(),
                    light: light.clone(),
                    known: listed(&known),
                });
            }
        }
    }
    Ok(())
}

/// Names of all light sources of a scene, each once, in the order of the scene.
fn light_names(scene: &Scene) -> Vec<String> {
    let shining = |index: &usize| scene.surfaces[*index].exitance != DVec3::ZERO;
    let surfaces = (0..scene.surfaces.len()).filter(shining).map(Origin::Surface);
    let lights = (0..scene.lights.len()).map(Origin::Light);
    let sky = (scene.sky != DVec3::ZERO).then_some(Origin::Sky);
    let names = surfaces.chain(lights).chain(sky).flat_map(|origin| names_of(scene, origin));
    let mut seen = HashSet::new();
    names.filter(|name| seen.insert(*name)).map(str::to_owned).collect()
}

/// Names of lights in words, as far as a message has room for them.
pub fn listed<S: AsRef<str>>(names: &[S]) -> String {
    let mut words = String::new();
    for (index, name) in names.iter().map(AsRef::as_ref).enumerate() {
        if words.len() + name.len() > LISTED_BYTES {
            return format!("{words} and {} more", names.len() - index);
        }
        words += if index == 0 { "" } else { ", " };
        words += name;
    }
    if words.is_empty() { "none that has a name".into() } else { words }
}

/// The names of a light source.
pub(super) fn names_of(scene: &Scene, origin: Origin) -> impl Iterator<Item = &str> {
    let root = &scene.source.root;
    let (node, material, sky) = match origin {
        Origin::Surface(index) => {
            let surface = &scene.surfaces[index];
            let node = root.nodes.get(surface.node);
            let mesh = node.and_then(|node| root.get(node.mesh?));
            let primitive = mesh.and_then(|mesh| mesh.primitives.get(surface.primitive));
            (node, primitive.and_then(|primitive| root.get(primitive.material?)), None)
        }
        Origin::Light(index) => (root.nodes.get(scene.lights[index].node), None, None),
        Origin::Sky => (None, None, Some(SKY)),
    };
    let node = node.and_then(|node| node.name.as_deref());
    let material = material.and_then(|material| material.name.as_deref());
    [node, material, sky].into_iter().flatten().filter(|name| !name.is_empty())
}

impl Bake<'_, '_> {
    /// The light of each group.
    ///
    /// # Errors
    /// When rows cannot be had.
    #[tracing::instrument(skip_all)]
    pub(super) fn layers(&mut self) -> Result<Vec<LitLayer>, BakeError> {
        if self.settings.groups.is_empty() {
            return Ok(vec![]);
        }
        self.office.enter(Phase::Groups, self.mesh.vertices.len());
        let whole = self.irradiance.clone();
        let layers = self.apart(|bake| bake.layers_beside(&whole))?;
        self.end_step("groups");
        Ok(layers)
    }

    /// Does something with other light than the whole, which is there again afterwards.
    pub(super) fn apart<T>(
        &mut self,
        work: impl FnOnce(&mut Self) -> Result<T, BakeError>,
    ) -> Result<T, BakeError> {
        let state = (self.direct.clone(), self.radiosity.clone(), self.irradiance.clone(), self.spent.sweeps);
        let figures = (self.unshot, self.unshot_bound, self.residual);
        let done = work(self);
        (self.direct, self.radiosity, self.irradiance, self.spent.sweeps) = state;
        (self.unshot, self.unshot_bound, self.residual) = figures;
        done
    }

    /// The light of each group, fitted as this whole is.
    fn layers_beside(&mut self, whole: &[DVec3]) -> Result<Vec<LitLayer>, BakeError> {
        let mut layers = vec![];
        for group in &self.settings.groups {
            let is_meant = |source: &&LightSource| {
                names_of(self.scene, source.origin).any(|name| group.lights.iter().any(|light| light == name))
            };
            let sources: Vec<LightSource> = self.sources.iter().filter(is_meant).cloned().collect();
            self.light_vertices(&sources, self.settings.only != LightPart::Direct)?;
            let part = self.settings.only.of_all(&self.irradiance, &self.direct);
            layers.push(LitLayer {
                name: group.name.clone(),
                lights: group.lights.clone(),
                irradiance: best_fit_of_part(&self.mesh, whole, &part),
            });
        }
        Ok(layers)
    }

    /// What these sources give all vertices.
    pub(super) fn direct_of(&mut self, sources: &[LightSource]) -> Result<Vec<DVec3>, BakeError> {
        let mut direct = Vec::with_capacity(self.direct.len());
        for set in &self.vertex_sets {
            direct.extend(light::irradiance(sources, self.rows.set(*set), self.office, |_, _, _| ())?);
        }
        Ok(direct)
    }

    /// Gives all vertices the light of these sources alone, reflected or straight, in place of the light that they had.
    pub(super) fn light_vertices(
        &mut self,
        sources: &[LightSource],
        reflected: bool,
    ) -> Result<(), BakeError> {
        self.direct = self.direct_of(sources)?;
        if !reflected {
            return Ok(());
        }
        self.radiosity = vec![DVec3::ZERO; self.shares.len()];
        self.solve_settled(self.settings.threshold * TOLERANCE)
    }
}
