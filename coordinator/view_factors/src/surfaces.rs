//! The surfaces of a scene, their names and polygons.

use std::collections::{HashMap, HashSet};

use glam::DVec3;
use kernel::geometry::{ConvexPolygon, area_vector};

use super::{Division, OPEN, ViewFactorError};
use scene::{Facet, Scene, Side, Surface};

/// Turns of a polygon to the wrong side count as straight up to this part of both edges' lengths.
const STRAIGHT: f64 = 1e-6;

/// A surface between which and others there are form factors.
pub struct NamedSurface {
    /// Its name: no other surface has it.
    pub name: String,
    /// Its polygons, in the frame.
    pub polygons: Vec<ConvexPolygon>,
}

/// The surfaces of a scene, in the order of the importer.
pub fn named(scene: &Scene, division: Division) -> Result<Vec<NamedSurface>, ViewFactorError> {
    let names = names(scene)?;
    let surfaces = scene.surfaces.iter().zip(names);
    Ok(match division {
        Division::Surfaces => surfaces
            .map(|(surface, name)| NamedSurface {
                name,
                polygons: surface.facets.iter().map(Facet::polygon).collect(),
            })
            .collect(),
        Division::Facets => surfaces
            .flat_map(|(surface, name)| {
                let polygons = surface.facets.iter().flat_map(polygons).enumerate();
                polygons
                    .map(|(index, polygon)| NamedSurface {
                        name: format!("{name}/{index}"),
                        polygons: vec![polygon],
                    })
                    .collect::<Vec<_>>()
            })
            .collect(),
    })
}

/// The polygons of the file that a facet was joined from. Files hold triangles only: those that follow each other and fan out
/// from one corner were one polygon, as long as that is convex.
fn polygons(facet: &Facet) -> Vec<ConvexPolygon> {
    let mut polygons: Vec<Vec<DVec3>> = vec![];
    for triangle in &facet.triangles {
        let [a, b, c] = triangle.positions;
        if let Some(fan) = polygons.last_mut()
            && fan[0] == a
        {
            // A polygon seen from its back, or mirrored, has its triangles in the other order.
            let place = match () {
                () if fan[fan.len() - 1] == b => Some((fan.len(), c)),
                () if fan[1] == c => Some((1, b)),
                () => None,
            };
            if let Some((place, corner)) = place {
                fan.insert(place, corner);
                if is_convex(fan, facet.normal) {
                    continue;
                }
                fan.remove(place);
            }
        }
        polygons.push(vec![a, b, c]);
    }
    polygons.into_iter().map(|corners| ConvexPolygon { plane: facet.plane, corners }).collect()
}

fn is_convex(corners: &[DVec3], normal: DVec3) -> bool {
    let count = corners.len();
    let edge = |i: usize| corners[(i + 1) % count] - corners[i % count];
    (0..count).all(|i| {
        let (arriving, leaving) = (edge(i), edge(i + 1));
        arriving.cross(leaving).dot(normal) >= -STRAIGHT * arriving.length() * leaving.length()
    })
}

/// Centre of gravity of some polygons.
pub fn centre(polygons: &[ConvexPolygon]) -> DVec3 {
    let triangles = || {
        polygons.iter().flat_map(|polygon| {
            let corners = &polygon.corners;
            corners[1..].windows(2).map(move |pair| [corners[0], pair[0], pair[1]])
        })
    };
    let area = |triangle: &[DVec3; 3]| area_vector(triangle).length();
    let whole: f64 = triangles().map(|triangle| area(&triangle)).sum();
    triangles().map(|triangle| triangle.iter().sum::<DVec3>() / 3.0 * (area(&triangle) / whole)).sum()
}

/// A name for each surface: that of its node, else of its mesh; with the number of the primitive where the mesh has several.
fn names(scene: &Scene) -> Result<Vec<String>, ViewFactorError> {
    let given: Vec<Option<String>> =
        scene.surfaces.iter().map(|surface| given_name(scene, surface)).collect();
    if given.iter().all(Option::is_none) {
        return Err(ViewFactorError::NoNames);
    }
    let whole = |(surface, given): (&Surface, Option<String>)| {
        let name = given.unwrap_or_else(|| format!("node {}", surface.node));
        let primitive =
            if primitives(scene, surface) > 1 { format!(".{}", surface.primitive) } else { String::new() };
        let side = if surface.side == Side::Back { " (back)" } else { "" };
        format!("{name}{primitive}{side}")
    };
    let names: Vec<String> = scene.surfaces.iter().zip(given).map(whole).collect();
    if names.iter().any(|name| name == OPEN) {
        return Err(ViewFactorError::ReservedName);
    }
    let mut uses: HashMap<&str, usize> = HashMap::new();
    for name in &names {
        *uses.entry(name).or_default() += 1;
    }
    let mut taken = HashSet::new();
    let distinct = |(surface, name): (&Surface, &String)| {
        let mut own = name.clone();
        if uses[name.as_str()] > 1 {
            own = format!("{name} (node {})", surface.node);
        }
        while !taken.insert(own.clone()) {
            own.push('\'');
        }
        own
    };
    Ok(scene.surfaces.iter().zip(&names).map(distinct).collect())
}

fn given_name(scene: &Scene, surface: &Surface) -> Option<String> {
    let root = &scene.source.root;
    let node = root.nodes.get(surface.node)?;
    let mesh = node.mesh.and_then(|mesh| root.meshes.get(mesh.value()));
    let names = [node.name.as_ref(), mesh.and_then(|mesh| mesh.name.as_ref())];
    names.into_iter().flatten().find(|name| !name.trim().is_empty()).cloned()
}

fn primitives(scene: &Scene, surface: &Surface) -> usize {
    let root = &scene.source.root;
    let mesh = root.nodes.get(surface.node).and_then(|node| node.mesh);
    mesh.and_then(|mesh| root.meshes.get(mesh.value())).map_or(1, |mesh| mesh.primitives.len())
}
