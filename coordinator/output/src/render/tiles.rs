//! A picture in tiles.

use std::collections::BTreeMap;

use glam::DVec3;
use kernel::picture::{Camera, FinishedTile, MOST_SIDE, Pixels, TileRequest, TileService};
use kernel::replica::{Digest, EncodedReplica};
use kernel::row::JobId;

/// Rays of a tile, about: some ten milliseconds of work, so that the message costs little beside it and the end of the picture
/// does not wait for one worker.
const TILE_RAYS: u32 = 1 << 15;

/// Least and most pixels of a tile's side.
const SIDES: [u32; 2] = [8, 128];

/// So many tiles are under way at most: enough to keep a hundred threads busy.
const MOST_UNDER_WAY: usize = 512;

/// Most pixels of a picture: 3 GiB of radiance.
const MOST_PIXELS: u64 = 1 << 28;

/// Settings of a picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TileSettings {
    /// Where it is taken from.
    pub camera: Camera,
    /// Pixels in a line, and lines.
    pub size: [u32; 2],
    /// Rays for each pixel.
    pub samples: u32,
    /// Radiance where there is no surface.
    pub background: DVec3,
}

/// A picture: radiance, as it is.
#[derive(Debug, Clone, PartialEq)]
pub struct Picture {
    /// Pixels in a line, and lines.
    pub size: [u32; 2],
    /// Radiance of the pixels, line by line from the top.
    pub pixels: Pixels,
    /// Rays cast.
    pub rays: u64,
    /// Time that workers computed, in nanoseconds of one thread.
    pub busy_nanoseconds: u64,
}

/// Why there is no picture.
#[derive(Debug, thiserror::Error)]
pub enum RenderError {
    /// A size of nothing, or of too much.
    #[error("a picture of {0} x {1} pixels cannot be made: 1 to {MOST_SIDE} on a side, {MOST_PIXELS} in all")]
    Size(u32, u32),
    /// No more tiles.
    #[error("tiles cannot be computed: {0}")]
    Tiles(#[source] Box<dyn std::error::Error + Send + Sync>),
}

/// Has a picture computed in tiles; `progress` is told how many of how many are done. The same scene and settings give the same
/// bits, whoever computes them.
///
/// # Errors
/// When the tiles cannot be had, or the size makes no sense.
pub fn render_tiles<S: TileService>(
    service: &mut S,
    scene: EncodedReplica,
    settings: &TileSettings,
    progress: &mut dyn FnMut(usize, usize),
) -> Result<Picture, RenderError> {
    let [width, height] = settings.size;
    let count = u64::from(width) * u64::from(height);
    if count == 0 || count > MOST_PIXELS || width.max(height) > MOST_SIDE {
        return Err(RenderError::Size(width, height));
    }
    let digest = scene.digest;
    service.publish(scene);
    let mut waiting = requests(digest, settings).zip(0..).map(|(request, job)| (JobId(job), request));
    let total = requests(digest, settings).count();
    let mut under_way: BTreeMap<JobId, TileRequest> = BTreeMap::new();
    let mut picture =
        Picture { size: settings.size, pixels: vec![[0.0; 3]; count as usize], rays: 0, busy_nanoseconds: 0 };
    let mut done = 0;
    loop {
        let some: Vec<_> = waiting.by_ref().take(MOST_UNDER_WAY - under_way.len()).collect();
        if !some.is_empty() {
            under_way.extend(some.iter().cloned());
            service.submit(some);
        }
        if under_way.is_empty() {
            break;
        }
        let finished = service.next().map_err(|error| RenderError::Tiles(Box::new(error)))?;
        if let Some(request) = under_way.remove(&finished.job) {
            picture.put(&request, &finished);
            done += 1;
            progress(done, total);
        }
    }
    service.release(digest);
    Ok(picture)
}

/// The tiles of a picture, line by line.
fn requests(picture: Digest, settings: &TileSettings) -> impl Iterator<Item = TileRequest> {
    let TileSettings { camera, size, samples, background } = *settings;
    let side = (f64::from(TILE_RAYS / samples.max(1)).sqrt() as u32).next_multiple_of(SIDES[0]);
    let side = side.clamp(SIDES[0], SIDES[1]);
    let starts = move |length: u32| (0..length).step_by(side as usize);
    let corners = starts(size[1]).flat_map(move |top| starts(size[0]).map(move |left| [left, top]));
    corners.map(move |corner| {
        let extent = [0, 1].map(|axis| side.min(size[axis] - corner[axis]));
        TileRequest { picture, camera, size, corner, extent, samples, background }
    })
}

impl Picture {
    fn put(&mut self, request: &TileRequest, finished: &FinishedTile) {
        let [columns, width] = [request.extent[0] as usize, self.size[0] as usize];
        for (line, pixels) in finished.pixels.chunks_exact(columns).enumerate() {
            let first = (request.corner[1] as usize + line) * width + request.corner[0] as usize;
            self.pixels[first..first + columns].copy_from_slice(pixels);
        }
        self.rays += finished.rays;
        self.busy_nanoseconds = self.busy_nanoseconds.saturating_add(finished.busy_nanoseconds);
    }
}
