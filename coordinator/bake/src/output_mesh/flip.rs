//! Diagonals that follow the light.

use foldhash::{HashSet, HashSetExt};
use rayon::prelude::*;

use super::collapse::under;
use super::working::{NONE, Working};

/// Weight of a triangle's shape against the mean square deviation, in limits.
const WEIGHT_OF_SHAPE: f64 = 0.02;

/// A flip must better the cost by this part.
const GAIN: f64 = 0.99;

/// Fewest edges that a thread takes.
const AT_ONCE: usize = 256;

/// A flip of an edge: its two triangles, and their corners after it.
struct Flip {
    triangles: [u32; 2],
    new: [[u32; 3]; 2],
}

impl Working {
    /// Flips those of these edges where the light fits better, or triangles get a better shape. Returns the points of the triangles that
    /// changed.
    pub fn flip_edges(&mut self, candidates: &[(u32, u32)]) -> Vec<u32> {
        let better = |(a, b): &(u32, u32)| Some((*a, *b, self.better_flip(*a, *b)?));
        let flips: Vec<(u32, u32, Flip)> =
            candidates.par_iter().with_min_len(AT_ONCE).filter_map(better).collect();
        let mut changed = vec![];
        let mut flipped: HashSet<u32> = HashSet::new();
        for (a, b, flip) in flips {
            // Another one may have changed the triangles, or joined the same two corners.
            let is_as_found = flip.triangles.iter().all(|triangle| !flipped.contains(triangle))
                && !self.are_joined(flip.new[0][0], flip.new[0][2]);
            let flip = if is_as_found { Some(flip) } else { self.better_flip(a, b) };
            if let Some(flip) = flip {
                let corners = flip.new;
                flipped.extend(flip.triangles);
                self.flip(flip);
                changed
                    .extend(corners.as_flattened().iter().map(|corner| self.corners[*corner as usize].point));
            }
        }
        changed
    }

    /// Edges of the triangles around points, the lesser corner first, in order.
    pub fn inner_edges(&self, points: &[u32]) -> Vec<(u32, u32)> {
        let of_point = |point: &u32| {
            let corners = self.points[*point as usize].iter();
            let triangles = corners.flat_map(|corner| &self.corners[*corner as usize].around);
            triangles.flat_map(|triangle| self.triangles[*triangle as usize].sorted_edges())
        };
        let mut edges: Vec<(u32, u32)> =
            points.par_iter().with_min_len(AT_ONCE).flat_map_iter(of_point).collect();
        edges.par_sort_unstable();
        edges.dedup();
        edges
    }

    /// The flip of an edge, if it is for the better.
    fn better_flip(&self, a: u32, b: u32) -> Option<Flip> {
        let [one, other] = self.both_sides(a, b)?;
        let region = self.triangles[one as usize].region;
        let turned = |triangle: u32| {
            let corners = self.triangles[triangle as usize].corners;
            let at = corners.iter().position(|corner| *corner != a && *corner != b).unwrap_or(0);
            [0, 1, 2].map(|step| corners[(at + step) % 3])
        };
        // The corners opposite of the edge, and the edge as each triangle walks it.
        let ([p, from, to], [q, back, _]) = (turned(one), turned(other));
        if p == q || back != to {
            return None;
        }
        let new = [[p, from, q], [q, to, p]];
        let old = [one, other].map(|triangle| self.triangles[triangle as usize].corners);
        let limit = GAIN * self.cost_of_pair(region, old, [one, other], f64::INFINITY)?;
        let is_better =
            self.cost_of_pair(region, new, [one, other], limit).is_some() && !self.are_joined(p, q);
        is_better.then_some(Flip { triangles: [one, other], new })
    }

    fn are_joined(&self, a: u32, b: u32) -> bool {
        self.along(a, b).next().is_some()
    }

    fn flip(&mut self, Flip { triangles, new }: Flip) {
        let mut samples = vec![];
        for (index, corners) in triangles.into_iter().zip(new) {
            let triangle = &mut self.triangles[index as usize];
            samples.append(&mut triangle.samples);
            let gone = std::mem::replace(&mut triangle.corners, corners);
            for corner in gone {
                self.corners[corner as usize].around.retain(|around| *around != index);
            }
            for corner in corners {
                self.corners[corner as usize].around.push(index);
            }
        }
        debug_assert!(new.iter().flatten().all(|corner| *corner != NONE));
        self.deal_out(samples, &triangles);
    }

    /// Mean square deviation in two triangles, in limits, and their shape, if that is less than `most`; `None` where a limit is exceeded
    /// or a triangle is turned.
    fn cost_of_pair(
        &self,
        region: u32,
        pair: [[u32; 3]; 2],
        with_samples: [u32; 2],
        most: f64,
    ) -> Option<f64> {
        let [one, two] = pair.map(|corners| self.shape(region, corners));
        let of_shape = WEIGHT_OF_SHAPE * (2.0 - one?.1 - two?.1);
        if of_shape >= most {
            return None;
        }
        let lights = pair.map(|corners| self.light_between(region, corners));
        let (mut sum, mut count) = (0.0, 0.0_f64);
        for index in with_samples {
            for sample in &self.triangles[index as usize].samples {
                let sample = &self.samples[*sample as usize];
                let (_, light, weights) = under(lights, sample.position)?;
                let square = light.deviation(weights, sample).length_squared() / sample.limit;
                if square > 1.0 {
                    return None;
                }
                sum += square;
                count += 1.0;
            }
        }
        Some(sum / count.max(1.0) + of_shape).filter(|cost| *cost < most)
    }
}
