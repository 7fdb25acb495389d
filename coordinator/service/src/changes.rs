//! State changes of jobs, one at a time: on disk first, then in memory, so that no client sees a state that a crash could undo.

use std::io;
use std::sync::Arc;
use std::thread;
use std::time::{Duration, Instant, SystemTime};

use protocol::api::{Outcome, State};

use crate::Inner;
use crate::job::{ClientName, JobId, Record};
use crate::ledger::Entry;
use crate::outside::{Ending, JobProcess};
use crate::progress::Live;
use crate::queue::{Action, Event};
use crate::refusal::Refusal;
use crate::store::{expired, remove_file};
use crate::sync::lock;

/// How long a job waits before it is tried again.
const AGAIN: Duration = Duration::from_secs(10);

/// How often a waiting job checks whether it was stopped.
const LOOK: Duration = Duration::from_millis(50);

/// How often the process of a job may be killed or fall before the job is given up.
const MOST_CRASHES: u32 = 3;

/// Most characters of a failure or warning, and most warnings, stored of a job: it must fit into a message.
const MOST_WORDS: usize = 2000;
const MOST_WARNINGS: usize = 100;

impl Inner {
    /// Carries out the queue's actions.
    pub(super) fn perform(self: &Arc<Self>, actions: Vec<Action>) {
        for action in actions {
            match action {
                Action::Stop(job) => {
                    if let Some(live) = lock(&self.ledger).entry(job).and_then(|entry| entry.live.as_ref()) {
                        live.stop();
                    }
                }
                Action::Start(job) => self.start(job),
            }
        }
        self.metrics.load(lock(&self.ledger).load());
    }

    fn start(self: &Arc<Self>, job: JobId) {
        let begun = lock(&self.ledger)
            .entry(job)
            .and_then(|entry| Some((entry.record.clone(), entry.live.as_ref()?.begin())));
        let Some((record, live)) = begun else {
            // Deleted before it started.
            let actions = lock(&self.ledger).tell_queue(Event::Left(job));
            return self.perform(actions);
        };
        let inner = Arc::clone(self);
        let work = move || {
            let process = JobProcess {
                command: &inner.job_command,
                store: &inner.store,
                workers: &inner.workers,
                limits: &inner.limits,
                jobs: inner.jobs,
            };
            tracing::info!(job = %record.id, client = %record.client, "begins");
            let ending = process.run(&record, &live);
            inner.leave(&record, &live, ending);
        };
        if let Err(error) = thread::Builder::new().name("job".into()).spawn(work) {
            tracing::error!(%error, "cannot start a thread for a job");
            let actions = lock(&self.ledger).tell_queue(Event::Left(job));
            self.perform(actions);
        }
    }

    /// Ends the thread of a job: stores the result, or queues the job again.
    fn leave(self: &Arc<Self>, record: &Record, live: &Live, ending: Ending) {
        let job = record.id;
        let again = self.settle(record, ending);
        if let Err(why) = &again {
            if !why.is_empty() {
                tracing::warn!(%job, why, "waits, to resume later");
            }
            lock(&self.ledger).change(job, |entry| entry.record.state = State::Queued);
            let until = Instant::now() + AGAIN;
            while !live.is_stopped() && Instant::now() < until {
                thread::sleep(LOOK);
            }
        }
        let changing = lock(&self.changing);
        let has_ended = lock(&self.ledger).entry(job).is_none_or(|entry| entry.record.has_ended());
        if again.is_err() && has_ended {
            // Cancelled or deleted while it waited.
            self.remove_files(record);
        }
        let actions = {
            let mut ledger = lock(&self.ledger);
            ledger.change(job, |entry| entry.live = None);
            ledger.tell_queue(if has_ended { Event::Left(job) } else { Event::PutBack(job) })
        };
        drop(changing);
        self.perform(actions);
    }

    /// Stores how a job ended; an error is why it must run again.
    fn settle(&self, record: &Record, ending: Ending) -> Result<(), String> {
        let _changing = lock(&self.changing);
        let now = lock(&self.ledger).entry(record.id).map(|entry| entry.record.clone());
        let Some(now) = now.filter(|now| !now.has_ended()) else {
            // Cancelled or deleted meanwhile.
            self.remove_files(record);
            return Ok(());
        };
        let ended = match ending {
            Ending::Done(outcome) => {
                let warnings =
                    outcome.warnings.iter().take(MOST_WARNINGS).map(|warning| shortened(warning)).collect();
                now.ended(State::Done, String::new(), Some(Outcome { warnings, ..*outcome }))
            }
            Ending::Failed(why) => now.ended(State::Failed, shortened(&why), None),
            // The service is ending; the job resumes at the next start.
            Ending::Stopped => return Err(String::new()),
            Ending::Later(why) => return Err(why),
            Ending::Crashed(why) => {
                let crashes = now.crashes + 1;
                let now = Record { crashes, ..now };
                if crashes < MOST_CRASHES {
                    // Not counted where the disk fails.
                    let _ = self.store.change(&now);
                    lock(&self.ledger).change(record.id, |entry| entry.record.crashes = crashes);
                    return Err(why);
                }
                now.ended(State::Failed, shortened(&format!("given up after {crashes} times: {why}")), None)
            }
        };
        // If this fails, the job runs again, quickly: its rows are in the checkpoint.
        self.store.change(&ended).map_err(|error| format!("its record cannot be written: {error}"))?;
        tracing::info!(job = %ended.id, state = ended.state.as_str_name(), failure = ended.failure, "ended");
        self.metrics.ended(ended.state);
        lock(&self.ledger).change(record.id, |entry| entry.record = ended);
        if let Err(error) = self.store.end_checkpoint(record) {
            tracing::warn!(%error, "a checkpoint cannot be removed");
        }
        Ok(())
    }

    fn remove_files(&self, record: &Record) {
        // Light that only this unfinished bake could have kept.
        let is_last = record.relit.is_none() || !lock(&self.ledger).uses_light(record.light(), record.id);
        let light = if is_last { self.store.remove_light(record.light()) } else { Ok(()) };
        let own =
            [self.store.checkpoint(record.id), self.store.result(record)].map(|path| remove_file(&path));
        for error in own.into_iter().chain([light]).filter_map(Result::err) {
            tracing::warn!(%error, "a file of a job that is gone cannot be removed");
        }
        self.drop_scene(record);
    }

    /// Removes the scene of a deleted job, unless other jobs use it.
    pub(super) fn drop_scene(&self, record: &Record) {
        if !lock(&self.ledger).has_any_of(record.scene) {
            // On failure, the next start sets it aside.
            let _ = self.store.remove_scene(record.scene);
        }
    }

    /// Cancels a job, unless it has ended.
    pub(super) fn cancel(self: &Arc<Self>, client: &ClientName, id: &str) -> Result<(), Refusal> {
        let changing = lock(&self.changing);
        let record = lock(&self.ledger).of_client(client, id)?.record.clone();
        if record.has_ended() {
            return Ok(());
        }
        let cancelled = record.ended(State::Cancelled, String::new(), None);
        self.store.change(&cancelled)?;
        tracing::info!(job = %record.id, %client, "cancelled");
        self.metrics.ended(State::Cancelled);
        let actions = {
            let mut ledger = lock(&self.ledger);
            ledger.change(record.id, |entry| entry.record = cancelled);
            ledger.tell_queue(Event::Withdrawn(record.id))
        };
        if actions.iter().all(|action| *action != Action::Stop(record.id)) {
            // It did not run: no thread will remove it.
            let _ = remove_file(&self.store.checkpoint(record.id));
        }
        drop(changing);
        self.perform(actions);
        Ok(())
    }

    /// Deletes a job.
    pub(super) fn delete(self: &Arc<Self>, client: &ClientName, id: &str) -> Result<(), Refusal> {
        let changing = lock(&self.changing);
        let record = lock(&self.ledger).of_client(client, id)?.record.clone();
        let actions = self.forget(&record)?;
        drop(changing);
        tracing::info!(job = %record.id, %client, "deleted");
        self.perform(actions);
        Ok(())
    }

    /// Deletes a job, while [`Self::changing`] is held.
    fn forget(&self, record: &Record) -> Result<Vec<Action>, Refusal> {
        let live = lock(&self.ledger).entry(record.id).and_then(|entry| entry.live.clone());
        let runs = live.is_some_and(|live| live.has_begun());
        // A running job may still read its scene and light; its thread removes them.
        self.remove(record, runs)?;
        let mut ledger = lock(&self.ledger);
        // Stopped by its handle: it is not found by name any more.
        if let Some(live) = ledger.entry(record.id).and_then(|entry| entry.live.as_ref()) {
            live.stop();
        }
        let actions = ledger.tell_queue(Event::Withdrawn(record.id));
        ledger.remove(record.id);
        Ok(actions)
    }

    /// Removes a job's files, while [`Self::changing`] is held; its scene and light only if no other job uses them.
    pub(super) fn remove(&self, record: &Record, keeps_both: bool) -> io::Result<()> {
        let (keeps_scene, keeps_light) = {
            let ledger = lock(&self.ledger);
            (ledger.uses(record.scene, record.id), ledger.uses_light(record.light(), record.id))
        };
        self.store.remove(record, keeps_both || keeps_scene, keeps_both || keeps_light)
    }

    /// Deletes expired jobs.
    pub(super) fn tidy(self: &Arc<Self>) {
        let _changing = lock(&self.changing);
        self.store.reserve();
        let room = match self.store.room() {
            Ok(room) => room,
            Err(error) => return tracing::warn!(%error, "cannot measure the free space"),
        };
        self.metrics.room(room.taken, room.free);
        let ended: Vec<Record> = {
            let ledger = lock(&self.ledger);
            let has_left = |entry: &&Entry| entry.record.has_ended() && entry.live.is_none();
            ledger.all().filter(has_left).map(|entry| entry.record.clone()).collect()
        };
        let sizes = ended
            .iter()
            .map(|record| (record.id, record.ended.unwrap_or(record.submitted), self.store.size_of(record)))
            .collect();
        let too_many = room.taken.saturating_sub(self.limits.keep_bytes);
        let gone = expired(sizes, SystemTime::now(), self.limits.keep_age, too_many);
        for record in ended.iter().filter(|record| gone.contains(&record.id)) {
            match self.forget(record) {
                Ok(_) => tracing::info!(job = %record.id, "expired"),
                Err(error) => tracing::warn!(%error, "an expired job cannot be removed"),
            }
        }
    }
}

/// Returns as much of a text as is stored.
fn shortened(text: &str) -> String {
    match text.char_indices().nth(MOST_WORDS) {
        Some((end, _)) => format!("{} …", &text[..end]),
        None => text.to_owned(),
    }
}
