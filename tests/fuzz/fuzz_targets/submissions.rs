//! Whatever the bytes of a submission, its fields are named as wrong, or its settings are such that a bake can begin.
#![no_main]

use libfuzzer_sys::fuzz_target;
use pipeline::options::{Violations, wanted};
use probes::Places;
use prost::Message;
use protocol::api::SubmitSceneHeader;

fuzz_target!(|bytes: &[u8]| {
    let Ok(header) = SubmitSceneHeader::decode(bytes) else { return };
    let mut wrong = Violations::default();
    let wanted = wanted(&header, &mut wrong);
    if wrong.check().is_err() {
        return;
    }
    let bake = wanted.bake;
    for number in [bake.mesh_error, bake.shooter_edge, bake.threshold] {
        assert!(number > 0.0 && number.is_finite(), "{bake:?}");
    }
    assert!(bake.window > 0 && (4..=262_144).contains(&bake.rays_per_hemisphere), "{bake:?}");
    assert!((0.0..=0.5).contains(&bake.form_factor_error), "{bake:?}");
    assert!((0.0..=1e-3).contains(&bake.factor_rounding), "{bake:?}");
    assert!(bake.max_edge.is_none_or(|edge| edge > 0.0 && edge.is_finite()), "{bake:?}");
    assert!(wanted.import.sky.is_finite() && wanted.import.sky.min_element() >= 0.0);
    assert!(wanted.import.weld.is_none_or(|weld| weld > 0.0 && weld.is_finite()));
    assert!(wanted.occlusion.is_none_or(|distance| distance > 0.0 && distance.is_finite()));
    match wanted.probes {
        Some(Places::Grid(spacing)) => assert!(spacing > 0.0 && spacing.is_finite()),
        Some(Places::Points(points)) => {
            assert!(!points.is_empty() && points.iter().all(|point| point.is_finite()))
        }
        None => {}
    }
    assert!(wanted.export.exposure.is_none_or(|exposure| exposure > 0.0 && exposure.is_finite()));
});
