use std::f64::consts::PI;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};

use anyhow::Context;
use glam::DVec3;
use kernel::picture::tracer::Picture;
use output::render::{LitFile, choose_view, read_lit};
use rayon::prelude::*;
use scene::ReadOptions;
use verify::picture::{self, Flip, flip};
use verify::plain::{PlainOptions, PlainScene};
use verify::reference::{Ray, ReferenceSettings, trace_rays};

use super::super::progress::ProgressLine;

/// Pixels from left to right.
const WIDTH: u32 = 480;

/// Width over height where the camera does not state it, and the least and the most of it.
const ASPECT: f64 = 1.6;
const ASPECTS: [f64; 2] = [0.5, 4.0];

/// Cameras of which pictures are made: the first ones.
const MOST_CAMERAS: usize = 8;

/// Rays from one showing of progress to the next.
const SHOWN: u64 = 256;

/// Rays of a pixel from left to right, and from top to bottom.
const SIDE: u32 = 2;

/// Path-traced pictures of a scene, to compare those of its bakes with: from the first cameras of the lit file, or from where `render`
/// would take one.
pub struct Pictures {
    views: Vec<View>,
    /// Radiance where there is no surface: what the bake's pictures have there.
    background: DVec3,
    /// Display value of a unit of radiance: that of the lit file.
    exposure: f64,
    /// FLIP between two halves of the paths.
    pub noise: Option<Flip>,
}

struct View {
    /// Row by row of pixels, [`SIDE`] times [`SIDE`] in each.
    rays: Vec<Ray>,
    /// Pixels of a row.
    width: usize,
    /// Linear display value of each pixel.
    truth: Vec<DVec3>,
}

impl Pictures {
    /// Traces the pictures, of `paths` paths a pixel, from the cameras of a lit file of the scene.
    pub fn trace(
        scene: &Path,
        lit: &Path,
        read: &ReadOptions,
        paths: u32,
        threads: usize,
        line: &ProgressLine,
    ) -> anyhow::Result<Self> {
        line.enter("truth");
        let lit = read_lit(lit, read)?;
        let mut views = views(&lit)?;
        let background = lit.sky.unwrap_or(DVec3::ZERO);
        let plain =
            PlainScene::open_with(scene, &PlainOptions { read: read.clone(), ..PlainOptions::default() })?;
        let exposure = PI * lit.exposure.unwrap_or(1.0);
        let total = views.iter().map(|view| 2 * view.rays.len() as u64).sum();
        let paths = paths.div_ceil(2 * SIDE * SIDE);
        let mut noise = vec![];
        let done = AtomicU64::new(0);
        line.restart();
        for view in &mut views {
            let traced = || {
                let done = done.fetch_add(1, Ordering::Relaxed) + 1;
                if done.is_multiple_of(SHOWN) {
                    line.show_part("truth", (done, total), "rays");
                }
            };
            let half = |seed| {
                let settings = ReferenceSettings { paths, seed, threads };
                let radiance = trace_rays(&plain, &view.rays, background, &settings, &traced)
                    .with_context(|| format!("{} cannot be traced", scene.display()))?;
                anyhow::Ok(pixels(&radiance, exposure))
            };
            let (first, second) = (half(1)?, half(2)?);
            noise.extend(view.flip(&first, &second));
            view.truth = first.into_iter().zip(second).map(|(a, b)| (a + b) * 0.5).collect();
        }
        Ok(Self { views, background, exposure, noise: Flip::of(&noise) })
    }

    /// FLIP over the pixels of all pictures of a lit file.
    pub fn flip(&self, lit: &Path, read: &ReadOptions) -> anyhow::Result<Option<Flip>> {
        let LitFile { scene, frame, .. } = read_lit(lit, read)?;
        let picture = Picture::new(scene);
        let radiance = |ray: &Ray| {
            let origin = frame.to_frame(ray.origin);
            let ray = kernel::picture::Ray { origin, direction: ray.direction, start: 0.0 };
            picture.radiance(&ray, self.background).0
        };
        let of_view = |view: &View| {
            let seen: Vec<DVec3> = view.rays.par_iter().map(radiance).collect();
            view.flip(&view.truth, &pixels(&seen, self.exposure))
        };
        Ok(Flip::of(&self.views.iter().flat_map(of_view).collect::<Vec<_>>()))
    }
}

impl View {
    /// FLIP of each pixel of two pictures of this view.
    fn flip(&self, truth: &[DVec3], lit: &[DVec3]) -> Vec<f64> {
        let [truth, lit] = [truth, lit].map(|values| picture::Picture::of_linear(self.width, values));
        flip(&truth, &lit)
    }
}

/// The rays of each camera.
fn views(lit: &LitFile) -> anyhow::Result<Vec<View>> {
    let frame = &lit.frame;
    let size = |aspect: f64| [WIDTH, (f64::from(WIDTH) / aspect).round() as u32];
    let exact = |[width, height]: [u32; 2]| f64::from(width) / f64::from(height);
    let mut cameras = vec![];
    for camera in lit.cameras.iter().take(MOST_CAMERAS) {
        let [least, most] = ASPECTS;
        let size = size(camera.aspect().unwrap_or(ASPECT).clamp(least, most));
        cameras.push((camera.camera(frame, exact(size))?, size));
    }
    if cameras.is_empty() {
        let size = size(ASPECT);
        cameras.push((choose_view(&lit.scene, exact(size)), size));
    }
    let view = |(camera, [width, height]): (kernel::picture::Camera, [u32; 2])| {
        let places = (0..height * width).flat_map(|pixel| {
            let [x, y] = [pixel % width, pixel / width];
            (0..SIDE * SIDE).map(move |ray| [x * SIDE + ray % SIDE, y * SIDE + ray / SIDE])
        });
        let rays = places.map(|[x, y]| {
            let place = |at: u32, of: u32| (f64::from(at) + 0.5) / f64::from(of * SIDE);
            camera.ray(place(x, width), place(y, height))
        });
        // They start where the camera begins to see.
        let world = |ray: kernel::picture::Ray| {
            let origin = frame.to_world(ray.origin + ray.direction * ray.start);
            Ray { origin, direction: ray.direction }
        };
        View { rays: rays.map(world).collect(), truth: vec![], width: width as usize }
    };
    Ok(cameras.into_iter().map(view).collect())
}

/// Display values of pixels: means over the rays of each.
fn pixels(rays: &[DVec3], exposure: f64) -> Vec<DVec3> {
    let side = (SIDE * SIDE) as usize;
    rays.chunks(side).map(|rays| rays.iter().sum::<DVec3>() * exposure / side as f64).collect()
}
