//! A whole study of a small room: its runs, its figures, its files.

use std::fs;
use std::path::{Path, PathBuf};

use assert_cmd::Command;
use glam::DVec3;
use tempfile::TempDir;
use tests::builder::{Material, SceneBuilder};
use tests::programs::binary;
use tests::{data, shapes};

/// A folder with a scene and a reference.
struct Bench {
    folder: TempDir,
}

impl Bench {
    fn new(scene: &SceneBuilder) -> Self {
        let bench = Self { folder: tempfile::tempdir().unwrap() };
        fs::write(bench.scene(), scene.glb()).unwrap();
        bench
    }

    fn scene(&self) -> PathBuf {
        self.folder.path().join("room.glb")
    }

    fn reference(&self) -> PathBuf {
        self.folder.path().join("room.csv")
    }

    /// A quick study, to be started.
    fn study(&self, output: &Path) -> Command {
        let mut command = coordinator("study");
        command
            .arg(self.scene())
            .arg("--reference")
            .arg(self.reference())
            .arg("-o")
            .arg(output)
            .arg("--quick");
        command
    }
}

fn coordinator(subcommand: &str) -> Command {
    let mut command = Command::new(binary("coordinator"));
    command.arg(subcommand);
    command
}

/// A line of the CSV, by the names of its columns.
struct Line<'a> {
    header: &'a str,
    line: &'a str,
}

impl Line<'_> {
    fn field(&self, name: &str) -> &str {
        let column = self.header.split(',').position(|column| column == name);
        self.line.split(',').nth(column.unwrap_or_else(|| panic!("no {name} in {}", self.header))).unwrap()
    }

    fn number(&self, name: &str) -> f64 {
        self.field(name).parse().unwrap_or_else(|_| panic!("{name} in {}", self.line))
    }
}

#[test]
fn quick_study_writes_its_three_files() {
    let board = [[0.4, 0.1, 0.4], [0.4, 0.1, 0.6], [0.6, 0.1, 0.6], [0.6, 0.1, 0.4]].map(DVec3::from_array);
    let room = SceneBuilder::new()
        .part("walls", &shapes::unit_room(), Material::grey(0.5))
        .part("board", &[board.to_vec()], Material::grey(0.5).double_sided())
        .point_light(DVec3::new(0.5, 0.7, 0.5), 1.0);
    let bench = Bench::new(&room);
    let few = ["--points", "200", "--paths", "2048"];
    coordinator("reference").arg(bench.scene()).arg("-o").arg(bench.reference()).args(few).assert().success();
    // An older file of a study is in the way.
    let output = bench.folder.path().join("new/study");
    fs::create_dir_all(&output).unwrap();
    fs::write(output.join("study.csv"), "older").unwrap();
    let answer = bench
        .study(&output)
        .args(["--threads", "2", "--seeds", "2", "--picture-paths", "4"])
        .output()
        .unwrap();
    let said = String::from_utf8(answer.stderr).unwrap();
    assert!(answer.status.success(), "{said}");
    assert!(
        said.contains("13/13 seeds, --exact-occluders 0 --rays 256 --mesh-error 0.005 --seed 1: "),
        "{said}"
    );
    let mut files: Vec<_> = fs::read_dir(&output).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    files.sort();
    assert_eq!(files, ["study.csv", "study.md", "study.svg"]);

    let csv = fs::read_to_string(output.join("study.csv")).unwrap();
    let (header, lines) = csv.split_once('\n').unwrap();
    let lines: Vec<Line> = lines.lines().map(|line| Line { header, line }).collect();
    assert_eq!(lines.len(), 13);
    for line in &lines {
        for positive in [
            "seconds",
            "relative_l2",
            "p95",
            "flip_mean",
            "estimated_error",
            "vertices",
            "rows",
            "form_factors",
        ] {
            assert!(line.number(positive) > 0.0, "{positive} in {}", line.line);
        }
        let sampled = line.field("curve") == "rays";
        assert_eq!(line.number("pairs_sampled") > 0.0, sampled, "{}", line.line);
        #[cfg(target_os = "linux")]
        assert!((1e6..1e10).contains(&line.number("peak_memory_bytes")), "{}", line.line);
    }
    let error = |curve: &str, value: &str| {
        let of_setting = |line: &&Line| (line.field("curve"), line.field("value")) == (curve, value);
        lines.iter().find(of_setting).unwrap_or_else(|| panic!("no {curve} {value}")).number("relative_l2")
    };
    // The knobs do what they should: finer is more exact, and the defaults are good to the 3 % that whole scenes are held to.
    for (curve, coarse, fine) in [("together", "0.1", "0.03"), ("depth", "0.1", "0.02")] {
        assert!(error(curve, fine) < error(curve, coarse), "{curve}: {csv}");
    }
    assert!(error("defaults", "") < 0.03, "{csv}");
    let seeds: Vec<&str> =
        lines.iter().filter(|line| line.field("part") == "seeds").map(|line| line.field("seed")).collect();
    assert_eq!(seeds, ["0", "1", "0", "1"]);

    let tables = fs::read_to_string(output.join("study.md")).unwrap();
    assert_eq!(String::from_utf8(answer.stdout).unwrap().trim_end(), tables.trim_end());
    for word in ["room.glb", "2 threads", "| knob | 10 % | 5 % | 3 % | 2 % | 1 % |", "| defaults | 2 |"] {
        assert!(tables.contains(word), "{word:?} is missing in {tables}");
    }
    let plot = fs::read_to_string(output.join("study.svg")).unwrap();
    assert!(plot.starts_with("<svg") && plot.contains("room.glb: error over time"), "{plot}");
}

/// What stops one run stops the study, with what that run said.
#[test]
fn run_that_fails_is_told_and_nothing_is_written() {
    // In the dark: the reference fits the surfaces, but there is nothing to bake.
    let dark = SceneBuilder::new().part("walls", &shapes::unit_room(), Material::grey(0.5));
    let bench = Bench::new(&dark);
    let header = fs::read_to_string(data("references/cornell.reference.csv")).unwrap();
    let header = header.lines().next().unwrap();
    fs::write(bench.reference(), format!("{header}\n0.5,0.5,0,0,0,1,0,1,1,1,0,0,0\n")).unwrap();
    let output = bench.folder.path().join("study");
    let answer = bench.study(&output).output().unwrap();
    let said = String::from_utf8(answer.stderr).unwrap();
    assert!(!answer.status.success());
    for word in ["error: solve ", "room.glb --error 0.1 --seed 0 failed", "no light", "emissiveFactor"] {
        assert!(said.contains(word), "{word:?} is missing in: {said}");
    }
    assert_eq!(fs::read_dir(&output).unwrap().count(), 0);
}
