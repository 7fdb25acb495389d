//! How long import and mesh of a scene take, and how large the mesh is: `cargo run --release -p bake --example mesh -- SCENE [ERROR]`.

use std::time::Instant;

use anyhow::Context;
use bake::BakeSettings;
use bake::ShootingMesh;
use bake::mesh::Mesh;
use scene::{ImportOptions, Scene, import};

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
    let (count, difference) = uncovered(&scene, &mesh);
    println!("{count} facets not covered by their leaves, by {difference:.3} square frame units");
    Ok(())
}

/// How many lit facets the leaves differ from by more than a thousandth of their area, and by how much together, in square frame units.
fn uncovered(scene: &Scene, mesh: &Mesh) -> (usize, f64) {
    let mut covered: Vec<Vec<f64>> =
        scene.surfaces.iter().map(|surface| vec![0.0; surface.facets.len()]).collect();
    for (_, leaf) in mesh.leaves() {
        covered[leaf.surface as usize][leaf.facet as usize] += leaf.area;
    }
    let facets = scene.surfaces.iter().flat_map(|surface| &surface.facets).zip(covered.iter().flatten());
    let lit = facets.filter(|(facet, _)| !facet.is_sealed);
    let differences = lit.filter_map(|(facet, covered)| {
        let area = facet.polygon().area();
        let difference = (covered - area).abs();
        (difference > 1e-3 * area).then_some(difference)
    });
    differences.fold((0, 0.0), |(count, sum), difference| (count + 1, sum + difference))
}
