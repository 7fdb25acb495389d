//! Lights that are no surface: names, places and flux. What the program knows of a kind of light before it is baked stands
//! here and in the import; every match lists all kinds, so that a new one does not compile until it is complete.

use std::f64::consts::{PI, TAU};
use std::fmt::{self, Display, Formatter};

use document::EXT_LIGHTS_AREA;
use glam::DVec3;
use gltf::json::Root;
use kernel::geometry::{ConvexPolygon, PlaneId};
use kernel::row::Spot;
use serde_json::{Value, json};

use crate::frame::Frame;

/// Radiance of an area light of the draft that states none.
pub(crate) const DEFAULT_LUMINANCE: f32 = 1000.0;

/// Sides of the polygon that stands for a disk. Its area is the disk's: so the flux is exact, and what is left of the outline is a
/// ripple of 64 periods, whose effect dies out within a few tenths of the radius. There a form factor is off by 4e-7 at most, on the
/// axis by 7e-8; the kernel rounds those of its rows to 1e-4.
const DISK_SIDES: u32 = 64;

/// Farthest that a corner of an area light may be from the middle of the scene, frame units: 2^29 times the scene's size, as
/// far as workers read coordinates.
const FARTHEST: f64 = (1_u64 << 40) as f64;

/// Part of an area light's area that rounding may change. More, and the light is too small for where it stands.
const AREA_DOUBT: f64 = 1e-3;

/// A light that is no surface.
#[derive(Debug, Clone)]
pub struct Light {
    /// Index of the node in the source document.
    pub node: usize,
    /// For messages: node name or index.
    pub name: String,
    /// Where it is and where it shines.
    pub kind: LightKind,
    /// Strength in file units. Point and spot lights: radiant intensity, W/sr (or candela). Directional lights: irradiance of a
    /// surface across them, W/m^2 (or lux). Area lights: radiance, W/(m^2 sr) (or cd/m^2).
    pub intensity: DVec3,
    /// Where the document keeps it.
    pub entry: LightEntry,
}

/// The kinds of lights that are no surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LightKind {
    /// Shines into all directions alike.
    Point {
        /// Position in the frame.
        position: DVec3,
    },
    /// Shines into a cone, with full intensity on its axis.
    Spot(Spot),
    /// Comes from infinitely far.
    Directional {
        /// Unit vector along which the light travels.
        along: DVec3,
    },
    /// Shines from the front of a flat shape, from all of it alike, and neither blocks nor reflects light. Experimental:
    /// `EXT_lights_area` is a draft.
    Area(AreaLight),
}

/// A flat shape that shines to its front.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AreaLight {
    /// The outline.
    pub shape: AreaShape,
    /// Middle, in the frame.
    pub centre: DVec3,
    /// From the middle of a rectangle to the middle of a side; from that of a disk to its rim. Frame units.
    pub across: DVec3,
    /// The same, at right angles: `across` x `along` points to the front.
    pub along: DVec3,
    /// Plane that it lies in.
    pub plane: PlaneId,
}

/// Outlines of area lights.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AreaShape {
    /// A rectangle.
    Rectangle,
    /// A disk.
    Disk,
}

impl Light {
    /// The flux that the light sends out: intensity times the solid angle that it fills, for area lights pi times radiance times
    /// area. Zero for one that is infinitely far: only what falls on the scene counts, and that is known from its row.
    #[must_use]
    pub fn flux(&self, frame: &Frame) -> DVec3 {
        match self.kind {
            LightKind::Point { .. } => self.intensity * 4.0 * PI,
            LightKind::Spot(spot) => self.intensity * spot.solid_angle(),
            LightKind::Directional { .. } => DVec3::ZERO,
            LightKind::Area(area) => self.intensity * (PI * area.area() * frame.scale * frame.scale),
        }
    }
}

impl LightKind {
    /// Name in the import report, in the singular, after its place in the report's order.
    #[must_use]
    pub fn noun(&self) -> (u8, &'static str) {
        match self {
            Self::Point { .. } => (0, "point light"),
            Self::Spot(_) => (1, "spot light"),
            Self::Directional { .. } => (2, "directional light"),
            Self::Area(AreaLight { shape: AreaShape::Rectangle, .. }) => (3, "rectangular area light"),
            Self::Area(AreaLight { shape: AreaShape::Disk, .. }) => (4, "disk area light"),
        }
    }

    /// Where it stands, in the frame; `None` of one that is infinitely far.
    #[must_use]
    pub fn position(&self) -> Option<DVec3> {
        match self {
            Self::Point { position } | Self::Spot(Spot { position, .. }) => Some(*position),
            Self::Directional { .. } => None,
            Self::Area(area) => Some(area.centre),
        }
    }

    /// Points whose convex hull holds all places that its light leaves from, in the frame; none of one that is infinitely far.
    #[must_use]
    pub fn extremes(&self) -> Vec<DVec3> {
        match self {
            Self::Point { position } | Self::Spot(Spot { position, .. }) => vec![*position],
            Self::Directional { .. } => vec![],
            Self::Area(area) => area.polygon().corners,
        }
    }

    /// The direction that its light comes from, if it is infinitely far: then only what falls on the scene counts as its flux.
    #[must_use]
    pub fn from_far(&self) -> Option<DVec3> {
        match self {
            Self::Directional { along } => Some(-*along),
            Self::Point { .. } | Self::Spot(_) | Self::Area(_) => None,
        }
    }

    /// True where the numbers are ones that rows can be computed of.
    #[must_use]
    pub fn is_valid(&self) -> bool {
        match self {
            Self::Point { position } => position.is_finite(),
            Self::Spot(spot) => {
                spot.position.is_finite()
                    && spot.direction.is_normalized()
                    && (0.0..=spot.inner_cosine).contains(&spot.outer_cosine)
            }
            Self::Directional { along } => along.is_normalized(),
            Self::Area(area) => area.is_valid(),
        }
    }

    /// The kind with positions of the world moved to the frame.
    pub(crate) fn to_frame(self, frame: &Frame) -> Self {
        match self {
            Self::Point { position } => Self::Point { position: frame.to_frame(position) },
            Self::Spot(spot) => Self::Spot(Spot { position: frame.to_frame(spot.position), ..spot }),
            Self::Directional { .. } => self,
            Self::Area(area) => Self::Area(AreaLight {
                centre: frame.to_frame(area.centre),
                across: area.across / frame.scale,
                along: area.along / frame.scale,
                ..area
            }),
        }
    }

    /// The flat shape that it is, if it is one: for the planes of the scene.
    pub(crate) fn flat_mut(&mut self) -> Option<&mut AreaLight> {
        match self {
            Self::Area(area) => Some(area),
            Self::Point { .. } | Self::Spot(_) | Self::Directional { .. } => None,
        }
    }
}

impl AreaLight {
    /// Unit normal of the side that shines; zero of a light without area.
    #[must_use]
    pub fn normal(&self) -> DVec3 {
        self.across.cross(self.along).normalize_or_zero()
    }

    /// Area, in squared frame units.
    #[must_use]
    pub fn area(&self) -> f64 {
        let quarter = self.across.cross(self.along).length();
        match self.shape {
            AreaShape::Rectangle => 4.0 * quarter,
            AreaShape::Disk => PI * quarter,
        }
    }

    /// The polygon that it shines from: for a disk one of the same area.
    #[must_use]
    pub fn polygon(&self) -> ConvexPolygon {
        let at = |across: f64, along: f64| self.centre + self.across * across + self.along * along;
        let corners = match self.shape {
            AreaShape::Rectangle => {
                [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| at(x, y)).to_vec()
            }
            AreaShape::Disk => {
                let turn = TAU / f64::from(DISK_SIDES);
                let radius = (turn / turn.sin()).sqrt();
                let corner = |index: u32| {
                    let (sine, cosine) = (f64::from(index) * turn).sin_cos();
                    at(radius * cosine, radius * sine)
                };
                (0..DISK_SIDES).map(corner).collect()
            }
        };
        ConvexPolygon { plane: self.plane, corners }
    }

    fn is_valid(&self) -> bool {
        let polygon = self.polygon();
        let (expected, area) = (self.normal() * self.area(), polygon.area_vector());
        let is_near = polygon.corners.iter().all(|corner| corner.abs().max_element() <= FARTHEST);
        // Not the other way round: no comparison holds of what is no number.
        is_near && expected.length() > 0.0 && area.distance(expected) <= AREA_DOUBT * expected.length()
    }
}

/// Where a document keeps a light. Nodes that share one share its brightness and colour.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum LightEntry {
    /// Index among the lights of `KHR_lights_punctual`.
    Punctual(usize),
    /// Index among the lights of `EXT_lights_area`.
    Area(usize),
}

impl Display for LightEntry {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Self::Punctual(index) => write!(formatter, "light {index}"),
            Self::Area(index) => write!(formatter, "area light {index}"),
        }
    }
}

impl LightEntry {
    /// Multiplies the light's brightness and colour in the document.
    pub fn multiply(self, root: &mut Root, factor: DVec3) {
        let Some(extensions) = root.extensions.as_mut() else { return };
        match self {
            Self::Punctual(index) => {
                let lights = extensions.khr_lights_punctual.as_mut();
                let Some(light) = lights.and_then(|lights| lights.lights.get_mut(index)) else { return };
                let (colour, above) = colour_and_rest(light.color, factor);
                light.color = colour;
                light.intensity *= above;
            }
            Self::Area(index) => {
                let lights = extensions.others.get_mut(EXT_LIGHTS_AREA);
                let light = lights.and_then(|lights| lights.get_mut("lights")?.get_mut(index));
                let Some(light) = light.and_then(Value::as_object_mut) else { return };
                let number = |value: &Value| value.as_f64().map(|value| value as f32);
                let part = |axis: usize| light.get("color").and_then(|colour| number(colour.get(axis)?));
                let before = [0, 1, 2].map(|axis| part(axis).unwrap_or(1.0));
                let intensity = light.get("intensity").and_then(number).unwrap_or(DEFAULT_LUMINANCE);
                let (colour, above) = colour_and_rest(before, factor);
                light.insert("color".into(), json!(colour));
                light.insert("intensity".into(), json!(intensity * above));
            }
        }
    }
}

/// A colour times a factor: at most 1, and what it must be multiplied by.
#[must_use]
pub fn colour_and_rest(colour: [f32; 3], factor: DVec3) -> ([f32; 3], f32) {
    let colour = DVec3::from_array(colour.map(f64::from)) * factor;
    let above = colour.max_element().max(1.0);
    ((colour / above).as_vec3().to_array(), above as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn light(shape: AreaShape) -> AreaLight {
        let (across, along) = (DVec3::X * 3.0, DVec3::Z * -3.0);
        AreaLight { shape, centre: DVec3::splat(7.0), across, along, plane: PlaneId(0) }
    }

    #[test]
    fn polygons_have_the_area_of_the_light_and_face_its_front() {
        for (shape, area) in [(AreaShape::Rectangle, 36.0), (AreaShape::Disk, 9.0 * PI)] {
            let light = light(shape);
            assert_eq!(light.area(), area);
            assert!(light.polygon().area_vector().distance(DVec3::Y * area) <= 1e-12 * area);
            assert_eq!(light.normal(), DVec3::Y);
            assert!(LightKind::Area(light).is_valid());
        }
    }

    #[test]
    fn lights_too_small_or_far_for_their_numbers_are_not_valid() {
        let of = |part: AreaLight| LightKind::Area(part).is_valid();
        let own = light(AreaShape::Disk);
        for length in [0.0, 1e-200, 1e-16, f64::NAN, 1e20, f64::INFINITY] {
            assert!(
                !of(AreaLight { across: DVec3::X * length, along: DVec3::Z * -length, ..own }),
                "{length}"
            );
        }
        assert!(!of(AreaLight { centre: DVec3::X * 1e13, ..own }));
        assert!(of(AreaLight { centre: DVec3::X * 1e5, ..own }));
    }
}
