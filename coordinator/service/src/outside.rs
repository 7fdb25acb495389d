//! The process of a job as the service sees it.

use std::ffi::{OsStr, OsString};
use std::io::{self, Read};
use std::os::unix::ffi::OsStrExt;
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::process::{Child, ChildStdin, Command, ExitStatus, Stdio};
use std::sync::Arc;
use std::sync::mpsc::{self, RecvTimeoutError, Sender};
use std::thread;
use std::time::{Duration, Instant};

use cluster::metrics::BakeMetrics;
use cluster::{Answers, Cluster, ClusterError, Jobs};
use kernel::messages::RowJob;
use kernel::replica::{Digest, EncodedReplica};
use kernel::row::{JobId as RowJobId, RowRequest};
use pipeline::memory::resident_memory_bytes;
use protocol::api::Outcome;

use crate::job::Record;
use crate::pipes::messages::{Begin, FromJob, NoRows, Order, Replica, Surroundings, ToJob, Word, Workers};
use crate::pipes::{Outlet, receive};
use crate::progress::Live;
use crate::settings::Limits;
use crate::store::Store;

/// How often the process is looked at, and told of what has changed around it.
const LOOK: Duration = Duration::from_millis(20);

/// How long a process may take to end that has closed its output.
const PARTING: Duration = Duration::from_secs(1);

/// A mebibyte in bytes.
const MIB: u64 = 1 << 20;

/// How a run of a job ended.
#[derive(Debug)]
pub enum Ending {
    /// The lit file is written.
    Done(Box<Outcome>),
    /// It cannot be baked or relit.
    Failed(String),
    /// It was stopped.
    Stopped,
    /// It can resume later: there are no workers, or the disk is full.
    Later(String),
    /// Its process was killed, by the system or by a fault.
    Crashed(String),
}

/// What is needed to run a job.
pub struct JobProcess<'a> {
    /// The command that runs the job that its input names.
    pub command: &'a [OsString],
    /// The data folder.
    pub store: &'a Store,
    /// The workers of all jobs.
    pub workers: &'a Cluster,
    /// Limits of a job.
    pub limits: &'a Limits,
    /// Jobs that may run at the same time.
    pub jobs: usize,
}

impl JobProcess<'_> {
    /// Runs one job, which resumes from its checkpoint if there is one.
    pub fn run(&self, record: &Record, live: &Live) -> Ending {
        let mut child = match self.start() {
            Ok(child) => child,
            Err(error) => return Ending::Later(format!("its process cannot be started: {error}")),
        };
        let ending = match (child.stdin.take(), child.stdout.take()) {
            (Some(input), Some(output)) => self.attend(&mut child, input, output, record, live),
            _ => Ending::Later("its process has no pipes".into()),
        };
        if !matches!(ending, Ending::Done(_)) {
            self.store.remove_halves(record);
            if live.is_stopped() {
                return Ending::Stopped;
            }
        }
        ending
    }

    fn start(&self) -> io::Result<Child> {
        let mut words = self.command.iter();
        let program = words.next().map_or(OsStr::new("coordinator"), OsString::as_os_str);
        let mut command = Command::new(program);
        command.args(words).stdin(Stdio::piped()).stdout(Stdio::piped());
        // What a terminal sends to the service is not for its jobs: these end when the service says so.
        command.process_group(0).spawn()
    }

    /// Serves a process until it has ended.
    fn attend(
        &self,
        child: &mut Child,
        input: ChildStdin,
        output: impl Read + Send,
        record: &Record,
        live: &Live,
    ) -> Ending {
        let outlet = Arc::new(Outlet::new(input));
        let surroundings = self.surroundings(live);
        let begin = Order::Begin(Begin {
            data: self.store.root().as_os_str().as_bytes().to_vec(),
            job: record.id.to_string(),
            record: Store::encode(record),
            row_cache: self.limits.row_cache(),
            light_bytes: self.limits.light_bytes,
            checkpoint_bytes: self
                .limits
                .checkpoint_bytes
                .min(self.store.room_for_rows(record.id, self.jobs)),
            memory: self.limits.memory,
            surroundings,
        });
        // Where it is gone already, its output ends at once.
        let _ = outlet.send(&ToJob { order: Some(begin) });
        live.link.open(&outlet);
        let (jobs, answers) = self.workers.handle(record.header.priority).split();
        let (ends, ended) = mpsc::channel();
        thread::scope(|scope| {
            let metrics = self.workers.metrics().bake();
            let listener = Listener { jobs, workers: self.workers, metrics, outlet: &outlet, live, ends };
            let feeder = Feeder { answers, outlet: &outlet, told: surroundings };
            let listening = thread::Builder::new().spawn_scoped(scope, move || listener.listen(output));
            let feeding =
                thread::Builder::new().spawn_scoped(scope, move || feeder.feed(|| self.surroundings(live)));
            let ending = match listening.and(feeding) {
                Ok(_) => self.watch(child, &ended, live),
                Err(error) => Ending::Later(format!("no threads for its process: {error}")),
            };
            // It has said its last word, or is not wanted any more; an error says that it has ended.
            let _ = child.kill();
            let _ = child.wait();
            live.link.close();
            ending
        })
    }

    /// Waits for the last word of a process, or for a reason to end it.
    fn watch(&self, child: &mut Child, ended: &mpsc::Receiver<Ending>, live: &Live) -> Ending {
        loop {
            match ended.recv_timeout(LOOK) {
                Ok(ending) => return ending,
                Err(RecvTimeoutError::Disconnected) => return gone(child),
                Err(RecvTimeoutError::Timeout) => {}
            }
            if live.is_stopped() {
                return Ending::Stopped;
            }
            if resident_memory_bytes(child.id()).is_some_and(|bytes| bytes > self.limits.memory) {
                return Ending::Failed(too_large(self.limits.memory));
            }
        }
    }

    fn surroundings(&self, live: &Live) -> Surroundings {
        Surroundings {
            threads: self.workers.status().threads as u64,
            is_watched: live.wants_previews(),
            jobs_ahead: self.workers.jobs_ahead() as u64,
            time: self.workers.thread_time().into(),
        }
    }
}

/// What to do about a job that needs too much memory.
pub const TOO_LARGE: &str =
    "submit a smaller scene or a larger error, or start the service with a larger --memory-per-job";

/// Says that a job needs more memory than it may use, and the cure.
fn too_large(limit: u64) -> String {
    format!("it needs more than the {} MiB of memory that a job may use here: {TOO_LARGE}", limit / MIB)
}

/// Decides how a job ended whose process has closed its output without a last word.
fn gone(child: &mut Child) -> Ending {
    let until = Instant::now() + PARTING;
    loop {
        match child.try_wait() {
            Ok(Some(status)) => return of_status(status),
            Ok(None) if Instant::now() < until => thread::sleep(Duration::from_millis(1)),
            Ok(None) => return Ending::Crashed("its process fell silent".into()),
            Err(error) => return Ending::Later(format!("its process cannot be watched: {error}")),
        }
    }
}

fn of_status(status: ExitStatus) -> Ending {
    use rustix::process::Signal;
    let is = |signal: Signal| status.signal() == Some(signal.as_raw());
    if [Signal::TERM, Signal::INT, Signal::HUP].into_iter().any(is) {
        // Somebody ends all processes of the service.
        return Ending::Later("its process was told to end".into());
    }
    if is(Signal::KILL) {
        return Ending::Crashed("its process was killed, for want of memory perhaps".into());
    }
    Ending::Crashed(format!("its process ended by {status}"))
}

/// Takes what a process says, until its output ends.
struct Listener<'a> {
    jobs: Jobs,
    workers: &'a Cluster,
    metrics: BakeMetrics,
    outlet: &'a Outlet<ChildStdin>,
    live: &'a Live,
    ends: Sender<Ending>,
}

impl Listener<'_> {
    fn listen(self, mut output: impl Read) {
        while let Ok(Some(FromJob { word })) = receive(&mut output) {
            let Some(word) = word else { continue };
            let ending = match word {
                Word::Done(outcome) => Ending::Done(Box::new(outcome)),
                Word::Failed(why) => Ending::Failed(why),
                Word::Later(why) => Ending::Later(why),
                word => {
                    self.take(word);
                    continue;
                }
            };
            // Where nobody waits, the process was ended for another reason.
            let _ = self.ends.send(ending);
        }
    }

    fn take(&self, word: Word) {
        match word {
            Word::Publish(replica) => {
                if let Some(replica) = replica_of(replica) {
                    self.jobs.publish(replica);
                }
            }
            Word::Release(digest) => {
                if let Ok(digest) = Digest::try_from(digest.as_ref()) {
                    self.jobs.release(digest);
                }
            }
            Word::Submit(submit) => match submit.jobs.iter().map(request_of).collect() {
                Ok(requests) => self.jobs.submit(requests),
                Err(message) => {
                    tell(self.outlet, Order::NoRows(NoRows { is_final: true, message }));
                }
            },
            Word::Withdraw(_) => self.jobs.withdraw(),
            Word::AskWorkers(_) => {
                let parts = self.jobs.workers().into_iter().map(Into::into).collect();
                tell(self.outlet, Order::Workers(Workers { parts }));
            }
            Word::Enter(phase) => {
                self.metrics.clear();
                self.live.enter(phase);
            }
            Word::Progress(progress) => {
                if let Some(of_bake) = progress.of_bake() {
                    self.metrics.progress(&of_bake);
                }
                self.live.set(&progress, self.workers.status().workers);
            }
            Word::Preview(number) => self.live.set_preview(number),
            Word::Exported(exported) => self.live.link.exported(exported),
            Word::Done(_) | Word::Failed(_) | Word::Later(_) => {}
        }
    }
}

fn request_of(job: &RowJob) -> Result<(RowJobId, RowRequest), String> {
    RowRequest::from_job(job)
        .map(|request| (RowJobId(job.job_id), request))
        .map_err(|error| error.to_string())
}

fn replica_of(replica: Replica) -> Option<EncodedReplica> {
    let digest = Digest::try_from(replica.digest.as_ref()).ok()?;
    Some(EncodedReplica { digest, kind: replica.kind(), bytes: replica.bytes })
}

/// Hands finished rows to a process, and tells it of its surroundings, until the listener has dropped its half of the handle.
struct Feeder<'a> {
    answers: Answers,
    outlet: &'a Outlet<ChildStdin>,
    told: Surroundings,
}

impl Feeder<'_> {
    fn feed(mut self, surroundings: impl Fn() -> Surroundings) {
        let mut looked = Instant::now();
        loop {
            let is_there = match self.answers.next_within(LOOK) {
                Ok(Some(finished)) => tell(self.outlet, finished.into()),
                Ok(None) => true,
                Err(error) => {
                    let is_final = matches!(error, ClusterError::Abandoned { .. });
                    let no_rows = NoRows { is_final, message: error.to_string() };
                    tell(self.outlet, Order::NoRows(no_rows)) && error != ClusterError::Stopped
                }
            };
            if !is_there {
                return;
            }
            // It asks for a lock that every worker's connection takes, too.
            if looked.elapsed() < LOOK {
                continue;
            }
            looked = Instant::now();
            let now = surroundings();
            if now != self.told {
                self.told = now;
                if !tell(self.outlet, Order::Surroundings(now)) {
                    return;
                }
            }
        }
    }
}

/// Sends an order; returns whether the process is there.
fn tell(outlet: &Outlet<ChildStdin>, order: Order) -> bool {
    outlet.send(&ToJob { order: Some(order) }).is_ok()
}
