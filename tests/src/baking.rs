//! A scene baked in this process, and figures of the result.

use bake::lit::{LitMesh, LitVertex};
use bake::{AskedPoints, BakeSettings, Baked, Unobserved, bake_with_points};
use cluster::{Cluster, Workers};
use glam::DVec3;
use scene::Scene;
use scene::{ImportOptions, import_slice};

/// Imports a GLB.
///
/// # Panics
/// When it cannot be imported.
#[must_use]
pub fn imported(glb: &[u8]) -> Scene {
    import_slice(glb, &ImportOptions::default()).unwrap_or_else(|error| panic!("{error}"))
}

/// Bakes a scene with so many threads of this process.
///
/// # Panics
/// When it cannot be baked.
#[must_use]
pub fn baked_by(scene: &Scene, settings: &BakeSettings, threads: usize) -> Baked {
    baked_with_points(scene, settings, &AskedPoints::default(), threads)
}

/// Bakes a scene with so many threads of this process, and asks for the light of these points.
///
/// # Panics
/// When it cannot be baked.
#[must_use]
pub fn baked_with_points(
    scene: &Scene,
    settings: &BakeSettings,
    points: &AskedPoints,
    threads: usize,
) -> Baked {
    let cluster = Cluster::start(&Workers::Embedded { threads }.into()).expect("threads can be started");
    let baked = bake_with_points(scene, settings, points, &mut cluster.handle(0), &mut Unobserved)
        .unwrap_or_else(|error| panic!("{error}"));
    cluster.shutdown();
    baked
}

/// Bakes a scene with two threads.
///
/// # Panics
/// When it cannot be baked.
#[must_use]
pub fn baked(scene: &Scene, settings: &BakeSettings) -> Baked {
    baked_by(scene, settings, 2)
}

/// The vertices of a surface that its triangles use, each once.
#[must_use]
pub fn vertices_of(lit: &LitMesh, surface: usize) -> Vec<LitVertex> {
    let mut used: Vec<u32> = lit.surfaces[surface].iter().flat_map(|triangle| triangle.vertices).collect();
    used.sort_unstable();
    used.dedup();
    used.into_iter().map(|vertex| lit.vertices[vertex as usize]).collect()
}

/// Area of those triangles of a surface that `counts` says, given their middle; and the flux that they receive. Both in the
/// scene's frame: multiply by its squared scale for the file's units.
#[must_use]
pub fn area_and_flux(lit: &LitMesh, surface: usize, counts: impl Fn(DVec3) -> bool) -> (f64, DVec3) {
    lit.surfaces[surface].iter().fold((0.0, DVec3::ZERO), |(area, flux), triangle| {
        let [a, b, c] = triangle.vertices.map(|vertex| lit.vertices[vertex as usize]);
        if !counts((a.position + b.position + c.position) / 3.0) {
            return (area, flux);
        }
        let own = (b.position - a.position).cross(c.position - a.position).length() / 2.0;
        (area + own, flux + (a.irradiance + b.irradiance + c.irradiance) / 3.0 * own)
    })
}

/// Mean irradiance of a surface.
#[must_use]
pub fn mean_irradiance(lit: &LitMesh, surface: usize) -> DVec3 {
    let (area, flux) = area_and_flux(lit, surface, |_| true);
    flux / area
}
