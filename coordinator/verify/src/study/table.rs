//! The tables, as Markdown.

use super::seeds::Spread;
use super::{Circumstances, Curve, Measurement, Point, SeedFigures, TimeTo, points, seed_figures, time_to};
use crate::picture::Flip;

/// The errors whose time is told.
const ERRORS: [f64; 5] = [0.1, 0.05, 0.03, 0.02, 0.01];

/// Cell of an unknown value.
const UNKNOWN: &str = "–";

/// All tables: time to an error by each curve, every setting, bias and spread over seeds.
#[must_use]
pub fn markdown(circumstances: &Circumstances, measurements: &[Measurement]) -> String {
    let curves = Curve::ALL.map(|curve| (curve, points(measurements, curve)));
    let all: Vec<Point> = curves.iter().flat_map(|(_, points)| points.clone()).collect();
    let seeded = seed_figures(measurements);
    let seeds = (!seeded.is_empty()).then(|| seeds(&seeded));
    let always = [head(circumstances), times(&curves), settings(&all, circumstances.noise)];
    always.into_iter().chain(seeds).collect::<Vec<_>>().join("\n")
}

fn head(about: &Circumstances) -> String {
    format!(
        "# Work and precision: {}\n\n\
        {} on {}. Rows by {}. Median of {} run{}; the time is the wall time of the whole program, from the file to the lit \
        file. The error is the relative L2 error of the radiosity against {}.\n",
        about.scene,
        about.program,
        about.machine,
        about.workers,
        about.runs,
        if about.runs == 1 { "" } else { "s" },
        about.reference
    )
}

fn times(curves: &[(Curve, Vec<Point>)]) -> String {
    let titles = ERRORS.map(|error| percent(error, 0));
    let header = ["knob".to_owned()].into_iter().chain(titles).collect();
    let swept = curves.iter().filter(|(curve, points)| *curve != Curve::Defaults && !points.is_empty());
    let rows = swept.map(|(curve, points)| {
        let times = ERRORS.map(|error| match time_to(error, points) {
            TimeTo::AtMost(seconds) => format!("≤ {}", time(seconds)),
            TimeTo::Seconds(seconds) => time(seconds),
            TimeTo::NotReached(_) => "not reached".to_owned(),
        });
        [curve.title().to_owned()].into_iter().chain(times).collect()
    });
    let table = table(header, rows.collect());
    format!(
        "## Time to an error\n\n{table}\n\
        Between two settings the logarithm of the error is taken to be linear in that of the time. \"≤\": the coarsest \
        setting is better than that. Where one knob is turned, the others stay at their defaults, which bound the error that it \
        can reach.\n"
    )
}

fn settings(points: &[Point], noise: Option<Flip>) -> String {
    let header = [
        "setting",
        "error",
        "estimated",
        "energy ratio",
        "FLIP, mean",
        "FLIP, 99th percentile",
        "time",
        "vertices",
        "million form factors",
        "million rays",
        "million form factors/s",
        "million rays/s",
        "peak memory, MiB",
    ];
    let millions = |value: f64| format!("{:.2}", value * 1e-6);
    let or_unknown = |value: Option<f64>| value.map_or(UNKNOWN.to_owned(), |value| format!("{value:.3}"));
    let rows = points.iter().map(|point| {
        let rate = |work: f64| {
            let rate = work / point.busy_seconds;
            if rate.is_finite() { millions(rate) } else { UNKNOWN.to_owned() }
        };
        let memory = |bytes: f64| format!("{:.0}", bytes / f64::from(1 << 20));
        vec![
            point.setting.title(),
            percent(point.error, 2),
            percent(point.estimated_error, 2),
            format!("{:.4}", point.energy_ratio),
            or_unknown(point.flip.map(|flip| flip.mean)),
            or_unknown(point.flip.map(|flip| flip.p99)),
            time(point.seconds),
            format!("{:.0}", point.vertices),
            millions(point.factors),
            millions(point.rays),
            rate(point.factors),
            rate(point.rays),
            point.peak_memory_bytes.map_or(UNKNOWN.to_owned(), memory),
        ]
    });
    let table = table(header.map(str::to_owned).to_vec(), rows.collect());
    format!(
        "## Every setting\n\n{table}\n\
        Form factors and rays per second are those of one thread while it computes rows. The memory is that of the \
        coordinator's process, which holds its own threads, but not workers elsewhere.{}\n",
        noise.map_or_else(String::new, |noise| format!(
            " FLIP is that of pictures of the lit file beside path-traced ones: 0 where the eye sees no difference. Two halves of \
            their paths differ by {:.3} in the mean and {:.3} at the 99th percentile; about half of that is left where a bake has no error.",
            noise.mean, noise.p99
        ))
    )
}

fn seeds(figures: &[SeedFigures]) -> String {
    let header = [
        "setting",
        "seeds",
        "bias of the energy",
        "spread of the energy",
        "error",
        "spread of the error",
        "estimated / measured error",
        "spread of that",
    ];
    let rows = figures.iter().map(|seeded| {
        let with_error = |spread: &Spread| {
            format!("{:+.3} % ± {:.3} %", spread.mean * 100.0, spread.standard_error * 100.0)
        };
        vec![
            seeded.setting.title(),
            seeded.seeds.to_string(),
            with_error(&seeded.bias),
            percent(seeded.bias.deviation, 3),
            percent(seeded.error.mean, 3),
            percent(seeded.error.deviation, 3),
            format!("{:.3}", seeded.estimate.mean),
            format!("{:.3}", seeded.estimate.deviation),
        ]
    });
    let table = table(header.map(str::to_owned).to_vec(), rows.collect());
    format!(
        "## Bias and spread over seeds\n\n{table}\n\
        The bias is the mean of the energy ratio less 1, with the standard error of that mean over the seeds; it holds what the \
        mesh loses or adds as well. A spread is the standard deviation from seed to seed.\n"
    )
}

/// A table of Markdown; the first column is text, the others are numbers.
fn table(header: Vec<String>, rows: Vec<Vec<String>>) -> String {
    let line = |cells: &[String]| format!("| {} |\n", cells.join(" | "));
    let rule = format!("|---|{}\n", "---:|".repeat(header.len() - 1));
    [line(&header), rule].into_iter().chain(rows.iter().map(|row| line(row))).collect()
}

fn percent(part: f64, digits: usize) -> String {
    format!("{:.digits$} %", part * 100.0)
}

/// Seconds with three digits or so.
fn time(seconds: f64) -> String {
    match seconds {
        s if s < 1.0 => format!("{s:.3} s"),
        s if s < 10.0 => format!("{s:.2} s"),
        s if s < 100.0 => format!("{s:.1} s"),
        s => format!("{s:.0} s"),
    }
}

#[cfg(test)]
mod tests {
    use super::super::Part;
    use super::super::test_measurements::{circumstances, measurement, power_laws};
    use super::*;

    fn line<'a>(text: &'a str, start: &str) -> &'a str {
        text.lines().find(|line| line.starts_with(start)).unwrap_or_else(|| panic!("no {start} in {text}"))
    }

    #[test]
    fn times_are_those_of_the_power_laws() {
        let text = markdown(&circumstances(), &power_laws());
        assert_eq!(line(&text, "| knob"), "| knob | 10 % | 5 % | 3 % | 2 % | 1 % |");
        assert_eq!(
            line(&text, "| all together"),
            "| all together (--error) | 1.60 s | 3.20 s | 5.33 s | 8.00 s | 16.0 s |"
        );
        assert_eq!(
            line(&text, "| threshold"),
            "| threshold (--threshold) | 2.56 s | 10.2 s | not reached | not reached | not reached |"
        );
    }

    #[test]
    fn a_curve_that_begins_below_an_error_says_so_and_one_that_was_not_run_is_left_out() {
        let runs = [measurement(Curve::Depth, Some(0.1), 0.25, 0.04)];
        let text = markdown(&circumstances(), &runs);
        assert_eq!(
            line(&text, "| depth"),
            "| depth (--mesh-error) | ≤ 0.250 s | ≤ 0.250 s | not reached | not reached | not reached |"
        );
        assert!(!text.contains("| rays") && !text.contains("seeds"), "{text}");
    }

    #[test]
    fn every_setting_has_its_figures() {
        let mut runs = power_laws();
        runs.last_mut().unwrap().report.peak_memory_bytes = None;
        let text = markdown(&circumstances(), &runs);
        assert_eq!(
            line(&text, "| --exact-occluders 0 --rays 4096"),
            "| --exact-occluders 0 --rays 4096 | 8.00 % | 1.00 % | 0.9900 | 0.160 | 0.640 | 16.0 s | 1000 | 4.00 | 8.00 | 2.00 | 4.00 | 50 |"
        );
        assert!(line(&text, "| defaults").ends_with("| 2.00 | 4.00 | – |"));
        for word in [
            "room.glb",
            "room.csv",
            "Some Processor",
            "2 threads",
            "Median of 5 runs",
            "halflight 0.1.0",
            "0.034",
        ] {
            assert!(text.contains(word), "{word}");
        }
    }

    #[test]
    fn seeds_have_bias_and_spread() {
        let runs = [0.98, 1.0, 1.02].map(|ratio| {
            let mut run = measurement(Curve::Rays, Some(256.0), 1.0, 0.02);
            run.step.part = Part::Seeds;
            run.score.energy_ratio = ratio - 0.01;
            run
        });
        let text = markdown(&circumstances(), &runs);
        assert_eq!(
            line(&text, "| --exact-occluders 0 --rays 256"),
            "| --exact-occluders 0 --rays 256 | 3 | -1.000 % ± 1.155 % | 2.000 % | 2.000 % | 0.000 % | 0.500 | 0.000 |"
        );
    }
}
