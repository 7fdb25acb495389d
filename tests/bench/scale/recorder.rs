//! Rows as the real kernel makes them, each computed once and kept on disk with what it took.

use std::collections::HashMap;
use std::error::Error;
use std::fs::{File, OpenOptions};
use std::io::{BufReader, BufWriter, Read, Write};
use std::path::Path;
use std::sync::Arc;

use kernel::replica::{Digest, EncodedReplica};
use kernel::row::{Row, RowRequest, decode_row};
use prost::Message;
use protocol::packing::{packed, unpacked};
use protocol::worker::RowStatistics;
use rayon::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use worker::job::Job;
use worker::store::{Replica, ReplicaStore};

use crate::processor::{Nanoseconds, processor_time};

/// What a worker answers, and what it takes.
pub struct Recorded {
    /// The row.
    pub row: Row,
    /// What the worker counted.
    pub statistics: RowStatistics,
    /// Length of the row as it travels.
    pub bytes: u64,
    /// Processor time to compute and encode it.
    pub compute: Nanoseconds,
    /// Processor time to decode it.
    pub decode: Nanoseconds,
}

/// All rows asked for so far.
pub struct Recorder {
    rows: HashMap<Digest, Arc<Recorded>>,
    replicas: HashMap<Digest, Published>,
    /// Computes rows: the threads of the bake have one core, so that what they share can be told.
    pool: ThreadPool,
    file: BufWriter<File>,
}

/// A replica, and what it takes to load it.
struct Published {
    encoded: EncodedReplica,
    replica: Replica,
    /// Bytes that travel.
    length: u64,
    prepare: Nanoseconds,
}

impl Recorder {
    /// With the rows of a file, which those that are computed are added to.
    ///
    /// # Errors
    /// When the file cannot be read or written.
    pub fn open(path: &Path) -> Result<Self, Box<dyn Error>> {
        let mut rows = HashMap::new();
        if path.exists() {
            let mut file = BufReader::new(File::open(path)?);
            // An interrupted recording ends in the middle of a row.
            while let Ok((key, row)) = read(&mut file) {
                rows.insert(key, Arc::new(row));
            }
        }
        let file = BufWriter::new(OpenOptions::new().create(true).append(true).open(path)?);
        Ok(Self { rows, replicas: HashMap::new(), pool: ThreadPoolBuilder::new().build()?, file })
    }

    /// Makes a replica ready.
    pub fn publish(&mut self, encoded: EncodedReplica) {
        let packed = packed(&encoded.bytes);
        let length = packed.as_ref().map_or(encoded.bytes.len(), Vec::len) as u64;
        let start = processor_time();
        let unpacked =
            packed.map(|packed| unpacked(&packed, encoded.bytes.len() as u64).expect("it was packed"));
        let bytes = unpacked.as_deref().unwrap_or(&encoded.bytes);
        let replica = Replica::decode(encoded.kind, bytes).expect("what was just encoded can be decoded");
        let prepare = processor_time() - start;
        self.replicas.insert(encoded.digest, Published { encoded, replica, length, prepare });
    }

    /// Length of a replica, and the processor time to make it ready.
    #[must_use]
    pub fn replica(&self, digest: Digest) -> (u64, Nanoseconds) {
        let published = &self.replicas[&digest];
        (published.length, published.prepare)
    }

    /// Computes all rows of these requests that are not known yet.
    pub fn record(&mut self, requests: &[RowRequest]) {
        let missing: Vec<RowRequest> = requests.iter().flat_map(one_by_one).collect();
        let missing: Vec<(Digest, RowRequest)> = missing
            .into_iter()
            .map(|request| (key(&request), request))
            .filter(|(key, _)| !self.rows.contains_key(key))
            .collect();
        let mut store = ReplicaStore::new(u64::MAX);
        for (_, request) in &missing {
            for digest in [request.scene, request.receivers] {
                let Published { replica, encoded, .. } = &self.replicas[&digest];
                store.insert(digest, replica.clone(), encoded.bytes.len() as u64);
            }
        }
        let jobs: Vec<(Digest, u32, Job)> = missing
            .into_iter()
            .map(|(key, request)| {
                let job = Job::new(&request.to_job(0), &mut store)
                    .expect("the coordinator asks for what makes sense");
                (key, request.receiver_count, job)
            })
            .collect();
        let compute = |jobs: Vec<(Digest, u32, Job)>| -> Vec<(Digest, Vec<u8>, Recorded)> {
            jobs.into_par_iter()
                .map(|(key, receivers, job)| {
                    let start = processor_time();
                    let finished = job.compute();
                    let computed = processor_time();
                    let row = decode_row(&finished.rows[0], receivers as usize)
                        .expect("what was just encoded can be decoded");
                    let decode = processor_time() - computed;
                    let bytes = finished.rows[0].to_vec();
                    let statistics = finished.statistics[0];
                    let recorded = Recorded {
                        row,
                        statistics,
                        bytes: bytes.len() as u64,
                        compute: computed - start,
                        decode,
                    };
                    (key, bytes, recorded)
                })
                .collect()
        };
        let made = self.pool.install(|| compute(jobs));
        for (key, bytes, recorded) in made {
            write(&mut self.file, key, &bytes, &recorded).expect("rows can be kept");
            self.rows.insert(key, Arc::new(recorded));
        }
    }

    /// The rows of a request that was recorded.
    #[must_use]
    pub fn rows(&self, request: &RowRequest) -> Vec<Arc<Recorded>> {
        one_by_one(request).map(|one| Arc::clone(&self.rows[&key(&one)])).collect()
    }
}

/// A request as so many requests of one row.
fn one_by_one(request: &RowRequest) -> impl Iterator<Item = RowRequest> + '_ {
    request.shooters.iter().map(|shooter| RowRequest { shooters: vec![shooter.clone()], ..*request })
}

fn key(request: &RowRequest) -> Digest {
    Digest::of(&request.to_job(0).encode_to_vec())
}

fn write(file: &mut impl Write, key: Digest, row: &[u8], recorded: &Recorded) -> std::io::Result<()> {
    file.write_all(&key.0)?;
    let statistics = recorded.statistics.encode_to_vec();
    for number in [
        recorded.compute,
        recorded.decode,
        recorded.row.receivers() as u64,
        row.len() as u64,
        statistics.len() as u64,
    ] {
        file.write_all(&number.to_le_bytes())?;
    }
    file.write_all(row)?;
    file.write_all(&statistics)
}

fn read(file: &mut impl Read) -> Result<(Digest, Recorded), Box<dyn Error>> {
    let mut key = Digest([0; 32]);
    file.read_exact(&mut key.0)?;
    let mut numbers = [0; 5];
    for number in &mut numbers {
        let mut bytes = [0; 8];
        file.read_exact(&mut bytes)?;
        *number = u64::from_le_bytes(bytes);
    }
    let [compute, decode, receivers, row_length, statistics_length] = numbers;
    let mut row = vec![0; row_length as usize];
    file.read_exact(&mut row)?;
    let mut statistics = vec![0; statistics_length as usize];
    file.read_exact(&mut statistics)?;
    let statistics = RowStatistics::decode(statistics.as_slice())?;
    Ok((
        key,
        Recorded {
            row: decode_row(&row, receivers as usize)?,
            statistics,
            bytes: row_length,
            compute,
            decode,
        },
    ))
}
