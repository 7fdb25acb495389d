//! PLY, read back.

use std::collections::HashMap;

use glam::DVec3;

use super::*;
use bake::lit::LitLayer;
use fixtures::{light, open, square};

/// Properties by name.
type Vertex = HashMap<String, f32>;

/// Corners and surface.
type Face = ([usize; 3], usize);

fn read(bytes: &[u8]) -> (Vec<Vertex>, Vec<Face>) {
    let end = bytes.windows(11).position(|window| window == b"end_header\n").unwrap() + 11;
    let header = std::str::from_utf8(&bytes[..end]).unwrap();
    assert!(header.starts_with("ply\nformat binary_little_endian 1.0\n"));
    let count = |element: &str| -> usize {
        let line = header.lines().find_map(|line| line.strip_prefix(&format!("element {element} "))).unwrap();
        line.parse().unwrap()
    };
    let names: Vec<&str> = header.lines().filter_map(|line| line.strip_prefix("property float ")).collect();
    let faces_at = header.find("element face").unwrap();
    assert_eq!(
        &header[faces_at..].lines().skip(1).collect::<Vec<_>>(),
        &["property list uchar int vertex_indices", "property int surface", "end_header",]
    );
    let (vertices, faces) = bytes[end..].split_at(count("vertex") * names.len() * 4);
    let floats: Vec<f32> = vertices.as_chunks().0.iter().map(|b| f32::from_le_bytes(*b)).collect();
    let vertices = floats
        .chunks_exact(names.len())
        .map(|row| names.iter().map(|name| (*name).to_owned()).zip(row.iter().copied()).collect())
        .collect();
    assert_eq!(faces.len(), count("face") * 17);
    let faces = faces.chunks_exact(17).map(|face| {
        assert_eq!(face[0], 3);
        let [a, b, c, surface] =
            [1, 5, 9, 13].map(|at| u32::from_le_bytes(face[at..at + 4].try_into().unwrap()) as usize);
        ([a, b, c], surface)
    });
    (vertices, faces.collect())
}

fn of(vertex: &Vertex, names: [&str; 3]) -> DVec3 {
    names.map(|name| f64::from(vertex[name])).into()
}

fn light_of(vertex: &Vertex, quantity: &str) -> DVec3 {
    let names = ["red", "green", "blue"].map(|channel| format!("{quantity}_{channel}"));
    of(vertex, [&names[0], &names[1], &names[2]])
}

#[test]
fn a_ply_has_the_lit_mesh_in_the_world_with_irradiance_and_radiosity() {
    let scene = open("cornell.glb");
    let lit = light(&scene, 2, |world| world.abs() + DVec3::ONE);
    let directory = TempDir::new().unwrap();
    let path = directory.path().join("lit.ply");
    check_writable(&path).unwrap();
    for (domain, vertices_of_each) in [(Domain::Vertex, None), (Domain::Corner, Some(3))] {
        let settings = ExportSettings { domain, ..settings() };
        let exported = export(&scene, &lit, &settings, &path).unwrap();
        assert_eq!(fs::read_dir(&directory).unwrap().count(), 1);
        let (vertices, faces) = read(&fs::read(&path).unwrap());
        assert_eq!((vertices.len(), faces.len()), (exported.vertices, exported.triangles));
        assert_eq!(faces.len(), lit.surfaces.iter().map(Vec::len).sum::<usize>());
        if let Some(each) = vertices_of_each {
            assert_eq!(vertices.len(), faces.len() * each);
        }
        for (corners, surface) in &faces {
            let surface = &scene.surfaces[*surface];
            let [a, b, c] = corners.map(|corner| of(&vertices[corner], ["x", "y", "z"]));
            let normal = of(&vertices[corners[0]], ["nx", "ny", "nz"]);
            assert!(((b - a).cross(c - a).normalize() - normal).length() < 1e-3, "counter-clockwise");
            for corner in corners {
                let vertex = &vertices[*corner];
                let irradiance = of(vertex, ["x", "y", "z"]).abs() + DVec3::ONE;
                assert!((light_of(vertex, "irradiance") - irradiance).length() < 1e-4);
                let radiosity = surface.reflectance * irradiance + surface.exitance;
                assert!((light_of(vertex, "radiosity") - radiosity).length() < 1e-4);
            }
        }
    }
}

#[test]
fn a_ply_has_the_light_of_groups() {
    let (scene, mut lit) = square();
    let irradiance = lit.vertices.iter().map(|vertex| vertex.position).collect();
    lit.layers = vec![LitLayer { name: "Key 1".into(), lights: vec![], irradiance }];
    let directory = TempDir::new().unwrap();
    let path = directory.path().join("lit.ply");
    export(&scene, &lit, &settings(), &path).unwrap();
    let (vertices, _) = read(&fs::read(&path).unwrap());
    for vertex in vertices {
        let expected = scene.frame.to_frame(of(&vertex, ["x", "y", "z"]));
        assert!((light_of(&vertex, "irradiance_key_1") - expected).length() < 1e-5);
    }
    lit.layers[0].irradiance.clear();
    assert!(export(&scene, &lit, &settings(), &path).is_err());
}
