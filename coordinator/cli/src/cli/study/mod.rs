mod pictures;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;

use anyhow::Context;
use bake::BakeSettings;
use clap::Args;
use cluster::Workers;
use files::AtomicWriteFile;
use pipeline::options::schema::{Options, Value};
use protocol::api::BakeOptions;
use scene::ReadOptions;
use tempfile::TempDir;
use verify::picture::Flip;
use verify::score::{check_reference, score};
use verify::study::{Circumstances, Measurement, PlanSize, RunReport, Step, markdown, plan, svg, to_csv};

use super::console::print;
use super::machine;
use super::outputs::check_distinct;
use super::progress::ProgressLine;
use super::scene_options::BesideOptions;
use super::workers::WorkerArguments;

use pictures::Pictures;

/// Most paths of a pixel: its four rays have two sequences of 65,536 each.
const MOST_PICTURE_PATHS: i64 = 8 << 16;

#[derive(Args)]
pub struct StudyArguments {
    /// Scene to bake: .glb or .gltf
    scene: PathBuf,
    /// Path-traced reference of the scene, CSV, as written by `reference`
    #[arg(long, value_name = "CSV")]
    reference: PathBuf,
    /// Folder for study.csv, study.svg and study.md, created if missing; older files are overwritten
    #[arg(short, long, value_name = "FOLDER")]
    output: PathBuf,
    /// Runs of each setting, of which the median counts [default: 5; 1 with --quick]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1000))]
    runs: Option<u32>,
    /// Seeds for bias and spread [default: 10; 3 with --quick]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..=1000))]
    seeds: Option<u32>,
    /// Measure only two settings per option, once
    #[arg(long)]
    quick: bool,
    /// Vary only --error, over these values: for large scenes
    #[arg(long, value_name = "E,...", value_delimiter = ',', value_parser = error, conflicts_with = "seeds")]
    errors: Vec<f64>,
    /// Paths per pixel, in eights, of the path-traced pictures for FLIP; 0 makes none [default: 256; 16 with --quick]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=MOST_PICTURE_PATHS))]
    picture_paths: Option<u32>,
    #[command(flatten)]
    beside: BesideOptions,
    #[command(flatten)]
    pub workers: WorkerArguments,
}

/// An error that `solve --error` takes.
fn error(text: &str) -> Result<f64, String> {
    match BakeOptions::KNOBS.iter().find(|knob| knob.flag == "error").map(|knob| knob.kind.parse(text)) {
        Some(Ok(Value::Number(error))) => Ok(error),
        Some(Err(wanted)) => Err(wanted),
        _ => Err("there is no such option".to_owned()),
    }
}

impl StudyArguments {
    fn picture_paths(&self) -> u32 {
        self.picture_paths.unwrap_or(if self.quick { 16 } else { 256 })
    }

    fn size(&self) -> PlanSize {
        let (runs, seeds) = if self.quick { (1, 3) } else { (5, 10) };
        // A curve goes from coarse to fine.
        let mut errors = self.errors.clone();
        errors.sort_unstable_by(|a, b| b.total_cmp(a));
        errors.dedup();
        PlanSize {
            runs: self.runs.unwrap_or(runs),
            seeds: self.seeds.unwrap_or(seeds),
            quick: self.quick,
            errors,
        }
    }
}

/// Bakes a scene many times, and writes how its error falls with time.
pub fn run(arguments: &StudyArguments, workers: &Workers) -> anyhow::Result<()> {
    let size = arguments.size();
    check_reference(&arguments.reference, &arguments.scene, &arguments.beside.read())?;
    let outputs = Outputs::prepare(arguments)?;
    let mut bench = Bench::new(arguments, workers)?;
    let steps = plan(&size, BakeSettings::default().seed);
    let line = ProgressLine::new("bake");
    let mut seconds = 0.0;
    let mut measurements = vec![];
    for (index, step) in steps.iter().enumerate() {
        line.enter("bake");
        let measurement = bench.measure(*step, &line)?;
        seconds += measurement.seconds;
        let left = seconds / (index + 1) as f64 * (steps.len() - index - 1) as f64;
        line.say(format_args!(
            "{}/{} {}, {}: {:.2} s, error {:.2} %, energy {:.4}{} · {:.0} s left",
            index + 1,
            steps.len(),
            step.part.name(),
            step.arguments().join(" "),
            measurement.seconds,
            100.0 * measurement.score.relative_l2,
            measurement.score.energy_ratio,
            measurement.flip.map_or_else(String::new, |flip| format!(", FLIP {:.3}", flip.mean)),
            left
        ));
        measurements.push(measurement);
    }
    line.finish();
    let circumstances = Circumstances {
        scene: file_name(&arguments.scene),
        reference: file_name(&arguments.reference),
        program: concat!("halflight ", env!("CARGO_PKG_VERSION")).into(),
        machine: machine::describe(),
        workers: describe(workers),
        runs: size.runs,
        noise: bench.pictures.as_ref().and_then(|pictures| pictures.noise),
    };
    let tables = markdown(&circumstances, &measurements);
    outputs.write(&to_csv(&measurements), &svg(&circumstances, &measurements)?, &tables)?;
    print(&tables)
}

/// Where the results go.
struct Outputs {
    folder: PathBuf,
}

const CSV: &str = "study.csv";
const SVG: &str = "study.svg";
const MARKDOWN: &str = "study.md";

impl Outputs {
    /// Makes the folder, and finds out whether files can be written there without losing what is read.
    fn prepare(arguments: &StudyArguments) -> anyhow::Result<Self> {
        let folder = &arguments.output;
        let mut read = vec![("scene", Some(&*arguments.scene)), ("reference", Some(&*arguments.reference))];
        read.extend(arguments.workers.security.files());
        fs::create_dir_all(folder).with_context(|| {
            format!("output folder {} cannot be made: choose another --output", folder.display())
        })?;
        for name in [CSV, SVG, MARKDOWN] {
            let path = folder.join(name);
            check_distinct(&read, &[("output", Some(&path))])?;
            anyhow::ensure!(!path.is_dir(), "{} is a folder: choose another --output", path.display());
            files::replace(&path)
                .and_then(AtomicWriteFile::discard)
                .with_context(|| format!("{} cannot be written: choose another --output", path.display()))?;
        }
        Ok(Self { folder: folder.to_owned() })
    }

    fn write(&self, csv: &str, svg: &str, markdown: &str) -> anyhow::Result<()> {
        for (name, text) in [(CSV, csv), (SVG, svg), (MARKDOWN, markdown)] {
            let path = self.folder.join(name);
            files::write(&path, text.as_bytes())
                .with_context(|| format!("{} cannot be written", path.display()))?;
        }
        Ok(())
    }
}

/// Runs `solve`, each time as a process of its own: time and memory are then those of the whole program.
struct Bench<'a> {
    arguments: &'a StudyArguments,
    program: PathBuf,
    /// Which workers the runs use, as arguments.
    workers: [String; 2],
    folder: TempDir,
    /// Made with the first lit file, of which they take the cameras.
    pictures: Option<Pictures>,
    threads: usize,
}

impl<'a> Bench<'a> {
    fn new(arguments: &'a StudyArguments, workers: &Workers) -> anyhow::Result<Self> {
        let threads = arguments.workers.threads.count()?.get();
        let workers = match workers {
            Workers::Embedded { threads } => ["--threads".into(), threads.to_string()],
            Workers::Remote(names) => ["--workers".into(), names.join(",")],
        };
        let program = std::env::current_exe().context("this program's own file cannot be found")?;
        let folder = TempDir::with_prefix("halflight-study-").context("no temporary folder can be made")?;
        Ok(Self { arguments, program, workers, folder, pictures: None, threads })
    }

    fn measure(&mut self, step: Step, line: &ProgressLine) -> anyhow::Result<Measurement> {
        let [lit, report] = ["lit.glb", "report.json"].map(|name| self.folder.path().join(name));
        let mut command = Command::new(&self.program);
        command
            .arg("solve")
            .arg(&self.arguments.scene)
            .arg("--output")
            .arg(&lit)
            .arg("--report")
            .arg(&report);
        command.args(step.arguments()).args(&self.workers);
        if self.arguments.beside.outside_files {
            command.arg("--outside-files");
        }
        // The arguments say which workers; the variables could contradict them. The port of the metrics is this process's.
        for variable in ["COORDINATOR_WORKERS", "COORDINATOR_THREADS", "COORDINATOR_METRICS"] {
            command.env_remove(variable);
        }
        command.stdin(Stdio::null());
        let clock = Instant::now();
        let answer =
            command.output().with_context(|| format!("{} cannot be started", self.program.display()))?;
        let seconds = clock.elapsed().as_secs_f64();
        let run = || format!("solve {} {}", self.arguments.scene.display(), step.arguments().join(" "));
        anyhow::ensure!(
            answer.status.success(),
            "{} failed ({}):\n{}",
            run(),
            answer.status,
            String::from_utf8_lossy(&answer.stderr).trim_end()
        );
        let text = fs::read_to_string(&report).with_context(|| format!("{} left no report", run()))?;
        let report = RunReport::parse(&text)
            .with_context(|| format!("{} left a report that cannot be read", run()))?;
        let read = self.arguments.beside.read();
        let score = score(&lit, &self.arguments.reference, &self.arguments.scene, &read)?;
        let flip = self.flip(&lit, &read, line)?;
        Ok(Measurement { step, seconds, score, flip, report })
    }

    /// FLIP of a lit file's pictures; none where none are asked for.
    fn flip(&mut self, lit: &Path, read: &ReadOptions, line: &ProgressLine) -> anyhow::Result<Option<Flip>> {
        let paths = self.arguments.picture_paths();
        if paths == 0 {
            return Ok(None);
        }
        let pictures = match self.pictures.take() {
            Some(pictures) => pictures,
            None => Pictures::trace(&self.arguments.scene, lit, read, paths, self.threads, line)
                .context("FLIP has no pictures to compare with: --picture-paths 0 leaves it out")?,
        };
        line.enter("pictures");
        self.pictures.insert(pictures).flip(lit, read)
    }
}

fn describe(workers: &Workers) -> String {
    match workers {
        Workers::Embedded { threads: 1 } => "1 thread".into(),
        Workers::Embedded { threads } => format!("{threads} threads"),
        Workers::Remote(names) => format!("workers {}", names.join(", ")),
    }
}

fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}
