use bytes::Bytes;
use glam::DVec3;

use super::Camera;
use crate::messages::{self, TileJob};
use crate::replica::{Digest, EncodedReplica, ReplicaError};
use crate::row::JobId;

/// Most pixels of a picture's side.
pub const MOST_SIDE: u32 = 1 << 16;

/// Most rays of a pixel: the length of the sequence that spreads them.
pub const MOST_SAMPLES: u32 = 1 << 16;

/// Most rays through the pixels of a tile: some minutes of one thread, far from any use.
pub const MOST_TILE_RAYS: u64 = 1 << 28;

/// Most pixels of a tile: their radiances fit into one message.
const MOST_PIXELS: u64 = 1 << 22;

/// Bytes of the radiance of a pixel.
const PIXEL_BYTES: usize = 12;

/// A rectangle of a picture.
#[derive(Debug, Clone, PartialEq)]
pub struct TileRequest {
    /// The lit scene.
    pub picture: Digest,
    /// Where the picture is taken from.
    pub camera: Camera,
    /// Pixels in a line of the whole picture, and its lines.
    pub size: [u32; 2],
    /// Pixels to the left of the rectangle, and lines above it.
    pub corner: [u32; 2],
    /// Pixels in a line of the rectangle, and its lines.
    pub extent: [u32; 2],
    /// Rays for each pixel: one through its middle, or several spread over it.
    pub samples: u32,
    /// Radiance where there is no surface.
    pub background: DVec3,
}

/// Radiance of the pixels of a tile, line by line from the top.
pub type Pixels = Vec<[f32; 3]>;

/// Why a message is not a request for a tile, or not the answer to it.
#[derive(Debug, thiserror::Error)]
pub enum TileError {
    /// A digest is malformed.
    #[error(transparent)]
    Digest(#[from] ReplicaError),
    /// The camera is invalid.
    #[error("invalid camera of a tile: {0}")]
    Camera(&'static str),
    /// Another part of the request is invalid.
    #[error("invalid tile: {0}")]
    Invalid(&'static str),
    /// The pixels changed on the way.
    #[error("pixels do not match their digest")]
    Changed,
    /// The pixels are not those of this tile.
    #[error("invalid pixels: {0}")]
    Pixels(&'static str),
}

impl TileRequest {
    /// Number of pixels.
    #[must_use]
    pub fn pixels(&self) -> usize {
        self.extent[0] as usize * self.extent[1] as usize
    }

    /// The request as it travels.
    #[must_use]
    pub fn to_job(&self, job_id: u64) -> TileJob {
        let Self { size: [width, height], corner: [left, top], extent: [columns, rows], samples, .. } = *self;
        TileJob {
            job_id,
            picture_digest: self.picture.to_bytes(),
            camera: Some(self.camera.to_message()),
            width,
            height,
            left,
            top,
            columns,
            rows,
            samples,
            background: self.background.to_array().to_vec(),
        }
    }

    /// Reads a request and checks it.
    ///
    /// # Errors
    /// When a number is invalid, or the tile would take too long or too many bytes.
    pub fn from_job(job: &TileJob) -> Result<Self, TileError> {
        let picture = Digest::try_from(job.picture_digest.as_ref())?;
        let camera = job.camera.as_ref().ok_or(TileError::Camera("there is none"))?;
        let camera = Camera::from_message(camera)?;
        let background: [f64; 3] = job
            .background
            .as_slice()
            .try_into()
            .map_err(|_| TileError::Invalid("its background has three numbers"))?;
        if !background.iter().all(|value| (0.0..=f64::from(f32::MAX)).contains(value)) {
            return Err(TileError::Invalid("its background is neither negative nor beyond all bounds"));
        }
        let inside = |first: u32, count: u32, all: u32| {
            count > 0 && all <= MOST_SIDE && first.checked_add(count).is_some_and(|end| end <= all)
        };
        if !inside(job.left, job.columns, job.width) || !inside(job.top, job.rows, job.height) {
            return Err(TileError::Invalid("it has pixels, and all of them in a picture"));
        }
        let pixels = u64::from(job.columns) * u64::from(job.rows);
        let rays = pixels * u64::from(job.samples);
        if !(1..=MOST_SAMPLES).contains(&job.samples) || rays > MOST_TILE_RAYS || pixels > MOST_PIXELS {
            return Err(TileError::Invalid("it has no rays, or too many for a tile: cut it"));
        }
        Ok(Self {
            picture,
            camera,
            size: [job.width, job.height],
            corner: [job.left, job.top],
            extent: [job.columns, job.rows],
            samples: job.samples,
            background: DVec3::from_array(background),
        })
    }
}

/// Pixels as they travel, with their digest.
#[must_use]
pub fn encode_pixels(pixels: &[[f32; 3]]) -> (Bytes, Digest) {
    let bytes: Vec<u8> = pixels.as_flattened().iter().flat_map(|value| value.to_le_bytes()).collect();
    let digest = Digest::of(&bytes);
    (bytes.into(), digest)
}

/// Reads the pixels that answer a request and checks them.
///
/// # Errors
/// When they do not match their digest, there are more or fewer than requested, or one is negative, infinite or NaN.
pub fn decode_pixels(
    request: &TileRequest,
    finished: &messages::FinishedTile,
) -> Result<(Pixels, Digest), TileError> {
    let digest = Digest::of(&finished.pixels);
    if finished.digest != digest.0.as_slice() {
        return Err(TileError::Changed);
    }
    let (values, rest) = finished.pixels.as_chunks::<4>();
    if !rest.is_empty() || finished.pixels.len() != request.pixels() * PIXEL_BYTES {
        return Err(TileError::Pixels("there are more or fewer than were asked for"));
    }
    let values: Vec<f32> = values.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect();
    if !values.iter().all(|value| value.is_finite() && *value >= 0.0) {
        return Err(TileError::Pixels("a radiance is negative or not finite"));
    }
    Ok((values.as_chunks::<3>().0.to_vec(), digest))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::Projection;

    fn request() -> TileRequest {
        TileRequest {
            picture: Digest::of(b"picture"),
            camera: Camera {
                eye: DVec3::ZERO,
                right: DVec3::X,
                up: DVec3::Y,
                forward: DVec3::NEG_Z,
                projection: Projection::Parallel { half: [1.0; 2] },
                near: 0.0,
            },
            size: [64, 48],
            corner: [32, 32],
            extent: [32, 16],
            samples: 4,
            background: DVec3::new(0.5, 0.25, 0.125),
        }
    }

    #[test]
    fn a_request_comes_back_as_it_went_and_senseless_ones_are_refused() {
        assert_eq!(TileRequest::from_job(&request().to_job(7)).unwrap(), request());
        let refused = |change: fn(&mut TileJob)| {
            let mut job = request().to_job(7);
            change(&mut job);
            TileRequest::from_job(&job).is_err()
        };
        assert!(refused(|job| job.camera = None));
        assert!(refused(|job| job.picture_digest = Bytes::new()));
        assert!(refused(|job| job.left = u32::MAX));
        assert!(refused(|job| job.rows = 17));
        assert!(refused(|job| job.columns = 0));
        assert!(refused(|job| job.samples = 0));
        assert!(refused(|job| job.samples = u32::MAX));
        assert!(refused(|job| job.background[0] = -1.0));
        assert!(refused(|job| job.background[0] = f64::NAN));
        assert!(refused(|job| job.background.push(0.0)));
        assert!(refused(|job| {
            (job.width, job.height, job.left, job.top) = (MOST_SIDE, MOST_SIDE, 0, 0);
            (job.columns, job.rows, job.samples) = (MOST_SIDE, MOST_SIDE, 1);
        }));
    }

    #[test]
    fn pixels_are_those_of_the_tile() {
        let answer = |pixels: &[[f32; 3]]| {
            let (pixels, digest) = encode_pixels(pixels);
            messages::FinishedTile { pixels, digest: digest.to_bytes(), ..messages::FinishedTile::default() }
        };
        let good: Pixels = (0..512).map(|pixel| [pixel as f32, 0.5, 1e9]).collect();
        assert_eq!(decode_pixels(&request(), &answer(&good)).unwrap().0, good);
        assert!(decode_pixels(&request(), &answer(&good[1..])).is_err());
        for wrong in [-1.0, f32::NAN, f32::INFINITY] {
            let mut bad = good.clone();
            bad[9][1] = wrong;
            assert!(decode_pixels(&request(), &answer(&bad)).is_err());
        }
        let changed = messages::FinishedTile { digest: Bytes::new(), ..answer(&good) };
        assert!(matches!(decode_pixels(&request(), &changed), Err(TileError::Changed)));
    }
}

/// The answer to a job that asks for a tile.
#[derive(Debug, Clone, PartialEq)]
pub struct FinishedTile {
    /// The job.
    pub job: JobId,
    /// Radiance of its pixels.
    pub pixels: Pixels,
    /// Rays cast.
    pub rays: u64,
    /// Time that the worker computed, in nanoseconds of one thread.
    pub busy_nanoseconds: u64,
}

/// Computes tiles: a cluster of workers, in this process or elsewhere.
pub trait TileService {
    /// Why no more tiles can be had.
    type Error: std::error::Error + Send + Sync + 'static;

    /// Makes a replica known before the first job that needs it.
    fn publish(&mut self, replica: EncodedReplica);
    /// Says that a replica will not be used again.
    fn release(&mut self, digest: Digest);
    /// Asks for tiles; earlier requests are more urgent.
    fn submit(&mut self, requests: Vec<(JobId, TileRequest)>);
    /// Waits for the next finished tile, in any order.
    ///
    /// # Errors
    /// When no more tiles can be had.
    fn next(&mut self) -> Result<FinishedTile, Self::Error>;
}
