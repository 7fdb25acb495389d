//! The mesh of the output: without T-junctions, with no more vertices than light needs, and as good to look at as the bake.

use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};

use bake::{BakeSettings, Baked};
use cluster::{Cluster, Workers};
use document::texture::linear_to_srgb;
use glam::{DMat4, DVec3, I64Vec3};
use output::export::{ExportSettings, export};
use output::render::{LookAt, TileSettings, read_lit, render_tiles};
use proptest::prelude::*;
use scene::{ImportOptions, ReadOptions, Scene, import_slice};
use tempfile::TempDir;
use tests::baking::{baked, imported};
use tests::builder::{Material, SceneBuilder};
use tests::shapes;
use verify::picture::{Flip, Picture, flip};

/// Positions closer than this are one, relative to the extent.
const ONE: f64 = 1e-6;

/// A vertex this close to an edge lies on it.
const ON_EDGE: f64 = 2e-6;

/// Triangles of a GLB in the world, three positions each.
fn triangles(path: &Path) -> Vec<[DVec3; 3]> {
    let gltf = gltf::Gltf::open(path).unwrap();
    let blob = gltf.blob.clone();
    let mut found = vec![];
    let mut todo: Vec<(gltf::Node, DMat4)> =
        gltf.scenes().flat_map(|scene| scene.nodes()).map(|node| (node, DMat4::IDENTITY)).collect();
    while let Some((node, above)) = todo.pop() {
        let local = node.transform().matrix().map(|column| column.map(f64::from));
        let world = above * DMat4::from_cols_array_2d(&local);
        todo.extend(node.children().map(|child| (child, world)));
        for primitive in node.mesh().into_iter().flat_map(|mesh| mesh.primitives()) {
            let reader = primitive.reader(|_| blob.as_deref());
            let place = |p: [f32; 3]| world.transform_point3(DVec3::from_array(p.map(f64::from)));
            let positions: Vec<DVec3> = reader.read_positions().unwrap().map(place).collect();
            let indices: Vec<usize> = match reader.read_indices() {
                Some(indices) => indices.into_u32().map(|index| index as usize).collect(),
                None => (0..positions.len()).collect(),
            };
            found
                .extend(indices.chunks_exact(3).map(|t| [positions[t[0]], positions[t[1]], positions[t[2]]]));
        }
    }
    found
}

/// Edges of one triangle only in whose inside another vertex lies.
fn t_junctions(triangles: &[[DVec3; 3]]) -> usize {
    let corners = || triangles.iter().flatten().copied();
    let (low, high) = (corners().fold(DVec3::MAX, DVec3::min), corners().fold(DVec3::MIN, DVec3::max));
    let extent = (high - low).max_element();
    let cell = |point: DVec3| (point / (extent * ONE)).round().as_i64vec3();
    let places: HashMap<I64Vec3, DVec3> = corners().map(|point| (cell(point), point)).collect();
    let mut edges: HashMap<[[i64; 3]; 2], u32> = HashMap::new();
    for triangle in triangles {
        let own = triangle.map(|corner| cell(corner).to_array());
        if own[0] != own[1] && own[1] != own[2] && own[2] != own[0] {
            for (a, b) in [(0, 1), (1, 2), (2, 0)] {
                *edges.entry([own[a].min(own[b]), own[a].max(own[b])]).or_default() += 1;
            }
        }
    }
    let mut sorted: Vec<DVec3> = places.values().copied().collect();
    sorted.sort_by(|a, b| a.x.total_cmp(&b.x));
    let open = edges.iter().filter(|(_, count)| **count == 1);
    open.filter(|(ends, _)| {
        let [a, b] = ends.map(|end| places[&I64Vec3::from_array(end)]);
        let length = a.distance(b);
        let along = (b - a) / length;
        let first = sorted.partition_point(|point| point.x < a.x.min(b.x) - extent * ON_EDGE);
        let mut near = sorted[first..].iter().take_while(|point| point.x <= a.x.max(b.x) + extent * ON_EDGE);
        near.any(|point| {
            let part = (*point - a).dot(along);
            (*point - a - along * part).length() < extent * ON_EDGE
                && (length * 1e-3..length * 0.999).contains(&part)
        })
    })
    .count()
}

fn written(scene: &Scene, baked: &Baked) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("lit.glb");
    export(scene, &baked.lit, &ExportSettings::default(), &path).unwrap();
    (folder, path)
}

/// T-junctions of a bake beyond those of its scene.
fn new_t_junctions(glb: &[u8], options: &ImportOptions, settings: &BakeSettings) -> usize {
    let scene = import_slice(glb, options).unwrap();
    let (folder, path) = written(&scene, &baked(&scene, settings));
    let input = folder.path().join("input.glb");
    fs::write(&input, glb).unwrap();
    t_junctions(&triangles(&path)).saturating_sub(t_junctions(&triangles(&input)))
}

#[test]
fn no_bake_has_t_junctions_that_its_scene_has_not() {
    let sky = ImportOptions { sky: DVec3::new(1.0, 1.25, 1.6), ..ImportOptions::default() };
    let scenes = [
        ("cornell", ImportOptions::default(), 0.02),
        ("table", ImportOptions::default(), 0.03),
        ("doorway", ImportOptions::default(), 0.03),
        ("house", sky, 0.1),
    ];
    for (name, options, error) in scenes {
        let glb = fs::read(tests::data(&format!("scenes/{name}.glb"))).unwrap();
        for simplify in [true, false] {
            let settings = BakeSettings { simplify, ..BakeSettings::for_error(error) };
            assert_eq!(new_t_junctions(&glb, &options, &settings), 0, "{name}, simplified: {simplify}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn boxes_that_touch_have_no_t_junctions(
        boxes in prop::collection::vec((0_u8..5, 0_u8..5, 1_u8..4, 1_u8..4, 1_u8..5), 1..5),
        turn in 0.0..6.0,
    ) {
        let mut builder = SceneBuilder::new().part("room", &shapes::unit_room(), Material::grey(0.5));
        for (x, y, width, depth, height) in boxes {
            let low = DVec3::new(f64::from(x), f64::from(y), 0.0) / 7.0;
            let size = DVec3::new(f64::from(width), f64::from(depth), f64::from(height)) / 9.0;
            let high = (low + size).min(DVec3::splat(0.95));
            builder = builder.part("box", &shapes::box_facing_out(low, high), Material::grey(0.6));
        }
        let builder = builder
            .point_light(DVec3::new(0.9, 0.95, 0.9), 1.0)
            .all_placed(DMat4::from_rotation_y(turn));
        let settings = BakeSettings { shooter_edge: 0.3, mesh_error: 0.05, ..BakeSettings::default() };
        prop_assert_eq!(new_t_junctions(&builder.glb(), &ImportOptions::default(), &settings), 0);
    }
}

/// Inside a furnace light is the same everywhere.
#[test]
fn a_box_in_even_light_keeps_its_triangles() {
    let room = shapes::box_facing_in(DVec3::ZERO, DVec3::new(3.0, 2.0, 1.0));
    let scene = imported(&SceneBuilder::new().part("room", &room, Material::grey(0.5).emitting(1.0)).glb());
    let lit = baked(&scene, &BakeSettings::default()).lit;
    assert_eq!(lit.surfaces[0].len(), 12);
    let of_input = scene.surfaces[0].facets.iter().flat_map(|facet| &facet.triangles);
    for triangle in of_input {
        let has = |corners: [u32; 3]| {
            corners.iter().all(|corner| triangle.positions.contains(&lit.vertices[*corner as usize].position))
        };
        assert!(lit.surfaces[0].iter().any(|own| has(own.vertices)), "{triangle:?} is not there");
    }
}

/// Simplification may add 3 % to the estimated error, and says how much it did.
#[test]
fn the_error_grows_by_no_more_than_stated() {
    for name in ["cornell", "table", "doorway"] {
        let of = |simplify| {
            let settings = BakeSettings { simplify, ..BakeSettings::for_error(0.03) };
            tests::measured::measured(name, &settings)
        };
        let (simple, full) = (of(true), of(false));
        let stated = simple.report.error.total / full.report.error.total;
        assert!((1.0..=1.0308).contains(&stated), "{name}: {stated}");
        let found = simple.score.relative_l2 / full.score.relative_l2;
        assert!(found <= 1.05, "{name}: {found}");
    }
}

/// A view: file of its path-traced picture, eye, target, angle from side to side, and exposure of the picture.
type View = (&'static str, DVec3, DVec3, f64, f64);

/// FLIP of a view of a scene baked to 2 %: mean and 99th percentile.
fn flip_of(path: &Path, (name, eye, target, angle, exposure): View) -> (f64, f64) {
    let image = image::open(tests::data(&format!("references/pictures/{name}.png"))).unwrap().into_rgb8();
    let size = [image.width(), image.height()];
    let pixels = image.pixels().map(|pixel| DVec3::from_array(pixel.0.map(f64::from)) / 255.0).collect();
    let truth = Picture { width: size[0] as usize, pixels };
    let file = read_lit(path, &ReadOptions::default()).unwrap();
    let aspect = f64::from(size[0]) / f64::from(size[1]);
    let height_angle = 2.0 * ((angle.to_radians() / 2.0).tan() / aspect).atan();
    let camera = LookAt { eye, target, up: DVec3::Y, height_angle }.camera(&file.frame, aspect).unwrap();
    let cluster = Cluster::start(&Workers::Embedded { threads: 2 }.into()).unwrap();
    let settings = TileSettings { camera, size, samples: 64, background: DVec3::ZERO };
    let scene = kernel::picture::encode_picture(&file.scene);
    let picture = render_tiles(&mut cluster.handle(0), scene, &settings, &mut |_, _| ()).unwrap();
    let shown = |radiance: &[f32; 3]| {
        let channel = |value: f32| linear_to_srgb((f64::from(value) * exposure).clamp(0.0, 1.0));
        DVec3::from_array(radiance.map(channel))
    };
    let pixels = picture.pixels.iter().map(shown).collect();
    let Flip { mean, p99 } = Flip::of(&flip(&truth, &Picture { width: truth.width, pixels })).unwrap();
    (mean, p99)
}

/// The limits are measured values with little room.
#[test]
fn bakes_look_like_path_traced_pictures() {
    let at = DVec3::new;
    let views: [(&str, View, [f64; 2]); 5] = [
        (
            "cornell",
            ("cornell-inside", at(2.75, 2.75, 5.4), at(2.75, 2.6, 0.0), 75.0, 3.0197),
            [0.026, 0.065],
        ),
        ("cornell", ("cornell-floor", at(0.4, 1.6, 5.2), at(3.6, 0.0, 2.0), 60.0, 3.591_31), [0.026, 0.085]),
        ("table", ("table-room", at(5.6, 2.2, 4.6), at(2.8, 0.4, 2.2), 60.0, 0.176_705), [0.026, 0.085]),
        ("doorway", ("doorway-lit", at(3.5, 1.7, 0.4), at(1.2, 0.8, 3.2), 75.0, 0.368_206), [0.022, 0.090]),
        ("doorway", ("doorway-dark", at(7.6, 1.8, 0.4), at(4.1, 1.0, 3.2), 70.0, 2.412_51), [0.030, 0.095]),
    ];
    let mut lit: HashMap<&str, (TempDir, PathBuf)> = HashMap::new();
    let mut worse = vec![];
    for (name, view, [most_mean, most_percentile]) in views {
        let (_, path) = lit.entry(name).or_insert_with(|| {
            let scene = imported(&fs::read(tests::data(&format!("scenes/{name}.glb"))).unwrap());
            written(&scene, &baked(&scene, &BakeSettings::for_error(0.02)))
        });
        let (mean, percentile) = flip_of(path, view);
        eprintln!("{}: FLIP {mean:.4}, 99th percentile {percentile:.4}", view.0);
        if mean > most_mean || percentile > most_percentile {
            worse.push(format!("{}: {mean} {percentile}", view.0));
        }
    }
    assert!(worse.is_empty(), "{worse:?}");
}
