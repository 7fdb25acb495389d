//! Skies as images: radiance from every direction.
//!
//! Two sorts are read: equirectangular files (OpenEXR or Radiance HDR), beside the scene or within it, and the cube maps of
//! EXT_lights_image_based. Files are not trusted: whatever the bytes, the answer is an image or an error.

mod cube;
mod file;
mod within;

use std::f64::consts::{PI, TAU};

use glam::{DQuat, DVec3};

pub use cube::EXT_LIGHTS_IMAGE_BASED;
pub use within::{HALFLIGHT_SKY_IMAGE, PutSkyError, put_sky_image, take_sky_image};

use crate::PlainDocument;
use crate::error::ImportProblem;

/// The sky of a document's scene, if it has one, and the factor of its radiance. Images that cannot be decoded are a warning, and no sky.
///
/// # Errors
/// When the scene refers to no sky, or to one that makes no sense.
pub fn sky_of(
    file: &PlainDocument,
    warnings: &mut Vec<String>,
) -> Result<Option<(SkyImage, f64)>, ImportProblem> {
    Ok(match within::image_of(file)? {
        Some(sky) => Some(sky),
        None => cube::sky_of(file, warnings)?.map(|image| (image, 1.0)),
    })
}

/// Why a sky cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum SkyError {
    /// The file cannot be read.
    #[error("cannot be read; check the path and the permissions")]
    Unreadable(#[from] std::io::Error),
    /// Another format.
    #[error("is neither OpenEXR nor Radiance HDR; convert it to .exr or .hdr")]
    Format,
    /// Not all directions, or not in this projection.
    #[error("has {width} x {height} texels; an equirectangular sky is twice as wide as high")]
    Shape {
        /// Texels of a row.
        width: usize,
        /// Number of rows.
        height: usize,
    },
    /// Too many texels.
    #[error("has {width} x {height} texels; scale it down to {most} x {half} or less", most = MOST_WIDTH, half = MOST_WIDTH / 2)]
    TooLarge {
        /// Texels of a row.
        width: usize,
        /// Number of rows.
        height: usize,
    },
    /// A texel is no radiance.
    #[error(
        "has a texel that is not finite in column {column}, row {row}; clamp it where the image was made"
    )]
    NotFinite {
        /// Column from 0.
        column: usize,
        /// Row from 0.
        row: usize,
    },
    /// The decoder gave up.
    #[error("is damaged: {0}; export it again")]
    Damaged(String),
}

/// Most texels of a row.
pub const MOST_WIDTH: usize = 8192;

/// Which texel a direction belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Projection {
    /// Longitude along the rows, latitude down the columns. The upper edge is +Y, the middle of the image +X, and what is right of it
    /// +Z.
    Equirectangular {
        /// Texels of a row.
        width: usize,
        /// Number of rows.
        height: usize,
    },
    /// Six squares, +X, -X, +Y, -Y, +Z, -Z, each as seen from within: see [`CUBE_FACES`].
    Cube {
        /// Texels along an edge.
        edge: usize,
    },
}

/// The faces of a cube map as seen from within: where each is, what is right of it, and what is below.
pub const CUBE_FACES: [[DVec3; 3]; 6] = [
    [DVec3::X, DVec3::Z, DVec3::NEG_Y],
    [DVec3::NEG_X, DVec3::NEG_Z, DVec3::NEG_Y],
    [DVec3::Y, DVec3::NEG_X, DVec3::Z],
    [DVec3::NEG_Y, DVec3::NEG_X, DVec3::NEG_Z],
    [DVec3::Z, DVec3::NEG_X, DVec3::NEG_Y],
    [DVec3::NEG_Z, DVec3::X, DVec3::NEG_Y],
];

/// Radiance from every direction. Each texel has the same all over.
#[derive(Debug, Clone)]
pub struct SkyImage {
    /// Where its texels are.
    pub projection: Projection,
    /// Radiance, row by row from the upper left corner on, face by face; finite, not negative.
    pub texels: Vec<[f32; 3]>,
    /// Turns a direction of the image into one of the world.
    pub rotation: DQuat,
}

impl SkyImage {
    /// The same sky turned about +Y, counter-clockwise seen from above.
    #[must_use]
    pub fn turned(self, degrees: f64) -> Self {
        Self { rotation: DQuat::from_rotation_y(degrees.to_radians()) * self.rotation, ..self }
    }

    /// Texels along a great circle.
    #[must_use]
    pub fn texels_around(&self) -> usize {
        match self.projection {
            Projection::Equirectangular { width, .. } => width,
            Projection::Cube { edge } => 4 * edge,
        }
    }

    /// Visits every texel, cut into `division` by `division` parts: a direction of the world in the middle of the part, its solid
    /// angle in steradians, and its radiance.
    pub fn each_part(&self, division: usize, mut visit: impl FnMut(DVec3, f64, DVec3)) {
        match self.projection {
            Projection::Equirectangular { width, height } => {
                let step = TAU / (width * division) as f64;
                let longitudes: Vec<(f64, f64)> =
                    (0..width * division).map(|part| ((part as f64 + 0.5) * step - PI).sin_cos()).collect();
                for part in 0..height * division {
                    let angle = |edge: usize| PI * edge as f64 / (height * division) as f64;
                    let (upper, lower) = (angle(part), angle(part + 1));
                    let (sine, cosine) = f64::midpoint(upper, lower).sin_cos();
                    let solid_angle = step * (upper.cos() - lower.cos());
                    let row = &self.texels[part / division * width..][..width];
                    for (column, (z, x)) in longitudes.iter().enumerate() {
                        let direction = DVec3::new(x * sine, cosine, z * sine);
                        visit(self.rotation * direction, solid_angle, radiance(row[column / division]));
                    }
                }
            }
            Projection::Cube { edge } => {
                let parts = edge * division;
                let at = |part: usize| 2.0 * part as f64 / parts as f64 - 1.0;
                for (face, [front, right, down]) in CUBE_FACES.iter().enumerate() {
                    for row in 0..parts {
                        for column in 0..parts {
                            let solid_angle =
                                solid_angle_on_cube([at(column), at(column + 1)], [at(row), at(row + 1)]);
                            let middle = |part: usize| f64::midpoint(at(part), at(part + 1));
                            let direction = *front + *right * middle(column) + *down * middle(row);
                            let texel = (face * edge + row / division) * edge + column / division;
                            visit(
                                self.rotation * direction.normalize(),
                                solid_angle,
                                radiance(self.texels[texel]),
                            );
                        }
                    }
                }
            }
        }
    }
}

fn radiance(texel: [f32; 3]) -> DVec3 {
    DVec3::from_array(texel.map(f64::from))
}

/// Solid angle, in steradians, of a rectangle on a face of the cube from -1 to 1, seen from its middle.
#[must_use]
pub fn solid_angle_on_cube(across: [f64; 2], along: [f64; 2]) -> f64 {
    let corner = |x: f64, y: f64| (x * y).atan2((x * x + y * y + 1.0).sqrt());
    let [x0, x1] = across;
    let [y0, y1] = along;
    corner(x1, y1) - corner(x0, y1) - corner(x1, y0) + corner(x0, y0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(projection: Projection, texel: impl Fn(usize) -> f32) -> SkyImage {
        let count = match projection {
            Projection::Equirectangular { width, height } => width * height,
            Projection::Cube { edge } => 6 * edge * edge,
        };
        let texels = (0..count).map(|index| [texel(index); 3]).collect();
        SkyImage { projection, texels, rotation: DQuat::IDENTITY }
    }

    /// The parts cover the sphere, and the mean of a sky that is as bright as a direction is high, and dark below, points up.
    #[test]
    fn parts_cover_all_directions() {
        for projection in
            [Projection::Equirectangular { width: 32, height: 16 }, Projection::Cube { edge: 8 }]
        {
            let (mut all, mut mean) = (0.0, DVec3::ZERO);
            image(projection, |_| 1.0).each_part(3, |direction, solid_angle, radiance| {
                all += solid_angle;
                mean += direction * solid_angle * radiance.x;
            });
            assert!((all / (2.0 * TAU) - 1.0).abs() < 1e-12, "{projection:?}: {all}");
            assert!(mean.length() < 1e-12, "{projection:?}: {mean}");
        }
    }

    /// Where a single bright texel is seen.
    #[test]
    fn texels_are_where_they_are_said_to_be() {
        let seen = |projection, bright: usize, degrees: f64| {
            let mut sum = DVec3::ZERO;
            let only = image(projection, |texel| if texel == bright { 1.0 } else { 0.0 });
            only.turned(degrees).each_part(2, |direction, solid_angle, radiance| {
                sum += direction * solid_angle * radiance.x;
            });
            sum.normalize()
        };
        let flat = Projection::Equirectangular { width: 400, height: 200 };
        let row = 100 * 400;
        for (bright, degrees, towards) in [
            (0, 0.0, DVec3::Y),
            (199 * 400, 0.0, DVec3::NEG_Y),
            (row + 200, 0.0, DVec3::X),
            (row + 300, 0.0, DVec3::Z),
            (row + 100, 0.0, DVec3::NEG_Z),
            (row, 0.0, DVec3::NEG_X),
            // A quarter of a turn counter-clockwise seen from above takes +X to -Z.
            (row + 200, 90.0, DVec3::NEG_Z),
        ] {
            let found = seen(flat, bright, degrees);
            assert!((found - towards).length() < 0.02, "{bright}: {found}, not {towards}");
        }
        let cube = Projection::Cube { edge: 3 };
        for (face, [front, right, down]) in CUBE_FACES.into_iter().enumerate() {
            assert!((seen(cube, face * 9 + 4, 0.0) - front).length() < 1e-12);
            assert!(seen(cube, face * 9 + 5, 0.0).dot(right) > 0.4);
            assert!(seen(cube, face * 9 + 7, 0.0).dot(down) > 0.4);
            // As seen from within a right-handed world.
            assert_eq!(right.cross(down), front);
        }
    }
}
