//! A sky that differs by direction: looked up where a path leaves the scene, and sampled where it is bright.

use std::f64::consts::{PI, TAU};

use document::sky::{CUBE_FACES, Projection, SkyImage};
use glam::DVec3;

/// Cells of the table of chances, over longitude and over latitude.
const WIDTH: usize = 1024;
const HEIGHT: usize = 512;

/// A sky ready to be sampled.
pub(super) struct Sky<'a> {
    image: &'a SkyImage,
    factor: DVec3,
    /// Running sum of chances over the cells of the world's directions, row by row from above.
    ends: Vec<f64>,
}

impl<'a> Sky<'a> {
    /// Prepares an image; `None` where no light comes from it.
    pub(super) fn new(image: &'a SkyImage, factor: DVec3) -> Option<Self> {
        // Parts are smaller than cells, and a cell may be as bright as its neighbours: none that a sun reaches into is left without chance.
        let division = (4 * WIDTH).div_ceil(image.texels_around()).min(64);
        let mut brightness = vec![0.0; WIDTH * HEIGHT];
        image.each_part(division, |direction, solid_angle, radiance| {
            brightness[cell_of(direction)] += (radiance * factor).element_sum() * solid_angle;
        });
        brightness.iter_mut().enumerate().for_each(|(cell, sum)| *sum /= solid_angle(cell));
        let around = |cell: usize| {
            let (row, column) = (cell / WIDTH, cell % WIDTH);
            let rows = row.saturating_sub(1)..(row + 2).min(HEIGHT);
            let cells =
                rows.flat_map(|row| [WIDTH - 1, 0, 1].map(|step| row * WIDTH + (column + step) % WIDTH));
            cells.map(|cell| brightness[cell]).fold(0.0, f64::max)
        };
        let mut ends: Vec<f64> = (0..WIDTH * HEIGHT).map(|cell| around(cell) * solid_angle(cell)).collect();
        let mut sum = 0.0;
        for end in &mut ends {
            sum += *end;
            *end = sum;
        }
        ends.iter_mut().for_each(|end| *end /= sum);
        (sum > 0.0).then_some(Self { image, factor, ends })
    }

    /// Radiance from a direction.
    pub(super) fn radiance(&self, direction: DVec3) -> DVec3 {
        let own = self.image.rotation.inverse() * direction;
        let last = |place: f64, count: usize| (place as usize).min(count - 1);
        let texel = match self.image.projection {
            Projection::Equirectangular { width, height } => {
                let column = (own.z.atan2(own.x) / TAU + 0.5) * width as f64;
                let row = own.y.clamp(-1.0, 1.0).acos() / PI * height as f64;
                last(row, height) * width + last(column, width)
            }
            Projection::Cube { edge } => {
                let axis = own.abs().max_position();
                let face = 2 * axis + usize::from(own[axis] < 0.0);
                let [front, right, down] = CUBE_FACES[face];
                let place = |along: DVec3| f64::midpoint(own.dot(along) / own.dot(front), 1.0) * edge as f64;
                (face * edge + last(place(down), edge)) * edge + last(place(right), edge)
            }
        };
        self.factor * DVec3::from_array(self.image.texels[texel].map(f64::from))
    }

    /// Chance per solid angle at which [`Self::direction`] chooses this direction.
    pub(super) fn density(&self, direction: DVec3) -> f64 {
        let cell = cell_of(direction);
        self.chance(cell) / solid_angle(cell)
    }

    fn chance(&self, cell: usize) -> f64 {
        self.ends[cell] - if cell == 0 { 0.0 } else { self.ends[cell - 1] }
    }

    /// A random direction, where the sky is bright.
    pub(super) fn direction(&self, draw: [f64; 3]) -> DVec3 {
        let cell = self.ends.partition_point(|end| *end <= draw[0]).min(self.ends.len() - 1);
        let (row, column) = (cell / WIDTH, cell % WIDTH);
        let longitude = TAU * (column as f64 + draw[1]) / WIDTH as f64 - PI;
        let height = |row: usize| (PI * row as f64 / HEIGHT as f64).cos();
        let up = height(row) + (height(row + 1) - height(row)) * draw[2];
        let out = (1.0 - up * up).max(0.0).sqrt();
        DVec3::new(longitude.cos() * out, up, longitude.sin() * out)
    }
}

fn cell_of(direction: DVec3) -> usize {
    let column = (direction.z.atan2(direction.x) / TAU + 0.5) * WIDTH as f64;
    let row = direction.y.clamp(-1.0, 1.0).acos() / PI * HEIGHT as f64;
    (row as usize).min(HEIGHT - 1) * WIDTH + (column as usize).min(WIDTH - 1)
}

fn solid_angle(cell: usize) -> f64 {
    let edge = |row: usize| (PI * row as f64 / HEIGHT as f64).cos();
    let row = cell / WIDTH;
    TAU / WIDTH as f64 * (edge(row) - edge(row + 1))
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DQuat;

    /// The parts of an image lie where it is looked up, and chances are densities.
    #[test]
    fn directions_are_found_again() {
        for projection in
            [Projection::Equirectangular { width: 64, height: 32 }, Projection::Cube { edge: 16 }]
        {
            let count = match projection {
                Projection::Equirectangular { width, height } => width * height,
                Projection::Cube { edge } => 6 * edge * edge,
            };
            let texels = (0..count).map(|index| [index as f32 + 1.0, 1.0, 0.0]).collect();
            let rotation = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), 0.7);
            let image = SkyImage { projection, texels, rotation };
            let sky = Sky::new(&image, DVec3::new(2.0, 1.0, 1.0)).unwrap();
            image.each_part(3, |direction, _, radiance| {
                assert_eq!(sky.radiance(direction), radiance * DVec3::new(2.0, 1.0, 1.0));
            });
            let all: f64 = (0..WIDTH * HEIGHT).map(|cell| sky.chance(cell)).sum();
            assert!((all - 1.0).abs() < 1e-9);
            let chosen = sky.direction([0.3, 0.5, 0.5]);
            assert!(sky.density(chosen) > 0.0 && (chosen.length() - 1.0).abs() < 1e-12);
        }
    }
}
