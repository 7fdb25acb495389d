//! Which vertices can go.

use glam::DVec3;
use smallvec::SmallVec;

use super::linear::LightIn;
use super::working::{NONE, Working};

/// Triangles lower than this, relative to the extent, are not made: their corners would lie on each other's edges.
const LEAST_HEIGHT: f64 = 8e-6;

/// A position this close to a line, relative to the extent, lies on it.
const STRAIGHT: f64 = 1e-6;

/// Cost of the worst shape, in limits: among collapses that change little, better triangles.
const COST_OF_SHAPE: f64 = 0.1;

/// A collapse that costs less than this is taken without a look at others.
const CHEAP: f64 = 0.1;

/// A collapse of a point into another one.
#[derive(Debug, Clone, Copy)]
pub struct Collapse {
    pub into: u32,
    pub cost: f64,
}

/// Where a point may go.
enum Ways {
    /// It stays.
    None,
    /// Along the straight edge that it divides.
    Along([u32; 2]),
    /// Anywhere: it lies inside a region.
    Any,
}

/// What a collapse changes, by corner of its point.
pub type Moves = SmallVec<[Move; 2]>;

/// What changes where a corner goes.
pub struct Move {
    corner: u32,
    /// Where it goes.
    target: u32,
    /// Triangles that change: their corners, none where they are gone, and their samples.
    triangles: Vec<(u32, [u32; 3], Vec<u32>)>,
}

/// The triangles of one region around a corner, with the corner moved.
struct Sector {
    old: SmallVec<[u32; 8]>,
    new: SmallVec<[(u32, [u32; 3]); 8]>,
}

impl Working {
    /// The cheapest collapse of a point, if one costs less than a limit.
    pub fn best_collapse(&self, point: u32) -> Option<Collapse> {
        let targets: SmallVec<[u32; 8]> = match self.ways(point) {
            Ways::None => return None,
            Ways::Along(ends) => ends.into_iter().collect(),
            Ways::Any => self.neighbours(point),
        };
        let mut best: Option<Collapse> = None;
        for into in targets {
            let bound = best.map_or(1.0, |best| best.cost);
            if let Some(cost) = self.cost(point, into, bound)
                && best.is_none_or(|best| cost < best.cost)
            {
                best = Some(Collapse { into, cost });
                if cost < CHEAP {
                    break;
                }
            }
        }
        best
    }

    /// Points that share a triangle with a point.
    pub fn neighbours(&self, point: u32) -> SmallVec<[u32; 8]> {
        let mut found = SmallVec::new();
        for corner in &self.points[point as usize] {
            for triangle in &self.corners[*corner as usize].around {
                for other in self.triangles[*triangle as usize].corners {
                    let other = self.corners[other as usize].point;
                    if other != point && !found.contains(&other) {
                        found.push(other);
                    }
                }
            }
        }
        found
    }

    fn ways(&self, point: u32) -> Ways {
        let mut ends: SmallVec<[u32; 4]> = SmallVec::new();
        for corner in &self.points[point as usize] {
            for triangle in &self.corners[*corner as usize].around {
                for other in self.triangles[*triangle as usize].corners {
                    if other == *corner || self.both_sides(*corner, other).is_some() {
                        continue;
                    }
                    let end = self.corners[other as usize].point;
                    if !ends.contains(&end) {
                        ends.push(end);
                        if ends.len() > 2 {
                            return Ways::None;
                        }
                    }
                }
            }
        }
        match ends[..] {
            [] => Ways::Any,
            [a, b] if self.is_between(point, a, b) => Ways::Along([a, b]),
            _ => Ways::None,
        }
    }

    /// Position of a point.
    fn place(&self, point: u32) -> DVec3 {
        self.at(self.points[point as usize][0])
    }

    fn is_between(&self, point: u32, a: u32, b: u32) -> bool {
        let [at, a, b] = [point, a, b].map(|point| self.place(point));
        let along = (b - a).normalize_or_zero();
        let part = (at - a).dot(along);
        (at - a - along * part).length() <= STRAIGHT * self.extent && part > 0.0 && part < a.distance(b)
    }

    /// Cost of a collapse, unless it deviates by `most` limits or more, or turns a triangle.
    fn cost(&self, point: u32, into: u32, most: f64) -> Option<f64> {
        let mut sectors: SmallVec<[(u32, Sector); 2]> = SmallVec::new();
        let mut shape = 1.0_f64;
        for corner in &self.points[point as usize] {
            for sector in self.sectors(*corner, into)? {
                shape = shape.min(self.check_shape(&sector)?);
                sectors.push((*corner, sector));
            }
        }
        let of_shape = COST_OF_SHAPE * (1.0 - shape);
        let mut worst = 0.0_f64;
        let most_square = (most - of_shape).max(0.0).powi(2);
        for (corner, sector) in &sectors {
            worst = worst.max(self.deviation(*corner, sector, most_square)?);
        }
        Some(worst.sqrt() + of_shape)
    }

    /// The corner of a point that a corner is joined with by an edge; only where there is one.
    fn partner(&self, corner: u32, into: u32) -> Option<u32> {
        let mut found = NONE;
        for triangle in &self.corners[corner as usize].around {
            for other in self.triangles[*triangle as usize].corners {
                if self.corners[other as usize].point == into && found != other {
                    if found != NONE {
                        return None;
                    }
                    found = other;
                }
            }
        }
        (found != NONE).then_some(found)
    }

    fn sectors(&self, corner: u32, into: u32) -> Option<SmallVec<[Sector; 2]>> {
        let target = self.partner(corner, into)?;
        let mut regions: SmallVec<[u32; 2]> = SmallVec::new();
        let mut sectors: SmallVec<[Sector; 2]> = SmallVec::new();
        for index in &self.corners[corner as usize].around {
            let triangle = &self.triangles[*index as usize];
            let place = regions.iter().position(|region| *region == triangle.region).unwrap_or_else(|| {
                regions.push(triangle.region);
                sectors.push(Sector { old: SmallVec::new(), new: SmallVec::new() });
                regions.len() - 1
            });
            sectors[place].old.push(*index);
            if !triangle.corners.contains(&target) {
                let moved = triangle.corners.map(|own| if own == corner { target } else { own });
                sectors[place].new.push((*index, moved));
            }
        }
        Some(sectors)
    }

    /// The worst shape of a sector's triangles, from 0 to 1; `None` where one is turned or too low, or the area changes.
    fn check_shape(&self, sector: &Sector) -> Option<f64> {
        let region = self.triangles[sector.old[0] as usize].region;
        let mut worst = 1.0_f64;
        let (mut before, mut after) = (0.0, 0.0);
        for index in &sector.old {
            before += self.doubled_area(region, self.triangles[*index as usize].corners);
        }
        for (_, corners) in &sector.new {
            let (area, quality) = self.shape(region, *corners)?;
            after += area;
            worst = worst.min(quality);
        }
        let slack = 2.0 * STRAIGHT * self.extent * before.abs().sqrt() + 1e-9 * before.abs();
        (!sector.new.is_empty() && (before - after).abs() <= slack).then_some(worst)
    }

    fn doubled_area(&self, region: u32, corners: [u32; 3]) -> f64 {
        let [a, b, c] = corners.map(|corner| self.flat(region, corner));
        (b - a).perp_dot(c - a)
    }

    /// Twice the area of a triangle as its region sees it, and its shape: 1 if equilateral, near 0 if flat. `None` where it is
    /// turned or too low.
    pub fn shape(&self, region: u32, corners: [u32; 3]) -> Option<(f64, f64)> {
        let [a, b, c] = corners.map(|corner| self.flat(region, corner));
        let area = (b - a).perp_dot(c - a);
        let squares = [a.distance_squared(b), b.distance_squared(c), c.distance_squared(a)];
        let longest = squares.into_iter().fold(0.0, f64::max).sqrt();
        let is_high = area > LEAST_HEIGHT * self.extent * longest;
        let equilateral = 2.0 * 3.0_f64.sqrt();
        is_high.then(|| (area, equilateral * area / squares.into_iter().sum::<f64>()))
    }

    /// Largest squared deviation in a sector over its limit; `None` where it is `most` or more.
    fn deviation(&self, corner: u32, sector: &Sector, most: f64) -> Option<f64> {
        let region = self.triangles[sector.old[0] as usize].region;
        // Where a sample deviates too much the first do, in a few of the triangles.
        let mut lights: SmallVec<[Option<LightIn>; 8]> = SmallVec::from_elem(None, sector.new.len());
        let samples = sector.old.iter().flat_map(|index| &self.triangles[*index as usize].samples);
        let mut worst = 0.0_f64;
        for sample in [corner].iter().chain(samples) {
            let sample = &self.samples[*sample as usize];
            let of = |(light, (_, corners)): (&mut Option<LightIn>, &(u32, [u32; 3]))| {
                *light.get_or_insert_with(|| self.light_between(region, *corners))
            };
            let (_, light, weights) = under(lights.iter_mut().zip(&sector.new).map(of), sample.position)?;
            let square = light.deviation(weights, sample).length_squared() / sample.limit;
            if square >= most || square.is_nan() {
                return None;
            }
            worst = worst.max(square);
        }
        Some(worst)
    }

    /// What a collapse changes.
    pub fn moves(&self, point: u32, into: u32) -> Moves {
        let moves = |corner: &u32| {
            let (target, sectors) = (self.partner(*corner, into)?, self.sectors(*corner, into)?);
            let triangles = sectors.into_iter().flat_map(|sector| self.after(*corner, &sector));
            Some(Move { corner: *corner, target, triangles: triangles.collect() })
        };
        self.points[point as usize].iter().filter_map(moves).collect()
    }

    /// The triangles of a sector after its corner has moved: their corners, none where they are gone, and their samples.
    fn after(&self, corner: u32, sector: &Sector) -> Vec<(u32, [u32; 3], Vec<u32>)> {
        let region = self.triangles[sector.old[0] as usize].region;
        let lights: SmallVec<[LightIn; 8]> =
            sector.new.iter().map(|(_, corners)| self.light_between(region, *corners)).collect();
        let mut all: Vec<_> = sector.new.iter().map(|(index, corners)| (*index, *corners, vec![])).collect();
        let samples = sector.old.iter().flat_map(|index| &self.triangles[*index as usize].samples);
        for sample in [corner].iter().chain(samples) {
            let position = self.samples[*sample as usize].position;
            if let Some((place, ..)) = under(lights.iter().copied(), position) {
                all[place].2.push(*sample);
            }
        }
        let is_new = |index: &u32| sector.new.iter().any(|(new, _)| new == index);
        all.extend(sector.old.iter().filter(|index| !is_new(index)).map(|index| (*index, [NONE; 3], vec![])));
        all
    }

    /// Carries a collapse out, as long as nothing around it has changed since its moves were found.
    pub fn collapse(&mut self, point: u32, moves: Moves) {
        self.points[point as usize].clear();
        for Move { corner, target, triangles } in moves {
            for (index, corners, samples) in triangles {
                let triangle = &mut self.triangles[index as usize];
                triangle.samples = samples;
                let before = std::mem::replace(&mut triangle.corners, corners);
                if corners[0] == NONE {
                    for other in before {
                        self.corners[other as usize].around.retain(|around| *around != index);
                    }
                } else {
                    self.corners[target as usize].around.push(index);
                }
            }
            self.corners[corner as usize].around.clear();
        }
    }

    /// Deals samples out to the triangles of one region that they lie in.
    pub fn deal_out(&mut self, samples: Vec<u32>, among: &[u32]) {
        let lights: SmallVec<[LightIn; 8]> =
            among.iter().map(|index| self.light_in(&self.triangles[*index as usize])).collect();
        for sample in samples {
            let position = self.samples[sample as usize].position;
            if let Some((place, ..)) = under(lights.iter().copied(), position) {
                self.triangles[among[place] as usize].samples.push(sample);
            }
        }
    }
}

/// The triangle that a position lies in, or is least far outside of: its place among these, its light, and its weights. Later ones are
/// not looked at.
pub fn under(lights: impl IntoIterator<Item = LightIn>, position: DVec3) -> Option<(usize, LightIn, DVec3)> {
    let mut best: Option<(usize, LightIn, DVec3)> = None;
    let mut most = f64::NEG_INFINITY;
    for (index, light) in lights.into_iter().enumerate() {
        let weights = light.weights(position);
        let least = weights.min_element();
        if least > most || best.is_none() {
            best = Some((index, light, weights));
            most = most.max(least);
            if least >= 0.0 {
                break;
            }
        }
    }
    best
}
