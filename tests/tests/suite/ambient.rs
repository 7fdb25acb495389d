//! Ambient occlusion at vertices, where it is known.

use std::fs;

use assert_cmd::Command;
use bake::lit::LitMesh;
use bake::{BakeSettings, occlusion};
use glam::DVec3;
use gltf::{Gltf, Semantic};
use scene::Scene;
use tests::baking::{baked, imported};
use tests::builder::{Material, SceneBuilder};
use tests::programs::binary;
use tests::shapes::{self, Polygon};

/// A square in a plane of constant height, lit from above.
fn floor(side: f64, height: f64) -> Polygon {
    [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
        .map(|(x, y)| DVec3::new(side * x, side * y, height))
        .to_vec()
}

fn lit(glb: &[u8]) -> (Scene, LitMesh) {
    let scene = imported(glb);
    let settings = BakeSettings { max_edge: Some(0.5), ..BakeSettings::for_error(0.3) };
    let mesh = baked(&scene, &settings).lit;
    (scene, mesh)
}

/// Mean and largest difference of the occlusion from what is expected, at vertices of the first surface.
fn differences(
    (scene, mesh): &(Scene, LitMesh),
    distance: f64,
    expected: impl Fn(DVec3) -> Option<f64>,
) -> (f64, f64) {
    let open = occlusion(scene, mesh, distance, || false).unwrap();
    let mut vertices: Vec<u32> = mesh.surfaces[0].iter().flat_map(|triangle| triangle.vertices).collect();
    vertices.sort_unstable();
    vertices.dedup();
    let difference = |vertex: &u32| {
        let place = scene.frame.to_world(mesh.vertices[*vertex as usize].position);
        Some((open[*vertex as usize] - expected(place)?).abs())
    };
    let all: Vec<f64> = vertices.iter().filter_map(difference).collect();
    assert!(all.len() > 10, "{}", all.len());
    (all.iter().sum::<f64>() / all.len() as f64, all.iter().copied().fold(0.0, f64::max))
}

#[test]
fn below_a_ceiling() {
    let ceiling = shapes::turned(&[floor(4.0, 1.0)]);
    let glb = SceneBuilder::new()
        .part("floor", &[floor(4.0, 0.0)], Material::grey(0.5))
        .part("ceiling", &ceiling, Material::grey(0.5).emitting(1.0))
        .glb();
    let all = lit(&glb);
    for distance in [0.9, 1.25, 2.0] {
        // Rays meet it before they have come so far where their cosine is above 1 / distance.
        let expected = f64::min(1.0 / (distance * distance), 1.0);
        let in_middle = |place: DVec3| (place.abs().max_element() < 2.0).then_some(expected);
        let (mean, most) = differences(&all, distance, in_middle);
        assert!(mean < 0.01 && most < 0.03, "{mean} in the mean, {most} at most, at {distance}");
    }
}

#[test]
fn before_a_wall() {
    let wall =
        [(-9.0, 0.0), (9.0, 0.0), (9.0, 9.0), (-9.0, 9.0)].map(|(y, z)| DVec3::new(4.0, y, z)).to_vec();
    let wall = shapes::turned(&[wall]);
    let glb = SceneBuilder::new()
        .part("floor", &[floor(4.0, 0.0)], Material::grey(0.5))
        .part("wall", &wall, Material::grey(0.5).emitting(1.0))
        .glb();
    let all = lit(&glb);
    // At a distance x of a wall without end: rays whose component towards it is above x / distance.
    let distance = 1.5;
    let expected = |place: DVec3| {
        let part: f64 = (4.0 - place.x) / distance;
        let blocked = if part < 1.0 {
            (part.acos() - part * (1.0 - part * part).sqrt()) / std::f64::consts::PI
        } else {
            0.0
        };
        (place.y.abs() < 3.0).then_some(1.0 - blocked)
    };
    let (mean, most) = differences(&all, distance, expected);
    assert!(mean < 0.01 && most < 0.03, "{mean} in the mean, {most} at most");
}

#[test]
fn a_file_has_it_beside_the_light() {
    let folder = tempfile::tempdir().unwrap();
    let [low, high] = [0.4, 0.6].map(DVec3::splat);
    let glb = SceneBuilder::new()
        .part("walls", &shapes::unit_room(), Material::grey(0.5).emitting(1.0))
        .part("box", &shapes::box_facing_out(low, high), Material::grey(0.5))
        .glb();
    fs::write(folder.path().join("scene.glb"), glb).unwrap();
    let solve = |more: &[&str]| {
        let mut command = Command::new(binary("coordinator"));
        command.current_dir(folder.path()).args(["solve", "scene.glb", "--error", "0.2"]).args(more);
        command.output().unwrap()
    };
    let answer = solve(&["-o", "lit.glb", "--occlusion", "0.3"]);
    assert!(answer.status.success(), "{}", String::from_utf8_lossy(&answer.stderr));
    let Gltf { document, blob } = Gltf::open(folder.path().join("lit.glb")).unwrap();
    let name = Semantic::Extras("OCCLUSION".into());
    let mut values = vec![];
    for primitive in document.meshes().flat_map(|mesh| mesh.primitives().collect::<Vec<_>>()) {
        let accessor = primitive.get(&name).unwrap();
        let data = |_: gltf::Buffer| blob.as_deref();
        values.extend(gltf::accessor::Iter::<[f32; 3]>::new(accessor, data).unwrap());
    }
    let one = |[red, green, blue]: &[f32; 3]| (0.0..=1.0).contains(red) && red == green && red == blue;
    assert!(values.iter().all(one));
    // Corners of the room see a quarter of the open, and the box nothing near.
    assert!(values.iter().any(|value| value[0] < 0.4) && values.iter().any(|value| value[0] > 0.97));
    for (arguments, words) in [
        (&["-o", "map.glb", "--lightmap", "--occlusion", "1"][..], "bake without lightmap"),
        (&["-o", "no.glb", "--occlusion", "0"][..], "must be a positive number"),
    ] {
        let answer = solve(arguments);
        let said = String::from_utf8(answer.stderr).unwrap();
        assert!(!answer.status.success() && said.contains(words), "{said}");
    }
    let answer = solve(&["-o", "lit.ply", "--occlusion", "0.3"]);
    assert!(answer.status.success());
    let ply = fs::read(folder.path().join("lit.ply")).unwrap();
    assert!(String::from_utf8_lossy(&ply[..2000]).contains("\nproperty float occlusion\nelement face"));
}
