//! Scenes whose factors are known to many digits.

use tests::cases::case;
use tests::shapes;
use view_factors::ViewFactorSettings;

use super::{computed, factor, scene_of, sums};

/// Rounding of the file is none: all coordinates are dyadic.
const ROUNDING: f64 = 1e-13;

#[test]
fn closed_cube_has_the_known_factors() {
    let factors = computed(&scene_of(&shapes::unit_room()), ViewFactorSettings::default());
    let [opposite, adjacent] = case("D00").values()[..] else { panic!("two values") };
    for from in 0..6 {
        for to in 0..6 {
            let expected = match () {
                () if from == to => 0.0,
                () if from / 2 == to / 2 => opposite,
                () => adjacent,
            };
            let (found, error) = factor(&factors, from, to);
            assert!((found - expected).abs() <= ROUNDING, "{from} to {to}: {found} {expected}");
            assert_eq!(error, 0.0);
        }
    }
    assert!(sums(&factors).iter().all(|sum| (sum - 1.0).abs() < 1e-12), "{:?}", sums(&factors));
    assert_eq!((factors.closed_rows, factors.counts.estimated, factors.counts.exact), (6, 0, 15));
    for row in &factors.rows {
        assert_eq!((row.area, row.open), (1.0, 0.0));
        assert!(row.correction.abs() < 1e-12);
    }
}

/// Parallel and perpendicular rectangles, from nearly touching to a thousand edges apart: exact, or by a rule good to 1e-7.
#[test]
fn rectangles_have_the_known_factors() {
    for id in ["C01", "C02", "C03", "C05", "C06", "C08", "C10", "C12"] {
        let case = case(id);
        let pair = [case.polygon("polygon1"), case.polygon("polygon2")];
        let factors = computed(&scene_of(&pair), ViewFactorSettings::default());
        let expected = case.values()[0];
        let (found, error) = factor(&factors, 0, 1);
        // Coordinates that are no f32 are rounded: areas by twice that.
        let is_dyadic = pair.iter().flatten().all(|corner| corner.as_vec3().as_dvec3() == *corner);
        let rounding = if is_dyadic { ROUNDING } else { 1e-6 };
        assert!((found - expected).abs() <= rounding * expected + error, "{id}: {found} {expected} {error}");
        assert!(error <= 1e-7 * found, "{id}");
        assert!((factors.rows[0].open + found - 1.0).abs() < 1e-14, "{id}");
        assert_eq!(factors.closed_rows, 0, "{id}");
    }
}

/// Two squares with a smaller one between: within the standard error, which falls with the number of points, and seen from the
/// blocker's two neighbours as it should be.
#[test]
fn blocked_squares_have_the_known_factor() {
    let case = case("C30");
    let expected = case.values()[0];
    let polygons = [case.polygon("polygon1"), case.polygon("polygon2"), case.polygon("blocker")];
    let mut last = f64::INFINITY;
    for points in [256, 4096, 65536] {
        let settings = ViewFactorSettings { points, ..ViewFactorSettings::default() };
        let factors = computed(&scene_of(&polygons), settings);
        let (found, error) = factor(&factors, 0, 1);
        assert!((found - expected).abs() <= 3.0 * error, "{points}: {found} {expected} {error}");
        // At least as the square root of the number of points.
        assert!(error <= 0.25 * last, "{points}: {error} {last}");
        assert_eq!((factors.counts.estimated, factors.counts.exact), (1, 1));
        last = error;
    }
    assert!(last < 1e-5, "{last}");
}
