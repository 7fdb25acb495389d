//! Which runs a study makes.

/// A knob that is swept while the others stay at their defaults.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Curve {
    /// All of them, as `--error` picks them.
    Together,
    /// The mesh: `--mesh-error`.
    Depth,
    /// The end of shooting: `--threshold`.
    Threshold,
    /// The rays, with all occlusion sampled: `--exact-occluders 0 --rays`.
    Rays,
    /// No knob is turned but that the mesh is fine; visibility is computed where that is possible. One point.
    Defaults,
}

impl Curve {
    /// All curves, in the order in which they are run and shown.
    pub const ALL: [Self; 5] = [Self::Together, Self::Depth, Self::Threshold, Self::Rays, Self::Defaults];

    /// Name in the CSV.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Together => "together",
            Self::Depth => "depth",
            Self::Threshold => "threshold",
            Self::Rays => "rays",
            Self::Defaults => "defaults",
        }
    }

    /// Name for people, with the knob as the command line has it.
    #[must_use]
    pub fn title(self) -> &'static str {
        match self {
            Self::Together => "all together (--error)",
            Self::Depth => "depth (--mesh-error)",
            Self::Threshold => "threshold (--threshold)",
            Self::Rays => "rays (--exact-occluders 0 --rays)",
            Self::Defaults => "defaults",
        }
    }

    /// Values of the knob, from coarse to fine.
    fn values(self, size: &PlanSize) -> Vec<Option<f64>> {
        let values: &[f64] = match (self, size.quick) {
            (Self::Together, _) if !size.errors.is_empty() => &size.errors,
            _ if !size.errors.is_empty() => return vec![],
            (Self::Defaults, _) => return vec![None],
            (Self::Together, false) => &[0.1, 0.05, 0.03, 0.02, 0.015, 0.01],
            (Self::Together, true) => &[0.1, 0.03],
            (Self::Depth, false) => &[0.1, 0.05, 0.02, 0.01, 0.005, 0.003],
            (Self::Depth, true) => &[0.1, 0.02],
            (Self::Threshold, false) => &[1.0, 0.3, 0.1, 0.03, 1e-3, 1e-6],
            (Self::Threshold, true) => &[1.0, 1e-3],
            (Self::Rays, false) => &[16.0, 64.0, 256.0, 1024.0, 4096.0],
            (Self::Rays, true) => &[16.0, 256.0],
        };
        values.iter().copied().map(Some).collect()
    }
}

/// Error of the mesh where it is not what is studied: small beside the others.
const FINE: &str = "0.005";

/// Rays per hemisphere of the sampled setting whose bias and spread are measured: few enough to show noise.
const SEEDED_RAYS: f64 = 256.0;

/// One setting of the knobs.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd)]
pub struct Setting {
    /// The knob that is turned.
    pub curve: Curve,
    /// Its value; none where none is turned.
    pub value: Option<f64>,
}

impl Setting {
    /// The setting as arguments of `solve`.
    #[must_use]
    pub fn arguments(&self) -> Vec<String> {
        let knobs: &[&str] = match self.curve {
            Curve::Together => &["--error"],
            Curve::Depth => &["--mesh-error"],
            Curve::Threshold => &["--threshold"],
            Curve::Rays => &["--exact-occluders", "0", "--rays"],
            Curve::Defaults => &[],
        };
        let value = self.value.map(|value| value.to_string());
        knobs.iter().map(|&knob| knob.to_owned()).chain(value).collect()
    }

    /// The setting for people: the arguments, or `defaults`.
    #[must_use]
    pub fn title(&self) -> String {
        match self.curve {
            Curve::Defaults => self.curve.title().to_owned(),
            _ => self.arguments().join(" "),
        }
    }
}

/// Purpose of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Part {
    /// A curve of error over time: the same seed in every run.
    Curves,
    /// Bias and spread: another seed in every run.
    Seeds,
}

impl Part {
    /// Name in the CSV.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Curves => "curves",
            Self::Seeds => "seeds",
        }
    }
}

/// One run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step {
    /// Purpose.
    pub part: Part,
    /// How it is baked.
    pub setting: Setting,
    /// Which of the equal runs it is, from 1.
    pub run: u32,
    /// Seed of the bake.
    pub seed: u64,
}

impl Step {
    /// The run as arguments of `solve`.
    #[must_use]
    pub fn arguments(&self) -> Vec<String> {
        let mut arguments = self.setting.arguments();
        if !matches!(self.setting.curve, Curve::Together | Curve::Depth) {
            arguments.extend(["--mesh-error", FINE].map(str::to_owned));
        }
        arguments.extend(["--seed".to_owned(), self.seed.to_string()]);
        arguments
    }
}

/// How large a study is.
#[derive(Debug, Clone, PartialEq)]
pub struct PlanSize {
    /// Runs of each setting of a curve.
    pub runs: u32,
    /// Seeds for bias and spread.
    pub seeds: u32,
    /// Two points a curve.
    pub quick: bool,
    /// Where not empty, `--error` alone is swept, over these, and no seeds are.
    pub errors: Vec<f64>,
}

/// All runs, in their order: every setting of the curves once, then all of them again, so that a slow spell of the machine
/// falls on one run of each setting and the medians leave it out; then the seeds.
#[must_use]
pub fn plan(size: &PlanSize, default_seed: u64) -> Vec<Step> {
    let settings: Vec<Setting> = Curve::ALL
        .into_iter()
        .flat_map(|curve| curve.values(size).into_iter().map(move |value| Setting { curve, value }))
        .collect();
    let curves = (1..=size.runs).flat_map(|run| {
        settings.iter().map(move |&setting| Step { part: Part::Curves, setting, run, seed: default_seed })
    });
    let seeded = [
        Setting { curve: Curve::Defaults, value: None },
        Setting { curve: Curve::Rays, value: Some(SEEDED_RAYS) },
    ];
    let seeded = seeded.into_iter().filter(|_| size.errors.is_empty());
    let seeds = seeded.flat_map(|setting| {
        (0..size.seeds).map(move |seed| Step { part: Part::Seeds, setting, run: 1, seed: u64::from(seed) })
    });
    curves.chain(seeds).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_study_runs_every_setting_as_often_as_asked_and_every_seed_once() {
        let steps = plan(&PlanSize { runs: 5, seeds: 10, quick: false, errors: vec![] }, 7);
        // 6 + 6 + 6 + 5 values and the defaults, and two settings with seeds.
        assert_eq!(steps.len(), 24 * 5 + 2 * 10);
        let round = &steps[24..48];
        assert!(round.iter().all(|step| (step.run, step.seed, step.part) == (2, 7, Part::Curves)));
        assert_eq!(round.iter().filter(|step| step.setting.curve == Curve::Rays).count(), 5);
        let seeds: Vec<u64> = steps[120..130].iter().map(|step| step.seed).collect();
        assert_eq!(seeds, (0..10).collect::<Vec<_>>());
        assert!(steps[130..].iter().all(|step| step.setting.value == Some(256.0)));
        let quick = PlanSize { runs: 1, seeds: 3, quick: true, errors: vec![] };
        assert_eq!(plan(&quick, 0).len(), 9 + 6);
        let steps = plan(&PlanSize { runs: 2, errors: vec![0.3, 0.15, 0.1], ..quick }, 0);
        let asked: Vec<_> = steps.iter().map(|step| step.arguments().join(" ")).collect();
        let round = ["--error 0.3 --seed 0", "--error 0.15 --seed 0", "--error 0.1 --seed 0"];
        assert_eq!(asked, [round, round].concat());
    }

    #[test]
    fn a_step_says_its_knob_and_no_other() {
        let step = |curve, value| {
            let step = Step { part: Part::Curves, setting: Setting { curve, value }, run: 1, seed: 3 };
            step.arguments().join(" ")
        };
        assert_eq!(step(Curve::Together, Some(0.015)), "--error 0.015 --seed 3");
        assert_eq!(step(Curve::Depth, Some(0.02)), "--mesh-error 0.02 --seed 3");
        assert_eq!(step(Curve::Threshold, Some(1e-6)), "--threshold 0.000001 --mesh-error 0.005 --seed 3");
        assert_eq!(
            step(Curve::Rays, Some(4096.0)),
            "--exact-occluders 0 --rays 4096 --mesh-error 0.005 --seed 3"
        );
        assert_eq!(step(Curve::Defaults, None), "--mesh-error 0.005 --seed 3");
    }
}
