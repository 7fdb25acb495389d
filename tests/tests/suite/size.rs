//! How a bake grows with its scene, in counts: the same rooms, five and twenty of them.

use bake::{BakeReport, BakeSettings, RowStrategy, Unobserved, bake};
use tests::baking::imported;
use tests::building::building;
use tests::rooms_only::RoomsOnly;

/// Edge of the shooting patches, in metres.
const EDGE: f64 = 1.2;

/// Interpolation error that is asked for.
const ERROR: f64 = 0.05;

/// Rooms differ in size and furniture: so far may the mean of some be from that of others.
const ROOMS_DIFFER: f64 = 1.25;

/// The figures of a building's bake, and the bytes of all rows as they travel.
fn baked(rooms: usize, row_cache: usize) -> (BakeReport, u64) {
    let building = building(rooms);
    let scene = imported(&building.scene.glb());
    let settings = BakeSettings {
        rows: RowStrategy::Exact,
        shooter_edge: EDGE / building.extent,
        mesh_error: ERROR,
        row_cache,
        ..BakeSettings::default()
    };
    let mut service = RoomsOnly::new(&building, scene.frame);
    let baked = bake(&scene, &settings, &mut service, &mut Unobserved).unwrap();
    (baked.report, service.bytes)
}

#[test]
fn memory_rows_and_shots_grow_with_the_factors_that_are_not_0() {
    let ((few, few_sent), (many, many_sent)) = (baked(5, 2048), baked(20, 2048));
    // Within rooms everything sees everything, and vertices see more than a hemisphere: so do the points that measure them.
    for report in [&few, &many] {
        assert!(report.error.receivers <= ERROR, "{:?}", report.error);
    }
    let ratio = |few: u64, many: u64| many as f64 / few as f64;
    let shares = ratio(few.shooting_vertices as u64, many.shooting_vertices as u64);
    assert!((4.0 / ROOMS_DIFFER..=4.0 * ROOMS_DIFFER).contains(&shares), "{shares:.2}-fold shares");
    let factors = ratio(few.factors, many.factors);
    // However often either was refined.
    let [of_few, of_many] = [&few, &many].map(|report| report.factors as f64 / report.vertices as f64);
    let differ = of_many / of_few;
    assert!((1.0 / ROOMS_DIFFER..=ROOMS_DIFFER).contains(&differ), "{differ:.2}-fold factors of a vertex");
    let grows = |name: &str, few: u64, many: u64, than: f64| {
        let grown = ratio(few, many);
        assert!(grown <= ROOMS_DIFFER * than, "{name}: {few} to {many}, {grown:.2}-fold, not {than:.2}-fold");
    };
    grows("shots", few.shots, many.shots, shares);
    // Kept are the rows over the vertices, and their means over the shares.
    let kept = |report: &BakeReport| {
        report.factors as f64 * (1.0 + report.shooting_vertices as f64 / report.vertices as f64)
    };
    grows("bytes kept", few.row_bytes as u64, many.row_bytes as u64, kept(&many) / kept(&few));
    // A share has a row over each set of receivers: those of the first mesh, those of each round of refinement, and some points.
    let sets = |report: &BakeReport| f64::from(report.refinement_rounds + 2);
    let rows_per_share =
        |report: &BakeReport| report.rows as f64 / report.shooting_vertices as f64 / sets(report);
    let [of_few, of_many] = [&few, &many].map(rows_per_share);
    assert!(of_many <= ROOMS_DIFFER * of_few, "{of_many} rows for each share and set, not {of_few}");
    grows("bytes sent", few_sent, many_sent, factors);
    // Three quarters of the pairs of five rooms are in different rooms, and 19 of 20 of those of twenty: they weigh nothing.
    let bytes_per_factor = |report: &BakeReport, sent: u64| sent as f64 / report.factors as f64;
    assert!(bytes_per_factor(&few, few_sent) <= 6.0, "{}", bytes_per_factor(&few, few_sent));
    assert!(bytes_per_factor(&many, many_sent) <= 6.0, "{}", bytes_per_factor(&many, many_sent));
    assert!(many.row_bytes as f64 <= kept(&many) * 6.0, "{} for {}", many.row_bytes, kept(&many));
}

#[test]
fn a_cache_is_not_exceeded_and_half_of_the_rows_costs_two_passes_more() {
    let (whole, _) = baked(5, 2048);
    let mebibytes = (whole.row_bytes >> 20) / 2;
    let (half, _) = baked(5, mebibytes);
    assert!(half.row_bytes <= mebibytes << 20, "{} bytes kept", half.row_bytes);
    assert_eq!(half.error, whole.error);
    assert_eq!(half.rows, whole.rows);
    // A round of settling takes each missing row twice, the first solution once for each sweep of those that it misses, and
    // shooting some of them: far from once for each of the sweeps.
    let again = half.rows_again as f64 / whole.rows as f64;
    assert!(again > 0.0 && again < 4.0, "{again} times each row, {} sweeps", whole.sweeps);
}
