use foldhash::{HashMap, HashMapExt};

use glam::DVec2;
use kernel::disjoint_sets::DisjointSets;
use spade::handles::FixedFaceHandle;
use spade::{ConstrainedDelaunayTriangulation, HasPosition, Point2, Triangulation};

use super::Axes;
use super::arrangement::Arrangement;
use super::grading::Grading;
use scene::Facet;

/// Part by which the area of the triangles may differ from that of the facets.
const AREA_TOLERANCE: f64 = 1e-6;

/// Coordinates are moved away from 0 by this many frame units, since those next to 0 are refused.
const AWAY: f64 = 8192.0;

/// Coordinates are multiples of 1 over this: then the middles of segments, and of their halves nine times on, lie on them to the last
/// bit, and leave no slivers there.
const STEPS: f64 = (1 << 30) as f64;

/// Triangles of a region.
pub struct Triangles {
    /// Place of each vertex, and the point of the arrangement that it is.
    pub vertices: Vec<(DVec2, Option<u32>)>,
    /// Counter-clockwise.
    pub triangles: Vec<Triangle>,
}

/// A triangle of a region.
pub struct Triangle {
    /// Indices of its corners.
    pub corners: [u32; 3],
    /// The triangle beyond each edge, which leaves the corner of the same number; none across borders and lines.
    pub beside: [Option<u32>; 3],
    /// Index of its facet within the surface.
    pub facet: u32,
}

#[derive(Clone, Copy)]
struct Site {
    place: Point2<f64>,
    point: Option<u32>,
}

impl HasPosition for Site {
    type Scalar = f64;
    fn position(&self) -> Point2<f64> {
        self.place
    }
}

impl Site {
    fn new(place: DVec2, point: Option<u32>) -> Self {
        Self { place: Point2::new(place.x, place.y), point }
    }
}

type Delaunay = ConstrainedDelaunayTriangulation<Site>;

/// The triangles inside of the facets. `None` where they do not cover them.
pub fn triangulate(
    arrangement: &Arrangement,
    facets: &[(u32, &Facet)],
    axes: &Axes,
    finest: f64,
) -> Option<Triangles> {
    let places: Vec<DVec2> = arrangement.points.iter().map(|place| on_grid(*place + AWAY)).collect();
    let ends: Vec<[DVec2; 2]> =
        arrangement.segments.iter().map(|ends| ends.map(|end| places[end as usize])).collect();
    let mut grading = Grading::new(&ends, finest);
    let mut sites: Vec<Site> =
        (0..).zip(&places).map(|(point, place)| Site::new(*place, Some(point))).collect();
    let mut segments: Vec<[usize; 2]> = vec![];
    for (numbers, ends) in arrangement.segments.iter().zip(&ends) {
        let mut last = numbers[0] as usize;
        grading.split(*ends, &mut |place| {
            segments.push([last, sites.len()]);
            last = sites.len();
            sites.push(Site::new(place, None));
        });
        segments.push([last, numbers[1] as usize]);
    }
    sites.extend(grading.points.iter().map(|place| Site::new(*place, None)));
    let delaunay = Delaunay::try_bulk_load_cdt(sites, segments, |_| ()).ok()?;
    let all = inside(&delaunay, facets, axes);
    let area = |triangle: &Triangle| {
        let [a, b, c] = triangle.corners.map(|corner| all.vertices[corner as usize].0);
        (b - a).perp_dot(c - a) / 2.0
    };
    let found: f64 = all.triangles.iter().map(area).sum();
    let whole: f64 = facets.iter().map(|(_, facet)| facet.polygon().area()).sum();
    ((found - whole).abs() <= AREA_TOLERANCE * whole).then_some(all)
}

/// The triangles that lie in a facet.
fn inside(delaunay: &Delaunay, facets: &[(u32, &Facet)], axes: &Axes) -> Triangles {
    let faces: Vec<_> = delaunay.inner_faces().collect();
    let number: HashMap<FixedFaceHandle<_>, usize> =
        faces.iter().enumerate().map(|(number, face)| (face.fix(), number)).collect();
    let beside = |face: usize| {
        faces[face].adjacent_edges().map(|edge| {
            let open = !edge.is_constraint_edge();
            edge.rev().face().as_inner().filter(|_| open).map(|other| number[&other.fix()])
        })
    };
    let mut joined = DisjointSets::new(faces.len());
    for face in 0..faces.len() {
        beside(face).into_iter().flatten().for_each(|other| joined.join(face, other));
    }
    // What no border runs through lies in one facet, or in none: its largest triangle tells.
    let mut largest: HashMap<usize, usize> = HashMap::new();
    for face in 0..faces.len() {
        let best = largest.entry(joined.representative(face)).or_insert(face);
        if faces[face].area() > faces[*best].area() {
            *best = face;
        }
    }
    let outlines: Vec<(u32, Vec<DVec2>)> = facets
        .iter()
        .map(|(index, facet)| (*index, facet.positions().map(|position| axes.flat(position)).collect()))
        .collect();
    let facet_of: HashMap<usize, Option<u32>> = largest
        .into_iter()
        .map(|(part, face)| {
            let centre = faces[face].center();
            let centre = DVec2::new(centre.x - AWAY, centre.y - AWAY);
            let holding = outlines.iter().find(|(_, outline)| holds(outline, centre));
            (part, holding.map(|(index, _)| *index))
        })
        .collect();
    let mut kept: Vec<Option<u32>> = vec![None; faces.len()];
    let mut count = 0;
    for (face, kept) in kept.iter_mut().enumerate() {
        if facet_of[&joined.representative(face)].is_some() {
            *kept = Some(count);
            count += 1;
        }
    }
    let vertices = delaunay
        .vertices()
        .map(|vertex| {
            let Site { place, point } = vertex.data();
            (DVec2::new(place.x - AWAY, place.y - AWAY), *point)
        })
        .collect();
    let mut triangles = vec![];
    for (face, handle) in faces.iter().enumerate() {
        if let Some(facet) = facet_of[&joined.representative(face)] {
            triangles.push(Triangle {
                corners: handle.adjacent_edges().map(|edge| edge.from().index() as u32),
                beside: beside(face).map(|other| kept[other?]),
                facet,
            });
        }
    }
    Triangles { vertices, triangles }
}

fn on_grid(place: DVec2) -> DVec2 {
    (place * STEPS).round() / STEPS
}

fn holds(outline: &[DVec2], point: DVec2) -> bool {
    let next = outline.iter().cycle().skip(1);
    outline.iter().zip(next).all(|(from, to)| (*to - *from).perp_dot(point - *from) > 0.0)
}
