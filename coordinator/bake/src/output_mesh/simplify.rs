//! Collapses and flips, in rounds.
//!
//! In a round each point that changed has its cheapest collapse found, all at once; then those are carried out whose triangles no
//! other one of the round has changed, the cheapest first.

use rayon::prelude::*;

use super::collapse::{Collapse, Moves};
use super::working::Working;

/// Rounds end when one removes no more than this part of the vertices: around a vertex of many long triangles only one goes at a
/// time, and each takes as long as thousands elsewhere.
const LEAST_PART: f64 = 1.0 / 4096.0;

/// Most passes of flips.
const MOST_FLIPS: usize = 4;

/// Fewest points that a thread takes.
const AT_ONCE: usize = 64;

/// Removes the vertices that light does not need.
pub fn simplify(working: &mut Working) {
    let count = working.points.len();
    let mut found: Vec<Option<Collapse>> = vec![None; count];
    let mut dirty: Vec<u32> = (0..count as u32).collect();
    let mut changed: Vec<u32> = vec![];
    loop {
        let best = |point: &u32| working.best_collapse(*point);
        let best: Vec<Option<Collapse>> = dirty.par_iter().with_min_len(AT_ONCE).map(best).collect();
        for (point, best) in dirty.iter().zip(best) {
            found[*point as usize] = best;
        }
        let removed;
        (removed, dirty) = round(working, &mut found);
        changed.extend(&dirty);
        if removed as f64 <= LEAST_PART * count as f64 {
            break;
        }
    }
    flip_around(working, changed);
}

/// Carries out collapses of points that are no neighbours, the cheapest first. Returns their number, and the points whose surroundings
/// changed.
fn round(working: &mut Working, found: &mut [Option<Collapse>]) -> (usize, Vec<u32>) {
    let mut order: Vec<(f64, u32, u32)> = (0..)
        .zip(found.iter())
        .filter_map(|(point, found)| found.map(|collapse| (collapse.cost, point, collapse.into)))
        .collect();
    order.par_sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let around = |(_, point, _): &(f64, u32, u32)| working.neighbours(*point);
    let around: Vec<_> = order.par_iter().with_min_len(AT_ONCE).map(around).collect();
    let mut is_gone = vec![false; found.len()];
    let mut chosen = vec![];
    let mut dirty = vec![];
    for ((_, point, into), around) in order.into_iter().zip(around) {
        // Of points that are no neighbours none has a triangle of the other.
        if around.iter().any(|other| is_gone[*other as usize]) {
            continue;
        }
        found[point as usize] = None;
        chosen.push((point, into));
        is_gone[point as usize] = true;
        dirty.extend(around);
    }
    let moves = |(point, into): &(u32, u32)| working.moves(*point, *into);
    let moves: Vec<Moves> = chosen.par_iter().with_min_len(AT_ONCE).map(moves).collect();
    let removed = chosen.len();
    for ((point, _), moves) in chosen.into_iter().zip(moves) {
        working.collapse(point, moves);
    }
    dirty.par_sort_unstable();
    dirty.dedup();
    (removed, dirty)
}

/// Flips edges around these points.
fn flip_around(working: &mut Working, mut points: Vec<u32>) {
    for _ in 0..MOST_FLIPS {
        points.par_sort_unstable();
        points.dedup();
        let changed = working.flip_edges(&working.inner_edges(&points));
        if changed.is_empty() {
            break;
        }
        points = changed;
    }
}
