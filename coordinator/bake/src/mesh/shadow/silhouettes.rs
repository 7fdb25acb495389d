use glam::DVec3;
use kernel::geometry::Bounds;
use rayon::prelude::*;
use scene::Facet;
use smallvec::SmallVec;

use super::WELD;
use super::source::Source;

/// A shadow on a leaning receiver may be longer than on one across the light, by this factor: what falls flatter is dim.
const LEANING: f64 = 2.0;

/// An edge with the facets that meet there.
pub struct Edge {
    ends: [DVec3; 2],
    /// Mean of the corners of each facet.
    centres: SmallVec<[DVec3; 2]>,
}

/// An edge that a light sees as an outline.
#[derive(Debug, Clone, Copy)]
pub struct Silhouette {
    pub ends: [DVec3; 2],
    /// Unit normal of the plane through the light and the edge. All facets at the edge lie on the other side.
    pub outward: DVec3,
}

/// The edges of some facets. Those whose ends are the same within the welding distance are one, whichever surface they belong to.
/// Where facets do not meet end to end there are several, each of fewer facets.
pub fn edges(facets: &[&Facet]) -> Vec<Edge> {
    let mut sides: Vec<([[i32; 3]; 2], u32, u32)> = facets
        .par_iter()
        .enumerate()
        .flat_map_iter(|(index, facet)| {
            let count = facet.corners.len();
            (0..count).filter_map(move |corner| {
                let ends = [corner, (corner + 1) % count].map(|i| cell(facet.corners[i].position));
                let key = if ends[0] <= ends[1] { ends } else { [ends[1], ends[0]] };
                (key[0] != key[1]).then_some((key, index as u32, corner as u32))
            })
        })
        .collect();
    sides.par_sort_unstable();
    let centre = |facet: &Facet| facet.positions().sum::<DVec3>() / facet.corners.len() as f64;
    sides
        .par_chunk_by(|a, b| a.0 == b.0)
        .map(|sides| {
            let (_, facet, corner) = sides[0];
            let corners = &facets[facet as usize].corners;
            let ends = [corner as usize, (corner as usize + 1) % corners.len()].map(|i| corners[i].position);
            let mut centres: SmallVec<[DVec3; 2]> = SmallVec::new();
            centres.extend(sides.iter().map(|side| centre(facets[side.1 as usize])));
            Edge { ends, centres }
        })
        .collect()
}

fn cell(position: DVec3) -> [i32; 3] {
    (position / WELD).round().as_ivec3().to_array()
}

/// The edges that a light sees as an outline and whose shadows can be as long as `shortest`; the `most` longest, in the order of the
/// edges.
pub fn seen_from(source: &Source, edges: &[Edge], shortest: f64, most: usize) -> Vec<Silhouette> {
    let scene = Bounds::around(edges.iter().flat_map(|edge| edge.ends));
    let farthest =
        |from: DVec3| scene.corners().map(|corner| corner.distance(from)).into_iter().fold(0.0, f64::max);
    let mut seen: Vec<(f64, usize, Silhouette)> = edges
        .par_iter()
        .enumerate()
        .filter_map(|(index, edge)| {
            let length = LEANING * source.longest_shadow(edge.ends, farthest);
            if length.is_nan() || length < shortest {
                return None;
            }
            Some((length, index, silhouette(source, edge)?))
        })
        .collect();
    if seen.len() > most {
        seen.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        seen.truncate(most);
        seen.sort_by_key(|silhouette| silhouette.1);
    }
    seen.into_iter().map(|(.., silhouette)| silhouette).collect()
}

/// An edge as an outline: as the light sees it, all facets at it lie on one side. However their windings are, and how many they are.
fn silhouette(source: &Source, edge: &Edge) -> Option<Silhouette> {
    let [from, to] = edge.ends;
    let outward = (to - from).cross(source.towards(from)).try_normalize()?;
    let (mut above, mut below) = (false, false);
    for centre in &edge.centres {
        let height = outward.dot(*centre - from);
        above |= height > WELD;
        below |= height < -WELD;
    }
    // A facet that is seen edge-on casts no shadow by itself.
    match (above, below) {
        (true, false) => Some(Silhouette { ends: edge.ends, outward: -outward }),
        (false, true) => Some(Silhouette { ends: edge.ends, outward }),
        _ => None,
    }
}
