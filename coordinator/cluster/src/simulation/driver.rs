//! A small bake. Like the whole one it chooses jobs from the results of earlier ones; the end state must not depend on their time or
//! origin.

use std::collections::{BTreeMap, HashMap};

use kernel::replica::{Digest, EncodedReplica};
use kernel::row::{Row, RowRequest, decode_row};
use worker::job::Job;
use worker::store::{Replica, ReplicaStore};

use super::room::Room;
use crate::connections::{AsyncCluster, ClusterError, FinishedJob, JobId};
use bake::solver::ShareId;
use bake::solver::cache::{RowCache, SetId};
use bake::solver::shooting::Shooting;

/// Shots under way, and shares whose rows over the fine receivers are.
const WINDOW: usize = 24;

/// Rows of a job.
const ROWS: usize = 2;

/// Answers jobs.
pub trait JobService {
    fn publish(&mut self, replica: EncodedReplica);
    fn release(&mut self, digest: Digest);
    fn submit(&mut self, requests: Vec<(JobId, RowRequest)>);
    async fn next(&mut self) -> Result<FinishedJob, ClusterError>;
}

impl JobService for AsyncCluster {
    fn publish(&mut self, replica: EncodedReplica) {
        AsyncCluster::publish(self, replica);
    }

    fn release(&mut self, digest: Digest) {
        AsyncCluster::release(self, digest);
    }

    fn submit(&mut self, requests: Vec<(JobId, RowRequest)>) {
        AsyncCluster::submit(self, requests);
    }

    async fn next(&mut self) -> Result<FinishedJob, ClusterError> {
        AsyncCluster::next(self).await
    }
}

/// Bakes. Returns the bits of all that was shot and received.
pub async fn bake(room: &Room, service: &mut impl JobService) -> Result<Vec<u64>, ClusterError> {
    service.publish(room.scene.clone());
    service.publish(room.coarse.clone());
    let mut jobs = Jobs { room, service, next: 0, shares: HashMap::new() };

    let mut cache = RowCache::new(usize::MAX);
    let set: SetId = cache.add_set(room.shares.len());
    let mut shooting = Shooting::new(room.shares.clone(), room.direct.clone(), set, WINDOW, 1e-4);
    let mut wanted = shooting.start(&cache);
    while !shooting.is_done() {
        jobs.submit(&wanted, false);
        wanted.clear();
        for (share, row) in jobs.next().await? {
            wanted.extend(shooting.row_arrived(share, row, &mut cache));
        }
    }
    let shot = shooting.into_shot();

    jobs.service.release(room.coarse.digest);
    jobs.service.publish(room.fine.clone());
    let mut irradiance = vec![0.0; room.fine_count];
    let mut wanted = (0..room.shares.len() as u32).map(ShareId);
    let mut first: Vec<ShareId> = wanted.by_ref().take(WINDOW).collect();
    let mut arrived = BTreeMap::new();
    let mut applied = 0;
    while applied < room.shares.len() {
        jobs.submit(&first, true);
        first.clear();
        arrived.extend(jobs.next().await?);
        while let Some(row) = arrived.remove(&ShareId(applied as u32)) {
            row.for_each(|receiver, factor| irradiance[receiver] += f64::from(factor) * shot[applied]);
            applied += 1;
            first.extend(wanted.next());
        }
    }
    jobs.service.release(room.fine.digest);
    Ok(shot.into_iter().chain(irradiance).map(f64::to_bits).collect())
}

/// Jobs without an answer.
struct Jobs<'a, S> {
    room: &'a Room,
    service: &'a mut S,
    next: u64,
    shares: HashMap<JobId, Vec<ShareId>>,
}

impl<S: JobService> Jobs<'_, S> {
    fn submit(&mut self, shares: &[ShareId], over_fine: bool) {
        let requests = shares.chunks(ROWS).map(|shares| {
            let job = JobId(self.next);
            self.next += 1;
            self.shares.insert(job, shares.to_vec());
            (job, self.room.request(shares, over_fine))
        });
        self.service.submit(requests.collect());
    }

    async fn next(&mut self) -> Result<Vec<(ShareId, Row)>, ClusterError> {
        let FinishedJob { job, rows, .. } = self.service.next().await?;
        let shares = self.shares.remove(&job).unwrap_or_else(|| panic!("job {job} came twice, or unasked"));
        assert_eq!(shares.len(), rows.len(), "rows of job {job}");
        Ok(shares.into_iter().zip(rows).collect())
    }
}

/// Computes jobs without a cluster, the last one first.
struct Alone {
    store: ReplicaStore,
    jobs: Vec<(JobId, RowRequest)>,
}

impl JobService for Alone {
    fn publish(&mut self, EncodedReplica { digest, kind, bytes }: EncodedReplica) {
        self.store.insert(digest, Replica::decode(kind, &bytes).unwrap(), bytes.len() as u64);
    }

    fn release(&mut self, digest: Digest) {
        self.store.remove(digest);
    }

    fn submit(&mut self, requests: Vec<(JobId, RowRequest)>) {
        self.jobs.extend(requests);
    }

    async fn next(&mut self) -> Result<FinishedJob, ClusterError> {
        let (job, request) = self.jobs.pop().expect("a job is under way");
        let finished = Job::new(&request.to_job(job.0), &mut self.store).unwrap().compute();
        let decode = |bytes| decode_row(bytes, request.receiver_count as usize).unwrap();
        Ok(FinishedJob {
            job,
            rows: finished.rows.iter().map(|row| decode(row)).collect(),
            statistics: vec![],
        })
    }
}

/// The bits of a bake that nothing disturbs.
pub fn undisturbed() -> Vec<u64> {
    let mut alone = Alone { store: ReplicaStore::new(u64::MAX), jobs: vec![] };
    let runtime = tokio::runtime::Builder::new_current_thread().build().unwrap();
    runtime.block_on(bake(&Room::new(), &mut alone)).unwrap()
}
