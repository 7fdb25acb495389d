//! Light between gather points.
//!
//! The light of a receiver is that of the nearest points which face as it does, lie in its plane and are in sight: a plane fitted
//! to them by weighted least squares, which has the value of their mean where it would go far beyond them.

use std::num::NonZero;

use glam::{DMat3, DVec3};
use kernel::geometry::PlaneId;
use kernel::occluder::Occluder;
use kernel::replica::Receiver;
use rayon::prelude::*;

use super::nearest::{AT_ONCE, Last, SortedPoints};
use super::sky::factor_by_sky;

/// Points that are looked at for each receiver.
const NEIGHBOURS: NonZero<usize> = NonZero::new(12).unwrap();

/// Distance from the planes of receiver and point at which a point counts little, relative to the distance of the neighbours,
const OFF_PLANE: f64 = 0.15;

/// and relative to the scene's extent, at least.
const LEAST_OFF_PLANE: f64 = 1e-3;

/// Points nearer than this, relative to the distance of the neighbours, are not told apart.
const NEAR: f64 = 0.05;

/// For the fitted plane those nearer than this count alike where each has [`MANY_RAYS`]: the noise of their rays evens out. The nearest
/// alone would show its own as a spot on an even ceiling.
const ALIKE: f64 = 0.6;

/// With other numbers of rays that distance goes with their noise,
const MANY_RAYS: f64 = 256.0;

/// which falls with this power of their number,
const NOISE_POWER: f64 = 0.75;

/// but it is never more than this.
const LARGEST_ALIKE: f64 = 1.0;

/// Power of the cosine between the normals.
const FACING: i32 = 8;

/// Points are seen from this far above both surfaces, relative to the scene's extent,
const LEAST_LIFT: f64 = 3e-5;

/// and as much higher, relative to their distance, for each radian between their normals: twice what a curved surface rises
/// above the straight line.
const LIFT: f64 = 0.25;

/// Points with less than this part of the largest weight do not count.
const LEAST_WEIGHT: f64 = 1e-3;

/// Points that face another way or lie in another plane have this weight at least: where there are no others, they count.
const LEAST: f64 = 1e-5;

/// Slopes are held back by this part of the weights: points that all lie on one line tell nothing of the other direction.
const HELD: f64 = 1e-2;

/// A fitted plane counts where its weights, without their signs, sum to no more than this.
const MOST_EXTRAPOLATION: f64 = 1.6;

/// Indices of points and their weights, which sum to 1 until they follow a sky.
pub type Weights = Vec<(u32, f32)>;

/// A point near a receiver.
struct Near {
    point: u32,
    /// From the receiver to it, relative to the distance of the neighbours once that is known.
    offset: DVec3,
    distance: f64,
    /// How much it counts for a plane.
    weight: f64,
    /// How much its surface is like that of the receiver, up to 1.
    alike: f64,
}

impl Near {
    /// How much it counts where those nearer than this count alike: more the nearer it is and the more it is alike.
    fn weight_within(&self, near: f64) -> f64 {
        self.alike / (self.offset.length_squared() + near * near)
    }
}

/// Weights of points for each of some receivers.
#[derive(Default)]
pub struct Interpolation {
    /// Offsets into `weights`: one per receiver, and the end.
    starts: Vec<u32>,
    /// Of all receivers.
    weights: Weights,
}

impl Interpolation {
    /// The interpolation with these weights for each receiver; one without any gets no light.
    pub fn new(receivers: impl IntoIterator<Item = Option<Weights>>) -> Self {
        let mut all = Self { starts: vec![0], weights: vec![] };
        for weights in receivers {
            all.weights.extend(weights.into_iter().flatten());
            all.starts.push(all.weights.len() as u32);
        }
        all
    }

    fn weights_of(&self, receiver: usize) -> &[(u32, f32)] {
        &self.weights[self.starts[receiver] as usize..self.starts[receiver + 1] as usize]
    }

    /// Number of receivers.
    pub fn receivers(&self) -> usize {
        self.starts.len().saturating_sub(1)
    }

    /// Irradiance of the receivers, given that of the points.
    pub fn of(&self, points: &[DVec3]) -> Vec<DVec3> {
        let at = |receiver| interpolated(self.weights_of(receiver), points);
        (0..self.receivers()).into_par_iter().with_min_len(1024).map(at).collect()
    }

    /// Lets light follow the sky view factors of the receivers, given those of the points, as [`factor_by_sky`] says.
    pub fn follow_sky(&mut self, of_receivers: &[f64], of_points: &[DVec3]) {
        debug_assert!(self.receivers() == 0 || of_receivers.len() == self.receivers());
        let factors: Vec<f64> = self
            .of(of_points)
            .iter()
            .zip(of_receivers)
            .map(|(points, own)| factor_by_sky(*own, points.x))
            .collect();
        for (receiver, factor) in factors.into_iter().enumerate() {
            let range = self.starts[receiver] as usize..self.starts[receiver + 1] as usize;
            self.weights[range].iter_mut().for_each(|(_, weight)| *weight *= factor as f32);
        }
    }

    /// Mean over the receivers of the sum of squared weights: the part of the variance of a point that a receiver has.
    pub fn variance_part(&self) -> f64 {
        let squares: f64 = self.weights.iter().map(|(_, weight)| f64::from(weight * weight)).sum();
        squares / self.receivers().max(1) as f64
    }
}

/// The value that some points with weights make.
pub fn interpolated(weights: &[(u32, f32)], points: &[DVec3]) -> DVec3 {
    weights.iter().map(|(point, weight)| points[*point as usize] * f64::from(*weight)).sum()
}

/// Points whose light is known.
pub struct Neighbours<'a> {
    points: &'a [Receiver],
    tree: SortedPoints,
    occluder: &'a Occluder,
    /// Of the scene.
    extent: f64,
    /// Points nearer than this count alike for a plane, relative to the distance of the neighbours.
    alike_within: f64,
}

impl<'a> Neighbours<'a> {
    /// Sorts points. Those that were placed have this number of rays.
    pub fn new(points: &'a [Receiver], rays: u32, occluder: &'a Occluder, extent: f64) -> Self {
        let noise = (MANY_RAYS / f64::from(rays)).powf(NOISE_POWER);
        let alike_within = (ALIKE * noise).clamp(NEAR, LARGEST_ALIKE);
        Self { points, tree: SortedPoints::new(points, extent), occluder, extent, alike_within }
    }

    /// Weights of the points for each of some receivers; none where it sees no point that is at least so much alike. They are found
    /// sooner where each receiver lies by the one before.
    pub fn all_weights(&self, receivers: &[Receiver], least_alike: f64) -> Vec<Option<Weights>> {
        let of_some = |some: &[Receiver]| {
            let mut last = Last::default();
            let weights = |receiver| self.weights_by(receiver, least_alike, None, &mut last);
            some.iter().map(weights).collect::<Vec<_>>()
        };
        receivers.par_chunks(AT_ONCE).flat_map_iter(of_some).collect()
    }

    /// Weights of the points for a receiver; none where it sees no point that is at least so much alike. `itself` is a point that
    /// does not count.
    pub fn weights(&self, receiver: &Receiver, least_alike: f64, itself: Option<u32>) -> Option<Weights> {
        self.weights_by(receiver, least_alike, itself, &mut Last::default())
    }

    fn weights_by(
        &self,
        receiver: &Receiver,
        least_alike: f64,
        itself: Option<u32>,
        last: &mut Last,
    ) -> Option<Weights> {
        let found = self.tree.nearest(receiver, NEIGHBOURS, f64::INFINITY, last).map(|(point, _)| point);
        let near = |point: u32| {
            let offset = self.points[point as usize].position - receiver.position;
            Near { point, offset, distance: offset.length(), weight: 0.0, alike: 0.0 }
        };
        let mut all: Vec<Near> = found.filter(|point| Some(*point) != itself).map(near).collect();
        all.sort_by(|a, b| a.distance.total_cmp(&b.distance).then(a.point.cmp(&b.point)));
        let scale = all.get(all.len() / 2)?.distance.max(f64::MIN_POSITIVE);
        let off_plane = OFF_PLANE * scale + LEAST_OFF_PLANE * self.extent;
        for near in &mut all {
            let normal = self.points[near.point as usize].normal;
            let off = (near.offset.dot(normal).abs() + near.offset.dot(receiver.normal).abs()) / off_plane;
            let facing = normal.dot(receiver.normal).max(0.0).powi(FACING);
            near.alike = ((-off * off).exp() * facing).max(LEAST);
            near.offset /= scale;
            near.weight = near.weight_within(self.alike_within);
        }
        let is_alike = |all: &[Near]| all.iter().any(|near| near.alike >= least_alike);
        if !is_alike(&all) {
            return None;
        }
        let largest = all.iter().map(|near| near.weight).fold(0.0, f64::max);
        all.retain(|near| near.weight > LEAST_WEIGHT * largest && self.is_seen(receiver, near.point));
        is_alike(&all).then(|| fitted(receiver.normal, &all))
    }

    fn is_seen(&self, receiver: &Receiver, point: u32) -> bool {
        let point = &self.points[point as usize];
        let turn = receiver.normal.distance(point.normal);
        let lift = LEAST_LIFT * self.extent + LIFT * turn * receiver.position.distance(point.position);
        let above = |receiver: &Receiver| receiver.position + receiver.normal * lift;
        // Their own surfaces hide them from each other, too: the two sides of a cupboard's door.
        !self.occluder.blocks(above(receiver), above(point), [PlaneId::NONE; 2])
    }
}

/// Weights by which values at some offsets make the value at 0: of the plane fitted to them, or of their mean, which follows the nearest.
fn fitted(normal: DVec3, points: &[Near]) -> Weights {
    let (u, v) = normal.any_orthonormal_pair();
    let terms = |offset: DVec3| DVec3::new(1.0, offset.dot(u), offset.dot(v));
    let sum: f64 = points.iter().map(|near| near.weight).sum();
    let mut matrix = DMat3::from_diagonal(DVec3::new(0.0, HELD, HELD) * sum);
    for near in points {
        let terms = terms(near.offset);
        matrix += DMat3::from_cols(terms * terms.x, terms * terms.y, terms * terms.z) * near.weight;
    }
    let first = matrix.inverse().x_axis;
    let plane: Vec<f64> = points.iter().map(|near| near.weight * first.dot(terms(near.offset))).collect();
    let is_held = plane.iter().map(|weight| weight.abs()).sum::<f64>() <= MOST_EXTRAPOLATION;
    let sum: f64 = points.iter().map(|near| near.weight_within(NEAR)).sum();
    let mean = |near: &Near| near.weight_within(NEAR) / sum;
    let weights = points.iter().zip(plane);
    weights.map(|(near, plane)| (near.point, if is_held { plane } else { mean(near) } as f32)).collect()
}

#[cfg(test)]
mod tests {
    use kernel::geometry::ConvexPolygon;

    use super::*;

    const EXTENT: f64 = 1000.0;
    const RAYS: u32 = 256;

    fn floor(x: f64, y: f64, z: f64) -> Receiver {
        Receiver { position: DVec3::new(x, y, z), normal: DVec3::Z, plane: PlaneId(0) }
    }

    fn grid(z: f64) -> Vec<Receiver> {
        (0..25).map(|index| floor(f64::from(index % 5) * 10.0, f64::from(index / 5) * 10.0, z)).collect()
    }

    fn panel(z: f64) -> Occluder {
        let corner = |(x, y)| DVec3::new(x, y, z);
        let corners = [(-99.0, -99.0), (99.0, -99.0), (99.0, 99.0), (-99.0, 99.0)].map(corner).to_vec();
        Occluder::new(&[ConvexPolygon { plane: PlaneId(7), corners }])
    }

    fn light(points: &[Receiver], of: impl Fn(DVec3) -> f64) -> Vec<DVec3> {
        points.iter().map(|point| DVec3::splat(of(point.position))).collect()
    }

    #[test]
    fn linear_light_is_interpolated_exactly_within_the_points() {
        let points = grid(0.0);
        let occluder = Occluder::new(&[]);
        let neighbours = Neighbours::new(&points, RAYS, &occluder, EXTENT);
        let linear = |at: DVec3| 3.0 + 0.2 * at.x - 0.1 * at.y;
        let values = light(&points, linear);
        for at in [floor(20.0, 20.0, 0.0), floor(17.0, 22.0, 0.0), floor(31.0, 12.0, 0.0)] {
            let weights = neighbours.weights(&at, 0.0, None).unwrap();
            let sum: f32 = weights.iter().map(|(_, weight)| weight).sum();
            assert!((sum - 1.0).abs() < 1e-5, "{sum}");
            let found = interpolated(&weights, &values).x;
            assert!((found - linear(at.position)).abs() < 0.03, "{found} at {at:?}");
        }
    }

    #[test]
    fn points_on_the_other_side_of_a_panel_do_not_count() {
        // Bright above the panel, dark below it, a thousandth of the scene apart.
        let mut points = grid(0.5);
        points.extend(grid(-0.5));
        let values = light(&points, |at| f64::from(at.z > 0.0));
        for (occluder, expected) in [(panel(0.2), 0.95..=1.05), (Occluder::new(&[]), 0.5..=0.85)] {
            let neighbours = Neighbours::new(&points, RAYS, &occluder, EXTENT);
            let weights = neighbours.weights(&floor(15.0, 15.0, 0.5), 0.0, None).unwrap();
            let found = interpolated(&weights, &values).x;
            assert!(expected.contains(&found), "{found}, expected {expected:?}");
        }
    }

    #[test]
    fn light_follows_the_sky_of_each_receiver() {
        let half = |first: u32| Some(vec![(first, 0.5), (first + 1, 0.5)]);
        let mut between = Interpolation::new([half(0), half(1), None]);
        let light = [1.0, 3.0, 5.0].map(DVec3::splat);
        let skies = [0.0, 0.0, 1.0].map(DVec3::splat);
        between.follow_sky(&[0.5, 0.5, 0.5], &skies);
        let expected = [2.0 * factor_by_sky(0.5, 0.0), 4.0 * factor_by_sky(0.5, 0.5), 0.0];
        for (found, expected) in between.of(&light).iter().zip(expected) {
            assert!((found.x - expected).abs() < 1e-6, "{found}, not {expected}");
        }
    }

    #[test]
    fn a_receiver_that_sees_no_point_is_alone() {
        let points = grid(10.0);
        let occluder = panel(5.0);
        let neighbours = Neighbours::new(&points, RAYS, &occluder, EXTENT);
        assert_eq!(neighbours.weights(&floor(15.0, 15.0, 0.0), 0.0, None), None);
        assert!(neighbours.weights(&floor(15.0, 15.0, 10.0), 0.0, None).is_some());
        let wall = Receiver { normal: DVec3::X, ..floor(15.0, 15.0, 10.0) };
        assert_eq!(neighbours.weights(&wall, 0.05, None), None, "no point faces as it does");
        assert_eq!(Neighbours::new(&[], RAYS, &occluder, EXTENT).weights(&wall, 0.0, None), None);
    }

    #[test]
    fn a_point_does_not_count_for_itself_where_it_is_left_out() {
        let points = grid(0.0);
        let occluder = Occluder::new(&[]);
        let neighbours = Neighbours::new(&points, RAYS, &occluder, EXTENT);
        let own = neighbours.weights(&points[12], 0.0, None).unwrap();
        assert!(own.iter().any(|(point, _)| *point == 12), "{own:?}");
        let others = neighbours.weights(&points[12], 0.0, Some(12)).unwrap();
        assert!(others.iter().all(|(point, _)| *point != 12));
    }
}
