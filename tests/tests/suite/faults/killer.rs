use protocol::worker::RowJob;

use super::bake_by;
use super::fake::{FakeWorker, Nature};

/// The share whose rows nobody survives.
const DEADLY: u64 = 40;

#[test]
fn a_job_that_kills_every_worker_is_named_and_given_up() {
    let is_deadly = |job: &RowJob| job.shooters.iter().any(|shooter| shooter.key == DEADLY);
    let mortal = || Nature::answering(move |job, honest| (!is_deadly(job)).then(|| vec![honest]));
    let workers = [FakeWorker::start(mortal()), FakeWorker::start(mortal())];
    let addresses = workers.each_ref().map(|worker| worker.address.as_str());
    let solved = bake_by(&addresses, &["--worker-grace", "600"]).finish();
    assert!(!solved.success && solved.lit.is_none(), "{}", solved.said);
    let error = solved.said.lines().last().unwrap();
    for word in ["error: ", "job ", "cannot be computed", "workers were lost while they computed this job"] {
        assert!(error.contains(word), "{word:?} is missing in: {error}");
    }
}
