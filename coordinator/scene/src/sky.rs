//! A sky whose radiance differs by direction, in cells that bring the light of an image with as few polygons as it needs.
//!
//! The image is summed over the cells of a quadtree on each face of a cube. A bake takes the coarsest cells, then divides those first
//! whose radiance varies most times their solid angle: a sun becomes a cell of its own size, a clear sky stays in large ones. A cell's
//! radiance is its mean: what comes from it in all is right however coarse it is.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use document::sky::{SkyImage, solid_angle_on_cube};
use glam::DVec3;

/// Most levels of the quadtree: 512 cells along an edge of the cube, .22 degrees each in the middle of a face.
const MOST_LEVELS: usize = 9;

/// Cells this many times as bright as the mean are those of suns.
const BRIGHT: f64 = 16.0;

/// Channels that differ by less than this are the same.
const ROUNDING: f64 = 1e-6;

/// Level of the coarsest cells: a smaller polygon is more often wholly hidden by one wall, and fewer occluders stand before it.
const FIRST_LEVEL: usize = 2;

/// Radiance by direction.
#[derive(Debug)]
pub struct SkyPattern {
    /// For each level of the quadtree, the cells of each face row by row.
    levels: Vec<Vec<Sum>>,
}

/// What comes from a part of the sky.
#[derive(Debug, Clone, Copy, Default)]
struct Sum {
    /// Radiance times solid angle.
    flux: DVec3,
    /// Square of the sum of the channels, times solid angle.
    square: f64,
    /// Steradians.
    solid_angle: f64,
}

impl Sum {
    fn add(&mut self, other: &Self) {
        self.flux += other.flux;
        self.square += other.square;
        self.solid_angle += other.solid_angle;
    }

    /// Standard deviation of the radiance within it, times its solid angle: most of the flux that may seem to come from another place.
    fn deviation(&self) -> f64 {
        let flux = self.flux.element_sum();
        (self.square * self.solid_angle - flux * flux).max(0.0).sqrt()
    }
}

/// A square on a face of the cube, with one radiance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SkyCell {
    /// Faces in the order -X, +X, -Y, +Y, -Z, +Z.
    pub face: usize,
    /// Cells along an edge of the cube at its level.
    pub along_edge: usize,
    /// Its row, along the axis after that of the face.
    pub row: usize,
    /// Its column, along the axis after that.
    pub column: usize,
    /// Its mean radiance, relative to that of the whole sky in each channel.
    pub radiance: DVec3,
    /// Part of all light of the sky that comes from it.
    pub part: f64,
}

/// A cell that may be divided: that whose radiance varies most first, then in the order of the image.
struct Candidate {
    deviation: f64,
    level: usize,
    index: usize,
}

impl Ord for Candidate {
    fn cmp(&self, other: &Self) -> Ordering {
        let place = |candidate: &Self| (candidate.level, candidate.index);
        self.deviation.total_cmp(&other.deviation).then_with(|| place(other).cmp(&place(self)))
    }
}

impl PartialOrd for Candidate {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Candidate {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Candidate {}

impl SkyPattern {
    /// Sums an image up.
    #[must_use]
    pub fn new(image: &SkyImage) -> Self {
        let around = image.texels_around();
        let last = ((around / 4).max(1).ilog2() as usize).clamp(FIRST_LEVEL, MOST_LEVELS);
        let edge = 1usize << last;
        // Parts of texels are smaller than cells, also in the corners of the cube, where these are a third as wide.
        let division = (16 * edge).div_ceil(around).clamp(1, 64);
        let mut cells = vec![Sum::default(); 6 * edge * edge];
        let mut whole = Sum::default();
        image.each_part(division, |direction, solid_angle, radiance| {
            let sum = radiance.element_sum();
            let part = Sum { flux: radiance * solid_angle, square: sum * sum * solid_angle, solid_angle };
            cells[cell_of(direction, edge)].add(&part);
            whole.add(&part);
        });
        // Parts fall into one cell or the next as a whole: cells get their own solid angles, and all together the light of the image. A
        // sun's flux counts as it is, wherever its parts fell.
        let bright = BRIGHT * whole.flux.element_sum() / whole.solid_angle;
        let mut found = DVec3::ZERO;
        for (index, cell) in cells.iter_mut().enumerate().filter(|(_, cell)| cell.solid_angle > 0.0) {
            let exact = solid_angle_of(index, edge);
            let is_sun = cell.flux.element_sum() > bright * cell.solid_angle;
            let factor = if is_sun { 1.0 } else { exact / cell.solid_angle };
            *cell = Sum { flux: cell.flux * factor, square: cell.square * factor, solid_angle: exact };
            found += cell.flux;
        }
        let factor = whole.flux.element_sum() / found.element_sum();
        if factor.is_finite() {
            for cell in &mut cells {
                cell.flux *= factor;
                cell.square *= factor * factor;
            }
        }
        let mut levels = vec![cells];
        for level in (0..last).rev() {
            let edge = 1usize << level;
            let finer = &levels[levels.len() - 1];
            let coarser = (0..6 * edge * edge).map(|index| {
                let mut sum = Sum::default();
                children(index, edge).for_each(|child| sum.add(&finer[child]));
                sum
            });
            let coarser = coarser.collect();
            levels.push(coarser);
        }
        levels.reverse();
        Self { levels }
    }

    fn whole(&self) -> DVec3 {
        self.levels[0].iter().map(|face| face.flux).sum()
    }

    /// Whether no light comes from it.
    #[must_use]
    pub fn is_dark(&self) -> bool {
        self.whole() == DVec3::ZERO
    }

    /// Mean radiance over all directions.
    #[must_use]
    pub fn mean(&self) -> DVec3 {
        self.whole() / (4.0 * std::f64::consts::PI)
    }

    /// Whether all of it has the colour of its mean.
    #[must_use]
    pub fn has_one_colour(&self) -> bool {
        let finest = self.levels.last().into_iter().flatten();
        let mut radiances = finest.map(|cell| self.relative(cell.flux / cell.solid_angle));
        radiances.all(|radiance| (radiance - radiance.x).abs().max_element() <= ROUNDING * radiance.x)
    }

    /// Radiance relative to the mean; 0 in channels where there is none.
    fn relative(&self, radiance: DVec3) -> DVec3 {
        let mean = self.mean();
        DVec3::select(mean.cmpgt(DVec3::ZERO), radiance / mean, DVec3::ZERO)
    }

    /// Cells that cover all directions: at most `most`, and fewer where their radiance varies by less than `tolerance` of the whole.
    #[must_use]
    pub fn cells(&self, most: usize, tolerance: f64) -> Vec<SkyCell> {
        let candidate = |level: usize, index: usize| Candidate {
            deviation: self.levels[level][index].deviation(),
            level,
            index,
        };
        let mut open: BinaryHeap<Candidate> =
            (0..self.levels[FIRST_LEVEL].len()).map(|index| candidate(FIRST_LEVEL, index)).collect();
        let mut count = open.len();
        let mut left: f64 = open.iter().map(|cell| cell.deviation).sum();
        let enough = tolerance * self.whole().element_sum();
        let mut cells = vec![];
        while let Some(worst) = open.pop() {
            if count + 3 > most || left <= enough || worst.level + 1 == self.levels.len() {
                cells.push((worst.level, worst.index));
                continue;
            }
            left -= worst.deviation;
            count += 3;
            for child in children(worst.index, 1 << worst.level) {
                let child = candidate(worst.level + 1, child);
                left += child.deviation;
                open.push(child);
            }
        }
        cells.sort_unstable();
        cells.into_iter().map(|(level, index)| self.cell(level, index)).collect()
    }

    fn cell(&self, level: usize, index: usize) -> SkyCell {
        let Sum { flux, solid_angle, .. } = self.levels[level][index];
        let along_edge = 1 << level;
        let [face, row, column] = place_of(index, along_edge);
        let part = flux.element_sum() / self.whole().element_sum().max(f64::MIN_POSITIVE);
        let radiance = self.relative(flux / solid_angle);
        SkyCell { face, along_edge, row, column, radiance, part }
    }
}

/// Face, row and column of a cell.
fn place_of(index: usize, edge: usize) -> [usize; 3] {
    [index / (edge * edge), index / edge % edge, index % edge]
}

/// The cells of the next level that a cell consists of; `edge` is that of its own.
fn children(index: usize, edge: usize) -> impl Iterator<Item = usize> {
    let [face, row, column] = place_of(index, edge);
    let place = move |down, right| (face * 2 * edge + 2 * row + down) * 2 * edge + 2 * column + right;
    [place(0, 0), place(0, 1), place(1, 0), place(1, 1)].into_iter()
}

fn cell_of(direction: DVec3, edge: usize) -> usize {
    let axis = direction.abs().max_position();
    let far = direction[axis] > 0.0;
    let place = |coordinate: f64| {
        let from_edge = f64::midpoint(coordinate / direction[axis].abs(), 1.0) * edge as f64;
        (from_edge as usize).min(edge - 1)
    };
    let (row, column) = (place(direction[(axis + 1) % 3]), place(direction[(axis + 2) % 3]));
    ((2 * axis + usize::from(far)) * edge + row) * edge + column
}

fn solid_angle_of(index: usize, edge: usize) -> f64 {
    let [_, row, column] = place_of(index, edge);
    let at = |place: usize| 2.0 * place as f64 / edge as f64 - 1.0;
    solid_angle_on_cube([at(row), at(row + 1)], [at(column), at(column + 1)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use document::sky::Projection;
    use glam::DQuat;

    fn image(width: usize, texel: impl Fn(usize, usize) -> [f32; 3]) -> SkyImage {
        let height = width / 2;
        let texels = (0..width * height).map(|index| texel(index % width, index / width)).collect();
        SkyImage {
            projection: Projection::Equirectangular { width, height },
            texels,
            rotation: DQuat::IDENTITY,
        }
    }

    #[test]
    fn an_even_sky_stays_in_its_coarsest_cells() {
        for width in [2, 64, 300] {
            let pattern = SkyPattern::new(&image(width, |_, _| [1.0, 2.0, 3.0]).turned(20.0));
            let cells = pattern.cells(1000, 0.01);
            assert_eq!(cells.len(), 96);
            for cell in &cells {
                assert!((cell.radiance - DVec3::ONE).length() < 1e-9, "{cell:?}");
            }
            assert!(pattern.has_one_colour() && !pattern.is_dark());
            assert!((pattern.mean() - DVec3::new(1.0, 2.0, 3.0)).length() < 1e-9);
        }
    }

    /// One bright texel ends in cells of its own size, which hold its flux and look towards it.
    #[test]
    fn a_sun_gets_cells_of_its_own_size() {
        let [column, row] = [700, 100];
        let sky = image(1024, |x, y| if [x, y] == [column, row] { [1e6; 3] } else { [1.0, 0.5, 0.25] });
        let pattern = SkyPattern::new(&sky);
        let (mut flux, mut towards, mut all) = (0.0, DVec3::ZERO, DVec3::ZERO);
        sky.each_part(4, |direction, solid_angle, radiance| {
            all += radiance * solid_angle;
            if radiance.x > 1e3 {
                flux += radiance.x * solid_angle;
                towards = direction;
            }
        });
        let cells = pattern.cells(256, 0.01);
        assert!(cells.len() <= 256);
        let solid_angle =
            |cell: &SkyCell| solid_angle_of(cell.row * cell.along_edge + cell.column, cell.along_edge);
        let found: DVec3 = cells.iter().map(|cell| cell.radiance * pattern.mean() * solid_angle(cell)).sum();
        assert!((found.x / all.x - 1.0).abs() < 1e-2, "{found}, not {all}");
        let bright: Vec<_> = cells.iter().filter(|cell| cell.radiance.x * pattern.mean().x > 1e3).collect();
        let own: f64 = bright.iter().map(|cell| cell.radiance.x * pattern.mean().x * solid_angle(cell)).sum();
        assert!((own / flux - 1.0).abs() < 1e-2, "{own}, not {flux}");
        for cell in bright {
            assert_eq!(cell.along_edge, 256);
            let axis = cell.face / 2;
            let mut direction = DVec3::ZERO;
            direction[axis] = if cell.face % 2 == 1 { 1.0 } else { -1.0 };
            direction[(axis + 1) % 3] = (2 * cell.row + 1) as f64 / 256.0 - 1.0;
            direction[(axis + 2) % 3] = (2 * cell.column + 1) as f64 / 256.0 - 1.0;
            assert!(direction.normalize().dot(towards) > 0.9999, "{cell:?}");
        }
        assert!(!pattern.has_one_colour());
    }

    /// Half of the light from one texel, wherever it is: near a corner of the cube, cells are small and few parts fall into each.
    #[test]
    fn a_sun_keeps_its_flux_beside_a_sky() {
        let (width, bright) = (1024, 4e5);
        for [column, row] in [[640, 156], [641, 157], [512, 3], [77, 250], [895, 158]] {
            let sky = image(width, |x, y| if [x, y] == [column, row] { [bright; 3] } else { [1.0; 3] });
            let mut flux = 0.0;
            sky.each_part(1, |_, solid_angle, radiance| {
                flux += if radiance.x > 1.0 { radiance.x * solid_angle } else { 0.0 };
            });
            let pattern = SkyPattern::new(&sky);
            let (mut sun, mut all) = (0.0, 0.0);
            for cell in pattern.cells(256, 0.01) {
                let index = cell.row * cell.along_edge + cell.column;
                let own = cell.radiance.x * pattern.mean().x * solid_angle_of(index, cell.along_edge);
                all += own;
                sun += if cell.radiance.x * pattern.mean().x > 1e3 { own } else { 0.0 };
            }
            assert!((sun / flux - 1.0).abs() < 0.01, "{column}, {row}: {sun}, not {flux}");
            let expected = flux + 4.0 * std::f64::consts::PI;
            assert!((all / expected - 1.0).abs() < 0.001, "{column}, {row}: {all}, not {expected}");
        }
    }

    #[test]
    fn cells_cover_all_directions_once() {
        let sky = image(256, |x, y| [(x * y % 17) as f32; 3]);
        let pattern = SkyPattern::new(&sky);
        assert!(pattern.has_one_colour());
        let cells = pattern.cells(300, 0.0);
        assert!((297..=300).contains(&cells.len()), "{}", cells.len());
        let of_face: f64 = cells.iter().map(|cell| 1.0 / (cell.along_edge * cell.along_edge) as f64).sum();
        assert_eq!(of_face, 6.0);
        assert!((cells.iter().map(|cell| cell.part).sum::<f64>() - 1.0).abs() < 1e-12);
    }
}
