//! A file through import and export, with the same light everywhere, to see what reading and writing take:
//! `cargo measure through -- FILE.glb OUT.glb`.

use std::collections::HashMap;
use std::error::Error;
use std::path::Path;
use std::time::Instant;

use bake::lit::{LitMesh, LitTriangle, LitVertex};
use glam::DVec3;
use output::export::{ExportSettings, export};
use scene::Scene;
use scene::{ImportOptions, import};

fn main() -> Result<(), Box<dyn Error>> {
    let [input, output] = std::env::args().skip(1).collect::<Vec<_>>().try_into().map_err(|_| "IN OUT")?;
    let clock = Instant::now();
    let scene = import(Path::new(&input), &ImportOptions { needs_light: false, ..ImportOptions::default() })?;
    report("import", clock);
    let clock = Instant::now();
    let lit = evenly_lit(&scene);
    report("mesh", clock);
    let clock = Instant::now();
    let exported = export(&scene, &lit, &ExportSettings::default(), Path::new(&output))?;
    report("export", clock);
    println!("{} vertices, {} triangles", exported.vertices, exported.triangles);
    Ok(())
}

/// Every facet as a fan, with an irradiance of 1.
fn evenly_lit(scene: &Scene) -> LitMesh {
    let mut lit = LitMesh::default();
    for surface in &scene.surfaces {
        let mut known = HashMap::new();
        let mut triangles = Vec::new();
        for (facet, value) in (0..).zip(&surface.facets) {
            let corners: Vec<u32> = value
                .corners
                .iter()
                .map(|corner| {
                    let key =
                        [corner.position, corner.normal].map(|point| point.to_array().map(f64::to_bits));
                    *known.entry(key).or_insert_with(|| {
                        let (position, normal, irradiance) = (corner.position, corner.normal, DVec3::ONE);
                        lit.vertices.push(LitVertex { position, normal, irradiance });
                        lit.vertices.len() as u32 - 1
                    })
                })
                .collect();
            let fan = corners[1..].windows(2).map(|pair| [corners[0], pair[0], pair[1]]);
            triangles.extend(fan.map(|vertices| LitTriangle { facet, vertices }));
        }
        lit.surfaces.push(triangles);
    }
    lit
}

/// Seconds of a step, and the most memory so far, where Linux counts it.
fn report(step: &str, clock: Instant) {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).unwrap_or("?");
    println!("{step}: {:.2} s, at most {} so far", clock.elapsed().as_secs_f64(), peak.trim());
}
