//! The mean of an image over a polygon, exactly.
//!
//! By Green's theorem the integral of f over a polygon is that of F(x, y) = ∫ f(t, y) dt, from any fixed line up to x, along its outline,
//! times dy. A texel, or the cell between four centres where values are interpolated, makes F a polynomial: of the first degree in x and
//! constant in y, or of the second degree in x and the first in y. Along the piece of an edge in one cell F is then a polynomial of the
//! third degree at most, and Simpson's rule gives its integral exactly. The cost is that of the texels that the outline passes, not of
//! those within, and that of an image repeated a hundred times is no other.
//!
//! Sums of texels from a row's start on are kept for every sixteenth, so that F is known at any place after sixteen texels at most.

use glam::{DVec2, DVec4};
use rayon::prelude::*;

use document::texture::{Filter, Sampler, Wrap};

/// Something with a value at every texel: red, green, blue, and a fourth.
pub trait Raster: Sync {
    /// Texels that an outline may cross before a coarser image is used. The error lies along the outline only, some texels of the
    /// thousands inside.
    const MOST_PASSED: f64 = 2048.0;

    /// Texels of a row, and rows: at least one of each.
    fn size(&self) -> [u32; 2];
    /// The value of a texel.
    fn texel(&self, column: u32, row: u32) -> DVec4;
}

/// Texels between places with known sums.
const BLOCK: usize = 16;

/// Width and height, in texels, of a texel of the coarser image.
const COARSER: u32 = 8;

/// Height over extent, and height in texels, below which a polygon has no area to speak of.
const LEAST_HEIGHT: f64 = 1e-7;

/// Places farther away than this, in texels, are not distinguished.
const FARTHEST: f64 = (1_u64 << 40) as f64;

/// An image with what it takes to have its mean over polygons.
pub struct AreaMeans<R> {
    raster: R,
    /// For each row, sums of its texels before each block, and that of all.
    sums: Vec<DVec4>,
    blocks: usize,
    coarser: Option<Box<AreaMeans<Grid>>>,
    is_constant: bool,
    is_grey: bool,
}

/// Plain values, row by row.
pub(super) struct Grid {
    size: [u32; 2],
    values: Vec<DVec4>,
}

impl Raster for Grid {
    fn size(&self) -> [u32; 2] {
        self.size
    }

    fn texel(&self, column: u32, row: u32) -> DVec4 {
        self.values[row as usize * self.size[0] as usize + column as usize]
    }
}

impl<R: Raster> AreaMeans<R> {
    /// Makes the sums of an image. Takes two bytes for each texel.
    pub fn new(raster: R) -> Self {
        let [width, height] = raster.size();
        let blocks = (width as usize).div_ceil(BLOCK);
        let first = raster.texel(0, 0);
        let mut sums = vec![DVec4::ZERO; (blocks + 1) * height as usize];
        let (is_constant, is_grey) = sums
            .par_chunks_mut(blocks + 1)
            .enumerate()
            .map(|(row, sums)| {
                let (mut sum, mut is_constant, mut is_grey) = (DVec4::ZERO, true, true);
                for (block, place) in sums.iter_mut().enumerate() {
                    *place = sum;
                    for column in (block * BLOCK..(block + 1) * BLOCK).take_while(|c| *c < width as usize) {
                        let texel = raster.texel(column as u32, row as u32);
                        sum += texel;
                        is_constant &= texel == first;
                        is_grey &= texel.x == texel.y && texel.x == texel.z;
                    }
                }
                (is_constant, is_grey)
            })
            .reduce(|| (true, true), |a, b| (a.0 && b.0, a.1 && b.1));
        let mut means = Self { raster, sums, blocks, coarser: None, is_constant, is_grey };
        if width.max(height) > 1 {
            means.coarser = Some(Box::new(AreaMeans::new(means.coarser_grid())));
        }
        means
    }

    /// The image itself.
    pub fn raster(&self) -> &R {
        &self.raster
    }

    /// The value of all texels, where they have only one.
    pub fn constant(&self) -> Option<DVec4> {
        self.is_constant.then(|| self.raster.texel(0, 0))
    }

    /// True where red, green and blue are equal everywhere.
    pub fn is_grey(&self) -> bool {
        self.is_grey
    }

    /// The value at texture coordinates.
    pub fn at(&self, uv: DVec2, sampler: &Sampler) -> DVec4 {
        sampler.interpolate(self.raster.size(), uv, |column, row| self.raster.texel(column, row))
    }

    /// The mean over a convex polygon in texture coordinates, whichever way round; `None` where it has no area.
    pub fn over(&self, polygon: &[DVec2], sampler: &Sampler) -> Option<DVec4> {
        let [width, height] = self.raster.size().map(f64::from);
        let shift = if sampler.filter == Filter::Linear { 0.5 } else { 0.0 };
        let place = |uv: &DVec2| *uv * DVec2::new(width, height) - shift;
        let is_near = |place: DVec2| place.abs().max_element() <= FARTHEST;
        if !polygon.iter().all(|uv| is_near(place(uv))) {
            return None;
        }
        let edges = || polygon.iter().map(place).zip(polygon.iter().cycle().skip(1).map(place));
        let passed = |(from, to): (DVec2, DVec2)| {
            let [across, down] = [(sampler.wrap_u, width), (sampler.wrap_v, height)];
            let inside = |value: f64, (wrap, count): (Wrap, f64)| match wrap {
                Wrap::Clamp => value.clamp(-1.0, count),
                Wrap::Repeat | Wrap::Mirror => value,
            };
            (inside(from.x, across) - inside(to.x, across)).abs()
                + (inside(from.y, down) - inside(to.y, down)).abs()
        };
        if let Some(coarser) = &self.coarser
            && edges().map(passed).sum::<f64>() > R::MOST_PASSED
        {
            return coarser.over(polygon, sampler);
        }
        let first = place(polygon.first()?);
        let (mut area, mut low, mut high) = (0.0, first, first);
        for (from, to) in edges() {
            area += (from - first).perp_dot(to - first) / 2.0;
            (low, high) = (low.min(from), high.max(from));
        }
        let extent = (high - low).max_element();
        if area.abs() <= LEAST_HEIGHT * extent * extent.max(1.0) {
            return None;
        }
        // The coarsest image has one texel, and nothing that is worth a walk over it millions of times.
        if let Some(constant) = self.constant() {
            return Some(constant);
        }
        let walk = Walk { means: self, sampler, origin: low.x.floor() as i64 };
        let integral: DVec4 = edges().map(|(from, to)| walk.along(from, to)).sum();
        Some((integral / area).max(DVec4::ZERO))
    }

    /// Means of rectangles of texels, which cover the image evenly.
    fn coarser_grid(&self) -> Grid {
        let [width, height] = self.raster.size();
        let size = [width, height].map(|count| (count / COARSER).max(1));
        let step = DVec2::new(f64::from(size[0]), f64::from(size[1])).recip();
        let sampler = Sampler { wrap_u: Wrap::Clamp, wrap_v: Wrap::Clamp, filter: Filter::Nearest };
        let mean = |index: u32| {
            let low = DVec2::new(f64::from(index % size[0]), f64::from(index / size[0]));
            let corner = |x: f64, y: f64| (low + DVec2::new(x, y)) * step;
            let rectangle = [corner(0.0, 0.0), corner(1.0, 0.0), corner(1.0, 1.0), corner(0.0, 1.0)];
            self.over_texels(&rectangle, &sampler)
        };
        Grid { size, values: (0..size[0] * size[1]).into_par_iter().map(mean).collect() }
    }

    /// The mean over a rectangle within the image, without a look at how many texels it passes.
    fn over_texels(&self, rectangle: &[DVec2; 4], sampler: &Sampler) -> DVec4 {
        let [width, height] = self.raster.size().map(f64::from);
        let places = rectangle.map(|uv| uv * DVec2::new(width, height));
        let walk = Walk { means: self, sampler, origin: places[0].x.floor() as i64 };
        let integral: DVec4 = (0..4).map(|i| walk.along(places[i], places[(i + 1) % 4])).sum();
        let size = places[2] - places[0];
        integral / (size.x * size.y)
    }

    /// Sum of the first `count` texels of a row.
    fn first_texels(&self, row: u32, count: u32) -> DVec4 {
        let block = count as usize / BLOCK;
        let known = self.sums[row as usize * (self.blocks + 1) + block];
        let rest = (block * BLOCK) as u32..count;
        rest.fold(known, |sum, column| sum + self.raster.texel(column, row))
    }

    /// Sum of the texels of a row from the image's edge up to a place before or beyond it.
    fn sum_to(&self, row: u32, place: i64, wrap: Wrap) -> DVec4 {
        let width = self.raster.size()[0];
        let (count, first) = (i64::from(width), |count: i64| self.first_texels(row, count as u32));
        match wrap {
            Wrap::Repeat => {
                let (times, rest) = (place.div_euclid(count), place.rem_euclid(count));
                first(count) * times as f64 + first(rest)
            }
            Wrap::Mirror => {
                let (times, rest) = (place.div_euclid(2 * count), place.rem_euclid(2 * count));
                let all = first(count);
                let own = if rest <= count { first(rest) } else { all * 2.0 - first(2 * count - rest) };
                all * (2.0 * times as f64) + own
            }
            Wrap::Clamp if place <= 0 => self.raster.texel(0, row) * place as f64,
            Wrap::Clamp if place > count => {
                first(count) + self.raster.texel(width - 1, row) * (place - count) as f64
            }
            Wrap::Clamp => first(place),
        }
    }
}

/// A walk along an outline. Places are in texels; those of an interpolated image count from the centre of its first texel.
struct Walk<'a, R> {
    means: &'a AreaMeans<R>,
    sampler: &'a Sampler,
    /// Where F is 0: near the polygon, so that little is lost in differences.
    origin: i64,
}

/// Sums of a row at the place of the walk.
#[derive(Clone, Copy)]
struct RowSum {
    row: u32,
    /// F at the left end of the cell.
    before: DVec4,
    /// Values at both ends of the cell where they are interpolated; else the cell's own, twice.
    values: [DVec4; 2],
}

impl RowSum {
    /// F at `part` texels from the left end of the cell.
    fn at(&self, part: f64) -> DVec4 {
        let [left, right] = self.values;
        self.before + left * part + (right - left) * (part * part / 2.0)
    }
}

impl<R: Raster> Walk<'_, R> {
    /// The integral of F dy along an edge.
    fn along(&self, from: DVec2, to: DVec2) -> DVec4 {
        let way = to - from;
        if way.y == 0.0 {
            return DVec4::ZERO;
        }
        let [width, height] = self.means.raster.size().map(i64::from);
        let (columns, rows) =
            (self.cells(self.sampler.wrap_u, width), self.cells(self.sampler.wrap_v, height));
        let start = |value: f64, cells: &[i64; 2]| (value.floor() as i64).clamp(cells[0], cells[1]);
        let (mut column, mut row) = (start(from.x, &columns), start(from.y, &rows));
        let mut upper = self.row_sum(row, column);
        let mut lower = self.row_below(row, column, &upper);
        let (mut integral, mut passed) = (DVec4::ZERO, 0.0);
        loop {
            let next_column = crossing(from.x, way.x, column, &columns);
            let next_row = crossing(from.y, way.y, row, &rows);
            let end = next_column.min(next_row).min(1.0).max(passed);
            let f = |at: f64| {
                let part = from.x + at * way.x - column as f64;
                match self.sampler.filter {
                    Filter::Nearest => upper.at(part),
                    Filter::Linear => upper.at(part).lerp(lower.at(part), from.y + at * way.y - row as f64),
                }
            };
            let mean = match self.sampler.filter {
                Filter::Nearest => f((passed + end) / 2.0),
                Filter::Linear => (f(passed) + f((passed + end) / 2.0) * 4.0 + f(end)) / 6.0,
            };
            integral += mean * ((end - passed) * way.y);
            if end >= 1.0 {
                return integral;
            }
            passed = end;
            if next_column <= next_row {
                let step = if way.x > 0.0 { 1 } else { -1 };
                column += step;
                self.move_along(&mut upper, column, step);
                if self.sampler.filter == Filter::Linear {
                    self.move_along(&mut lower, column, step);
                }
            } else if way.y > 0.0 {
                row += 1;
                upper = if self.sampler.filter == Filter::Linear { lower } else { self.row_sum(row, column) };
                lower = self.row_below(row, column, &upper);
            } else {
                row -= 1;
                lower = upper;
                upper = self.row_sum(row, column);
            }
        }
    }

    /// First and last cell along a side; what lies beyond a clamped image is a single cell.
    fn cells(&self, wrap: Wrap, count: i64) -> [i64; 2] {
        match (wrap, self.sampler.filter) {
            (Wrap::Clamp, Filter::Nearest) => [-1, count],
            (Wrap::Clamp, Filter::Linear) => [-1, count - 1],
            (Wrap::Repeat | Wrap::Mirror, _) => [i64::MIN, i64::MAX],
        }
    }

    fn texel(&self, column: i64, row: u32) -> DVec4 {
        let width = self.means.raster.size()[0];
        self.means.raster.texel(self.sampler.wrap_u.texel(column, width), row)
    }

    /// Sums of a row at a column.
    fn row_sum(&self, row: i64, column: i64) -> RowSum {
        let row = self.sampler.wrap_v.texel(row, self.means.raster.size()[1]);
        let values = self.values(column, row);
        let sum = if (column - self.origin).unsigned_abs() <= 2 * BLOCK as u64 {
            let (low, high) = (self.origin.min(column), self.origin.max(column));
            let sum: DVec4 = (low..high).map(|column| self.texel(column, row)).sum();
            if column < self.origin { -sum } else { sum }
        } else {
            let sum_to = |place| self.means.sum_to(row, place, self.sampler.wrap_u);
            sum_to(column) - sum_to(self.origin)
        };
        let before = match self.sampler.filter {
            Filter::Nearest => sum,
            // Each cell is the mean of the texels at its ends: the first and the last one count half.
            Filter::Linear => sum + (values[0] - self.texel(self.origin, row)) / 2.0,
        };
        RowSum { row, before, values }
    }

    /// The row that an interpolated one is interpolated with.
    fn row_below(&self, row: i64, column: i64, upper: &RowSum) -> RowSum {
        match self.sampler.filter {
            Filter::Nearest => *upper,
            Filter::Linear => self.row_sum(row + 1, column),
        }
    }

    fn values(&self, column: i64, row: u32) -> [DVec4; 2] {
        let here = self.texel(column, row);
        match self.sampler.filter {
            Filter::Nearest => [here; 2],
            Filter::Linear => [here, self.texel(column + 1, row)],
        }
    }

    /// Moves what is known of a row to the next column, or to the one before.
    fn move_along(&self, sum: &mut RowSum, column: i64, step: i64) {
        let cell = |values: [DVec4; 2]| (values[0] + values[1]) / 2.0;
        let left = sum.values;
        sum.values = self.values(column, sum.row);
        sum.before += if step > 0 { cell(left) } else { -cell(sum.values) };
    }
}

/// Where an edge leaves a cell, as a part of its way; infinite if it does not.
fn crossing(from: f64, way: f64, cell: i64, cells: &[i64; 2]) -> f64 {
    if way > 0.0 && cell < cells[1] {
        ((cell + 1) as f64 - from) / way
    } else if way < 0.0 && cell > cells[0] {
        (cell as f64 - from) / way
    } else {
        f64::INFINITY
    }
}

#[cfg(test)]
mod tests;
