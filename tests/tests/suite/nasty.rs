//! Scenes that ask for trouble, made from fixed seeds. `just nasty` goes on with others, and looks at the clock too.

use std::time::Duration;

use tests::nasty::{End, Family, bake, broken, nasty};
use tests::numbers::Numbers;

/// Far above what any of these bakes takes: only what hangs ends here.
const HANGS: Duration = Duration::from_secs(300);

/// Triangles of each scene, at most, beside the room's.
const TRIANGLES: usize = 48;

/// Bakes scenes of a family, of which each must end as it should.
fn holds(family: Family, seeds: &[u64]) {
    for &seed in seeds {
        let scene = nasty(family, seed, TRIANGLES);
        let baked = bake(&scene, None, HANGS);
        let broken = broken(&scene, &baked);
        let name = family.name();
        assert!(broken.is_empty(), "{name} {seed}: {}\n{}", broken.join("; "), baked.said);
        assert!(scene.is_damaged || baked.end == End::Code(0), "{name} {seed}: {}", baked.said);
    }
}

#[test]
fn layers_and_coplanar_triangles() {
    holds(Family::Layers, &[1, 2, 3, 6]);
    holds(Family::Coplanar, &[1, 2, 3]);
}

#[test]
fn slivers_fans_and_needles() {
    holds(Family::Slivers, &[1, 2, 3]);
    holds(Family::Fans, &[1, 2, 3]);
    holds(Family::Needles, &[1, 2, 3]);
}

#[test]
fn shells_and_sizes_far_apart() {
    holds(Family::Shells, &[2, 4]);
    holds(Family::Sizes, &[1, 2, 3, 4]);
}

#[test]
fn soup_and_crumbs() {
    holds(Family::Soup, &[1, 3, 5]);
    holds(Family::Crumbs, &[1, 2]);
}

#[test]
fn chains_and_instances() {
    holds(Family::Chains, &[1, 2, 3]);
    holds(Family::Instances, &[1, 2, 3]);
}

#[test]
fn bad_numbers() {
    holds(Family::Numbers, &(1..=12).collect::<Vec<_>>());
}

/// Whenever a bake is told to stop, it ends by that signal, and what it leaves is whole or nothing.
#[test]
fn bakes_that_are_stopped() {
    for seed in 1..=6 {
        let scene = nasty(Family::Soup, seed, TRIANGLES);
        let mut numbers = Numbers::new(seed);
        // It may end before: then it is a bake like any other.
        let stopped = bake(&scene, Some(Duration::from_secs_f64(numbers.magnitude(0.001, 0.5))), HANGS);
        let broken = broken(&scene, &stopped);
        assert!(broken.is_empty(), "seed {seed}: {}\n{}", broken.join("; "), stopped.said);
    }
}
