use std::fs;

use document::ReadOptions;
use tempfile::TempDir;

use super::*;
use crate::reference::Place;
use bake::lit::LitMesh;
use fixtures::{light, open, test_scene};
use output::export::{ExportSettings, export};
use scene::Scene;

const HEADER: &str =
    "x,y,z,nx,ny,nz,primitive,radiosity_r,radiosity_g,radiosity_b,stderr_r,stderr_g,stderr_b";

/// A directory with the Cornell box, lit, and a reference.
struct Files {
    directory: TempDir,
}

impl Files {
    fn new(scene: &Scene, lit: &LitMesh, rows: &[&str]) -> Self {
        let files = Self { directory: TempDir::new().unwrap() };
        let settings = ExportSettings::default();
        export(scene, lit, &settings, &files.path("lit.glb")).unwrap();
        files.write_reference(&[&[HEADER], rows].concat());
        files
    }

    /// The Cornell box, lit with an irradiance that depends on the position.
    fn cornell(irradiance: impl Fn(DVec3) -> DVec3, rows: &[&str]) -> Self {
        let scene = open("cornell.glb");
        Self::new(&scene, &light(&scene, 3, irradiance), rows)
    }

    fn path(&self, name: &str) -> PathBuf {
        self.directory.path().join(name)
    }

    fn write_reference(&self, lines: &[&str]) {
        fs::write(self.path("reference.csv"), lines.join("\n")).unwrap();
    }

    fn score(&self) -> Result<Score, ScoreError> {
        let scene = test_scene("cornell.glb");
        score(&self.path("lit.glb"), &self.path("reference.csv"), &scene, &ReadOptions::default())
    }
}

/// Takes the ceiling away from where the reference has it.
fn raise_ceiling(lit: &mut LitMesh) {
    for triangle in lit.surfaces[1].clone() {
        triangle.vertices.iter().for_each(|&vertex| lit.vertices[vertex as usize].position.y += 100.0);
    }
}

fn assert_near(value: f64, expected: f64) {
    assert!((value - expected).abs() < 1e-6, "{value} is not {expected}");
}

#[test]
fn figures_of_a_constant_irradiance_are_those_computed_by_hand() {
    // The floor reflects .73: everywhere .73 x 2 = 1.46.
    let rows = [
        "1,0,1,0,1,0,0,1.46,1.46,1.46,.1,.1,.1",
        "5,0,1,0,1,0,0,1.46,1.46,1.46,.1,.1,.1",
        "1,0,5,0,1,0,0,1.46,1.46,1.46,.1,.1,.1",
        "5,0,5,0,1,0,0,1,1,1,.1,.1,.1",
        "2,5.5,2,0,-1,0,1,1,1,1,.1,.1,.1",
    ];
    let scene = open("cornell.glb");
    let mut lit = light(&scene, 3, |_| DVec3::splat(2.0));
    raise_ceiling(&mut lit);
    let score = Files::new(&scene, &lit, &rows).score().unwrap();
    let mean = (3.0 * 1.46 + 1.0) / 4.0;
    let noise = 4.0 * 0.01;
    let signal = 3.0 * 1.46_f64.powi(2) + 1.0 - noise;
    assert_near(score.relative_l2, ((0.46_f64.powi(2) - noise) / signal).sqrt());
    assert_near(score.reference_noise, (noise / (signal + noise)).sqrt());
    assert_near(score.energy_ratio, 1.46 / mean);
    assert_near(score.max, 0.46 / mean);
    assert_near(score.p95, 0.85 * 0.46 / mean);
    assert_eq!((score.uncovered, score.not_finite), (1, 0));
    // 7 sheets and 2 boxes of 6 sides; every sheet 2 x 4^3 triangles over 9 x 9 vertices.
    assert_eq!((score.triangles, score.vertices), (19 * 128, 19 * 81));
}

#[test]
fn every_point_of_a_reference_is_found_and_interpolated_linearly() {
    let gradient = |world: DVec3| DVec3::new(world.x, 2.0 * world.y, 1.0 + world.z);
    let files = Files::cornell(gradient, &[]);
    let reference = test_scene("../references/cornell.reference.csv");
    let points = read(&reference).unwrap();
    assert_eq!(points.len(), 4000);
    let materials = PlainScene::open(&test_scene("cornell.glb")).unwrap().materials;
    let rows: Vec<String> = points
        .iter()
        .map(|point| {
            let Place { position: p, normal: n, primitive } = point.place;
            let b = materials[primitive].reflectance * gradient(p);
            format!(
                "{},{},{},{},{},{},{primitive},{},{},{},0,0,0",
                p.x, p.y, p.z, n.x, n.y, n.z, b.x, b.y, b.z
            )
        })
        .collect();
    files.write_reference(&[&[HEADER], &rows.iter().map(String::as_str).collect::<Vec<_>>()[..]].concat());
    let score = files.score().unwrap();
    assert_eq!(score.uncovered, 0);
    // The reference's positions have six decimals.
    assert!(score.max < 1e-5, "{}", score.max);
    assert_near(score.energy_ratio, 1.0);
}

/// Only the tall block of Cornell's box is lit, evenly; and the vertices of its triangles. Its bottom and the floor coincide.
fn lit_block(scene: &Scene) -> (LitMesh, Vec<usize>) {
    let mut lit = light(scene, 1, |_| DVec3::ZERO);
    let tall = scene.surfaces.iter().position(|surface| surface.name.starts_with("tall")).unwrap();
    let triangles = lit.surfaces[tall].iter();
    let vertices: Vec<usize> =
        triangles.flat_map(|triangle| triangle.vertices).map(|vertex| vertex as usize).collect();
    vertices.iter().for_each(|vertex| lit.vertices[*vertex].irradiance = DVec3::ONE);
    (lit, vertices)
}

#[test]
fn of_two_sheets_at_one_place_the_one_that_faces_the_point_counts() {
    let scene = open("cornell.glb");
    let (lit, _) = lit_block(&scene);
    let rows = [
        "1.8,0,1.8,0,-1,0,8,.73,.73,.73,0,0,0",
        "1.8,0,1.8,0,1,0,0,0,0,0,0,0,0",
        "5.4,0,5.4,0,1,0,0,0,0,0,0,0,0",
    ];
    let score = Files::new(&scene, &lit, &rows).score().unwrap();
    assert!(score.max < 1e-6 && score.uncovered == 0, "{score:?}");
}

#[test]
fn of_two_sheets_a_rounding_apart_the_one_that_faces_the_point_counts() {
    // The bottom of the tall block has sunk into it by a tenth of the distance that points look over: the floor is nearer.
    let scene = open("cornell.glb");
    let (mut lit, vertices) = lit_block(&scene);
    for vertex in vertices {
        let position = &mut lit.vertices[vertex].position;
        if scene.frame.to_world(*position).y < 1e-3 {
            position.y = scene.frame.to_frame(DVec3::Y * 5e-5).y;
        }
    }
    let score = Files::new(&scene, &lit, &["1.8,0,1.8,0,-1,0,8,.73,.73,.73,0,0,0"]).score().unwrap();
    assert!(score.max < 1e-6 && score.uncovered == 0, "{score:?}");
}

#[test]
fn errors_below_the_noise_of_the_reference_are_lost_in_it() {
    let lost = |irradiance: f64, standard_error: f64| {
        let row = format!("1,0,1,0,1,0,0,.73,.73,.73,{standard_error},{standard_error},{standard_error}");
        let score = Files::cornell(|_| DVec3::splat(irradiance), &[&row]).score().unwrap();
        score.is_lost_in_noise()
    };
    assert!(!lost(2.0, 0.1));
    assert!(lost(1.05, 0.1));
    // Nearly all of its radiosity is noise: what is found relative to the rest means nothing.
    assert!(lost(2.0, 0.72));
}

/// Its points have no extent; that of the scene says how near is near.
#[test]
fn reference_of_a_single_point_is_found() {
    let score = Files::cornell(|_| DVec3::ONE, &["1,0,1,0,1,0,0,.73,.73,.73,0,0,0"]).score().unwrap();
    assert_eq!(score.uncovered, 0);
    assert_near(score.energy_ratio, 1.0);
}

#[test]
fn what_is_not_finite_shows() {
    let point = || ReferencePoint {
        place: Place { position: DVec3::ZERO, normal: DVec3::Y, primitive: 0 },
        radiosity: DVec3::ONE,
        standard_error: DVec3::ZERO,
    };
    let radiosities = [Some(DVec3::ONE), Some(DVec3::new(1.0, f64::NAN, 1.0)), None];
    let score = compare(&[point(), point(), point()], &radiosities);
    assert_eq!((score.not_finite, score.uncovered), (1, 1));
    assert!(score.relative_l2.is_nan() && score.energy_ratio.is_nan() && score.max.is_nan());
}

#[test]
fn references_that_do_not_fit_are_refused() {
    let good = "1,0,1,0,1,0,0,1,1,1,0,0,0";
    let files = Files::cornell(|_| DVec3::ONE, &[good, "5,0,5,0,1,0,0,1,1,1,0,0,0"]);
    files.score().unwrap();
    for (lines, expected) in [
        (vec!["x,y,z", good], "its first line must be x,y,z,nx,ny,nz,primitive"),
        (vec![], "its first line must be"),
        (vec![HEADER], "has no points"),
        (vec![HEADER, good, "1,2,3"], "line 3: expected 13 finite numbers"),
        (vec![HEADER, "1,0,1,0,1,0,0,one,1,1,0,0,0"], "line 2: expected 13 finite numbers"),
        (vec![HEADER, "1,0,1,0,1,0,0,nan,1,1,0,0,0"], "line 2: expected 13 finite numbers"),
        (vec![HEADER, "1,0,1,0,1,0,.5,1,1,1,0,0,0"], "the seventh a primitive's index"),
        (vec![HEADER, "1,0,1,0,1,0,9,1,1,1,0,0,0"], "refers to primitive 9, but"),
        // In the air, on another primitive, and on the back of the right one.
        (vec![HEADER, good, "9,9,9,0,1,0,0,1,1,1,0,0,0"], "1 of 2 points of"),
        (vec![HEADER, good, "1,0,1,0,1,0,1,1,1,1,0,0,0"], "lie on no surface of"),
        (vec![HEADER, "1,0,1,0,-1,0,0,1,1,1,0,0,0"], "the first on line 2: use the scene of the reference"),
    ] {
        files.write_reference(&lines);
        let error = files.score().unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    }
}

#[test]
fn lit_scene_that_is_mostly_elsewhere_is_refused() {
    let scene = open("cornell.glb");
    let mut lit = light(&scene, 1, |_| DVec3::ONE);
    raise_ceiling(&mut lit);
    let [floor, ceiling] = ["1,0,1,0,1,0,0,1,1,1,0,0,0", "2,5.5,2,0,-1,0,1,1,1,1,0,0,0"];
    assert_eq!(Files::new(&scene, &lit, &[floor, ceiling]).score().unwrap().uncovered, 1);
    let error = Files::new(&scene, &lit, &[floor, ceiling, ceiling]).score().unwrap_err().to_string();
    assert!(
        error.contains("1 of 3 points of") && error.contains("bake the scene of the reference"),
        "{error}"
    );
}

/// The radiosity of a reference is all that leaves a surface.
#[test]
fn what_a_surface_emits_itself_counts() {
    let [red, green, blue] =
        PlainScene::open(&test_scene("cornell.glb")).unwrap().materials[6].exitance.to_array();
    assert!(red > 0.0);
    let lamp = read(&test_scene("../references/cornell.reference.csv")).unwrap();
    assert!(lamp.iter().all(|point| point.place.primitive != 6), "the lamp is black");
    let row = |x| format!("{x},5.49,2.75,0,-1,0,6,{red},{green},{blue},0,0,0");
    assert_near(Files::cornell(|_| DVec3::ONE, &[&row(2.5), &row(3.0)]).score().unwrap().relative_l2, 0.0);
}

#[test]
fn scenes_that_are_missing_broken_or_not_lit_are_refused() {
    let files = Files::cornell(|_| DVec3::ONE, &["1,0,1,0,1,0,0,1,1,1,0,0,0"]);
    fs::write(files.path("broken.glb"), "glTF, but not much of it").unwrap();
    for (lit, expected) in [
        (files.path("missing.glb"), "cannot be read"),
        (files.path("broken.glb"), "is truncated"),
        (test_scene("cornell.glb"), "a primitive of node floor has no _IRRADIANCE"),
    ] {
        let error =
            score(&lit, &files.path("reference.csv"), &test_scene("cornell.glb"), &ReadOptions::default())
                .unwrap_err()
                .to_string();
        assert!(error.contains(expected), "{error}");
    }
}

#[test]
fn a_surface_close_above_is_not_taken_for_the_one_that_the_point_is_on() {
    let sheet = |y: f64| [DVec3::new(0.0, y, 0.0), DVec3::new(0.0, y, 10.0), DVec3::new(10.0, y, 0.0)];
    // Both within the distance from which a point looks, a thousandth.
    let triangles = [sheet(5e-4), sheet(0.0), sheet(-5e-4)];
    let grid = TriangleGrid::new(&triangles, 10.0);
    for (index, height) in [5e-4, 0.0, -5e-4].into_iter().enumerate() {
        let (found, _) = grid.locate(DVec3::new(2.0, height, 2.0), DVec3::Y).unwrap();
        assert_eq!(found, index, "at height {height}");
    }
}
