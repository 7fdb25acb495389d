use glam::DVec3;
use kernel::geometry::area_vector;
use smallvec::SmallVec;

use super::contact::{Contact, contacts};
use super::order::FacetPlaces;
use super::pieces::{cut_along, cut_long};
use super::welding::Welder;
use super::{Mesh, Patch, PatchId, VertexId, edge};
use scene::Scene;

impl Mesh {
    /// The mesh of a scene's facets, divided until no edge is longer than `longest_edge`, but no more than `max_level` times.
    /// `extent` is the scene's. Lengths are in frame units.
    /// `lines`, in the order of surfaces and facets, become edges as the contacts do; there may be none.
    #[must_use]
    pub fn new(
        scene: &Scene,
        extent: f64,
        longest_edge: f64,
        max_level: u32,
        lines: &[Vec<Vec<Contact>>],
    ) -> Self {
        let mut contacts = contacts(scene, extent, longest_edge / 16.0);
        contacts.iter_mut().flatten().zip(lines.iter().flatten()).for_each(|(own, more)| own.extend(more));
        let mut welder = Welder::default();
        let mut places = vec![];
        scene.surfaces.iter().flat_map(|surface| &surface.facets).for_each(|facet| welder.add_corners(facet));
        for (surface_index, surface) in scene.surfaces.iter().enumerate() {
            for (facet_index, facet) in surface.facets.iter().enumerate() {
                let own = &contacts[surface_index][facet_index];
                welder.add_ends(own, facet);
                for piece in cut_along(facet.corners.clone(), facet.normal, own) {
                    cut_long(piece, facet.normal, longest_edge, &mut |corners| {
                        welder.add(&corners, facet);
                        places.push((surface_index, facet_index));
                    });
                }
            }
        }
        let welded = welder.weld(|polygon| {
            let (surface, facet) = places[polygon];
            &contacts[surface][facet]
        });
        let mut mesh =
            Self { vertices: welded.vertices, facet_places: FacetPlaces::new(scene), ..Self::default() };
        for ((surface, facet), corners) in places.into_iter().zip(welded.polygons) {
            if !corners.is_empty() {
                mesh.add_leaf(surface as u32, facet as u32, corners.into(), None);
            }
        }
        mesh.divide_longer_than(longest_edge, max_level);
        mesh.order_vertices();
        mesh
    }

    fn divide_longer_than(&mut self, longest_edge: f64, max_level: u32) {
        for _ in 0..max_level {
            let leaves = self.leaves().map(|(id, _)| id);
            let long: Vec<PatchId> =
                leaves.filter(|id| self.size(*id) > longest_edge * (1.0 + 1e-9)).collect();
            if long.is_empty() {
                break;
            }
            for id in long {
                self.divide(id);
            }
        }
    }

    pub(super) fn add_leaf(
        &mut self,
        surface: u32,
        facet: u32,
        corners: SmallVec<[VertexId; 4]>,
        parent: Option<PatchId>,
    ) -> PatchId {
        let id = PatchId(self.patches.len() as u32);
        let positions: SmallVec<[DVec3; 8]> = corners.iter().map(|corner| self.position(*corner)).collect();
        let area = area_vector(&positions).length();
        self.patches.push(Patch { surface, facet, corners, first_child: None, parent, area });
        let edges: SmallVec<[_; 8]> = self.edges(id).map(|(a, b)| edge(a, b)).collect();
        for edge in edges {
            self.leaves_at.entry(edge).or_default().push(id);
        }
        id
    }
}
