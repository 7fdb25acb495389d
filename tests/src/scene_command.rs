//! A command that reads a scene and writes a file, run as a user does.

use std::fs;
use std::path::{Path, PathBuf};

use assert_cmd::Command;
use tempfile::TempDir;

use crate::programs::binary;

/// A folder with a scene in it, and a command of `coordinator` that reads it.
pub struct SceneCommand {
    /// The folder.
    pub folder: TempDir,
    /// The scene's file.
    pub scene: PathBuf,
    /// Name of the command.
    pub name: &'static str,
}

impl SceneCommand {
    /// For the command `name`, with these bytes as the scene.
    ///
    /// # Panics
    /// When there is no folder to write to.
    #[must_use]
    pub fn new(name: &'static str, glb: &[u8]) -> Self {
        let folder = tempfile::tempdir().expect("there is room for a folder");
        let scene = folder.path().join("scene.glb");
        fs::write(&scene, glb).expect("there is room for a scene");
        Self { folder, scene, name }
    }

    /// A path in the folder.
    #[must_use]
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// The command with these arguments.
    #[must_use]
    pub fn command(&self, output: &Path, arguments: &[&str]) -> Command {
        let mut command = Command::new(binary("coordinator"));
        command.arg(self.name).arg(&self.scene).arg("-o").arg(output).args(arguments);
        command
    }

    /// Must refuse, say all of this, and write nothing.
    ///
    /// # Panics
    /// When it does not.
    pub fn assert_refused(&self, output: &Path, arguments: &[&str], words: &[&str]) {
        let files = || fs::read_dir(self.folder.path()).expect("the folder is there").count();
        let before = files();
        let answer = self.command(output, arguments).output().expect("the command runs");
        let said = String::from_utf8(answer.stderr).expect("it speaks UTF-8");
        assert!(!answer.status.success(), "not refused");
        for word in words {
            assert!(said.contains(word), "{word:?} is missing in: {said}");
        }
        assert!(!said.contains("panicked"), "{said}");
        // A cause is told once.
        assert!(said.matches("os error").count() <= 1, "{said}");
        assert_eq!(files(), before, "files were left behind");
    }
}
