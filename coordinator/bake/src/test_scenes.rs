//! Scenes of a few facets, for tests.

use crate::mesh::{Mesh, Patch, PatchId, Share, Vertex, VertexId};
use glam::DVec3;
use kernel::geometry::{PlaneId, area_vector};
use scene::{
    Corner, Facet, Frame, ImportReport, Light, LightEntry, LightKind, Scene, Side, SourceDocument,
    SourceTriangle, Surface,
};

/// Width of what is tested.
pub const SIZE: f64 = 1000.0;

const LONGEST_EDGE: f64 = 300.0;

/// A facet with these corners, counter-clockwise seen from its lit side.
pub fn facet(plane: u32, corners: &[[f64; 3]]) -> Facet {
    let corners: Vec<DVec3> = corners.iter().copied().map(DVec3::from_array).collect();
    let normal = area_vector(&corners).normalize_or_zero();
    let triangle = |third: usize| {
        let vertices = [0, third - 1, third];
        let positions = vertices.map(|vertex| corners[vertex]);
        SourceTriangle { vertices: vertices.map(|vertex| vertex as u32), positions }
    };
    let triangles = (2..corners.len()).map(triangle).collect();
    let corners = corners.into_iter().map(|position| Corner { position, normal }).collect();
    Facet { plane: PlaneId(plane), normal, corners, triangles, is_sealed: false }
}

fn surface(facets: Vec<Facet>) -> Surface {
    Surface {
        node: 0,
        primitive: 0,
        side: Side::Front,
        name: String::new(),
        reflectance: DVec3::splat(0.5),
        exitance: DVec3::ZERO,
        opacity: 1.0,
        appearance: None,
        keeps_normals: false,
        facets,
    }
}

/// A scene whose surfaces have these facets.
pub fn scene(surfaces: Vec<Vec<Facet>>, lights: Vec<LightKind>) -> Scene {
    let light = |kind| Light {
        node: 0,
        name: String::new(),
        kind,
        intensity: DVec3::splat(1e6),
        entry: LightEntry::Punctual(0),
    };
    let surfaces: Vec<Surface> = surfaces.into_iter().map(surface).collect();
    Scene {
        source: SourceDocument {
            root: gltf::json::Root::default(),
            buffers: vec![],
            folder: None,
            is_meshopt: false,
        },
        vertex_count: surfaces.iter().map(Surface::vertex_count).sum(),
        sealed_vertex_count: 0,
        surfaces,
        lights: lights.into_iter().map(light).collect(),
        sky: DVec3::ZERO,
        sky_pattern: None,
        frame: Frame { centre: DVec3::ZERO, scale: 1.0 },
        plane_count: 1000,
        warnings: vec![],
        import_report: ImportReport::default(),
        degenerate_triangles: 0,
    }
}

/// Divides the first of each `every` leaves of a mesh.
pub fn divide(mesh: &mut Mesh, every: usize) {
    let leaves: Vec<PatchId> = mesh.leaves().map(|(id, _)| id).collect();
    leaves.into_iter().step_by(every).for_each(|id| mesh.divide(id));
}

/// A square in a sloping plane, its mesh, divided by this number of slanting lines and the shares of the one without them.
pub fn overlaid(lines: u32) -> (Scene, Mesh, Vec<Share>) {
    let at = |x: f64, z: f64| [x * SIZE, z * SIZE / 2.0, z * SIZE];
    let [a, b, c, d] = [at(0.0, 0.0), at(0.0, 1.0), at(1.0, 1.0), at(1.0, 0.0)];
    let scene = scene(vec![vec![facet(0, &[a, b, c]), facet(0, &[a, c, d])]], vec![]);
    let line = |index: u32| {
        let x = SIZE * (0.2 + 0.6 * f64::from(index) / f64::from(lines));
        [(x, 0.1 * SIZE), (x + 0.05 * SIZE, 0.9 * SIZE)].map(|(x, z)| DVec3::new(x, z / 2.0, z))
    };
    let lines = vec![vec![(0..lines).map(line).collect(), vec![]]];
    let mesh_of = |lines: &[_]| Mesh::new(&scene, SIZE, LONGEST_EDGE, 8, lines);
    let (mesh, without) = (mesh_of(&lines), mesh_of(&[]));
    let shares = mesh.overlaid(&without, without.shares(&scene), LONGEST_EDGE, &scene);
    assert_eq!(shares.len(), without.vertices.len());
    assert!(mesh.vertices.len() > 2 * shares.len(), "{} vertices", mesh.vertices.len());
    (scene, mesh, shares)
}

/// Squares apart from each other, with edges of these lengths.
pub fn squares(edges: &[f64]) -> Mesh {
    let mut mesh = Mesh::default();
    for (index, edge) in edges.iter().enumerate() {
        let first = mesh.vertices.len() as u32;
        let corners = [DVec3::ZERO, DVec3::X, DVec3::X + DVec3::Y, DVec3::Y];
        mesh.vertices.extend(corners.map(|corner| Vertex {
            position: corner * *edge + DVec3::X * 10.0 * index as f64,
            normal: DVec3::Z,
            plane: PlaneId(0),
            smooth: false,
            hovering: None,
        }));
        mesh.patches.push(Patch {
            surface: 0,
            facet: 0,
            corners: (first..first + 4).map(VertexId).collect(),
            first_child: None,
            parent: None,
            area: edge * edge,
        });
    }
    mesh
}
