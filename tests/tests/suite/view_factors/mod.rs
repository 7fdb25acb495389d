//! View factors between the surfaces of a scene.
//!
//! | module | what is held against what |
//! |---|---|
//! | `known` | cube, rectangles, a blocked pair: values from 60-digit arithmetic |
//! | `rooms` | closed scenes with things in the way: closing, reciprocity, seeds, parts and wholes |
//! | `streets` | a small city, open to the sky, against a Monte Carlo that shares nothing with the program |
//! | `command` | the command: its files, its errors |

mod command;
mod known;
mod rooms;
mod streets;

use scene::Scene;
use scene::{ImportOptions, import_slice};
use tests::builder::{Material, SceneBuilder};
use tests::shapes::Polygon;
use view_factors::{Division, ViewFactorSettings, ViewFactors, view_factors};

/// Imports a GLB without light.
fn dark(scene: &SceneBuilder) -> Scene {
    let options = ImportOptions { needs_light: false, ..ImportOptions::default() };
    import_slice(&scene.glb(), &options).unwrap_or_else(|error| panic!("{error}"))
}

fn computed(scene: &SceneBuilder, settings: ViewFactorSettings) -> ViewFactors {
    view_factors(&dark(scene), &settings, &|_, _| ()).unwrap_or_else(|error| panic!("{error}"))
}

fn by_facets() -> ViewFactorSettings {
    ViewFactorSettings { division: Division::Facets, ..ViewFactorSettings::default() }
}

/// Each polygon a part of its own, called by its number.
fn scene_of(polygons: &[Polygon]) -> SceneBuilder {
    polygons.iter().enumerate().fold(SceneBuilder::new(), |scene, (index, polygon)| {
        scene.part(&format!("face {index}"), std::slice::from_ref(polygon), Material::grey(0.5))
    })
}

/// Factor of a surface to another and its standard error, by their indices.
fn factor(factors: &ViewFactors, from: usize, to: usize) -> (f64, f64) {
    let ends = [from.min(to) as u32, from.max(to) as u32];
    let area = factors.rows[from].area;
    let pair = factors.pairs.iter().find(|pair| [pair.from, pair.to] == ends);
    pair.map_or((0.0, 0.0), |pair| (pair.area / area, pair.variance.sqrt() / area))
}

/// Sums of the rows' factors.
fn sums(factors: &ViewFactors) -> Vec<f64> {
    let mut sums = vec![0.0; factors.rows.len()];
    for pair in &factors.pairs {
        sums[pair.from as usize] += pair.area;
        if pair.from != pair.to {
            sums[pair.to as usize] += pair.area;
        }
    }
    sums.iter().zip(&factors.rows).map(|(sum, row)| sum / row.area).collect()
}
