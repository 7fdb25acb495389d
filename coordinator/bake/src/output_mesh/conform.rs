//! Vertices at one position, and splits at T-junctions.
//!
//! An edge is *open* where not exactly two triangles of its surface share it by its vertices: at creases, contacts, borders between
//! materials and sides. Where another vertex lies inside it a rasterizer shows dots, so the triangle is split there.

use foldhash::{HashMap, HashMapExt};
use glam::{DVec3, I64Vec3};
use rayon::prelude::*;
use smallvec::SmallVec;

use super::grid::{Grid, ON_EDGE, ONE_POINT, bits};
use super::slivers::drop_slivers;
use super::split::{fan, is_line, normal_between};
use super::working::{Corner, NONE, Triangle, Working};

/// Most places on edges for each corner: hundreds of slivers in one line have each other's vertices on their edges, quadratically
/// many.
const MOST_SPLITS: usize = 4;

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
    drop_slivers(working, pieces);
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
            working.remove(index as u32);
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
        working.detach(index as u32);
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
pub(super) mod tests {
    use super::*;
    use crate::lit::{LitMesh, LitTriangle, LitVertex};
    use crate::test_scenes::{facet, scene};
    use ::scene::Facet;

    /// Width of the scenes.
    pub const WIDTH: f64 = 1000.0;

    /// Triangles of facets and vertices of their own, made conforming: the positions of those that are left.
    pub fn conforming(triangles: &[[[f64; 3]; 3]]) -> Vec<[DVec3; 3]> {
        conforming_facets(triangles.iter().map(|corners| facet(0, corners)).collect())
    }

    /// The same of triangular facets.
    fn conforming_facets(triangles: Vec<Facet>) -> Vec<[DVec3; 3]> {
        let positions: Vec<DVec3> = triangles.iter().flat_map(Facet::positions).collect();
        let count = triangles.len() as u32;
        let scene = scene(vec![triangles], vec![]);
        let vertex = |position| LitVertex { position, normal: DVec3::Z, irradiance: DVec3::ONE };
        let triangle =
            |facet: u32| LitTriangle { facet, vertices: [0, 1, 2].map(|corner| 3 * facet + corner) };
        let lit = LitMesh {
            vertices: positions.into_iter().map(vertex).collect(),
            surfaces: vec![(0..count).map(triangle).collect()],
            ..LitMesh::default()
        };
        let mut working = Working::new(&scene, &lit);
        conform(&mut working);
        working.alive().map(|(_, triangle)| triangle.corners.map(|corner| working.at(corner))).collect()
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

    /// Beside a facet that covers a part of another, the corners of what is left of it are computed.
    #[test]
    fn corners_that_are_not_of_the_input_move_to_those_that_are() {
        let [from, to] = [[0.0, 0.0, 0.0], [WIDTH, 0.0, 0.0]];
        let beside = [0.5 * ONE_POINT * WIDTH, 0.0, 0.0];
        let above = facet(0, &[from, to, [0.5 * WIDTH, 0.5 * WIDTH, 0.0]]);
        let whole = facet(0, &[[-WIDTH, 0.0, 0.0], [0.5 * WIDTH, -0.5 * WIDTH, 0.0], to]);
        let piece = facet(0, &[beside, [0.5 * WIDTH, -0.5 * WIDTH, 0.0], to]);
        let left = Facet { triangles: whole.triangles, ..piece };
        let triangles = conforming_facets(vec![left, above]);
        assert!(triangles[0].contains(&DVec3::ZERO), "{triangles:?}");
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
