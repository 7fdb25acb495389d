//! The vertices of one lit side of one primitive, as glTF stores them.

use foldhash::{HashMap, HashMapExt};
use glam::{DMat3, DMat4, DVec3, Vec3};
use gltf::Semantic;
use smallvec::SmallVec;

use super::attributes::{self, SourceAttribute};
use super::exposure::{corners, display_colour};
use super::layers::Parts;
use super::{Domain, ExportError};
use bake::lit::{LitMesh, LitTriangle, LitVertex};
use scene::{Frame, Side, Surface};

/// Geometry in a node's coordinates.
#[derive(Debug, Default)]
pub(super) struct RefinedPrimitive {
    pub(super) positions: Vec<[f32; 3]>,
    pub(super) normals: Vec<[f32; 3]>,
    /// `COLOR_0`: of four components where the input's has four, else of three.
    pub(super) colours: Vec<f32>,
    pub(super) irradiances: Vec<[f32; 3]>,
    /// Light groups and unshot radiosity of the lit mesh.
    pub(super) parts: Vec<Vec<[f32; 3]>>,
    /// Name, components per vertex and components of every further attribute.
    pub(super) further: Vec<(Semantic, usize, Vec<f32>)>,
    /// Three per triangle, counter-clockwise in glTF's sense.
    pub(super) indices: Vec<u32>,
}

impl RefinedPrimitive {
    /// Components of a colour.
    pub(super) fn colour_width(&self) -> usize {
        self.colours.len() / self.positions.len().max(1)
    }
}

/// How the light of a primitive is shown.
#[derive(Debug, Clone, Copy)]
pub(super) struct Show {
    /// `COLOR_0` per unit of irradiance.
    pub(super) exposure: f64,
    /// Part of the base colour that reflects diffusely.
    pub(super) diffuse: f64,
    /// Which vertices triangles share.
    pub(super) domain: Domain,
}

/// From the frame to a node's coordinates.
#[derive(Debug, Clone, Copy)]
pub(super) struct Placement {
    frame: Frame,
    from_world: DMat4,
    /// Takes world normals to local ones: the inverse of the inverse transpose.
    normal: DMat3,
    /// The node mirrors, so that glTF takes clockwise triangles for front faces.
    mirrored: bool,
}

impl Placement {
    /// For a node with this transform to the world; `None` when it cannot be inverted.
    pub(super) fn new(frame: Frame, to_world: DMat4) -> Option<Self> {
        let linear = DMat3::from_mat4(to_world);
        let determinant = linear.determinant();
        let from_world = to_world.inverse();
        (determinant != 0.0 && from_world.is_finite()).then(|| Self {
            frame,
            from_world,
            normal: linear.transpose(),
            mirrored: determinant < 0.0,
        })
    }
}

/// Collects the triangles of a surface: one vertex for every different set of attributes, or for every corner.
///
/// # Errors
/// When a value is not finite in f32, or the lit mesh does not fit the surface.
pub(super) fn refine(
    surface: &Surface,
    triangles: &[LitTriangle],
    lit: &LitMesh,
    parts: &Parts,
    placement: &Placement,
    show: Show,
    source: &[SourceAttribute],
) -> Result<RefinedPrimitive, ExportError> {
    let tint = source.iter().position(|attribute| attribute.is_tint).map(|at| {
        let first = source[..at].iter().map(|attribute| attribute.width).sum();
        first..first + source[at].width
    });
    let tint = tint.unwrap_or(0..0);
    let mut refined = RefinedPrimitive {
        parts: vec![vec![]; parts.len()],
        further: source
            .iter()
            .filter(|attribute| attribute.semantic != Semantic::Normals)
            .map(|attribute| (attribute.semantic.clone(), attribute.kept_width(), Vec::new()))
            .collect(),
        ..RefinedPrimitive::default()
    };
    let mut known: HashMap<(u32, SmallVec<[u32; 8]>), u32> = HashMap::new();
    let mut values = Vec::new();
    for triangle in triangles {
        let corners = corners(lit, triangle)?;
        let middle = corners.iter().map(|corner| corner.position).sum::<DVec3>() / 3.0;
        let facet = surface.facets.get(triangle.facet as usize).ok_or_else(|| {
            ExportError::Mismatch(format!("{} has no facet {}", surface.name, triangle.facet))
        })?;
        let mut indices = [0; 3];
        for ((index, &vertex), corner) in indices.iter_mut().zip(&triangle.vertices).zip(corners) {
            values.clear();
            if !source.is_empty() {
                let point = attributes::locate(facet, middle, corner.position);
                point
                    .and_then(|point| source.iter().try_for_each(|a| a.interpolate(&point, &mut values)))
                    .ok_or_else(|| {
                        ExportError::Mismatch(format!("{} lacks source vertices", surface.name))
                    })?;
            }
            let key = (vertex, values.iter().map(|value| value.to_bits()).collect());
            let shared = if show.domain == Domain::Vertex { known.get(&key).copied() } else { None };
            *index = match shared {
                Some(index) => index,
                None => {
                    let index = refined.push(surface, corner, source, &values, placement)?;
                    refined.push_light(surface, lit, vertex, &values[tint.clone()], show)?;
                    refined.push_parts(surface, parts, vertex)?;
                    known.insert(key, index);
                    index
                }
            };
        }
        if placement.mirrored {
            indices.swap(1, 2);
        }
        refined.indices.extend(indices);
    }
    Ok(refined)
}

impl RefinedPrimitive {
    /// Adds a vertex and returns its index.
    fn push(
        &mut self,
        surface: &Surface,
        vertex: &LitVertex,
        source: &[SourceAttribute],
        further: &[f32],
        placement: &Placement,
    ) -> Result<u32, ExportError> {
        let index = u32::try_from(self.positions.len())
            .ok()
            .filter(|&index| index < u32::MAX)
            .ok_or(ExportError::TooLarge(usize::MAX))?;
        let position = placement.from_world.transform_point3(placement.frame.to_world(vertex.position));
        let mut normal = (placement.normal * vertex.normal).normalize();
        self.positions.push(finite(surface, position, "position")?);
        let mut kept = self.further.iter_mut();
        let mut rest = further;
        for source in source {
            let (own, others) = rest.split_at(source.width);
            rest = others;
            if source.semantic == Semantic::Normals {
                normal = normal_of_source(surface.side, own)
                    .filter(|own| is_meant(*own, normal))
                    .unwrap_or(normal);
            } else if let Some((semantic, width, values)) = kept.next() {
                if !own.iter().all(|value| value.is_finite()) {
                    return Err(not_finite(surface, &semantic.to_string()));
                }
                values.extend_from_slice(&own[..*width]);
            }
        }
        self.normals.push(finite(surface, normal, "normal")?);
        Ok(index)
    }

    /// Adds the light of the vertex that was added last. `tint` is the input's `COLOR_0` there; empty where it has none.
    fn push_light(
        &mut self,
        surface: &Surface,
        lit: &LitMesh,
        vertex: u32,
        tint: &[f32],
        show: Show,
    ) -> Result<(), ExportError> {
        let irradiance = lit.vertices[vertex as usize].irradiance;
        self.irradiances.push(finite(surface, irradiance, "irradiance")?);
        let (rgb, alpha) = tint.split_at(tint.len().min(3));
        let rgb = if rgb.is_empty() { DVec3::ONE } else { Vec3::from_slice(rgb).as_dvec3() };
        let colour = display_colour(lit.shown_irradiance(vertex) * rgb * show.diffuse, show.exposure);
        self.colours.extend(finite(surface, colour, "colour")?);
        self.colours.extend(alpha);
        Ok(())
    }

    /// Adds what the vertex that was added last has beside the whole light.
    fn push_parts(&mut self, surface: &Surface, parts: &Parts, vertex: u32) -> Result<(), ExportError> {
        for (values, (semantic, of_vertices)) in self.parts.iter_mut().zip(parts) {
            let value = of_vertices.get(vertex as usize).ok_or_else(|| {
                ExportError::Mismatch(format!("{} has no value at vertex {vertex}", semantic.to_string()))
            })?;
            values.push(finite(surface, *value, &semantic.to_string())?);
        }
        Ok(())
    }
}

/// The unit normal of the input on this side, in the node's coordinates; `None` where it has none.
fn normal_of_source(side: Side, components: &[f32]) -> Option<DVec3> {
    let front = DVec3::from_array(<[f32; 3]>::try_from(components).ok()?.map(f64::from));
    front.try_normalize().map(|front| if side == Side::Front { front } else { -front })
}

/// Whether a normal of the input points away from the surface, as the one that its light has does.
fn is_meant(source: DVec3, normal: DVec3) -> bool {
    source.dot(normal) > 0.0
}

fn finite(surface: &Surface, value: DVec3, quantity: &str) -> Result<[f32; 3], ExportError> {
    let value = value.as_vec3();
    if value.is_finite() { Ok(value.to_array()) } else { Err(not_finite(surface, quantity)) }
}

fn not_finite(surface: &Surface, quantity: &str) -> ExportError {
    ExportError::NotFinite { surface: surface.name.clone(), quantity: quantity.into() }
}
