//! Scenes of a few facets, for tests.

use glam::DVec3;
use kernel::geometry::{PlaneId, area_vector};
use scene::{
    Corner, Facet, Frame, ImportReport, Light, LightEntry, LightKind, Scene, Side, SourceDocument, Surface,
};

/// A facet with these corners, counter-clockwise seen from its lit side.
pub fn facet(plane: u32, corners: &[[f64; 3]]) -> Facet {
    let corners: Vec<DVec3> = corners.iter().copied().map(DVec3::from_array).collect();
    let normal = area_vector(&corners).normalize_or_zero();
    let corners = corners.into_iter().map(|position| Corner { position, normal }).collect();
    Facet { plane: PlaneId(plane), normal, corners, triangles: vec![], is_sealed: false }
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
