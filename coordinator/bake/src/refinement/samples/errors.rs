//! What errors at sample points tell of those over all surfaces.

use glam::DVec3;

use super::SamplePoints;
use crate::error_budget::{INTERPOLATED_NOISE, without_noise};
use crate::mesh::Mesh;
use crate::refinement::cap::Cap;
use crate::refinement::draw::SamplePoint;

impl SamplePoints {
    /// Relative interpolation error, given the mean reflectance and the relative noise of the light at a vertex; then the same less the
    /// standard error of its square: few of all points may hold most of it.
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
        [self.relative(&errors), self.relative_at_least(&errors)].map(|mixed| without_noise(mixed, noise))
    }

    /// Mean over the area of the square error of the radiosity under a cap, given the irradiance at the points, and errors of it.
    pub fn mean_square_error(&self, errors: &[DVec3], irradiance: &[DVec3], cap: Cap) -> f64 {
        let square = |((point, error), irradiance): ((&SamplePoint, &DVec3), &DVec3)| {
            let [error, radiosity] =
                [*error, *irradiance].map(|light| (point.reflectance * light).length_squared());
            point.weight * error * cap.part(radiosity)
        };
        let points = self.points.iter().zip(errors).zip(irradiance);
        mean_and_its_error(&points.map(square).collect::<Vec<_>>()).0
    }

    /// Whether light is gathered twice at each position.
    fn is_drawn_twice(&self) -> bool {
        self.points.len() > 1 && self.points[0].position == self.points[1].position
    }

    /// How often light is gathered at each position.
    fn draws(&self) -> usize {
        if self.is_drawn_twice() { 2 } else { 1 }
    }

    /// Number of positions.
    pub fn positions(&self) -> usize {
        self.points.len() / self.draws()
    }

    /// Differences of the radiosity at the first points where other shooters give these irradiances.
    pub fn differences(&self, other: &[DVec3]) -> Vec<DVec3> {
        let mut all: Vec<DVec3> =
            self.direct.iter().zip(other).map(|(direct, other)| *direct + *other).collect();
        self.bound(&mut all);
        let pairs = self.points.iter().zip(&self.irradiance).zip(all);
        pairs.map(|((point, own), all)| point.reflectance * (all - *own)).collect()
    }

    /// Root mean square of radiosity errors at the first points, relative to that of the radiosity, or the same with the brightest places
    /// capped, where it is more. Of two draws it is what the noise could hide at least, where that is more: their mean square may be below
    /// 0 by chance.
    pub fn relative(&self, errors: &[DVec3]) -> f64 {
        let least = if self.is_drawn_twice() { 1.0 } else { 0.0 };
        self.largest_relative(errors, |mean, standard_error| mean.max(least * standard_error))
    }

    /// What [`Self::relative`] tells, less the standard error of its square: where few points hold most of it, little is certain.
    pub fn relative_at_least(&self, errors: &[DVec3]) -> f64 {
        self.largest_relative(errors, |mean, standard_error| (mean - standard_error).max(0.0))
    }

    /// Root of an `estimate` from a mean square error and its standard error, relative to the radiosity: over all places, or with the
    /// brightest capped where that is more.
    fn largest_relative(&self, errors: &[DVec3], estimate: impl Fn(f64, f64) -> f64) -> f64 {
        let (places, errors) = (self.places(), self.squares(errors));
        let relative = |cap: Cap| {
            let part = |(square, _): &(f64, f64)| cap.part(*square);
            let norm = cap.norm(&places) / places.len().max(1) as f64;
            let errors: Vec<f64> =
                errors.iter().zip(&places).map(|(error, place)| error * part(place)).collect();
            let (mean, standard_error) = mean_and_its_error(&errors);
            if norm > 0.0 { (estimate(mean, standard_error) / norm).sqrt() } else { 0.0 }
        };
        relative(Cap::NONE).max(relative(Cap::over(places.clone())))
    }

    /// The square of the radiosity at each position, with its weight.
    fn places(&self) -> Vec<(f64, f64)> {
        let draws = self.draws();
        let radiosities = self.radiosities();
        let points = self.points.iter().step_by(draws).zip(radiosities.chunks_exact(draws));
        points.map(|(point, radiosity)| (square(radiosity), point.weight)).collect()
    }

    fn radiosities(&self) -> Vec<DVec3> {
        let radiosity = |(point, irradiance): (&SamplePoint, &DVec3)| point.reflectance * *irradiance;
        self.points.iter().zip(&self.irradiance).map(radiosity).collect()
    }

    /// Squares of values at the first points, weighted: one of each position.
    fn squares(&self, values: &[DVec3]) -> Vec<f64> {
        let draws = self.draws();
        let values = values.chunks_exact(draws);
        self.points.iter().step_by(draws).zip(values).map(|(point, own)| point.weight * square(own)).collect()
    }

    /// Errors of the radiosity with the interreflection of their mean: light lost between the vertices is missing on all surfaces,
    /// relative to their radiosity by its part of the flux, times what comes back.
    fn with_level(&self, errors: &[DVec3], reflectance: f64) -> Vec<DVec3> {
        let radiosities = self.radiosities();
        let [lost, flux] = [errors, &radiosities].map(|values| self.flux(values));
        let level = if flux > 0.0 { lost / flux * self.returning(flux, reflectance) } else { 0.0 };
        errors.iter().zip(radiosities).map(|(error, radiosity)| *error + radiosity * level).collect()
    }

    /// What comes back and is reflected again, over what is reflected straight from the sources. In a closed room it is rho / (1 - rho),
    /// and nowhere more: as much is taken where direct light is not known.
    fn returning(&self, flux: f64, reflectance: f64) -> f64 {
        let enclosed = reflectance / (1.0 - reflectance);
        let pairs = self.points.iter().zip(&self.direct);
        let direct: Vec<DVec3> = pairs.map(|(point, direct)| point.reflectance * *direct).collect();
        let direct = self.flux(&direct);
        if direct > 0.0 { (flux / direct - 1.0).clamp(0.0, enclosed) } else { enclosed }
    }

    /// What is proportional to the flux from all surfaces that have these radiosities at the points.
    fn flux(&self, radiosities: &[DVec3]) -> f64 {
        let pairs = self.points.iter().zip(radiosities);
        pairs.map(|(point, radiosity)| point.weight * radiosity.element_sum()).sum()
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
        mean_and_its_error(&self.squares(&self.radiosities())).0.max(0.0)
    }
}

/// Mean of squares, below 0 where two draws of small ones have much noise, and its standard error.
fn mean_and_its_error(squares: &[f64]) -> (f64, f64) {
    let count = squares.len().max(1) as f64;
    let mean = squares.iter().sum::<f64>() / count;
    let variance = squares.iter().map(|square| (square - mean).powi(2)).sum::<f64>() / (count - 1.0).max(1.0);
    (mean, (variance / count).sqrt())
}

/// Square of a value from one or two draws: of one draw the first is the last, too.
fn square(draws: &[DVec3]) -> f64 {
    draws[0].dot(draws[draws.len() - 1])
}

#[cfg(test)]
mod tests {
    use kernel::geometry::PlaneId;
    use kernel::replica::Receiver;
    use sobol_burley::sample_4d;

    use super::*;
    use crate::mesh::PatchId;
    use crate::test_scenes::squares;

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

    /// One point of hundreds in a narrow shadow must not decide how far to refine.
    #[test]
    fn an_error_that_one_point_tells_is_not_certain() {
        let mesh = squares(&[1.0]);
        let (points, _) = noisy(1);
        let first = |irradiance: Vec<DVec3>| SamplePoints {
            points: points.points[..irradiance.len()].to_vec(),
            irradiance,
            ..SamplePoints::default()
        };
        let found = |points: SamplePoints| points.interpolation_error(&mesh, &[DVec3::X; 4], 0.0, 0.0);
        let mut irradiance = vec![DVec3::X; 400];
        irradiance[7] = DVec3::ZERO;
        let [of_one, at_least] = found(first(irradiance));
        assert!((of_one - 0.05).abs() < 1e-3 && at_least < 0.2 * of_one, "{of_one}, {at_least}");
        let [of_all, at_least] = found(first(vec![DVec3::X * 0.95; 400]));
        assert!((of_all - 0.05).abs() < 4e-3 && at_least > 0.9 * of_all, "{of_all}, {at_least}");
    }

    /// Where little area holds nearly all light, its errors count, and so do those of the rest.
    #[test]
    fn bright_places_hide_no_errors() {
        let (mut points, _) = noisy(1);
        let bright = |index: usize| index.is_multiple_of(1024);
        for (index, light) in points.irradiance.iter_mut().enumerate() {
            *light *= if bright(index) { 1000.0 } else { 1.0 };
        }
        let found = |of_bright: f64, of_rest: f64| {
            let error = |index: usize| DVec3::X * if bright(index) { 1000.0 * of_bright } else { of_rest };
            points.relative(&(0..POSITIONS).map(error).collect::<Vec<_>>())
        };
        assert!((found(0.0, ERROR) - ERROR).abs() < 1e-3, "{}", found(0.0, ERROR));
        assert!((found(ERROR, 0.0) - ERROR).abs() < 1e-3, "{}", found(ERROR, 0.0));
    }

    #[test]
    fn lost_light_is_missing_as_often_as_light_comes_back() {
        let (points, errors) = noisy(1);
        let level = |direct: f64| {
            let points = SamplePoints { direct: vec![DVec3::X * direct; POSITIONS], ..points.clone() };
            points.with_level(&errors, 0.9)[0].x - errors[0].x
        };
        let lost = ERROR;
        assert!((level(0.5) - lost).abs() < 0.01, "half comes back");
        assert!((level(1.0)).abs() < 0.01, "none does");
        assert!((level(0.01) - 9.0 * lost).abs() < 0.1, "no more than in a closed room");
        assert!((level(0.0) - 9.0 * lost).abs() < 0.1, "not known");
    }
}
