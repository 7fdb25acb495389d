//! Spherical harmonics of order 2, real, in the order and with the signs that graphics has them: 1; y, z, x; xy, yz, 3z² - 1, xz, x² - y².
//!
//! Irradiance is radiance convolved with a clamped cosine, which scales each band by a factor of its own and leaves next to nothing of
//! what is beyond the second (Ramamoorthi and Hanrahan, "An efficient representation for irradiance environment maps", 2001). So
//! irradiance by normal tells the radiance's harmonics.

use std::f64::consts::PI;

use glam::DVec3;

/// Harmonics of radiance: red, green and blue of each.
pub type Coefficients = [DVec3; 9];

/// Normals that the irradiance of a probe is asked for.
pub const NORMALS: usize = 32;

/// The harmonics in a direction.
fn basis(DVec3 { x, y, z }: DVec3) -> [f64; 9] {
    let band_0 = (1.0 / (4.0 * PI)).sqrt();
    let band_1 = (3.0 / (4.0 * PI)).sqrt();
    let band_2 = (15.0 / (4.0 * PI)).sqrt();
    [
        band_0,
        band_1 * y,
        band_1 * z,
        band_1 * x,
        band_2 * x * y,
        band_2 * y * z,
        band_2 / 12.0_f64.sqrt() * (3.0 * z * z - 1.0),
        band_2 * x * z,
        band_2 / 2.0 * (x * x - y * y),
    ]
}

/// By what the clamped cosine scales each harmonic.
const COSINE: [f64; 9] = {
    let (band_1, band_2) = (2.0 * PI / 3.0, PI / 4.0);
    [PI, band_1, band_1, band_1, band_2, band_2, band_2, band_2, band_2]
};

/// Irradiance of a surface with this normal.
#[must_use]
pub fn irradiance(coefficients: &Coefficients, normal: DVec3) -> DVec3 {
    let factors = basis(normal).into_iter().zip(COSINE).map(|(basis, cosine)| basis * cosine);
    factors.zip(coefficients).map(|(factor, coefficient)| *coefficient * factor).sum()
}

/// The normals, corners of an icosahedron and middles of its faces, each with its part of the sphere. Sums over them are integrals up
/// to the ninth order, so that bands up to the seventh do not disturb what is wanted.
pub fn normals() -> [(DVec3, f64); NORMALS] {
    let golden = (1.0 + 5.0_f64.sqrt()) / 2.0;
    let turned =
        |point: DVec3| [point, DVec3::new(point.y, point.z, point.x), DVec3::new(point.z, point.x, point.y)];
    let corners = [1.0, -1.0].map(|a| [1.0, -1.0].map(|b| turned(DVec3::new(0.0, a, b * golden))));
    // Middles of faces are the corners of a dodecahedron.
    let middles = [1.0, -1.0].map(|a| [1.0, -1.0].map(|b| turned(DVec3::new(0.0, a * golden, b / golden))));
    let cube = [1.0, -1.0].map(|x| [1.0, -1.0].map(|y| [1.0, -1.0].map(|z| DVec3::new(x, y, z))));
    let weighted = |weight: f64| move |point: DVec3| (point.normalize(), weight / 840.0);
    let corners = corners.into_iter().flatten().flatten().map(weighted(25.0));
    let middles = middles.into_iter().flatten().flatten().chain(cube.into_iter().flatten().flatten());
    let mut all = [(DVec3::ZERO, 0.0); NORMALS];
    all.iter_mut()
        .zip(corners.chain(middles.map(weighted(27.0))))
        .for_each(|(place, normal)| *place = normal);
    all
}

/// The harmonics, given the irradiance at each of the normals.
pub fn fitted(irradiance: impl IntoIterator<Item = DVec3>) -> Coefficients {
    let mut coefficients = [DVec3::ZERO; 9];
    for ((normal, part), irradiance) in normals().into_iter().zip(irradiance) {
        for ((coefficient, basis), cosine) in coefficients.iter_mut().zip(basis(normal)).zip(COSINE) {
            *coefficient += irradiance * (4.0 * PI * part * basis / cosine);
        }
    }
    coefficients
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Directions all over the sphere.
    fn directions(count: usize) -> impl Iterator<Item = DVec3> {
        (0..count).map(move |index| {
            let z = 1.0 - (2.0 * index as f64 + 1.0) / count as f64;
            let (sine, cosine) = (index as f64 * 2.399_963_229_728_653).sin_cos();
            let radius = (1.0 - z * z).sqrt();
            DVec3::new(radius * cosine, radius * sine, z)
        })
    }

    #[test]
    fn normals_are_distinct_and_cover_the_sphere() {
        let normals = normals();
        let sum: f64 = normals.iter().map(|(_, part)| part).sum();
        assert!((sum - 1.0).abs() < 1e-12, "{sum}");
        for (index, (a, _)) in normals.iter().enumerate() {
            assert!(normals[..index].iter().all(|(b, _)| a.dot(*b) < 0.9));
        }
    }

    #[test]
    fn sums_over_the_normals_are_integrals_up_to_the_ninth_order() {
        let axis = DVec3::new(0.3, -0.5, 0.8).normalize();
        for order in 0..=9 {
            let sum: f64 = normals().iter().map(|(normal, part)| part * normal.dot(axis).powi(order)).sum();
            let expected = if order % 2 == 0 { 1.0 / f64::from(order + 1) } else { 0.0 };
            assert!((sum - expected).abs() < 1e-12, "{order}: {sum}");
        }
        let tenth: f64 = normals().iter().map(|(normal, part)| part * normal.dot(axis).powi(10)).sum();
        assert!((tenth - 1.0 / 11.0).abs() > 1e-6, "{tenth}");
    }

    #[test]
    fn even_light_has_one_coefficient() {
        let coefficients = fitted([DVec3::splat(PI); NORMALS]);
        // Of radiance 1.
        assert!((coefficients[0].x - (4.0 * PI).sqrt()).abs() < 1e-12);
        assert!(coefficients[1..].iter().all(|coefficient| coefficient.length() < 1e-12));
        assert!((irradiance(&coefficients, DVec3::X) - DVec3::splat(PI)).length() < 1e-12);
    }

    #[test]
    fn light_of_the_first_bands_is_kept_whole() {
        let radiance = [3.0, -0.4, 0.5, 0.9, 0.2, -0.6, 0.3, 0.1, -0.7].map(DVec3::splat);
        let found = fitted(normals().map(|(normal, _)| irradiance(&radiance, normal)));
        for (found, expected) in found.iter().zip(radiance) {
            assert!((*found - expected).length() < 1e-12, "{found} {expected}");
        }
    }

    /// The bound of what order 2 can hold: beams are worst.
    #[test]
    fn a_beam_loses_a_twelfth_and_no_more() {
        for beam in directions(50) {
            let exact = |normal: DVec3| normal.dot(beam).max(0.0);
            let coefficients = fitted(normals().map(|(normal, _)| DVec3::splat(exact(normal))));
            let (mut errors, mut all) = (0.0, 0.0);
            for normal in directions(2000) {
                let exact = exact(normal);
                errors += (irradiance(&coefficients, normal).x - exact).powi(2);
                all += exact * exact;
            }
            let relative = f64::sqrt(errors / all);
            // 8.84 % are lost by cutting the series; the rest is the normals' own.
            assert!((0.088..0.095).contains(&relative), "{relative}");
        }
    }
}
