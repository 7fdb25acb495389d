//! Lightmaps: their texels against path-traced references and vertices of the same bake, and the files that they come in.

use std::collections::{BTreeSet, HashMap};
use std::path::Path;

use assert_cmd::Command;
use bake::{AskedPoints, BakeSettings, LightGroup};
use glam::{DMat4, DVec3};
use gltf::{Gltf, Semantic};
use lightmap::{Lightmap, Plan, Resolution, plan};
use output::export::{ExportSettings, export};
use scene::{ImportOptions, ReadOptions, Scene, import, import_slice};
use serde_json::{Value, json};
use tests::baking::baked_with_points;
use tests::builder::{Material, SceneBuilder, pack};
use tests::data;
use tests::programs::binary;
use tests::shapes;
use verify::plain::PlainScene;
use verify::reference::{locate, read};
use verify::score::score;

fn cornell() -> Scene {
    import(&data("scenes/cornell.glb"), &ImportOptions::default()).unwrap()
}

fn planned(scene: &Scene, texel: f64) -> Plan {
    plan(scene, Resolution::Texel(texel), &|| false).unwrap()
}

fn texels(plan: &Plan) -> AskedPoints<'_> {
    AskedPoints { on_surfaces: plan.points(), around: plan.around(), ..AskedPoints::default() }
}

/// Irradiance that a viewer finds at a place of a surface, with bilinear filtering.
fn seen_at(map: &Lightmap, scene: &Scene, surface: usize, place: DVec3) -> Option<DVec3> {
    let layout = map.layouts.iter().find(|layout| layout.surface == surface)?;
    let sorted = |mut vertices: [u32; 3]| {
        vertices.sort_unstable();
        vertices
    };
    let triangles: HashMap<[u32; 3], usize> = layout
        .triangles
        .iter()
        .enumerate()
        .map(|(index, own)| (sorted(own.map(|vertex| layout.sources[vertex as usize])), index))
        .collect();
    let all = scene.surfaces[surface].facets.iter().flat_map(|facet| &facet.triangles);
    // The triangle that the place is least far off: off its plane, or outside of its edges.
    let (_, vertices, weights) = all
        .map(|triangle| {
            let [a, b, c] = triangle.positions;
            let normal = (b - a).cross(c - a);
            let part = |from: DVec3, to: DVec3| {
                (to - from).cross(place - from).dot(normal) / normal.length_squared()
            };
            let weights = [part(b, c), part(c, a), part(a, b)];
            let outside = weights.into_iter().fold(0.0_f64, |most, weight| most.max(-weight));
            let off = (place - a).dot(normal).abs() / normal.length() + outside * normal.length().sqrt();
            (off, triangle.vertices, weights)
        })
        .min_by(|a, b| a.0.total_cmp(&b.0))?;
    let index = *triangles.get(&sorted(vertices))?;
    let corners = layout.corners(index, map.size);
    let weight = |corner: u32| {
        let source = layout.sources[corner as usize];
        vertices.iter().position(|vertex| *vertex == source).map_or(0.0, |at| weights[at])
    };
    let texel: glam::DVec2 =
        layout.triangles[index].iter().zip(corners).map(|(corner, at)| at * weight(*corner)).sum();
    let page = &map.images[0][layout.pages[index]? as usize];
    let (low, part) = ((texel - 0.5).floor(), (texel - 0.5).fract_gl());
    let at = |right: f64, down: f64| {
        let x = (low.x + right).clamp(0.0, f64::from(map.size[0] - 1)) as usize;
        let y = (low.y + down).clamp(0.0, f64::from(map.size[1] - 1)) as usize;
        DVec3::from_array(page[y * map.size[0] as usize + x].map(f64::from))
    };
    let row = |down: f64| at(0.0, down).lerp(at(1.0, down), part.x);
    Some(row(0.0).lerp(row(1.0), part.y))
}

/// Relative L2 of the radiosity at the points of the reference.
fn error_of(map: &Lightmap, scene: &Scene, name: &str) -> f64 {
    let plain = PlainScene::open(&data(&format!("scenes/{name}.glb"))).unwrap();
    let given = read(&data(&format!("references/{name}.reference.csv"))).unwrap();
    let places = locate(&plain, &given.iter().map(|point| point.place).collect::<Vec<_>>());
    assert!(places.iter().all(Option::is_some));
    let (mut errors, mut all) = (0.0, 0.0);
    // No light falls below the boxes, where texels are filled from their neighbours.
    for point in given.iter().filter(|point| point.radiosity != DVec3::ZERO) {
        let place = scene.frame.to_frame(point.place.position);
        let own = (0..scene.surfaces.len()).min_by(|a, b| {
            let distance = |surface: usize| {
                let facets = scene.surfaces[surface].facets.iter();
                let facing = facets.filter(|facet| facet.normal.dot(point.place.normal) > 0.99);
                facing
                    .map(|facet| {
                        let corners: Vec<DVec3> = facet.positions().collect();
                        let off = (place - corners[0]).dot(facet.normal).abs();
                        let next = corners.iter().cycle().skip(1);
                        let outside = corners.iter().zip(next).map(|(a, b)| {
                            let along = (*b - *a).normalize();
                            -facet.normal.cross(along).dot(place - *a)
                        });
                        off.max(outside.fold(0.0, f64::max))
                    })
                    .fold(f64::INFINITY, f64::min)
            };
            distance(*a).total_cmp(&distance(*b))
        });
        let surface = own.unwrap();
        let seen = seen_at(map, scene, surface, place).unwrap() * scene.surfaces[surface].reflectance
            + scene.surfaces[surface].exitance;
        // Without the variance of the reference, as the score has it.
        let variance = point.standard_error.length_squared();
        errors += (seen - point.radiosity).length_squared() - variance;
        all += point.radiosity.length_squared() - variance;
    }
    (errors / all).sqrt()
}

#[test]
fn texels_of_cornell_are_as_near_the_reference_as_was_asked() {
    let scene = cornell();
    let plan = planned(&scene, 0.05);
    let asked = 0.02;
    let baked = baked_with_points(&scene, &BakeSettings::for_error(asked), &texels(&plan), 2);
    let map = plan.lightmap(&baked.at_points.on_surfaces);
    let folder = tempfile::tempdir().unwrap();
    let lit = folder.path().join("lit.glb");
    export(&scene, &baked.lit, &ExportSettings::default(), &lit).unwrap();
    let vertices = score(
        &lit,
        &data("references/cornell.reference.csv"),
        &data("scenes/cornell.glb"),
        &ReadOptions::default(),
    )
    .unwrap();
    let texels = error_of(&map, &scene, "cornell");
    // Vertices follow the light, texels of 5 cm do not.
    assert!(texels <= asked && vertices.relative_l2 <= asked, "{texels} at texels, {vertices:?}");
}

/// A floor below bars that are thinner than the coarsest lattice is wide, under a sun: hardly a texel is far from what it has where all are
/// computed, though most are not.
#[test]
fn thin_shadows_fall_between_no_texels() {
    let bar = |index: usize| {
        let x = 0.3 + 0.55 * index as f64;
        shapes::box_facing_out(DVec3::new(x, 0.5, 0.2), DVec3::new(x + 0.04, 0.54, 3.8))
    };
    let floor = [[0.0, 0.0], [0.0, 4.0], [4.0, 4.0], [4.0, 0.0]].map(|[x, z]| DVec3::new(x, 0.0, z)).to_vec();
    let glb = SceneBuilder::new()
        .part("floor", &[floor], Material::grey(0.5))
        .part("bars", &(0..7).flat_map(bar).collect::<Vec<_>>(), Material::grey(0.5))
        .light(
            json!({ "type": "directional", "intensity": 3.0, "name": "sun" }),
            DMat4::from_rotation_x(-1.3),
        )
        .glb();
    let options = ImportOptions { sky: DVec3::splat(0.3), ..ImportOptions::default() };
    let scene = import_slice(&glb, &options).unwrap();
    let plan = planned(&scene, 0.02);
    for rows in [bake::RowStrategy::Exact, bake::RowStrategy::Gather] {
        let groups = vec![LightGroup { name: "day".into(), lights: vec!["sun".into()] }];
        let settings = BakeSettings { rows, groups, ..BakeSettings::for_error(0.05) };
        let light =
            |points: &AskedPoints| baked_with_points(&scene, &settings, points, 2).at_points.on_surfaces;
        let all = light(&AskedPoints { around: &[], ..texels(&plan) });
        let some = light(&texels(&plan));
        let is_mean = |(point, around): (&DVec3, &Option<[u32; 4]>)| {
            let mean =
                |around: [u32; 4]| around.map(|other| some[0][other as usize] / 4.0).iter().sum::<DVec3>();
            around.is_some_and(|around| mean(around).distance(*point) <= 1e-12 * point.length())
        };
        let means = some[0].iter().zip(plan.around()).filter(|of| is_mean(*of)).count();
        assert!(2 * means > some[0].len(), "{rows:?}: {means} of {} are means", some[0].len());
        for (layer, (expected, found)) in all.iter().zip(&some).enumerate() {
            let count = found.len() as f64;
            let mean = expected.iter().map(|light| light.x).sum::<f64>() / count;
            let off: Vec<f64> = expected.iter().zip(found).map(|(a, b)| (a.x - b.x).abs() / mean).collect();
            let rms = (off.iter().map(|off| off * off).sum::<f64>() / count).sqrt();
            let far = off.iter().filter(|off| **off > 0.2).count();
            assert!(rms < 0.025, "{rows:?}, layer {layer}: {rms} off");
            assert!(far * 1000 < found.len(), "{rows:?}, layer {layer}: {far} of {count} are far off");
        }
    }
}

#[test]
fn texels_are_the_same_whatever_the_workers() {
    let scene = cornell();
    let plan = planned(&scene, 0.1);
    for rows in [bake::RowStrategy::Exact, bake::RowStrategy::Gather] {
        let settings = BakeSettings { rows, ..BakeSettings::for_error(0.1) };
        let light =
            |threads| baked_with_points(&scene, &settings, &texels(&plan), threads).at_points.on_surfaces;
        assert!(light(1) == light(3), "{rows:?}");
    }
}

/// A room with a box, both sides of which are lit.
fn room() -> Vec<u8> {
    let [low, high] = [0.4, 0.6].map(DVec3::splat);
    SceneBuilder::new()
        .part("walls", &shapes::unit_room(), Material::grey(0.5).emitting(1.0))
        .part("box", &shapes::box_facing_out(low, high), Material::grey(0.5).double_sided())
        .glb()
}

fn solve(folder: &Path, arguments: &[&str]) -> std::process::Output {
    let mut command = Command::new(binary("coordinator"));
    command.current_dir(folder).args(["solve", "scene.glb", "--error", "0.2"]).args(arguments);
    command.output().unwrap()
}

#[test]
fn a_file_keeps_its_meshes_and_materials_and_names_its_lightmap() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("scene.glb"), room()).unwrap();
    let arguments = [
        "-o",
        "lit.glb",
        "--report",
        "report.json",
        "--lightmap",
        "--texel-size",
        "0.05",
        "--lightmap-format",
        "exr",
    ];
    let answer = solve(folder.path(), &arguments);
    assert!(answer.status.success(), "{}", String::from_utf8_lossy(&answer.stderr));
    let report: Value =
        serde_json::from_slice(&std::fs::read(folder.path().join("report.json")).unwrap()).unwrap();
    assert_eq!(
        (&report["lightmap"]["pages"], &report["lightmap"]["uses_second_set"]),
        (&1.into(), &false.into())
    );
    assert!(folder.path().join("lit-lightmap-0.exr").is_file());

    let [input, lit] = ["scene.glb", "lit.glb"].map(|name| Gltf::open(folder.path().join(name)).unwrap());
    let positions = |file: &Gltf| -> Vec<_> {
        let primitives =
            file.meshes().flat_map(|mesh| mesh.primitives().collect::<Vec<_>>()).collect::<Vec<_>>();
        primitives.iter().map(|own| own.get(&Semantic::Positions).unwrap().count()).collect()
    };
    // The box has two sides.
    assert_eq!((positions(&input).len(), positions(&lit).len()), (2, 3));
    let extras: Value = serde_json::from_str(lit.as_json().asset.extras.as_ref().unwrap().get()).unwrap();
    let map = &extras["halflight"]["lightmap"];
    assert_eq!((&map["texCoord"], &map["encoding"]), (&1.into(), &"srgb".into()));
    assert_eq!(map["files"], json!(["lit-lightmap-0.exr"]));
    for primitive in lit.meshes().flat_map(|mesh| mesh.primitives().collect::<Vec<_>>()) {
        let set = primitive.get(&Semantic::TexCoords(1)).unwrap();
        assert_eq!(set.count(), primitive.get(&Semantic::Positions).unwrap().count());
        let material = primitive.material();
        assert!(!material.unlit());
        let link = material.extension_value("MOZ_lightmap").unwrap();
        assert_eq!((&link["index"], &link["texCoord"]), (&map["textures"][0], &1.into()));
        assert_eq!(link["intensity"], map["scale"]);
    }
    // At most E = 1 / (1 - .5), which the walls would have without the box.
    let scale = map["scale"].as_f64().unwrap();
    assert!((1.2..2.2).contains(&scale), "{map}");
}

#[test]
fn pages_for_graphics_hardware_are_written_beside_the_file() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("scene.glb"), room()).unwrap();
    let arguments = ["-o", "lit.glb", "--lightmap", "--lightmap-size", "128", "--lightmap-format", "ktx2"];
    let answer = solve(folder.path(), &arguments);
    assert!(answer.status.success(), "{}", String::from_utf8_lossy(&answer.stderr));
    let page = std::fs::read(folder.path().join("lit-lightmap-0.ktx2")).unwrap();
    let number = |at: usize| u32::from_le_bytes(page[at..at + 4].try_into().unwrap());
    let bc6h = 143;
    assert_eq!((&page[1..7], number(12)), (&b"KTX 20"[..], bc6h));
    let [width, height] = [number(20), number(24)];
    let blocks = 16 * width.div_ceil(4) * height.div_ceil(4);
    assert!(
        width <= 128 && page.len() as u32 >= blocks && page.len() as u32 <= blocks + 512,
        "{width} x {height}"
    );
    let lit = gltf::Gltf::open(folder.path().join("lit.glb")).unwrap();
    let extras: Value =
        serde_json::from_str(lit.document.as_json().asset.extras.as_ref().unwrap().get()).unwrap();
    assert_eq!(extras["halflight"]["lightmap"]["files"], json!(["lit-lightmap-0.ktx2"]));
}

#[test]
fn a_mesh_of_many_nodes_is_stored_once() {
    let folder = tempfile::tempdir().unwrap();
    // The number of accessors, and the rectangles of the boxes on the page.
    let solved = |copies: usize| -> (usize, Vec<String>) {
        let [low, high] = [0.05, 0.15].map(DVec3::splat);
        let (mut document, binary) = SceneBuilder::new()
            .part("walls", &shapes::unit_room(), Material::grey(0.5).emitting(1.0))
            .part("box", &shapes::box_facing_out(low, high), Material::grey(0.5))
            .document();
        for copy in 1..copies {
            let place = json!([0.2 * (copy % 4) as f64, 0.0, 0.2 * (copy / 4) as f64]);
            document["nodes"].as_array_mut().unwrap().push(json!({ "mesh": 1, "translation": place }));
            document["scenes"][0]["nodes"].as_array_mut().unwrap().push(json!(copy + 1));
        }
        std::fs::write(folder.path().join("scene.glb"), pack(&document, &binary)).unwrap();
        let answer = solve(folder.path(), &["-o", "lit.glb", "--lightmap", "--texel-size", "0.05"]);
        assert!(answer.status.success(), "{}", String::from_utf8_lossy(&answer.stderr));
        let lit = Gltf::open(folder.path().join("lit.glb")).unwrap();
        let boxes = lit.nodes().filter(|node| node.index() > 0).map(|node| node.mesh().unwrap());
        let primitives: Vec<_> = boxes.flat_map(|mesh| mesh.primitives().collect::<Vec<_>>()).collect();
        let of = |semantic: &Semantic| -> BTreeSet<usize> {
            primitives.iter().map(|own| own.get(semantic).unwrap().index()).collect()
        };
        assert_eq!((primitives.len(), of(&Semantic::Positions).len()), (copies, 1));
        assert_eq!(of(&Semantic::TexCoords(1)).len(), 1);
        let rectangle = |primitive: &gltf::Primitive| {
            let link = primitive.material().extension_value("MOZ_lightmap").unwrap().clone();
            link["extensions"]["KHR_texture_transform"].to_string()
        };
        (lit.accessors().count(), primitives.iter().map(rectangle).collect())
    };
    let (two, many) = (solved(2), solved(9));
    assert_eq!(two.0, many.0, "accessors");
    let distinct: BTreeSet<&String> = many.1.iter().collect();
    assert_eq!(distinct.len(), 9, "{:?}", many.1);
}

#[test]
fn what_cannot_be_a_lightmap_is_refused_before_the_bake() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("scene.glb"), room()).unwrap();
    for (arguments, words) in [
        (&["-o", "lit.glb", "--lightmap", "--texel-size", "0.00001"][..], "give a --texel-size of"),
        (&["-o", "lit.ply", "--lightmap"][..], "write .glb or .gltf"),
        (&["-o", "lit.glb", "--texel-size", "0.1"][..], "give lightmap, too"),
    ] {
        let answer = solve(folder.path(), arguments);
        let said = String::from_utf8(answer.stderr).unwrap();
        assert!(!answer.status.success() && said.contains(words), "{said}");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "files were left behind");
    }
}
