//! Numbers that no light survives: parts far smaller than the scene, and lights far too bright for it.

use kernel::geometry::Bounds;

use super::PlacedPrimitive;
use super::lights::WorldLight;
use super::triangles::to_world;
use crate::frame::Frame;
use crate::light::LightKind;
use document::ImportProblem;

/// Part of the scene's extent below which a primitive is too small: within it, planes are one and points the same.
const LEAST_PART: f64 = 5e-8;

/// Extents of a scene in metres beyond which a scale was hardly meant.
const USUAL: std::ops::RangeInclusive<f64> = 1e-6..=1e9;

/// Most of irradiance, radiance or exitance, in the file's units: a thousand million million million times that of the sun, and
/// still a number when it is a million times closer.
pub(super) const MOST: f64 = 1e25;

/// The boxes of the primitives in the world, and what is out of proportion in them.
pub(super) struct Extents<'a> {
    primitives: &'a [PlacedPrimitive],
    boxes: &'a [Bounds],
    whole: f64,
}

impl<'a> Extents<'a> {
    /// The boxes belong to the primitives.
    pub(super) fn new(primitives: &'a [PlacedPrimitive], boxes: &'a [Bounds]) -> Self {
        let all = boxes.iter().fold(Bounds::EMPTY, |all, own| all.union(*own));
        Self { primitives, boxes, whole: extent(&all) }
    }

    /// Warns of primitives that are too small to be lit, and of a scene of an unusual size.
    ///
    /// # Errors
    /// When one that is too small emits light: it would be lost.
    pub(super) fn check(&self, warnings: &mut Vec<String>) -> Result<(), ImportProblem> {
        let mut small =
            self.primitives.iter().zip(self.boxes).filter(|(placed, own)| self.is_too_small(placed, own));
        let mut first = None;
        let mut others = 0usize;
        for (placed, own) in &mut small {
            if placed.pattern.exitance != glam::DVec3::ZERO {
                return Err(ImportProblem::TooSmall {
                    place: placed.name.clone(),
                    extent: extent(own),
                    whole: self.whole,
                    far: self.farthest(own),
                });
            }
            match first {
                None => first = Some((placed, own)),
                Some(_) => others += 1,
            }
        }
        if let Some((placed, own)) = first {
            let more = if others > 0 { format!(", as are {others} more") } else { String::new() };
            warnings.push(format!(
                "{}: is {:.1e} across in a scene of {:.1e}, too small to be lit{more}; check the scales and places of its node \
                 and of {}",
                placed.name,
                extent(own),
                self.whole,
                self.farthest(own)
            ));
        }
        if self.whole > 0.0 && !USUAL.contains(&self.whole) {
            let largest = self.boxes.iter().enumerate().max_by(|a, b| extent(a.1).total_cmp(&extent(b.1)));
            let name = largest.map_or("its nodes", |(index, _)| &self.primitives[index].name);
            warnings.push(format!(
                "the scene is {:.1e} m across, which was hardly meant: check the scale of {name}",
                self.whole
            ));
        }
        Ok(())
    }

    /// Whether a primitive with an extent of its own has next to none in the scene.
    fn is_too_small(&self, placed: &PlacedPrimitive, own: &Bounds) -> bool {
        let least = LEAST_PART * self.whole;
        extent(own) < least && {
            let used = placed.geometry.triangles.iter().flatten();
            let positions = || used.clone().map(|&vertex| placed.geometry.positions[vertex as usize]);
            let first = positions().next();
            // Welding on request is no mistake.
            let unwelded = Bounds::around(positions().map(|position| to_world(&placed.world, position)));
            extent(&unwelded) < least && positions().any(|position| Some(position) != first)
        }
    }

    /// The primitive that reaches farthest from a box.
    fn farthest(&self, from: &Bounds) -> String {
        let reach = |own: &Bounds| (own.high - from.low).max(from.high - own.low).max_element();
        let far = self.boxes.iter().enumerate().max_by(|a, b| reach(a.1).total_cmp(&reach(b.1)));
        far.map_or_else(String::new, |(index, _)| self.primitives[index].name.clone())
    }
}

fn extent(bounds: &Bounds) -> f64 {
    (bounds.high - bounds.low).max_element().max(0.0)
}

/// Checks that the irradiance of a light is a number wherever the scene is.
pub(super) fn check_light(light: &WorldLight, frame: &Frame) -> Result<(), ImportProblem> {
    let light = light.inner();
    let extent = 1024.0 * frame.scale;
    let brightest = light.intensity.max_element();
    let irradiance = match &light.kind {
        LightKind::Point { position } => Some(*position),
        LightKind::Spot(spot) => Some(spot.position),
        _ => None,
    }
    .map_or(brightest, |position| {
        let distance = (position.distance(frame.centre) - extent).max(extent);
        brightest / (distance * distance)
    });
    // The square of a small extent may be zero.
    if irradiance <= MOST || brightest == 0.0 {
        return Ok(());
    }
    Err(ImportProblem::TooBright { place: format!("the light of {}", light.name), value: irradiance })
}
