//! Light between gather points where receivers see an even sky.
//!
//! What a receiver sees of the sky is known, and the rest of its hemisphere is covered. The points that it takes its light from may
//! see more covered or less: at the upper edge of a gap, where half of the sky is seen, they may lie deep in the gap and see none. Their
//! light would then be that of half a hemisphere too much, and come back from wall to wall. So their light is taken for that of what is
//! covered, and the receiver gets the part of it that it sees.

/// Most that light grows so. Of points that see little but the sky it tells little how bright surfaces are.
const MOST: f64 = 2.0;

/// Part of a hemisphere that rays tell apart. Where little more is covered, light is left as it is: of both parts rays know next to nothing.
const TOLD_APART: f64 = 1.0 / 64.0;

/// Factor of the light that surfaces give a receiver, where it is interpolated between points, given the sky view factor of the receiver
/// and the one interpolated between the points.
pub fn factor_by_sky(own: f64, of_points: f64) -> f64 {
    // Planes between the points may go beyond them.
    let [own, of_points] = [own, of_points].map(|sky| (1.0 - sky).max(0.0) + TOLD_APART);
    (own / of_points).min(MOST)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn light_follows_what_is_covered() {
        let is_about = |[own, of_points]: [f64; 2], factor: f64| {
            let found = factor_by_sky(own, of_points);
            assert!(
                (found - factor).abs() <= 0.04,
                "{found} where {own} and {of_points} of the sky are seen"
            );
        };
        is_about([0.5, 0.0], 0.5);
        is_about([0.0, 0.25], 1.0 / 0.75);
        is_about([0.25, 0.25], 1.0);
        is_about([1.0, 0.5], 0.0);
        is_about([0.0, 0.9], MOST);
        is_about([1.0, 0.9999], 1.0);
        is_about([1.0, 1.1], 1.0);
    }
}
