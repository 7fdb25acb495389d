//! Accounts of workers, by address: a worker that comes back goes on with its account.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use tokio::time::Instant;

use super::connect::is_at;
use super::summary::{FinishedWork, WorkerSummary};
use crate::scheduler::WorkerId;

/// The accounts of all workers that were ever connected.
#[derive(Default)]
pub(super) struct Accounts {
    /// In the order in which they were first connected.
    accounts: Vec<Account>,
    of_worker: BTreeMap<WorkerId, usize>,
    losses: u64,
}

struct Account {
    summary: WorkerSummary,
    /// While it is connected: the start, and the bytes sent since.
    open: Option<(Instant, Arc<AtomicU64>)>,
}

impl Account {
    /// The summary as of now.
    fn so_far(&self) -> WorkerSummary {
        let mut summary = self.summary.clone();
        if let Some((since, sent)) = &self.open {
            summary.connected += since.elapsed();
            summary.bytes_sent += sent.load(Ordering::Relaxed);
        }
        summary
    }

    fn close(&mut self) {
        self.summary = self.so_far();
        self.open = None;
    }
}

impl Accounts {
    /// A worker is connected. Returns whether it was before.
    pub(super) fn open(
        &mut self,
        worker: WorkerId,
        name: String,
        address: String,
        threads: usize,
        bytes_sent: Arc<AtomicU64>,
    ) -> bool {
        let known = self.accounts.iter().position(|account| account.summary.part.address == address);
        let index = known.unwrap_or_else(|| {
            let summary = WorkerSummary::new(name.clone(), address, threads);
            self.accounts.push(Account { summary, open: None });
            self.accounts.len() - 1
        });
        let account = &mut self.accounts[index];
        (account.summary.part.name, account.summary.part.threads) = (name, threads);
        account.summary.lost = None;
        account.summary.connections += 1;
        account.open = Some((Instant::now(), bytes_sent));
        self.of_worker.insert(worker, index);
        known.is_some()
    }

    /// A worker answered a job, as the first or not.
    pub(super) fn count(&mut self, worker: WorkerId, is_first: bool, work: &FinishedWork, bytes: u64) {
        let Some(summary) = self.of_worker.get(&worker).map(|index| &mut self.accounts[*index].summary)
        else {
            return;
        };
        if is_first {
            summary.part.add(work, bytes);
        } else {
            summary.part.busy += work.busy();
            summary.part.bytes_received += bytes;
        }
    }

    /// A worker answered a job that another one had answered before.
    pub(super) fn count_late(&mut self, worker: WorkerId) {
        if let Some(index) = self.of_worker.get(&worker) {
            self.accounts[*index].summary.late += 1;
        }
    }

    /// A worker is lost, or left in good order. Returns its name and address.
    pub(super) fn lose(&mut self, worker: WorkerId, reason: String, orderly: bool) -> (String, String) {
        self.losses += u64::from(!orderly);
        self.close(worker);
        let Some(account) = self.of_worker.get(&worker).map(|index| &mut self.accounts[*index]) else {
            return Default::default();
        };
        account.summary.lost = Some(reason);
        (account.summary.part.name.clone(), account.summary.part.address.clone())
    }

    /// A worker left at the end.
    pub(super) fn close(&mut self, worker: WorkerId) {
        if let Some(index) = self.of_worker.get(&worker) {
            self.accounts[*index].close();
        }
    }

    /// The name of a worker.
    pub(super) fn name(&self, worker: WorkerId) -> &str {
        self.of_worker.get(&worker).map_or("unknown", |index| &self.accounts[*index].summary.part.name)
    }

    /// The address of a worker.
    pub(super) fn address(&self, worker: WorkerId) -> &str {
        self.of_worker.get(&worker).map_or("", |index| &self.accounts[*index].summary.part.address)
    }

    /// Name, address and threads of a worker.
    pub(super) fn who(&self, worker: WorkerId) -> (String, String, usize) {
        let known = self.of_worker.get(&worker).map(|index| &self.accounts[*index].summary.part);
        known.map(|part| (part.name.clone(), part.address.clone(), part.threads)).unwrap_or_default()
    }

    /// Number of jobs that a worker computes at the same time.
    pub(super) fn threads(&self, worker: WorkerId) -> usize {
        self.of_worker.get(&worker).map_or(0, |index| self.accounts[*index].summary.part.threads)
    }

    /// Whether a worker was ever reached by a name.
    pub(super) fn knows(&self, name: &str) -> bool {
        self.accounts.iter().any(|account| is_at(&account.summary.part.address, name))
    }

    /// Whether no worker was ever connected.
    pub(super) fn is_empty(&self) -> bool {
        self.accounts.is_empty()
    }

    /// Times that a worker was lost without a goodbye.
    pub(super) fn losses(&self) -> u64 {
        self.losses
    }

    /// How each worker was lost.
    pub(super) fn reasons(&self) -> impl Iterator<Item = String> + '_ {
        let lost = |account: &Account| {
            let WorkerSummary { part, lost, .. } = &account.summary;
            lost.as_ref().map(|reason| format!("worker at {}: {reason}", part.address))
        };
        self.accounts.iter().filter_map(lost)
    }

    /// What each worker did up to now.
    pub(super) fn summaries(&self) -> Vec<WorkerSummary> {
        self.accounts.iter().map(Account::so_far).collect()
    }
}
