//! Shadow lines: where the shadow of an edge ends on a facet, in the light of a point, a spot or the sun.
//!
//! Irradiance from such a light jumps there, as it does at a contact. A mesh that follows the jump by division alone spends
//! thousands of vertices on it and still shows saw teeth; a line that is an edge of the mesh, with separate vertices on either
//! side, has no error at all. Lights with an area and the sky cast no such lines.
//!
//! | file | what it does |
//! |---|---|
//! | `source` | lights that cast sharp shadows |
//! | `silhouettes` | edges of the scene, and those that a light sees as an outline |
//! | `projection` | the shadow of an edge on facets |
//! | `search` | facets that can receive the shadow of an edge |
//! | `visibility` | the parts of a line that divide light from shadow |
//! | `ends` | ends moved to where lines meet |
//! | `worth` | which lines are worth their vertices |

mod ends;
mod projection;
mod search;
mod silhouettes;
mod source;
#[cfg(test)]
mod tests;
mod visibility;
mod worth;

use glam::DVec3;
use kernel::geometry::ConvexPolygon;
use kernel::occluder::Occluder;
use rayon::prelude::*;
use scene::{Facet, Scene};

use super::WELD;
use super::line::Contact;
use projection::{Shadow, shadow_on};
use search::Receivers;
use silhouettes::Silhouette;
use visibility::Sight;

/// Shortest shadow of an edge that is looked for, relative to the scene's extent.
const SHORTEST: f64 = 1e-3;

/// Most edges per light whose shadows are looked for: those that it sees longest.
const MOST_EDGES: usize = 1 << 13;

/// Most facets per light that are looked at for all shadows: edges beyond them are passed over, those that it sees longest first. Scenes
/// whose triangles are all seen through each other have quadratically many.
const MOST_LOOKS: usize = 1 << 23;

/// What a line costs that is looked at closely, in facets.
const LOOKS_OF_A_LINE: usize = 16;

/// Edges that are looked at together.
const EDGES_AT_ONCE: usize = 1 << 9;

/// Surfaces that are more transparent than this cast no sharp shadow.
const LEAST_OPACITY: f64 = 0.99;

/// A line with what is known of it.
#[derive(Debug, Clone)]
struct Line {
    /// Index of the surface and of the facet in it.
    facet: (usize, usize),
    /// Index among the sources.
    source: usize,
    ends: Contact,
    /// False where an end is that of the edge's shadow or lies on the facet's border; true where it was searched for.
    searched: [bool; 2],
    /// The jump of the irradiance, in the middle.
    jump: DVec3,
}

/// The shadow lines of every facet, in the order of surfaces and facets: the lines that a bake with this relative error should
/// have as edges of the mesh, those that save the most vertices first. `extent` is the scene's.
pub fn shadow_lines(scene: &Scene, extent: f64, error: f64) -> Vec<Vec<Vec<Contact>>> {
    let mut lines: Vec<Vec<Vec<Contact>>> =
        scene.surfaces.iter().map(|surface| vec![vec![]; surface.facets.len()]).collect();
    let sources = source::sources(scene);
    if sources.is_empty() {
        return lines;
    }
    let casters: Vec<&Facet> = casters(scene).collect();
    let polygons: Vec<ConvexPolygon> = casters.iter().map(|facet| facet.polygon()).collect();
    let (edges, (receivers, occluder)) = rayon::join(
        || silhouettes::edges(&casters),
        || rayon::join(|| Receivers::new(scene, SHORTEST * extent), || Occluder::new(&polygons)),
    );
    let mut found = vec![];
    for (index, source) in sources.iter().enumerate() {
        let silhouettes = silhouettes::seen_from(source, &edges, SHORTEST * extent, MOST_EDGES);
        let of_edge = |silhouette: &Silhouette| {
            let (mut lines, mut stops, mut looks) = (vec![], vec![], 0);
            receivers.for_each(source, silhouette, |place, facet| {
                looks += 1;
                match shadow_on(source, silhouette, facet, SHORTEST * extent) {
                    Some(Shadow::Contact(ends)) => stops.push((place, ends)),
                    Some(Shadow::Line(ends)) => {
                        looks += LOOKS_OF_A_LINE;
                        let sight = Sight { source, silhouette, facet, occluder: &occluder, extent };
                        lines.extend(sight.lines(ends).into_iter().map(|(ends, searched)| Line {
                            facet: place,
                            source: index,
                            ends,
                            searched,
                            jump: source.irradiance((ends[0] + ends[1]) / 2.0, facet.normal),
                        }));
                    }
                    None => {}
                }
            });
            (lines, stops, looks)
        };
        let (mut of_source, mut stops, mut looks) = (vec![], vec![], 0);
        for some in silhouettes.chunks(EDGES_AT_ONCE).map(|edges| edges.par_iter().map(of_edge)) {
            if looks > MOST_LOOKS {
                break;
            }
            for (lines, own_stops, own_looks) in some.collect::<Vec<_>>() {
                of_source.extend(lines);
                stops.extend(own_stops);
                looks += own_looks;
            }
        }
        found.extend(ends::joined(of_source, &stops, scene));
    }
    for line in worth::worth_it(scene, &sources, &occluder, found, error) {
        lines[line.facet.0][line.facet.1].push(line.ends);
    }
    lines
}

/// The facets that cast shadows.
fn casters(scene: &Scene) -> impl Iterator<Item = &Facet> {
    scene.fronts().filter(|surface| surface.opacity >= LEAST_OPACITY).flat_map(|surface| &surface.facets)
}

fn facet_at(scene: &Scene, place: (usize, usize)) -> &Facet {
    &scene.surfaces[place.0].facets[place.1]
}
