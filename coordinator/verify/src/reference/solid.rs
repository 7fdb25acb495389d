//! The triangles of a scene behind a bounding volume hierarchy.

use std::cmp::Reverse;

use glam::DVec3;
use kernel::geometry::Bounds;
use kernel::hierarchy::{Hierarchy, PaddedBox};

use super::hash::mix;
use crate::plain::{PlainMaterial, PlainScene, PlainTriangle};

/// How far rays start and end off surfaces, as a share of the scene's extent: some last places of the f32 that files hold, so
/// that surfaces meant to lie in one plane do not hide each other. Boxes are padded by as much.
pub(super) const CLEARANCE: f64 = 1.0 / (1 << 20) as f64;

/// The scene centred, with an extent of 1: rays meet boxes in f32.
#[derive(Clone, Copy)]
pub(super) struct Frame {
    centre: DVec3,
    /// World units per unit here.
    pub(super) scale: f64,
}

impl Frame {
    fn of(scene: &PlainScene) -> Self {
        let corners = scene.triangles.iter().flat_map(|triangle| triangle.corners);
        let Bounds { low, high } = Bounds::around(corners);
        Self { centre: low + (high - low) * 0.5, scale: (high - low).max_element() }
    }

    /// A world position in the frame.
    pub(super) fn place(&self, world: DVec3) -> DVec3 {
        (world - self.centre) / self.scale
    }
}

/// Cosine from which triangles may lie in one plane: an angle of 2e-5, which rounded coordinates leave.
const PARALLEL: f64 = 1.0 - 2e-10;

/// Opacity from which a layer hides the others: means of textures are rounded.
const OPAQUE: f64 = 1.0 - 1e-6;

/// A triangle of the solid.
pub(super) struct Triangle {
    /// Corners in the frame, counter-clockwise seen from the front.
    pub(super) corners: [DVec3; 3],
    /// Unit normal of the front.
    pub(super) normal: DVec3,
    /// Its material, without textures.
    pub(super) material: PlainMaterial,
    /// Its index in the scene.
    source: usize,
    /// Whether its material varies.
    varies: bool,
}

impl Triangle {
    fn of(scene: &PlainScene, frame: Frame, index: usize) -> Self {
        let source = &scene.triangles[index];
        Self {
            corners: source.corners.map(|corner| frame.place(corner)),
            normal: source.area_vector().normalize(),
            material: scene.materials[source.primitive],
            source: index,
            varies: matches!(scene.appearances.get(source.primitive), Some(Some(_))),
        }
    }

    /// The unit normal on the side that a ray of this direction meets, if that side reflects or emits at all.
    pub(super) fn side(&self, direction: DVec3) -> Option<DVec3> {
        let front = self.normal.dot(direction) < 0.0;
        (front || self.material.double_sided).then_some(if front { self.normal } else { -self.normal })
    }

    /// Whether both lie in one plane about a point, and show a side to a ray of this direction.
    fn is_layer_of(&self, other: &Self, point: DVec3, direction: DVec3) -> bool {
        let holds = |own: &Self| own.normal.dot(point - own.corners[0]).abs() <= CLEARANCE;
        self.normal.dot(other.normal).abs() >= PARALLEL
            && holds(self)
            && holds(other)
            && self.side(direction).is_some()
            && other.side(direction).is_some()
    }

    /// Distance along a ray, in units of the direction's length.
    ///
    /// The sign of an edge's volume decides on which side of it the ray passes. Two triangles that share the edge compute it
    /// from the same numbers with opposite sign, and 0 counts for both: no ray passes between them.
    fn meet(&self, origin: DVec3, direction: DVec3) -> Option<f64> {
        // Written out: half of the tracer's time is spent here, and closures over arrays become calls.
        let [a, b, c] = self.corners;
        let (a, b, c) = (a - origin, b - origin, c - origin);
        let volume = |from: DVec3, to: DVec3| direction.dot(from.cross(to));
        let (ab, bc, ca) = (volume(a, b), volume(b, c), volume(c, a));
        let inside = (ab >= 0.0 && bc >= 0.0 && ca >= 0.0) || (ab <= 0.0 && bc <= 0.0 && ca <= 0.0);
        let slope = direction.dot(self.normal);
        (inside && slope != 0.0).then(|| a.dot(self.normal) / slope)
    }
}

/// The first hit of a ray.
pub(super) struct Hit {
    /// Index of the triangle in [`Solid::triangles`].
    pub(super) triangle: usize,
    /// Distance from the ray's origin.
    pub(super) distance: f64,
}

/// A scene's triangles.
pub(super) struct Solid<'a> {
    scene: &'a PlainScene,
    /// How their coordinates relate to the world's.
    pub(super) frame: Frame,
    triangles: Hierarchy<Triangle>,
}

impl<'a> Solid<'a> {
    /// Builds the hierarchy.
    pub(super) fn new(scene: &'a PlainScene) -> Self {
        let frame = Frame::of(scene);
        let triangles = (0..scene.triangles.len()).map(|index| Triangle::of(scene, frame, index)).collect();
        let around = |triangle: &Triangle| PaddedBox::around(triangle.corners, CLEARANCE);
        Self { scene, frame, triangles: Hierarchy::new(triangles, around) }
    }

    /// The triangles, in the order of the hierarchy's leaves.
    pub(super) fn triangles(&self) -> &[Triangle] {
        self.triangles.items()
    }

    /// The triangle with this index in the scene.
    pub(super) fn triangle(&self, index: usize) -> Triangle {
        Triangle::of(self.scene, self.frame, index)
    }

    /// The material of a triangle at a point of it, in the frame.
    pub(super) fn material(&self, triangle: &Triangle, point: DVec3) -> PlainMaterial {
        if !triangle.varies {
            return triangle.material;
        }
        // Barycentric coordinates are the same in the frame.
        let source = PlainTriangle { corners: triangle.corners, ..self.scene.triangles[triangle.source] };
        self.scene.material_at(&source, point)
    }

    /// The exitance of a triangle where its texture is brightest, as far as it is there.
    pub(super) fn emitted(&self, triangle: &Triangle) -> DVec3 {
        triangle.material.exitance * triangle.material.opacity
    }

    /// Whether a triangle, met at this distance, lets a ray pass.
    fn lets_pass(&self, index: usize, origin: DVec3, direction: DVec3, distance: f64, chance: u64) -> bool {
        let triangle = &self.triangles()[index];
        if !triangle.varies && triangle.material.opacity >= 1.0 {
            return false;
        }
        let opacity = self.material(triangle, origin + direction * distance).opacity;
        // Each triangle draws its own number, whatever the order in which they are met.
        let draw = mix(chance, index as u64) as f64 / u64::MAX as f64;
        opacity < 1.0 && draw >= opacity
    }

    /// The first triangle that a ray of unit direction meets and does not pass; `chance` decides what it passes.
    ///
    /// Of several at one place the one that emits towards the ray counts, else the one that shows its front: a thin wall of two
    /// sheets is seen from both sides, and a lamp in the plane of a ceiling is seen. Layers of one plane have an order.
    pub(super) fn first_hit(&self, origin: DVec3, direction: DVec3, chance: u64) -> Option<Hit> {
        let mut least = f64::INFINITY;
        let mut found: Option<Hit> = None;
        self.triangles.along_ray(origin, direction, |index, triangle| {
            let Some(distance) = triangle.meet(origin, direction).filter(|distance| *distance > 0.0) else {
                return f32::INFINITY;
            };
            let rank = match triangle.side(direction) {
                Some(_) if triangle.material.exitance != DVec3::ZERO => 2.0,
                Some(_) => 1.0,
                None => 0.0,
            };
            let key = distance - rank * CLEARANCE;
            let other = found.as_ref().map(|hit| &self.triangles()[hit.triangle]);
            let met = origin + direction * distance;
            let goes_first = match other.filter(|other| triangle.is_layer_of(other, met, direction)) {
                Some(other) => self.order(triangle, met) < self.order(other, met),
                None => key < least,
            };
            if !goes_first || self.lets_pass(index, origin, direction, distance, chance) {
                return f32::INFINITY;
            }
            least = key;
            found = Some(Hit { triangle: index, distance });
            // What comes a little later may still be preferred.
            (key + 3.0 * CLEARANCE) as f32
        });
        found
    }

    /// Which of the layers at a point of one plane is seen: the least. Opaque ones go before others, those that emit before those that
    /// do not, then the first in the file.
    fn order(&self, layer: &Triangle, point: DVec3) -> (Reverse<bool>, Reverse<bool>, usize) {
        let material = self.material(layer, point);
        (Reverse(material.opacity >= OPAQUE), Reverse(material.exitance != DVec3::ZERO), layer.source)
    }

    /// Whether a triangle is what is seen of its layers, at a point of it in the frame, from the side of a normal.
    pub(super) fn is_seen(&self, triangle: &Triangle, point: DVec3, normal: DVec3) -> bool {
        let (origin, direction) = (point + normal * CLEARANCE, -normal);
        let around = self.triangles.touching(&PaddedBox::around([point], CLEARANCE));
        let mut met = around
            .into_iter()
            .filter(|layer| layer.source != triangle.source && layer.is_layer_of(triangle, point, direction))
            .filter(|layer| layer.meet(origin, direction).is_some());
        let order = self.order(triangle, point);
        met.all(|layer| order < self.order(layer, point))
    }

    /// Part of the light that passes from one point to another.
    pub(super) fn transmittance(&self, from: DVec3, to: DVec3) -> f64 {
        let span = to - from;
        let length = span.length();
        let direction = span / length;
        let mut passing = 1.0;
        let is_clear = self.triangles.is_clear(from, direction, length + CLEARANCE, |triangle| {
            let Some(distance) = triangle.meet(from, direction).filter(|d| *d > 0.0 && *d < length) else {
                return false;
            };
            passing *= 1.0 - self.material(triangle, from + direction * distance).opacity;
            passing <= 0.0
        });
        if is_clear { passing } else { 0.0 }
    }

    /// Indices, in the scene, of the triangles near a world position, and of some more.
    pub(super) fn near(&self, position: DVec3, distance: f64) -> impl Iterator<Item = usize> + use<'_> {
        let around = PaddedBox::around([self.frame.place(position)], distance / self.frame.scale);
        self.triangles.touching(&around).into_iter().map(|triangle| triangle.source)
    }
}
