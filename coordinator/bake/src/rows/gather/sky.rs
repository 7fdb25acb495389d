//! Light between gather points where receivers see an even sky.
//!
//! What a receiver sees of the sky is known, and the rest of its hemisphere is covered. The points that it takes its light from may
//! see more covered or less: at the upper edge of a gap, where half of the sky is seen, they may lie deep in the gap and see none. Their
//! light would then be that of half a hemisphere too much, and come back from wall to wall. So their light is taken for that of what is
//! covered, and the receiver gets the part of it that it sees.

/// Most that light grows so. Of points that see little but the sky it tells little how bright surfaces are.
const MOST: f64 = 2.0;

/// Where the points see less covered than this, their light is left as it is.
const LEAST_COVERED: f64 = 1e-3;

/// Factor of the light that surfaces give a receiver, where it is interpolated between points, given the sky view factor of the receiver
/// and the one interpolated between the points.
pub fn factor_by_sky(own: f64, of_points: f64) -> f64 {
    let [own, of_points] = [own, of_points].map(|sky| 1.0 - sky);
    if of_points > LEAST_COVERED { (own / of_points).clamp(0.0, MOST) } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn light_follows_what_is_covered() {
        assert_eq!(factor_by_sky(0.5, 0.0), 0.5);
        assert_eq!(factor_by_sky(0.0, 0.25), 1.0 / 0.75);
        assert_eq!(factor_by_sky(0.25, 0.25), 1.0);
        assert_eq!(factor_by_sky(1.0, 0.5), 0.0);
        assert_eq!(factor_by_sky(0.0, 0.9), MOST);
        // Planes that go beyond their points.
        assert_eq!(factor_by_sky(0.9, 1.1), 1.0);
    }
}
