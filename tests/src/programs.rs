//! The binaries of the workspace as processes. What is started here ends here.

use std::fs;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdout, Command, ExitStatus, Stdio};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::Duration;

pub use rustix::process::Signal;
use rustix::process::{Pid, kill_process};
use tempfile::TempDir;

/// Where a binary of this workspace is: cargo puts it into the folder above the test's own.
///
/// # Panics
/// When it was not built: then the tests were not run with `cargo test --workspace`.
#[must_use]
pub fn binary(name: &str) -> PathBuf {
    let test = std::env::current_exe().expect("a running program has a path");
    let folder = test.ancestors().nth(2).expect("tests lie two folders deep");
    let path = folder.join(format!("{name}{}", std::env::consts::EXE_SUFFIX));
    assert!(
        path.is_file(),
        "{} is not built: run the tests with `cargo test --workspace`, or build it with `cargo build -p {name}` and \
         the profile of the tests",
        path.display()
    );
    path
}

/// A `worker` process; ends when dropped.
pub struct WorkerProcess {
    child: Child,
    /// Where it listens, `host:port`.
    pub address: String,
    /// Kept open, so that the worker can go on writing.
    _output: BufReader<ChildStdout>,
}

impl WorkerProcess {
    /// Starts a worker on a free port of this machine and waits until it listens.
    ///
    /// # Panics
    /// When it cannot be started, or does not say where it listens.
    #[must_use]
    pub fn start(threads: usize) -> Self {
        Self::start_at("127.0.0.1:0", threads, &[])
    }

    /// The same on a given address, with more arguments.
    ///
    /// # Panics
    /// As [`Self::start`].
    #[must_use]
    pub fn start_at(address: &str, threads: usize, arguments: &[&str]) -> Self {
        let mut child = Command::new(binary("worker"))
            .args(["--listen", address, "--threads", &threads.to_string()])
            .args(arguments)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect("the worker can be started");
        let mut output = BufReader::new(child.stdout.take().expect("standard output is a pipe"));
        let mut line = String::new();
        output.read_line(&mut line).expect("the worker writes text");
        // "worker NAME listens on ADDRESS with N threads"
        let address = line.split_whitespace().skip_while(|word| *word != "on").nth(1);
        let address = address.unwrap_or_else(|| panic!("no address in {line:?}")).to_owned();
        Self { child, address, _output: output }
    }

    /// Sends the process a signal.
    ///
    /// # Panics
    /// When the process has ended and somebody has waited for it.
    pub fn signal(&self, signal: Signal) {
        send(&self.child, signal);
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

impl Drop for WorkerProcess {
    fn drop(&mut self) {
        self.kill();
    }
}

/// Sends a child a signal.
///
/// # Panics
/// When the child has ended and somebody has waited for it.
pub(crate) fn send(child: &Child, signal: Signal) {
    kill_process(Pid::from_child(child), signal).expect("the process is there until it is waited for");
}

/// How long a command may say nothing before it counts as hung.
const HANGS: Duration = Duration::from_secs(180);

/// A command on its way, whose errors are read as they come; ends when dropped.
pub struct Running {
    child: Child,
    lines: mpsc::Receiver<String>,
    said: Vec<String>,
}

impl Running {
    /// Starts a command.
    ///
    /// # Panics
    /// When it cannot be started.
    #[must_use]
    pub fn start(command: &mut Command) -> Self {
        let mut child = command
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the command can be started");
        let output = BufReader::new(child.stderr.take().expect("standard error is a pipe"));
        let (sender, lines) = mpsc::channel();
        std::thread::spawn(move || {
            // The test may have ended.
            output.lines().map_while(Result::ok).try_for_each(|line| sender.send(line))
        });
        Self { child, lines, said: vec![] }
    }

    /// Waits until it says something with this text in it, now or before.
    ///
    /// # Panics
    /// When it ends without, or says nothing for very long.
    pub fn wait_for(&mut self, text: &str) {
        self.wait_for_times(text, 1);
    }

    /// Waits until this number of its lines have this text in them.
    ///
    /// # Panics
    /// As [`Self::wait_for`].
    pub fn wait_for_times(&mut self, text: &str, times: usize) {
        while self.said.iter().filter(|line| line.contains(text)).count() < times {
            match self.lines.recv_timeout(HANGS) {
                Ok(line) => self.said.push(line),
                Err(error) => panic!("{text:?} is missing ({error}) in:\n{}", self.said.join("\n")),
            }
        }
    }

    /// Sends the process a signal.
    ///
    /// # Panics
    /// When the process has ended and somebody has waited for it.
    pub fn signal(&self, signal: Signal) {
        send(&self.child, signal);
    }

    /// Waits until it has ended: whether it says that all is well, and all that it wrote to standard error.
    ///
    /// # Panics
    /// When it says nothing for very long.
    #[must_use]
    pub fn finish(mut self) -> (bool, String) {
        loop {
            match self.lines.recv_timeout(HANGS) {
                Ok(line) => self.said.push(line),
                Err(RecvTimeoutError::Disconnected) => break,
                Err(RecvTimeoutError::Timeout) => panic!("it hangs, after:\n{}", self.said.join("\n")),
            }
        }
        let status = self.child.wait().expect("a child can be waited for");
        (status.success(), self.said.join("\n"))
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A `coordinator solve` process on its way; ends when dropped.
pub struct Solving {
    running: Running,
    folder: TempDir,
}

/// What came of it.
pub struct Solved {
    /// Whether it says that all is well.
    pub success: bool,
    /// The lit file, where there is one.
    pub lit: Option<Vec<u8>>,
    /// The report; null where there is none.
    pub report: serde_json::Value,
    /// All that it wrote to standard error.
    pub said: String,
}

impl Solving {
    /// Starts to bake a scene.
    ///
    /// # Panics
    /// When the coordinator cannot be started.
    #[must_use]
    pub fn start(scene: &Path, arguments: &[&str]) -> Self {
        let folder = tempfile::tempdir().expect("there is room for a folder");
        let running = Running::start(
            Command::new(binary("coordinator"))
                .arg("solve")
                .arg(scene)
                .arg("-o")
                .arg(folder.path().join("lit.glb"))
                .arg("--report")
                .arg(folder.path().join("report.json"))
                .args(arguments)
                // Replicas that workers have are told at once, progress once a second: too late for bakes of seconds.
                .env("RUST_LOG", "warn,cluster::connections::upload=debug"),
        );
        Self { running, folder }
    }

    /// As [`Running::wait_for`].
    pub fn wait_for(&mut self, text: &str) {
        self.running.wait_for(text);
    }

    /// Waits until this number of replicas has been loaded, by all workers together.
    ///
    /// # Panics
    /// As [`Running::wait_for`].
    pub fn wait_for_replicas(&mut self, count: usize) {
        self.running.wait_for_times("replica loaded", count);
    }

    /// As [`Running::signal`].
    pub fn signal(&self, signal: Signal) {
        self.running.signal(signal);
    }

    /// Waits until the bake has ended.
    ///
    /// # Panics
    /// As [`Running::finish`], and when its report is no JSON.
    #[must_use]
    pub fn finish(self) -> Solved {
        let (success, said) = self.running.finish();
        let read = |name: &str| fs::read(self.folder.path().join(name)).ok();
        let report = read("report.json").map(|json| serde_json::from_slice(&json).expect("reports are JSON"));
        Solved { success, lit: read("lit.glb"), report: report.unwrap_or_default(), said }
    }
}
