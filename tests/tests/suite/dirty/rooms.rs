use bake::mesh::Mesh;
use bake::{BakeSettings, Baked};
use glam::DVec3;
use kernel::geometry::area_vector;
use scene::{Facet, Scene};
use scene::{ImportOptions, import_slice};
use tests::baking::{baked, imported, mean_irradiance, vertices_of};
use tests::dirty::{clean_room, dirty_room};

fn settings() -> BakeSettings {
    BakeSettings { shooter_edge: 0.3, mesh_error: 0.05, validation_samples: 0, ..BakeSettings::default() }
}

/// Whether a place in the room is well outside of what is not seen: furniture, partition, and the gap above the lamp.
fn is_open(place: DVec3) -> bool {
    let is_over_lamp = (2.4..3.4).contains(&place.x) && (1.4..2.6).contains(&place.z) && place.y > 2.98;
    // Walls and ceiling from above the furniture on; everything stands on the floor or in it.
    place.y > 2.0 && !is_over_lamp
}

/// Irradiance at the open vertices of the walls, by place.
fn open_irradiance(scene: &Scene, result: &Baked) -> Vec<f64> {
    let vertices = vertices_of(&result.lit, 0).into_iter();
    let open = vertices.filter(|vertex| is_open(scene.frame.to_world(vertex.position)));
    open.map(|vertex| vertex.irradiance.x).collect()
}

#[test]
fn a_dirty_room_is_lit_as_the_clean_one() {
    let (clean, dirty) = (imported(&clean_room().glb()), imported(&dirty_room(6_000)));
    assert!(dirty.degenerate_triangles > 20, "{}", dirty.degenerate_triangles);
    let duplicates = dirty.warnings.iter().filter(|warning| warning.contains("duplicate triangles dropped"));
    assert!(duplicates.count() >= 5, "{:?}", dirty.warnings);
    let [expected, found] = [&clean, &dirty].map(|scene| baked(scene, &settings()));
    for vertex in &found.lit.vertices {
        assert!(vertex.irradiance.is_finite() && vertex.position.is_finite());
        assert!(vertex.irradiance.min_element() >= -1e-6, "{}", vertex.irradiance);
    }
    // Walls, partition and furniture come first, in the same order; the clutter shades a little.
    for surface in 0..6 {
        let [a, b] = [&expected, &found].map(|result| mean_irradiance(&result.lit, surface).x);
        assert!((b / a - 1.0).abs() < 0.08, "{}: {b} for {a}", clean.surfaces[surface].name);
    }
    let least = |values: Vec<f64>| values.into_iter().fold(f64::INFINITY, f64::min);
    let (clean_least, dirty_least) =
        (least(open_irradiance(&clean, &expected)), least(open_irradiance(&dirty, &found)));
    assert!(dirty_least > 0.6 * clean_least, "black splotches: {dirty_least} for {clean_least}");
}

/// As many facets whatever the triangulation, but for slivers: triangles without area whose middle corner rounding moved off the
/// line stay by themselves.
#[test]
fn triangulation_does_not_show_in_the_facets() {
    let clean = imported(&clean_room().glb());
    let expected: usize = clean.surfaces[..6].iter().map(|surface| surface.facets.len()).sum();
    assert_eq!(expected, 36);
    for triangles in [500, 6_000, 60_000] {
        let scene = imported(&dirty_room(triangles));
        let is_sliver = |facet: &&Facet| {
            let corners: Vec<DVec3> = facet.corners.iter().map(|corner| corner.position).collect();
            // The frame is 1024 long or longer, and f32 rounds by half of 2^-23 of that at most.
            facet.triangles.len() == 1
                && area_vector(&corners).length() < 1e-3 * corners[0].distance(corners[1])
        };
        let facets = || scene.surfaces[..6].iter().flat_map(|surface| &surface.facets);
        let (slivers, all) = (facets().filter(is_sliver).count(), facets().count());
        assert_eq!(all - slivers, expected, "{triangles} triangles, {slivers} slivers");
        // One triangle in a hundred is a sliver to be, one in four of those lies along a diagonal.
        assert!(slivers <= triangles / 200, "{slivers} slivers of {triangles} triangles");
    }
}

#[test]
fn half_a_million_triangles_are_imported_and_meshed() {
    let scene = import_slice(&dirty_room(500_000), &ImportOptions::default()).unwrap();
    let triangles: usize =
        scene.surfaces.iter().flat_map(|surface| &surface.facets).map(|facet| facet.triangles.len()).sum();
    assert!((480_000..520_000).contains(&triangles), "{triangles}");
    for surface in &scene.surfaces {
        for facet in &surface.facets {
            assert!((facet.normal.length() - 1.0).abs() < 1e-9 && facet.corners.len() >= 3);
            assert!(facet.corners.iter().all(|corner| corner.position.is_finite()));
        }
    }
    let corners = scene.surfaces.iter().flat_map(|surface| &surface.facets).flat_map(|facet| &facet.corners);
    let extent = corners.map(|corner| corner.position.abs().max_element()).fold(0.0, f64::max) * 2.0;
    let mesh = Mesh::new(&scene, extent, 0.3 * extent, 8, &[]);
    assert!(mesh.vertices.iter().all(|vertex| vertex.position.is_finite() && vertex.normal.is_normalized()));
    assert!(mesh.vertices.len() < 200_000, "{}", mesh.vertices.len());
}
