//! A scene baked by a process of its own.

use std::fs;
use std::io::{Read, Seek};
use std::os::unix::process::ExitStatusExt;
use std::path::Path;
use std::process::{Command, ExitStatus, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use serde_json::Value;

use super::Nasty;
use crate::programs::{Signal, binary, send};

/// How often a process is looked at.
const LOOK: Duration = Duration::from_millis(5);

/// What came of a bake.
pub struct Bake {
    /// How the process ended.
    pub end: End,
    /// All that it wrote to standard error.
    pub said: String,
    /// The report; null where there is none.
    pub report: Value,
    /// The lit file, where there is one.
    pub lit: Option<Vec<u8>>,
    /// Names of files that are neither scene, lit file nor report.
    pub left: Vec<String>,
    /// Seconds from start to end.
    pub seconds: f64,
    /// Seconds from SIGTERM to the end, where one was sent before it.
    pub stopping_seconds: Option<f64>,
    /// Most memory that the process held, in bytes; 0 where the system does not count it.
    pub peak_bytes: u64,
}

/// How a process ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum End {
    /// With this code.
    Code(i32),
    /// By this signal.
    Signal(i32),
    /// Killed here, since it took too long.
    TooLong,
}

impl From<ExitStatus> for End {
    fn from(status: ExitStatus) -> Self {
        status.code().map_or_else(|| Self::Signal(status.signal().unwrap_or_default()), Self::Code)
    }
}

/// Bakes a scene by `coordinator solve`, on two threads. Sends SIGTERM after `stop`, and kills the process after `most`.
///
/// # Panics
/// When the process cannot be started, or files not be written.
#[must_use]
pub fn bake(nasty: &Nasty, stop: Option<Duration>, most: Duration) -> Bake {
    let folder = tempfile::tempdir().expect("there is room for a folder");
    let place = |name: &str| folder.path().join(name);
    fs::write(place("scene.glb"), &nasty.glb).expect("there is room for a scene");
    let mut said = tempfile::tempfile().expect("there is room for a file");
    let mut child = Command::new(binary("coordinator"))
        .arg("solve")
        .arg(place("scene.glb"))
        .arg("-o")
        .arg(place("lit.glb"))
        .arg("--report")
        .arg(place("report.json"))
        .args(&nasty.options)
        .args(["--threads", "2"])
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(said.try_clone().expect("a file has two handles"))
        .spawn()
        .expect("the coordinator can be started");
    let clock = Instant::now();
    let (mut peak_bytes, mut stopped) = (0, None);
    let end = loop {
        peak_bytes = peak_bytes.max(most_bytes(child.id()));
        if let Some(status) = child.try_wait().expect("a child can be waited for") {
            break End::from(status);
        }
        if stopped.is_none() && stop.is_some_and(|stop| clock.elapsed() >= stop) {
            send(&child, Signal::TERM);
            stopped = Some(Instant::now());
        }
        if clock.elapsed() > most {
            // It may have ended by itself.
            let _ = child.kill();
            let _ = child.wait();
            break End::TooLong;
        }
        sleep(LOOK);
    };
    let seconds = clock.elapsed().as_secs_f64();
    let mut text = String::new();
    said.rewind().and_then(|()| said.read_to_string(&mut text)).expect("it writes text");
    let report: Value = fs::read(place("report.json"))
        .ok()
        .map(|json| serde_json::from_slice(&json).expect("reports are JSON"))
        .unwrap_or_default();
    Bake {
        end,
        said: text,
        peak_bytes: peak_bytes.max(report["peak_memory_bytes"].as_u64().unwrap_or(0)),
        report,
        lit: fs::read(place("lit.glb")).ok(),
        left: others(folder.path()),
        seconds,
        stopping_seconds: stopped.map(|at| at.elapsed().as_secs_f64()),
    }
}

/// Names of files in a folder that are not expected there.
fn others(folder: &Path) -> Vec<String> {
    let names = fs::read_dir(folder).expect("the folder is there").flatten();
    names
        .map(|entry| entry.file_name().to_string_lossy().into_owned())
        .filter(|name| !["scene.glb", "lit.glb", "report.json"].contains(&name.as_str()))
        .collect()
}

/// Most memory that a process held so far, in bytes, where the system counts it.
fn most_bytes(process: u32) -> u64 {
    let status = fs::read_to_string(format!("/proc/{process}/status")).unwrap_or_default();
    let kib = status.lines().find_map(|line| line.strip_prefix("VmHWM:")?.trim().strip_suffix(" kB"));
    kib.and_then(|kib| kib.parse().ok()).map_or(0, |kib: u64| kib << 10)
}
