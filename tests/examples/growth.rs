//! What bakes of buildings take beside their rows: `cargo measure growth -- ROOMS...`.

use std::error::Error;
use std::time::Instant;

use bake::{BakeSettings, Baked, Unobserved, bake};
use output::export::{ExportSettings, export};
use tests::baking::imported;
use tests::building::building;
use tests::rooms_only::RoomsOnly;

/// Edge of the shooting patches, in metres: the same in every building.
const EDGE: f64 = 0.8;

/// Interpolation error asked for.
const MESH_ERROR: f64 = 0.03;

fn main() -> Result<(), Box<dyn Error>> {
    println!("rooms  vertices  shares      rows   kept MB  sent MB    shots  sweeps  seconds: steps");
    for rooms in std::env::args().skip(1) {
        let building = building(rooms.parse()?);
        let clock = Instant::now();
        let scene = imported(&building.scene.glb());
        let import = clock.elapsed().as_secs_f64();
        let settings = BakeSettings {
            shooter_edge: EDGE / building.extent,
            mesh_error: MESH_ERROR,
            max_vertices: Some(1_000_000),
            ..BakeSettings::default()
        };
        let mut service = RoomsOnly::new(&building, scene.frame);
        let Baked { lit, report, .. } = bake(&scene, &settings, &mut service, &mut Unobserved)?;
        let baked = clock.elapsed().as_secs_f64();
        let file = std::env::temp_dir().join(format!("growth-{}.glb", std::process::id()));
        let export_settings = ExportSettings::default();
        export(&scene, &lit, &export_settings, &file)?;
        std::fs::remove_file(&file)?;
        let seconds = clock.elapsed().as_secs_f64();
        let steps: Vec<String> =
            report.seconds.iter().map(|(step, seconds)| format!("{step} {seconds:.2}")).collect();
        println!(
            "{rooms:>5} {:>9} {:>7} {:>9} {:>9.1} {:>8.1} {:>8} {:>7}  {seconds:.2}: import {import:.2}, {}, export {:.2}",
            report.vertices,
            report.shooting_vertices,
            report.rows,
            report.row_bytes as f64 / 1e6,
            service.bytes as f64 / 1e6,
            report.shots,
            report.sweeps,
            steps.join(", "),
            seconds - baked
        );
    }
    Ok(())
}
