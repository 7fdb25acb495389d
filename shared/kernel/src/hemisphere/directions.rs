//! Directions over a hemisphere.

use std::borrow::Cow;
use std::f64::consts::TAU;
use std::sync::{LazyLock, OnceLock};

use glam::DVec3;
use sobol_burley::parts::hash;
use sobol_burley::sample_4d;

/// Sets of directions that are computed once, for each number of rays that is a power of two. Computing them anew takes as long as a
/// fifth of the rays do in a simple scene.
const SETS: u32 = 32;

/// Binary logarithm of the most rays of such a set: with more, the noise of the sets themselves would show, and they would fill the caches.
const MOST_KEPT: u32 = 10;

/// Number of a direction in its sequence, and its coordinates where the normal is +z.
type Numbered = (u32, DVec3);

/// By the logarithm of the number of rays, and set.
static KEPT: LazyLock<Vec<OnceLock<Vec<Numbered>>>> =
    LazyLock::new(|| (0..(MOST_KEPT + 1) * SETS).map(|_| OnceLock::new()).collect());

/// Unit vectors over the hemisphere about a normal, with the density of the cosine, and their numbers in the sequence: Owen-scrambled
/// Sobol' points, spread over the disk below. Vectors that follow each other are much alike: their rays go through the same parts of
/// the tree, which then are in the caches. Up to a thousand they are those of one of a few sequences, turned about the normal by an angle
/// of their own.
pub fn directions(normal: DVec3, rays: u32, seed: u32) -> impl Iterator<Item = (u32, DVec3)> {
    let (tangent, bitangent) = normal.any_orthonormal_pair();
    let is_kept = rays.is_power_of_two() && rays <= 1 << MOST_KEPT;
    let (about, turn) = if is_kept {
        let random = hash(seed);
        let (set, turn) = (random % SETS, f64::from(random / SETS) / f64::from(u32::MAX / SETS + 1));
        let kept = &KEPT[(rays.trailing_zeros() * SETS + set) as usize];
        (Cow::Borrowed(kept.get_or_init(|| about_z(rays, set)).as_slice()), turn)
    } else {
        (Cow::Owned(about_z(rays, seed)), 0.0)
    };
    let (sine, cosine) = (TAU * turn).sin_cos();
    let (tangent, bitangent) = (tangent * cosine + bitangent * sine, bitangent * cosine - tangent * sine);
    (0..about.len()).map(move |index| {
        let (number, DVec3 { x, y, z }) = about[index];
        (number, tangent * x + bitangent * y + normal * z)
    })
}

/// The directions of a sequence about +z, along a curve.
fn about_z(rays: u32, seed: u32) -> Vec<Numbered> {
    let mut points: Vec<(u32, u32, [f32; 2])> = (0..rays)
        .map(|index| {
            let [x, y, ..] = sample_4d(index, 0, seed);
            (along_curve(x, y), index, [x, y])
        })
        .collect();
    points.sort_unstable_by_key(|(place, index, _)| (*place, *index));
    let direction = |(_, index, [x, y]): (u32, u32, [f32; 2])| {
        let (x, y) = on_disk(f64::from(x), f64::from(y));
        (index, DVec3::new(x, y, (1.0 - x * x - y * y).max(0.0).sqrt()))
    };
    points.into_iter().map(direction).collect()
}

/// Place of a point of the unit square along the curve through 256 x 256 cells that Morton's order is.
fn along_curve(x: f32, y: f32) -> u32 {
    let spread = |coordinate: f32| {
        let cell = (coordinate * 256.0) as u32;
        let cell = (cell | cell << 4) & 0x0f0f;
        let cell = (cell | cell << 2) & 0x3333;
        (cell | cell << 1) & 0x5555
    };
    spread(x) | spread(y) << 1
}

/// The concentric map of the unit square to the unit disk, which keeps areas and neighbours (Shirley and Chiu, "A low distortion map
/// between disk and square", 1997).
fn on_disk(x: f64, y: f64) -> (f64, f64) {
    let (a, b) = (2.0 * x - 1.0, 2.0 * y - 1.0);
    if a == 0.0 && b == 0.0 {
        return (0.0, 0.0);
    }
    let (radius, angle) =
        if a.abs() > b.abs() { (a, TAU / 8.0 * (b / a)) } else { (b, TAU / 4.0 - TAU / 8.0 * (a / b)) };
    let (sine, cosine) = angle.sin_cos();
    (radius * cosine, radius * sine)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whatever the order in which they are cast, they are those of the sequence.
    #[test]
    fn directions_that_follow_each_other_are_alike() {
        for rays in [256, 1024, 1000, 4096] {
            let found: Vec<(u32, DVec3)> = directions(DVec3::Z, rays, 3).collect();
            let mut numbers: Vec<u32> = found.iter().map(|(number, _)| *number).collect();
            numbers.sort_unstable();
            assert!(numbers.into_iter().eq(0..rays));
            assert!(found.iter().all(|(_, own)| (own.length() - 1.0).abs() < 1e-12 && own.z >= 0.0));
            // Two random points of the disk are 128 / (45 pi) apart in the mean.
            let apart: f64 = found.windows(2).map(|pair| (pair[1].1 - pair[0].1).truncate().length()).sum();
            assert!(apart / f64::from(rays) < 0.2, "{apart} with {rays} rays");
        }
    }

    /// Each set by itself has the density of the cosine: of each quarter of the disk, by area, it has a quarter of the rays.
    #[test]
    fn directions_have_the_density_of_the_cosine_whatever_the_seed() {
        let (rays, seeds) = (256, 200);
        let normal = DVec3::new(0.3, -0.5, 0.8).normalize();
        let (mut sum, mut squares) = (DVec3::ZERO, 0.0);
        for seed in 0..seeds {
            let inner = directions(normal, rays, seed).filter(|(_, own)| own.dot(normal) > 0.75_f64.sqrt());
            let part = inner.count() as f64 / f64::from(rays);
            squares += (part - 0.25).powi(2);
            sum += directions(normal, rays, seed).map(|(_, own)| own).sum::<DVec3>() / f64::from(rays);
        }
        // Random rays would be off by .027.
        assert!((squares / f64::from(seeds)).sqrt() < 0.01, "{squares}");
        let mean = sum / f64::from(seeds);
        assert!(mean.distance(normal * 2.0 / 3.0) < 1e-3, "{mean}");
    }

    /// Rays of neighbours differ: what one misses, another finds.
    #[test]
    fn seeds_give_directions_of_their_own() {
        let of = |seed| directions(DVec3::Z, 64, seed).map(|(_, own)| own).collect::<Vec<_>>();
        let all: Vec<Vec<DVec3>> = (0..200).map(of).collect();
        for (index, one) in all.iter().enumerate() {
            for other in &all[index + 1..] {
                let same = one.iter().zip(other).filter(|(a, b)| a.distance(**b) < 1e-4).count();
                assert!(same < 8, "{same} directions of two seeds are the same");
            }
        }
    }
}
