use std::fs;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::Duration;

use rustix::process::{Pid, kill_process};
use tests::programs::{Signal, Solved, Solving, binary};

use super::Cornell;

/// A second of one thread: what goes wrong does so when there are so many bytes, not at a time.
static SHORT: Cornell = Cornell::new(["--mesh-error", "0.008"]);

/// Checkpoints of the bake grow to five times this.
const FIRST_KILL: u64 = 2 << 20;

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn checkpoint(&self) -> PathBuf {
        self.0.path().join("rows")
    }
}

fn length(path: &Path) -> u64 {
    fs::metadata(path).map_or(0, |metadata| metadata.len())
}

/// Starts the bake and kills it when its checkpoint has so many bytes; their number then.
fn killed_at(checkpoint: &Path, bytes: u64) -> u64 {
    let solving = SHORT.bake(&["--threads", "2", "--checkpoint", checkpoint.to_str().unwrap()]);
    while length(checkpoint) < bytes {
        sleep(Duration::from_millis(2));
    }
    solving.signal(Signal::KILL);
    let solved = solving.finish();
    assert!(!solved.success && solved.lit.is_none(), "it was over before it was killed");
    length(checkpoint)
}

/// Bakes to the end; what became of it, and rows read from the checkpoint and added to it.
fn resumed(checkpoint: &Path, more: &[&str]) -> (Solved, u64, u64) {
    let arguments = ["--threads", "2", "--checkpoint", checkpoint.to_str().unwrap()];
    let solved = SHORT.bake(&[&arguments, more].concat()).finish();
    SHORT.assert_undisturbed(&solved);
    let count = |name: &str| solved.report["checkpoint"][name].as_u64().unwrap();
    let (read, written) = (count("rows_read"), count("rows_written"));
    (solved, read, written)
}

#[test]
fn a_killed_coordinator_goes_on_where_it_was() {
    let folder = Folder::new();
    let checkpoint = folder.checkpoint();
    let first = killed_at(&checkpoint, FIRST_KILL);
    let second = killed_at(&checkpoint, 2 * first);
    assert!(second > first);
    let (solved, read, written) = resumed(&checkpoint, &[]);
    assert!(read > 0 && written > 0, "{read} rows read, {written} written");
    assert_eq!(solved.report["bake"]["rows"], read + written, "some rows were made twice");
    assert!(!checkpoint.exists(), "it is removed when all is done");
}

/// In a container the coordinator is process 1, to which the system delivers only signals that it listens for.
#[test]
fn a_signal_ends_process_one_and_its_rows_are_kept() {
    const NAMESPACE: [&str; 4] = ["--pid", "--fork", "--kill-child", "--"];
    let possible = Command::new("unshare").args(NAMESPACE).arg("true").status();
    if !possible.is_ok_and(|status| status.success()) {
        println!("skipped: a process cannot be the first of its own here");
        return;
    }
    let folder = Folder::new();
    let checkpoint = folder.checkpoint();
    for signal in [Signal::TERM, Signal::INT] {
        let before = length(&checkpoint);
        let mut unshare = Command::new("unshare")
            .args(NAMESPACE)
            .arg(binary("coordinator"))
            .args([Path::new("solve"), &tests::data("scenes/cornell.glb"), Path::new("-o")])
            .args([&folder.0.path().join("lit.glb"), Path::new("--checkpoint"), &checkpoint])
            .args(SHORT.knobs)
            .args(["--threads", "2"])
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        while length(&checkpoint) < before + FIRST_KILL {
            sleep(Duration::from_millis(2));
        }
        let children = format!("/proc/{0}/task/{0}/children", unshare.id());
        let first = fs::read_to_string(children).unwrap().trim().parse().unwrap();
        kill_process(Pid::from_raw(first).unwrap(), signal).unwrap();
        let mut said = String::new();
        unshare.stderr.take().unwrap().read_to_string(&mut said).unwrap();
        assert_eq!(unshare.wait().unwrap().code(), Some(128 + signal.as_raw()), "{said}");
        assert!(said.contains("stopped by SIG") && said.contains("the same command goes on"), "{said}");
    }
    let (_, read, written) = resumed(&checkpoint, &[]);
    assert!(read > 0 && written > 0, "{read} rows read, {written} written");
}

/// Kept, it spares another bake all of its rows, by whatever workers.
#[test]
fn a_kept_checkpoint_holds_all_rows() {
    let folder = Folder::new();
    let checkpoint = folder.checkpoint();
    let (_, read, written) = resumed(&checkpoint, &["--keep-checkpoint"]);
    assert_eq!(read, 0);
    let arguments = ["--threads", "1", "--checkpoint", checkpoint.to_str().unwrap()];
    let solved = SHORT.bake(&arguments).finish();
    SHORT.assert_undisturbed(&solved);
    assert_eq!(solved.report["checkpoint"]["rows_read"], written);
    assert_eq!(solved.report["checkpoint"]["rows_written"], 0);
}

#[test]
fn a_torn_checkpoint_is_good_up_to_the_tear() {
    let folder = Folder::new();
    let checkpoint = folder.checkpoint();
    let bytes = killed_at(&checkpoint, FIRST_KILL);
    let torn = folder.0.path().join("torn");
    for length in [0, 10, bytes / 3, bytes - 1] {
        let whole = fs::read(&checkpoint).unwrap();
        fs::write(&torn, &whole[..length as usize]).unwrap();
        let (_, read, written) = resumed(&torn, &[]);
        assert!(
            written > 0 && (read > 0) == (length > 1000),
            "{length} bytes: {read} read, {written} written"
        );
    }
}

/// A row that changed on the disk is computed again, and the others are not.
#[test]
fn a_damaged_checkpoint() {
    let folder = Folder::new();
    let checkpoint = folder.checkpoint();
    let bytes = killed_at(&checkpoint, FIRST_KILL);
    let (mut damaged, torn) = (fs::read(&checkpoint).unwrap(), folder.0.path().join("torn"));
    damaged[bytes as usize / 2] ^= 4;
    fs::write(&torn, &damaged).unwrap();
    let (_, read, _) = resumed(&checkpoint, &[]);
    let (_, read_of_damaged, written) = resumed(&torn, &[]);
    assert!(written > 0 && read_of_damaged < read, "{read_of_damaged} of {read} read, {written} written");
}

#[test]
fn the_checkpoint_of_another_scene_does_no_harm() {
    let folder = Folder::new();
    let checkpoint = folder.checkpoint();
    killed_at(&checkpoint, FIRST_KILL);
    let scene = tests::data("scenes/table.glb");
    let knobs = ["--threads", "2", "--mesh-error", "0.05"];
    let kept = ["--checkpoint", checkpoint.to_str().unwrap(), "--keep-checkpoint"];
    let without = Solving::start(&scene, &knobs).finish();
    let with = Solving::start(&scene, &[&knobs[..], &kept].concat()).finish();
    assert!(with.success && with.lit == without.lit, "{}", with.said);
    assert_eq!(with.report["checkpoint"]["rows_read"], 0);
    // It now holds rows of both.
    assert!(resumed(&checkpoint, &[]).1 > 0);
}

#[test]
fn two_bakes_do_not_share_a_checkpoint() {
    let folder = Folder::new();
    let checkpoint = folder.checkpoint();
    let arguments = ["--threads", "2", "--checkpoint", checkpoint.to_str().unwrap()];
    let first = SHORT.bake(&arguments);
    while length(&checkpoint) == 0 {
        sleep(Duration::from_millis(2));
    }
    let second = SHORT.bake(&arguments).finish();
    assert!(!second.success && second.said.contains("in use by another bake"), "{}", second.said);
    SHORT.assert_undisturbed(&first.finish());
}

#[test]
fn a_limit_is_kept() {
    let folder = Folder::new();
    let (solved, _, written) = resumed(&folder.checkpoint(), &["--checkpoint-size", "2"]);
    assert!(written > 0);
    assert!(solved.report["checkpoint"]["bytes"].as_u64().unwrap() <= 2 << 20);
    assert!(solved.said.contains("--checkpoint-size"), "{}", solved.said);
}

/// The bake goes on without it, and says so.
#[test]
fn a_full_disk() {
    let folder = Folder::new();
    let small = folder.0.path().join("small");
    fs::create_dir(&small).unwrap();
    let mounted = Command::new("mount").args(["-t", "tmpfs", "-o", "size=1m", "tmpfs"]).arg(&small).status();
    if !mounted.is_ok_and(|status| status.success()) {
        println!("skipped: a file system of one megabyte cannot be mounted here");
        return;
    }
    let _mounted = Mounted(&small);
    let (solved, _, written) = resumed(&small.join("rows"), &["--keep-checkpoint"]);
    assert!(written > 0);
    let stopped = solved.report["checkpoint"]["stopped"].as_str().unwrap();
    assert!(stopped.contains("No space left"), "{stopped}");
    assert!(
        solved.said.contains("the bake goes on") && solved.said.contains("No space left"),
        "{}",
        solved.said
    );
    // What is on the small disk is good.
    let moved = folder.checkpoint();
    fs::copy(small.join("rows"), &moved).unwrap();
    let (_, read, _) = resumed(&moved, &[]);
    assert_eq!(read, written);
}

/// The same without a file system of its own: no file may grow beyond a limit, which is less than the checkpoint takes and more
/// than the lit file.
#[test]
fn a_file_that_may_not_grow() {
    let folder = Folder::new();
    let limit = SHORT.expected().len() * 5 / 4;
    let [checkpoint, output, report] =
        ["rows", "lit.glb", "report.json"].map(|name| folder.0.path().join(name));
    // The signal that would end the process is ignored: writing fails instead, as on a full disk.
    let script = format!("trap '' XFSZ; ulimit -f {}; exec \"$@\"", limit.div_ceil(512));
    let solved = Command::new("sh")
        .args(["-c", &script, "sh"])
        .arg(binary("coordinator"))
        .arg("solve")
        .arg(tests::data("scenes/cornell.glb"))
        .args([Path::new("-o"), &output, Path::new("--report"), &report])
        .args([Path::new("--checkpoint"), &checkpoint, Path::new("--keep-checkpoint")])
        .args(SHORT.knobs)
        .args(["--threads", "2"])
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&solved.stderr);
    assert!(solved.status.success(), "{said}");
    assert_eq!(said.matches("the bake goes on").count(), 1, "{said}");
    assert!(said.contains(checkpoint.to_str().unwrap()), "{said}");
    assert!(fs::read(&output).unwrap() == SHORT.expected(), "the lit file differs; {said}");
    let report: serde_json::Value = serde_json::from_slice(&fs::read(&report).unwrap()).unwrap();
    assert!(report["checkpoint"]["stopped"].as_str().unwrap().contains("too large"), "{report}");
    // What was written is good.
    let (_, read, written) = resumed(&checkpoint, &[]);
    assert!(read > 0 && written > 0 && read == report["checkpoint"]["rows_written"]);
}

struct Mounted<'a>(&'a Path);

impl Drop for Mounted<'_> {
    fn drop(&mut self) {
        // What is left is removed with its folder.
        let _ = Command::new("umount").arg(self.0).status();
    }
}
