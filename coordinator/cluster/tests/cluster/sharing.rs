//! Several handles and one set of workers.

use std::collections::BTreeMap;
use std::net::TcpListener;
use std::path::Path;
use std::thread::sleep;
use std::time::{Duration, Instant};

use bake::{BakeError, BakeSettings, Baked, Observer, Phase, Progress, RowService, Unobserved, bake};
use cluster::{Cluster, ClusterSettings, Handle, JobId, Workers};
use kernel::row::Row;
use scene::Scene;
use scene::{ImportOptions, import};

use super::bakery::Bakery;
use super::server::Server;

/// Longer than any answer takes.
const LONG: Duration = Duration::from_secs(60);

fn embedded() -> Cluster {
    Cluster::start(&Workers::Embedded { threads: 2 }.into()).unwrap()
}

fn scene(name: &str) -> Scene {
    let path = Path::new("../../tests/scenes").join(name).with_extension("glb");
    import(&path, &ImportOptions::default()).unwrap()
}

fn settings() -> BakeSettings {
    BakeSettings { shooter_edge: 0.3, mesh_error: 0.05, validation_samples: 64, ..BakeSettings::default() }
}

fn baked(scene: &Scene, mut handle: Handle) -> Baked {
    bake(scene, &settings(), &mut handle, &mut Unobserved).unwrap()
}

fn assert_same(one: &Baked, other: &Baked) {
    assert_eq!(one.lit.vertices, other.lit.vertices);
    assert_eq!(one.lit.surfaces, other.lit.surfaces);
    assert_eq!(one.report.rays, other.report.rays);
}

#[test]
fn bakes_at_once_give_what_each_gives_alone() {
    let [cornell, table] = ["cornell", "table"].map(scene);
    let alone = [&cornell, &table].map(|scene| baked(scene, embedded().handle(0)));
    let cluster = embedded();
    // Twice the same scene: replicas of one are those of the other, and stay when the first is done.
    let together = std::thread::scope(|scope| {
        let bakes = [(&cornell, 0), (&table, 20), (&cornell, -20)];
        let threads = bakes.map(|(scene, priority)| {
            let handle = cluster.handle(priority);
            scope.spawn(move || baked(scene, handle))
        });
        threads.map(|thread| thread.join().unwrap())
    });
    assert_same(&together[0], &alone[0]);
    assert_same(&together[1], &alone[1]);
    assert_same(&together[2], &alone[0]);
    let status = cluster.status();
    assert_eq!((status.workers, status.threads), (1, 2));
}

/// Ends its bake once it shoots.
#[derive(Default)]
struct Impatient(bool);

impl Observer for Impatient {
    fn progress(&mut self, progress: &Progress) {
        self.0 |= progress.phase == Phase::Shoot && progress.rows > 20;
    }

    fn is_cancelled(&mut self) -> bool {
        self.0
    }
}

#[test]
fn a_cancelled_bake_takes_nothing_from_another_of_the_same_scene() {
    let cornell = scene("cornell");
    let alone = baked(&cornell, embedded().handle(0));
    let cluster = embedded();
    let stays = std::thread::scope(|scope| {
        let handle = cluster.handle(0);
        let stays = scope.spawn(|| baked(&cornell, handle));
        for _ in 0..3 {
            let (mut handle, mut impatient) = (cluster.handle(0), Impatient::default());
            let cancelled = bake(&cornell, &settings(), &mut handle, &mut impatient);
            assert!(matches!(cancelled.map(|_| ()), Err(BakeError::Cancelled)));
        }
        stays.join().unwrap()
    });
    assert_same(&stays, &alone);
}

/// Submits the jobs of the bakery `times` times. Returns their number.
fn submit(handle: &mut Handle, bakery: &Bakery, times: usize) -> usize {
    bakery.replicas().into_iter().for_each(|replica| handle.publish(replica));
    let requests: Vec<_> = (0..times).flat_map(|_| bakery.requests()).collect();
    let count = requests.len();
    handle.submit((0..).map(JobId).zip(requests).collect());
    count
}

/// Takes `count` answers and compares them with those of the engine.
fn take(handle: &mut Handle, expected: &BTreeMap<u64, Vec<Row>>, count: usize) {
    for _ in 0..count {
        let finished = handle.next_within(LONG).unwrap().expect("an answer in time");
        let first = finished.job.0 % expected.len() as u64;
        assert_eq!(finished.rows, expected[&first]);
    }
}

#[test]
fn who_comes_later_does_not_wait_for_a_long_queue() {
    let bakery = Bakery::new();
    let expected = bakery.rows();
    let cluster = embedded();
    let [mut long, mut short] = [cluster.handle(0), cluster.handle(0)];
    // So many that they take seconds, longer than a thread waits for its turn on a busy machine.
    let waiting = submit(&mut long, &bakery, 500);
    take(&mut long, &expected, 20);
    let count = submit(&mut short, &bakery, 1);
    take(&mut short, &expected, count);
    // How many, time decides; but in the order of submission the short queue would have been last.
    let answered: u64 = long.workers().iter().map(|worker| worker.jobs).sum();
    assert!(
        answered < waiting as u64,
        "all {answered} of the long queue came before {count} of the short one"
    );
    long.withdraw();
    assert!(
        matches!(long.next_within(Duration::from_millis(100)), Ok(None)),
        "an answer that nobody waits for"
    );
    let count = submit(&mut long, &bakery, 1);
    take(&mut long, &expected, count);
}

#[test]
fn without_workers_every_handle_is_told_once_the_grace_is_over() {
    let bakery = Bakery::new();
    let address = unused_address();
    let workers = Workers::Remote(vec![address.clone()]);
    let settings = ClusterSettings { grace: Duration::from_millis(300), ..workers.into() };
    let cluster = Cluster::start_in_background(&settings).unwrap();
    let mut handles = [cluster.handle(0), cluster.handle(0)];
    for handle in &mut handles {
        submit(handle, &bakery, 1);
    }
    for handle in &mut handles {
        let error = handle.next_within(LONG).unwrap_err().to_string();
        assert!(error.contains(&address), "{error}");
    }
    let mut late = cluster.handle(0);
    submit(&mut late, &bakery, 1);
    assert!(late.next_within(LONG).is_err());
}

#[test]
fn with_endless_grace_jobs_wait_for_their_workers() {
    let bakery = Bakery::new();
    let expected = bakery.rows();
    let address = unused_address();
    let workers = Workers::Remote(vec![address.clone()]);
    let settings = ClusterSettings { grace: ClusterSettings::ENDLESS_GRACE, ..workers.into() };
    let cluster = Cluster::start_in_background(&settings).unwrap();
    let mut handle = cluster.handle(0);
    let count = submit(&mut handle, &bakery, 1);
    assert!(matches!(handle.next_within(Duration::from_millis(300)), Ok(None)));
    assert_eq!(cluster.status().workers, 0);
    let first = Server::real_at(&address);
    take(&mut handle, &expected, count / 2);
    drop(first);
    let _second = Server::real_at(&address);
    take(&mut handle, &expected, count - count / 2);
    // The first may have answered all of them before it went.
    let end = Instant::now() + LONG;
    while cluster.status().workers == 0 {
        assert!(Instant::now() < end, "the second worker is not there");
        sleep(Duration::from_millis(10));
    }
    drop(cluster);
    submit(&mut handle, &bakery, 1);
    assert!(handle.next_within(LONG).is_err());
}

/// An address without a listener.
fn unused_address() -> String {
    TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().to_string()
}
