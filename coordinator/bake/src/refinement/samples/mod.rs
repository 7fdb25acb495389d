//! Sample points: random points between the vertices, where interpolated light is compared with light gathered there. Refinement
//! samples tell where to divide patches; validation samples, drawn anew, measure the error of the solution.
//!
//! A shadow that falls between all vertices of a coarse mesh leaves no trace at them. Random points see it with a known
//! probability, and their mean square error is an unbiased estimate of the integral.

mod errors;

use glam::DVec3;
use kernel::geometry::PlaneId;
use kernel::replica::{Receiver, Receivers};
use rayon::prelude::*;

use super::draw::{Draw, MOST_DRAWN, SamplePoint, draw_on, point_at};
use crate::mesh::{Mesh, PatchId, VertexId, interpolation};
use crate::settings::BakeSettings;
use crate::solver::bounds::Bounds;
use scene::Scene;

/// Key of the first point of the first draw as a receiver: above all vertices, so that its rays are its own.
const FIRST_KEY: u64 = 1 << 32;

/// Most light that evenly reflected light brings, relative to what is reflected at first.
const MOST_RETURNED: f64 = 10.0;

/// Sample points, and the light gathered at them.
///
/// Two points in turn at one position are two draws of the light there, with rays of their own. The noise of one is independent of the
/// other's: squares of errors are then products of both, and have no noise in their mean.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SamplePoints {
    /// Key of the first as a receiver.
    first_key: u64,
    points: Vec<SamplePoint>,
    /// Irradiance from the light sources.
    direct: Vec<DVec3>,
    /// Total irradiance.
    irradiance: Vec<DVec3>,
    /// Whether each sees any surface or light source. Known of middles only.
    exposed: Vec<bool>,
    /// Scales the light of those that see more than a hemisphere: vertices there are scaled, too.
    bounds: Bounds,
}

impl SamplePoints {
    /// Draws points on the reflecting surfaces: half of them uniformly over the area, half by what `expected` tells
    /// of each leaf's part of the error, where it is known.
    pub fn draw(
        mesh: &Mesh,
        scene: &Scene,
        settings: &BakeSettings,
        expected: &[(PatchId, f64)],
        draw: Draw,
    ) -> Self {
        let reflects =
            |id: &PatchId| scene.surfaces[mesh.patch(*id).surface as usize].reflectance != DVec3::ZERO;
        let reflecting: Vec<PatchId> = mesh.leaves().map(|(id, _)| id).filter(reflects).collect();
        let mut errors = vec![0.0; mesh.patches.len()];
        expected.iter().for_each(|(id, error)| errors[id.index()] = *error);
        let expected: Vec<f64> = reflecting.iter().map(|id| errors[id.index()]).collect();
        let draws = if draw.is_twice { 2 } else { 1 };
        let first = draw.positions_before;
        let positions = draw.positions(settings.validation_samples, reflecting.len());
        let seed = (settings.seed, draw.round);
        let points = draw_on(mesh, scene, &reflecting, &expected, seed, first..first + positions);
        let first_key = FIRST_KEY + u64::from(draw.round) * MOST_DRAWN as u64 + (first * draws) as u64;
        let points = points.into_iter().flat_map(|point| std::iter::repeat_n(point, draws)).collect();
        Self { first_key, points, ..Self::default() }
    }

    /// Appends points of the same draw, with the light gathered at them.
    pub fn append(&mut self, more: Self) {
        if self.points.is_empty() {
            self.first_key = more.first_key;
        }
        self.points.extend(more.points);
        self.direct.extend(more.direct);
        self.irradiance.extend(more.irradiance);
        self.bounds.append(more.bounds);
    }

    /// Draws this many points, at most [`MOST_DRAWN`], on all surfaces in the same way. `expected` is that of each leaf, or empty.
    /// Keys of receivers start at `first_key`.
    pub fn draw_everywhere(
        mesh: &Mesh,
        scene: &Scene,
        seed: (u64, u32),
        first_key: u64,
        expected: &[f64],
        count: usize,
    ) -> Self {
        let leaves: Vec<PatchId> = mesh.leaves().map(|(id, _)| id).collect();
        Self { first_key, points: draw_on(mesh, scene, &leaves, expected, seed, 0..count), ..Self::default() }
    }

    /// The middles of these leaves. Keys of receivers start at `first_key`.
    pub fn middles(mesh: &Mesh, scene: &Scene, leaves: &[PatchId], first_key: u64) -> Self {
        let middle = |id: &PatchId| point_at(mesh, scene, *id, mesh.centre(*id), 1.0);
        Self { first_key, points: leaves.par_iter().map(middle).collect(), ..Self::default() }
    }

    /// The first `count` points as receivers.
    pub fn receivers(&self, count: usize) -> Receivers {
        let receivers = self.points.iter().take(count).map(|point| point.receiver).collect();
        Receivers { first_key: self.first_key, receivers }
    }

    /// Number of points.
    pub fn count(&self) -> usize {
        self.points.len()
    }

    /// Sets the sums of the form factors: light that is set from now on is scaled down where they are above 1.
    pub fn set_row_sums(&mut self, sums: &[f64]) {
        self.bounds = Bounds::default();
        self.bounds.add(sums);
    }

    /// Whether the sums of the form factors are known.
    pub fn has_row_sums(&self) -> bool {
        self.bounds.vertices() == self.points.len()
    }

    /// Scales the light of points that see more than a hemisphere.
    pub fn bound(&self, light: &mut [DVec3]) {
        self.bounds.apply(0, light);
    }

    /// Sets the direct irradiance.
    pub fn set_direct(&mut self, direct: Vec<DVec3>) {
        self.direct = direct;
    }

    /// Adds to the direct irradiance.
    pub fn add_direct(&mut self, light: &[DVec3]) {
        self.direct.iter_mut().zip(light).for_each(|(direct, light)| *direct += *light);
    }

    /// Sets the total irradiance, given that from the shares.
    pub fn set_gathered(&mut self, gathered: &[DVec3]) {
        self.set_irradiance(
            self.direct.iter().zip(gathered).map(|(direct, light)| *direct + *light).collect(),
        );
    }

    /// Sets the total irradiance.
    pub fn set_irradiance(&mut self, mut irradiance: Vec<DVec3>) {
        self.bound(&mut irradiance);
        self.irradiance = irradiance;
    }

    /// Sets the total irradiance as if all that is reflected of the direct light, and of this irradiance beside it, came back evenly,
    /// to [`MOST_RETURNED`] times as much: as in a closed room, where there is most of it.
    pub fn reflect_evenly(&mut self, beside: DVec3) {
        let (mut reflected, mut reflectance, mut all) = (DVec3::ZERO, DVec3::ZERO, 0.0);
        for (point, direct) in self.points.iter().zip(&self.direct) {
            reflected += point.weight * point.reflectance * (*direct + beside);
            reflectance += point.weight * point.reflectance;
            all += point.weight;
        }
        let lost = (all - reflectance).max(DVec3::splat(all / MOST_RETURNED));
        let back = if all > 0.0 { reflected / lost } else { DVec3::ZERO };
        self.set_irradiance(self.direct.iter().map(|direct| *direct + beside + back).collect());
    }

    /// Root mean square over the area of the gathered radiosity.
    pub fn level(&self) -> f64 {
        self.mean_square_radiosity().sqrt()
    }

    /// Returns true if the mesh has a patch for every point.
    pub fn lie_on(&self, mesh: &Mesh) -> bool {
        self.points.iter().all(|point| point.patch.index() < mesh.patches.len())
    }

    /// Encodes the points for later comparisons: the patch of each, and 7 numbers: reflectance, position and weight.
    pub fn to_numbers(&self) -> (Vec<u32>, Vec<f64>) {
        let numbers = |point: &SamplePoint| {
            let [reflectance, position] = [point.reflectance, point.position].map(|v| v.to_array());
            reflectance.into_iter().chain(position).chain([point.weight])
        };
        let patches = self.points.iter().map(|point| point.patch.0).collect();
        (patches, self.points.iter().flat_map(numbers).collect())
    }

    /// Decodes points, for comparisons only; `None` where the numbers are not valid.
    pub fn from_numbers(patches: &[u32], numbers: &[f64]) -> Option<Self> {
        let (numbers, rest) = numbers.as_chunks::<7>();
        let fits = rest.is_empty() && numbers.len() == patches.len();
        let can_be = numbers.as_flattened().iter().all(|number| number.is_finite());
        let point = |(patch, &[r, g, b, x, y, z, weight]): (&u32, &[f64; 7])| {
            let position = DVec3::new(x, y, z);
            let receiver = Receiver { position, normal: DVec3::ZERO, plane: PlaneId(0) };
            let reflectance = DVec3::new(r, g, b);
            SamplePoint { patch: PatchId(*patch), reflectance, receiver, position, weight }
        };
        (fits && can_be)
            .then(|| Self { points: patches.iter().zip(numbers).map(point).collect(), ..Self::default() })
    }

    /// Sets which points see any surface or light source.
    pub fn set_exposed(&mut self, covered: &[f64]) {
        let sees = |(covered, direct): (&f64, &DVec3)| *covered > 0.0 || *direct != DVec3::ZERO;
        self.exposed = covered.iter().zip(&self.direct).map(sees).collect();
    }

    /// Mean irradiance of a leaf, from the mean of its corners and the light in its middle, if it is known: exact where light is
    /// quadratic over a triangle, a parallelogram or a regular polygon (Simpson's rule). Corners of a room are darker than its walls.
    /// A middle inside of something else is not exposed, and does not count. Only of points made as middles, of leaves by rising number.
    pub fn mean(&self, mesh: &Mesh, leaf: PatchId, of_corners: DVec3) -> DVec3 {
        self.mean_with(mesh, leaf, of_corners, &self.irradiance)
    }

    /// The same of light straight from the sources.
    pub fn mean_direct(&self, mesh: &Mesh, leaf: PatchId, of_corners: DVec3) -> DVec3 {
        self.mean_with(mesh, leaf, of_corners, &self.direct)
    }

    fn mean_with(&self, mesh: &Mesh, leaf: PatchId, of_corners: DVec3, middles: &[DVec3]) -> DVec3 {
        let Ok(found) = self.points.binary_search_by_key(&leaf, |point| point.patch) else {
            return of_corners;
        };
        match (self.exposed.get(found), middles.get(found)) {
            (Some(true), Some(middle)) => {
                of_corners.lerp(*middle, part_of_middle(mesh.patch(leaf).corners.len()))
            }
            _ => of_corners,
        }
    }

    /// Values at the points with the leaves that these lie in.
    pub fn on_leaves(&self, mesh: &Mesh, values: Vec<DVec3>) -> Vec<(PatchId, DVec3)> {
        let leaf = |point: &SamplePoint| mesh.leaf_at(point.patch, point.position);
        self.points.iter().map(leaf).zip(values).collect()
    }

    /// Compares interpolated with gathered light: the leaf under each point, and the error of its radiosity.
    pub fn compare(&self, mesh: &Mesh, irradiance: &[DVec3]) -> Vec<(PatchId, DVec3)> {
        self.compare_with(mesh, irradiance, &self.irradiance)
    }

    /// The same with light straight from the sources.
    pub fn compare_direct(&self, mesh: &Mesh, irradiance: &[DVec3]) -> Vec<(PatchId, DVec3)> {
        self.compare_with(mesh, irradiance, &self.direct)
    }

    fn compare_with(&self, mesh: &Mesh, irradiance: &[DVec3], gathered: &[DVec3]) -> Vec<(PatchId, DVec3)> {
        let value = |vertex: VertexId| irradiance[vertex.index()];
        let found = |(point, gathered): (&SamplePoint, &DVec3)| {
            let leaf = mesh.leaf_at(point.patch, point.position);
            let corners = interpolation(mesh, leaf, point.position, value);
            let interpolated: DVec3 = corners.iter().map(|(vertex, weight)| value(*vertex) * *weight).sum();
            (leaf, point.reflectance * (interpolated - *gathered))
        };
        self.points.par_iter().zip(gathered).with_min_len(256).map(found).collect()
    }
}

/// Weight of the light in the middle of a polygon with so many corners in its mean, beside that of the corners: for a regular one,
/// 1 - r^2 / R^2 with r the radius of gyration and R that of the corners.
fn part_of_middle(corners: usize) -> f64 {
    1.0 - (2.0 + (std::f64::consts::TAU / corners as f64).cos()) / 6.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn light_comes_back_as_in_a_closed_room() {
        let returned = |reflectance: f64, beside: f64| {
            let receiver = Receiver { position: DVec3::ZERO, normal: DVec3::Z, plane: PlaneId(0) };
            let point = |weight| SamplePoint {
                patch: PatchId(0),
                reflectance: DVec3::splat(reflectance),
                receiver,
                position: DVec3::ZERO,
                weight,
            };
            let direct = vec![DVec3::splat(4.0), DVec3::ZERO];
            let mut samples =
                SamplePoints { points: vec![point(0.5), point(1.5)], direct, ..SamplePoints::default() };
            samples.reflect_evenly(DVec3::splat(beside));
            samples.irradiance.iter().map(|light| light.x).collect::<Vec<_>>()
        };
        // A mean of 1 over the area.
        assert_eq!(returned(0.5, 0.0), [5.0, 1.0]);
        assert_eq!(returned(0.5, 1.0), [7.0, 3.0]);
        assert_eq!(returned(0.0, 1.0), [5.0, 1.0]);
        assert_eq!(returned(1.0, 0.0), [14.0, 10.0]);
    }

    #[test]
    fn middles_weigh_as_much_as_simpsons_rule_says() {
        for (corners, part) in [(3, 0.75), (4, 2.0 / 3.0), (6, 7.0 / 12.0)] {
            assert!((part_of_middle(corners) - part).abs() < 1e-12, "{corners}");
        }
    }
}
