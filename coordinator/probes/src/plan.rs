//! From a scene to receivers, and from their light to harmonics.

use glam::DVec3;
use kernel::geometry::PlaneId;
use kernel::replica::Receiver;
use rayon::prelude::*;
use scene::Scene;
use serde::Serialize;
use serde_json::{Value, json};

use crate::error::{MOST_PROBES, ProbeError};
use crate::grid::Grid;
use crate::harmonics::{Coefficients, NORMALS, fitted, normals};
use crate::inside::{Place, Walls};

/// Light below this part of the mean is none, behind surfaces that are lit from both sides.
const DARK: f64 = 1e-3;

/// How far points may lie from the scene, in its extents.
const FARTHEST: f64 = 100.0;

/// Where probes are wanted.
#[derive(Debug, Clone, PartialEq)]
pub enum Places {
    /// On a grid in the box around the scene, so far apart, in units of the file.
    Grid(f64),
    /// At these points, in units of the file.
    Points(Vec<DVec3>),
}

/// Probes before their light is known.
pub struct Plan {
    grid: Option<Grid>,
    /// Units of the file.
    positions: Vec<DVec3>,
    places: Vec<Place>,
    receivers: Vec<Receiver>,
}

/// What probes there are.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PlanReport {
    /// The grid, if they are on one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub grid: Option<Grid>,
    /// Number of probes.
    pub probes: usize,
    /// Those inside of walls.
    pub inside: usize,
}

/// Finds the places of probes.
///
/// # Errors
/// When there would be too many, or they lie too far away.
pub fn plan(scene: &Scene, places: &Places) -> Result<Plan, ProbeError> {
    let corners = || scene.surfaces.iter().flat_map(|own| &own.facets).flat_map(|facet| facet.positions());
    let low = corners().fold(DVec3::INFINITY, DVec3::min);
    let high = corners().fold(DVec3::NEG_INFINITY, DVec3::max);
    let (grid, positions) = match places {
        Places::Grid(spacing) => {
            let grid = Grid::filling([low, high].map(|corner| scene.frame.to_world(corner)), *spacing)?;
            (Some(grid), grid.positions().collect())
        }
        Places::Points(points) if points.len() > MOST_PROBES => {
            return Err(ProbeError::TooMany(points.len()));
        }
        Places::Points(points) => (None, points.clone()),
    };
    let farthest = FARTHEST * (high - low).max_element();
    let in_frame: Vec<DVec3> = positions.iter().map(|position| scene.frame.to_frame(*position)).collect();
    if let Some(far) = in_frame.iter().position(|point| point.length() > farthest) {
        return Err(ProbeError::Far(far));
    }
    let walls = Walls::new(scene);
    let places: Vec<Place> = in_frame.par_iter().map(|point| walls.place(*point)).collect();
    let open = in_frame.iter().zip(&places).filter(|(_, place)| **place != Place::Inside);
    let receivers = open
        .flat_map(|(point, _)| {
            normals().map(|(normal, _)| Receiver { position: *point, normal, plane: PlaneId::NONE })
        })
        .collect();
    Ok(Plan { grid, positions, places, receivers })
}

impl Plan {
    /// Receivers whose light is wanted: none inside of walls.
    #[must_use]
    pub fn receivers(&self) -> &[Receiver] {
        &self.receivers
    }

    /// The probes, given the irradiance at the receivers in each layer.
    #[must_use]
    pub fn probes(self, layers: &[Vec<DVec3>]) -> Probes {
        let Self { grid, positions, places, .. } = self;
        let mut layers: Vec<Vec<Coefficients>> = layers
            .iter()
            .map(|light| {
                let mut of_probes = light.chunks_exact(NORMALS);
                let mut of_probe = |place: &Place| match place {
                    Place::Inside => [DVec3::ZERO; 9],
                    _ => fitted(of_probes.next().into_iter().flatten().copied()),
                };
                places.iter().map(&mut of_probe).collect()
            })
            .collect();
        let level = |coefficients: &Coefficients| coefficients[0].element_sum();
        let whole = layers.first().map_or(&[][..], Vec::as_slice);
        let open = || whole.iter().zip(&places).filter(|(_, place)| **place == Place::Open);
        let mean = open().map(|(light, _)| level(light)).sum::<f64>() / open().count().max(1) as f64;
        let inside: Vec<bool> = places
            .iter()
            .enumerate()
            .map(|(probe, place)| match place {
                Place::Open => false,
                Place::BehindLitBacks => whole.get(probe).is_none_or(|light| level(light) < DARK * mean),
                Place::Inside => true,
            })
            .collect();
        if let Some(grid) = &grid {
            layers.iter_mut().for_each(|layer| fill(layer, &inside, grid));
        }
        Probes { grid, positions, inside, layers }
    }
}

/// Gives probes inside of walls the mean of those beside them, ring by ring, so that interpolation near walls takes no dark from them.
fn fill(layer: &mut [Coefficients], inside: &[bool], grid: &Grid) {
    let mut is_known: Vec<bool> = inside.iter().map(|inside| !inside).collect();
    loop {
        let unknown = (0..layer.len()).filter(|probe| !is_known[*probe]);
        let found: Vec<(usize, Coefficients)> = unknown
            .filter_map(|probe| {
                let near: Vec<usize> = grid.around(probe).filter(|other| is_known[*other]).collect();
                let mean = |band: usize| {
                    near.iter().map(|other| layer[*other][band]).sum::<DVec3>() / near.len() as f64
                };
                (!near.is_empty()).then(|| (probe, std::array::from_fn(mean)))
            })
            .collect();
        if found.is_empty() {
            return;
        }
        for (probe, light) in found {
            (layer[probe], is_known[probe]) = (light, true);
        }
    }
}

/// Light at points in space.
#[derive(Debug, Clone, PartialEq)]
pub struct Probes {
    /// The grid, if they are on one.
    pub grid: Option<Grid>,
    /// Their positions, units of the file.
    pub positions: Vec<DVec3>,
    /// Which lie inside of walls: on a grid, these have the light of their neighbours, elsewhere none.
    pub inside: Vec<bool>,
    /// Harmonics of the radiance, by layer.
    pub layers: Vec<Vec<Coefficients>>,
}

impl Probes {
    /// What probes there are.
    #[must_use]
    pub fn report(&self) -> PlanReport {
        let inside = self.inside.iter().filter(|inside| **inside).count();
        PlanReport { grid: self.grid, probes: self.positions.len(), inside }
    }

    /// All of it as JSON; `groups` names the layers behind the first.
    #[must_use]
    pub fn to_json(&self, groups: &[String], unit: &str) -> Value {
        let numbers = |vector: &DVec3| json!(vector.to_array().map(short));
        let coefficients = |layer: &Vec<Coefficients>| -> Value {
            let of_probe = |probe: &Coefficients| -> Value {
                probe.iter().flat_map(|band| band.to_array()).map(short).collect()
            };
            layer.iter().map(of_probe).collect()
        };
        let mut layers = self.layers.iter().map(coefficients);
        let whole = layers.next();
        let groups: Vec<Value> = groups
            .iter()
            .zip(layers)
            .map(|(name, coefficients)| json!({ "name": name, "coefficients": coefficients }))
            .collect();
        let mut json = json!({
            "unit": unit,
            "positions": self.positions.iter().map(numbers).collect::<Vec<_>>(),
            "inside": self.inside,
            "coefficients": whole,
            "groups": groups,
        });
        if let Some(grid) = &self.grid {
            json["grid"] = json!(grid);
        }
        json
    }
}

/// A number in as many digits as matter: of a single float.
fn short(value: f64) -> f64 {
    format!("{value:.6e}").parse().unwrap_or(value)
}
