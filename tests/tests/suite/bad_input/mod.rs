//! The command line on bad input: a message that names the file and the cure, an exit code that is not 0, and nothing
//! half-written.

mod files;
#[cfg(unix)]
mod outputs;
mod references;
mod workers;

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

use assert_cmd::Command;
use tempfile::TempDir;
use tests::builder::{Material, SceneBuilder};
use tests::programs::binary;
use tests::shapes;

/// Far above what any of these runs takes: only what hangs ends here.
const HANGS: Duration = Duration::from_secs(60);

/// A folder with an input file in it.
struct Bench {
    folder: TempDir,
    input: PathBuf,
}

/// What a run of the coordinator said.
struct Answer {
    success: bool,
    stdout: String,
    stderr: String,
}

impl Bench {
    fn new(name: &str, bytes: &[u8]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let input = folder.path().join(name);
        fs::write(&input, bytes).unwrap();
        Self { folder, input }
    }

    /// With a scene that can be baked.
    fn good() -> Self {
        Self::new("good.glb", &good_scene().glb())
    }

    fn output(&self) -> PathBuf {
        self.folder.path().join("lit.glb")
    }

    /// A run of `solve`, to be started.
    fn solve(&self, output: &Path, arguments: &[&str]) -> Command {
        let mut command = Command::new(binary("coordinator"));
        command.arg("solve").arg(&self.input).arg("-o").arg(output).args(arguments).timeout(HANGS);
        command
    }

    fn run(&self, output: &Path, arguments: &[&str]) -> Answer {
        let output = self.solve(output, arguments).output().unwrap();
        let text = |bytes| String::from_utf8(bytes).unwrap();
        Answer { success: output.status.success(), stdout: text(output.stdout), stderr: text(output.stderr) }
    }

    /// Runs `solve`, which must refuse the input with all of these words and leave the folder as it was.
    fn assert_refused(&self, output: &Path, arguments: &[&str], words: &[&str]) {
        let answer = self.run(output, arguments);
        assert!(!answer.success, "not refused");
        answer.assert_said(words);
        // Warnings may come before.
        let last = answer.stderr.lines().last().unwrap_or_default();
        assert!(last.starts_with("error: "), "{}", answer.stderr);
        self.assert_nothing_written();
    }

    /// The input's own file is refused, with its path in the message.
    fn assert_input_refused(&self, words: &[&str]) {
        let input = self.input.display().to_string();
        self.assert_refused(&self.output(), &[], &[&[input.as_str()], words].concat());
    }

    fn assert_nothing_written(&self) {
        let names: Vec<_> =
            fs::read_dir(self.folder.path()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
        assert_eq!(names, [self.input.file_name().unwrap()], "files were left behind");
    }
}

impl Answer {
    fn assert_said(&self, words: &[&str]) {
        for word in words {
            assert!(self.stderr.contains(word), "{word:?} is missing in: {}", self.stderr);
        }
        assert!(!self.stderr.contains("panicked"), "{}", self.stderr);
    }
}

/// A room that bakes in no time.
fn good_scene() -> SceneBuilder {
    SceneBuilder::new().part("walls", &shapes::unit_room(), Material::grey(0.5).emitting(1.0))
}
