use bake::BakeSettings;
use glam::{DMat4, DQuat, DVec3};
use serde_json::{Value, json};
use tests::baking::{baked, imported, mean_irradiance};
use tests::builder::{Material, SceneBuilder, pack};
use tests::shapes::{Polygon, box_facing_in, box_facing_out, prism_facing_in, turned};

/// Rooms that do not see each other stand so far apart.
const APART: f64 = 4.0;

/// What a mean may differ by between two meshes of one surface: less than half of the mesh error of 2 %.
const MESH_ERROR: f64 = 0.01;

fn settings() -> BakeSettings {
    BakeSettings { mesh_error: 0.02, validation_samples: 0, ..BakeSettings::default() }
}

/// A lamp, and a block without any symmetry.
fn parts() -> [(&'static str, Vec<Polygon>, Material); 3] {
    let floor =
        [[-0.6, -0.4], [0.1, -0.7], [0.4, 0.2], [-0.3, 0.5]].map(|[x, y]| DVec3::new(x, y, -0.9)).to_vec();
    let block = turned(&prism_facing_in(&floor, 0.7));
    let lamp = box_facing_out(DVec3::new(0.3, -0.2, 0.6), DVec3::new(0.6, 0.4, 0.8));
    [
        ("room", box_facing_in(DVec3::splat(-1.0), DVec3::ONE), Material::grey(0.6)),
        ("block", block, Material::grey(0.5)),
        ("lamp", lamp, Material::grey(0.2).emitting(10.0)),
    ]
}

/// One-sided surfaces stay lit on their outside however their node is mirrored: eight times the same room under all signs of scale,
/// the last of them twice mirrored, in two nodes.
#[test]
fn mirrored_nodes_are_lit_as_their_original() {
    let builder = parts().into_iter().fold(SceneBuilder::new(), |builder, (name, polygons, material)| {
        builder.part(name, &polygons, material)
    });
    let (mut document, binary) = builder.document();
    let mut nodes: Vec<Value> = vec![];
    let mut roots = vec![];
    for copy in 0..8_u32 {
        let sign = |axis: u32| if copy >> axis & 1 == 1 { -1.0 } else { 1.0 };
        let children: Vec<usize> = (0..3)
            .map(|mesh| {
                nodes.push(json!({ "name": format!("copy {copy}, mesh {mesh}"), "mesh": mesh }));
                nodes.len() - 1
            })
            .collect();
        let mut scale = [sign(0), sign(1), sign(2)];
        let mut inner = children;
        if copy == 7 {
            // One axis in a node of its own.
            scale[2] = 1.0;
            nodes.push(json!({ "scale": [1.0, 1.0, -1.0], "children": inner }));
            inner = vec![nodes.len() - 1];
        }
        let place = [APART * f64::from(copy), 0.0, 0.0];
        nodes.push(json!({ "translation": place, "scale": scale, "children": inner }));
        roots.push(nodes.len() - 1);
    }
    (document["nodes"], document["scenes"]) = (json!(nodes), json!([{ "nodes": roots }]));
    let scene = imported(&pack(&document, &binary));
    let baked = baked(&scene, &settings());
    assert!(baked.report.warnings.is_empty(), "{:?}", baked.report.warnings);
    assert_eq!(scene.surfaces.len(), 24);
    for (index, surface) in scene.surfaces.iter().enumerate() {
        let [original, found] = [index % 3, index].map(|index| mean_irradiance(&baked.lit, index).x);
        assert!(original > 0.1, "{original} on {}", surface.name);
        let off = found / original - 1.0;
        assert!(off.abs() <= MESH_ERROR, "{}: {found} for {original}", surface.name);
    }
}

/// Six plates, each turned about an axis in a node under one that is moved, turned and scaled: lit as the same plates written in
/// the world's coordinates.
#[test]
fn turned_nodes_face_where_their_corners_say() {
    let plate = vec![
        DVec3::new(-0.2, -0.1, 0.0),
        DVec3::new(0.3, -0.1, 0.0),
        DVec3::new(0.3, 0.2, 0.0),
        DVec3::new(-0.2, 0.2, 0.0),
    ];
    let lamp = |builder: SceneBuilder| {
        builder.point_light(DVec3::new(0.3, 2.5, 0.4), 40.0).point_light(-DVec3::ONE, 9.0)
    };
    let axes = [DVec3::X, -DVec3::X, DVec3::Y, -DVec3::Y, DVec3::Z, -DVec3::Z];
    let arms = axes.map(|axis| {
        let spread = DQuat::from_axis_angle(axis, 1.1);
        let parent =
            (DVec3::new(0.5, 1.5, 0.75), DQuat::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), 0.7), axis * 1.5);
        let child = (DVec3::ONE, spread, DVec3::new(0.4, 0.1, 0.2));
        [parent, child]
    });
    let material = Material::grey(0.5).double_sided();

    let nested = arms.iter().fold(SceneBuilder::new(), |builder, _| {
        builder.part("plate", std::slice::from_ref(&plate), material)
    });
    let (mut document, binary) = lamp(nested).document();
    let first_parent = document["nodes"].as_array().map_or(0, Vec::len);
    let fields = |(scale, turn, place): (DVec3, DQuat, DVec3)| json!({ "scale": scale.to_array(), "rotation": turn.to_array(), "translation": place.to_array() });
    for (index, [parent, child]) in arms.into_iter().enumerate() {
        let mut inner = fields(child);
        inner["mesh"] = json!(index);
        document["nodes"][index] = inner;
        let mut outer = fields(parent);
        outer["children"] = json!([index]);
        document["nodes"].as_array_mut().unwrap().push(outer);
        document["scenes"][0]["nodes"][index] = json!(first_parent + index);
    }
    let nested = imported(&pack(&document, &binary));

    let written = arms.iter().fold(SceneBuilder::new(), |builder, arm| {
        let [parent, child] =
            arm.map(|(scale, turn, place)| DMat4::from_scale_rotation_translation(scale, turn, place));
        let corners = plate.iter().map(|corner| (parent * child).transform_point3(*corner)).collect();
        builder.part("plate", &[corners], material)
    });
    let written = imported(&lamp(written).glb());

    let [found, expected] = [&nested, &written].map(|scene| baked(scene, &settings()).lit);
    assert_eq!((nested.surfaces.len(), written.surfaces.len()), (12, 12));
    for surface in 0..12 {
        let [a, b] = [&found, &expected].map(|lit| mean_irradiance(lit, surface).x);
        assert!((a - b).abs() <= MESH_ERROR * b, "surface {surface}: {a} for {b}");
    }
}
