//! References that do not fit, given to `compare` and to `study`.

use std::fs;
use std::path::{Path, PathBuf};

use assert_cmd::Command;
use tests::builder::{Material, SceneBuilder};
use tests::programs::binary;
use tests::shapes;

use super::{Answer, Bench, HANGS};

const HEADER: &str =
    "x,y,z,nx,ny,nz,primitive,radiosity_r,radiosity_g,radiosity_b,stderr_r,stderr_g,stderr_b";

/// In the middle of a wall of the good scene, which has the radiosity 2 everywhere.
const GOOD: &str = "0.5,0.5,0,0,0,1,0,2,2,2,0,0,0";

/// A good scene and what came out of its bake.
struct Lit {
    bench: Bench,
    reference: PathBuf,
}

impl Lit {
    fn new() -> Self {
        let bench = Bench::good();
        let answer = bench.run(&bench.output(), &[]);
        assert!(answer.success, "{}", answer.stderr);
        let reference = bench.folder.path().join("reference.csv");
        Self { bench, reference }
    }

    fn comparison(&self) -> Command {
        let mut command = coordinator("compare");
        command.arg(self.bench.output()).arg("--reference").arg(&self.reference).arg("--scene");
        command.arg(&self.bench.input);
        command
    }

    fn compare(&self) -> Answer {
        answer(&mut self.comparison())
    }

    fn quick_study(&self, output: &Path) -> Command {
        let mut command = coordinator("study");
        command.arg(&self.bench.input).arg("--reference").arg(&self.reference).arg("--quick");
        command.arg("-o").arg(output);
        command
    }

    fn study(&self, output: &Path) -> Answer {
        answer(&mut self.quick_study(output))
    }

    fn write_reference(&self, lines: &[&str]) {
        fs::write(&self.reference, lines.join("\n")).unwrap();
    }
}

fn coordinator(subcommand: &str) -> Command {
    let mut command = Command::new(binary("coordinator"));
    command.arg(subcommand).timeout(HANGS);
    command
}

fn answer(command: &mut Command) -> Answer {
    let output = command.output().unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    Answer { success: output.status.success(), stdout: text(output.stdout), stderr: text(output.stderr) }
}

impl Answer {
    /// Refused with all of these words, and before any bake was run.
    fn assert_refused(&self, words: &[&str]) {
        assert!(!self.success, "not refused: {}", self.stdout);
        self.assert_said(words);
        assert!(self.stderr.starts_with("error: "), "{}", self.stderr);
        assert_eq!(self.stderr.trim_end().lines().count(), 1, "{}", self.stderr);
        assert_eq!(self.stdout, "");
    }
}

#[test]
fn references_that_do_not_fit() {
    let lit = Lit::new();
    lit.write_reference(&[HEADER, GOOD]);
    let good = lit.compare();
    assert!(good.success, "{}", good.stderr);
    let output = lit.bench.folder.path().join("study");
    for (lines, words) in [
        (vec!["x,y,z", GOOD], ["is not a reference", "its first line must be x,y,z,nx"]),
        (vec![], ["is not a reference", "its first line must be"]),
        (vec![HEADER], ["reference.csv", "has no points"]),
        (vec![HEADER, "0.5,0.5"], ["line 2", "expected 13 finite numbers"]),
        // Of another scene: a primitive that is not there, and points where nothing is.
        (vec![HEADER, "0.5,0.5,0,0,0,1,3,2,2,2,0,0,0"], ["primitive 3", "use the scene of the reference"]),
        (vec![HEADER, "5,5,5,0,0,1,0,2,2,2,0,0,0"], ["on no surface of", "good.glb"]),
    ] {
        lit.write_reference(&lines);
        lit.compare().assert_refused(&words);
        lit.study(&output).assert_refused(&words);
    }
    fs::remove_file(&lit.reference).unwrap();
    lit.compare().assert_refused(&["reference.csv", "cannot be read"]);
    lit.study(&output).assert_refused(&["reference.csv", "cannot be read"]);
    assert!(!output.exists(), "a folder was left behind");
}

/// Buffers outside the scene's folder are read where that is allowed, by the runs of a study too.
#[test]
fn scenes_with_files_outside_their_folder() {
    let lit = Lit::new();
    lit.write_reference(&[HEADER, GOOD]);
    // Dark: the runs of a study find nothing to bake, once they have read it.
    let dark = SceneBuilder::new().part("walls", &shapes::unit_room(), Material::grey(0.5));
    let (mut document, buffer) = dark.document();
    document["buffers"][0]["uri"] = "../outside.bin".into();
    let within = lit.bench.folder.path().join("within");
    fs::create_dir(&within).unwrap();
    fs::write(lit.bench.folder.path().join("outside.bin"), buffer).unwrap();
    let scene = within.join("dark.gltf");
    fs::write(&scene, document.to_string()).unwrap();
    let lit = Lit { bench: Bench { input: scene, ..lit.bench }, ..lit };
    let output = lit.bench.folder.path().join("study");
    for refused in [lit.compare(), lit.study(&output)] {
        refused.assert_refused(&["outside.bin", "--outside-files"]);
    }
    let allowed = answer(lit.comparison().arg("--outside-files"));
    assert!(allowed.success, "{}", allowed.stderr);
    let allowed = answer(lit.quick_study(&output).arg("--outside-files"));
    allowed.assert_said(&["dark.gltf --error 0.1 --seed 0 failed", "no light"]);
}

#[test]
fn study_of_no_scene() {
    let lit = Lit::new();
    lit.write_reference(&[HEADER, GOOD]);
    fs::write(&lit.bench.input, "no scene").unwrap();
    lit.study(&lit.bench.folder.path().join("study")).assert_refused(&["good.glb", "is not a glTF"]);
}

#[test]
fn study_without_a_place_to_write() {
    let lit = Lit::new();
    lit.write_reference(&[HEADER, GOOD]);
    lit.study(&lit.reference).assert_refused(&["reference.csv", "cannot be made", "choose another --output"]);
    let taken = lit.bench.folder.path().join("taken");
    fs::create_dir_all(taken.join("study.svg")).unwrap();
    lit.study(&taken).assert_refused(&["study.svg", "is a folder", "choose another --output"]);
    let own = Lit { reference: lit.bench.folder.path().join("study.csv"), bench: lit.bench };
    own.write_reference(&[HEADER, GOOD]);
    own.study(own.bench.folder.path()).assert_refused(&["study.csv", "is the reference itself"]);
}
