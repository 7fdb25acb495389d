//! Whatever a worker answers, it is refused, or its rows and figures can be used and summed.
#![no_main]

use cluster::Answer;
use glam::DVec3;
use kernel::replica::Digest;
use kernel::row::{Precision, RowRequest, Shape, Shooter};
use libfuzzer_sys::fuzz_target;
use prost::Message;
use protocol::worker::{Finished, digest_of_rows};

fuzz_target!(|input: (u16, u8, &[u8])| {
    let (receivers, shooters, bytes) = input;
    let Ok(mut finished) = Finished::decode(bytes) else { return };
    let shooter = |key| Shooter { key, shape: Shape::Point(DVec3::ZERO) };
    let request = RowRequest {
        scene: Digest::of(b"scene"),
        receivers: Digest::of(b"receivers"),
        first_receiver: 0,
        receiver_count: receivers.into(),
        shooters: (0..u64::from(shooters)).map(shooter).collect(),
        precision: Precision::DEFAULT,
    };
    let as_it_came = Answer::check(&request, &finished);
    // No fuzzer guesses a digest.
    finished.digest = digest_of_rows(&finished.rows).to_bytes();
    let Ok(answer) = Answer::check(&request, &finished) else {
        assert!(as_it_came.is_err());
        return;
    };
    assert_eq!((answer.rows.len(), answer.statistics.len()), (shooters.into(), shooters.into()));
    for row in &answer.rows {
        assert_eq!(row.receivers(), usize::from(receivers));
        assert!(row.iter().all(|(_, factor)| factor.is_finite() && factor > 0.0));
    }
    let rays = answer.statistics.iter().map(|cost| cost.rays).try_fold(0_u64, u64::checked_add);
    let sums: f64 = answer.statistics.iter().map(|cost| cost.factor_sum + cost.sampling_variance).sum();
    assert!(rays.is_some() && sums.is_finite());
});
