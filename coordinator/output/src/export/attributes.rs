//! The input's vertex attributes at the vertices of the refined mesh.

use glam::DVec3;
use gltf::accessor::{DataType, Dimensions, Item, Iter};
use gltf::{Accessor, Semantic};
use smallvec::SmallVec;

use super::ExportError;
use scene::{Facet, SourceTriangle};

/// Below this barycentric coordinate a point counts as outside a triangle: some ten thousand roundings of f64.
const OUTSIDE: f64 = -1e-9;

/// Name of the attribute that keeps the input's `COLOR_0`, without its underscore.
pub(super) const TINT: &str = "COLOR_0";

/// Name of the attribute of the irradiance, without its underscore; those of its parts begin with it.
pub(super) const IRRADIANCE: &str = "IRRADIANCE";

/// Name of the attribute of the radiosity that is still to be shot, without its underscore.
pub(super) const UNSHOT: &str = "UNSHOT";

/// Name of the attribute of the part of the hemisphere in which nothing stands near, without its underscore.
pub(super) const OCCLUSION: &str = "OCCLUSION";

/// An attribute of the input, as floats.
pub(super) struct SourceAttribute {
    /// Its name.
    pub(super) semantic: Semantic,
    /// Components per vertex.
    pub(super) width: usize,
    /// Whether it is what the input multiplies base colour by.
    pub(super) is_tint: bool,
    /// Components of all vertices, normalised integers already in [0, 1] or [-1, 1].
    values: Vec<f64>,
}

/// What the refined mesh keeps as the input has it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Keeps {
    /// `COLOR_0`, without light.
    pub(super) colours: bool,
    /// `NORMAL`, though light has others.
    pub(super) normals: bool,
}

/// Reads the attributes that the refined mesh takes over: neither those that it has of its own (`POSITION`, `NORMAL` unless it
/// [keeps](Keeps) it, `_IRRADIANCE` and what begins like it, `_UNSHOT`, `_OCCLUSION`) nor those that belong to an undone pose (`JOINTS`,
/// `WEIGHTS`). `COLOR_0`, which the light is multiplied by, is also kept by itself, as [`TINT`], unless it is kept as it is.
///
/// Matrices, which only application-specific attributes have, are left out.
pub(super) fn read(
    primitive: &gltf::Primitive<'_>,
    buffers: &[Vec<u8>],
    keeps: Keeps,
) -> Result<Vec<SourceAttribute>, ExportError> {
    let mut attributes = Vec::new();
    for (semantic, accessor) in primitive.attributes() {
        let own = match &semantic {
            Semantic::Positions => true,
            Semantic::Normals => !keeps.normals,
            Semantic::Joints(_) | Semantic::Weights(_) => true,
            Semantic::Extras(name) => {
                [TINT, UNSHOT, OCCLUSION].contains(&name.as_str()) || name.starts_with(IRRADIANCE)
            }
            _ => false,
        };
        let width = accessor.dimensions().multiplicity();
        if own || width > 4 || accessor.dimensions() == Dimensions::Mat2 {
            continue;
        }
        let values = components(&accessor, buffers)
            .ok_or_else(|| ExportError::Buffer(format!("attribute {}", semantic.to_string())))?;
        let is_tint = !keeps.colours && semantic == Semantic::Colors(0) && width >= 3;
        let semantic = if is_tint { Semantic::Extras(TINT.into()) } else { semantic };
        attributes.push(SourceAttribute { semantic, width, is_tint, values });
    }
    Ok(attributes)
}

/// All components of an accessor, vertex by vertex; `None` when its buffer does not hold them.
pub(super) fn components(accessor: &Accessor<'_>, buffers: &[Vec<u8>]) -> Option<Vec<f64>> {
    let scale = |largest: f64| if accessor.normalized() { 1.0 / largest } else { 1.0 };
    // The most negative integer of a signed type lies below -1.
    let signed = |value: f64, largest: f64| {
        (value * scale(largest)).max(if accessor.normalized() { -1.0 } else { value })
    };
    match accessor.data_type() {
        DataType::I8 => items(accessor, buffers, |v: i8| signed(v.into(), 127.0)),
        DataType::U8 => items(accessor, buffers, |v: u8| f64::from(v) * scale(255.0)),
        DataType::I16 => items(accessor, buffers, |v: i16| signed(v.into(), 32767.0)),
        DataType::U16 => items(accessor, buffers, |v: u16| f64::from(v) * scale(65535.0)),
        DataType::U32 => items(accessor, buffers, |v: u32| v.into()),
        DataType::F32 => items(accessor, buffers, |v: f32| v.into()),
    }
}

/// All components of an accessor of component type `T`.
fn items<T: Item + Copy>(
    accessor: &Accessor<'_>,
    buffers: &[Vec<u8>],
    to_f64: impl Fn(T) -> f64,
) -> Option<Vec<f64>> {
    let data = |buffer: gltf::Buffer<'_>| buffers.get(buffer.index()).map(Vec::as_slice);
    if accessor.count() == 0 {
        return None;
    }
    let values: Vec<T> = match accessor.dimensions().multiplicity() {
        1 => Iter::<T>::new(accessor.clone(), data)?.collect(),
        2 => Iter::<[T; 2]>::new(accessor.clone(), data)?.flatten().collect(),
        3 => Iter::<[T; 3]>::new(accessor.clone(), data)?.flatten().collect(),
        _ => Iter::<[T; 4]>::new(accessor.clone(), data)?.flatten().collect(),
    };
    Some(values.into_iter().map(to_f64).collect())
}

/// A point in a triangle of the input.
#[derive(Debug, Clone, Copy)]
pub(super) struct SourcePoint {
    vertices: [u32; 3],
    weights: DVec3,
}

/// Where in the facet's source triangles the corner of a refined triangle lies.
///
/// The source triangle under the refined triangle's middle, where it holds the corner: then attributes that jump from one
/// source triangle to the next stay apart. Otherwise, for refined triangles across several source triangles, the one that
/// holds the corner best. `None` when the facet has no source triangle.
pub(super) fn locate(facet: &Facet, middle: DVec3, corner: DVec3) -> Option<SourcePoint> {
    let home = holding(&facet.triangles, middle)?;
    let weights = barycentric(home, corner);
    let (triangle, weights) = if weights.min_element() >= OUTSIDE {
        (home, weights)
    } else {
        let triangle = holding(&facet.triangles, corner)?;
        (triangle, barycentric(triangle, corner))
    };
    let inside = weights.max(DVec3::ZERO);
    Some(SourcePoint { vertices: triangle.vertices, weights: inside / inside.element_sum() })
}

/// The triangle that holds the point, or the one that it is least far outside of.
fn holding(triangles: &[SourceTriangle], point: DVec3) -> Option<&SourceTriangle> {
    match triangles {
        [only] => Some(only),
        several => several
            .iter()
            .map(|triangle| (barycentric(triangle, point).min_element(), triangle))
            .max_by(|a, b| a.0.total_cmp(&b.0))
            .map(|(_, triangle)| triangle),
    }
}

/// Barycentric coordinates of the point's projection; they sum to 1.
fn barycentric(triangle: &SourceTriangle, point: DVec3) -> DVec3 {
    let [a, b, c] = triangle.positions;
    let normal = (b - a).cross(c - a);
    let area = normal.length_squared();
    let v = (point - a).cross(c - a).dot(normal) / area;
    let w = (b - a).cross(point - a).dot(normal) / area;
    if v.is_finite() && w.is_finite() { DVec3::new(1.0 - v - w, v, w) } else { DVec3::X }
}

impl SourceAttribute {
    /// Components that the output keeps. Of a colour that light is multiplied by the alpha stands in `COLOR_0` already, and the
    /// attributes that the exporter adds are all of one shape: Blender's importer (4.5) mixes up those of different shapes.
    pub(super) fn kept_width(&self) -> usize {
        if self.is_tint { 3 } else { self.width }
    }

    /// Appends the attribute at a point. `None` when the attribute has fewer vertices than the triangle names.
    pub(super) fn interpolate(&self, point: &SourcePoint, out: &mut Vec<f32>) -> Option<()> {
        let at = |vertex: u32| self.values.chunks_exact(self.width).nth(vertex as usize);
        let [a, b, c] = point.vertices.map(at);
        let (a, b, c) = (a?, b?, c?);
        let weights = point.weights.to_array();
        let mut values: SmallVec<[f64; 4]> =
            (0..self.width).map(|i| weights[0] * a[i] + weights[1] * b[i] + weights[2] * c[i]).collect();
        if self.semantic == Semantic::Tangents {
            // A tangent has unit length and, as its fourth component, a sign: neither survives a mean.
            let direction = DVec3::from_slice(&values);
            let unit = direction.try_normalize().unwrap_or_else(|| DVec3::from_slice(a));
            values = SmallVec::from([unit.x, unit.y, unit.z, a[3]]);
        } else if self.is_tint || matches!(self.semantic, Semantic::Colors(_)) {
            values.iter_mut().for_each(|value| *value = value.clamp(0.0, 1.0));
        }
        out.extend(values.iter().map(|value| *value as f32));
        Some(())
    }
}
