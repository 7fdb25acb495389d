use super::{ENDLESS, QUICK, Room, cornell, wait_for};

/// Jobs that have ended go, with their lit files; those that wait and run stay, with their scene and their rows, and end.
#[test]
fn only_jobs_that_have_ended_are_kept_no_longer() {
    for option in [["--keep-size", "0"], ["--keep-days", "0"]] {
        let room = Room::new();
        let mut service = room.start(&["--jobs", "1"]);
        let done = service.submit(&cornell(), &QUICK);
        assert!(!service.result(&done).is_empty());
        let running = service.submit(&cornell(), &ENDLESS);
        let queued = service.submit(&cornell(), &QUICK);
        let checkpoint = room.data().join("checkpoints").join(&running);
        wait_for("it has rows", || checkpoint.metadata().is_ok_and(|file| file.len() > 1 << 20));
        service.kill();
        assert!(room.names("jobs").contains(&done), "{option:?}");
        let mut service = room.start(&[&["--jobs", "1"], &option[..]].concat());
        wait_for("what has ended is gone", || !room.names("jobs").contains(&done));
        let listed = service.ask(&["jobs"]).text;
        assert!(!listed.contains(&done) && listed.contains(&running) && listed.contains(&queued), "{listed}");
        for folder in ["results", "light"] {
            wait_for("its files are gone", || room.names(folder).is_empty());
        }
        assert!(checkpoint.exists(), "rows of a job that runs are gone");
        service.kill();
        let service = room.start(&["--jobs", "1"]);
        assert!(service.ask(&["cancel", &running]).success);
        assert!(!service.result(&queued).is_empty());
    }
}
