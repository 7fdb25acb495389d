//! Pictures against values from the lit mesh, and against the same pictures by other workers.

use std::fs;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use bake::BakeSettings;
use cluster::{Cluster, Workers};
use glam::{DMat4, DVec3};
use kernel::picture::{Camera, encode_picture};
use output::export::{ExportSettings, export};
use output::render::{
    LightOfFile, LitFile, LookAt, Picture, TileSettings, choose_view, read_lit, render_tiles,
};
use scene::ReadOptions;
use serde_json::json;
use tempfile::TempDir;
use tests::baking::{baked, imported};
use tests::builder::{Material, SceneBuilder, pack};
use tests::programs::{WorkerProcess, binary};
use tests::shapes;

/// Bakes a scene of the repository, coarsely.
fn lit(name: &str) -> (TempDir, PathBuf) {
    let scene = imported(&fs::read(tests::data(&format!("scenes/{name}.glb"))).unwrap());
    let baked =
        baked(&scene, &BakeSettings { shooter_edge: 0.1, mesh_error: 0.1, ..BakeSettings::default() });
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("lit.glb");
    let settings = ExportSettings::default();
    export(&scene, &baked.lit, &settings, &path).unwrap();
    (folder, path)
}

fn take(file: &LitFile, camera: Camera, size: [u32; 2], samples: u32) -> Picture {
    let cluster = Cluster::start(&Workers::Embedded { threads: 2 }.into()).unwrap();
    let settings = TileSettings { camera, size, samples, background: DVec3::ZERO };
    render_tiles(&mut cluster.handle(0), encode_picture(&file.scene), &settings, &mut |_, _| ()).unwrap()
}

fn at(picture: &Picture, x: u32, y: u32) -> DVec3 {
    DVec3::from_array(picture.pixels[(y * picture.size[0] + x) as usize].map(f64::from))
}

/// A triangle of a lit file, read by nothing of this program.
struct Triangle {
    corners: [DVec3; 3],
    /// Radiance at the corners.
    radiance: [DVec3; 3],
}

fn triangles(path: &Path) -> Vec<Triangle> {
    let gltf = gltf::Gltf::open(path).unwrap();
    let (document, buffers) = (gltf.document, [gltf.blob.unwrap()]);
    let mut triangles = vec![];
    for node in document.nodes() {
        let Some(mesh) = node.mesh() else { continue };
        assert!(document.nodes().all(|node| node.children().count() == 0), "nodes stand by themselves");
        let world = DMat4::from_cols_array_2d(&node.transform().matrix().map(|column| column.map(f64::from)));
        for primitive in mesh.primitives() {
            let reader = primitive.reader(|buffer| Some(buffers[buffer.index()].as_slice()));
            let place =
                |position: [f32; 3]| world.transform_point3(DVec3::from_array(position.map(f64::from)));
            let positions: Vec<DVec3> = reader.read_positions().unwrap().map(place).collect();
            let accessor = primitive.get(&gltf::Semantic::Extras("IRRADIANCE".into())).unwrap();
            let data = |buffer: gltf::Buffer| buffers.get(buffer.index()).map(Vec::as_slice);
            let irradiance: Vec<[f32; 3]> = gltf::accessor::Iter::new(accessor, data).unwrap().collect();
            let material = primitive.material();
            let surface = material.pbr_metallic_roughness();
            let [red, green, blue, _] = surface.base_color_factor().map(f64::from);
            let diffuse = 1.0 - f64::from(surface.metallic_factor());
            let emission = material.emissive_factor().map(f64::from);
            let emission =
                DVec3::from_array(emission) * f64::from(material.emissive_strength().unwrap_or(1.0));
            let emission = if material.unlit() { DVec3::ZERO } else { emission };
            let radiance = |vertex: usize| {
                let irradiance = DVec3::from_array(irradiance[vertex].map(f64::from));
                DVec3::new(red, green, blue) * diffuse * irradiance / std::f64::consts::PI + emission
            };
            let indices: Vec<usize> = reader.read_indices().unwrap().into_u32().map(|i| i as usize).collect();
            triangles.extend(indices.chunks_exact(3).map(|corner| {
                let corner = [corner[0], corner[1], corner[2]];
                Triangle { corners: corner.map(|c| positions[c]), radiance: corner.map(radiance) }
            }));
        }
    }
    triangles
}

/// What a ray sees by trying every triangle; `None` where it passes an edge so closely that rounding decides.
fn seen(triangles: &[Triangle], eye: DVec3, direction: DVec3) -> Option<DVec3> {
    let mut nearest = f64::INFINITY;
    let mut radiance = DVec3::ZERO;
    for Triangle { corners: [a, b, c], radiance: at } in triangles {
        let normal = (*b - *a).cross(*c - *a);
        let facing = normal.dot(direction);
        let distance = normal.dot(*a - eye) / facing;
        if facing >= 0.0 || !(0.0..nearest).contains(&distance) {
            continue;
        }
        let point = eye + direction * distance;
        let weight = |from: &DVec3, to: &DVec3| {
            normal.dot((*to - *from).cross(point - *from)) / normal.length_squared()
        };
        let weights = [weight(b, c), weight(c, a), weight(a, b)];
        if weights.iter().any(|weight| weight.abs() < 1e-5) && weights.iter().all(|weight| *weight > -1e-5) {
            return None;
        }
        if weights.iter().all(|weight| *weight > 0.0) {
            nearest = distance;
            radiance = weights.iter().zip(at).map(|(weight, value)| *value * *weight).sum();
        }
    }
    Some(radiance)
}

#[test]
fn pixels_of_cornell_are_what_its_mesh_says() {
    let (_folder, path) = lit("cornell");
    let file = read_lit(&path, &ReadOptions::default()).unwrap();
    assert_eq!(file.light, LightOfFile::Irradiance);
    assert!(file.exposure.is_some_and(|exposure| exposure > 0.0));
    let triangles = triangles(&path);
    let eye = DVec3::new(2.75, 2.75, 13.4);
    let target = DVec3::new(2.75, 2.75, 2.75);
    let height_angle = 38.3_f64.to_radians();
    let look_at = LookAt { eye, target, up: DVec3::Y, height_angle };
    let size = 48_u32;
    let picture = take(&file, look_at.camera(&file.frame, 1.0).unwrap(), [size; 2], 1);
    let half = (height_angle / 2.0).tan();
    let (mut compared, mut bright) = (0, 0);
    for y in 0..size {
        for x in 0..size {
            let place = |pixel: u32| (2.0 * (f64::from(pixel) + 0.5) / f64::from(size) - 1.0) * half;
            let direction = DVec3::new(place(x), -place(y), -1.0).normalize();
            let Some(expected) = seen(&triangles, eye, direction) else { continue };
            let found = at(&picture, x, y);
            let error = (found - expected).abs().max_element();
            assert!(error <= 1e-5 * (1.0 + expected.max_element()), "{x} {y}: {found} {expected}");
            compared += 1;
            bright += u32::from(expected.max_element() > 0.0);
        }
    }
    assert!(compared > size * size * 9 / 10 && bright > compared / 2, "{compared} {bright}");
}

/// Part of a picture that is not black.
fn lit_part(picture: &Picture) -> f64 {
    let lit = picture.pixels.iter().filter(|pixel| pixel.iter().any(|value| *value > 0.0)).count();
    lit as f64 / picture.pixels.len() as f64
}

#[test]
fn no_picture_of_a_scene_of_the_repository_is_black() {
    let mut scenes = 0;
    for entry in fs::read_dir(tests::data("scenes")).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_none_or(|extension| extension != "glb") {
            continue;
        }
        let file = read_lit(&path, &ReadOptions::default()).unwrap();
        let picture = take(&file, choose_view(&file.scene, 1.5), [96, 64], 1);
        assert!(lit_part(&picture) > 0.3, "{}: {}", path.display(), lit_part(&picture));
        scenes += 1;
    }
    assert!(scenes >= 3);
    for name in ["cornell", "doorway", "table"] {
        let (_folder, path) = lit(name);
        let file = read_lit(&path, &ReadOptions::default()).unwrap();
        let picture = take(&file, choose_view(&file.scene, 1.5), [96, 64], 1);
        assert!(lit_part(&picture) > 0.3, "{name}: {}", lit_part(&picture));
        assert!(file.warnings.is_empty(), "{name}: {:?}", file.warnings);
    }
}

/// A lamp in the corner of a room, three copies of a box, and an upright sheet of which both sides are lit.
fn room_with_copies() -> Vec<u8> {
    let [low, high] = [DVec3::new(0.1, 0.0, 0.1), DVec3::new(0.25, 0.2, 0.25)];
    let lamp = shapes::box_facing_out(DVec3::new(0.1, 0.7, 0.1), DVec3::new(0.3, 0.8, 0.3));
    let sheet = [[0.6, 0.0], [0.8, 0.0], [0.8, 0.4], [0.6, 0.4]].map(|[x, y]| DVec3::new(x, y, 0.3));
    let sheet = sheet.to_vec();
    let (mut document, binary) = SceneBuilder::new()
        .part("walls", &shapes::unit_room(), Material::grey(0.6))
        .part("box", &shapes::box_facing_out(low, high), Material::grey(0.5).double_sided())
        .part("sheet", &[sheet], Material::grey(0.5).double_sided())
        .part("lamp", &lamp, Material::grey(0.2).emitting(10.0))
        .document();
    for (copy, place) in [[0.3, 0.0, 0.2], [0.5, 0.0, 0.6]].into_iter().enumerate() {
        document["nodes"].as_array_mut().unwrap().push(json!({ "mesh": 1, "translation": place }));
        document["scenes"][0]["nodes"].as_array_mut().unwrap().push(json!(copy + 4));
    }
    pack(&document, &binary)
}

/// From lightmaps of both encodings, and from vertices.
#[test]
fn lightmaps_are_shown_as_the_light_of_vertices_is() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("scene.glb"), room_with_copies()).unwrap();
    let picture = |arguments: &[&str]| {
        let mut command = Command::new(binary("coordinator"));
        command.current_dir(&folder).args(["solve", "scene.glb", "-o", "lit.glb", "--error", "0.03"]);
        assert!(command.args(arguments).output().unwrap().status.success(), "{arguments:?}");
        let file = read_lit(&folder.path().join("lit.glb"), &ReadOptions::default()).unwrap();
        assert!(file.warnings.is_empty(), "{:?}", file.warnings);
        let [eye, target] = [DVec3::new(0.95, 0.6, 0.95), DVec3::new(0.2, 0.3, 0.3)];
        let look_at = LookAt { eye, target, up: DVec3::Y, height_angle: 1.4 };
        (file.light, take(&file, look_at.camera(&file.frame, 1.5).unwrap(), [96, 64], 4))
    };
    let (light, expected) = picture(&[]);
    assert_eq!(light, LightOfFile::Irradiance);
    let length = |values: &[DVec3]| values.iter().map(|value| value.length_squared()).sum::<f64>().sqrt();
    let radiance = |picture: &Picture| -> Vec<DVec3> {
        let clipped = |value: f32| f64::from(value.min(1.0));
        picture.pixels.iter().map(|pixel| DVec3::from_array(pixel.map(clipped))).collect()
    };
    for format in ["png", "rgbm"] {
        let (light, found) = picture(&["--lightmap", "--texel-size", "0.02", "--lightmap-format", format]);
        assert_eq!(light, LightOfFile::Lightmaps);
        let [found, expected] = [&found, &expected].map(radiance);
        let off: Vec<DVec3> = found.iter().zip(&expected).map(|(a, b)| *a - *b).collect();
        let off = length(&off) / length(&expected);
        assert!(off < 0.04, "{format}: {off}");
    }
}

/// Long enough that a worker can be killed in its middle.
const LONG: [&str; 8] = ["--width", "320", "--height", "240", "--samples", "128", "--tone-map", "linear"];

/// A line by which a picture is under way.
const UNDER_WAY: &str = " tiles";

/// Has a small picture made by these workers: its bytes.
fn picture_by(path: &Path, workers: &[&str], name: &str) -> Vec<u8> {
    let small = ["--width", "120", "--height", "90", "--samples", "64", "--tone-map", "linear"];
    render(path, workers, name, small, None::<fn()>).0
}

/// Has a picture made by these workers, and calls `disturb` when it is under way. Its bytes, and all that was said.
fn disturbed_picture_by(
    path: &Path,
    workers: &[&str],
    name: &str,
    disturb: impl FnOnce(),
) -> (Vec<u8>, String) {
    render(path, workers, name, LONG, Some(disturb))
}

fn render(
    path: &Path,
    workers: &[&str],
    name: &str,
    options: [&str; 8],
    mut disturb: Option<impl FnOnce()>,
) -> (Vec<u8>, String) {
    let output = path.with_file_name(name);
    let mut command = Command::new(binary("coordinator"));
    command.arg("render").arg(path).arg("-o").arg(&output).args(options);
    if workers.is_empty() {
        command.args(["--threads", "2"]);
    } else {
        command.args(["--workers", &workers.join(",")]);
    }
    let mut child =
        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let mut said = String::new();
    for line in BufReader::new(child.stderr.take().unwrap()).lines() {
        let line = line.unwrap();
        if line.contains(UNDER_WAY)
            && let Some(disturb) = disturb.take()
        {
            disturb();
        }
        said += &line;
        said.push('\n');
    }
    assert!(child.wait().unwrap().success(), "{said}");
    assert!(disturb.is_none(), "{said}");
    (fs::read(output).unwrap(), said)
}

#[test]
fn whoever_computes_the_tiles_the_picture_has_the_same_bytes() {
    let (_folder, path) = lit("table");
    for format in ["exr", "png"] {
        let name = |of: &str| format!("{of}.{format}");
        let expected = picture_by(&path, &[], &name("embedded"));
        let one = WorkerProcess::start(2);
        let by_one = picture_by(&path, &[&one.address], &name("one"));
        assert!(by_one == expected, "by one worker the {format} differs");
        let four = [1, 1, 1, 1].map(WorkerProcess::start);
        let addresses = four.each_ref().map(|worker| worker.address.as_str());
        let by_four = picture_by(&path, &addresses, &name("four"));
        assert!(by_four == expected, "by four workers the {format} differs");
    }
}

#[test]
fn a_killed_worker_changes_no_pixel() {
    let (_folder, path) = lit("table");
    let (expected, _) = disturbed_picture_by(&path, &[], "embedded.exr", || ());
    let (mut dies, lives) = (WorkerProcess::start(1), WorkerProcess::start(1));
    let addresses = [dies.address.clone(), lives.address.clone()];
    let (disturbed, said) =
        disturbed_picture_by(&path, &addresses.each_ref().map(String::as_str), "killed.exr", || dies.kill());
    assert!(said.contains("lost a worker"), "{said}");
    assert!(disturbed == expected, "with a worker killed the picture differs");
}
