//! All jobs in memory: reads are answered from here, without the disk.
//!
//! | module | what lives there |
//! |---|---|
//! | `arriving` | jobs whose record is being written |
//! | `views` | jobs as clients see them |

mod arriving;
mod views;

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;
use std::time::SystemTime;

use protocol::api::State;
use tokio::sync::watch;

use super::job::{ClientName, JobId, Record, SceneDigest, Sequence, next_revision};
use super::progress::Live;
use super::queue::{Action, Event, Places, Priority, Queue, Waiting};
use super::refusal::Refusal;
use arriving::Arriving;

/// A job in memory.
#[derive(Debug)]
pub struct Entry {
    /// Its record.
    pub record: Record,
    /// Its live state, while it runs.
    pub live: Option<Arc<Live>>,
    changed: watch::Sender<()>,
}

/// All jobs in memory.
#[derive(Debug)]
pub struct Ledger {
    entries: BTreeMap<JobId, Entry>,
    by_sequence: BTreeMap<Sequence, JobId>,
    by_key: HashMap<(ClientName, String), JobId>,
    arriving: Arriving,
    queue: Queue,
    /// Jobs ahead of each queued job; computed on demand.
    ahead: Option<HashMap<JobId, u32>>,
    queue_changed: watch::Sender<()>,
    /// Number of changes of the queue, each of which may move queued jobs.
    queue_changes: u64,
}

impl Ledger {
    /// Creates an empty ledger.
    #[must_use]
    pub fn new(places: Places) -> Self {
        Self {
            entries: BTreeMap::new(),
            by_sequence: BTreeMap::new(),
            by_key: HashMap::new(),
            arriving: Arriving::default(),
            queue: Queue::new(places),
            ahead: None,
            queue_changed: watch::channel(()).0,
            queue_changes: 0,
        }
    }

    /// Starts no jobs until [`Event::Opened`].
    pub fn hold(&mut self) {
        self.tell_queue(Event::Closed);
    }

    /// Gives a job its position. It counts from now on, until it is inserted or dismissed.
    pub fn announce(&mut self, record: Record) -> Record {
        let last = self.by_sequence.last_key_value().map_or(Sequence::default(), |(last, _)| *last);
        self.arriving.announce(record, last)
    }

    /// Drops an announced job.
    pub fn dismiss(&mut self, job: JobId) {
        self.arriving.dismiss(job);
    }

    /// Whether a job of the same client and key is being written.
    #[must_use]
    pub fn is_arriving(&self, draft: &Record) -> bool {
        self.arriving.has_key_of(draft)
    }

    /// Adds a job, and returns the queue's actions.
    pub fn insert(&mut self, record: Record) -> Vec<Action> {
        let id = record.id;
        self.arriving.dismiss(id);
        self.by_sequence.insert(record.sequence, id);
        if !record.header.idempotency_key.is_empty() {
            self.by_key.insert((record.client.clone(), record.header.idempotency_key.clone()), id);
        }
        let waiting = (!record.has_ended()).then(|| Waiting {
            client: record.client.clone(),
            priority: Priority(record.header.priority),
            sequence: record.sequence,
        });
        self.entries.insert(id, Entry { record, live: None, changed: watch::channel(()).0 });
        waiting.map(|waiting| self.tell_queue(Event::Submitted(id, waiting))).unwrap_or_default()
    }

    /// Removes a job, which has ended or was withdrawn.
    pub fn remove(&mut self, job: JobId) -> Option<Entry> {
        let entry = self.entries.remove(&job)?;
        self.by_sequence.remove(&entry.record.sequence);
        let key = (entry.record.client.clone(), entry.record.header.idempotency_key.clone());
        if self.by_key.get(&key) == Some(&job) {
            self.by_key.remove(&key);
        }
        Some(entry)
    }

    /// Passes an event to the queue, marks jobs that start as running, and returns the queue's actions.
    pub fn tell_queue(&mut self, event: Event) -> Vec<Action> {
        let actions = self.queue.handle(event);
        self.ahead = None;
        self.queue_changes += 1;
        for action in &actions {
            if let Action::Start(job) = action
                && let Some(entry) = self.entries.get_mut(job)
            {
                entry.live = Some(Arc::new(Live::new(entry.changed.clone())));
                entry.record.state = State::Running;
                entry.record.started = Some(SystemTime::now());
                entry.touch(self.queue_changes);
            }
        }
        self.queue_changed.send_replace(());
        actions
    }

    /// Returns a job of any client.
    #[must_use]
    pub fn entry(&self, job: JobId) -> Option<&Entry> {
        self.entries.get(&job)
    }

    /// Changes a job.
    pub fn change(&mut self, job: JobId, change: impl FnOnce(&mut Entry)) {
        if let Some(entry) = self.entries.get_mut(&job) {
            change(entry);
            entry.touch(self.queue_changes);
        }
    }

    /// Returns a job of this client.
    ///
    /// # Errors
    /// When it does not exist or is another client's, without telling which.
    pub fn of_client(&self, client: &ClientName, id: &str) -> Result<&Entry, Refusal> {
        let entry = id.parse().ok().and_then(|id: JobId| self.entries.get(&id));
        entry.filter(|entry| entry.record.client == *client).ok_or_else(|| {
            Refusal::UnknownJob(id.chars().filter(|character| !character.is_control()).take(40).collect())
        })
    }

    /// Returns the job that this client submitted with this key.
    #[must_use]
    pub fn by_key(&self, client: &ClientName, key: &str) -> Option<&Entry> {
        if key.is_empty() {
            return None;
        }
        self.by_key.get(&(client.clone(), key.to_owned())).and_then(|job| self.entries.get(job))
    }

    /// Returns all jobs, oldest first.
    pub fn all(&self) -> impl DoubleEndedIterator<Item = &Entry> {
        self.by_sequence.values().filter_map(|job| self.entries.get(job))
    }

    /// Whether a job other than `but` uses a scene.
    #[must_use]
    pub fn uses(&self, scene: SceneDigest, but: JobId) -> bool {
        self.records().any(|record| record.scene == scene && record.id != but)
    }

    /// Whether any job uses a scene.
    #[must_use]
    pub fn has_any_of(&self, scene: SceneDigest) -> bool {
        self.records().any(|record| record.scene == scene)
    }

    /// Includes arriving jobs.
    fn records(&self) -> impl Iterator<Item = &Record> {
        self.entries.values().map(|entry| &entry.record).chain(self.arriving.all())
    }

    /// Whether a job other than `but` uses the light that a baked job has kept.
    #[must_use]
    pub fn uses_light(&self, baked: JobId, but: JobId) -> bool {
        self.records().any(|record| record.light() == baked && record.id != but)
    }

    /// Whether this client has a job of a scene, and need not upload it again. Scenes of other clients do not count: a digest does
    /// not prove that the client has the file.
    #[must_use]
    pub fn has_scene(&self, client: &ClientName, scene: SceneDigest) -> bool {
        self.entries.values().any(|entry| entry.record.scene == scene && entry.record.client == *client)
    }

    /// Counts the unfinished jobs of a client.
    #[must_use]
    pub fn unfinished(&self, client: &ClientName) -> usize {
        let is_counted = |record: &&Record| record.client == *client && !record.has_ended();
        self.records().filter(is_counted).count()
    }

    /// Returns the numbers of queued and running jobs.
    #[must_use]
    pub fn load(&self) -> (usize, usize) {
        (self.queue.waiting(), self.queue.running())
    }
}

impl Entry {
    /// Raises the revision beyond those shown last, to which [`Ledger::show`] adds changes of the queue or the run.
    fn touch(&mut self, queue_changes: u64) {
        let changes = self.live.as_ref().map_or(0, |live| live.progress().1);
        self.record.revision = next_revision(self.record.revision + changes.max(queue_changes));
        self.changed.send_replace(());
    }
}
