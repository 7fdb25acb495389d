//! Vertices at one position, and splits at T-junctions.
//!
//! An edge is *open* where not exactly two triangles of its surface share it by its vertices: at creases, contacts, borders between
//! materials and sides. Where another vertex lies inside it a rasterizer shows dots, so the triangle is split there.

use foldhash::{HashMap, HashMapExt};
use glam::{DVec3, I64Vec3};
use kernel::geometry::Bounds;
use rayon::prelude::*;
use smallvec::SmallVec;

use super::working::{Corner, NONE, Triangle, Working};

/// Vertices closer than this, relative to the extent, are at one position: two roundings of f32 coordinates.
pub const ONE_POINT: f64 = 2.5e-7;

/// A vertex this close to an edge, relative to the extent, lies on it.
pub const ON_EDGE: f64 = 2.2e-6;

/// Height of a triangle that is a line, relative to its longest edge.
const FLAT: f64 = 1e-3;

/// Makes the triangles conforming, and finds which corners are collapsed together.
pub fn conform(working: &mut Working) {
    let places = Places::new(working);
    let open = open_edges(working);
    let mut is_tied = vec![false; places.first.len()];
    for (a, b, _) in &open {
        for corner in [*a, *b] {
            is_tied[places.of_corner[corner as usize] as usize] = true;
        }
    }
    let grid = Grid::new(&places.position, ONE_POINT.max(ON_EDGE) * working.extent);
    let mut inside: HashMap<(u32, u32), Vec<(u32, f64)>> = HashMap::new();
    let margin = 2.0 * ONE_POINT * working.extent;
    let find = |(a, b, _): &(u32, u32, u32)| {
        let ends = [*a, *b].map(|corner| places.position[places.of_corner[corner as usize] as usize]);
        ((*a, *b), grid.inside(&places.position, ends, margin))
    };
    let found: Vec<_> =
        open.par_iter().with_min_len(256).map(find).filter(|(_, found)| !found.is_empty()).collect();
    for (edge, found) in found {
        found.iter().for_each(|(place, _)| is_tied[*place as usize] = true);
        inside.insert(edge, found);
    }
    move_to_places(working, &places, &is_tied);
    split(working, &places, &inside);
    let mut points: Vec<SmallVec<[u32; 2]>> = vec![SmallVec::new(); places.first.len()];
    for index in 0..working.corners.len() as u32 {
        let place = working.corners[index as usize].point;
        if working.corners[index as usize].around.is_empty() {
            continue;
        }
        if place != NONE && is_tied[place as usize] {
            points[place as usize].push(index);
        } else {
            working.corners[index as usize].point = points.len() as u32;
            points.push(SmallVec::from_slice(&[index]));
        }
    }
    working.points = points;
}

/// Open edges, the lesser corner first, and their only triangle or the first of several.
fn open_edges(working: &Working) -> Vec<(u32, u32, u32)> {
    let mut edges: Vec<(u32, u32, u32)> = working
        .alive()
        .flat_map(|(index, Triangle { corners: [a, b, c], .. })| {
            [(*a, *b), (*b, *c), (*c, *a)].map(|(a, b)| (a.min(b), a.max(b), index))
        })
        .collect();
    edges.par_sort_unstable();
    let of_edge = edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1));
    of_edge.filter(|triangles| triangles.len() != 2).map(|triangles| triangles[0]).collect()
}

/// Positions at which corners lie.
struct Places {
    of_corner: Vec<u32>,
    /// The corner that gives each its position.
    first: Vec<u32>,
    position: Vec<DVec3>,
}

impl Places {
    fn new(working: &Working) -> Self {
        let tolerance = ONE_POINT * working.extent;
        let cell = |position: DVec3| (position / (2.0 * tolerance)).floor().as_i64vec3();
        let mut places =
            Self { of_corner: vec![NONE; working.corners.len()], first: vec![], position: vec![] };
        let mut by_cell: HashMap<I64Vec3, SmallVec<[u32; 1]>> = HashMap::new();
        let mut order: Vec<u32> = (0..working.corners.len() as u32).collect();
        // The input's corners do not move.
        order.sort_by_key(|corner| !working.corners[*corner as usize].fixed);
        for index in order {
            let position = working.at(index);
            let (low, high) = (cell(position - tolerance), cell(position + tolerance));
            let mut nearest: Option<(f64, u32)> = None;
            for x in low.x..=high.x {
                for y in low.y..=high.y {
                    for z in low.z..=high.z {
                        for place in by_cell.get(&I64Vec3::new(x, y, z)).into_iter().flatten() {
                            let distance = position.distance(places.position[*place as usize]);
                            if distance <= tolerance && nearest.is_none_or(|known| (distance, *place) < known)
                            {
                                nearest = Some((distance, *place));
                            }
                        }
                    }
                }
            }
            places.of_corner[index as usize] = nearest.map_or_else(
                || {
                    let place = places.position.len() as u32;
                    places.first.push(index);
                    places.position.push(position);
                    by_cell.entry(cell(position)).or_default().push(place);
                    place
                },
                |(_, place)| place,
            );
        }
        places
    }
}

/// Moves corners where triangles of several surfaces meet to one position.
fn move_to_places(working: &mut Working, places: &Places, is_tied: &[bool]) {
    for (corner, place) in working.corners.iter_mut().zip(&places.of_corner) {
        corner.point = *place;
        if is_tied[*place as usize] && !corner.fixed {
            corner.position = places.position[*place as usize];
        }
    }
}

/// Splits the triangles along open edges that have places inside.
fn split(working: &mut Working, places: &Places, inside: &HashMap<(u32, u32), Vec<(u32, f64)>>) {
    let mut added: HashMap<(u32, u32, u32), u32> = HashMap::new();
    for index in 0..working.triangles.len() {
        let Triangle { corners, surface, facet, region, .. } = working.triangles[index].clone();
        let edges = [(0, 1), (1, 2), (2, 0)].map(|(a, b)| (corners[a], corners[b]));
        let own = corners.map(|corner| places.of_corner[corner as usize]);
        let on = |(a, b): (u32, u32)| inside.get(&(a.min(b), a.max(b))).into_iter().flatten();
        let has_own = edges.into_iter().flat_map(on).any(|(place, _)| own.contains(place));
        if has_own && is_line(own.map(|place| places.position[place as usize])) {
            for corner in corners {
                working.corners[corner as usize].around.retain(|around| *around != index as u32);
            }
            working.triangles[index].corners = [NONE; 3];
            continue;
        }
        let outline = edges.map(|(a, b)| {
            let edge = (a.min(b), a.max(b));
            let mut line: SmallVec<[u32; 4]> = SmallVec::from_slice(&[a]);
            let found = inside.get(&edge).map_or(&[][..], Vec::as_slice);
            let between = found.iter().filter(|(place, _)| !own.contains(place)).map(|(place, part)| {
                *added.entry((edge.0, edge.1, *place)).or_insert_with(|| {
                    working.add_between(edge, *place, places.position[*place as usize], *part)
                })
            });
            line.extend(between);
            if a > b {
                line[1..].reverse();
            }
            line.push(b);
            line
        });
        if outline.iter().all(|line| line.len() == 2) {
            continue;
        }
        for corner in corners {
            working.corners[corner as usize].around.retain(|around| *around != index as u32);
        }
        let parts = fan(outline.each_ref().map(SmallVec::as_slice));
        let mut parts =
            parts.into_iter().map(|corners| Triangle { corners, surface, facet, region, samples: vec![] });
        if let Some(own) = parts.next() {
            for corner in own.corners {
                working.corners[corner as usize].around.push(index as u32);
            }
            working.triangles[index] = own;
        }
        parts.for_each(|part| working.add(part));
    }
}

/// Whether a triangle with a corner on its opposite edge is no more than that edge. Without it nothing is missing: what lies beyond the
/// edge is split at the corner. Small triangles have corners near their edges, too.
pub fn is_line([a, b, c]: [DVec3; 3]) -> bool {
    let longest = [a - b, b - c, c - a].map(DVec3::length_squared).into_iter().fold(0.0, f64::max);
    (b - a).cross(c - a).length() <= FLAT * longest
}

/// The triangles of one whose three edges have more corners inside; each edge is given with its ends. A fan to the corner opposite of the
/// first edge that is divided; the next edge belongs to its last triangle.
pub fn fan([ab, bc, ca]: [&[u32]; 3]) -> Vec<[u32; 3]> {
    let [a, _, c] = [ab[0], bc[0], ca[0]];
    let mut parts: Vec<[u32; 3]> = vec![];
    let (first, last) = (ab[1], ab[ab.len() - 2]);
    parts.extend(ab.windows(2).skip(1).take(ab.len().saturating_sub(3)).map(|pair| [pair[0], pair[1], c]));
    if ab.len() == 2 {
        let first = bc[bc.len() - 2];
        parts.extend(bc.windows(2).take(bc.len() - 2).map(|pair| [pair[0], pair[1], a]));
        parts.extend(ca.windows(2).map(|pair| [pair[0], pair[1], first]));
    } else {
        parts.extend(bc.windows(2).map(|pair| [pair[0], pair[1], last]));
        parts.extend(ca.windows(2).map(|pair| [pair[0], pair[1], first]));
    }
    parts
}

impl Working {
    /// A corner at a place inside an edge.
    fn add_between(&mut self, (a, b): (u32, u32), place: u32, position: DVec3, part: f64) -> u32 {
        let [one, two] = [a, b].map(|corner| &self.corners[corner as usize]);
        let normal = if one.normal == two.normal {
            one.normal
        } else {
            one.normal.lerp(two.normal, part).normalize_or(one.normal)
        };
        let corner = Corner {
            position,
            normal,
            light: one.light.lerp(two.light, part),
            from: ([one.from.0[0], two.from.0[0]], part),
            surface: one.surface,
            fixed: false,
            point: place,
            around: SmallVec::new(),
        };
        self.corners.push(corner);
        self.corners.len() as u32 - 1
    }
}

/// Places by the cell that they lie in.
pub struct Grid {
    low: DVec3,
    cell: f64,
    /// Cells along each axis.
    count: I64Vec3,
    sorted: Vec<(u64, u32)>,
    tolerance: f64,
}

impl Grid {
    /// A grid for edges that a place is on within this distance.
    pub fn new(positions: &[DVec3], tolerance: f64) -> Self {
        let bounds = Bounds::around(positions.iter().copied());
        let extent = bounds.extent().max_element().max(tolerance);
        // Places lie on surfaces, and crowd on small things: most cells hold none, and those there hold few.
        let cell = extent / (4.0 * positions.len() as f64).sqrt().clamp(1.0, 8192.0);
        let low = positions.iter().copied().fold(DVec3::MAX, DVec3::min);
        let count = (bounds.extent() / cell).floor().as_i64vec3() + I64Vec3::ONE;
        let mut grid = Self { low, cell, count, sorted: vec![], tolerance };
        grid.sorted = (0..)
            .zip(positions)
            .map(|(index, position)| (grid.key(((*position - low) / cell).floor().as_i64vec3()), index))
            .collect();
        grid.sorted.sort_unstable();
        grid
    }

    fn key(&self, cell: I64Vec3) -> u64 {
        let cell = cell.clamp(I64Vec3::ZERO, self.count - I64Vec3::ONE);
        ((cell.z * self.count.y + cell.y) * self.count.x + cell.x) as u64
    }

    /// Places inside an edge, with the part of the way from its first end, in order; `margin` from the ends at least.
    pub fn inside(&self, positions: &[DVec3], [from, to]: [DVec3; 2], margin: f64) -> Vec<(u32, f64)> {
        let span = to - from;
        let length = span.length();
        let mut found: Vec<(u32, f64)> = vec![];
        if length <= 2.0 * margin {
            return found;
        }
        let axis = span.abs().max_position();
        let scaled = |value: f64, axis: usize| ((value - self.low[axis]) / self.cell).floor() as i64;
        let (least, most) = (from[axis].min(to[axis]), from[axis].max(to[axis]));
        let (other, third) = ((axis + 1) % 3, (axis + 2) % 3);
        let first = scaled(least - self.tolerance, axis).max(0);
        let last = scaled(most + self.tolerance, axis).min(self.count[axis] - 1);
        for slab in first..=last {
            let border = |slab: i64| self.low[axis] + slab as f64 * self.cell;
            let part = |value: f64| ((value - from[axis]) / span[axis]).clamp(0.0, 1.0);
            let borders = [border(slab) - self.tolerance, border(slab + 1) + self.tolerance];
            let [one, two] = borders.map(|value| from + span * part(value));
            let range = |axis: usize| {
                let low = scaled(one[axis].min(two[axis]) - self.tolerance, axis).max(0);
                let high = scaled(one[axis].max(two[axis]) + self.tolerance, axis).min(self.count[axis] - 1);
                low..=high
            };
            for second in range(other) {
                for last in range(third) {
                    let mut cell = I64Vec3::ZERO;
                    (cell[axis], cell[other], cell[third]) = (slab, second, last);
                    let key = self.key(cell);
                    let start = self.sorted.partition_point(|(own, _)| *own < key);
                    let here = self.sorted[start..].iter().take_while(|(own, _)| *own == key);
                    found.extend(here.filter_map(|(_, place)| {
                        let offset = positions[*place as usize] - from;
                        let along = offset.dot(span) / length;
                        let beside = (offset - span * (along / length)).length();
                        let is_inside = beside <= self.tolerance && along > margin && along < length - margin;
                        is_inside.then_some((*place, along / length))
                    }));
                }
            }
        }
        found.sort_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
        found
    }
}
