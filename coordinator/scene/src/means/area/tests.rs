//! Means over polygons against sums over clipped texels.

use rand::rngs::SmallRng;
use rand::{Rng, SeedableRng};

use super::*;

const WRAPS: [Wrap; 3] = [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp];

fn random_grid(random: &mut SmallRng, size: [u32; 2]) -> Grid {
    let value = |_| DVec4::from_array(std::array::from_fn(|_| random.random_range(0.0..1.0)));
    Grid { size, values: (0..size[0] * size[1]).map(value).collect() }
}

/// White where column and row are both even or both odd.
fn checkerboard(size: [u32; 2]) -> AreaMeans<Grid> {
    let value = |index: u32| DVec4::splat(f64::from((index % size[0] + index / size[0]) % 2));
    AreaMeans::new(Grid { size, values: (0..size[0] * size[1]).map(value).collect() })
}

/// A random convex polygon of 3 to 7 corners around a centre, turning either way.
fn random_polygon(random: &mut SmallRng, centre: DVec2, radius: f64) -> Vec<DVec2> {
    let count = random.random_range(3..8);
    let mut angles: Vec<f64> = (0..count).map(|_| random.random_range(0.0..std::f64::consts::TAU)).collect();
    angles.sort_by(f64::total_cmp);
    if random.random() {
        angles.reverse();
    }
    let stretch = DVec2::new(random.random_range(0.1..1.0), random.random_range(0.1..1.0));
    let turn = DVec2::from_angle(random.random_range(0.0..std::f64::consts::TAU));
    angles
        .into_iter()
        .map(|angle| centre + turn.rotate(DVec2::from_angle(angle) * stretch) * radius)
        .collect()
}

/// The part of a polygon on one side of a line: of the points with `distance` of 0 and more.
fn clipped(polygon: &[DVec2], distance: impl Fn(DVec2) -> f64) -> Vec<DVec2> {
    let mut part = vec![];
    for (i, &from) in polygon.iter().enumerate() {
        let to = polygon[(i + 1) % polygon.len()];
        let (d, e) = (distance(from), distance(to));
        if d >= 0.0 {
            part.push(from);
        }
        if d * e < 0.0 {
            part.push(from.lerp(to, d / (d - e)));
        }
    }
    part
}

/// The mean by clipping the polygon at every cell, and a rule that is exact for bilinear values in each triangle.
fn by_clipping(grid: &Grid, polygon: &[DVec2], sampler: &Sampler) -> DVec4 {
    let size = DVec2::new(f64::from(grid.size[0]), f64::from(grid.size[1]));
    let shift = if sampler.filter == Filter::Linear { 0.5 } else { 0.0 };
    let places: Vec<DVec2> = polygon.iter().map(|uv| *uv * size - shift).collect();
    let low = places.iter().copied().reduce(DVec2::min).unwrap().floor().as_i64vec2();
    let high = places.iter().copied().reduce(DVec2::max).unwrap().floor().as_i64vec2();
    let texel = |x: i64, y: i64| {
        grid.texel(sampler.wrap_u.texel(x, grid.size[0]), sampler.wrap_v.texel(y, grid.size[1]))
    };
    let (mut integral, mut all) = (DVec4::ZERO, 0.0);
    for (x, y) in (low.y..=high.y).flat_map(|y| (low.x..=high.x).map(move |x| (x, y))) {
        let corner = DVec2::new(x as f64, y as f64);
        let mut part = clipped(&places, |p| p.x - corner.x);
        part = clipped(&part, |p| corner.x + 1.0 - p.x);
        part = clipped(&part, |p| p.y - corner.y);
        part = clipped(&part, |p| corner.y + 1.0 - p.y);
        let value = |p: DVec2| match sampler.filter {
            Filter::Nearest => texel(x, y),
            Filter::Linear => {
                let q = p - corner;
                texel(x, y)
                    .lerp(texel(x + 1, y), q.x)
                    .lerp(texel(x, y + 1).lerp(texel(x + 1, y + 1), q.x), q.y)
            }
        };
        for i in 2..part.len() {
            let [a, b, c] = [part[0], part[i - 1], part[i]];
            let area = (b - a).perp_dot(c - a).abs() / 2.0;
            integral += (value((a + b) / 2.0) + value((b + c) / 2.0) + value((c + a) / 2.0)) * (area / 3.0);
            all += area;
        }
    }
    integral / all
}

#[test]
fn means_are_those_of_clipped_texels() {
    let mut random = SmallRng::seed_from_u64(1);
    for case in 0..600 {
        let size = [random.random_range(1..40), random.random_range(1..40)];
        let means = AreaMeans::new(random_grid(&mut random, size));
        // From a hundredth of a texel to some repeats of the image.
        let radius = 10.0_f64.powf(random.random_range(-3.5..0.5));
        let centre = DVec2::new(random.random_range(-2.0..3.0), random.random_range(-2.0..3.0));
        let polygon = random_polygon(&mut random, centre, radius);
        let sampler = Sampler {
            wrap_u: WRAPS[case % 3],
            wrap_v: WRAPS[case / 3 % 3],
            filter: if case % 2 == 0 { Filter::Nearest } else { Filter::Linear },
        };
        let Some(found) = means.over(&polygon, &sampler) else { continue };
        let expected = by_clipping(means.raster(), &polygon, &sampler);
        let extent = polygon.iter().map(|p| p.distance(centre)).fold(0.0, f64::max);
        let tolerance = 1e-9 / extent.min(1.0).powi(2) * 1e-3 + 1e-9;
        assert!(
            (found - expected).abs().max_element() < tolerance,
            "case {case}, {sampler:?}, radius {radius}: {found} is not {expected}"
        );
    }
}

#[test]
fn whole_images_have_the_mean_of_their_texels() {
    let mut random = SmallRng::seed_from_u64(2);
    for size in [[1, 1], [3, 2], [16, 16], [17, 5], [64, 33], [300, 200]] {
        let grid = random_grid(&mut random, size);
        let mean = grid.values.iter().sum::<DVec4>() / grid.values.len() as f64;
        let means = AreaMeans::new(grid);
        for filter in [Filter::Nearest, Filter::Linear] {
            let sampler = Sampler { filter, ..Sampler::default() };
            // Wherever it begins, and after many repeats: also where coarser images take its place.
            for (at, times) in [(0.0, 1.0), (0.37, 1.0), (-5.25, 3.0), (0.0, 1000.0), (7.0, 1e6)] {
                let corners = [DVec2::ZERO, DVec2::X, DVec2::ONE, DVec2::Y];
                let polygon = corners.map(|corner| corner * times + at);
                let found = means.over(&polygon, &sampler).unwrap();
                let worst = (found - mean).abs().max_element();
                assert!(worst < 1e-9, "{size:?} {filter:?} {times} times from {at}: off by {worst}");
            }
        }
    }
}

#[test]
fn small_polygons_have_the_value_at_their_place() {
    let mut random = SmallRng::seed_from_u64(3);
    let means = AreaMeans::new(random_grid(&mut random, [32, 32]));
    for filter in [Filter::Nearest, Filter::Linear] {
        let sampler = Sampler { filter, ..Sampler::default() };
        for _ in 0..200 {
            let centre = DVec2::new(random.random_range(-1.0..2.0), random.random_range(-1.0..2.0));
            // A nearest texel has edges that the polygon must not reach over.
            let centre =
                if filter == Filter::Nearest { ((centre * 32.0).floor() + 0.5) / 32.0 } else { centre };
            let square = [DVec2::ZERO, DVec2::X, DVec2::ONE, DVec2::Y].map(|c| centre + (c - 0.5) * 1e-5);
            let (found, expected) = (means.over(&square, &sampler).unwrap(), means.at(centre, &sampler));
            assert!((found - expected).abs().max_element() < 1e-3, "{filter:?}: {found} is not {expected}");
        }
    }
}

#[test]
fn checkerboards_are_grey_from_afar_and_their_squares_black_or_white() {
    let board = checkerboard([8, 8]);
    let sampler = Sampler { filter: Filter::Nearest, ..Sampler::default() };
    let square = |low: f64, size: f64| {
        [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
            .map(|(x, y)| DVec2::new(low + x * size, low + y * size))
    };
    assert_eq!(board.over(&square(0.0, 0.125), &sampler), Some(DVec4::ZERO));
    let shifted = square(0.0, 0.125).map(|corner| corner + DVec2::X * 0.125);
    assert_eq!(board.over(&shifted, &sampler), Some(DVec4::ONE));
    for size in [0.25, 1.0, 5.0, 400.0, 30_000.0] {
        let found = board.over(&square(0.0, size), &sampler).unwrap();
        assert!((found - 0.5).abs().max_element() < 1e-9, "{size}: {found}");
    }
    // Of a polygon that is not aligned the squares along the outline count, the less the larger it is.
    let mut random = SmallRng::seed_from_u64(4);
    for radius in [1.0, 10.0, 100.0, 1000.0, 1e5] {
        for _ in 0..20 {
            let polygon = random_polygon(&mut random, DVec2::new(0.3, 0.7), radius);
            let Some(found) = board.over(&polygon, &sampler) else { continue };
            let area: f64 = (2..polygon.len())
                .map(|i| (polygon[i - 1] - polygon[0]).perp_dot(polygon[i] - polygon[0]) / 2.0)
                .sum();
            let outline: f64 =
                (0..polygon.len()).map(|i| polygon[i].distance(polygon[(i + 1) % polygon.len()])).sum();
            let bound = (outline / 8.0 / area.abs()).min(0.5) + 1e-9;
            assert!((found.x - 0.5).abs() <= bound, "{radius}: {found} with a bound of {bound}");
        }
    }
}

#[test]
fn coarser_images_are_off_by_what_the_outline_passes() {
    let mut random = SmallRng::seed_from_u64(5);
    let means = AreaMeans::new(random_grid(&mut random, [64, 64]));
    let sampler = Sampler::default();
    for _ in 0..10 {
        // Some 20,000 texels along the outline: beyond what is walked, still cheap enough to walk it here.
        let polygon = random_polygon(&mut random, DVec2::new(0.2, 0.1), 90.0);
        let walked = |uv: &DVec2| *uv * 64.0 - 0.5;
        let places: Vec<DVec2> = polygon.iter().map(walked).collect();
        let area: f64 = (2..places.len())
            .map(|i| (places[i - 1] - places[0]).perp_dot(places[i] - places[0]) / 2.0)
            .sum();
        if area.abs() < 1e6 {
            continue;
        }
        let walk = Walk { means: &means, sampler: &sampler, origin: -10_000 };
        let integral: DVec4 =
            (0..places.len()).map(|i| walk.along(places[i], places[(i + 1) % places.len()])).sum();
        let found = means.over(&polygon, &sampler).unwrap();
        assert!((found - integral / area).abs().max_element() < 1e-4, "{found} is not {}", integral / area);
    }
}

#[test]
fn polygons_without_area_have_no_mean() {
    let board = checkerboard([4, 4]);
    let sampler = Sampler::default();
    let line = [DVec2::ZERO, DVec2::ONE, DVec2::new(0.3, 0.3)];
    assert_eq!(board.over(&line, &sampler), None);
    assert_eq!(board.over(&[DVec2::ONE; 3], &sampler), None);
    assert_eq!(board.over(&[], &sampler), None);
    for wild in [f64::NAN, f64::INFINITY, 1e300] {
        assert_eq!(board.over(&[DVec2::ZERO, DVec2::X * wild, DVec2::Y], &sampler), None);
    }
}

#[test]
fn images_of_one_colour_say_so() {
    let grid = |values: Vec<DVec4>| Grid { size: [2, 2], values };
    let mut values = vec![DVec4::splat(0.25); 4];
    assert_eq!(AreaMeans::new(grid(values.clone())).constant(), Some(DVec4::splat(0.25)));
    values[3].w = 0.5;
    assert_eq!(AreaMeans::new(grid(values)).constant(), None);
}

/// Counts how often its texels are asked for.
struct Counting(Grid, std::sync::atomic::AtomicUsize);

impl Raster for Counting {
    fn size(&self) -> [u32; 2] {
        self.0.size()
    }

    fn texel(&self, column: u32, row: u32) -> DVec4 {
        self.1.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
        self.0.texel(column, row)
    }
}

/// An image repeated a million times costs no more than one repeated a thousand times, and has the mean of the whole.
#[test]
fn huge_coordinates_cost_nothing() {
    let grid = random_grid(&mut SmallRng::seed_from_u64(7), [64, 32]);
    let mean = grid.values.iter().sum::<DVec4>() / grid.values.len() as f64;
    let means = AreaMeans::new(Counting(grid, Default::default()));
    for filter in [Filter::Nearest, Filter::Linear] {
        for wrap in [Wrap::Repeat, Wrap::Mirror] {
            let sampler = Sampler { wrap_u: wrap, wrap_v: wrap, filter };
            for scale in [1e3, 1e6, 1e8] {
                let polygon = [DVec2::ZERO, DVec2::new(scale, 0.25 * scale), DVec2::new(0.5 * scale, scale)];
                means.raster().1.store(0, std::sync::atomic::Ordering::Relaxed);
                let over = means.over(&polygon, &sampler).unwrap();
                assert!((over - mean).abs().max_element() < 0.01, "{scale} {over} {mean}");
                let asked = means.raster().1.load(std::sync::atomic::Ordering::Relaxed);
                assert!(asked < 1 << 20, "{asked} texels at {scale}");
            }
        }
    }
}
