//! What errors at sample points tell of those over all surfaces.

use glam::DVec3;

use super::SamplePoints;
use crate::error_budget::{INTERPOLATED_NOISE, without_noise};
use crate::mesh::Mesh;
use crate::refinement::draw::SamplePoint;

impl SamplePoints {
    /// Relative interpolation error, given the mean reflectance and the relative noise of the light at a vertex. Where light is
    /// gathered twice, what it is at least comes second: there few of some thousand points may hold most of it.
    pub fn interpolation_error(
        &self,
        mesh: &Mesh,
        fitted: &[DVec3],
        reflectance: f64,
        noise: f64,
    ) -> [f64; 2] {
        let errors: Vec<DVec3> = self.compare(mesh, fitted).into_iter().map(|(_, error)| error).collect();
        let errors = self.with_level(&errors, reflectance);
        // The gathered light is noisy too, unless two draws tell it apart.
        let gathered = if self.is_drawn_twice() { 0.0 } else { 1.0 };
        let noise = noise * (gathered + INTERPOLATED_NOISE).sqrt();
        let all = self.relative(&errors);
        let at_least = if self.is_drawn_twice() { self.relative_at_least(&errors) } else { all };
        [all, at_least].map(|mixed| without_noise(mixed, noise))
    }

    /// Mean over the area of the square error of the radiosity, given errors of the irradiance at the points.
    pub fn mean_square_error(&self, errors: &[DVec3]) -> f64 {
        let of_radiosity = |(point, error): (&SamplePoint, &DVec3)| point.reflectance * *error;
        self.mean_square_and_its_error(&self.points.iter().zip(errors).map(of_radiosity).collect::<Vec<_>>())
            .0
    }

    /// Whether light is gathered twice at each position.
    fn is_drawn_twice(&self) -> bool {
        self.points.len() > 1 && self.points[0].position == self.points[1].position
    }

    /// Number of positions.
    pub fn positions(&self) -> usize {
        self.points.len() / if self.is_drawn_twice() { 2 } else { 1 }
    }

    /// Differences of the radiosity at the first points where other shooters give these irradiances.
    pub fn differences(&self, other: &[DVec3]) -> Vec<DVec3> {
        let mut all: Vec<DVec3> =
            self.direct.iter().zip(other).map(|(direct, other)| *direct + *other).collect();
        self.bound(&mut all);
        let pairs = self.points.iter().zip(&self.irradiance).zip(all);
        pairs.map(|((point, own), all)| point.reflectance * (all - *own)).collect()
    }

    /// Root mean square of radiosity errors at the first points, relative to that of the radiosity. Of two draws it is what the noise
    /// could hide at least, where that is more: their mean square may be below 0 by chance.
    pub fn relative(&self, errors: &[DVec3]) -> f64 {
        let norm = self.mean_square_radiosity();
        let (mean, standard_error) = self.mean_square_and_its_error(errors);
        let least = if self.is_drawn_twice() { standard_error } else { 0.0 };
        if norm > 0.0 { (mean.max(least) / norm).sqrt() } else { 0.0 }
    }

    /// What [`Self::relative`] tells, less the standard error of its square: where few points hold most of it, little is certain.
    pub fn relative_at_least(&self, errors: &[DVec3]) -> f64 {
        let norm = self.mean_square_radiosity();
        let (mean, standard_error) = self.mean_square_and_its_error(errors);
        if norm > 0.0 { ((mean - standard_error).max(0.0) / norm).sqrt() } else { 0.0 }
    }

    /// Mean over the area of the squares of values at the first points, below 0 where two draws of small ones have much noise, and its
    /// standard error.
    fn mean_square_and_its_error(&self, values: &[DVec3]) -> (f64, f64) {
        let squares = self.squares(values);
        let count = squares.len().max(1) as f64;
        let mean = squares.iter().sum::<f64>() / count;
        let variance =
            squares.iter().map(|square| (square - mean).powi(2)).sum::<f64>() / (count - 1.0).max(1.0);
        (mean, (variance / count).sqrt())
    }

    /// Squares of values at the first points, weighted: one of each position.
    fn squares(&self, values: &[DVec3]) -> Vec<f64> {
        let draws = if self.is_drawn_twice() { 2 } else { 1 };
        // Of one draw the first is the last, too.
        let square = |values: &[DVec3]| values[0].dot(values[values.len() - 1]);
        let squares = values.chunks_exact(draws).map(square);
        self.points.iter().step_by(draws).zip(squares).map(|(point, square)| point.weight * square).collect()
    }

    /// Errors of the radiosity with the interreflection of their mean: light lost between the vertices is missing on all surfaces,
    /// by mean x rho / (1 - rho) relative to their radiosity.
    fn with_level(&self, errors: &[DVec3], reflectance: f64) -> Vec<DVec3> {
        let weighted = |(point, value): (&SamplePoint, &DVec3)| point.weight * value.element_sum();
        let radiosities: Vec<DVec3> =
            self.points.iter().zip(&self.irradiance).map(|(point, e)| point.reflectance * *e).collect();
        let lost: f64 = self.points.iter().zip(errors).map(weighted).sum();
        let flux: f64 = self.points.iter().zip(&radiosities).map(weighted).sum();
        let level = if flux > 0.0 { lost / flux * reflectance / (1.0 - reflectance) } else { 0.0 };
        errors.iter().zip(radiosities).map(|(error, radiosity)| *error + radiosity * level).collect()
    }

    /// Relative standard error of the radiosity at the first `count` points, from the rays that sampled visibility. Each row has
    /// the light of its shooter, and its variance summed over the points.
    pub fn noise(&self, rows: impl Iterator<Item = (DVec3, f64)>, count: usize) -> f64 {
        let variance: DVec3 = rows.map(|(light, sum)| light * light * sum).sum();
        let reflectance: DVec3 = self.points.iter().map(|point| point.reflectance * point.reflectance).sum();
        let norm = self.mean_square_radiosity();
        let points = (count * self.points.len()) as f64;
        if norm > 0.0 { ((variance * reflectance).element_sum() / (points * norm)).sqrt() } else { 0.0 }
    }

    /// Mean square of the gathered radiosity.
    pub(super) fn mean_square_radiosity(&self) -> f64 {
        self.mean_square_error(&self.irradiance).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use kernel::geometry::PlaneId;
    use kernel::replica::Receiver;
    use sobol_burley::sample_4d;

    use super::*;
    use crate::mesh::PatchId;

    const ERROR: f64 = 0.1;
    const NOISE: f64 = 0.5;
    const POSITIONS: usize = 1 << 16;

    /// Points of radiosity 1, each position drawn so often, and errors of [`ERROR`] under [`NOISE`].
    fn noisy(draws: usize) -> (SamplePoints, Vec<DVec3>) {
        let receiver = Receiver { position: DVec3::ZERO, normal: DVec3::Y, plane: PlaneId(0) };
        let point = |index: usize| SamplePoint {
            patch: PatchId(0),
            reflectance: DVec3::ONE,
            receiver,
            position: DVec3::X * (index / draws) as f64,
            weight: 1.0,
        };
        let count = POSITIONS * draws;
        let points: Vec<SamplePoint> = (0..count).map(point).collect();
        let noise = |index: usize| {
            // Of one sequence neighbours would not be independent.
            let (position, draw) = (index / draws, index % draws);
            if sample_4d(position as u32, 0, 1 + draw as u32)[0] < 0.5 { NOISE } else { -NOISE }
        };
        let errors = (0..count).map(|index| DVec3::X * (ERROR + noise(index))).collect();
        let irradiance = vec![DVec3::X; count];
        (SamplePoints { points, irradiance, ..SamplePoints::default() }, errors)
    }

    #[test]
    fn two_draws_tell_an_error_from_noise() {
        let (once, errors) = noisy(1);
        assert!((once.relative(&errors) - ERROR.hypot(NOISE)).abs() < 0.02);
        let (twice, errors) = noisy(2);
        assert!((twice.relative(&errors) - ERROR).abs() < 0.02, "{}", twice.relative(&errors));
        assert!(twice.relative_at_least(&errors) < twice.relative(&errors));
    }

    #[test]
    fn few_draws_do_not_claim_that_there_is_no_error() {
        let (points, errors) = noisy(2);
        for count in [16, 64, 256] {
            let first = SamplePoints {
                points: points.points[..count].to_vec(),
                irradiance: points.irradiance[..count].to_vec(),
                ..SamplePoints::default()
            };
            assert!(first.relative(&errors[..count]) > 0.02, "{count}: {}", first.relative(&errors[..count]));
        }
    }
}
