//! Made-up measurements for the tests of this folder.

use super::measurement::{BakeFigures, ErrorEstimate, ModelFigures};
use super::{Circumstances, Curve, Measurement, Part, RunReport, Setting, Step};
use crate::picture::Flip;
use crate::score::Score;

/// A run of a curve with this time and error.
pub(super) fn measurement(curve: Curve, value: Option<f64>, seconds: f64, relative_l2: f64) -> Measurement {
    Measurement {
        step: Step { part: Part::Curves, setting: Setting { curve, value }, run: 1, seed: 0 },
        seconds,
        score: Score {
            relative_l2,
            reference_noise: 0.001,
            energy_ratio: 0.99,
            p95: 0.03,
            max: 0.1,
            uncovered: 0,
            not_finite: 0,
            vertices: 1000,
            triangles: 2000,
        },
        flip: Some(Flip { mean: 2.0 * relative_l2, p99: 8.0 * relative_l2 }),
        report: RunReport {
            peak_memory_bytes: Some(50 << 20),
            bake: BakeFigures {
                vertices: 1000,
                shooting_vertices: 100,
                rows: 120,
                factors: 4_000_000,
                model: ModelFigures { pairs_sampled: 500 },
                rays: 8_000_000,
                busy_seconds: 2.0,
                error: ErrorEstimate {
                    mesh: 0.01,
                    receivers: 0.008,
                    shooters: 0.006,
                    total: 0.01,
                    ..ErrorEstimate::default()
                },
            },
        },
    }
}

/// Two points on each curve: errors of `.16 / t^exponent` at 1 and 16 s.
pub(super) fn power_laws() -> Vec<Measurement> {
    let law = |curve, coarse, fine, exponent: f64| {
        [(coarse, 1.0), (fine, 16.0)].map(|(value, seconds): (f64, f64)| {
            measurement(curve, Some(value), seconds, 0.16 / seconds.powf(exponent))
        })
    };
    let mut all = vec![];
    all.extend(law(Curve::Together, 0.1, 0.01, 1.0));
    all.extend(law(Curve::Depth, 0.1, 0.003, 0.75));
    all.extend(law(Curve::Threshold, 0.3, 1e-6, 0.5));
    all.extend(law(Curve::Rays, 16.0, 4096.0, 0.25));
    all.push(measurement(Curve::Defaults, None, 8.0, 0.012));
    all
}

pub(super) fn circumstances() -> Circumstances {
    Circumstances {
        scene: "room.glb".into(),
        reference: "room.csv".into(),
        program: "halflight 0.1.0".into(),
        machine: "Some Processor, 2 cores, Some System".into(),
        workers: "2 threads".into(),
        runs: 5,
        noise: Some(Flip { mean: 0.012, p99: 0.034 }),
    }
}
