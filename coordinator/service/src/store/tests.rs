mod opening;

use std::fs;
use std::path::Path;
use std::time::SystemTime;

use protocol::api::{Outcome, OutputOptions, SceneOptions, State, SubmitSceneHeader};
use sha2::{Digest, Sha256};
use tempfile::TempDir;

use super::*;
use crate::job::{ClientName, Relit, Sequence};

fn record(id: u128, scene: u8) -> Record {
    Record {
        id: JobId(id),
        client: ClientName("ann".into()),
        sequence: Sequence(id as u64),
        header: SubmitSceneHeader { name: "a room".into(), ..SubmitSceneHeader::default() },
        scene: SceneDigest([scene; 32]),
        relit: None,
        state: State::Queued,
        failure: String::new(),
        submitted: SystemTime::UNIX_EPOCH,
        started: None,
        ended: None,
        outcome: None,
        crashes: 0,
        revision: 7,
    }
}

fn open(folder: &TempDir) -> Opened {
    Store::open(folder.path()).unwrap()
}

fn exists(path: impl AsRef<Path>) -> bool {
    path.as_ref().exists()
}

#[test]
fn records_are_read_as_they_were_written() {
    let folder = tempfile::tempdir().unwrap();
    let relit =
        Relit { baked: JobId(1), options: SceneOptions { weld: Some(0.5), ..SceneOptions::default() } };
    let written = [
        record(1, 1),
        record(2, 1).ended(State::Failed, "no light".into(), None),
        Record { relit: Some(relit), ..record(3, 1) },
    ];
    let Opened { store, records, .. } = open(&folder);
    assert!(records.is_empty());
    written.iter().rev().for_each(|record| store.write(record).unwrap());
    drop(store);
    let Opened { records, damaged, .. } = open(&folder);
    assert_eq!(records, written);
    assert!(damaged.is_empty());
}

/// The moments at which the power may fail, as the folder then looks.
#[test]
fn unreferenced_files_are_set_aside() {
    let folder = tempfile::tempdir().unwrap();
    let Opened { store, .. } = open(&folder);
    let kept = record(1, 1);
    store.write(&kept).unwrap();
    let at = |path: &str| folder.path().join(path);
    fs::write(store.scene(kept.scene), "scene").unwrap();
    fs::write(store.checkpoint(kept.id), "rows").unwrap();
    let (other, half) = (record(2, 2), at("jobs").join(".00000000000000000000000000000003.a1b2c3"));
    // A record on its way; a scene whose record never came; a lit file and rows whose record is gone; an upload.
    fs::write(&half, "half").unwrap();
    fs::write(store.scene(other.scene), "scene").unwrap();
    fs::write(store.result(&other), "lit").unwrap();
    fs::write(store.checkpoint(other.id), "rows").unwrap();
    fs::write(at("passing/x.upload"), "part").unwrap();
    // A lit file on its way.
    let part = at("results/.00000000000000000000000000000003.glb.a1b2c3");
    fs::write(&part, "part").unwrap();
    drop(store);
    let Opened { store, records, set_aside, .. } = open(&folder);
    assert_eq!(records, std::slice::from_ref(&kept));
    for gone in [half, part, store.scene(other.scene), store.result(&other), store.checkpoint(other.id)] {
        assert!(!exists(&gone), "{}", gone.display());
    }
    let contents: Vec<_> = set_aside.iter().map(|path| fs::read_to_string(path).unwrap()).collect();
    assert_eq!(contents, ["scene", "lit", "rows"]);
    assert!(!exists(at("passing/x.upload")));
    assert!(exists(store.scene(kept.scene)) && exists(store.checkpoint(kept.id)));
}

#[test]
fn rows_of_a_job_are_set_aside_where_its_scene_is_gone() {
    let folder = tempfile::tempdir().unwrap();
    let Opened { store, .. } = open(&folder);
    let job = record(1, 1);
    let rows = store.checkpoint(job.id);
    for is_gone in [false, true] {
        fs::write(store.scene(job.scene), "scene").unwrap();
        fs::write(&rows, "rows").unwrap();
        if is_gone {
            fs::remove_file(store.scene(job.scene)).unwrap();
        }
        store.end_checkpoint(&job).unwrap();
        assert!(!exists(&rows));
        let aside = folder.path().join("unclaimed/checkpoints").join(rows.file_name().unwrap());
        assert_eq!(exists(&aside), is_gone);
    }
    // None was begun.
    store.end_checkpoint(&job).unwrap();
}

/// A backup has neither rows nor temporary files.
#[test]
fn a_backup_is_a_whole_folder() {
    let (folder, backup) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let Opened { store, .. } = open(&folder);
    let job = record(1, 1);
    store.write(&job).unwrap();
    fs::write(store.scene(job.scene), "scene").unwrap();
    let at = |path: &str| backup.path().join(path);
    fs::copy(folder.path().join("layout"), at("layout")).unwrap();
    for name in ["jobs", "scenes", "results", "light"] {
        fs::create_dir(at(name)).unwrap();
        for path in files_of(&folder.path().join(name)).unwrap() {
            fs::copy(&path, at(name).join(path.file_name().unwrap())).unwrap();
        }
    }
    let Opened { store, records, set_aside, .. } = open(&backup);
    assert_eq!(records, std::slice::from_ref(&job));
    assert!(set_aside.is_empty() && exists(store.scene(job.scene)));
}

#[test]
fn the_same_scene_again_mends_one_that_the_disk_has_changed() {
    let folder = tempfile::tempdir().unwrap();
    let Opened { store, .. } = open(&folder);
    let send = || {
        let mut upload = store.begin_upload().unwrap();
        upload.write(b"abc").unwrap();
        store.finish_upload(&upload).unwrap();
        upload.digest()
    };
    let scene = send();
    assert!(store.has_scene(scene));
    fs::write(store.scene(scene), b"abd").unwrap();
    assert!(!store.has_scene(scene));
    send();
    assert_eq!(fs::read(store.scene(scene)).unwrap(), b"abc");
    fs::remove_file(store.scene(scene)).unwrap();
    assert!(!store.has_scene(scene));
}

#[test]
fn a_damaged_record_costs_no_file() {
    let folder = tempfile::tempdir().unwrap();
    let Opened { store, .. } = open(&folder);
    let (whole, torn) = (record(1, 1), record(2, 2));
    [&whole, &torn].into_iter().for_each(|record| store.write(record).unwrap());
    fs::write(store.scene(torn.scene), "scene").unwrap();
    let path = store.record(torn.id);
    let bytes = fs::read(&path).unwrap();
    drop(store);
    let mut flipped = bytes.clone();
    *flipped.last_mut().unwrap() ^= 1;
    for damage in [&bytes[..0], &bytes[..10], &bytes[..bytes.len() - 1], &flipped] {
        fs::write(&path, damage).unwrap();
        let Opened { store, records, damaged, .. } = open(&folder);
        assert_eq!(records, std::slice::from_ref(&whole));
        assert_eq!(damaged, std::slice::from_ref(&path));
        assert!(exists(store.scene(torn.scene)) && exists(&path));
    }
    fs::write(&path, bytes).unwrap();
    assert_eq!(open(&folder).records, [whole, torn]);
}

/// While a record is damaged, nobody knows which scenes and lights it refers to.
#[test]
fn what_a_damaged_record_may_refer_to_is_set_aside() {
    let folder = tempfile::tempdir().unwrap();
    let Opened { store, .. } = open(&folder);
    let (whole, torn) = (record(1, 1), record(2, 1));
    [&whole, &torn].into_iter().for_each(|record| store.write(record).unwrap());
    fs::write(store.scene(torn.scene), "scene").unwrap();
    fs::write(store.light(whole.light()), "light").unwrap();
    let (path, bytes) = (store.record(torn.id), fs::read(store.record(torn.id)).unwrap());
    drop(store);
    fs::write(&path, "torn").unwrap();
    let Opened { store, .. } = open(&folder);
    store.remove(&whole, false, false).unwrap();
    let aside =
        |of: &str, path: &Path| folder.path().join("unclaimed").join(of).join(path.file_name().unwrap());
    let scene = aside("scenes", &store.scene(torn.scene));
    assert_eq!(fs::read(&scene).unwrap(), b"scene");
    assert_eq!(fs::read(aside("light", &store.light(whole.light()))).unwrap(), b"light");
    // The record is put back, and the scene.
    fs::write(&path, bytes).unwrap();
    fs::rename(scene, store.scene(torn.scene)).unwrap();
    drop(store);
    let Opened { store, records, .. } = open(&folder);
    assert_eq!(records, std::slice::from_ref(&torn));
    store.remove(&torn, false, false).unwrap();
    assert!(!exists(store.scene(torn.scene)));
}

#[test]
fn room_for_changes_is_kept_and_made_again() {
    let folder = tempfile::tempdir().unwrap();
    let Opened { store, .. } = open(&folder);
    let reserve = folder.path().join("reserve");
    let kept = || fs::metadata(&reserve).unwrap().len();
    let all = kept();
    assert!(all > 0);
    // As after changes on a full disk.
    fs::File::options().write(true).open(&reserve).unwrap().set_len(all / 2).unwrap();
    assert!(store.reserve());
    assert_eq!(kept(), all);
    drop(store);
    // A backup has none.
    fs::remove_file(&reserve).unwrap();
    open(&folder);
    assert_eq!(kept(), all);
}

#[test]
fn a_job_is_removed_with_its_files_and_an_unused_scene() {
    let folder = tempfile::tempdir().unwrap();
    let Opened { store, .. } = open(&folder);
    let mut ply = record(1, 1);
    ply.header.output = Some(OutputOptions { format: Format::Ply.into(), ..OutputOptions::default() });
    store.write(&ply).unwrap();
    for path in
        [store.scene(ply.scene), store.result(&ply), store.checkpoint(ply.id), store.light(ply.light())]
    {
        fs::write(path, "bytes").unwrap();
    }
    assert!(store.result(&ply).to_string_lossy().ends_with(".ply"));
    assert_eq!(store.size_of(&ply), 15 + fs::metadata(store.record(ply.id)).unwrap().len());
    store.remove(&ply, true, true).unwrap();
    assert!(exists(store.scene(ply.scene)) && exists(store.light(ply.id)) && !exists(store.result(&ply)));
    store.remove(&ply, false, false).unwrap();
    assert_eq!(store.room().unwrap().taken, 0);
}

#[test]
fn an_upload_appears_when_it_is_complete() {
    let folder = tempfile::tempdir().unwrap();
    let Opened { store, .. } = open(&folder);
    let mut upload = store.begin_upload().unwrap();
    upload.write(b"ab").unwrap();
    upload.write(b"c").unwrap();
    let digest = upload.digest();
    assert_eq!(upload.received(), 3);
    assert!(digest.to_string().starts_with("ba7816bf8f01cfea"), "{digest}");
    assert!(!exists(store.scene(digest)));
    store.finish_upload(&upload).unwrap();
    drop(upload);
    assert_eq!(fs::read(store.scene(digest)).unwrap(), b"abc");
    drop(store.begin_upload().unwrap());
    assert_eq!(fs::read_dir(folder.path().join("passing")).unwrap().count(), 0);
}

#[test]
fn a_check_finds_what_the_disk_has_changed_and_changes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let Opened { store, .. } = open(&folder);
    let mut upload = store.begin_upload().unwrap();
    upload.write(b"scene").unwrap();
    store.finish_upload(&upload).unwrap();
    let outcome = Outcome { sha256: Sha256::digest(b"lit").to_vec().into(), ..Outcome::default() };
    let done =
        Record { scene: upload.digest(), ..record(1, 1) }.ended(State::Done, String::new(), Some(outcome));
    let queued = Record { scene: upload.digest(), ..record(2, 1) };
    fs::write(store.result(&done), b"lit").unwrap();
    [&done, &queued].into_iter().for_each(|record| store.write(record).unwrap());
    let mut looked = 0;
    // The service runs meanwhile.
    let found = check(folder.path(), |_| looked += 1).unwrap();
    assert_eq!((found, looked), (DataCheck { files: 4, damaged: vec![] }, 4));
    let paths = [store.record(queued.id), store.scene(done.scene), store.result(&done)];
    for path in &paths {
        let whole = fs::read(path).unwrap();
        let mut flipped = whole.clone();
        *flipped.last_mut().unwrap() ^= 1;
        fs::write(path, &flipped).unwrap();
        let damaged =
            |found: DataCheck| -> Vec<_> { found.damaged.into_iter().map(|(path, _)| path).collect() };
        assert_eq!(damaged(check(folder.path(), |_| ()).unwrap()), std::slice::from_ref(path));
        assert_eq!(fs::read(path).unwrap(), flipped);
        fs::remove_file(path).unwrap();
        // A record that is gone is a job that was deleted.
        let missed = usize::from(*path != paths[0]);
        assert_eq!(check(folder.path(), |_| ()).unwrap().damaged.len(), missed);
        fs::write(path, whole).unwrap();
    }
    fs::write(folder.path().join("jobs/1.old"), "record").unwrap();
    assert_eq!(check(folder.path(), |_| ()).unwrap().damaged.len(), 1);
    let elsewhere = folder.path().join("elsewhere");
    fs::create_dir_all(elsewhere.join("jobs")).unwrap();
    assert!(matches!(check(&elsewhere, |_| ()), Err(StoreError::Foreign { .. })));
    fs::remove_dir_all(folder.path().join("light")).unwrap();
    assert!(matches!(check(folder.path(), |_| ()), Err(StoreError::Lost { .. })));
}
