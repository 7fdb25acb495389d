//! The lit mesh as PLY, for tools that analyse: positions in the world, light as numbers at vertices.
//!
//! Binary, little endian. Vertices of different surfaces are different, for radiosity is.

use std::collections::HashMap;
use std::fmt::Write;

use glam::DVec3;

use super::exposure::corners;
use super::{Domain, ExportError, ExportSettings, Exported, layers};
use bake::lit::{LitMesh, LitVertex};
use scene::{Scene, Surface};

/// A vertex of a surface, in the making.
struct Vertex<'a> {
    lit: &'a LitVertex,
    /// Its number in the lit mesh.
    index: u32,
    /// Area of the triangles around it, doubled, and means of reflectance and exitance over them, times that.
    area: f64,
    reflectance: DVec3,
    exitance: DVec3,
}

/// The file, and what is in it.
///
/// # Errors
/// When a value is not finite in f32, or the lit mesh does not fit the scene.
pub(super) fn encode(
    scene: &Scene,
    lit: &LitMesh,
    exposure: f64,
    settings: &ExportSettings,
) -> Result<(Vec<u8>, Exported), ExportError> {
    let groups: Vec<&str> = lit.layers.iter().map(|layer| layer.name.as_str()).collect();
    layers::check(&groups)?;
    let (mut vertices, mut faces) = (Vec::new(), Vec::new());
    let (mut vertex_count, mut face_count) = (0_u32, 0_usize);
    for (index, (surface, triangles)) in scene.surfaces.iter().zip(&lit.surfaces).enumerate() {
        let mut own: Vec<Vertex> = Vec::new();
        let mut known: HashMap<u32, u32> = HashMap::new();
        for triangle in triangles {
            let lit_corners = corners(lit, triangle)?;
            let [a, b, c] = lit_corners.map(|corner| corner.position);
            let area = (b - a).cross(c - a).length();
            if surface.facets.len() <= triangle.facet as usize {
                return Err(ExportError::Mismatch(format!(
                    "{} has no facet {}",
                    surface.name, triangle.facet
                )));
            }
            let reflectance = surface.mean_reflectance(triangle.facet, &[a, b, c]) * area;
            let exitance = surface.mean_exitance(triangle.facet, &[a, b, c]) * area;
            faces.push(3);
            for (number, corner) in triangle.vertices.into_iter().zip(lit_corners) {
                let next = own.len() as u32;
                let place = match settings.domain {
                    Domain::Vertex => *known.entry(number).or_insert(next),
                    Domain::Corner => next,
                };
                if place == next {
                    let [reflectance, exitance] = [DVec3::ZERO; 2];
                    own.push(Vertex { lit: corner, index: number, area: 0.0, reflectance, exitance });
                }
                let vertex = &mut own[place as usize];
                vertex.area += area;
                vertex.reflectance += reflectance;
                vertex.exitance += exitance;
                let place = vertex_count.checked_add(place).filter(|place| *place <= i32::MAX as u32);
                faces.extend(place.ok_or(ExportError::TooLarge(usize::MAX))?.to_le_bytes());
            }
            faces.extend((index as u32).to_le_bytes());
        }
        face_count += triangles.len();
        vertex_count = vertex_count.saturating_add(own.len() as u32);
        for vertex in &own {
            push(&mut vertices, scene, lit, surface, vertex)?;
        }
    }
    let mut file = header(scene, lit, exposure, settings, vertex_count, face_count).into_bytes();
    file.append(&mut vertices);
    file.append(&mut faces);
    let exported = Exported {
        exposure,
        vertices: vertex_count as usize,
        triangles: face_count,
        unshared: None,
        warnings: vec![],
    };
    Ok((file, exported))
}

/// Appends the properties of a vertex, in the order of the header.
fn push(
    out: &mut Vec<u8>,
    scene: &Scene,
    lit: &LitMesh,
    surface: &Surface,
    vertex: &Vertex,
) -> Result<(), ExportError> {
    // A vertex of triangles without an area has no mean over them.
    let mean = |sum: DVec3, of: DVec3| if vertex.area > 0.0 { sum / vertex.area } else { of };
    let irradiance = vertex.lit.irradiance;
    let radiosity =
        mean(vertex.reflectance, surface.reflectance) * irradiance + mean(vertex.exitance, surface.exitance);
    let of_groups = lit.layers.iter().map(|layer| layer.irradiance.get(vertex.index as usize).copied());
    let of_groups = of_groups.map(|value| value.unwrap_or(DVec3::NAN));
    let occlusion = lit.occlusion.get(vertex.index as usize).map(|open| *open as f32);
    let position = scene.frame.to_world(vertex.lit.position);
    for value in [position, vertex.lit.normal, irradiance, radiosity].into_iter().chain(of_groups) {
        let value = value.as_vec3();
        if !value.is_finite() {
            let (surface, quantity) = (surface.name.clone(), "position or light".into());
            return Err(ExportError::NotFinite { surface, quantity });
        }
        out.extend(value.to_array().into_iter().flat_map(f32::to_le_bytes));
    }
    out.extend(occlusion.into_iter().flat_map(f32::to_le_bytes));
    Ok(())
}

fn header(
    scene: &Scene,
    lit: &LitMesh,
    exposure: f64,
    settings: &ExportSettings,
    vertices: u32,
    faces: usize,
) -> String {
    let mut text = String::from("ply\nformat binary_little_endian 1.0\n");
    // Writing to a string cannot fail, and a comment is one line of a format that has only ASCII.
    let mut comment = |line: String| {
        let plain = |character: char| if matches!(character, ' '..='~') { character } else { '?' };
        let _ = writeln!(text, "comment {}", line.chars().map(plain).collect::<String>());
    };
    comment(concat!("made by Halflight ", env!("CARGO_PKG_VERSION")).into());
    comment(format!(
        "irradiance and radiosity in {}, linear RGB; suitable exposure {exposure}",
        settings.unit
    ));
    for (index, surface) in scene.surfaces.iter().enumerate() {
        comment(format!("surface {index} is {}, {:?}", surface.name, surface.side));
    }
    let _ = writeln!(text, "element vertex {vertices}");
    let mut properties: Vec<String> = ["x", "y", "z", "nx", "ny", "nz"].map(str::to_owned).to_vec();
    let of_groups = lit.layers.iter().map(|layer| layers::attribute(&layer.name).to_ascii_lowercase());
    for quantity in ["irradiance".into(), "radiosity".into()].into_iter().chain(of_groups) {
        properties.extend(["red", "green", "blue"].map(|channel| format!("{quantity}_{channel}")));
    }
    properties.extend((!lit.occlusion.is_empty()).then(|| "occlusion".into()));
    for property in properties {
        let _ = writeln!(text, "property float {property}");
    }
    let _ =
        writeln!(text, "element face {faces}\nproperty list uchar int vertex_indices\nproperty int surface");
    text.push_str("end_header\n");
    text
}
