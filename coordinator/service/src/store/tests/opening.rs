//! Which folders are opened.

use super::*;

#[test]
fn two_services_do_not_share_a_folder() {
    let folder = tempfile::tempdir().unwrap();
    let first = open(&folder);
    assert!(matches!(Store::open(folder.path()), Err(StoreError::InUse { .. })));
    drop(first);
    open(&folder);
}

#[test]
fn other_folders_and_other_releases_are_left_alone() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("letter.txt"), "dear").unwrap();
    assert!(matches!(Store::open(folder.path()), Err(StoreError::Foreign { .. })));
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    let folder = tempfile::tempdir().unwrap();
    drop(open(&folder));
    fs::write(folder.path().join("layout"), "halflight service data, layout 2\n").unwrap();
    let refused = Store::open(folder.path()).unwrap_err();
    assert!(refused.to_string().contains("layout 2"), "{refused}");
}

#[test]
fn a_folder_that_is_lost_costs_nothing_in_the_others() {
    let folder = tempfile::tempdir().unwrap();
    let Opened { store, .. } = open(&folder);
    let job = record(1, 1);
    store.write(&job).unwrap();
    fs::write(store.scene(job.scene), "scene").unwrap();
    fs::write(store.result(&job), "lit").unwrap();
    drop(store);
    let (jobs, kept) = (folder.path().join("jobs"), folder.path().join("kept"));
    fs::rename(&jobs, &kept).unwrap();
    let refused = Store::open(folder.path()).unwrap_err();
    assert!(matches!(&refused, StoreError::Lost { path } if *path == jobs), "{refused}");
    // As the message says, to go on without; then what was set aside is still there, twice over.
    for times in 1..=2 {
        fs::create_dir_all(&jobs).unwrap();
        let Opened { store, set_aside, .. } = open(&folder);
        assert_eq!(set_aside.len(), 2);
        assert!(set_aside.iter().all(exists));
        let unclaimed = folder.path().join("unclaimed/scenes");
        assert_eq!(fs::read_dir(unclaimed).unwrap().count(), times);
        fs::write(store.scene(job.scene), "scene").unwrap();
        fs::write(store.result(&job), "lit").unwrap();
    }
    fs::remove_dir(&jobs).unwrap();
    fs::rename(kept, jobs).unwrap();
    let Opened { store, records, set_aside, .. } = open(&folder);
    assert_eq!(records, std::slice::from_ref(&job));
    assert!(set_aside.is_empty() && exists(store.scene(job.scene)));
}

#[test]
fn an_interrupted_first_start_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("jobs")).unwrap();
    fs::create_dir(folder.path().join("scenes")).unwrap();
    drop(open(&folder));
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("jobs")).unwrap();
    fs::write(folder.path().join("jobs/letter.txt"), "dear").unwrap();
    assert!(matches!(Store::open(folder.path()), Err(StoreError::Foreign { .. })));
}

#[test]
fn a_folder_in_place_of_the_lock_is_named() {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("lock")).unwrap();
    let refused = Store::open(folder.path()).unwrap_err();
    assert!(matches!(&refused, StoreError::NoFile { path } if path.ends_with("lock")), "{refused}");
}

/// Opening a pipe waits for someone at its other end.
#[cfg(unix)]
#[test]
fn pipes_in_place_of_files_are_named_and_read_by_nobody() {
    use std::process::Command;

    let pipe = |path: &Path| assert!(Command::new("mkfifo").arg(path).status().unwrap().success());
    for name in ["layout", "lock", "reserve"] {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        drop(open(&folder));
        fs::remove_file(&path).unwrap();
        pipe(&path);
        let refused = Store::open(folder.path()).unwrap_err();
        assert!(matches!(&refused, StoreError::NoFile { path: found } if *found == path), "{refused}");
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene");
    pipe(&path);
    assert!(digest(&path).is_err());
    assert!(read_regular(&path).is_err());
}

#[test]
fn a_record_of_a_release_to_come_stops_the_service() {
    let bytes = record::encode(&record(1, 1));
    assert!(record::decode(JobId(1), &bytes).is_ok());
    let later = record::encode_as(&record(1, 1), record::VERSION + 1);
    let folder = tempfile::tempdir().unwrap();
    let Opened { store, .. } = open(&folder);
    fs::write(store.record(JobId(1)), later).unwrap();
    drop(store);
    let refused = Store::open(folder.path()).unwrap_err();
    assert!(matches!(refused, StoreError::RecordVersion { theirs: 2, ours: 1, .. }), "{refused}");
}
