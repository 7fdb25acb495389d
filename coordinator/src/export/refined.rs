//! The vertices of one lit side of one primitive, as glTF stores them.

use std::collections::HashMap;

use glam::{DMat3, DMat4, DVec3};
use gltf::Semantic;

use super::ExportError;
use super::attributes::{self, SourceAttribute};
use super::exposure::{corners, display_colour};
use crate::lit::{LitMesh, LitTriangle, LitVertex};
use crate::scene::{Frame, Surface};

/// Geometry in a node's coordinates.
#[derive(Debug, Default)]
pub(super) struct RefinedPrimitive {
    pub(super) positions: Vec<[f32; 3]>,
    pub(super) normals: Vec<[f32; 3]>,
    pub(super) colours: Vec<[f32; 3]>,
    pub(super) irradiances: Vec<[f32; 3]>,
    /// Name, components per vertex and components of every further attribute.
    pub(super) further: Vec<(Semantic, usize, Vec<f32>)>,
    /// Three per triangle, counter-clockwise in glTF's sense.
    pub(super) indices: Vec<u32>,
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

/// Collects the triangles of a surface, one vertex for every different set of attributes.
///
/// # Errors
/// When a value is not finite in f32, or the lit mesh does not fit the surface.
pub(super) fn refine(
    surface: &Surface,
    triangles: &[LitTriangle],
    lit: &LitMesh,
    placement: &Placement,
    exposure: f64,
    source: &[SourceAttribute],
) -> Result<RefinedPrimitive, ExportError> {
    let mut refined = RefinedPrimitive {
        further: source.iter().map(|a| (a.semantic.clone(), a.width, Vec::new())).collect(),
        ..RefinedPrimitive::default()
    };
    let mut known: HashMap<(u32, Vec<u32>), u32> = HashMap::new();
    for triangle in triangles {
        let corners = corners(lit, triangle)?;
        let middle = corners.iter().map(|corner| corner.position).sum::<DVec3>() / 3.0;
        let facet = surface.facets.get(triangle.facet as usize).ok_or_else(|| {
            ExportError::Mismatch(format!("{} has no facet {}", surface.name, triangle.facet))
        })?;
        let mut indices = [0; 3];
        for ((index, &vertex), corner) in indices.iter_mut().zip(&triangle.vertices).zip(corners) {
            let mut values = Vec::new();
            if !source.is_empty() {
                let point = attributes::locate(facet, middle, corner.position);
                point
                    .and_then(|point| source.iter().try_for_each(|a| a.interpolate(&point, &mut values)))
                    .ok_or_else(|| {
                        ExportError::Mismatch(format!("{} lacks source vertices", surface.name))
                    })?;
            }
            let key = (vertex, values.iter().map(|value| value.to_bits()).collect());
            *index = match known.get(&key) {
                Some(&index) => index,
                None => {
                    let index = refined.push(surface, corner, &values, placement, exposure)?;
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
        further: &[f32],
        placement: &Placement,
        exposure: f64,
    ) -> Result<u32, ExportError> {
        let not_finite = |quantity: &str| ExportError::NotFinite {
            surface: surface.name.clone(),
            quantity: quantity.into(),
        };
        let finite = |value: DVec3, quantity: &str| {
            let value = value.as_vec3();
            if value.is_finite() { Ok(value.to_array()) } else { Err(not_finite(quantity)) }
        };
        let index = u32::try_from(self.positions.len())
            .ok()
            .filter(|&index| index < u32::MAX)
            .ok_or(ExportError::TooLarge(usize::MAX))?;
        let position = placement.from_world.transform_point3(placement.frame.to_world(vertex.position));
        let normal = (placement.normal * vertex.normal).normalize();
        self.positions.push(finite(position, "position")?);
        self.normals.push(finite(normal, "normal")?);
        self.irradiances.push(finite(vertex.irradiance, "irradiance")?);
        self.colours.push(finite(display_colour(vertex.irradiance, exposure), "colour")?);
        let mut rest = further;
        for (semantic, width, values) in &mut self.further {
            let (own, others) = rest.split_at(*width);
            if !own.iter().all(|value| value.is_finite()) {
                return Err(not_finite(&semantic.to_string()));
            }
            values.extend_from_slice(own);
            rest = others;
        }
        Ok(index)
    }
}
