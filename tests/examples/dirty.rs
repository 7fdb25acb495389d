//! A dirty mesh baked to the end with default settings, and what came out: time, memory, and faults that a careless mesh provokes.
//!
//!     cargo measure dirty -- [TRIANGLES [OUT.glb]]
//!
//! `coordinator render OUT.glb -o OUT.png --eye 0.3,2.4,3.7 --target 4,0.8,1 --fov 70` shows it.

use std::error::Error;
use std::path::Path;
use std::time::Instant;

use bake::BakeSettings;
use glam::DVec3;
use output::export::{ExportSettings, export};
use tests::baking::{area_and_flux, baked, imported};
use tests::dirty::{ROOM, dirty_room};

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let triangles = arguments.next().map_or(Ok(500_000), |text| text.parse())?;
    let output = arguments.next().unwrap_or_else(|| "dirty-lit.glb".to_owned());
    let glb = dirty_room(triangles);
    println!("{:.1} MB", glb.len() as f64 / 1e6);

    let clock = Instant::now();
    let scene = imported(&glb);
    drop(glb);
    let facets: usize = scene.surfaces.iter().map(|surface| surface.facets.len()).sum();
    println!(
        "import: {:.2} s, {facets} facets, {} triangles without area",
        clock.elapsed().as_secs_f64(),
        scene.degenerate_triangles
    );

    let clock = Instant::now();
    let baked = baked(&scene, &BakeSettings::default());
    let steps: Vec<String> =
        baked.report.seconds.iter().map(|(step, seconds)| format!("{step} {seconds:.2}")).collect();
    println!("bake: {:.2} s ({})", clock.elapsed().as_secs_f64(), steps.join(", "));
    let (lit, report) = (&baked.lit, &baked.report);
    println!("{} vertices, {} shares, {} rows", report.vertices, report.shooting_vertices, report.rows);

    let is_sound = |light: DVec3| light.is_finite() && light.min_element() >= 0.0;
    let unsound =
        lit.vertices.iter().filter(|vertex| !is_sound(vertex.irradiance) || !vertex.position.is_finite());
    println!("vertices whose light is not a number or below zero: {}", unsound.count());
    // Above the furniture every place sees the lamp or a lit wall.
    let open = |place: DVec3| scene.frame.to_world(place).y > 2.0;
    let (area, flux) = area_and_flux(lit, 0, open);
    let mean = flux.x / area;
    let dark = lit.surfaces[0].iter().filter(|triangle| {
        let corners = triangle.vertices.map(|vertex| lit.vertices[vertex as usize]);
        let middle = corners.iter().map(|corner| corner.position).sum::<DVec3>() / 3.0;
        open(middle) && corners.iter().all(|corner| corner.irradiance.x < 0.1 * mean)
    });
    println!("open triangles darker than a tenth of the mean there: {}", dark.count());
    // Within the box that stands on the floor, and in the closed corner where another passes through the walls.
    let hidden = |place: DVec3| {
        let place = scene.frame.to_world(place);
        let within = |low: DVec3, high: DVec3| place.cmpgt(low).all() && place.cmplt(high).all();
        within(DVec3::new(1.02, -0.1, 1.02), DVec3::new(1.98, 0.28, 1.98))
            || within(DVec3::new(5.22, 0.12, 3.22), ROOM + DVec3::new(0.1, -1.92, 0.1))
    };
    let brightest =
        lit.vertices.iter().filter(|vertex| hidden(vertex.position)).map(|vertex| vertex.irradiance.x);
    println!("brightest place in closed corners: {:.2e} of the mean", brightest.fold(0.0, f64::max) / mean);

    let exported = export(&scene, lit, &ExportSettings::default(), Path::new(&output))?;
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).unwrap_or("?");
    println!("{output}: {} triangles; at most {} of memory", exported.triangles, peak.trim());
    Ok(())
}
