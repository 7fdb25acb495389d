//! Layers: facets that lie on one another in one plane and face the same way.
//!
//! Facets of one plane do not block each other, so each layer would take the light of the one in front, and reflect it once
//! more. Only one of them is lit at each point: opaque facets go before translucent ones, those that emit before those that do
//! not, and then the first in the file goes first. What lies under it is cut away.

use glam::{DVec2, DVec3};
use rayon::prelude::*;
use smallvec::SmallVec;

use crate::facet::{Corner, Facet};
use crate::frame::Frame;
use crate::model::Surface;
use kernel::geometry::area_vector;
use tree::Tree;

mod tree;

/// Most pieces of one facet. Beyond it, pieces are kept or dropped whole, by where their middle lies.
const MOST_PIECES: usize = 256;

/// Opacity above which a facet counts as opaque: means of textures are rounded.
const OPAQUE: f64 = 1.0 - 1e-6;

/// Corners in the coordinates of a plane.
type Outline = SmallVec<[DVec2; 6]>;

/// A facet by its surface and its number there.
#[derive(Debug, Clone, Copy)]
struct Place {
    surface: u32,
    facet: u32,
}

/// What is left of a facet under others.
struct Cut {
    place: Place,
    /// Surface of the first facet that covers it.
    under: u32,
    pieces: Vec<Vec<Corner>>,
}

/// Cuts away what lies under other facets, and returns warnings that name it. Planes must be assigned; overlaps narrower than the
/// `tolerance`, in frame units, are left alone.
pub(super) fn cut(surfaces: &mut [Surface], planes: u32, tolerance: f64, frame: &Frame) -> Vec<String> {
    let mut cuts: Vec<Cut> = by_plane(surfaces, planes)
        .par_chunk_by(|a, b| a.0 == b.0)
        .flat_map_iter(|plane| cuts_in_plane(surfaces, plane, tolerance))
        .collect();
    if cuts.is_empty() {
        return vec![];
    }
    cuts.sort_unstable_by_key(|cut| (cut.place.surface, cut.place.facet));
    let warnings = describe(surfaces, &cuts, frame.scale * frame.scale);
    let mut cuts = cuts.into_iter().peekable();
    while let Some(Cut { place: Place { surface, .. }, .. }) = cuts.peek() {
        let surface = *surface;
        let own = std::iter::from_fn(|| cuts.next_if(|cut| cut.place.surface == surface));
        apply(&mut surfaces[surface as usize], own);
    }
    warnings
}

/// The facets that share their plane, plane by plane.
fn by_plane(surfaces: &[Surface], planes: u32) -> Vec<(u32, Place)> {
    let places = || {
        surfaces.iter().enumerate().flat_map(|(surface, of)| {
            let place = move |facet: usize| Place { surface: surface as u32, facet: facet as u32 };
            of.facets.iter().enumerate().map(move |(index, facet)| (facet.plane.0, place(index)))
        })
    };
    let mut counts = vec![0_u32; planes as usize];
    places().for_each(|(plane, _)| counts[plane as usize] += 1);
    let mut shared: Vec<(u32, Place)> = places().filter(|(plane, _)| counts[*plane as usize] > 1).collect();
    // Stable: in the order of the file within a plane.
    shared.par_sort_by_key(|(plane, _)| *plane);
    shared
}

/// The cuts among the facets of a plane.
fn cuts_in_plane(surfaces: &[Surface], plane: &[(u32, Place)], tolerance: f64) -> Vec<Cut> {
    let facet = |place: &Place| &surfaces[place.surface as usize].facets[place.facet as usize];
    let Some((_, first)) = plane.first() else { return vec![] };
    let normal = facet(first).normal;
    let places = plane.iter().map(|(_, place)| *place);
    let (there, back): (Vec<Place>, Vec<Place>) =
        places.partition(|place| facet(place).normal.dot(normal) >= 0.0);
    let mut cuts = cuts_among(surfaces, there, normal, tolerance);
    cuts.extend(cuts_among(surfaces, back, -normal, tolerance));
    cuts
}

/// The cuts among facets of a plane that face the same way, given in the order of the file.
fn cuts_among(surfaces: &[Surface], mut places: Vec<Place>, normal: DVec3, tolerance: f64) -> Vec<Cut> {
    if places.len() < 2 {
        return vec![];
    }
    let facet = |place: &Place| &surfaces[place.surface as usize].facets[place.facet as usize];
    places.sort_by_cached_key(|place| rank(&surfaces[place.surface as usize], place.facet));
    let axes = Axes::new(normal);
    let hulls: Vec<Outline> = places
        .par_iter()
        .map(|place| hull(facet(place).positions().map(|corner| axes.project(corner)).collect()))
        .collect();
    let tree = Tree::new(&hulls, tolerance);
    let lies_under =
        |own: usize| tree.any_before(own, |other| !are_apart(&hulls[own], &hulls[other], tolerance));
    let under: Vec<usize> = (0..places.len()).into_par_iter().filter(|own| lies_under(*own)).collect();
    let mut is_hidden = vec![false; places.len()];
    let mut cuts = vec![];
    for own in under {
        // What lies under a hidden facet lies under those that hide it, too.
        let mut covers: Vec<usize> = vec![];
        tree.any_before(own, |other| {
            if !is_hidden[other] && !are_apart(&hulls[own], &hulls[other], tolerance) {
                covers.push(other);
            }
            false
        });
        let Some(first) = covers.iter().min() else { continue };
        let under = places[*first].surface;
        // Large ones first: they leave fewer pieces.
        covers.sort_by(|a, b| area(&hulls[*b]).total_cmp(&area(&hulls[*a])).then(a.cmp(b)));
        let covers: Vec<&[DVec2]> = covers.iter().map(|other| hulls[*other].as_slice()).collect();
        let pieces = subtract(facet(&places[own]).corners.clone(), &covers, &axes, tolerance);
        is_hidden[own] = pieces.is_empty();
        cuts.push(Cut { place: places[own], under, pieces });
    }
    cuts
}

/// Which facets go first, whatever their order: opaque ones, and of these the ones that emit.
fn rank(surface: &Surface, index: u32) -> (bool, bool) {
    if surface.opacity >= 1.0 && surface.exitance == DVec3::ZERO {
        return (false, true);
    }
    let corners: Vec<DVec3> = surface.facets[index as usize].positions().collect();
    let is_opaque = surface.opacity >= 1.0 || surface.mean_opacity(index, &corners) >= OPAQUE;
    let emits = surface.exitance != DVec3::ZERO && surface.mean_exitance(index, &corners) != DVec3::ZERO;
    (!is_opaque, !emits)
}

/// What is left of a convex polygon under convex ones.
fn subtract(corners: Vec<Corner>, covers: &[&[DVec2]], axes: &Axes, tolerance: f64) -> Vec<Vec<Corner>> {
    let mut pieces = vec![corners];
    for (index, cover) in covers.iter().enumerate() {
        let mut left = Vec::with_capacity(pieces.len());
        for piece in pieces {
            let outline: Outline = piece.iter().map(|corner| axes.project(corner.position)).collect();
            if are_apart(&hull(outline), cover, tolerance) {
                left.push(piece);
            } else {
                subtract_one(piece, cover, axes, tolerance, &mut left);
            }
        }
        pieces = left;
        if pieces.len() > MOST_PIECES {
            let is_covered = |piece: &Vec<Corner>| {
                let middle = piece.iter().map(|corner| corner.position).sum::<DVec3>() / piece.len() as f64;
                covers[index + 1..].iter().any(|cover| holds(cover, axes.project(middle)))
            };
            pieces.retain(|piece| !is_covered(piece));
            break;
        }
        if pieces.is_empty() {
            break;
        }
    }
    pieces
}

/// Adds the parts of a convex polygon outside of another. Parts narrower than the tolerance are dropped.
fn subtract_one(
    piece: Vec<Corner>,
    cover: &[DVec2],
    axes: &Axes,
    tolerance: f64,
    left: &mut Vec<Vec<Corner>>,
) {
    let mut rest = piece;
    for (from, to) in edges(cover) {
        let height = |corner: &Corner| {
            let height = height(from, to, axes.project(corner.position));
            // What is nearly on the line is on it: no sliver, and corners stay where they are.
            if height.abs() <= tolerance { 0.0 } else { height }
        };
        let heights: SmallVec<[f64; 8]> = rest.iter().map(height).collect();
        if heights.iter().all(|height| *height >= 0.0) {
            continue;
        }
        let (inside, outside) = split(&rest, &heights);
        if !is_sliver(&outside, tolerance) {
            left.push(outside);
        }
        rest = inside;
        if rest.is_empty() {
            break;
        }
    }
}

/// The parts of a convex polygon where the height is not negative, and where it is not positive.
fn split(corners: &[Corner], heights: &[f64]) -> (Vec<Corner>, Vec<Corner>) {
    let (mut above, mut below) = (vec![], vec![]);
    let Some(last) = corners.len().checked_sub(1) else { return (above, below) };
    let (mut from, mut from_height) = (corners[last], heights[last]);
    for (&corner, &height) in corners.iter().zip(heights) {
        if from_height * height < 0.0 {
            let part = from_height / (from_height - height);
            let normal = from.normal.lerp(corner.normal, part);
            let cut = Corner {
                position: from.position.lerp(corner.position, part),
                normal: if from.normal == corner.normal {
                    from.normal
                } else {
                    normal.normalize_or(from.normal)
                },
            };
            above.push(cut);
            below.push(cut);
        }
        if height >= 0.0 {
            above.push(corner);
        }
        if height <= 0.0 {
            below.push(corner);
        }
        (from, from_height) = (corner, height);
    }
    // A part that only touches the line has no area.
    let has_area = |sign: f64| heights.iter().any(|height| height * sign > 0.0);
    if !has_area(1.0) || above.len() < 3 {
        above.clear();
    }
    if !has_area(-1.0) || below.len() < 3 {
        below.clear();
    }
    (above, below)
}

/// Whether a polygon is narrower than the tolerance.
fn is_sliver(corners: &[Corner], tolerance: f64) -> bool {
    let positions: SmallVec<[DVec3; 8]> = corners.iter().map(|corner| corner.position).collect();
    let apart = |a: &DVec3| positions.iter().map(|b| a.distance(*b)).fold(0.0, f64::max);
    let diameter = positions.iter().map(apart).fold(0.0, f64::max);
    area_vector(&positions).length() <= tolerance * diameter
}

/// Replaces the facets that were cut.
fn apply(surface: &mut Surface, cuts: impl Iterator<Item = Cut>) {
    let mut cuts = cuts.peekable();
    let mut facets = Vec::with_capacity(surface.facets.len());
    for (index, facet) in (0..).zip(std::mem::take(&mut surface.facets)) {
        match cuts.next_if(|cut| cut.place.facet == index) {
            None => facets.push(facet),
            Some(cut) => facets.extend(cut.pieces.into_iter().map(|corners| piece_of(&facet, corners))),
        }
    }
    surface.facets = facets;
    if let Some(appearance) = &surface.appearance {
        surface.appearance = Some(appearance.of_pieces(&surface.facets).into());
    }
}

/// A piece of a facet, with those of its triangles that it may lie in.
fn piece_of(facet: &Facet, corners: Vec<Corner>) -> Facet {
    let around = |points: &mut dyn Iterator<Item = DVec3>| {
        let start = (DVec3::splat(f64::INFINITY), DVec3::splat(f64::NEG_INFINITY));
        points.fold(start, |(low, high), point| (low.min(point), high.max(point)))
    };
    let (low, high) = around(&mut corners.iter().map(|corner| corner.position));
    let mut triangles = facet.triangles.clone();
    triangles.retain(|triangle| {
        let (from, to) = around(&mut triangle.positions.iter().copied());
        from.cmple(high).all() && to.cmpge(low).all()
    });
    if triangles.is_empty() {
        triangles.clone_from(&facet.triangles);
    }
    Facet { corners, triangles, ..facet.clone() }
}

/// Warnings that name what was cut away, in square units of the file.
fn describe(surfaces: &[Surface], cuts: &[Cut], square_unit: f64) -> Vec<String> {
    struct Named<'a> {
        name: &'a str,
        by: &'a str,
        facets: usize,
        area: f64,
    }
    let mut named: Vec<Named> = vec![];
    for cut in cuts {
        let surface = &surfaces[cut.place.surface as usize];
        let area = |corners: &[Corner]| {
            let positions: Vec<DVec3> = corners.iter().map(|corner| corner.position).collect();
            area_vector(&positions).length() * square_unit
        };
        let whole = area(&surface.facets[cut.place.facet as usize].corners);
        let hidden = whole - cut.pieces.iter().map(|piece| area(piece)).sum::<f64>();
        match named.last_mut().filter(|last| last.name == surface.name) {
            Some(last) => {
                last.facets += 1;
                last.area += hidden;
            }
            None => named.push(Named {
                name: &surface.name,
                by: &surfaces[cut.under as usize].name,
                facets: 1,
                area: hidden,
            }),
        }
    }
    let warnings = named
        .iter()
        .map(|Named { name, by, facets, area }| {
            let facets = if *facets == 1 { "1 facet".to_owned() } else { format!("{facets} facets") };
            format!("{name}: {area:.3e} square units in {facets} cut away: another facet covers them in the same plane, first {by}")
        })
        .collect();
    document::first_warnings(warnings, "primitives with parts cut away under coplanar facets")
}

/// Coordinates of a plane.
struct Axes(DVec3, DVec3);

impl Axes {
    fn new(normal: DVec3) -> Self {
        let (u, v) = normal.any_orthonormal_pair();
        // Counter-clockwise must stay so.
        if u.cross(v).dot(normal) > 0.0 { Self(u, v) } else { Self(v, u) }
    }

    fn project(&self, point: DVec3) -> DVec2 {
        DVec2::new(self.0.dot(point), self.1.dot(point))
    }
}

/// The convex hull, counter-clockwise, by Andrew's monotone chain. Facets are convex up to rounding; the line through an edge of a
/// hull cuts off nothing, however short the edge.
fn hull(mut points: Outline) -> Outline {
    points.sort_unstable_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    points.dedup();
    if points.len() < 3 {
        return points;
    }
    let mut hull = Outline::new();
    let mut add = |points: &mut dyn Iterator<Item = &DVec2>| {
        let start = hull.len();
        for point in points {
            while let [.., a, b] = &hull[start..]
                && (*b - *a).perp_dot(*point - *b) <= 0.0
            {
                hull.pop();
            }
            hull.push(*point);
        }
        hull.pop();
    };
    add(&mut points.iter());
    add(&mut points.iter().rev());
    hull
}

fn edges(outline: &[DVec2]) -> impl Iterator<Item = (DVec2, DVec2)> + '_ {
    (0..outline.len()).map(|i| (outline[i], outline[(i + 1) % outline.len()]))
}

/// Distance of a point from a line, positive to its left.
fn height(from: DVec2, to: DVec2, point: DVec2) -> f64 {
    (to - from).perp_dot(point - from) / to.distance(from)
}

/// Whether two convex polygons overlap by no more than the tolerance, across an edge of either.
fn are_apart(a: &[DVec2], b: &[DVec2], tolerance: f64) -> bool {
    let is_outside = |of: &[DVec2], other: &[DVec2]| {
        edges(of).any(|(from, to)| other.iter().all(|point| height(from, to, *point) <= tolerance))
    };
    is_outside(a, b) || is_outside(b, a)
}

fn holds(outline: &[DVec2], point: DVec2) -> bool {
    edges(outline).all(|(from, to)| height(from, to, point) >= 0.0)
}

/// Twice the area of a polygon.
fn area(outline: &[DVec2]) -> f64 {
    edges(outline).map(|(from, to)| from.perp_dot(to)).sum()
}

#[cfg(test)]
mod tests;
