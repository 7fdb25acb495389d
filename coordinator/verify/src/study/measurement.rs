//! Measurements of runs, and their CSV.

use serde::Deserialize;

use super::Step;
use crate::picture::Flip;
use crate::score::Score;

/// The part of a run's report (`solve --report`) that a study uses.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct RunReport {
    /// Largest memory of the process, in bytes; none where the system does not say.
    pub peak_memory_bytes: Option<u64>,
    /// Figures of the bake.
    pub bake: BakeFigures,
}

/// The figures of a bake that a study shows.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct BakeFigures {
    /// Vertices of the refined mesh.
    pub vertices: u64,
    /// Vertices that shoot.
    pub shooting_vertices: u64,
    /// Rows made.
    pub rows: u64,
    /// Form factors computed that are not 0 before occlusion.
    pub factors: u64,
    /// Size of the model.
    pub model: ModelFigures,
    /// Rays cast.
    pub rays: u64,
    /// Seconds that workers computed, over all threads.
    pub busy_seconds: f64,
    /// Estimated relative L2 error of the radiosity.
    pub error: ErrorEstimate,
}

/// Estimated relative L2 error of the radiosity over the reflecting surfaces, sqrt(int (B' - B)^2 / int B^2), split by origin.
/// The parts are independent of each other: their squares add up.
#[derive(Debug, Clone, Copy, Default, PartialEq, Deserialize)]
pub struct ErrorEstimate {
    /// Light not yet shot, and what reflection would make of it.
    pub unshot: f64,
    /// Noise of visibility that was sampled with rays: standard error, from the spread between halves of the rays. 0 where all
    /// visibility was computed.
    pub visibility: f64,
    /// Arithmetic of the form factors: mean error of the rules that were used for them, and the rounding of stored rows.
    pub form_factors: f64,
    /// Of the mesh, in all: receivers and shooters.
    pub mesh: f64,
    /// Interpolation between vertices: measured at random points between them.
    pub receivers: f64,
    /// Shares that count as wholes, each with one radiosity: measured at random points, against the light of the refined mesh.
    pub shooters: f64,
    /// All of them.
    pub total: f64,
}

/// The figures of the model that a study shows.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct ModelFigures {
    /// Pairs of receiver and shooter whose visibility was sampled with rays.
    pub pairs_sampled: u64,
}

impl RunReport {
    /// Reads a report.
    ///
    /// # Errors
    /// When the text is not a report of this version.
    pub fn parse(json: &str) -> serde_json::Result<Self> {
        serde_json::from_str(json)
    }
}

/// The measurement of one run.
#[derive(Debug, Clone, PartialEq)]
pub struct Measurement {
    /// The run.
    pub step: Step,
    /// Wall time of the whole program, from the file to the lit file.
    pub seconds: f64,
    /// Its error against the reference.
    pub score: Score,
    /// The error that the eye sees; none where no pictures were made.
    pub flip: Option<Flip>,
    /// Its own report.
    pub report: RunReport,
}

/// Columns of the CSV.
const HEADER: &str = "part,curve,value,run,seed,seconds,relative_l2,energy_ratio,p95,flip_mean,flip_p99,estimated_error,estimated_unshot,\
estimated_visibility,estimated_form_factors,estimated_mesh,estimated_receivers,estimated_shooters,vertices,\
shooting_vertices,rows,form_factors,rays,pairs_sampled,busy_seconds,peak_memory_bytes";

/// All runs, one a line. Errors are parts of one, not percent; what is not known is empty.
#[must_use]
pub fn to_csv(measurements: &[Measurement]) -> String {
    let lines = measurements.iter().map(|measurement| line(measurement) + "\n");
    std::iter::once(format!("{HEADER}\n")).chain(lines).collect()
}

fn line(measurement: &Measurement) -> String {
    let Measurement { step, seconds, score, flip, report } = measurement;
    let (bake, error) = (&report.bake, &report.bake.error);
    let or_empty = |value: Option<String>| value.unwrap_or_default();
    [
        step.part.name().to_owned(),
        step.setting.curve.name().to_owned(),
        or_empty(step.setting.value.map(|value| value.to_string())),
        step.run.to_string(),
        step.seed.to_string(),
        format!("{seconds:.4}"),
        format!("{:.6}", score.relative_l2),
        format!("{:.6}", score.energy_ratio),
        format!("{:.6}", score.p95),
        or_empty(flip.map(|flip| format!("{:.5}", flip.mean))),
        or_empty(flip.map(|flip| format!("{:.5}", flip.p99))),
        format!("{:.4e}", error.total),
        format!("{:.4e}", error.unshot),
        format!("{:.4e}", error.visibility),
        format!("{:.4e}", error.form_factors),
        format!("{:.4e}", error.mesh),
        format!("{:.4e}", error.receivers),
        format!("{:.4e}", error.shooters),
        bake.vertices.to_string(),
        bake.shooting_vertices.to_string(),
        bake.rows.to_string(),
        bake.factors.to_string(),
        bake.rays.to_string(),
        bake.model.pairs_sampled.to_string(),
        format!("{:.4}", bake.busy_seconds),
        or_empty(report.peak_memory_bytes.map(|bytes| bytes.to_string())),
    ]
    .join(",")
}

#[cfg(test)]
mod tests {
    use super::super::test_measurements::measurement;
    use super::super::{Curve, Part};
    use super::*;

    #[test]
    fn csv_has_a_line_a_run_with_a_field_a_column() {
        let mut runs = [
            measurement(Curve::Rays, Some(256.0), 2.5, 0.0123),
            measurement(Curve::Defaults, None, 1.0, 0.01),
        ];
        runs[1].report.peak_memory_bytes = None;
        runs[1].flip = None;
        runs[1].step.part = Part::Seeds;
        let text = to_csv(&runs);
        let lines: Vec<Vec<&str>> = text.lines().map(|line| line.split(',').collect()).collect();
        assert_eq!(lines.len(), 3);
        assert!(lines.iter().all(|line| line.len() == lines[0].len()));
        let field = |line: usize, name: &str| {
            lines[line]
                [lines[0].iter().position(|column| *column == name).unwrap_or_else(|| panic!("{name}"))]
        };
        for (name, expected) in [
            ("part", "curves"),
            ("curve", "rays"),
            ("value", "256"),
            ("run", "1"),
            ("seed", "0"),
            ("seconds", "2.5000"),
            ("relative_l2", "0.012300"),
            ("energy_ratio", "0.990000"),
            ("p95", "0.030000"),
            ("flip_mean", "0.02460"),
            ("flip_p99", "0.09840"),
            ("estimated_error", "1.0000e-2"),
            ("estimated_receivers", "8.0000e-3"),
            ("vertices", "1000"),
            ("shooting_vertices", "100"),
            ("rows", "120"),
            ("form_factors", "4000000"),
            ("rays", "8000000"),
            ("pairs_sampled", "500"),
            ("busy_seconds", "2.0000"),
            ("peak_memory_bytes", "52428800"),
        ] {
            assert_eq!(field(1, name), expected, "{name}");
        }
        assert_eq!(
            ["part", "value", "flip_mean", "peak_memory_bytes"].map(|name| field(2, name)),
            ["seeds", "", "", ""]
        );
    }

    #[test]
    fn what_is_no_report_is_refused() {
        assert!(RunReport::parse("{\"bake\": {}}").is_err());
    }
}
