//! How long import and mesh of a scene take, and how large the mesh is: `cargo run --release -p bake --example mesh -- SCENE [ERROR]`.

use std::time::Instant;

use anyhow::Context;
use bake::BakeSettings;
use bake::ShootingMesh;
use scene::{ImportOptions, import};

fn main() -> anyhow::Result<()> {
    let mut arguments = std::env::args().skip(1);
    let path = arguments.next().context("give a scene")?;
    let error = arguments.next().map_or(Ok(0.05), |error| error.parse())?;
    let start = Instant::now();
    let scene = import(path.as_ref(), &ImportOptions { needs_light: false, ..ImportOptions::default() })?;
    let facets: usize = scene.surfaces.iter().map(|surface| surface.facets.len()).sum();
    let triangles: usize =
        scene.surfaces.iter().flat_map(|surface| &surface.facets).map(|facet| facet.triangles.len()).sum();
    let vertices = scene.vertex_count;
    println!(
        "import {:.2} s: {triangles} triangles, {facets} facets, {vertices} vertices",
        start.elapsed().as_secs_f64()
    );
    let start = Instant::now();
    let ShootingMesh { mesh, .. } = ShootingMesh::new(&scene, &BakeSettings::for_error(error));
    println!(
        "mesh {:.2} s: {} vertices, {} patches, {} leaves",
        start.elapsed().as_secs_f64(),
        mesh.vertices.len(),
        mesh.patches.len(),
        mesh.leaves().count()
    );
    Ok(())
}
