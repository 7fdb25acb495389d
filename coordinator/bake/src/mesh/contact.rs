//! Contacts: lines where one facet stands on another, or passes through it.
//!
//! Irradiance jumps there: lit floor on one side, floor hidden under the wall on the other. A patch across the line would leak
//! light under the wall, a share across it from one room to the next. The line therefore becomes an edge of the mesh, with
//! separate vertices on either side. So does the outline of what hovers just before a facet, such as a picture on a wall.

use glam::DVec3;
use kernel::geometry::Bounds;
use obvhs::Boundable;
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::builder::build_bvh2;
use rayon::prelude::*;

use super::line::{Contact, distance_to_line, narrow};
use super::planar::Region;
use super::{FEW_FACETS, WELD};
use scene::{Corner, Facet, Scene};

/// Shortest line that becomes an edge, relative to the scene's extent.
const SHORTEST: f64 = 2e-3;

/// The same relative to the longest edge of a patch.
const SHORTEST_OF_EDGE: f64 = 1.0 / 32.0;

/// Regions smaller than this are not cut, relative to the longest edge of a patch.
const SMALLEST_REGION: f64 = 0.25;

/// Height up to which the outline of what hovers is a line, relative to the longest edge of a patch.
const GAP: f64 = 1.0 / 16.0;

/// A shadow that ends this near to the outline of what hovers, relative to its height, has no line of its own.
const BESIDE: f64 = 2.0;

/// Most lines of a region: the longest contacts, then the longest outlines of hovering facets.
const MOST: usize = 1024;

/// Most lines of a scene, at least; the longest are kept. Of buildings with many rooms none may be missing, or light leaks.
const MOST_OF_SCENE: usize = 4096;

/// Most lines of a scene where few facets rise: they are walls.
const MOST_OF_SMALL_SCENE: usize = 65_536;

/// Most lines of a scene, per facet.
const LINES_PER_FACET: f64 = 0.125;

/// Most pairs of facets that are looked at, those of the largest regions first: for each facet, and for small scenes. Furnished flats
/// have 17 to 26 a facet; scenes whose triangles all pass through each other have quadratically many.
const LOOKS_PER_FACET: usize = 64;
const LOOKS_OF_SMALL_SCENE: usize = 1 << 22;

/// Regions that are looked at together.
const REGIONS_AT_ONCE: usize = 1 << 8;

/// Lines of a region.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Line {
    pub ends: Contact,
    /// Height over the facet of what leaves the line; 0 where it stands on it.
    pub height: f64,
}

struct FacetBox<'a> {
    facet: &'a Facet,
    aabb: Aabb,
}

impl Boundable for FacetBox<'_> {
    fn aabb(&self) -> Aabb {
        self.aabb
    }
}

impl Line {
    /// Whether another line runs beside the outline of what hovers, where its shadow may end.
    pub fn is_beside(&self, other: &Contact) -> bool {
        self.height > 0.0 && other.iter().all(|end| distance_to_line(*end, &self.ends) < self.height * BESIDE)
    }

    fn length(&self) -> f64 {
        self.ends[0].distance(self.ends[1])
    }
}

/// The contacts of every region, longest first; then the outlines of facets that hover over it. Lengths are in frame units.
/// There are `limit` at most, the longest of the scene.
pub fn contacts(
    scene: &Scene,
    regions: &[Region],
    extent: f64,
    longest_edge: f64,
    limit: usize,
) -> Vec<Vec<Line>> {
    let gap = GAP * longest_edge;
    let shortest = (SHORTEST * extent).max(SHORTEST_OF_EDGE * longest_edge);
    let boxed = |facet| FacetBox { facet, aabb: facet_box(facet) };
    let is_long = |line: &Line| line.length() >= shortest;
    // What is smaller than the shortest line leaves none.
    let rises = |facet: &&Facet| Bounds::around(facet.positions()).extent().length() >= shortest;
    let risers: Vec<FacetBox> = scene.front_facets().filter(rises).map(boxed).collect();
    if risers.is_empty() || limit == 0 {
        return vec![vec![]; regions.len()];
    }
    let bvh = build_bvh2(&risers, BvhBuildParams::fast_build(), &mut Default::default());
    let of_region = |region: &Region| {
        let (mut found, mut hovering, mut looks) = (vec![], vec![], 0);
        for (_, facet) in region.facets(scene) {
            bvh.aabb_traverse(grown(facet_box(facet), gap), |bvh, node| {
                let node = &bvh.nodes[node as usize];
                looks += node.prim_count as usize;
                for index in &bvh.primitive_indices[node.first_index as usize..][..node.prim_count as usize] {
                    let riser = risers[*index as usize].facet;
                    found.extend(contact(facet, riser).filter(is_long));
                    hovering.extend(hovering_edges(facet, riser, gap).into_iter().filter(is_long));
                }
                true
            });
        }
        sort_by_length(&mut found);
        sort_by_length(&mut hovering);
        // Two facets share each edge of what hovers, and a line may be a contact of both sides of a sheet. The lowest comes first.
        found.dedup_by_key(|line| line.ends);
        hovering.dedup_by_key(|line| line.ends);
        found.extend(hovering);
        found.truncate(MOST);
        (found, looks)
    };
    let most = if risers.len() <= FEW_FACETS {
        MOST_OF_SMALL_SCENE
    } else {
        MOST_OF_SCENE.max((risers.len() as f64 * LINES_PER_FACET) as usize)
    };
    let most = most.min(limit);
    let mut order: Vec<usize> = (0..regions.len()).collect();
    // Lines across a narrow one are too short, and light hardly differs between its long sides.
    let is_cut =
        |region: &Region| region.size >= SMALLEST_REGION * longest_edge && region.width(scene) >= shortest;
    order.retain(|region| is_cut(&regions[*region]));
    order.sort_by(|a, b| regions[*b].size.total_cmp(&regions[*a].size));
    let mut all = vec![vec![]; regions.len()];
    let most_looks = LOOKS_OF_SMALL_SCENE.max(LOOKS_PER_FACET * risers.len());
    let (mut looks, mut kept) = (0, 0);
    for some in order.chunks(REGIONS_AT_ONCE) {
        if looks > most_looks {
            break;
        }
        let lines: Vec<_> = some.par_iter().map(|region| of_region(&regions[*region])).collect();
        for (region, (lines, own_looks)) in some.iter().zip(lines) {
            looks += own_looks;
            kept += lines.len();
            all[*region] = lines;
        }
        // They need not all be held to know the longest.
        if kept > 4 * most {
            kept = keep_longest(&mut all, most, |length, least| length >= least);
        }
    }
    keep_longest(&mut all, most, |length, least| length > least);
    all
}

/// Keeps the longest lines of all regions where there are more than `most`: those that are long enough beside the first that is too
/// many. Returns how many there are then.
fn keep_longest(all: &mut [Vec<Line>], most: usize, is_long_enough: impl Fn(f64, f64) -> bool) -> usize {
    let mut lengths: Vec<f64> = all.iter().flatten().map(Line::length).collect();
    if lengths.len() > most {
        let (_, least, _) = lengths.select_nth_unstable_by(most, |a, b| b.total_cmp(a));
        let least = *least;
        all.iter_mut().for_each(|lines| lines.retain(|line| is_long_enough(line.length(), least)));
    }
    all.iter().map(Vec::len).sum()
}

/// Sorts by length, then by place: independent of the order of the BVH.
fn sort_by_length(lines: &mut [Line]) {
    let key = |line: &Line| (line.length(), line.ends.map(|end| end.to_array()), -line.height);
    lines.sort_by(|a, b| key(b).partial_cmp(&key(a)).unwrap_or(std::cmp::Ordering::Equal));
}

fn facet_box(facet: &Facet) -> Aabb {
    let points: Vec<_> = facet.positions().map(|position| position.as_vec3a()).collect();
    let tight = Aabb::from_points(&points);
    grown(tight, 2.0 * WELD)
}

fn grown(aabb: Aabb, by: f64) -> Aabb {
    let margin = glam::Vec3A::splat(by as f32);
    Aabb::new(aabb.min - margin, aabb.max + margin)
}

/// The edges of `riser` that hover over the front of `facet`, no higher than `gap`.
fn hovering_edges(facet: &Facet, riser: &Facet, gap: f64) -> Vec<Line> {
    let origin = facet.corners[0].position;
    let height = |corner: &Corner| facet.normal.dot(corner.position - origin);
    let hovers = |corner: &Corner| (WELD..=gap).contains(&height(corner));
    let foot = |corner: &Corner| corner.position - facet.normal * height(corner);
    let next = riser.corners.iter().cycle().skip(1);
    let edges = riser.corners.iter().zip(next).filter(|(a, b)| hovers(a) && hovers(b));
    // The same way round from whichever of its two facets an edge is seen.
    let from_least = |[a, b]: Contact| if a.to_array() <= b.to_array() { [a, b] } else { [b, a] };
    let line = |(a, b): (&Corner, &Corner)| {
        let ends = clip_to_facet(from_least([foot(a), foot(b)]), facet)?;
        Some(Line { ends, height: height(a).max(height(b)) })
    };
    edges.filter_map(line).collect()
}

/// The line along which `riser` rises from the front of `facet`.
fn contact(facet: &Facet, riser: &Facet) -> Option<Line> {
    if riser.plane == facet.plane {
        return None;
    }
    let origin = facet.corners[0].position;
    let count = riser.corners.len();
    let heights: Vec<f64> = riser.corners.iter().map(|c| facet.normal.dot(c.position - origin)).collect();
    if heights.iter().all(|height| *height <= WELD) || heights.iter().all(|height| *height > WELD) {
        return None;
    }
    let mut points = vec![];
    for (i, corner) in riser.corners.iter().enumerate() {
        let next = (i + 1) % count;
        if heights[i].abs() <= WELD {
            points.push(corner.position);
        } else if heights[next].abs() > WELD && (heights[i] > 0.0) != (heights[next] > 0.0) {
            let t = heights[i] / (heights[i] - heights[next]);
            points.push(corner.position.lerp(riser.corners[next].position, t));
        }
    }
    let along = facet.normal.cross(riser.normal);
    let by_place = |a: &&DVec3, b: &&DVec3| along.dot(**a).total_cmp(&along.dot(**b));
    let ends = [*points.iter().min_by(by_place)?, *points.iter().max_by(by_place)?];
    Some(Line { ends: clip_to_facet(ends, facet)?, height: 0.0 })
}

/// The part of a line within a facet, its border included.
fn clip_to_facet(line: Contact, facet: &Facet) -> Option<Contact> {
    let mut part = (0.0, 1.0);
    for (i, corner) in facet.corners.iter().enumerate() {
        let next = facet.corners[(i + 1) % facet.corners.len()].position;
        let inward = facet.normal.cross(next - corner.position).normalize_or_zero();
        if !narrow(&mut part, line.map(|point| inward.dot(point - corner.position) + WELD)) {
            return None;
        }
    }
    let (from, to) = part;
    (from < to).then(|| [line[0].lerp(line[1], from), line[0].lerp(line[1], to)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::planar::regions;
    use crate::test_scenes::{facet, scene};

    /// A sheet stands along the middle of a strip.
    #[test]
    fn narrow_strips_are_not_cut_lengthwise() {
        let lines_of = |width: f64| {
            let half = width / 2.0;
            let strip = [[0.0, -half, 0.0], [10.0, -half, 0.0], [10.0, half, 0.0], [0.0, half, 0.0]];
            let sheet = [[1.0, 0.0, 0.0], [9.0, 0.0, 0.0], [9.0, 0.0, 5.0], [1.0, 0.0, 5.0]];
            let scene = scene(vec![vec![facet(0, &strip)], vec![facet(1, &sheet)]], vec![]);
            let regions = regions(&scene);
            contacts(&scene, &regions, 10.0, 1.0, usize::MAX)[0].len()
        };
        assert_eq!(lines_of(1.0), 1);
        assert_eq!(lines_of(0.01), 0);
    }
}
