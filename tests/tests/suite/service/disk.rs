use std::fs;
use std::io::Write;
use std::process::Command;

use tests::service::ServiceProcess;
use tonic::Code;
use tonic_types::StatusExt;

use super::{Asker, MESH_ERROR, QUICK, Room, cornell, header};

/// A file system of a few megabytes, until it is dropped.
struct Small<'a>(&'a Room);

impl<'a> Small<'a> {
    fn mount(room: &'a Room, size: &str) -> Option<Self> {
        let path = room.folder.path().join("small");
        fs::create_dir(&path).unwrap();
        let size = format!("size={size}");
        let mounted = Command::new("mount").args(["-t", "tmpfs", "-o", &size, "tmpfs"]).arg(&path).status();
        if mounted.is_ok_and(|status| status.success()) {
            return Some(Self(room));
        }
        println!("skipped: a small file system cannot be mounted here");
        None
    }
}

impl Drop for Small<'_> {
    fn drop(&mut self) {
        // What is left is removed with its folder.
        let _ = Command::new("umount").arg(self.0.folder.path().join("small")).status();
    }
}

/// A disk without room is an error of the submission; a job that was accepted ends when there is room again.
#[test]
fn a_full_disk_refuses_and_loses_nothing() {
    let room = Room::new();
    let Some(_mounted) = Small::mount(&room, "4m") else { return };
    let small = room.folder.path().join("small");
    let service = ServiceProcess::start(&small.join("data"), &["--jobs", "1"]);
    let mut asker = Asker::new(&service, None);
    let scene = fs::read(cornell()).unwrap();
    let accepted = asker.submit(header(&scene), &[&scene]).unwrap().id;
    let ballast = small.join("ballast");
    // As full as can be: what is left would take a record at most.
    let full = Command::new("dd")
        .args(["if=/dev/zero", "bs=4096"])
        .arg(format!("of={}", ballast.display()))
        .output();
    assert!(!full.unwrap().status.success(), "the disk is not full");
    let refused = loop {
        // The accepted job's own files come and go.
        if let Err(refused) = asker.submit(header(&scene), &[&scene]) {
            break refused;
        }
    };
    assert_eq!(refused.code(), Code::ResourceExhausted, "{refused}");
    assert_eq!(refused.get_error_details().quota_failure().unwrap().violations[0].subject, "disk");
    fs::remove_file(ballast).unwrap();
    let undisturbed = Room::new();
    let other = undisturbed.start(&[]);
    // The header is that of the command line in all that matters.
    let options = ["--mesh-error", &MESH_ERROR.to_string()];
    let expected = other.result(&other.submit(&cornell(), &options));
    assert!(service.result(&accepted) == expected, "the lit file differs");
    assert!(asker.submit(header(&scene), &[]).is_ok());
}

/// Not one byte is free, and jobs can be cancelled, and stay so.
#[test]
fn jobs_are_cancelled_on_a_full_disk() {
    let room = Room::new();
    let Some(_mounted) = Small::mount(&room, "4m") else { return };
    let small = room.folder.path().join("small");
    // Without workers the jobs wait.
    let service = ServiceProcess::start(&small.join("data"), &["--workers", "127.0.0.1:1", "--jobs", "1"]);
    let jobs: Vec<String> = (0..3).map(|_| service.submit(&cornell(), &QUICK)).collect();
    let ballast = small.join("ballast");
    let mut file = fs::File::create(&ballast).unwrap();
    while file.write(&[1; 4096]).is_ok_and(|written| written > 0) {}
    for job in &jobs {
        let cancelled = service.ask(&["cancel", job]);
        assert!(cancelled.success, "{}", cancelled.errors);
    }
    drop(service);
    let service = ServiceProcess::start(&small.join("data"), &["--workers", "127.0.0.1:1"]);
    assert_eq!(service.ask(&["jobs"]).text.matches("cancelled").count(), jobs.len());
}

/// No file may grow beyond a limit that is less than the scene: the same, without a file system of its own.
#[test]
fn a_file_that_may_not_grow() {
    let room = Room::new();
    let scene = [fs::read(cornell()).unwrap(), vec![0; 64 << 10]].concat();
    let limit = format!("trap '' XFSZ; ulimit -f {}", (scene.len() - 4096) / 512);
    let service = ServiceProcess::start_after(&limit, &room.data(), &[]).unwrap();
    let mut asker = Asker::new(&service, None);
    let refused = asker.submit(header(&scene), &[&scene]).unwrap_err();
    assert_eq!(refused.code(), Code::ResourceExhausted, "{refused}");
    assert_eq!(room.names("passing"), <[&str; 0]>::default());
    // Room that is to be left free counts as well.
    drop(service);
    let service = room.start(&["--keep-free", "1000000000"]);
    let refused = Asker::new(&service, None).submit(header(&scene), &[&scene]).unwrap_err();
    assert_eq!(refused.get_error_details().quota_failure().unwrap().violations[0].subject, "disk");
}
