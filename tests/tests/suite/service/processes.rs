use std::fs;
use std::path::PathBuf;

use glam::{DMat4, DVec3};
use rustix::process::{Pid, Signal, kill_process};
use serde_json::json;
use tests::builder::{Material, SceneBuilder, pack};
use tests::programs::WorkerProcess;
use tests::service::ServiceProcess;

use super::{QUICK, Room, cornell, wait_for};

/// The processes that a process has started.
fn children(parent: u32) -> Vec<u32> {
    let processes = fs::read_dir("/proc").unwrap();
    let ids = processes.filter_map(|entry| entry.ok()?.file_name().to_str()?.parse().ok());
    ids.filter(|id: &u32| {
        let status = fs::read_to_string(format!("/proc/{id}/stat")).unwrap_or_default();
        // ID (NAME) STATE PARENT
        let mut fields = status.rsplit(')').next().unwrap_or_default().split_whitespace();
        fields.nth(1) == Some(&parent.to_string())
    })
    .collect()
}

/// The process of the job that runs, once it is there.
fn running(service: &ServiceProcess) -> u32 {
    let mut found = None;
    wait_for("the job has a process", || {
        found = children(service.id()).first().copied();
        found.is_some()
    });
    found.unwrap()
}

fn kill_running(service: &ServiceProcess) {
    let process = running(service);
    kill_process(Pid::from_raw(process as i32).unwrap(), Signal::KILL).unwrap();
    wait_for("the process has ended", || !children(service.id()).contains(&process));
}

/// So many triangles over a floor, under a lamp.
fn many_triangles(room: &Room, number: usize) -> PathBuf {
    let side = ((number / 2) as f64).sqrt() as usize;
    let tile = |index: usize| {
        let (x, z) = ((index % side) as f64, (index / side) as f64);
        // No two in one plane: nothing of it becomes one region.
        let y = 0.4 * (x * 12.9898 + z * 78.233).sin();
        let corner = DVec3::new(x, y, z);
        [DVec3::ZERO, DVec3::Z, DVec3::new(1.0, 0.0, 1.0), DVec3::X].map(|to| corner + 0.9 * to).to_vec()
    };
    let tiles: Vec<_> = (0..side * side).map(tile).collect();
    let scene = SceneBuilder::new().part("tiles", &tiles, Material::grey(0.5));
    let scene =
        scene.point_light(DVec3::new(1.0, 5.0, 1.0), 100.0).all_placed(DMat4::from_scale(DVec3::splat(0.1)));
    room.file("many.glb", &scene.glb())
}

/// A job with a scene that no worker takes fails with the cure, and the next is done by the same worker.
#[test]
fn a_job_that_is_too_large_for_the_workers_fails_alone() {
    let room = Room::new();
    let worker = WorkerProcess::start_at("127.0.0.1:0", 2, &["--replica-bytes", "1600000"]);
    let service = room.start(&["--workers", &worker.address, "--jobs", "2"]);
    let large = service.submit(&many_triangles(&room, 20_000), &["--mesh-error", "1"]);
    let small = service.submit(&cornell(), &QUICK);
    let failed = service.ask(&["watch", &large]);
    assert!(!failed.success);
    assert!(
        failed.errors.contains("--replica-bytes") && failed.errors.contains("400000"),
        "{}",
        failed.errors
    );
    assert!(!service.result(&small).is_empty());
    assert!(!service.result(&service.submit(&cornell(), &QUICK)).is_empty());
}

/// A job that takes more memory than it may fails with the cure, and the next is done by the same service.
#[test]
fn a_job_that_needs_too_much_memory_fails_alone() {
    let room = Room::new();
    let service = room.start(&["--memory-per-job", "96", "--jobs", "2"]);
    let large = service.submit(&many_triangles(&room, 100_000), &[]);
    let small = service.submit(&cornell(), &QUICK);
    let failed = service.ask(&["watch", &large]);
    assert!(!failed.success);
    assert!(
        failed.errors.contains("--memory-per-job") && failed.errors.contains("96 MiB"),
        "{}",
        failed.errors
    );
    assert!(!service.result(&small).is_empty());
    wait_for("all processes of jobs have ended", || children(service.id()).is_empty());
}

/// Three hundred kilobytes that show a mesh of six thousand triangles four thousand times. The file is enough to see that.
#[test]
fn a_job_whose_file_tells_that_it_is_too_large_is_not_begun() {
    let room = Room::new();
    let service = room.start(&["--memory-per-job", "200"]);
    let triangle = [DVec3::ZERO, DVec3::X, DVec3::Y].to_vec();
    let scene = SceneBuilder::new().part("tiles", &vec![triangle; 6000], Material::grey(0.5).emitting(1.0));
    let (mut document, binary) = scene.document();
    let nodes: Vec<_> = (0..4000).map(|x| json!({ "mesh": 0, "translation": [x, 0, 0] })).collect();
    document["scenes"][0]["nodes"] = (0..nodes.len()).collect();
    document["nodes"] = nodes.into();
    let job = service.submit(&room.file("many.glb", &pack(&document, &binary)), &[]);
    let failed = service.ask(&["watch", &job]);
    assert!(!failed.success && failed.errors.contains("MiB of memory at least"), "{}", failed.errors);
}

/// Whoever kills a job's process, the job resumes; after three times it is given up, with the reason.
#[test]
fn a_job_is_given_up_when_its_process_was_killed_three_times() {
    let room = Room::new();
    let service = room.start(&[]);
    let job = service.submit(&many_triangles(&room, 10_000), &[]);
    for _ in 0..3 {
        kill_running(&service);
    }
    let failed = service.ask(&["watch", &job]);
    assert!(!failed.success);
    assert!(failed.errors.contains("given up after 3 times"), "{}", failed.errors);
    assert!(!service.result(&service.submit(&cornell(), &QUICK)).is_empty());
}

/// A process that was killed once costs nothing but time: the bytes are the same.
#[test]
fn a_job_whose_process_was_killed_gives_the_same_bytes() {
    let room = Room::new();
    let service = room.start(&[]);
    let expected = service.result(&service.submit(&cornell(), &["--error", "0.02"]));
    let job = service.submit(&cornell(), &["--error", "0.02", "--name", "killed"]);
    kill_running(&service);
    assert!(service.result(&job) == expected, "the lit file differs");
}

/// A cancelled job leaves nothing: no process, no memory, no file; nor does a service that was killed.
#[test]
fn a_cancelled_job_leaves_no_process() {
    let room = Room::new();
    let mut service = room.start(&[]);
    let scene = many_triangles(&room, 40_000);
    let job = service.submit(&scene, &[]);
    let process = running(&service);
    assert!(service.ask(&["cancel", &job]).success);
    wait_for("its process has ended", || !children(service.id()).contains(&process));
    wait_for("its files are gone", || {
        ["results", "light", "checkpoints"].iter().all(|folder| room.names(folder).is_empty())
    });
    let _ = service.submit(&scene, &[]);
    let process = running(&service);
    service.kill();
    wait_for("its process has ended without its service", || {
        !fs::read_to_string(format!("/proc/{process}/cmdline")).is_ok_and(|line| line.contains("job"))
    });
}
