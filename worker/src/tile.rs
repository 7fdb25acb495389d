//! One tile of a picture: checked against the replicas, then computed.

use std::sync::Arc;

use kernel::picture::{TileRequest, encode_pixels};
use protocol::worker::{FinishedTile, TileJob};
use tokio::time::Instant;

use crate::job::JobError;
use crate::store::{Replica, ReplicaStore};
use kernel::picture::tracer::Picture;

/// A tile that can be computed: it holds all that it needs.
pub struct Tile {
    id: u64,
    request: TileRequest,
    picture: Arc<Picture>,
}

impl Tile {
    /// Reads a job and takes hold of its replica.
    ///
    /// # Errors
    /// When the job is invalid or names a replica that the store does not hold.
    pub fn new(message: &TileJob, store: &mut ReplicaStore) -> Result<Self, JobError> {
        let request = TileRequest::from_job(message)?;
        match store.get(request.picture) {
            Some(Replica::Picture(picture)) => Ok(Self { id: message.job_id, request, picture }),
            Some(_) => Err(JobError::WrongKind(request.picture)),
            None => Err(JobError::UnknownReplica(request.picture)),
        }
    }

    /// Computes the pixels, on the calling thread.
    #[must_use]
    #[tracing::instrument(name = "tile", skip_all, fields(job = self.id, pixels = self.request.pixels()))]
    pub fn compute(&self) -> FinishedTile {
        let start = Instant::now();
        let (pixels, rays) = self.picture.tile(&self.request);
        let (pixels, digest) = encode_pixels(&pixels);
        let busy_nanoseconds = start.elapsed().as_nanos().try_into().unwrap_or(u64::MAX);
        FinishedTile { job_id: self.id, pixels, rays, busy_nanoseconds, digest: digest.to_bytes() }
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use kernel::picture::{Camera, Part, PictureScene, Projection, decode_pixels, encode_picture};
    use kernel::replica::{Digest, encode_scene};
    use protocol::worker::FailureReason;

    use super::*;

    #[test]
    fn a_tile_is_computed_and_a_senseless_one_is_not() {
        let part = Part {
            positions: vec![[-9.0, -9.0, 0.0], [9.0, -9.0, 0.0], [0.0, 9.0, 0.0]],
            triangles: vec![[0, 1, 2]],
            emission: [1.0, 2.0, 4.0],
            ..Part::default()
        };
        let scene = PictureScene { parts: vec![part], ..PictureScene::default() };
        let (encoded, occluders) = (encode_picture(&scene), encode_scene(&[]));
        let mut store = ReplicaStore::new(1 << 20);
        for replica in [&encoded, &occluders] {
            let decoded = Replica::decode(replica.kind, &replica.bytes).unwrap();
            store.insert(replica.digest, decoded, replica.bytes.len() as u64);
        }
        let request = TileRequest {
            picture: encoded.digest,
            camera: Camera {
                eye: DVec3::Z * 5.0,
                right: DVec3::X,
                up: DVec3::Y,
                forward: DVec3::NEG_Z,
                projection: Projection::Parallel { half: [20.0; 2] },
                near: 0.0,
            },
            size: [3, 3],
            corner: [1, 0],
            extent: [2, 3],
            samples: 1,
            background: DVec3::ZERO,
        };
        let finished = Tile::new(&request.to_job(9), &mut store).unwrap().compute();
        assert_eq!((finished.job_id, finished.rays), (9, 6));
        let dark = [0.0; 3];
        let (pixels, _) = decode_pixels(&request, &finished).unwrap();
        assert_eq!(pixels, [dark, dark, [1.0, 2.0, 4.0], dark, dark, dark]);

        let mut reason = |change: fn(&mut TileRequest)| {
            let mut changed = request.clone();
            change(&mut changed);
            Tile::new(&changed.to_job(9), &mut store).err().unwrap().to_message(9).reason()
        };
        assert_eq!(reason(|tile| tile.picture = Digest::of(b"other")), FailureReason::UnknownReplica);
        assert_eq!(reason(|tile| tile.picture = encode_scene(&[]).digest), FailureReason::InvalidJob);
        assert_eq!(reason(|tile| tile.samples = 0), FailureReason::InvalidJob);
    }
}
