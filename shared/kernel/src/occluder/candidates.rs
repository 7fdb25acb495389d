//! Candidate lists: the occluders between a group of points and a polygon.

use std::ops::Range;

use glam::DVec3;
use smallvec::SmallVec;

use super::boxes::{Boxes, HalfSpace};
use super::{Body, Occluder, OccluderPolygon, Pyramids, Reach, Shaft};
use crate::form_factor::PreparedPolygon;
use crate::geometry::lanes::{LANES, Mask};
use crate::geometry::{Bounds, PlaneId, clip};

/// Occluders that can block something of a polygon, as far as they stand in front of its plane.
#[derive(Debug, Default)]
pub struct CandidateList {
    parts: Vec<Part>,
    /// Around each part.
    boxes: Boxes,
    /// The parts that are near the points at hand, and their boxes.
    near: Vec<u32>,
    near_boxes: Boxes,
    corners: Vec<DVec3>,
    found: Vec<u32>,
    bodies: Vec<u32>,
    /// Plane of the polygon.
    plane: PlaneId,
}

/// An occluder in front of the polygon's plane.
#[derive(Debug, Clone)]
enum Part {
    /// A polygon, or as much of it as stands in front.
    Polygon { occluder: u32, corners: Range<usize> },
    /// A convex body, all of it in front.
    Body(u32),
}

/// An occluder, whatever polygon it stands before.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Identity {
    /// A polygon.
    Polygon(u32),
    /// A convex body.
    Body(u32),
}

/// An occluder as the blocker of one point's view.
#[derive(Debug)]
pub enum Blocker<'a> {
    /// A polygon with these corners.
    Polygon(&'a [DVec3]),
    /// The outline of a body that the point is outside of.
    Outline(&'a Body),
}

/// Corners of a part, given those of all polygons.
fn corners_of<'a>(part: &Part, corners: &'a [DVec3], occluder: &'a Occluder) -> &'a [DVec3] {
    match part {
        Part::Polygon { corners: range, .. } => &corners[range.clone()],
        Part::Body(number) => &occluder.bodies[*number as usize].corners,
    }
}

impl CandidateList {
    /// Looks for the occluders that can stand between the points in a box and a polygon: all that are not in its plane, in the order
    /// of the occluders.
    pub fn collect(&mut self, occluder: &Occluder, group: &Bounds, polygon: &PreparedPolygon) {
        let target = Bounds::around(polygon.corners());
        let mut found = std::mem::take(&mut self.found);
        occluder.candidates(&Shaft::new(group, &target, 0.0), &mut found);
        self.take(occluder, &found, polygon);
        self.found = found;
    }

    /// Takes these occluders, in ascending order.
    pub fn take(&mut self, occluder: &Occluder, found: &[u32], polygon: &PreparedPolygon) {
        self.parts.clear();
        self.corners.clear();
        self.bodies.clear();
        self.plane = polygon.plane();
        let over_plane = |corner: &DVec3| polygon.normal().dot(*corner - polygon.corners()[0]);
        for index in found {
            let face = &occluder.polygons[*index as usize];
            if let Some(number) = face.body {
                let body = &occluder.bodies[number as usize];
                let heights = body.corners.iter().map(over_plane);
                let (low, high) = heights.fold((f64::MAX, f64::MIN), |(l, h), x| (l.min(x), h.max(x)));
                if high <= body.rounding {
                    continue;
                }
                if low >= -body.rounding {
                    if !self.bodies.contains(&number) {
                        self.bodies.push(number);
                        self.parts.push(Part::Body(number));
                    }
                    continue;
                }
            }
            if face.plane != polygon.plane() {
                self.add_polygon(*index, face, over_plane);
            }
        }
        // Which face of a body is found first is the group's matter; what is cut out first must not be.
        self.parts.sort_unstable_by_key(|part| match part {
            Part::Polygon { occluder, .. } => *occluder,
            Part::Body(number) => occluder.bodies[*number as usize].faces[0],
        });
        self.near.clear();
        self.near_boxes.clear();
        self.boxes.clear();
        for part in &self.parts {
            let bounds = Bounds::around(corners_of(part, &self.corners, occluder));
            self.boxes.push(&match part {
                Part::Polygon { .. } => bounds,
                Part::Body(number) => bounds.padded(DVec3::splat(occluder.bodies[*number as usize].rounding)),
            });
        }
    }

    fn add_polygon(&mut self, index: u32, face: &OccluderPolygon, over_plane: impl Fn(&DVec3) -> f64) {
        let heights: SmallVec<[f64; 8]> = face.corners.iter().map(over_plane).collect();
        let start = self.corners.len();
        if heights.iter().all(|height| *height >= 0.0) {
            self.corners.extend_from_slice(&face.corners);
        } else {
            self.corners.extend(clip(&face.corners, &heights));
        }
        if self.corners.len() > start {
            self.parts.push(Part::Polygon { occluder: index, corners: start..self.corners.len() });
        }
    }

    /// Finds the parts whose boxes are not outside of a shaft, for [`Self::narrow`]. Returns true if there are any.
    pub fn approach(&mut self, shaft: &Shaft) -> bool {
        let spaces: SmallVec<[HalfSpace; 20]> = shaft.half_spaces().collect();
        self.boxes.inside(&spaces, &mut self.near);
        self.near_boxes.take(&self.boxes, &self.near);
        !self.near.is_empty()
    }

    /// The parts, of those that were approached last, that can lie between any two points of the shaft's boxes, and rise over the horizon of points
    /// with this normal, none of which is lower along it than `lowest`.
    pub fn narrow(
        &self,
        occluder: &Occluder,
        shaft: &Shaft,
        horizon: Option<(DVec3, f64)>,
        parts: &mut Vec<u32>,
    ) {
        let mut spaces: SmallVec<[HalfSpace; 20]> = shaft.half_spaces().collect();
        spaces.extend(horizon);
        self.near_boxes.inside(&spaces, parts);
        parts.iter_mut().for_each(|part| *part = self.near[*part as usize]);
        parts.retain(|part| {
            let corners = corners_of(&self.parts[*part as usize], &self.corners, occluder);
            let is_over = |(normal, lowest): (DVec3, f64)| corners.iter().any(|c| normal.dot(*c) > lowest);
            horizon.is_none_or(is_over) && shaft.meets(corners)
        });
    }

    /// Number of parts.
    #[must_use]
    pub fn len(&self) -> usize {
        self.parts.len()
    }

    /// Which occluder a part is of; bodies go by their number.
    #[must_use]
    pub fn identity(&self, part: u32) -> Identity {
        match &self.parts[part as usize] {
            Part::Polygon { occluder, .. } => Identity::Polygon(*occluder),
            Part::Body(body) => Identity::Body(*body),
        }
    }

    /// The part of an occluder, where there is one.
    #[must_use]
    pub fn part_of(&self, identity: Identity) -> Option<u32> {
        (0..self.parts.len() as u32).find(|part| self.identity(*part) == identity)
    }

    /// True when nothing was found.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.parts.is_empty()
    }

    /// The faces of a body that are not in the polygon's plane.
    fn faces<'a>(&self, occluder: &'a Occluder, body: &'a Body) -> impl Iterator<Item = &'a u32> {
        let plane = self.plane;
        body.faces.iter().filter(move |face| occluder.polygons[**face as usize].plane != plane)
    }

    /// What a part does to the pyramids between some receivers and the polygon. Occluders in a receiver's own plane, given by
    /// `planes`, do not count.
    #[must_use]
    pub fn reach(
        &self,
        occluder: &Occluder,
        part: u32,
        pyramids: &Pyramids,
        planes: &[PlaneId; LANES],
    ) -> Reach {
        let of_polygon = |index: u32, corners: &[DVec3]| {
            let polygon = &occluder.polygons[index as usize];
            let reach = pyramids.reach(polygon, corners);
            let plane = |i: usize| Mask::from(planes[i] != polygon.plane) << i;
            let others = (0..LANES).map(plane).sum::<Mask>();
            Reach { partly: reach.partly & others, wholly: reach.wholly & others }
        };
        match &self.parts[part as usize] {
            Part::Polygon { occluder: index, corners } => of_polygon(*index, &self.corners[corners.clone()]),
            Part::Body(number) => {
                let body = &occluder.bodies[*number as usize];
                let (mut reach, outside) = pyramids.reach_body(body);
                if outside != Mask::MAX {
                    // Points on the body: its outline is not what they see of it.
                    for face in self.faces(occluder, body) {
                        let of_face = of_polygon(*face, &occluder.polygons[*face as usize].corners);
                        reach.partly |= of_face.partly & !outside;
                        reach.wholly |= of_face.wholly & !outside;
                    }
                    reach.partly &= !reach.wholly;
                }
                reach
            }
        }
    }

    /// Calls `block` with all that a part puts before a point that lies in a plane.
    pub fn for_each_blocker<'a>(
        &'a self,
        occluder: &'a Occluder,
        part: u32,
        (point, plane): (DVec3, PlaneId),
        mut block: impl FnMut(Blocker<'a>),
    ) {
        match &self.parts[part as usize] {
            Part::Polygon { corners, .. } => block(Blocker::Polygon(&self.corners[corners.clone()])),
            Part::Body(number) => {
                let body = &occluder.bodies[*number as usize];
                if body.is_outside(point) {
                    block(Blocker::Outline(body));
                } else {
                    for face in self.faces(occluder, body) {
                        let face = &occluder.polygons[*face as usize];
                        if face.plane != plane && !face.is_edge_on(point) {
                            block(Blocker::Polygon(&face.corners));
                        }
                    }
                }
            }
        }
    }
}
