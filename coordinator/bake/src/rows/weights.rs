//! Weights of vertices in the mean of a share.

use glam::DVec3;
use kernel::geometry::area_vector;

use crate::mesh::{Mesh, PatchId, Share, overlap};

/// A share of which less than this part is exposed takes the value at its vertex.
const LEAST_EXPOSED: f64 = 0.1;

/// Weight of the mean on the level of a leaf's parent, beside that of the leaf's own. The mean of the interpolation is off by a
/// multiple of the squared size; Richardson extrapolation with the parent's removes it.
const PARENT: f64 = -1.0 / 3.0;

/// Weights of the exposed vertices in the mean of a share: its parts are children of patches, or quarters of those never
/// divided, or what its polygons cover of them.
pub fn mean_weights(mesh: &Mesh, share: &Share, exposed: &[bool]) -> Vec<(usize, f64)> {
    let mut weights = Vec::with_capacity(8);
    for own in share.corners.chunk_by(|a, b| a.0 == b.0) {
        let id = own[0].0;
        if mesh.patch(id).first_child.is_some() {
            own.iter().for_each(|(_, corner)| add_leaves(mesh, id, *corner, &mut weights));
        } else if own.len() == mesh.patch(id).corners.len() {
            add_whole(mesh, id, 1.0, &mut weights);
        } else {
            own.iter().for_each(|(_, corner)| add_quarter(mesh, id, *corner, 1.0, &mut weights));
        }
    }
    for &(patch, polygon) in &share.overlaps {
        add_overlap(mesh, &share.polygons[polygon].corners, (patch, None), &mut weights);
    }
    weights.sort_unstable_by_key(|(vertex, _)| *vertex);
    weights.dedup_by(|from, into| {
        let same = from.0 == into.0;
        if same {
            into.1 += from.1;
        }
        same
    });
    let is_exposed = |entry: &(usize, f64)| exposed[entry.0];
    let sum = |weights: &[(usize, f64)]| weights.iter().map(|entry| entry.1).sum::<f64>();
    if weights.iter().any(is_exposed) {
        weights.retain(is_exposed);
    }
    let total = sum(&weights);
    // Extrapolation has negative weights: where few vertices are left they may outweigh the others.
    if total < LEAST_EXPOSED * share.area {
        return vec![(share.vertex.index(), 1.0)];
    }
    weights.iter_mut().for_each(|(_, weight)| *weight /= total);
    weights
}

/// Adds the leaves of a divided patch's child.
fn add_leaves(mesh: &Mesh, parent: PatchId, corner: usize, weights: &mut Vec<(usize, f64)>) {
    let Some(id) = mesh.children(parent).nth(corner) else { return };
    let patch = mesh.patch(id);
    if patch.first_child.is_some() {
        (0..patch.corners.len()).for_each(|corner| add_leaves(mesh, id, corner, weights));
        return;
    }
    add_whole(mesh, id, 1.0 - PARENT, weights);
    add_quarter(mesh, parent, corner, PARENT, weights);
}

/// Adds `part` times the integral over a patch, of what [`add_quarter`] integrates.
pub fn add_whole(mesh: &Mesh, id: PatchId, part: f64, weights: &mut Vec<(usize, f64)>) {
    let fan = mesh.fan(id);
    let (count, all) = (fan.len(), fan.iter().sum::<f64>());
    for (index, corner) in mesh.patch(id).corners.iter().enumerate() {
        let beside = fan[index] + fan[(index + count - 1) % count];
        weights.push((corner.index(), part * (beside + all / count as f64) / 3.0));
    }
}

/// Adds `part` times the integral over a corner's part of a patch: of what is linear over the triangles around the patch's centre,
/// which has the mean of the corners.
pub fn add_quarter(mesh: &Mesh, id: PatchId, corner: usize, part: f64, weights: &mut Vec<(usize, f64)>) {
    let patch = mesh.patch(id);
    let count = patch.corners.len();
    let fan = mesh.fan(id);
    let mut add = |i: usize, weight: f64| weights.push((patch.corners[i % count].index(), weight * part));
    // Half of each of the two triangles at the corner: between it, the middle of an edge and the centre.
    for (triangle, beside) in [(corner, corner + 1), (corner + count - 1, corner + count - 1)] {
        let third = fan[triangle % count] / 6.0;
        add(corner, 1.5 * third);
        add(beside, 0.5 * third);
        (0..count).for_each(|i| add(i, third / count as f64));
    }
}

/// Adds the parts of leaves that a polygon covers. A child comes with its parent and the corner there.
fn add_overlap(
    mesh: &Mesh,
    polygon: &[DVec3],
    (id, parent): (PatchId, Option<(PatchId, usize)>),
    weights: &mut Vec<(usize, f64)>,
) {
    let corners = mesh.corners(id);
    let covered = overlap(polygon, &corners);
    if covered.is_empty() {
        return;
    }
    if mesh.patch(id).first_child.is_some() {
        for (corner, child) in mesh.children(id).enumerate() {
            add_overlap(mesh, polygon, (child, Some((id, corner))), weights);
        }
        return;
    }
    let is_whole = covered[..] == corners[..];
    let part = if parent.is_some() { 1.0 - PARENT } else { 1.0 };
    if is_whole {
        add_whole(mesh, id, part, weights);
    } else {
        add_part(mesh, id, &covered, part, weights);
    }
    match parent {
        Some((parent, corner)) if is_whole => add_quarter(mesh, parent, corner, PARENT, weights),
        Some((parent, _)) => add_part(mesh, parent, &covered, PARENT, weights),
        None => {}
    }
}

/// Adds `part` times the integral over a convex part of a patch, of what [`add_quarter`] integrates.
fn add_part(mesh: &Mesh, id: PatchId, covered: &[DVec3], part: f64, weights: &mut Vec<(usize, f64)>) {
    let patch = mesh.patch(id);
    let count = patch.corners.len();
    let centre = mesh.centre(id);
    for (index, (from, to)) in mesh.edges(id).enumerate() {
        let triangle = [centre, mesh.position(from), mesh.position(to)];
        let doubled = (triangle[1] - centre).cross(triangle[2] - centre);
        if doubled == DVec3::ZERO {
            continue;
        }
        let (area, centroid) = area_and_centroid(&overlap(&triangle, covered));
        let towards = |a: DVec3, b: DVec3| {
            area * part * (a - centroid).cross(b - centroid).dot(doubled) / doubled.length_squared()
        };
        let [of_centre, of_from, of_to] =
            [0, 1, 2].map(|i| towards(triangle[(i + 1) % 3], triangle[(i + 2) % 3]));
        weights.push((patch.corners[index].index(), of_from));
        weights.push((patch.corners[(index + 1) % count].index(), of_to));
        let each = of_centre / count as f64;
        weights.extend(patch.corners.iter().map(|corner| (corner.index(), each)));
    }
}

/// Area and centroid of a convex polygon; of one without area, any point.
fn area_and_centroid(corners: &[DVec3]) -> (f64, DVec3) {
    let (mut area, mut moment) = (0.0, DVec3::ZERO);
    let Some((first, rest)) = corners.split_first() else { return (0.0, DVec3::ZERO) };
    for pair in rest.windows(2) {
        let own = area_vector(&[*first, pair[0], pair[1]]).length();
        area += own;
        moment += (pair[0] - *first + pair[1] - *first) * (own / 3.0);
    }
    (area, if area > 0.0 { *first + moment / area } else { *first })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::{SIZE, divide, overlaid};

    const EXACT: f64 = 1e-9;

    fn means(mesh: &Mesh, shares: &[Share], values: &[f64]) -> Vec<f64> {
        let exposed = vec![true; mesh.vertices.len()];
        let mean = |share: &Share| {
            mean_weights(mesh, share, &exposed).into_iter().map(|(vertex, part)| values[vertex] * part).sum()
        };
        shares.iter().map(mean).collect()
    }

    #[test]
    fn shares_of_another_mesh_get_all_the_flux_of_this_one() {
        let (_, mesh, shares) = overlaid(40);
        let values: Vec<f64> = (0..mesh.vertices.len()).map(|vertex| (vertex as f64).sin() + 2.0).collect();
        let seen: Vec<DVec3> = values.iter().map(|value| DVec3::splat(*value)).collect();
        let expected: f64 = mesh.leaves().map(|(id, patch)| patch.area * mesh.mean(id, &seen).x).sum();
        let found: f64 =
            means(&mesh, &shares, &values).iter().zip(&shares).map(|(mean, share)| mean * share.area).sum();
        assert!((found / expected - 1.0).abs() <= EXACT, "{found} of {expected}");
        let area: f64 = shares.iter().map(|share| share.area).sum();
        let whole = SIZE * SIZE * 1.25_f64.sqrt();
        assert!((area / whole - 1.0).abs() <= EXACT, "{area} of {whole}");
    }

    #[test]
    fn means_of_linear_light_are_exact_on_divided_meshes_too() {
        let (_, mut mesh, shares) = overlaid(40);
        (0..2).for_each(|_| divide(&mut mesh, 3));
        let light = |position: DVec3| 1.0 + position.dot(DVec3::new(0.002, 0.001, 0.003));
        let values: Vec<f64> = mesh.vertices.iter().map(|vertex| light(vertex.position)).collect();
        for (mean, share) in means(&mesh, &shares, &values).into_iter().zip(&shares) {
            let parts = share.polygons.iter().map(|polygon| area_and_centroid(&polygon.corners));
            let expected: f64 =
                parts.map(|(area, centroid)| area * light(centroid)).sum::<f64>() / share.area;
            assert!((mean / expected - 1.0).abs() <= EXACT, "{mean}, not {expected}");
        }
    }
}
