//! Whatever the bytes of a job, it is refused, or it is computed and its rows are rows.
#![no_main]

use std::sync::LazyLock;

use glam::DVec3;
use kernel::geometry::{ConvexPolygon, PlaneId};
use kernel::replica::{EncodedReplica, Receiver, Receivers, encode_receivers, encode_scene};
use kernel::row::{Shape, Shooter, decode_row};
use libfuzzer_sys::fuzz_target;
use prost::Message;
use protocol::worker::RowJob;
use worker::job::Job;
use worker::store::{Replica, ReplicaStore};

/// Work that a round may take: pairs of a receiver and a polygon, and rays for each.
const MOST_PAIRS: usize = 2_000;
const MOST_RAYS: u32 = 256;

/// Two walls between three rows of receivers.
static REPLICAS: LazyLock<[EncodedReplica; 2]> = LazyLock::new(|| {
    let wall = |x: f64, plane| ConvexPolygon {
        plane: PlaneId(plane),
        corners: [(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0)].map(|(y, z)| DVec3::new(x, y, z)).to_vec(),
    };
    let receiver = |i| Receiver {
        position: DVec3::new(f64::from(i % 3), f64::from(i / 3), 0.5),
        normal: [DVec3::X, DVec3::NEG_X, DVec3::Y][i as usize % 3],
        plane: PlaneId(i),
    };
    let set = Receivers { first_key: 9, receivers: (0..40).map(receiver).collect() };
    [encode_scene(&[wall(0.5, 1), wall(1.5, 2)]), encode_receivers(&set)]
});

fuzz_target!(|bytes: &[u8]| {
    let Ok(mut message) = RowJob::decode(bytes) else { return };
    let mut store = ReplicaStore::new(1 << 20);
    for EncodedReplica { digest, kind, bytes } in REPLICAS.iter() {
        let Ok(replica) = Replica::decode(*kind, bytes) else { unreachable!("it was encoded") };
        store.insert(*digest, replica, bytes.len() as u64);
    }
    let as_it_came = Job::new(&message, &mut store);
    // No fuzzer guesses a digest, or few receivers.
    message.scene_digest = REPLICAS[0].digest.to_bytes();
    message.receivers_digest = REPLICAS[1].digest.to_bytes();
    message.first_receiver %= 41;
    message.receiver_count %= 41;
    let Ok(job) = Job::new(&message, &mut store) else { return };
    drop(as_it_came);
    let request = job.request();
    let polygons: usize = request.shooters.iter().map(|shooter| shooter.shape.polygons()).sum();
    let is_long = |shooter: &Shooter| matches!(shooter.shape, Shape::Sky(rays) if rays > MOST_RAYS);
    if polygons * request.receiver_count as usize > MOST_PAIRS
        || request.precision.maximum_rays > MOST_RAYS
        || request.shooters.iter().any(is_long)
    {
        return;
    }
    let finished = job.compute();
    assert_eq!(finished.rows.len(), request.shooters.len());
    for row in &finished.rows {
        decode_row(row, request.receiver_count as usize).expect("what a worker encodes can be decoded");
    }
});
