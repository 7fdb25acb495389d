//! What dividing patches revealed of the error of interpolation.

use glam::DVec3;
use rayon::prelude::*;
use smallvec::SmallVec;

use crate::mesh::{Mesh, PatchId, VertexId};

/// Patches that a thread takes at least.
const AT_ONCE: usize = 1024;

/// Light at the new vertices of a divided patch minus what was interpolated there before.
pub(super) struct Revealed {
    /// At the middle of each edge, in the order of the corners.
    pub middles: SmallVec<[DVec3; 4]>,
    /// At the centroid.
    pub centre: DVec3,
}

/// The same of all patches of a mesh, for one light.
#[derive(Default)]
pub struct RevealedErrors {
    /// None where a patch is whole.
    of_patches: Vec<Option<Box<Revealed>>>,
}

impl RevealedErrors {
    /// Of this light, one value for each vertex.
    #[must_use]
    pub fn new(mesh: &Mesh, light: &[DVec3]) -> Self {
        let mut all = Self::default();
        all.follow(mesh, light);
        all
    }

    /// Adds those of patches that were divided since. The light of the vertices that there were before must be the same.
    pub fn follow(&mut self, mesh: &Mesh, light: &[DVec3]) {
        self.of_patches.resize_with(mesh.patches.len(), || None);
        let all = self.of_patches.par_iter_mut().enumerate().with_min_len(AT_ONCE);
        all.for_each(|(index, revealed)| {
            if revealed.is_none() && mesh.patches[index].first_child.is_some() {
                *revealed = Some(Box::new(revealed_by(mesh, PatchId(index as u32), light)));
            }
        });
    }

    /// Those of a patch, if it was divided.
    pub(super) fn of(&self, id: PatchId) -> Option<&Revealed> {
        self.of_patches[id.index()].as_deref()
    }
}

fn revealed_by(mesh: &Mesh, id: PatchId, light: &[DVec3]) -> Revealed {
    let patch = mesh.patch(id);
    let at = |vertex: VertexId| light[vertex.index()];
    let middles = mesh
        .edges(id)
        .map(|(a, b)| mesh.middle_of(a, b).map_or(DVec3::ZERO, |middle| at(middle) - (at(a) + at(b)) * 0.5))
        .collect();
    let mean = patch.corners.iter().map(|corner| at(*corner)).sum::<DVec3>() / patch.corners.len() as f64;
    // The centre is the third corner of every child.
    let centre = patch.first_child.map_or(mean, |child| at(mesh.patch(child).corners[2]));
    Revealed { middles, centre: centre - mean }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::{facet, scene};

    /// Light that is curved everywhere.
    fn light(mesh: &Mesh) -> Vec<DVec3> {
        mesh.vertices.iter().map(|vertex| (vertex.position * 0.01).map(|x| x.sin() + x * x)).collect()
    }

    #[test]
    fn what_follows_a_mesh_is_what_would_be_found_anew() {
        let wall = facet(0, &[[0.0, 0.0, 0.0], [0.0, 0.0, 400.0], [400.0, 0.0, 400.0], [400.0, 0.0, 0.0]]);
        let corner = facet(1, &[[0.0, 0.0, 0.0], [0.0, 0.0, 400.0], [0.0, 400.0, 0.0]]);
        let scene = scene(vec![vec![wall, corner]], vec![]);
        let mut mesh = Mesh::new(&scene, 400.0, 200.0, 0, &[]);
        let mut followed = RevealedErrors::new(&mesh, &light(&mesh));
        for _ in 0..3 {
            // Those at one end: coarser neighbours are divided, too.
            let (id, _) = mesh.leaves().last().unwrap();
            mesh.divide(id);
            followed.follow(&mesh, &light(&mesh));
        }
        let anew = RevealedErrors::new(&mesh, &light(&mesh));
        let divided = |all: &RevealedErrors| -> Vec<(PatchId, Vec<DVec3>)> {
            let of = |id| all.of(id).map(|own| (id, [own.middles.as_slice(), &[own.centre]].concat()));
            (0..mesh.patches.len() as u32).map(PatchId).filter_map(of).collect()
        };
        assert!(divided(&anew).len() >= 3);
        assert_eq!(divided(&followed), divided(&anew));
    }
}
