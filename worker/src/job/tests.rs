//! Jobs of a store that holds what they need, and of one that does not.

use glam::DVec3;
use kernel::geometry::{ConvexPolygon, PlaneId};
use kernel::messages;
use kernel::replica::{EncodedReplica, Receiver, Receivers, encode_receivers, encode_scene};
use kernel::row::{Precision, Shape, Shooter, decode_row};

use super::*;

/// A store that holds an empty scene and three receivers, and a job that both can answer.
fn prepared() -> (ReplicaStore, RowRequest) {
    let receiver = |x| Receiver { position: DVec3::X * x, normal: DVec3::Y, plane: PlaneId(0) };
    let set = Receivers { first_key: 5, receivers: [0.0, 1.0, 2.0].map(receiver).to_vec() };
    let (scene, receivers) = (encode_scene(&[]), encode_receivers(&set));
    let mut store = ReplicaStore::new(1 << 20);
    for EncodedReplica { digest, kind, bytes } in [&scene, &receivers] {
        store.insert(*digest, Replica::decode(*kind, bytes).unwrap(), bytes.len() as u64);
    }
    let request = RowRequest {
        scene: scene.digest,
        receivers: receivers.digest,
        first_receiver: 1,
        receiver_count: 2,
        shooters: vec![Shooter { key: 1, shape: Shape::Point(DVec3::new(1.0, 2.0, 0.0)) }],
        precision: Precision {
            rays_per_hemisphere: 64,
            minimum_rays: 1,
            maximum_rays: 64,
            seed: 1,
            factor_rounding: 0.0,
            ..Precision::DEFAULT
        },
    };
    (store, request)
}

fn reason(request: &RowRequest, store: &mut ReplicaStore) -> FailureReason {
    Job::new(&request.to_job(9), store).err().unwrap().to_message(9).reason()
}

#[test]
fn a_range_of_the_receivers_is_computed() {
    let (mut store, request) = prepared();
    let finished = Job::new(&request.to_job(9), &mut store).unwrap().compute();
    assert_eq!((finished.job_id, finished.rows.len()), (9, 1));
    let row = decode_row(&finished.rows[0], 2).unwrap();
    // A light 2 above the first receiver of the range, and sqrt(5) from the second: cos / r^2.
    assert_eq!(row.to_dense(), [0.25, (2.0 / 5.0_f64.powf(1.5)) as f32]);
}

/// Its polygons travel once, and the work on all channels counts once.
#[test]
fn channels_of_one_shape_have_the_same_rows_together_and_alone() {
    let (mut store, request) = prepared();
    let tile = |step: u32| {
        let corner = |[x, z]: [f64; 2]| DVec3::new(f64::from(step) + x, 3.0, z);
        let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(corner).to_vec();
        ConvexPolygon { plane: PlaneId(1), corners }
    };
    let weights = |step: u32| [step, 8 - step, u32::from(step == 3)].map(|eighth| f64::from(eighth) / 8.0);
    let shapes = Shape::of_colours((0..8).map(|step| (tile(step), weights(step))).collect());
    let shooters: Vec<Shooter> = (40..).zip(shapes).map(|(key, shape)| Shooter { key, shape }).collect();
    let polygons = |shooter: &messages::Shooter| match &shooter.shape {
        Some(messages::shooter::Shape::Weighted(set)) => set.polygons.len(),
        _ => 0,
    };
    let mut compute = |shooters: &[Shooter]| {
        let message = RowRequest { shooters: shooters.to_vec(), ..request.clone() }.to_job(9);
        (
            Job::new(&message, &mut store).unwrap().compute(),
            message.shooters.iter().map(polygons).sum::<usize>(),
        )
    };
    let (together, sent) = compute(&shooters);
    let alone: Vec<_> = shooters.chunks(1).map(&mut compute).collect();
    for (at, (own, own_sent)) in alone.iter().enumerate() {
        assert_eq!(own.rows, [together.rows[at].clone()], "{at}");
        assert_eq!((sent, *own_sent), (8, 8));
        let counts = |statistics: &RowStatistics| {
            (statistics.pairs, statistics.rays, statistics.sampling_variance.to_bits())
        };
        assert_eq!(counts(&own.statistics[0]), counts(&together.statistics[at]));
        assert_eq!(own.statistics[0].pairs, if at == 0 { 16 } else { 0 });
    }
}

#[test]
fn a_missing_replica_can_be_loaded_and_a_senseless_job_not() {
    let (mut store, request) = prepared();
    let other = Digest::of(b"other");
    let unknown = RowRequest { receivers: other, ..request.clone() };
    assert_eq!(reason(&unknown, &mut store), FailureReason::UnknownReplica);
    let swapped = RowRequest { receivers: request.scene, ..request.clone() };
    assert_eq!(reason(&swapped, &mut store), FailureReason::InvalidJob);
    let beyond = RowRequest { first_receiver: u32::MAX, ..request.clone() };
    assert_eq!(reason(&beyond, &mut store), FailureReason::InvalidJob);
    let endless = RowRequest { shooters: vec![request.shooters[0].clone(); 4 << 20], ..request };
    assert_eq!(reason(&endless, &mut store), FailureReason::InvalidJob);
}

#[tokio::test]
async fn a_panic_is_a_failure_that_another_worker_may_not_have() {
    let pool = crate::pool::ComputePool::new(1).unwrap();
    let result = pool.run(|| panic!("broken")).await.map_err(JobError::from);
    let Body::Failed(failed) = answer(9, result) else { panic!("not a failure") };
    assert_eq!((failed.job_id, failed.reason()), (9, FailureReason::Internal));
}

/// The sky comes after the polygons, of which there are none here.
#[test]
fn a_row_of_a_hemisphere_covers_all_polygons_and_the_sky() {
    let (mut store, request) = prepared();
    let receiver = Receiver { position: DVec3::ZERO, normal: DVec3::Y, plane: PlaneId(0) };
    let shooters = vec![Shooter { key: 1, shape: Shape::Hemisphere(Hemisphere { receiver, rays: 64 }) }];
    let over = |receiver_count: u32| RowRequest {
        receivers: request.scene,
        first_receiver: 0,
        receiver_count,
        shooters: shooters.clone(),
        ..request.clone()
    };
    let finished = Job::new(&over(1).to_job(9), &mut store).unwrap().compute();
    assert_eq!(decode_row(&finished.rows[0], 1).unwrap().to_dense(), [1.0]);
    for count in [0, 2] {
        assert_eq!(reason(&over(count), &mut store), FailureReason::InvalidJob, "{count}");
    }
}
