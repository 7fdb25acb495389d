//! Layers: the light of groups of sources, separately.
//!
//! Light is linear, and so are all operations on it once the mesh is there: rows, means of shares, solution, and the best fit
//! with the choices of the whole light. So the layers are solved for on the mesh of the whole, with its rows, and sum to it.

use std::collections::HashSet;

use glam::DVec3;

use super::light_source::{LightSource, Origin};
use super::solved::Solved;
use crate::context::Context;
use crate::error::{BakeError, Result};
use crate::light_parts::{LightGroup, LightPart};
use crate::lit::LitLayer;
use crate::observer::Phase;
use crate::refinement::best_fit_of_part;
use crate::rows::{LocalRadiosity, Problem, Radiosity, Rows};
use scene::Scene;

/// Most bytes of names that a message lists.
const LISTED_BYTES: usize = 1000;

/// Name of the sky among the lights.
pub const SKY: &str = "sky";

/// Tolerance of parts of the light, relative to that of the whole: their sum is then as exact as the whole.
pub const PART_TOLERANCE: f64 = 0.1;

/// Checks that each group's lights are lights of the scene, before a long bake.
///
/// # Errors
/// When a name is not that of a light. The error lists the names of all lights.
pub fn check_groups(scene: &Scene, groups: &[LightGroup]) -> Result<()> {
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

/// A list of names, cut where it is too long for a message.
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
pub fn names_of(scene: &Scene, origin: Origin) -> impl Iterator<Item = &str> {
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
        Origin::Lamps => (None, None, None),
    };
    let node = node.and_then(|node| node.name.as_deref());
    let material = material.and_then(|material| material.name.as_deref());
    [node, material, sky].into_iter().flatten().filter(|name| !name.is_empty())
}

/// The light of a group.
pub struct Layer {
    /// At the vertices.
    pub lit: LitLayer,
    /// Its sources.
    pub sources: Vec<LightSource>,
    /// Radiosity that they give the shares; black where only direct light is wanted.
    radiosity: Vec<DVec3>,
    local: Option<LocalRadiosity>,
}

impl Layer {
    /// Radiosity of the shares, and within them.
    pub fn radiosity(&self) -> Radiosity<'_> {
        Radiosity { shares: &self.radiosity, local: self.local.as_ref() }
    }
}

impl Solved {
    /// The light of each group.
    ///
    /// # Errors
    /// When rows cannot be had.
    #[tracing::instrument(skip_all)]
    pub fn layers(&mut self, cx: &mut Context) -> Result<Vec<Layer>> {
        if cx.settings.groups.is_empty() {
            return Ok(vec![]);
        }
        cx.client.monitor.enter(Phase::Groups, self.mesh.mesh.vertices.len());
        // The report counts the sweeps of the whole.
        let sweeps = cx.work.sweeps;
        let means = self.means();
        let mut layers = vec![];
        for group in &cx.settings.groups {
            let is_meant = |source: &&LightSource| {
                names_of(cx.scene, source.origin).any(|name| group.lights.iter().any(|light| light == name))
            };
            let sources: Vec<LightSource> = self.sources.each().iter().filter(is_meant).cloned().collect();
            let direct = self.direct_of(cx, &sources)?;
            let (part, radiosity, local) = if cx.settings.only == LightPart::Direct {
                (direct, vec![DVec3::ZERO; self.mesh.shares.len()], None)
            } else {
                let tolerance = cx.settings.threshold * PART_TOLERANCE;
                let dark = self.dark(cx, &sources)?;
                let (mesh, exposed) = (&self.mesh, &self.exposed);
                let problem = Problem { mesh, values: &means, exposed, direct: &direct, tolerance };
                let Rows { source, table } = &mut self.rows;
                let solution = problem.solve(cx, source.as_mut(), table, dark)?;
                let part = cx.settings.only.of_all(&solution.irradiance, &direct);
                (part, solution.radiosity, solution.local)
            };
            let lit = LitLayer {
                name: group.name.clone(),
                lights: group.lights.clone(),
                irradiance: best_fit_of_part(
                    &self.mesh.mesh,
                    &self.solution.irradiance,
                    &self.revealed,
                    &part,
                ),
            };
            layers.push(Layer { lit, sources, radiosity, local });
        }
        cx.work.sweeps = sweeps;
        cx.end_step("groups");
        Ok(layers)
    }
}
