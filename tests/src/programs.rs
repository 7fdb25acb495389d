//! The binaries of the workspace as processes. What is started here ends here.

use std::io::{BufRead, BufReader};
use std::path::PathBuf;
use std::process::{Child, ChildStdout, Command, Stdio};

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
        let mut child = Command::new(binary("worker"))
            .args(["--listen", "127.0.0.1:0", "--threads", &threads.to_string()])
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

    /// Ends the process at once, as a machine that loses its power.
    pub fn kill(&mut self) {
        // It may have ended by itself.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Drop for WorkerProcess {
    fn drop(&mut self) {
        self.kill();
    }
}
