use std::f64::consts::{PI, TAU};

use glam::{DMat3, DMat4, DVec2, DVec3};

/// Triangles with what glTF knows of their vertices. Texture coordinates are metres unless it is said otherwise.
#[derive(Debug, Clone, Default)]
pub struct Geometry {
    pub positions: Vec<DVec3>,
    pub normals: Vec<DVec3>,
    pub places: Vec<DVec2>,
    /// Of each vertex, linear; empty for none.
    pub colours: Vec<DVec3>,
    pub triangles: Vec<[u32; 3]>,
}

impl Geometry {
    /// All of these together.
    pub fn of(parts: impl IntoIterator<Item = Self>) -> Self {
        parts.into_iter().fold(Self::default(), |mut all, part| {
            let first = all.positions.len() as u32;
            all.triangles.extend(part.triangles.iter().map(|corners| corners.map(|corner| corner + first)));
            all.positions.extend(part.positions);
            all.normals.extend(part.normals);
            all.places.extend(part.places);
            all.colours.extend(part.colours);
            all
        })
    }

    /// Placed elsewhere, by a transform that does not mirror.
    pub fn placed(mut self, place: DMat4) -> Self {
        let turn = DMat3::from_mat4(place).inverse().transpose();
        self.positions.iter_mut().for_each(|position| *position = place.transform_point3(*position));
        self.normals.iter_mut().for_each(|normal| *normal = (turn * *normal).normalize());
        self
    }

    /// Moved.
    pub fn moved(self, x: f64, y: f64, z: f64) -> Self {
        self.placed(DMat4::from_translation(DVec3::new(x, y, z)))
    }

    /// With texture coordinates multiplied.
    pub fn tiled(mut self, u: f64, v: f64) -> Self {
        self.places.iter_mut().for_each(|place| *place *= DVec2::new(u, v));
        self
    }

    /// In one colour.
    pub fn coloured(mut self, colour: DVec3) -> Self {
        self.colours = vec![colour; self.positions.len()];
        self
    }

    /// A surface over a grid of `columns` times `rows` cells; `at` tells position, normal and texture place of u and v from 0 to 1.
    /// Its front is where u to v turns counter-clockwise.
    pub fn grid(columns: u32, rows: u32, at: impl Fn(f64, f64) -> (DVec3, DVec3, DVec2)) -> Self {
        let mut geometry = Self::default();
        for row in 0..=rows {
            for column in 0..=columns {
                let (position, normal, place) =
                    at(f64::from(column) / f64::from(columns), f64::from(row) / f64::from(rows));
                geometry.positions.push(position);
                geometry.normals.push(normal.normalize());
                geometry.places.push(place);
            }
        }
        for row in 0..rows {
            for column in 0..columns {
                let first = row * (columns + 1) + column;
                let [a, b, c, d] = [first, first + 1, first + columns + 2, first + columns + 1];
                geometry.triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
        geometry
    }
}

/// A parallelogram, its front where its edges turn counter-clockwise.
pub fn sheet(corner: DVec3, across: DVec3, up: DVec3) -> Geometry {
    let (width, height) = (across.length(), up.length());
    Geometry::grid(1, 1, |u, v| {
        (corner + across * u + up * v, across.cross(up), DVec2::new(u * width, (1.0 - v) * height))
    })
}

/// A box.
pub fn cuboid(low: [f64; 3], high: [f64; 3]) -> Geometry {
    let (low, high) = (DVec3::from_array(low), DVec3::from_array(high));
    let [x, y, z] = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| axis * (high - low));
    Geometry::of([
        sheet(low + z, x, y),
        sheet(low + x, -x, y),
        sheet(low + x + z, -z, y),
        sheet(low, z, y),
        sheet(low + y + z, x, -z),
        sheet(low, x, z),
    ])
}

/// What turns about the vertical: radius and height from the lowest place on, smooth; its texture goes round it once.
pub fn turned(profile: &[[f64; 2]], segments: u32) -> Geometry {
    let rows = profile.len() as u32 - 1;
    let mut geometry = Geometry::grid(segments, rows, |u, v| {
        let row = (v * f64::from(rows)).round() as usize;
        let [radius, height] = profile[row];
        let [before, after] = [profile[row.saturating_sub(1)], profile[(row + 1).min(rows as usize)]];
        let slope = DVec2::new(after[1] - before[1], before[0] - after[0]);
        let (sine, cosine) = libm::sincos(u * TAU);
        let outward = DVec3::new(sine, 0.0, cosine);
        let normal = outward * slope.x + DVec3::Y * slope.y;
        (outward * radius + DVec3::Y * height, normal, DVec2::new(u, 1.0 - v))
    });
    // On the axis cells are triangles.
    let positions = &geometry.positions;
    geometry.triangles.retain(|corners| {
        let [a, b, c] = corners.map(|corner| positions[corner as usize]);
        (b - a).cross(c - a).length() > 1e-12
    });
    geometry
}

/// A profile for [`turned`] between places, rounded by interpolation with Catmull-Rom splines of `steps` steps each.
pub fn rounded(places: &[[f64; 2]], steps: u32) -> Vec<[f64; 2]> {
    let at = |index: i64| DVec2::from_array(places[index.clamp(0, places.len() as i64 - 1) as usize]);
    let mut profile = vec![];
    for part in 0..places.len() as i64 - 1 {
        let [a, b, c, d] = [-1, 0, 1, 2].map(|offset| at(part + offset));
        for step in 0..steps {
            let t = f64::from(step) / f64::from(steps);
            let between = b * 2.0
                + (c - a) * t
                + (a * 2.0 - b * 5.0 + c * 4.0 - d) * t * t
                + (b * 3.0 - a - c * 3.0 + d) * t * t * t;
            profile.push([(between.x * 0.5).max(0.0), between.y * 0.5]);
        }
    }
    profile.push(places[places.len() - 1]);
    profile
}

/// A box with rounded edges, `cells` by `cells` on each side: |x/a|^6 + |y/b|^6 + |z/c|^6 = 1, about the origin.
pub fn cushion(half: [f64; 3], cells: u32) -> Geometry {
    let half = DVec3::from_array(half);
    let faces = [
        [DVec3::X, DVec3::Y, DVec3::Z],
        [DVec3::NEG_X, DVec3::Y, DVec3::NEG_Z],
        [DVec3::Z, DVec3::X, DVec3::Y],
        [DVec3::X, DVec3::Z, DVec3::NEG_Y],
        [DVec3::Y, DVec3::Z, DVec3::X],
        [DVec3::Z, DVec3::Y, DVec3::NEG_X],
    ];
    let face = |[across, up, out]: [DVec3; 3]| {
        Geometry::grid(cells, cells, move |u, v| {
            // Cells are finer near the edges, where it bends.
            let bend = |t: f64| libm::sin((t - 0.5) * PI);
            let on_cube = across * bend(u) + up * bend(v) + out;
            let sixth = |v: DVec3| v * v * v * v * v;
            let length = libm::pow((sixth(on_cube) * on_cube).abs().element_sum(), 1.0 / 6.0);
            let on_unit = on_cube / length;
            (on_unit * half, sixth(on_unit) / half, DVec2::new(u, 1.0 - v))
        })
    };
    Geometry::of(faces.map(face))
}

/// A cloth that hangs from the height in folds along x, with its front at +z; texture coordinates are metres along the cloth.
pub fn curtain(width: f64, height: f64, folds: f64, depth: f64, cells: [u32; 2]) -> Geometry {
    Geometry::grid(cells[0], cells[1], |u, v| {
        let angle = u * folds * TAU;
        let (sine, cosine) = libm::sincos(angle);
        // Folds are deeper at the hem.
        let deep = depth * (1.3 - 0.6 * v);
        let slope = deep * cosine * folds * TAU / width;
        let position = DVec3::new(u * width, v * height, deep * sine);
        let normal = DVec3::new(-slope, 0.6 * depth * sine / height, 1.0);
        (position, normal, DVec2::new(1.6 * u * width, (1.0 - v) * height))
    })
}

/// A leaf from the origin along +z, bent down, with its front at +y.
pub fn leaf(length: f64, width: f64) -> Geometry {
    Geometry::grid(2, 10, |u, v| {
        let along = |v: f64| DVec3::new(0.0, length * (0.5 * v - 0.55 * v * v), length * v);
        let half = width * libm::sin(PI * (0.04 + 0.93 * v)) * (1.0 - 0.5 * v);
        let side = 1.0 - 2.0 * u;
        let slope = 0.5 - 1.1 * v;
        let normal = DVec3::new(-0.6 * side, 1.0, -slope);
        (along(v) + DVec3::new(half * side, 0.3 * half * side * side, 0.0), normal, DVec2::new(u, 1.0 - v))
    })
}
