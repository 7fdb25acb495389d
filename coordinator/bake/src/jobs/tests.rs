//! Rows from a service that answers the last job first.

use std::time::Duration;

use glam::DVec3;
use kernel::geometry::{ConvexPolygon, PlaneId};
use kernel::messages::RowStatistics;
use kernel::replica::{Digest, EncodedReplica, Receiver, Receivers, encode_scene};
use kernel::row::{FinishedJob, JobId, Row, RowRequest, Shape, Shooter};
use kernel::visibility::MANY_POLYGONS;

use super::{RowClient, RowService, ThreadTime};
use crate::error::BakeError;
use crate::observer::Unobserved;

/// The factor of a receiver is the key of the shooter and the receiver's index.
#[derive(Default)]
struct Backwards {
    jobs: Vec<(JobId, RowRequest)>,
    /// Jobs that had been asked for when the first answer was.
    asked_ahead: Option<usize>,
    /// Rows of each job.
    sizes: Vec<usize>,
}

impl RowService for Backwards {
    fn publish(&mut self, _: EncodedReplica) {}

    fn release(&mut self, _: Digest) {}

    fn submit(&mut self, requests: Vec<(JobId, RowRequest)>) {
        self.sizes.extend(requests.iter().map(|(_, request)| request.shooters.len()));
        self.jobs.extend(requests);
    }

    fn withdraw(&mut self) {
        self.jobs.clear();
    }

    fn next(&mut self, _: Duration) -> Result<Option<FinishedJob>, BakeError> {
        self.asked_ahead.get_or_insert(self.jobs.len());
        let (job, request) = self.jobs.pop().expect("a job is under way");
        let receivers = request.first_receiver..request.first_receiver + request.receiver_count;
        let row = |shooter: &Shooter| {
            Row::new(&receivers.clone().map(|at| factor(shooter.key, at)).collect::<Vec<f32>>())
        };
        let rows = request.shooters.iter().map(row).collect();
        let variance = f64::from(request.receiver_count);
        let statistics = RowStatistics { sampling_variance: variance, ..RowStatistics::default() };
        Ok(Some(FinishedJob { job, rows, statistics: vec![statistics; request.shooters.len()] }))
    }
}

fn factor(key: u64, receiver: u32) -> f32 {
    (key * 10_000) as f32 + receiver as f32
}

fn receivers(count: usize) -> Receivers {
    let receiver = Receiver { position: DVec3::ZERO, normal: DVec3::Z, plane: PlaneId(0) };
    Receivers { first_key: count as u64, receivers: vec![receiver; count] }
}

/// Asks for the rows of three shooters, one of them of many polygons, over some sets. Returns set, row and variance in the order in
/// which they came, and the jobs asked for ahead.
fn rows_over(counts: &[usize]) -> (Vec<(usize, usize, f64)>, usize) {
    let mut service = Backwards::default();
    let mut observer = Unobserved;
    let began = (std::time::Instant::now(), ThreadTime::default());
    let mut client = RowClient::new(&mut service, &mut observer, encode_scene(&[]), began);
    let sets: Vec<_> = counts.iter().map(|count| client.publish_receivers(&receivers(*count))).collect();
    let polygon = ConvexPolygon { plane: PlaneId(1), corners: vec![DVec3::X, DVec3::Y, DVec3::Z] };
    let shapes = [
        Shape::Point(DVec3::Z),
        Shape::Polygons(vec![polygon; 4 * MANY_POLYGONS]),
        Shape::Directional(DVec3::NEG_Z),
    ];
    let shooters: Vec<Shooter> = (0..).zip(shapes).map(|(key, shape)| Shooter { key, shape }).collect();
    let mut taken = vec![];
    let take = |set: usize, row: usize, factors: &Row, variance| {
        let expected: Vec<f32> = (0..counts[set] as u32).map(|at| factor(row as u64, at)).collect();
        assert_eq!(factors.to_dense(), expected, "row {row} over set {set}");
        taken.push((set, row, variance));
    };
    client.each_row(&shooters, &sets, take).unwrap();
    drop(client);
    (taken, service.asked_ahead.unwrap_or_default())
}

#[test]
fn rows_come_in_order_whole_and_once_whatever_the_order_of_the_jobs() {
    let (taken, asked_ahead) = rows_over(&[1000, 0, 10]);
    let expected = |set: usize, count: usize| (0..3).map(move |row| (set, row, count as f64));
    let all: Vec<_> = expected(0, 1000).chain(expected(1, 0)).chain(expected(2, 10)).collect();
    assert_eq!(taken, all);
    assert_eq!(
        asked_ahead,
        1 + 2 + 1 + 1 + 1,
        "many polygons over many in two pieces; no set waits for another"
    );
}

/// One job has them all, whatever it is cut into.
#[test]
fn channels_of_one_shape_are_not_parted() {
    let mut service = Backwards::default();
    let mut observer = Unobserved;
    let began = (std::time::Instant::now(), ThreadTime::default());
    let mut client = RowClient::new(&mut service, &mut observer, encode_scene(&[]), began);
    let polygon = ConvexPolygon { plane: PlaneId(1), corners: vec![DVec3::X, DVec3::Y, DVec3::Z] };
    let coloured = || Shape::of_colours(vec![(polygon.clone(), [1.0, 0.5, 0.2]); 4 * MANY_POLYGONS]);
    let shapes = coloured().into_iter().chain([Shape::Point(DVec3::Z)]).chain(coloured());
    let shooters: Vec<Shooter> = (0..).zip(shapes).map(|(key, shape)| Shooter { key, shape }).collect();
    let sets = [3000, 5].map(|count| client.publish_receivers(&receivers(count)));
    let mut taken = vec![];
    let take = |set: usize, row: usize, factors: &Row, _| {
        let expected: Vec<f32> = (0..sets[set].count() as u32).map(|at| factor(row as u64, at)).collect();
        assert_eq!(factors.to_dense(), expected, "row {row} over set {set}");
        taken.push((set, row));
    };
    client.each_row(&shooters, &sets, take).unwrap();
    drop(client);
    assert_eq!(taken, (0..2).flat_map(|set| (0..7).map(move |row| (set, row))).collect::<Vec<_>>());
    assert!(!service.sizes.is_empty());
    assert!(service.sizes.iter().all(|rows| [1, 3, 4, 7].contains(rows)), "{:?}", service.sizes);
}

/// The vertices of one round of refinement would else be one job for each lamp.
#[test]
fn rows_of_few_lamps_are_cut() {
    let counts = [2500, 30];
    let (taken, asked_ahead) = rows_over(&counts);
    let rows = (0..2).flat_map(|set| (0..3).map(move |row| (set, row, counts[set] as f64)));
    assert_eq!(taken, rows.collect::<Vec<_>>());
    let of_many = 2500_usize.div_ceil(704);
    assert_eq!(asked_ahead, 3 + of_many + 3 + 1, "a point and a sun in three pieces each");
}

#[test]
fn nothing_is_asked_of_no_set() {
    assert_eq!(rows_over(&[]), (vec![], 0));
}
