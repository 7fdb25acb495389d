use std::fs;
use std::process::Command;

use tests::programs::binary;
use tonic::Code;

use super::{Asker, HANGS, QUICK, Room, cornell, header, text};

/// A disk changes one bit of a scene: nobody gets another scene's light, and the same file mends it.
#[test]
fn a_scene_that_the_disk_has_changed_fails_its_jobs_and_is_mended_by_the_same_file() {
    let room = Room::new();
    let file = fs::read(cornell()).unwrap();
    // Without workers the job waits.
    let service = room.start(&["--workers", "127.0.0.1:1"]);
    let job = service.submit(&cornell(), &QUICK);
    drop(service);
    let names = room.names("scenes");
    let scene = room.data().join("scenes").join(&names[0]);
    let mut flipped = file.clone();
    *flipped.last_mut().unwrap() ^= 1;
    fs::write(&scene, &flipped).unwrap();
    let service = room.start(&[]);
    let failed = service.ask(&["watch", &job]);
    assert!(!failed.success);
    assert!(
        failed.errors.contains("damaged") && failed.errors.contains("submit the file again"),
        "{}",
        failed.errors
    );
    // The digest alone is not enough any more.
    let refused = Asker::new(&service, None).submit(header(&file), &[]).unwrap_err();
    assert_eq!(refused.code(), Code::FailedPrecondition, "{refused}");
    let check = |whole: bool| {
        let mut command = Command::new(binary("coordinator"));
        let said = command.args(["check-data", "--data", text(&room.data())]).output().unwrap();
        assert_eq!(said.status.success(), whole, "{said:?}");
        String::from_utf8(said.stdout).unwrap().contains(text(&scene))
    };
    assert!(check(false), "the scene is not named");
    let again = service.submit(&cornell(), &QUICK);
    assert_eq!(fs::read(&scene).unwrap(), file);
    check(true);
    let undisturbed = Room::new();
    let other = undisturbed.start(&[]);
    assert!(
        service.result(&again) == other.result(&other.submit(&cornell(), &QUICK)),
        "the lit file differs"
    );
}

/// The folder of the records is lost: the service says so, and nothing else is.
#[test]
fn a_folder_that_is_lost_stops_the_service_and_costs_nothing_more() {
    let room = Room::new();
    let service = room.start(&[]);
    let job = service.submit(&cornell(), &QUICK);
    let expected = service.result(&job);
    drop(service);
    let (jobs, elsewhere) = (room.data().join("jobs"), room.folder.path().join("jobs"));
    fs::rename(&jobs, &elsewhere).unwrap();
    let mut serve = assert_cmd::Command::new(binary("coordinator"));
    serve.args(["serve", "--listen", "127.0.0.1:0", "--data", text(&room.data())]).timeout(HANGS);
    let said = String::from_utf8(serve.output().unwrap().stderr).unwrap();
    assert!(said.contains("has lost") && said.contains("put it back"), "{said}");
    fs::rename(&elsewhere, &jobs).unwrap();
    assert!(room.start(&[]).result(&job) == expected, "the lit file differs");
}
