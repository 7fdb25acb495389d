//! Normals of facets and corners.

use glam::{DVec3, Vec3};
use serde_json::json;

use crate::facet::Facet;
use crate::import::test_document::{SQUARE, SQUARE_INDICES, TestDocument};

/// The square with this normal at every vertex.
fn square_with_normals(normals: [[f32; 3]; 4]) -> TestDocument {
    let mut document = TestDocument::square();
    let normals = document.vectors(&normals);
    document.root["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = normals.into();
    document
}

/// A normal tilted from +z towards +x.
fn tilted(degrees: f32) -> [f32; 3] {
    [degrees.to_radians().sin(), 0.0, degrees.to_radians().cos()]
}

fn normals(facet: &Facet) -> Vec<DVec3> {
    facet.corners.iter().map(|corner| corner.normal).collect()
}

#[test]
fn normals_within_a_degree_are_the_facets() {
    let scene = square_with_normals([tilted(0.9); 4]).scene();
    let [facet] = &scene.surfaces[0].facets[..] else { panic!("not joined") };
    assert_eq!(normals(facet), [DVec3::Z; 4]);
}

#[test]
fn smooth_normals_are_kept_and_keep_triangles_apart() {
    for degrees in [1.1, 30.9] {
        let scene = square_with_normals([tilted(degrees); 4]).scene();
        assert_eq!(scene.surfaces[0].facets.len(), 2);
        assert!(!scene.surfaces[0].keeps_normals);
        for facet in &scene.surfaces[0].facets {
            assert_eq!(facet.normal, DVec3::Z);
            for normal in normals(facet) {
                assert!(normal.distance(Vec3::from_array(tilted(degrees)).as_dvec3().normalize()) < 1e-12);
            }
        }
    }
}

#[test]
fn smooth_normals_off_the_shared_edge_do_not_keep_triangles_apart() {
    let flat = tilted(0.0);
    let scene = square_with_normals([flat, tilted(20.0), flat, flat]).scene();
    let [facet] = &scene.surfaces[0].facets[..] else { panic!("not joined") };
    let smooth = facet.corners.iter().filter(|corner| corner.normal != DVec3::Z).count();
    assert_eq!((facet.corners.len(), smooth), (4, 1));
}

#[test]
fn meaningless_normals_fall_back_to_the_facets() {
    for normal in
        [[0.0; 3], [f32::NAN; 3], [f32::INFINITY, 0.0, 0.0], tilted(90.0), tilted(180.0), tilted(31.1)]
    {
        let scene = square_with_normals([normal; 4]).scene();
        let [facet] = &scene.surfaces[0].facets[..] else { panic!("{normal:?} not joined") };
        assert_eq!(normals(facet), [DVec3::Z; 4], "{normal:?}");
        assert_eq!(scene.surfaces[0].keeps_normals, normal == tilted(31.1), "{normal:?}");
    }
}

#[test]
fn smooth_normals_transform_like_normals() {
    // Perpendicular to the surface 2 z = x, whose normal is (-1, 0, 2): stretched along x by 2 it becomes (-1, 0, 4).
    for (scale, expected) in [
        ([2.0, 1.0, 1.0], DVec3::new(-1.0, 0.0, 4.0)),
        ([-2.0, 1.0, 1.0], DVec3::new(1.0, 0.0, 4.0)),
        ([1.0, -5.0, 1.0], DVec3::new(-1.0, 0.0, 2.0)),
    ] {
        let mut document = square_with_normals([[-1.0, 0.0, 2.0]; 4]);
        document.root["nodes"][0]["scale"] = json!(scale);
        document.root["materials"][0]["doubleSided"] = true.into();
        let scene = document.scene();
        for (surface, side) in scene.surfaces.iter().zip([1.0, -1.0]) {
            for normal in normals(&surface.facets[0]) {
                assert!(normal.distance(side * expected.normalize()) < 1e-12, "{scale:?}: {normal}");
            }
        }
    }
}

#[test]
fn cube_with_shared_vertices_has_six_flat_facets_whatever_its_normals() {
    let corner = |i: u32| [(i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2 & 1) as f32];
    let positions: Vec<[f32; 3]> = (0..8).map(corner).collect();
    let outwards: Vec<[f32; 3]> = positions.iter().map(|position| position.map(|axis| axis - 0.5)).collect();
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let indices: Vec<u32> = faces.iter().flat_map(|face| SQUARE_INDICES.map(|i| face[i as usize])).collect();

    for is_smooth in [false, true] {
        let mut document = TestDocument::with_triangles(&positions, &indices);
        if is_smooth {
            let normals = document.vectors(&outwards);
            document.root["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = normals.into();
        }
        let scene = document.scene();
        assert_eq!((scene.surfaces[0].facets.len(), scene.plane_count), (6, 6));
        for facet in &scene.surfaces[0].facets {
            assert_eq!(normals(facet), [facet.normal; 4]);
            // Outwards, from the centre of the frame.
            assert!(facet.corners.iter().all(|corner| corner.position.dot(facet.normal) > 0.0));
        }
    }
}

#[test]
fn sides_of_a_prism_of_six_sides_have_smooth_corners() {
    let ring = |height: f32| {
        (0..6).map(move |corner| {
            let (y, x) = (std::f32::consts::FRAC_PI_3 * corner as f32).sin_cos();
            [x, y, height]
        })
    };
    let positions: Vec<[f32; 3]> = ring(0.0).chain(ring(2.0)).collect();
    let outwards: Vec<[f32; 3]> = positions.iter().map(|[x, y, _]| [*x, *y, 0.0]).collect();
    let side = |corner: u32| [corner, (corner + 1) % 6, (corner + 1) % 6 + 6, corner + 6];
    let indices: Vec<u32> =
        (0..6).flat_map(|corner| SQUARE_INDICES.map(|i| side(corner)[i as usize])).collect();
    let mut document = TestDocument::with_triangles(&positions, &indices);
    let normals = document.vectors(&outwards);
    document.root["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = normals.into();
    let scene = document.scene();
    assert_eq!((scene.surfaces[0].facets.len(), scene.plane_count), (12, 6));
    let cosine = 0.75f64.sqrt();
    for facet in &scene.surfaces[0].facets {
        assert!(facet.corners.iter().all(|corner| (corner.normal.dot(facet.normal) - cosine).abs() < 1e-6));
    }
}

#[test]
fn corner_mean_of_the_square_is_its_middle() {
    let scene = TestDocument::with_triangles(&SQUARE, &SQUARE_INDICES).scene();
    let corners = &scene.surfaces[0].facets[0].corners;
    assert_eq!(corners.iter().map(|corner| corner.position).sum::<DVec3>(), DVec3::ZERO);
}
