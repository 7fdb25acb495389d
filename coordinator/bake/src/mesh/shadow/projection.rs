use scene::Facet;

use super::silhouettes::Silhouette;
use super::source::Source;
use super::{Contact, WELD};
use crate::mesh::line::narrow;

/// An edge this near to the light's own height over a plane, relative to it, has its shadow infinitely far.
const LEVEL: f64 = 1e-6;

/// Where an edge meets a facet.
pub enum Shadow {
    /// Its shadow.
    Line(Contact),
    /// It lies on the facet, and shadows end there.
    Contact(Contact),
}

/// The shadow of an edge on a facet that faces the light; `None` where there is none, or the whole shadow on the facet's plane is
/// shorter than `shortest`.
pub fn shadow_on(source: &Source, edge: &Silhouette, facet: &Facet, shortest: f64) -> Option<Shadow> {
    let origin = facet.corners[0].position;
    let light = source.height_over(origin, facet.normal);
    if light.is_nan() || light <= WELD {
        return None;
    }
    let snapped = |height: f64| if height.abs() <= WELD { 0.0 } else { height };
    let heights = edge.ends.map(|end| snapped(facet.normal.dot(end - origin)));
    if heights == [0.0; 2] {
        return clipped(edge.ends, facet).map(Shadow::Contact);
    }
    // From the plane up to the light.
    let most = light * (1.0 - LEVEL);
    let mut part = (0.0, 1.0);
    for ends in [heights, heights.map(|height| most - height)] {
        if !narrow(&mut part, ends) {
            return None;
        }
    }
    let (from, to) = part;
    if from >= to {
        return None;
    }
    let shadow_at = |t: f64| {
        let height = heights[0] + (heights[1] - heights[0]) * t;
        source.shadow_of(edge.ends[0].lerp(edge.ends[1], t), height.max(0.0), facet.normal)
    };
    let whole = [shadow_at(from), shadow_at(to)];
    let is_long = whole[0].distance(whole[1]) >= shortest && whole.iter().all(|end| end.is_finite());
    if is_long { clipped(whole, facet).map(Shadow::Line) } else { None }
}

/// The part of a line within a facet, its border included.
fn clipped(line: Contact, facet: &Facet) -> Option<Contact> {
    let mut part = (0.0, 1.0);
    for (i, corner) in facet.corners.iter().enumerate() {
        let next = facet.corners[(i + 1) % facet.corners.len()].position;
        let inward = facet.normal.cross(next - corner.position).normalize_or_zero();
        let heights = line.map(|point| inward.dot(point - corner.position));
        let is_inside = heights.iter().all(|height| *height >= -WELD);
        if !is_inside && !narrow(&mut part, heights) {
            return None;
        }
    }
    let (from, to) = part;
    let part = [line[0].lerp(line[1], from), line[0].lerp(line[1], to)];
    (from < to && part[0].distance(part[1]) > 4.0 * WELD).then_some(part)
}
