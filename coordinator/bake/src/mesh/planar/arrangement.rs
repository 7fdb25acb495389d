use foldhash::{HashMap, HashMapExt};

use glam::{DVec2, DVec3};

use super::Axes;
use crate::mesh::WELD;
use crate::mesh::line::Contact;
use scene::Facet;

/// Most segments of a region that is cut along lines.
const MOST_SEGMENTS: usize = 16_384;

/// New points may come to lie on other segments, which are cut in the next pass.
const MOST_PASSES: usize = 4;

/// The borders of a region's facets and the lines on it, cut so that they only meet at their ends.
pub struct Arrangement {
    /// All points.
    pub points: Vec<DVec2>,
    /// Where the input has them, for corners of facets.
    pub positions: Vec<Option<DVec3>>,
    /// Pairs of points.
    pub segments: Vec<[u32; 2]>,
    /// Point by cell.
    cells: HashMap<[i64; 2], u32>,
}

impl Arrangement {
    /// Of the borders of all facets. `None` where there are too many segments.
    pub fn new(facets: &[(u32, &Facet)], lines: &[Contact], axes: &Axes) -> Option<Self> {
        let mut all = Self { points: vec![], positions: vec![], segments: vec![], cells: HashMap::new() };
        for (_, facet) in facets {
            let corners: Vec<u32> =
                facet.positions().map(|position| all.point(axes.flat(position), Some(position))).collect();
            for (from, to) in corners.iter().zip(corners.iter().cycle().skip(1)) {
                if from != to {
                    all.segments.push([*from.min(to), *from.max(to)]);
                }
            }
        }
        all.segments.sort_unstable();
        all.segments.dedup();
        for line in lines {
            let [from, to] = line.map(|end| all.on_border(axes.flat(end)));
            if from != to {
                all.segments.push([from.min(to), from.max(to)]);
            }
        }
        for _ in 0..MOST_PASSES {
            all.segments.sort_unstable();
            all.segments.dedup();
            if all.segments.len() > MOST_SEGMENTS {
                return None;
            }
            if !all.cut() {
                return Some(all);
            }
        }
        Some(all)
    }

    /// The point at a place, a new one if none is near.
    fn point(&mut self, place: DVec2, position: Option<DVec3>) -> u32 {
        if let Some(near) = self.near(place) {
            return near;
        }
        let id = self.points.len() as u32;
        self.points.push(place);
        self.positions.push(position);
        self.cells.insert(cell(place), id);
        id
    }

    fn near(&self, place: DVec2) -> Option<u32> {
        let [x, y] = cell(place);
        let around = (x - 1..=x + 1).flat_map(|x| (y - 1..=y + 1).map(move |y| [x, y]));
        let near = around.filter_map(|cell| self.cells.get(&cell).copied());
        let distance = |id: &u32| self.points[*id as usize].distance(place);
        near.filter(|id| distance(id) < WELD).min_by(|a, b| distance(a).total_cmp(&distance(b)))
    }

    /// The end of a line; one that lies on a border to within rounding is moved there, rather than the border to it.
    fn on_border(&mut self, place: DVec2) -> u32 {
        if let Some(near) = self.near(place) {
            return near;
        }
        let foot = self.segments.iter().find_map(|segment| {
            let [from, to] = self.ends(*segment);
            let t = place_along(from, to, place)?;
            let foot = from.lerp(to, t);
            (foot.distance(place) < WELD).then_some(foot)
        });
        self.point(foot.unwrap_or(place), None)
    }

    fn ends(&self, segment: [u32; 2]) -> [DVec2; 2] {
        segment.map(|point| self.points[point as usize])
    }

    /// Cuts segments where others meet or cross them; tells whether there were such.
    fn cut(&mut self) -> bool {
        let segments = std::mem::take(&mut self.segments);
        let mut cuts: Vec<Vec<(f64, u32)>> = vec![vec![]; segments.len()];
        let span = |this: &Self, segment: [u32; 2], axis: usize| {
            let [a, b] = this.ends(segment).map(|end| end[axis]);
            (a.min(b) - WELD, a.max(b) + WELD)
        };
        let mut order: Vec<usize> = (0..segments.len()).collect();
        order.sort_by(|a, b| {
            span(self, segments[*a], 0).0.total_cmp(&span(self, segments[*b], 0).0).then(a.cmp(b))
        });
        let mut active: Vec<usize> = vec![];
        for this in order {
            let (start, _) = span(self, segments[this], 0);
            let (low, high) = span(self, segments[this], 1);
            active.retain(|other| span(self, segments[*other], 0).1 >= start);
            for &other in &active {
                let (other_low, other_high) = span(self, segments[other], 1);
                if other_low <= high && low <= other_high {
                    self.meet(&segments, this, other, &mut cuts);
                }
            }
            active.push(this);
        }
        let is_cut = cuts.iter().any(|cuts| !cuts.is_empty());
        for (segment, mut cuts) in segments.into_iter().zip(cuts) {
            cuts.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            let mut from = segment[0];
            for to in cuts.into_iter().map(|cut| cut.1).chain([segment[1]]) {
                if from != to {
                    self.segments.push([from.min(to), from.max(to)]);
                }
                from = to;
            }
        }
        is_cut
    }

    fn meet(&mut self, segments: &[[u32; 2]], this: usize, other: usize, cuts: &mut [Vec<(f64, u32)>]) {
        let mut touches = false;
        for (cut, by) in [(this, other), (other, this)] {
            let [from, to] = self.ends(segments[cut]);
            for point in segments[by] {
                if segments[cut].contains(&point) {
                    touches = true;
                    continue;
                }
                let place = self.points[point as usize];
                let Some(t) = place_along(from, to, place) else { continue };
                if from.lerp(to, t).distance(place) < WELD {
                    cuts[cut].push((t, point));
                    touches = true;
                }
            }
        }
        if touches {
            return;
        }
        let ([a, b], [c, d]) = (self.ends(segments[this]), self.ends(segments[other]));
        let side = |from: DVec2, to: DVec2, point: DVec2| (to - from).perp_dot(point - from);
        let (left, right) = (side(c, d, a), side(c, d, b));
        if left * right < 0.0 && side(a, b, c) * side(a, b, d) < 0.0 {
            let t = left / (left - right);
            let place = a.lerp(b, t);
            let point = self.point(place, None);
            cuts[this].push((t, point));
            cuts[other].push((place_along(c, d, place).unwrap_or(0.5), point));
        }
    }
}

/// Where the foot of a point lies between two others, from 0 to 1; `None` where it lies at an end or beyond.
fn place_along(from: DVec2, to: DVec2, point: DVec2) -> Option<f64> {
    let way = to - from;
    let length = way.length();
    let along = way.dot(point - from) / length;
    (along > WELD && along < length - WELD).then(|| along / length)
}

fn cell(place: DVec2) -> [i64; 2] {
    (place / WELD).round().as_i64vec2().to_array()
}
