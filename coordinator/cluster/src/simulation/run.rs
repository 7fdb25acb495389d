use std::cell::RefCell;
use std::num::NonZeroUsize;
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use protocol::network::Network;
use protocol::security::{ClientSecurity, Transport};
use tokio::time::{sleep, timeout};
use tokio_util::sync::CancellationToken;
use turmoil::{Builder, Sim};
use worker::Settings;
use worker::passing::Passing;
use worker::pool::Compute;

use super::driver::bake;
use super::network::{ALL, NameServer, PORT, listen};
use super::plan::{CALM, Fault, Peers, Plan, WorkerPlan};
use super::room::Room;
use super::watch::{self, Counts, Watch};
use crate::connections::{AsyncCluster, ClusterSettings, Schedule, Workers};

/// Simulated time from one step to the next.
const STEP: Duration = Duration::from_millis(10);

/// Time limit after the last fault: less than a minute of work for the slowest worker alone, and the time to notice losses and
/// returns.
const PATIENCE: Duration = Duration::from_secs(90);

const COORDINATOR: &str = "coordinator";

/// How a simulation ended.
pub struct Outcome {
    /// Everything that happened.
    pub trace: Vec<String>,
    pub counts: Counts,
    /// The bits of the end state; or what does not hold that must, or that the work was not done in time.
    pub end: Result<Vec<u64>, String>,
}

fn name(worker: usize) -> String {
    format!("worker-{worker}")
}

/// Runs a simulation to its end.
pub fn run(seed: u64) -> Outcome {
    let plan = Plan::new(seed);
    watch::begin(&plan);
    let end = simulate(seed, &plan);
    let Watch { trace, violation, counts, .. } = watch::end();
    Outcome { trace, counts, end: violation.map_or(end, Err) }
}

fn simulate(seed: u64, plan: &Plan) -> Result<Vec<u64>, String> {
    let mut sim = Builder::new()
        .rng_seed(seed)
        .tick_duration(STEP)
        .max_message_latency(plan.latency)
        .min_message_latency(Duration::ZERO)
        .simulation_duration(CALM + PATIENCE)
        .tcp_capacity(1 << 14)
        .enable_random_order()
        .build();
    let names = NameServer::default();
    let shutdowns: Vec<_> = (0..)
        .zip(&plan.workers)
        .map(|(index, worker)| host(&mut sim, &names, seed, index, *worker))
        .collect();
    for index in 0..plan.workers.len() {
        names.list(&name(index), sim.lookup(name(index)));
    }
    let pairs: Vec<[String; 2]> =
        (0..plan.workers.len()).flat_map(|one| (0..one).map(move |other| [name(one), name(other)])).collect();
    for [one, other] in &pairs {
        match plan.peers {
            Peers::Together => {}
            Peers::Apart => sim.partition(one.as_str(), other.as_str()),
            Peers::Held => sim.hold(one.as_str(), other.as_str()),
        }
    }
    let mut held = plan.peers == Peers::Held;
    let result = Rc::new(RefCell::new(None));
    sim.client(COORDINATOR, coordinate(plan.clone(), names.clone(), Rc::clone(&result)));

    let mut faults = plan.faults.iter().copied().peekable();
    loop {
        while let Some((_, worker, fault)) = faults.next_if(|(time, ..)| *time <= sim.elapsed()) {
            watch::note(sim.elapsed(), format!("{} {fault:?}", name(worker)));
            let shutdown = shutdowns[worker].borrow().clone();
            befall(&mut sim, &names, &shutdown, &name(worker), fault);
        }
        if held && sim.elapsed() >= CALM {
            held = false;
            pairs.iter().for_each(|[one, other]| sim.release(one.as_str(), other.as_str()));
        }
        let is_over = sim.step().map_err(|error| error.to_string())?;
        if watch::is_violated() {
            return Err("violated".into());
        }
        if is_over {
            break;
        }
    }
    let bits = result.borrow_mut().take();
    bits.ok_or_else(|| "the coordinator ended without a result".into())
}

/// A worker's machine. Returns what tells its present process to stop.
fn host(
    sim: &mut Sim,
    names: &NameServer,
    seed: u64,
    index: usize,
    plan: WorkerPlan,
) -> Rc<RefCell<CancellationToken>> {
    let shutdown = Rc::new(RefCell::new(CancellationToken::new()));
    let present = Rc::clone(&shutdown);
    let starts = AtomicU64::new(0);
    let network: Arc<dyn Network> = Arc::new(names.clone());
    sim.host(name(index), move || {
        let start = starts.fetch_add(1, Ordering::Relaxed);
        let stop = CancellationToken::new();
        *present.borrow_mut() = stop.clone();
        let settings = Settings {
            instance: seed << 32 | (index as u64) << 16 | start,
            compute: Compute::InTask { time: plan.time },
            passing: Some(Passing {
                network: Arc::clone(&network),
                security: ClientSecurity {
                    transport: Transport::Plain { anywhere: true },
                    ..ClientSecurity::default()
                },
            }),
            ..Settings::new(&name(index), NonZeroUsize::new(plan.threads).expect("a worker has threads"))
        };
        async move {
            if start == 0 {
                sleep(plan.joins).await;
            }
            worker::serve(listen().await?, settings, stop).await?;
            Ok(())
        }
    });
    shutdown
}

async fn coordinate(plan: Plan, names: NameServer, result: Rc<RefCell<Option<Vec<u64>>>>) -> turmoil::Result {
    let addresses = match plan.one_name {
        true => vec![format!("{ALL}:{PORT}")],
        false => (0..plan.workers.len()).map(|index| format!("{}:{PORT}", name(index))).collect(),
    };
    let mut settings = ClusterSettings::from(Workers::Remote(addresses));
    settings.grace = CALM + PATIENCE;
    settings.security.transport = Transport::Plain { anywhere: true };
    if plan.periodic {
        settings.schedule = Schedule::Periodic { period: Duration::from_millis(100) };
    }
    let mut cluster = AsyncCluster::start_observed(&settings, Arc::new(names), watch::Watcher).await?;
    let bits = bake(&Room::new(), &mut cluster).await?;
    *result.borrow_mut() = Some(bits);
    // Those that are away do not answer.
    let _ = timeout(Duration::from_secs(1), cluster.leave()).await;
    Ok(())
}

fn befall(sim: &mut Sim, names: &NameServer, shutdown: &CancellationToken, worker: &str, fault: Fault) {
    match fault {
        Fault::Crash => sim.crash(worker),
        Fault::PowerCut => {
            sim.partition(worker, COORDINATOR);
            sim.crash(worker);
        }
        Fault::Drain => {
            names.remove(worker);
            shutdown.cancel();
        }
        Fault::Restart => {
            sim.repair(worker, COORDINATOR);
            names.remove(worker);
            names.list(worker, sim.lookup(worker));
            sim.bounce(worker);
        }
        Fault::Partition => sim.partition(worker, COORDINATOR),
        Fault::Repair => sim.repair(worker, COORDINATOR),
        Fault::Hold => sim.hold(worker, COORDINATOR),
        Fault::Release => sim.release(worker, COORDINATOR),
        Fault::Slow => sim.set_link_max_message_latency(worker, COORDINATOR, Duration::from_secs(2)),
        Fault::Quick => sim.set_link_max_message_latency(worker, COORDINATOR, Duration::from_millis(10)),
    }
}
