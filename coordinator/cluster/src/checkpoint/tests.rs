use std::fs;
use std::io::{self, Write};
use std::path::Path;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use glam::DVec3;
use kernel::row::{Precision, ROW_VERSION, Shape, Shooter, release};
use proptest::prelude::*;

use super::file::CheckpointFile;
use super::record::{HEAD, TAIL, decode_head, encode, keys};
use super::writer::{Storage, Writer, Written};
use super::*;
use bake::{BakeError, RowService};
use kernel::replica::{Digest, EncodedReplica};
use kernel::row::{FinishedJob, JobId, Row, RowRequest};
use protocol::worker::RowStatistics;

const RECEIVERS: usize = 5;

fn request((first, end): (u64, u64)) -> RowRequest {
    RowRequest {
        scene: Digest::of(b"scene"),
        receivers: Digest::of(b"receivers"),
        first_receiver: 0,
        receiver_count: RECEIVERS as u32,
        shooters: (first..end).map(|key| Shooter { key, shape: Shape::Point(DVec3::ONE) }).collect(),
        precision: Precision::DEFAULT,
    }
}

fn row(shooter: u64) -> Row {
    Row::new(&[shooter as f32; RECEIVERS])
}

fn statistics(shooter: u64) -> RowStatistics {
    RowStatistics { rays: shooter, ..RowStatistics::default() }
}

/// Computes rows that tell their shooter, and counts them.
#[derive(Default)]
struct Counting {
    jobs: Vec<(JobId, RowRequest)>,
    computed: u64,
}

impl RowService for Counting {
    fn publish(&mut self, _: EncodedReplica) {}

    fn release(&mut self, _: Digest) {}

    fn submit(&mut self, requests: Vec<(JobId, RowRequest)>) {
        self.jobs.extend(requests);
    }

    fn withdraw(&mut self) {
        self.jobs.clear();
    }

    fn next(&mut self, _: Duration) -> Result<Option<FinishedJob>, BakeError> {
        let (job, request) = self.jobs.pop().unwrap();
        self.computed += request.shooters.len() as u64;
        let keys: Vec<u64> = request.shooters.iter().map(|shooter| shooter.key).collect();
        let rows = keys.iter().map(|key| row(*key)).collect();
        Ok(Some(FinishedJob { job, rows, statistics: keys.into_iter().map(statistics).collect() }))
    }
}

/// Has the rows of these jobs, each from the first shooter to the one before the last, made with the checkpoint; the number of rows computed.
fn bake(path: &Path, limit: u64, jobs: &[(u64, u64)]) -> (u64, CheckpointSummary) {
    let mut service = Checkpointed::new(Counting::default(), OpenCheckpoint::open(path, limit).unwrap());
    service.submit((0..).map(JobId).zip(jobs.iter().copied().map(request)).collect());
    for _ in jobs {
        let finished = service.next(Duration::ZERO).unwrap().unwrap();
        let (first, end) = jobs[finished.job.0 as usize];
        assert!(finished.rows.iter().cloned().eq((first..end).map(row)));
        assert!(finished.statistics.iter().copied().eq((first..end).map(statistics)));
    }
    let (inner, summary) = service.finish();
    (inner.computed, summary)
}

#[test]
fn what_was_computed_is_not_computed_again_however_jobs_are_cut() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("rows");
    let (computed, summary) = bake(&path, u64::MAX, &[(0, 10), (10, 20)]);
    assert_eq!((computed, summary.rows_written, summary.rows_read), (20, 20, 0));
    let (computed, summary) = bake(&path, u64::MAX, &[(5, 15), (15, 25), (0, 3)]);
    assert_eq!((computed, summary.rows_written, summary.rows_read), (5, 5, 18));
    assert_eq!(summary.bytes, fs::metadata(&path).unwrap().len());
    assert_eq!(bake(&path, u64::MAX, &[(0, 25)]).0, 0);
}

#[test]
fn a_key_tells_all_that_a_row_depends_on() {
    let base = request((0, 1));
    let others = [
        request((1, 2)),
        RowRequest { scene: Digest::of(b"other"), ..base.clone() },
        RowRequest { receivers: Digest::of(b"other"), ..base.clone() },
        RowRequest { first_receiver: 1, ..base.clone() },
        RowRequest { receiver_count: 6, ..base.clone() },
        RowRequest { precision: Precision { seed: 9, ..Precision::DEFAULT }, ..base.clone() },
    ];
    assert_eq!(keys(&base), keys(&request((0, 2)))[..1]);
    for other in others {
        assert_ne!(keys(&base), keys(&other), "{other:?}");
    }
}

#[test]
fn a_torn_or_damaged_end_is_cut_off() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("rows");
    bake(&path, u64::MAX, &[(0, 4)]);
    let whole = fs::read(&path).unwrap();
    for length in 0..whole.len() {
        fs::write(&path, &whole[..length]).unwrap();
        let (computed, summary) = bake(&path, u64::MAX, &[(0, 4)]);
        assert_eq!(computed + summary.rows_read, 4);
        assert!(computed > 0, "{length} of {} bytes hold all rows", whole.len());
        assert_eq!(fs::read(&path).unwrap().len(), whole.len());
    }
    let header = CheckpointFile::open(&folder.path().join("empty")).unwrap().length as usize;
    let mut starts = vec![header];
    for _ in 1..4 {
        let start = *starts.last().unwrap();
        let (_, body) = decode_head(whole[start..].first_chunk().unwrap()).unwrap();
        starts.push(start + HEAD + body + TAIL);
    }
    for place in header..whole.len() {
        let mut damaged = whole.clone();
        damaged[place] ^= 0x10;
        fs::write(&path, &damaged).unwrap();
        let computed = bake(&path, u64::MAX, &[(0, 4)]).0;
        // A record whose length is wrong takes those behind it with it, others are lost alone.
        let number = starts.partition_point(|start| *start <= place) - 1;
        let is_length = place - starts[number] < size_of::<u32>();
        let most = if is_length { 4 - number as u64 } else { 1 };
        assert!((1..=most).contains(&computed), "{computed} computed again, byte {place}");
        assert_eq!(bake(&path, u64::MAX, &[(0, 4)]).0, 0, "byte {place}");
    }
}

#[test]
fn what_is_no_checkpoint_is_refused_and_left_alone() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("rows");
    let open = || OpenCheckpoint::open(&path, 0).err().unwrap();
    for other in ["glTF and so on, longer than the magic", "x", "halflight checkpoint\n0.0.1 protocol 1\n"] {
        fs::write(&path, other).unwrap();
        assert!(matches!(open(), CheckpointError::NotACheckpoint { .. } | CheckpointError::Version { .. }));
        assert_eq!(fs::read(&path).unwrap(), other.as_bytes());
    }
    fs::remove_file(&path).unwrap();
    let held = CheckpointFile::open(&path).unwrap();
    assert!(matches!(open(), CheckpointError::InUse { .. }));
    drop(held);
    let nowhere = OpenCheckpoint::open(&folder.path().join("no/rows"), 0).err().unwrap();
    assert!(nowhere.to_string().contains("--checkpoint"), "{nowhere}");
}

#[test]
fn a_checkpoint_of_another_row_version_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("rows");
    bake(&path, u64::MAX, &[(0, 2)]);
    let bytes = fs::read(&path).unwrap();
    let header = |release: &str| format!("halflight checkpoint\n{release}\n").into_bytes();
    let rows = bytes.strip_prefix(&header(&release())[..]).unwrap();
    let other = release().replace(&format!("rows {ROW_VERSION}"), &format!("rows {}", ROW_VERSION + 1));
    assert_ne!(other, release());
    fs::write(&path, [&header(&other), rows].concat()).unwrap();
    let error = OpenCheckpoint::open(&path, 0).err().unwrap().to_string();
    for words in [other.as_str(), &release(), "remove the file"] {
        assert!(error.contains(words), "{error}");
    }
}

#[test]
fn a_limit_ends_the_recording_and_not_the_bake() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("rows");
    let (computed, summary) = bake(&path, 500, &[(0, 10), (10, 20)]);
    assert!(computed == 20 && summary.rows_written > 0 && summary.rows_written < 20, "{summary:?}");
    assert!(summary.stopped.unwrap().contains("--checkpoint-size"));
    assert!(fs::metadata(&path).unwrap().len() <= 500);
    assert_eq!(bake(&path, 500, &[(0, 20)]).0, 20 - summary.rows_written);
}

/// A disk that is full after so many bytes.
#[derive(Clone)]
struct Small(Arc<Mutex<Vec<u8>>>, usize);

impl Write for Small {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let mut held = self.0.lock().unwrap();
        let room = self.1 - held.len();
        if room == 0 {
            return Err(io::ErrorKind::StorageFull.into());
        }
        let some = bytes.len().min(room);
        held.extend(&bytes[..some]);
        Ok(some)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Storage for Small {
    fn sync(&mut self) -> io::Result<()> {
        Ok(())
    }

    fn cut(&mut self, length: u64) -> io::Result<()> {
        self.0.lock().unwrap().truncate(length as usize);
        Ok(())
    }
}

#[test]
fn a_full_disk_ends_the_recording_at_a_whole_record() {
    let record = encode(Digest::of(b"0"), &row(1), &statistics(1)).len();
    let (disk, written) = (Arc::new(Mutex::new(vec![])), Written::new(Default::default(), 0));
    let mut writer = Writer::start(
        Path::new("rows"),
        Small(Arc::clone(&disk), 3 * record + record / 2),
        u64::MAX,
        Arc::clone(&written),
    )
    .unwrap();
    for number in 0..10_u8 {
        writer.record(Digest::of(&[number]), &row(1), &statistics(1));
    }
    writer.finish();
    assert!(written.stopped().is_some_and(|why| why.contains("cannot be written")));
    assert_eq!(disk.lock().unwrap().len(), 3 * record);
    assert!(written.place(&Digest::of(&[2])).is_some() && written.place(&Digest::of(&[3])).is_none());
}

proptest! {
    /// Whatever a file holds behind a good header, it can be gone on with.
    #[test]
    fn any_bytes_are_a_checkpoint_or_refused(
        bytes in prop::collection::vec(any::<u8>(), 0..300), has_header in any::<bool>()) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("rows");
        if has_header {
            drop(CheckpointFile::open(&path).unwrap());
        }
        let header = fs::read(&path).unwrap_or_default();
        fs::write(&path, [header, bytes].concat()).unwrap();
        match CheckpointFile::open(&path) {
            Ok(opened) => prop_assert_eq!(opened.length, fs::metadata(&path).unwrap().len()),
            Err(_) => prop_assert!(!has_header),
        }
    }
}
