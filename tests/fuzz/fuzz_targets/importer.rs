//! Whatever the bytes, importing gives an error, or a scene of numbers that the solver can take.
#![no_main]

use libfuzzer_sys::fuzz_target;
use scene::{ImportOptions, ReadOptions, import_slice};

fuzz_target!(|bytes: &[u8]| {
    let read = ReadOptions { max_bytes: 1 << 20, max_triangles: 2_000, ..ReadOptions::default() };
    let options = ImportOptions { read, ..ImportOptions::default() };
    let Ok(scene) = import_slice(bytes, &options) else { return };
    // A surface may be cut away under others, but not all.
    assert!(scene.surfaces.iter().any(|surface| !surface.facets.is_empty()));
    assert!(scene.frame.scale > 0.0 && scene.frame.centre.is_finite());
    for surface in &scene.surfaces {
        assert!(surface.reflectance.min_element() >= 0.0 && surface.reflectance.max_element() < 1.0);
        assert!(surface.exitance.is_finite() && surface.exitance.min_element() >= 0.0);
        assert!((0.0..=1.0).contains(&surface.opacity));
        for (index, facet) in surface.facets.iter().enumerate() {
            let corners: Vec<_> = facet.corners.iter().map(|corner| corner.position).collect();
            let (reflected, taken) = (
                surface.mean_reflectance(index as u32, &corners),
                surface.mean_opacity(index as u32, &corners),
            );
            assert!(reflected.min_element() >= 0.0 && reflected.max_element() < 1.0);
            assert!(
                surface.mean_exitance(index as u32, &corners).is_finite() && (0.0..=1.0).contains(&taken)
            );
            assert!(facet.plane.0 < scene.plane_count && facet.corners.len() >= 3);
            assert!((facet.normal.length() - 1.0).abs() < 1e-9);
            for corner in &facet.corners {
                // The frame is up to 2048 long, about its middle.
                assert!(corner.position.abs().max_element() <= 1024.0);
                assert!((corner.normal.length() - 1.0).abs() < 1e-9);
            }
        }
    }
    for light in &scene.lights {
        assert!(light.intensity.is_finite());
        assert!(light.kind.is_valid());
    }
});
