//! A coordinator as a service, and its commands.

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdout, Command, ExitStatus, Output, Stdio};

use crate::programs::{Signal, binary, send};

/// A `coordinator` that serves clients; ends when dropped.
pub struct ServiceProcess {
    child: Child,
    /// Where it listens, `host:port`.
    pub address: String,
    /// Kept open, so that it can go on writing.
    _output: BufReader<ChildStdout>,
}

impl ServiceProcess {
    /// Starts a service on a free port, with two threads to compute, and waits until it listens.
    ///
    /// # Panics
    /// When it cannot be started, or does not say where it listens.
    #[must_use]
    pub fn start(data: &Path, arguments: &[&str]) -> Self {
        Self::try_start(data, arguments).unwrap_or_else(|line| panic!("no address in {line:?}"))
    }

    /// The same, where it may refuse: what it said on standard output then.
    ///
    /// # Errors
    /// When it does not say where it listens.
    ///
    /// # Panics
    /// When it cannot be started.
    pub fn try_start(data: &Path, arguments: &[&str]) -> Result<Self, String> {
        Self::run(Command::new(binary("coordinator")), data, arguments)
    }

    /// The same through a shell that first does this.
    ///
    /// # Errors
    /// As [`Self::try_start`].
    ///
    /// # Panics
    /// When it cannot be started.
    pub fn start_after(script: &str, data: &Path, arguments: &[&str]) -> Result<Self, String> {
        let mut command = Command::new("sh");
        command.args(["-c", &format!("{script}; exec \"$@\""), "sh"]).arg(binary("coordinator"));
        Self::run(command, data, arguments)
    }

    fn run(mut command: Command, data: &Path, arguments: &[&str]) -> Result<Self, String> {
        for (option, value) in [("--threads", "2"), ("--listen", "127.0.0.1:0"), ("--keep-free", "0")] {
            if !arguments.contains(&option) {
                command.args([option, value]);
            }
        }
        let mut child = command
            .arg("--data")
            .arg(data)
            .args(arguments)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect("the coordinator can be started");
        let mut output = BufReader::new(child.stdout.take().expect("standard output is a pipe"));
        let mut line = String::new();
        output.read_line(&mut line).expect("it writes text");
        // "coordinator serves on ADDRESS, data in FOLDER"
        let address = line.split_whitespace().skip_while(|word| *word != "on").nth(1);
        let Some(address) = address.map(|address| address.trim_end_matches(',').to_owned()) else {
            let _ = child.kill();
            let _ = child.wait();
            return Err(line);
        };
        Ok(Self { child, address, _output: output })
    }

    /// Runs a command of the coordinator's that asks this service.
    ///
    /// # Panics
    /// When it cannot be started.
    #[must_use]
    pub fn ask(&self, arguments: &[&str]) -> Said {
        let output = asking(&self.address, arguments).stdin(Stdio::null()).output();
        Said::from(output.expect("the coordinator can be started"))
    }

    /// Submits a scene: the name of its job.
    ///
    /// # Panics
    /// When it is refused.
    #[must_use]
    pub fn submit(&self, scene: &Path, arguments: &[&str]) -> String {
        let scene = scene.to_str().expect("paths of tests are text");
        let said = self.ask(&[&["submit", scene], arguments].concat());
        assert!(said.success, "{}", said.errors);
        said.text.trim().to_owned()
    }

    /// The lit file of a job, when it is done.
    ///
    /// # Panics
    /// When it fails.
    #[must_use]
    pub fn result(&self, job: &str) -> Vec<u8> {
        let watched = self.ask(&["watch", job]);
        assert!(watched.success, "{}", watched.errors);
        let folder = tempfile::tempdir().expect("there is room for a folder");
        let path: PathBuf = folder.path().join("lit.glb");
        let fetched = self.ask(&["fetch", job, "-o", path.to_str().expect("paths of tests are text")]);
        assert!(fetched.success, "{}", fetched.errors);
        std::fs::read(path).expect("it was written")
    }

    /// Sends the process a signal.
    ///
    /// # Panics
    /// When the process has ended and somebody has waited for it.
    pub fn signal(&self, signal: Signal) {
        send(&self.child, signal);
    }

    /// The process, for those who measure it.
    #[must_use]
    pub fn id(&self) -> u32 {
        self.child.id()
    }

    /// Ends the process at once, as a machine that loses its power.
    pub fn kill(&mut self) {
        // It may have ended by itself.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }

    /// Waits until the process has ended by itself.
    ///
    /// # Panics
    /// When the system does not say.
    pub fn wait(&mut self) -> ExitStatus {
        self.child.wait().expect("a child can be waited for")
    }
}

impl Drop for ServiceProcess {
    fn drop(&mut self) {
        self.kill();
    }
}

/// A command of the coordinator's that asks the service at this address.
#[must_use]
pub fn asking(address: &str, arguments: &[&str]) -> Command {
    let mut command = Command::new(binary("coordinator"));
    command.args(arguments).args(["--server", address]);
    command
}

/// What a command said.
pub struct Said {
    /// Whether all is well.
    pub success: bool,
    /// Its output.
    pub text: String,
    /// Its errors.
    pub errors: String,
}

impl From<Output> for Said {
    fn from(output: Output) -> Self {
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        Self { success: output.status.success(), text: text(&output.stdout), errors: text(&output.stderr) }
    }
}
