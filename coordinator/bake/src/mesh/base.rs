use std::sync::atomic::{AtomicUsize, Ordering};

use glam::DVec3;
use kernel::geometry::area_vector;
use smallvec::SmallVec;

use rayon::prelude::*;

use super::contact::{Line, contacts};
use super::line::{Contact, distance_to_line};
use super::order::FacetPlaces;
use super::pieces::{Lengths, cut_along, cut_long, lengths};
use super::planar::{self, Piece, Region, regions};
use super::welding::weld;
use super::{FEW_FACETS, Mesh, Patch, PatchId, VertexId, WELD, edge};
use scene::{Facet, Scene, Surface};

/// What a mesh may have.
#[derive(Debug, Clone, Copy)]
pub struct MeshLimits {
    /// Pieces that facets are cut into; with more there is no mesh.
    pub pieces: usize,
    /// Contacts, the longest first; others are passed over.
    pub contacts: usize,
}

impl MeshLimits {
    /// None but those of every mesh.
    pub const NONE: Self = Self { pieces: usize::MAX, contacts: usize::MAX };
}

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
        // Without limits there is a mesh.
        Self::within(MeshLimits::NONE, scene, extent, longest_edge, max_level, lines).unwrap_or_default()
    }

    /// As [`Self::new`]; `None` where facets are cut into too many pieces, which is known before there is a mesh of them.
    #[must_use]
    pub fn within(
        limits: MeshLimits,
        scene: &Scene,
        extent: f64,
        longest_edge: f64,
        max_level: u32,
        lines: &[Vec<Vec<Contact>>],
    ) -> Option<Self> {
        let regions = regions(scene);
        let contacts = contacts(scene, &regions, extent, longest_edge, limits.contacts);
        let of_region = |(region, own): (&Region, &Vec<Line>)| -> Vec<Contact> {
            let of_facets = lines.get(region.surface).into_iter();
            let shadows =
                of_facets.flat_map(|facets| region.facets.iter().flat_map(|facet| &facets[*facet as usize]));
            // The edge of what hovers has its line already.
            let is_apart = |line: &&Contact| !own.iter().any(|other| other.is_beside(line));
            own.iter().map(|line| line.ends).chain(shadows.filter(is_apart).copied()).collect()
        };
        let lines_of: Vec<Vec<Contact>> = regions.par_iter().zip(&contacts).map(of_region).collect();
        let facets = scene.surfaces.iter().flat_map(Surface::lit_facets);
        let facets: Vec<&Facet> = facets.map(|(_, facet)| facet).collect();
        // Strips are what is dear there: all lines are triangulated around.
        let is_large = facets.len() > FEW_FACETS;
        let most_cuts = if is_large { 0 } else { MOST_CUTS };
        let lengths = if is_large {
            let most = MOST_CUT.max(scene.vertex_count / VERTICES_PER_CUT);
            lengths(facets.par_iter().copied(), longest_edge, most)
        } else {
            Lengths { longest: longest_edge, shortest: longest_edge }
        };
        let made = AtomicUsize::new(0);
        let pieces: Option<Vec<Vec<Piece>>> = regions
            .par_iter()
            .zip(&lines_of)
            .map(|(region, lines)| {
                let pieces = pieces_of(scene, region, lines, most_cuts, lengths);
                let before = made.fetch_add(pieces.len(), Ordering::Relaxed);
                (before + pieces.len() <= limits.pieces).then_some(pieces)
            })
            .collect();
        let pieces = pieces?;
        let facet = |surface: usize, facet: u32| &scene.surfaces[surface].facets[facet as usize];
        let with_facets: Vec<(&Facet, &Piece)> = regions
            .iter()
            .zip(&pieces)
            .flat_map(|(region, pieces)| {
                pieces.iter().map(move |piece| (facet(region.surface, piece.facet), piece))
            })
            .collect();
        let welded = weld(&facets, &with_facets);
        let places = regions.iter().zip(&contacts).zip(&pieces);
        let places = places.flat_map(|((region, lines), pieces)| {
            pieces.iter().map(move |piece| (region.surface as u32, piece, lines))
        });
        let mut mesh = Self {
            vertices: welded.vertices,
            facet_places: FacetPlaces::new(scene),
            has_lines: lines.iter().flatten().any(|own| !own.is_empty()),
            ..Self::default()
        };
        mesh.patches.reserve(welded.polygons.len());
        for ((surface, piece, lines), corners) in places.zip(welded.polygons) {
            if !corners.is_empty() {
                mesh.mark_hovering(&corners, piece, lines);
                mesh.add_leaf(surface, piece.facet, corners.into(), None);
            }
        }
        mesh.divide_longer_than(longest_edge, max_level);
        mesh.order_vertices();
        Some(mesh)
    }

    /// Marks the corners of a piece that lie on the outline of what hovers, with the least height over them.
    fn mark_hovering(&mut self, corners: &[VertexId], piece: &Piece, lines: &[Line]) {
        for ends in &piece.lines {
            let height = lines.iter().find(|line| line.ends == *ends).map_or(0.0, |line| line.height);
            if height <= 0.0 {
                continue;
            }
            for corner in corners {
                let vertex = &mut self.vertices[corner.index()];
                if distance_to_line(vertex.position, ends) < WELD {
                    vertex.hovering = Some(vertex.hovering.map_or(height, |other| height.min(other)));
                }
            }
        }
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
        if let Some(mut leaves_at) = self.leaves_at.take() {
            self.edges(id).for_each(|(a, b)| leaves_at.add(edge(a, b), id));
            self.leaves_at = Some(leaves_at);
        }
        id
    }
}

/// Most thin facets shorter than the longest edge that are cut across in a large scene, at least.
const MOST_CUT: usize = 1024;

/// One more may be cut for this many vertices of the scene.
const VERTICES_PER_CUT: usize = 64;

/// Regions with more lines than this are triangulated around them. Few lines cut facets from border to border: patches stay
/// rectangles, and have the light of a turned or mirrored scene to the last digits.
const MOST_CUTS: usize = 32;

/// Part of the longest edge down to which the triangles around lines are made finer for their shape's sake.
const FINEST: f64 = 1.0 / 16.0;

/// The pieces of a region: cut along its lines where these run through it, and across where they are long.
fn pieces_of(
    scene: &Scene,
    region: &Region,
    lines: &[Contact],
    most_cuts: usize,
    lengths: Lengths,
) -> Vec<Piece> {
    let facets = region.facets(scene);
    let runs_through = |line: &Contact| facets.iter().any(|(_, facet)| is_inside(facet, line));
    if lines.len() > most_cuts
        && lines.iter().any(runs_through)
        && let Some(pieces) = planar::pieces(&facets, lines, FINEST * lengths.longest)
    {
        return pieces;
    }
    // Most facets stay whole.
    let mut pieces = Vec::with_capacity(facets.len());
    for (index, facet) in facets {
        let (cuts, own) = if lines.len() > most_cuts {
            let on_border: Vec<Contact> =
                lines.iter().filter(|line| is_on_border(facet, line)).copied().collect();
            (&[][..], on_border)
        } else {
            (lines, lines.to_vec())
        };
        for piece in cut_along(facet.corners.clone(), facet.normal, cuts) {
            cut_long(piece, facet.normal, lengths, &mut |corners| {
                pieces.push(Piece { facet: index, corners, lines: own.clone() });
            });
        }
    }
    pieces
}

/// Whether a line lies on an edge of a facet.
fn is_on_border(facet: &Facet, line: &Contact) -> bool {
    let next = facet.positions().cycle().skip(1);
    facet.positions().zip(next).any(|(a, b)| line.iter().all(|end| distance_to_line(*end, &[a, b]) < WELD))
}

/// Whether a line runs through the inside of a facet.
fn is_inside(facet: &Facet, line: &Contact) -> bool {
    let middle = (line[0] + line[1]) / 2.0;
    let next = facet.positions().cycle().skip(1);
    facet
        .positions()
        .zip(next)
        .all(|(from, to)| facet.normal.cross((to - from).normalize_or_zero()).dot(middle - from) > WELD)
}
