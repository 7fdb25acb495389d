//! From the first order to the last word.

use std::ffi::OsString;
use std::fs;
use std::io::{self, Read, Write};
use std::os::unix::ffi::OsStringExt;
use std::path::PathBuf;
use std::process;
use std::sync::Arc;
use std::sync::mpsc::{self, Sender};
use std::thread;

use super::observer::Reporter;
use super::preview::Preview;
use super::rows::PipeRows;
use super::run::{Ending, Job, run};
use super::world::World;
use crate::pipes::messages::{Begin, ExportPreview, Exported, FromJob, Order, ToJob, Word};
use crate::pipes::{Outlet, receive};
use crate::store::Store;

/// Runs the job that the first order names. Ends the process when the input ends: then the service is gone.
///
/// # Errors
/// When the input begins with anything but a job, or no thread can be started.
pub fn run_job(mut input: impl Read + Send + 'static, output: impl Write + Send + 'static) -> io::Result<()> {
    be_killed_first();
    let Some(ToJob { order: Some(Order::Begin(begin)) }) = receive(&mut input)? else {
        return Err(io::Error::other("a job is begun by the service: use `coordinator serve`"));
    };
    let outlet = Arc::new(Outlet::new(output));
    let (world, preview) = (Arc::new(World::default()), Arc::new(Preview::default()));
    world.set(begin.surroundings);
    let (answers, answered) = mpsc::channel();
    let listener = Listener {
        outlet: Arc::clone(&outlet),
        world: Arc::clone(&world),
        preview: Arc::clone(&preview),
        answers,
    };
    thread::Builder::new().name("orders".into()).spawn(move || listener.listen(input))?;
    let mut rows = PipeRows::new(Arc::clone(&outlet), answered, Arc::clone(&world));
    let mut reporter = Reporter::new(Arc::clone(&outlet), world, preview);
    let word = match job_of(&begin) {
        Some(job) => match run(&job, &mut rows, &mut reporter) {
            Ending::Done(outcome) => Word::Done(*outcome),
            Ending::Failed(why) => Word::Failed(why),
            Ending::Later(why) => Word::Later(why),
        },
        None => Word::Failed("its record cannot be read".into()),
    };
    outlet.send(&FromJob { word: Some(word) })
}

fn job_of(begin: &Begin) -> Option<Job> {
    let data = PathBuf::from(OsString::from_vec(begin.data.clone()));
    let record = Store::decode(begin.job.parse().ok()?, &begin.record)?;
    Some(Job {
        store: Store::within(&data),
        record,
        row_cache: begin.row_cache as usize,
        light_bytes: begin.light_bytes,
        checkpoint_bytes: begin.checkpoint_bytes,
        memory: begin.memory,
    })
}

/// Asks Linux to end this process before the service and its workers where memory runs out.
fn be_killed_first() {
    // Anywhere else, all have the same chance.
    let _ = fs::write("/proc/self/oom_score_adj", "500");
}

/// Reads orders as they come: neither side ever waits for the other to read.
struct Listener<W: Write> {
    outlet: Arc<Outlet<W>>,
    world: Arc<World>,
    preview: Arc<Preview>,
    answers: Sender<Order>,
}

impl<W: Write + Send + 'static> Listener<W> {
    fn listen(self, mut input: impl Read) {
        while let Ok(Some(ToJob { order })) = receive(&mut input) {
            match order {
                Some(Order::Surroundings(now)) => self.world.set(now),
                Some(Order::ExportPreview(wanted)) => self.export(wanted),
                Some(order) => {
                    // The job may be over.
                    let _ = self.answers.send(order);
                }
                None => {}
            }
        }
        process::exit(1);
    }

    /// Exports the latest preview in a thread of its own.
    fn export(&self, ExportPreview { path }: ExportPreview) {
        let (outlet, preview) = (Arc::clone(&self.outlet), Arc::clone(&self.preview));
        let export = move || {
            let (number, failure) = match preview.export(&PathBuf::from(OsString::from_vec(path.clone()))) {
                Ok(number) => (number, String::new()),
                Err(error) => (0, error.to_string()),
            };
            outlet.say(Word::Exported(Exported { path, number, failure }));
        };
        if let Err(error) = thread::Builder::new().name("preview".into()).spawn(export) {
            tracing::error!(%error, "cannot start a thread for a preview");
        }
    }
}
