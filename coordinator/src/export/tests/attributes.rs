//! The input's vertex attributes in the output.

use glam::DVec3;
use gltf::Semantic;
use serde_json::json;

use super::*;
use crate::export::fixture::{Builder, light};

#[test]
fn attributes_are_interpolated_and_vertices_split_where_they_jump() {
    let mut builder = Builder::default();
    // Two triangles of a square that share no vertex: their texture coordinates jump across the diagonal.
    let positions: [[f32; 3]; 6] =
        [[0., 0., 0.], [1., 0., 0.], [1., 1., 0.], [0., 0., 0.], [1., 1., 0.], [0., 1., 0.]];
    let texture =
        positions.iter().enumerate().map(|(i, p)| [p[0] + (i / 3) as f32, p[1]]).collect::<Vec<_>>();
    let attributes = json!({
        "POSITION": builder.floats(&positions),
        "TEXCOORD_0": builder.floats(&texture),
        "TANGENT": builder.floats(&[[1., 0., 0., -1.], [0., 1., 0., -1.], [1., 0., 0., -1.]].repeat(2)),
        "COLOR_0": builder.floats(&[[0.5f32; 3]; 6]),
        "COLOR_1": builder.accessor(&[255; 24],
            json!({"componentType": 5121, "normalized": true, "count": 6, "type": "VEC4"})),
        "_WEAR": builder.floats(&positions.map(|p| [p[1] * 8.0])),
        "JOINTS_0": builder.accessor(&[0; 24], json!({"componentType": 5121, "count": 6, "type": "VEC4"})),
        "WEIGHTS_0": builder.floats(&[[1.0f32, 0., 0., 0.]; 6]),
    });
    let indices = builder.indices(&[0, 1, 2, 3, 4, 5]);
    let scene = builder.import(json!({
        "meshes": [{"primitives": [{"attributes": attributes, "indices": indices}]}],
        "nodes": [{"mesh": 0, "skin": 0}],
        "skins": [{"joints": [0]}],
        "scenes": [{"nodes": [0]}],
    }));
    assert_eq!(scene.surfaces[0].facets.len(), 1, "one facet of two source triangles");
    let lit = light(&scene, 1, |_| DVec3::ONE);
    assert_eq!(lit.vertices.len(), 9);
    let (exported, gltf) = round_trip(&scene, &lit);

    let primitive = first_primitive(&gltf, 0);
    assert_eq!(exported.vertices, 12, "three vertices lie on the diagonal");
    let rows = |semantic| attribute(&gltf, &primitive, &semantic);
    let positions = rows(Semantic::Positions);
    for (index, position) in positions.iter().enumerate() {
        let [u, v] = rows(Semantic::TexCoords(0))[index][..] else { panic!("two components") };
        let (x, y) = (position[0], position[1]);
        let jump = u - x;
        assert!((v - y).abs() < 1e-6);
        assert!(jump.abs() < 1e-6 && y <= x + 1e-6 || (jump - 1.0).abs() < 1e-6 && y >= x - 1e-6);
        let tangent = &rows(Semantic::Tangents)[index];
        assert!((point(tangent).length() - 1.0).abs() < 1e-6);
        assert_eq!(tangent[3], -1.0);
        assert_eq!(rows(Semantic::Colors(1))[index], [1.0; 4]);
        assert_eq!(rows(Semantic::Colors(0))[index], [0.5; 3], "irradiance 1 x exposure 0.5");
        assert!((rows(Semantic::Extras("WEAR".into()))[index][0] - 8.0 * y).abs() < 1e-5);
    }
    for gone in [Semantic::Joints(0), Semantic::Weights(0)] {
        assert!(primitive.get(&gone).is_none());
    }
    assert!(gltf.nodes().next().unwrap().skin().is_none());
}

#[test]
fn refined_triangles_across_source_triangles_follow_each_of_them() {
    let mut builder = Builder::default();
    let mut square = builder.square();
    // |x - y|, linear in each of the two source triangles.
    square["attributes"]["_WEAR"] = builder.floats(&[[0.0], [1.0], [0.0], [1.0]]).into();
    let mut scene = builder.import(json!({
        "meshes": [{"primitives": [square]}],
        "nodes": [{"mesh": 0}],
        "scenes": [{"nodes": [0]}],
    }));
    // Makes the fan's diagonal cross that of the source triangles.
    scene.surfaces[0].facets[0].corners.rotate_left(1);
    let lit = light(&scene, 2, |_| DVec3::ONE);
    let (exported, gltf) = round_trip(&scene, &lit);

    assert_eq!(exported.vertices, lit.vertices.len());
    let primitive = first_primitive(&gltf, 0);
    let positions = attribute(&gltf, &primitive, &Semantic::Positions);
    for (position, wear) in
        positions.iter().zip(attribute(&gltf, &primitive, &Semantic::Extras("WEAR".into())))
    {
        assert!((wear[0] - (position[0] - position[1]).abs()).abs() < 1e-6);
    }
}
