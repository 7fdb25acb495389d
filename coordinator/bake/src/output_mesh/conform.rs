//! Vertices at one position, and splits at T-junctions.
//!
//! An edge is *open* where not exactly two triangles of its surface share it by its vertices: at creases, contacts, borders between
//! materials and sides. Where another vertex lies inside it a rasterizer shows dots, so the triangle is split there.

use foldhash::{HashMap, HashMapExt};
use glam::{DVec3, I64Vec3};
use rayon::prelude::*;
use smallvec::SmallVec;

use super::grid::{Grid, ON_EDGE, ONE_POINT, bits};
use super::split::{fan, is_line, normal_between};
use super::working::{Corner, NONE, Triangle, Working};
use crate::mesh::distance_to_line;

/// Most places on edges for each corner: hundreds of slivers in one line have each other's vertices on their edges, quadratically
/// many.
const MOST_SPLITS: usize = 4;

/// Height of a piece that may be a line, relative to its longest edge, at most: corners of very small triangles all lie on their edges.
const FLAT: f64 = 0.3;

/// Both places of an open edge, the lesser first, and its number.
type AtPlaces = ((u32, u32), usize);

/// Makes the triangles conforming, and finds which corners are collapsed together.
pub fn conform(working: &mut Working) {
    let (places, open) = rayon::join(|| Places::new(working), || open_edges(working));
    let mut is_tied = vec![false; places.first.len()];
    for (a, b, _) in &open {
        for corner in [*a, *b] {
            is_tied[places.of_corner[corner as usize] as usize] = true;
        }
    }
    let grid = Grid::new(&places.position, ONE_POINT.max(ON_EDGE) * working.extent);
    let mut inside: HashMap<(u32, u32), Vec<(u32, f64)>> = HashMap::new();
    let margin = ONE_POINT * working.extent;
    let find = |(a, b, _): &(u32, u32, u32)| {
        let ends = [*a, *b].map(|corner| places.position[places.of_corner[corner as usize] as usize]);
        ((*a, *b), grid.inside(&places.position, ends, margin))
    };
    // Several edges lie at the same places: of both sides, and of both surfaces at a crease. Most have nothing inside.
    let places_of = |(index, (a, b, _)): (usize, &(u32, u32, u32))| {
        let [a, b] = [*a, *b].map(|corner| places.of_corner[corner as usize]);
        ((a.min(b), a.max(b)), index)
    };
    let mut by_places: Vec<AtPlaces> = open.par_iter().enumerate().map(places_of).collect();
    by_places.par_sort_unstable();
    let together: Vec<_> = by_places.chunk_by(|one, other| one.0 == other.0).collect();
    let counted = |(group, same): (usize, &&[AtPlaces])| {
        let inside = find(&open[same[0].1]).1.len();
        (inside > 0).then_some((inside * same.len(), group))
    };
    let all_of = |same: &&[AtPlaces]| same.iter().map(|(_, index)| find(&open[*index])).collect::<Vec<_>>();
    let mut groups: Vec<_> = together.par_iter().enumerate().with_min_len(64).filter_map(counted).collect();
    keep_fewest(&mut groups, MOST_SPLITS * working.corners.len());
    let of_groups = groups.par_iter().with_min_len(64).flat_map_iter(|(_, group)| all_of(&together[*group]));
    for (edge, found) in of_groups.collect::<Vec<_>>() {
        found.iter().for_each(|(place, _)| is_tied[*place as usize] = true);
        inside.insert(edge, found);
    }
    move_to_places(working, &places, &is_tied);
    let pieces = split(working, &places, &inside);
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
    drop_lines(working, pieces);
}

/// Drops those of some pieces that have no height: those with two corners at one position, and those whose longest edge no other triangle
/// has.
fn drop_lines(working: &mut Working, mut pieces: Vec<u32>) {
    let all = pieces.len();
    let mut before = usize::MAX;
    // Dropping one may leave a neighbour with such an edge.
    while pieces.len() < before {
        before = pieces.len();
        pieces.retain(|index| {
            let is_line = working.has_two_corners_in_one(*index) || working.is_line_of_its_own(*index);
            if is_line {
                let corners = working.triangles[*index as usize].corners;
                working.detach(*index as usize, corners);
                working.triangles[*index as usize].corners = [NONE; 3];
            }
            !is_line
        });
    }
    if pieces.len() < all {
        let Working { points, corners, .. } = working;
        let has_any = |corner: &mut u32| !corners[*corner as usize].around.is_empty();
        points.iter_mut().for_each(|point| point.retain(has_any));
    }
}

/// Keeps the groups of edges with the fewest places inside, `most` places in all. Each comes with its places and its number.
fn keep_fewest(groups: &mut Vec<(usize, usize)>, most: usize) {
    if groups.iter().map(|(places, _)| places).sum::<usize>() <= most {
        return;
    }
    groups.sort_unstable();
    let mut total = 0;
    let fits = |(places, _): &&(usize, usize)| {
        total += places;
        total <= most
    };
    let fitting = groups.iter().take_while(fits).count();
    groups.truncate(fitting);
}

/// Open edges, the lesser corner first, and their only triangle or the first of several.
fn open_edges(working: &Working) -> Vec<(u32, u32, u32)> {
    let edges_of = |(index, triangle): (usize, &Triangle)| {
        let is_alive = triangle.corners[0] != NONE;
        let edges = triangle.sorted_edges().into_iter().filter(move |_| is_alive);
        edges.map(move |(a, b)| (a, b, index as u32))
    };
    let triangles = working.triangles.par_iter().enumerate().with_min_len(1024);
    let mut edges: Vec<(u32, u32, u32)> = triangles.flat_map_iter(edges_of).collect();
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
        let mut known: HashMap<[u64; 3], u32> = HashMap::with_capacity(working.corners.len());
        let is_fixed = |corner: &u32| working.corners[*corner as usize].fixed;
        // The input's corners do not move.
        let (fixed, others): (Vec<u32>, Vec<u32>) = (0..working.corners.len() as u32).partition(is_fixed);
        for index in fixed.into_iter().chain(others) {
            let position = working.at(index);
            let exact = bits(position);
            if let Some(place) = known.get(&exact) {
                places.of_corner[index as usize] = *place;
                continue;
            }
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
            let place = nearest.map_or_else(
                || {
                    let place = places.position.len() as u32;
                    places.first.push(index);
                    places.position.push(position);
                    by_cell.entry(cell(position)).or_default().push(place);
                    place
                },
                |(_, place)| place,
            );
            known.insert(exact, place);
            places.of_corner[index as usize] = place;
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

/// Splits the triangles along open edges that have places inside. Returns the pieces.
fn split(working: &mut Working, places: &Places, inside: &HashMap<(u32, u32), Vec<(u32, f64)>>) -> Vec<u32> {
    let mut pieces = vec![];
    let mut added: HashMap<(u32, u32, u32), u32> = HashMap::new();
    let found_on = |[a, b, c]: [u32; 3]| {
        let on = |(a, b): (u32, u32)| inside.get(&(a.min(b), a.max(b))).map_or(&[][..], Vec::as_slice);
        [(a, b), (b, c), (c, a)].map(on)
    };
    let has_any =
        |index: &usize| found_on(working.triangles[*index].corners).iter().any(|found| !found.is_empty());
    let all: Vec<usize> =
        (0..working.triangles.len()).into_par_iter().with_min_len(256).filter(has_any).collect();
    for index in all {
        let Triangle { corners, surface, facet, region, .. } = working.triangles[index].clone();
        let edges = [(0, 1), (1, 2), (2, 0)].map(|(a, b)| (corners[a], corners[b]));
        let own = corners.map(|corner| places.of_corner[corner as usize]);
        let found = found_on(corners);
        // What lies beyond that edge is split at the corner, and at nothing else.
        let is_its_edge = found.into_iter().flatten().all(|(place, _)| own.contains(place));
        if is_its_edge && is_line(own.map(|place| places.position[place as usize])) {
            working.detach(index, corners);
            working.triangles[index].corners = [NONE; 3];
            continue;
        }
        let outline = [0, 1, 2].map(|side| {
            let ((a, b), found) = (edges[side], found[side]);
            let edge = (a.min(b), a.max(b));
            let mut line: SmallVec<[u32; 4]> = SmallVec::from_slice(&[a]);
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
            pieces.push(index as u32);
            continue;
        }
        working.detach(index, corners);
        let parts = fan(outline.each_ref().map(SmallVec::as_slice));
        let mut parts =
            parts.into_iter().map(|corners| Triangle { corners, surface, facet, region, samples: vec![] });
        if let Some(own) = parts.next() {
            for corner in own.corners {
                working.corners[corner as usize].around.push(index as u32);
            }
            working.triangles[index] = own;
            pieces.push(index as u32);
        }
        for part in parts {
            pieces.push(working.triangles.len() as u32);
            working.add(part);
        }
    }
    pieces
}

impl Working {
    /// Takes a triangle from its corners.
    fn detach(&mut self, index: usize, corners: [u32; 3]) {
        for corner in corners {
            self.corners[corner as usize].around.retain(|around| *around != index as u32);
        }
    }

    /// Whether two corners of a triangle lie at one position.
    fn has_two_corners_in_one(&self, index: u32) -> bool {
        let [a, b, c] =
            self.triangles[index as usize].corners.map(|corner| self.corners[corner as usize].point);
        a == b || b == c || c == a
    }

    /// Whether a corner of a triangle lies on the opposite edge, which no other triangle has, while others have the two shorter ones.
    fn is_line_of_its_own(&self, index: u32) -> bool {
        let corners = self.triangles[index as usize].corners;
        let sides = [0, 1, 2].map(|side| [0, 1, 2].map(|turn| corners[(side + turn) % 3]));
        let length = |[a, b, _]: [u32; 3]| self.at(a).distance_squared(self.at(b));
        let Some(longest) = (0..3).max_by(|a, b| length(sides[*a]).total_cmp(&length(sides[*b]))) else {
            return false;
        };
        let [from, to, across] = sides[longest];
        let distance = distance_to_line(self.at(across), &[from, to].map(|corner| self.at(corner)));
        let is_on = distance <= (ON_EDGE * self.extent).min(FLAT * length(sides[longest]).sqrt());
        is_on
            && !self.has_another(index, from, to)
            && self.has_another(index, to, across)
            && self.has_another(index, across, from)
    }

    /// Whether a triangle other than this has an edge between the positions of two corners.
    fn has_another(&self, index: u32, from: u32, to: u32) -> bool {
        let place = |corner: u32| self.corners[corner as usize].point as usize;
        let corners = self.points[place(from)].iter();
        let mut around = corners.flat_map(|corner| &self.corners[*corner as usize].around);
        around.any(|other| {
            *other != index && self.triangles[*other as usize].corners.iter().any(|c| place(*c) == place(to))
        })
    }

    /// A corner at a place inside an edge.
    fn add_between(&mut self, (a, b): (u32, u32), place: u32, position: DVec3, part: f64) -> u32 {
        let [one, two] = [a, b].map(|corner| &self.corners[corner as usize]);
        let normal = normal_between([one.normal, two.normal], part);
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lit::{LitMesh, LitTriangle, LitVertex};
    use crate::test_scenes::{facet, scene};

    const WIDTH: f64 = 1000.0;

    /// Triangles of facets and vertices of their own, made conforming: the positions of those that are left.
    fn conforming(triangles: &[[[f64; 3]; 3]]) -> Vec<[DVec3; 3]> {
        let scene = scene(vec![triangles.iter().map(|corners| facet(0, corners)).collect()], vec![]);
        let positions = triangles.iter().flatten().copied().map(DVec3::from_array);
        let vertex = |position| LitVertex { position, normal: DVec3::Z, irradiance: DVec3::ONE };
        let triangle =
            |facet: u32| LitTriangle { facet, vertices: [0, 1, 2].map(|corner| 3 * facet + corner) };
        let lit = LitMesh {
            vertices: positions.map(vertex).collect(),
            surfaces: vec![(0..triangles.len() as u32).map(triangle).collect()],
            ..LitMesh::default()
        };
        let mut working = Working::new(&scene, &lit);
        conform(&mut working);
        working.alive().map(|(_, triangle)| triangle.corners.map(|corner| working.at(corner))).collect()
    }

    /// Edges of one triangle alone, inside which a corner of others lies.
    fn t_junctions(triangles: &[[DVec3; 3]]) -> usize {
        let is_same = |a: DVec3, b: DVec3| a.distance(b) <= 2.0 * ONE_POINT * WIDTH;
        let is_whole = |[a, b, c]: &&[DVec3; 3]| !is_same(*a, *b) && !is_same(*b, *c) && !is_same(*c, *a);
        let edges = || triangles.iter().filter(is_whole).flat_map(|[a, b, c]| [[*a, *b], [*b, *c], [*c, *a]]);
        let has_ends = |[a, b]: [DVec3; 2], [c, d]: [DVec3; 2]| {
            is_same(a, c) && is_same(b, d) || is_same(a, d) && is_same(b, c)
        };
        let is_alone = |edge: &[DVec3; 2]| edges().filter(|other| has_ends(*edge, *other)).count() == 1;
        let has_inside = |edge: &[DVec3; 2]| {
            triangles.iter().flatten().any(|corner| {
                distance_to_line(*corner, edge) <= ON_EDGE * WIDTH
                    && edge.iter().all(|end| !is_same(*end, *corner))
            })
        };
        edges().filter(|edge| is_alone(edge) && has_inside(edge)).count()
    }

    #[test]
    fn pieces_that_are_lines_are_dropped_where_nothing_else_has_their_edge() {
        let [from, to, middle] = [[0.0, 0.0, 0.0], [WIDTH, 0.0, 0.0], [0.6 * WIDTH, 0.0, 0.0]];
        let (above, below) = ([0.5 * WIDTH, 0.5 * WIDTH, 0.0], [0.5 * WIDTH, -0.5 * WIDTH, 0.0]);
        let needle = [from, [0.3 * WIDTH, -1e-4, 0.0], to];
        let triangles = conforming(&[[from, to, above], needle, [from, below, middle], [middle, below, to]]);
        assert_eq!(t_junctions(&triangles), 0, "{triangles:?}");
        // The two below, and the one above, have a corner of the needle and one of each other on an edge.
        let is_high = |[a, b, c]: &&[DVec3; 3]| (*b - *a).cross(*c - *a).length() > 1.0;
        assert_eq!(triangles.iter().filter(is_high).count(), 3 + 3, "{triangles:?}");
    }

    #[test]
    fn very_small_triangles_stay() {
        let at = |x: f64, y: f64| [x * ON_EDGE * WIDTH, y * ON_EDGE * WIDTH, 0.0];
        let [from, to, middle] = [at(0.0, 0.0), at(1.5, 0.0), at(0.75, 0.8)];
        // As wide as the scene, and joined with its shorter edges.
        let [left, right] = [[-WIDTH, WIDTH, 0.0], [WIDTH, WIDTH, 0.0]];
        let triangles = conforming(&[[from, to, middle], [middle, to, right], [from, middle, left]]);
        let is_small = |corners: &&[DVec3; 3]| corners.iter().all(|corner| corner.length() < 1.0);
        assert_eq!(triangles.iter().filter(is_small).count(), 1, "{triangles:?}");
    }

    #[test]
    fn corners_hardly_further_apart_than_one_point_lie_on_each_others_edges() {
        let [from, to] = [[0.0, 0.0, 0.0], [WIDTH, 0.0, 0.0]];
        let (above, below) = ([0.5 * WIDTH, 0.5 * WIDTH, 0.0], [0.5 * WIDTH, -0.5 * WIDTH, 0.0]);
        let middles = [0.0, 1.1 * ONE_POINT].map(|off| [(0.5 + off) * WIDTH, 0.0, 0.0]);
        let [one, two] = middles;
        let triangles =
            conforming(&[[from, one, above], [one, to, above], [from, below, two], [two, below, to]]);
        assert_eq!(triangles.len(), 4 + 2, "{triangles:?}");
    }

    #[test]
    fn edges_with_the_fewest_places_are_split_where_there_are_too_many() {
        let kept = |most: usize| {
            let mut groups = vec![(7, 0), (2, 1), (4, 2), (1, 3)];
            keep_fewest(&mut groups, most);
            groups.into_iter().map(|(_, group)| group).collect::<Vec<_>>()
        };
        assert_eq!(kept(14), [0, 1, 2, 3]);
        assert_eq!(kept(13), [3, 1, 2]);
        assert_eq!(kept(6), [3, 1]);
        assert_eq!(kept(0), [] as [usize; 0]);
    }
}
