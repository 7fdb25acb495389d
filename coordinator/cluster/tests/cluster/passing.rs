//! Replicas passed on from worker to worker, on a clock that moves only while everything waits.

use std::collections::BTreeMap;
use std::num::NonZeroUsize;
use std::sync::Arc;
use std::time::Duration;

use cluster::{AsyncCluster, JobId};
use kernel::row::{Row, RowRequest};
use protocol::network::Network;
use protocol::security::{ClientSecurity, Transport};
use tokio::time::{Instant, sleep};
use worker::Settings;
use worker::passing::Passing;
use worker::pool::Compute;

use super::bakery::Bakery;
use super::clock::{Door, LONG, Process, SOON, Wires, cut_after, hangs, large_replica, refuses, start};

/// More than the coordinator sends a replica to at the same time.
const WORKERS: usize = 24;

fn address(worker: usize) -> String {
    format!("10.0.1.{worker}:7070")
}

/// Workers that a coordinator reaches.
struct Setting {
    cluster: AsyncCluster,
    _workers: Vec<Process>,
}

/// They find these doors to each other.
async fn setting(between: impl Fn(&Process) -> Door) -> Setting {
    setting_with(|_, process| process.plain_door(), between).await
}

/// The same, where the coordinator finds these doors, by the numbers of the workers.
async fn setting_with(to: impl Fn(usize, &Process) -> Door, between: impl Fn(&Process) -> Door) -> Setting {
    let (near, wires) = (Arc::new(Wires::default()), Arc::new(Wires::default()));
    let addresses: Vec<String> = (0..WORKERS).map(address).collect();
    let workers: Vec<Process> = addresses
        .iter()
        .enumerate()
        .map(|(number, address)| {
            let network: Arc<dyn Network> = Arc::<Wires>::clone(&wires);
            let transport = Transport::Plain { anywhere: true };
            let security = ClientSecurity { transport, ..ClientSecurity::default() };
            let process = Process::with(Settings {
                compute: Compute::InTask { time: SOON },
                passing: Some(Passing { network, security }),
                ..Settings::new(address, NonZeroUsize::MIN)
            });
            near.set(address, to(number, &process));
            wires.set(address, between(&process));
            process
        })
        .collect();
    let addresses: Vec<&str> = addresses.iter().map(String::as_str).collect();
    let cluster = start(&near, &addresses).await;
    Setting { cluster, _workers: workers }
}

impl Setting {
    /// Has a job for each worker and more computed over a large set of receivers. The rows, and how long that took.
    async fn work(&mut self) -> (BTreeMap<JobId, Vec<Row>>, Duration) {
        let bakery = Bakery::new();
        let large = large_replica(2000);
        let request = RowRequest { receivers: large.digest, ..bakery.requests()[0].clone() };
        bakery.replicas().into_iter().chain([large]).for_each(|replica| self.cluster.publish(replica));
        let jobs = 3 * WORKERS as u64;
        let requests = (0..jobs).map(|job| (JobId(job), request.clone())).collect();
        let began = Instant::now();
        self.cluster.submit(requests);
        let mut rows = BTreeMap::new();
        while (rows.len() as u64) < jobs {
            let finished = self.cluster.next().await.unwrap();
            rows.insert(finished.job, finished.rows);
        }
        (rows, began.elapsed())
    }

    async fn passed(&self) -> u64 {
        self.cluster.summarise().await.1.passed_replicas
    }

    async fn lost(&self) -> u64 {
        self.cluster.summarise().await.1.lost_workers
    }
}

#[tokio::test(start_paused = true)]
async fn workers_pass_replicas_on() {
    let mut setting = setting(Process::plain_door).await;
    let (rows, took) = setting.work().await;
    assert!(rows.values().all(|job| *job == rows[&JobId(0)]), "the same job has the same rows everywhere");
    assert!(setting.passed().await >= WORKERS as u64 / 2, "{}", setting.passed().await);
    assert!(took < Duration::from_secs(1), "{took:?}");
    assert_eq!(setting.lost().await, 0);
}

/// Where connections between workers vanish, or are refused, all work as if there were none.
#[tokio::test(start_paused = true)]
async fn workers_that_cannot_reach_each_other_get_all_from_the_coordinator() {
    for (door, longest) in [(hangs as fn() -> Door, 1500), (refuses, 500)] {
        let mut setting = setting(|_| door()).await;
        let (rows, took) = setting.work().await;
        assert!(rows.values().all(|job| *job == rows[&JobId(0)]));
        assert_eq!(setting.passed().await, 0);
        assert!(took < Duration::from_millis(longest), "{took:?}");
        assert_eq!(setting.lost().await, 0, "a firewall is no fault");
    }
}

/// A worker that takes the bytes and does nothing with them holds nobody up for long.
#[tokio::test(start_paused = true)]
async fn a_way_between_workers_that_stalls_is_given_up() {
    // Nobody reads what comes to the far end.
    let stalls = |process: &Process| {
        process.door(|_, far| {
            tokio::spawn(async move {
                sleep(LONG).await;
                drop(far);
            });
            None
        })
    };
    let mut setting = setting(stalls).await;
    let (rows, took) = setting.work().await;
    assert!(rows.values().all(|job| *job == rows[&JobId(0)]));
    assert!(took < Duration::from_millis(1500), "{took:?}");
    assert_eq!((setting.passed().await, setting.lost().await), (0, 0));
}

/// Workers that are lost while others get replicas from them do not take these with them.
#[tokio::test(start_paused = true)]
async fn the_tree_heals_when_workers_are_lost() {
    // The first to hold a replica are cut off while they pass it on; they are dialled again.
    let first = |number, process: &Process| {
        process.door(move |connection, far| match (number, connection) {
            (0..4, 0..2) => Some(cut_after(3 * SOON / 2, far)),
            _ => Some(far),
        })
    };
    let mut setting = setting_with(first, Process::plain_door).await;
    let (rows, took) = setting.work().await;
    assert!(rows.values().all(|job| *job == rows[&JobId(0)]));
    assert_eq!(setting.lost().await, 4);
    assert!(setting.passed().await > 0);
    assert!(took < Duration::from_secs(1), "{took:?}");
}

/// At the address that the coordinator has of a worker another one may answer, seen from elsewhere.
#[tokio::test(start_paused = true)]
async fn an_address_that_leads_elsewhere_is_noticed() {
    let stranger = Process::start(SOON).leak();
    let mut setting = setting(|_| stranger.plain_door()).await;
    let (rows, took) = setting.work().await;
    assert!(rows.values().all(|job| *job == rows[&JobId(0)]));
    assert_eq!(setting.passed().await, 0);
    assert!(took < Duration::from_millis(500), "{took:?}");
}
