use glam::DVec3;
use kernel::occluder::Occluder;
use scene::Facet;

use super::silhouettes::Silhouette;
use super::source::Source;
use super::{Contact, WELD};

/// Distance from a line at which light is looked for: well above the rounding of a file's coordinates, well below the distance of
/// receivers from their vertices.
pub const HAIR: f64 = 8.0 * WELD;

/// Shadows, and lights between shadows, that are narrower than this part of the scene's extent are none.
const NARROW: f64 = 2.5e-4;

/// Distance between the points of a line at which light is looked for, relative to the scene's extent.
const STEP: f64 = 5e-3;

/// Fewest and most of these points.
const POINTS: std::ops::RangeInclusive<usize> = 4..=32;

/// A part of a line, and which of its ends were searched for.
pub type Part = (Contact, [bool; 2]);

/// The view of a light from both sides of the shadow of an edge.
pub struct Sight<'a> {
    pub source: &'a Source,
    pub silhouette: &'a Silhouette,
    pub facet: &'a Facet,
    pub occluder: &'a Occluder,
    /// The scene's.
    pub extent: f64,
}

impl Sight<'_> {
    /// The parts of a line along which light is on the outer side and shadow on the inner one.
    pub fn lines(&self, [start, end]: Contact) -> Vec<Part> {
        let length = start.distance(end);
        let Some(out) = self.outward(end - start) else { return vec![] };
        let divides = |t: f64, distance: f64| {
            let point = start.lerp(end, t);
            !self.is_hidden(point + out * distance) && self.is_hidden(point - out * distance)
        };
        let count = ((length / (STEP * self.extent)) as usize).clamp(*POINTS.start(), *POINTS.end());
        // At a sharp corner, what is a hair beside one line may be beyond the other.
        let margin = (4.0 * HAIR / length).min(0.25);
        let place = |i: usize| margin + (1.0 - 2.0 * margin) * i as f64 / (count - 1) as f64;
        let states: Vec<bool> = (0..count).map(|i| divides(place(i), HAIR)).collect();
        let border = |inside: usize, outside: usize| {
            let (mut inside, mut outside) = (place(inside), place(outside));
            while (inside - outside).abs() * length > HAIR / 4.0 {
                let middle = (inside + outside) / 2.0;
                *if divides(middle, HAIR) { &mut inside } else { &mut outside } = middle;
            }
            inside
        };
        let mut parts = vec![];
        let mut next = 0;
        for run in states.chunk_by(|a, b| a == b) {
            let (first, last) = (next, next + run.len() - 1);
            next += run.len();
            if !run[0] {
                continue;
            }
            let searched = [first > 0, last < count - 1];
            let from = if searched[0] { border(first, first - 1) } else { 0.0 };
            let to = if searched[1] { border(last, last + 1) } else { 1.0 };
            let is_wide =
                [0.25, 0.5, 0.75].iter().any(|t| divides(from + (to - from) * t, NARROW * self.extent));
            if is_wide && (to - from) * length > 2.0 * HAIR {
                parts.push(([start.lerp(end, from), start.lerp(end, to)], searched));
            }
        }
        parts
    }

    /// Unit vector in the facet, across a line, to the side where the edge's own facets cast no shadow.
    fn outward(&self, along: DVec3) -> Option<DVec3> {
        let across = along.cross(self.facet.normal).try_normalize()?;
        Some(if across.dot(self.silhouette.outward) < 0.0 { -across } else { across })
    }

    fn is_hidden(&self, point: DVec3) -> bool {
        self.source.is_hidden(self.occluder, point, self.facet.plane)
    }
}
