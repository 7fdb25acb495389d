use std::collections::BTreeMap;

use glam::DVec3;
use scene::Scene;

use super::visibility::HAIR;
use super::{Contact, Line, WELD, facet_at};
use crate::mesh::line::nearest;

/// Sine of the least angle at which lines meet.
const LEAST_SINE: f64 = 0.02;

/// Moves the ends that were searched for to the lines on their facet that they were found at: lines, or `stops`, where shadows end
/// because something stands there. Leaves out lines that lie on longer ones.
pub fn joined(lines: Vec<Line>, stops: &[((usize, usize), Contact)], scene: &Scene) -> Vec<Line> {
    let mut by_facet: BTreeMap<(usize, usize), (Vec<Line>, Vec<Contact>)> = BTreeMap::new();
    for line in lines {
        by_facet.entry(line.facet).or_default().0.push(line);
    }
    for (place, ends) in stops {
        if let Some((_, stops)) = by_facet.get_mut(place) {
            stops.push(*ends);
        }
    }
    let mut all = vec![];
    for (place, (lines, stops)) in by_facet {
        let normal = facet_at(scene, place).normal;
        let others: Vec<Contact> = lines.iter().map(|line| line.ends).chain(stops.iter().copied()).collect();
        let moved = lines.iter().enumerate().map(|(index, line)| {
            let ends = [0, 1].map(|end| {
                let others =
                    others.iter().enumerate().filter(|(other, _)| *other != index).map(|(_, ends)| ends);
                if line.searched[end] { met(line.ends, end, others, normal) } else { line.ends[end] }
            });
            Line { ends, ..line.clone() }
        });
        let mut moved: Vec<Line> = moved.filter(|line| length(line) > HAIR).collect();
        moved.sort_by(|a, b| length(b).total_cmp(&length(a)));
        let mut kept: Vec<Line> = vec![];
        for line in moved {
            let lies_on = |other: &Line| {
                line.ends
                    .iter()
                    .all(|end| nearest(other.ends, *end).distance_squared(*end) < 4.0 * WELD * WELD)
            };
            if !kept.iter().any(lies_on) {
                kept.push(line);
            }
        }
        all.extend(kept);
    }
    all
}

pub fn length(line: &Line) -> f64 {
    line.ends[0].distance(line.ends[1])
}

/// The point where a line meets another one near one of its ends, or the end.
fn met<'a>(line: Contact, end: usize, others: impl Iterator<Item = &'a Contact>, normal: DVec3) -> DVec3 {
    let from = line[end];
    let along = (line[1] - line[0]).normalize_or_zero();
    let crossing = |other: &Contact| {
        let across = (other[1] - other[0]).cross(normal).normalize_or_zero();
        let sine = along.dot(across);
        let distance = (other[0] - from).dot(across) / sine;
        let point = from + along * distance;
        // The light was looked for a hair beside the line.
        let meets = sine.abs() > LEAST_SINE
            && distance.abs() <= 2.0 * HAIR / sine.abs()
            && nearest(*other, point).distance(point) <= 4.0 * HAIR;
        meets.then_some((distance.abs(), point))
    };
    let nearest = others.filter_map(crossing).reduce(|a, b| if b.0 < a.0 { b } else { a });
    nearest.map_or(from, |(_, point)| point)
}
