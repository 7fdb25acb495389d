//! Borders between charts: texels on both sides are changed a little, so that filtering gives the same light from both.
//!
//! At points along each border the light from one side must be that from the other. Of all changes that nearly do that, the least in
//! squares is chosen, by conjugate gradients on its normal equations.

use foldhash::{HashMap, HashMapExt};
use glam::{DVec2, DVec3};
use smallvec::SmallVec;

use crate::meetings::{EdgeOf, Meetings};
use crate::sides::LitSide;
use crate::unwrap::Pages;

/// Points along a border, per texel.
const PER_TEXEL: f64 = 2.0;

/// Coordinates that differ by less are the same, in texels.
const SAME_PLACE: f64 = 1e-3;

/// What a change of a texel costs, relative to a difference over a border: of those that a surface covers, and of others.
const COST: [f64; 2] = [1e-2, 1e-3];

/// Steps of conjugate gradients.
const STEPS: usize = 200;

/// Part of the first residual at which they end.
const ENOUGH: f64 = 1e-4;

/// Texels and their weights in the light of one side of a border, less that of the other.
pub type Equation = SmallVec<[(u32, f32); 8]>;

/// The equations of all borders over which light goes on smoothly.
pub fn equations(sides: &[LitSide], meetings: &Meetings, pages: &Pages) -> Vec<Equation> {
    let mut all = vec![];
    for pair in &meetings.smooth {
        let [Some(one), Some(other)] = pair.map(|edge| Border::new(sides, pages, edge)) else { continue };
        let other = if one.start == other.start { other } else { other.turned() };
        if one.is_same(&other) {
            continue;
        }
        let points = (PER_TEXEL * one.length().max(other.length())).ceil().max(1.0) as usize;
        for index in 0..points {
            let place = (index as f64 + 0.5) / points as f64;
            let mut equation = Equation::new();
            one.read(place, 1.0, pages, &mut equation);
            other.read(place, -1.0, pages, &mut equation);
            all.push(equation);
        }
    }
    all
}

/// An edge of a triangle on its page.
struct Border {
    page: u32,
    /// Its ends in texels.
    ends: [DVec2; 2],
    /// Frame position of the first end.
    start: DVec3,
    /// That of the second.
    end: DVec3,
}

impl Border {
    fn new(sides: &[LitSide], pages: &Pages, edge: EdgeOf) -> Option<Self> {
        let layout = &pages.layouts[edge.side as usize];
        let page = layout.pages[edge.triangle as usize]?;
        let side = &sides[edge.side as usize];
        let places = side.corners(&side.triangles[edge.triangle as usize]);
        let texels = layout.corners(edge.triangle as usize, pages.size);
        let [a, b] = edge.corners();
        Some(Self { page, ends: [texels[a], texels[b]], start: places[a], end: places[b] })
    }

    fn turned(self) -> Self {
        Self { page: self.page, ends: [self.ends[1], self.ends[0]], start: self.end, end: self.start }
    }

    fn is_same(&self, other: &Self) -> bool {
        let is_near = |index: usize| self.ends[index].distance(other.ends[index]) < SAME_PLACE;
        self.page == other.page && is_near(0) && is_near(1)
    }

    fn length(&self) -> f64 {
        self.ends[0].distance(self.ends[1])
    }

    /// Adds the texels that bilinear filtering reads at a place of the border.
    fn read(&self, place: f64, sign: f64, pages: &Pages, equation: &mut Equation) {
        for (texel, weight) in bilinear(self.ends[0].lerp(self.ends[1], place), pages.size) {
            let texel = self.page * pages.size[0] * pages.size[1] + texel;
            let weight = (sign * weight) as f32;
            match equation.iter_mut().find(|(own, _)| *own == texel) {
                Some((_, own)) => *own += weight,
                None => equation.push((texel, weight)),
            }
        }
    }
}

/// The texels that bilinear filtering reads at a place in texels, clamped at the border of the page, with their weights.
pub fn bilinear(place: DVec2, size: [u32; 2]) -> [(u32, f64); 4] {
    let low = (place - 0.5).floor();
    let part = place - 0.5 - low;
    let clamped = |value: f64, count: u32| value.clamp(0.0, f64::from(count - 1)) as u32;
    [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)].map(|(right, down)| {
        let weight = |is_far: f64, part: f64| if is_far > 0.0 { part } else { 1.0 - part };
        let (x, y) = (clamped(low.x + right, size[0]), clamped(low.y + down, size[1]));
        (y * size[0] + x, weight(right, part.x) * weight(down, part.y))
    })
}

/// Changes light so that the equations hold, nearly. `is_covered` tells which texels a surface covers.
pub fn agree(light: &mut [DVec3], equations: &[Equation], is_covered: impl Fn(u32) -> bool) {
    let mut places: HashMap<u32, usize> = HashMap::new();
    let mut texels = vec![];
    let rows: Vec<SmallVec<[(usize, f64); 8]>> = equations
        .iter()
        .map(|equation| {
            let place = |(texel, weight): &(u32, f32)| {
                let place = *places.entry(*texel).or_insert_with(|| {
                    texels.push(*texel);
                    texels.len() - 1
                });
                (place, f64::from(*weight))
            };
            equation.iter().map(place).collect()
        })
        .collect();
    let costs: Vec<f64> = texels.iter().map(|texel| COST[usize::from(!is_covered(*texel))]).collect();
    let difference = |row: &[(usize, f64)], values: &[DVec3]| -> DVec3 {
        row.iter().map(|(place, weight)| values[*place] * *weight).sum()
    };
    let normal = |values: &[DVec3]| -> Vec<DVec3> {
        let mut product: Vec<DVec3> = values.iter().zip(&costs).map(|(value, cost)| *value * *cost).collect();
        for row in &rows {
            let found = difference(row, values);
            row.iter().for_each(|(place, weight)| product[*place] += found * *weight);
        }
        product
    };
    let dot = |a: &[DVec3], b: &[DVec3]| a.iter().zip(b).map(|(a, b)| *a * *b).sum::<DVec3>();
    let part = |above: DVec3, below: DVec3| {
        let part = |index: usize| if below[index] > 0.0 { above[index] / below[index] } else { 0.0 };
        DVec3::new(part(0), part(1), part(2))
    };
    let now: Vec<DVec3> = texels.iter().map(|texel| light[*texel as usize]).collect();
    let mut residual = vec![DVec3::ZERO; texels.len()];
    for row in &rows {
        let found = difference(row, &now);
        row.iter().for_each(|(place, weight)| residual[*place] -= found * *weight);
    }
    let mut change = vec![DVec3::ZERO; texels.len()];
    let mut direction = residual.clone();
    let mut square = dot(&residual, &residual);
    let enough = square * (ENOUGH * ENOUGH);
    for _ in 0..STEPS {
        if square.cmple(enough).all() {
            break;
        }
        let product = normal(&direction);
        let step = part(square, dot(&direction, &product));
        change.iter_mut().zip(&direction).for_each(|(change, direction)| *change += step * *direction);
        residual.iter_mut().zip(&product).for_each(|(residual, product)| *residual -= step * *product);
        let next = dot(&residual, &residual);
        let turn = part(next, square);
        direction.iter_mut().zip(&residual).for_each(|(d, residual)| *d = *residual + turn * *d);
        square = next;
    }
    for (texel, change) in texels.iter().zip(change) {
        let value = &mut light[*texel as usize];
        *value = (*value + change).max(DVec3::ZERO);
    }
}
