//! The point of each texel: in the middle of the part of the surface that it covers and that is open to light.

use glam::{DVec2, DVec3};
use kernel::hemisphere::{SeenPolygons, directions};
use kernel::replica::Receiver;
use rayon::prelude::*;
use scene::{Scene, Side};

use crate::error::{LightmapError, Stop};
use crate::lattice::{Around, COARSEST, around, lattice};
use crate::layout::barycentric;
use crate::pieces::{Piece, beside, pieces};
use crate::sides::LitSide;
use crate::unwrap::Pages;

/// Rays that tell whether a point lies inside of something.
const RAYS: u32 = 16;

/// Most rays of a point inside of something that do not meet backs of surfaces: in the corner of two sheets seen from behind it is a
/// quarter of them.
const MOST_FREE: usize = 1;

/// Points per side of a texel that lies partly inside of something.
const SUB: u32 = 4;

/// How far points on curved surfaces are lifted, relative to the size of their triangle: facets around may rise over them.
const LIFT: f64 = 1e-3;

/// A texel without a point.
pub const NO_POINT: u32 = u32::MAX;

/// Covered texels and their points.
pub struct Texels {
    /// Number of each covered texel: page, row, column. Rising.
    pub texels: Vec<u32>,
    /// Index of the point of each; [`NO_POINT`] where it lies inside of something.
    pub point_of: Vec<u32>,
    /// Whether each lies inside of something whose backs are lit, too: if it is dark there, nobody looks in.
    pub may_be_hidden: Vec<bool>,
    /// The points: those of coarse lattices first.
    pub points: Vec<Receiver>,
    /// For each point, those around it whose mean light may be its own.
    pub around: Vec<Option<Around>>,
}

/// A point of a surface, and whether only backs that are lit are around it.
type Point = (Receiver, bool);

/// Finds the points of all texels.
pub fn texels(scene: &Scene, sides: &[LitSide], pages: &Pages, stop: Stop) -> Result<Texels, LightmapError> {
    let pieces = pieces(sides, pages, stop)?;
    let of_texels: Vec<&[Piece]> = pieces.chunk_by(|a, b| a.texel == b.texel).collect();
    let facets =
        || scene.surfaces.iter().flat_map(|own| own.facets.iter().map(move |facet| (own.side, facet)));
    let polygons: Vec<_> = facets().map(|(_, facet)| facet.polygon()).collect();
    let surroundings = Surroundings {
        sides,
        pages,
        seen: SeenPolygons::new(&polygons, &[]),
        is_back: facets().map(|(side, _)| side == Side::Back).collect(),
    };
    let checked = |work: &(dyn Fn(usize) -> Option<Point> + Sync)| -> Result<Vec<_>, LightmapError> {
        let all: Vec<_> = (0..of_texels.len())
            .into_par_iter()
            .with_min_len(256)
            .map(|index| if index % 256 == 0 && stop() { None } else { Some(work(index)) })
            .collect();
        all.into_iter().collect::<Option<Vec<_>>>().ok_or(LightmapError::Cancelled)
    };
    let whole = checked(&|index| surroundings.whole(of_texels[index]))?;
    // Only next to texels inside of something can one be inside in part.
    let is_mixed = |index: usize| {
        let kind = |index: usize| whole[index].map(|(_, may_be_hidden)| may_be_hidden);
        let mut others = beside(of_texels[index][0].texel, pages.size);
        others.any(|other| index_of(&of_texels, other).is_some_and(|other| kind(other) != kind(index)))
    };
    let found = checked(&|index| {
        if is_mixed(index) { surroundings.part(of_texels[index]) } else { whole[index] }
    })?;
    drop(whole);
    numbered(&of_texels, &found, pages.size, stop)
}

/// Index of a texel among those with pieces.
fn index_of(of_texels: &[&[Piece]], texel: u32) -> Option<usize> {
    of_texels.binary_search_by_key(&texel, |pieces| pieces[0].texel).ok()
}

/// Numbers the points that were found of texels, and finds those around each.
fn numbered(
    of_texels: &[&[Piece]],
    found: &[Option<Point>],
    [width, height]: [u32; 2],
    stop: Stop,
) -> Result<Texels, LightmapError> {
    let place = |index: usize| {
        let texel = of_texels[index][0].texel;
        [texel / (width * height), texel % width, texel / width % height]
    };
    // Coarse lattices first.
    let is_of = |index: usize, own: u32| {
        let [_, x, y] = place(index);
        found[index].is_some() && lattice([x, y]) == own
    };
    let of = |own: u32| (0..found.len()).filter(move |index| is_of(*index, own));
    let order: Vec<usize> = (0..=COARSEST).rev().flat_map(of).collect();
    let mut point_of = vec![NO_POINT; found.len()];
    order.iter().zip(0..).for_each(|(index, point)| point_of[*index] = point);
    let may_be_hidden: Vec<bool> =
        found.iter().map(|point| point.is_some_and(|(_, may_be)| may_be)).collect();
    let placed = |index: &usize| found[*index].map(|(receiver, _)| (receiver, place(*index)));
    let points: Vec<(Receiver, [u32; 3])> = order.iter().filter_map(placed).collect();
    let point_at = |[page, x, y]: [u32; 3]| {
        let is_on_page = x < width && y < height;
        let texel = is_on_page.then(|| (page * height + y) * width + x)?;
        let index = index_of(of_texels, texel)?;
        Some(point_of[index]).filter(|point| *point != NO_POINT)
    };
    let are_alike = |a: u32, b: u32| {
        let [a, b] = [a, b].map(|point| order[point as usize]);
        may_be_hidden[a] == may_be_hidden[b]
    };
    let around = around(&points, point_at, are_alike, stop).ok_or(LightmapError::Cancelled)?;
    let points = points.into_iter().map(|(receiver, _)| receiver).collect();
    let texels = of_texels.iter().map(|pieces| pieces[0].texel).collect();
    Ok(Texels { texels, point_of, may_be_hidden, points, around })
}

/// What stands around texels.
struct Surroundings<'a> {
    sides: &'a [LitSide],
    pages: &'a Pages,
    seen: SeenPolygons,
    /// Which of the polygons are backs of surfaces that are lit from both sides.
    is_back: Vec<bool>,
}

impl Surroundings<'_> {
    /// The middle of a texel's pieces, unless it lies inside of something.
    fn whole(&self, pieces: &[Piece]) -> Option<Point> {
        let area: f64 = pieces.iter().map(|piece| f64::from(piece.area)).sum();
        let middle = pieces.iter().map(|piece| piece.middle * f64::from(piece.area)).sum::<DVec2>() / area;
        self.open(pieces, middle)
    }

    /// The middle of the part of a texel's pieces that is not inside of something: of the part with the least around it.
    fn part(&self, pieces: &[Piece]) -> Option<Point> {
        let width = self.pages.size[0];
        let texel = pieces[0].texel % (width * self.pages.size[1]);
        let corner = DVec2::new(f64::from(texel % width), f64::from(texel / width));
        let points: Vec<(DVec2, bool)> = (0..SUB * SUB)
            .map(|index| {
                let place = DVec2::new(f64::from(index % SUB), f64::from(index / SUB));
                corner + (place + 0.5) / f64::from(SUB)
            })
            .filter(|place| self.holding(pieces, *place).is_some_and(|(_, depth)| depth >= 0.0))
            .filter_map(|place| Some((place, self.open(pieces, place)?.1)))
            .collect();
        let may_be_hidden = points.iter().all(|(_, may_be)| *may_be);
        let best = || points.iter().filter(|(_, may_be)| *may_be == may_be_hidden).map(|(place, _)| *place);
        let middle = best().sum::<DVec2>() / best().count().max(1) as f64;
        let nearest =
            best().min_by(|a, b| a.distance_squared(middle).total_cmp(&b.distance_squared(middle)))?;
        let in_middle = self.open(pieces, middle).filter(|(_, may_be)| *may_be == may_be_hidden);
        in_middle.or_else(|| self.open(pieces, nearest))
    }

    /// The point of the surface at a place of the page, unless it lies inside of something.
    fn open(&self, pieces: &[Piece], place: DVec2) -> Option<Point> {
        let receiver = self.receiver(pieces, place)?;
        let (mut free, mut lit_backs) = (0, 0);
        // Most points see a front or nothing soon.
        for (_, direction) in directions(receiver.normal, RAYS, 0) {
            match self.seen.nearest(receiver.position, direction, 0.0, receiver.plane) {
                Some(hit) if !hit.is_front => {}
                Some(hit) if self.is_back[hit.polygon] => lit_backs += 1,
                _ => free += 1,
            }
            if free > MOST_FREE {
                return Some((receiver, false));
            }
        }
        (lit_backs > 0).then_some((receiver, true))
    }

    /// The piece whose triangle holds a place, or is least far from it, and how deep inside it lies.
    fn holding<'p>(&self, pieces: &'p [Piece], place: DVec2) -> Option<(&'p Piece, f64)> {
        let depth = |piece: &'p Piece| {
            let corners =
                self.pages.layouts[piece.side as usize].corners(piece.triangle as usize, self.pages.size);
            let weights = barycentric(corners, place)?;
            Some((piece, weights.into_iter().fold(f64::INFINITY, f64::min)))
        };
        pieces.iter().filter_map(depth).reduce(|a, b| if b.1 > a.1 { b } else { a })
    }

    fn receiver(&self, pieces: &[Piece], place: DVec2) -> Option<Receiver> {
        let (piece, _) = self.holding(pieces, place)?;
        let side = &self.sides[piece.side as usize];
        let triangle = &side.triangles[piece.triangle as usize];
        let corners =
            self.pages.layouts[piece.side as usize].corners(piece.triangle as usize, self.pages.size);
        let weights = barycentric(corners, place)?.map(|weight| weight.max(0.0));
        let sum: f64 = weights.iter().sum();
        let mean = |values: [DVec3; 3]| {
            values.iter().zip(weights).map(|(value, weight)| *value * (weight / sum)).sum::<DVec3>()
        };
        let normal = mean(triangle.normals).try_normalize()?;
        let lift = if triangle.is_smooth { LIFT * side.area(triangle).sqrt() } else { 0.0 };
        Some(Receiver {
            position: mean(side.corners(triangle)) + normal * lift,
            normal,
            plane: triangle.plane,
        })
    }
}
