use std::fs;
use std::process::Command;
use std::sync::OnceLock;

use tests::programs::{Signal, WorkerProcess, binary};

use super::{QUICK, Room, cornell, text, wait_for};

/// A bake of some seconds, so that it can be ended in its middle.
pub const SLOW: [&str; 2] = ["--error", "0.016"];

/// What `solve` makes of cornell by the slow bake: made once for all tests.
pub fn slowly_solved() -> &'static [u8] {
    static SOLVED: OnceLock<Vec<u8>> = OnceLock::new();
    SOLVED.get_or_init(|| solved(&Room::new(), "solved.glb", &SLOW))
}

/// What `solve` makes of cornell.
pub fn solved(room: &Room, name: &str, arguments: &[&str]) -> Vec<u8> {
    ran(room, name, "solve", &[&["--threads", "2"], arguments].concat())
}

/// What a command makes of cornell.
pub fn ran(room: &Room, name: &str, command: &str, arguments: &[&str]) -> Vec<u8> {
    let output = room.folder.path().join(name);
    let mut run = Command::new(binary("coordinator"));
    let ran = run.arg(command).arg(cornell()).arg("-o").arg(&output).args(arguments).output().unwrap();
    assert!(ran.status.success(), "{}", String::from_utf8_lossy(&ran.stderr));
    fs::read(output).unwrap()
}

/// A Radiance HDR file of 8 by 4 texels: dark below, brighter to one side above.
fn sky_image() -> Vec<u8> {
    let mut bytes = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 4 +X 8\n".to_vec();
    let texel =
        |index: u8| if index < 16 { [100, 120 + 8 * (index % 8), 200, 129] } else { [50, 40, 30, 126] };
    bytes.extend((0..32).flat_map(texel));
    bytes
}

#[test]
fn a_job_gives_the_bytes_of_solve_with_the_same_options() {
    let room = Room::new();
    let service = room.start(&[]);
    for (index, options) in [
        "--error 0.05",
        "--mesh-error 0.1 --shooter-edge 0.2 --rays 64 --seed 7 --window 9 --only indirect",
        "--mesh-error 0.1 --shooter-edge 0.2 --sky 0.1,0.2,0.3 --light-unit watt --group up=sky",
        "--mesh-error 0.1 --shooter-edge 0.2 --output-domain corner --exposure 0.2 --unit lx",
    ]
    .into_iter()
    .enumerate()
    {
        let options: Vec<&str> = options.split(' ').collect();
        let expected = solved(&room, "solved.glb", &options);
        let output = room.folder.path().join(format!("{index}.glb"));
        let said = service.ask(&[&["submit", text(&cornell()), "-o", text(&output)], &options[..]].concat());
        assert!(said.success, "{}", said.errors);
        assert!(fs::read(output).unwrap() == expected, "the lit file differs: {options:?}");
    }
    // A sky image travels within the scene.
    let image = room.folder.path().join("sky.hdr");
    fs::write(&image, sky_image()).unwrap();
    let sky = ["--error", "0.1", "--sky", text(&image), "--sky-rotation", "30", "--sky-intensity", "0.7"];
    let expected = solved(&room, "solved.glb", &sky);
    let output = room.folder.path().join("sky.glb");
    let said = service.ask(&[&["submit", text(&cornell()), "-o", text(&output)], &sky[..]].concat());
    assert!(said.success, "{}", said.errors);
    assert!(fs::read(output).unwrap() == expected, "the lit file differs under a sky image");
    let expected = solved(&room, "solved.ply", &QUICK);
    let output = room.folder.path().join("lit.ply");
    let scene = cornell();
    let arguments = ["submit", text(&scene), "-o", text(&output), "--format", "ply"];
    let said = service.ask(&[&arguments, &QUICK[..]].concat());
    assert!(said.success && fs::read(output).unwrap() == expected, "{}", said.errors);
}

#[test]
fn jobs_of_workers_elsewhere_run_at_once_and_give_the_same_bytes() {
    let room = Room::new();
    let workers = [WorkerProcess::start(1), WorkerProcess::start(1)];
    let addresses = workers.each_ref().map(|worker| worker.address.as_str()).join(",");
    let service = room.start(&["--workers", &addresses, "--jobs", "3"]);
    let expected = solved(&room, "solved.glb", &QUICK);
    let jobs = [0; 6].map(|_| service.submit(&cornell(), &QUICK));
    for job in jobs {
        assert!(service.result(&job) == expected, "the lit file differs");
    }
}

#[test]
fn a_killed_service_goes_on_where_it_was() {
    let room = Room::new();
    let expected = slowly_solved();
    let mut service = room.start(&["--jobs", "1"]);
    let first = service.submit(&cornell(), &SLOW);
    let second = service.submit(&cornell(), &QUICK);
    let checkpoint = room.data().join("checkpoints").join(&first);
    let length = || fs::metadata(&checkpoint).map_or(0, |file| file.len());
    let mut rows = 0;
    // In the middle of its first rows, and again when it has more.
    for _ in 0..2 {
        wait_for("the job has new rows", || length() > rows + (1 << 20));
        rows = length();
        service.kill();
        assert!(!room.data().join("results").join(format!("{first}.glb")).exists(), "it was done too soon");
        service = room.start(&["--jobs", "1"]);
    }
    // Asked to end, it leaves in time, and the job goes on as well.
    service.signal(Signal::TERM);
    assert!(service.wait().success());
    let service = room.start(&["--jobs", "1"]);
    assert!(service.result(&first) == expected, "the lit file differs");
    assert!(service.result(&second) == solved(&room, "quick.glb", &QUICK), "the lit file differs");
    assert_eq!(room.names("checkpoints"), <[&str; 0]>::default());
    drop(service);
    // What is done stays done.
    assert!(room.start(&[]).result(&first) == expected);
}

/// Killed again and again while jobs come and go: what was answered holds.
#[test]
fn every_job_that_was_accepted_is_there_after_any_crash() {
    let room = Room::new();
    let expected = solved(&room, "solved.glb", &QUICK);
    let mut jobs = vec![];
    for round in 0..5 {
        let mut service = room.start(&["--jobs", "2"]);
        for _ in 0..2 {
            jobs.push(service.submit(&cornell(), &QUICK));
        }
        std::thread::sleep(std::time::Duration::from_millis(50 * round));
        service.kill();
    }
    let service = room.start(&["--jobs", "2"]);
    for job in jobs {
        assert!(service.result(&job) == expected, "the lit file differs");
    }
    assert_eq!(room.names("scenes").len(), 1);
}

#[test]
fn two_services_do_not_share_a_folder() {
    let room = Room::new();
    let _service = room.start(&[]);
    assert!(tests::service::ServiceProcess::try_start(&room.data(), &[]).is_err());
}

#[test]
fn jobs_wait_for_workers_that_are_not_there() {
    let room = Room::new();
    let mut worker = WorkerProcess::start(1);
    let address = worker.address.clone();
    worker.kill();
    let service = room.start(&["--workers", &address, "--worker-grace", "0.1"]);
    let job = service.submit(&cornell(), &QUICK);
    std::thread::sleep(std::time::Duration::from_millis(500));
    let _worker = WorkerProcess::start_at(&address, 2, &[]);
    assert!(service.result(&job) == solved(&room, "solved.glb", &QUICK), "the lit file differs");
}
