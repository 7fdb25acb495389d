//! Buildings of any number of furnished rooms, to see how a bake grows.
//!
//! Rooms stand in a near-square grid, behind walls of some thickness, and doors lead from each to its neighbours. Widths, depths,
//! furniture, reflectances and doors are drawn from a fixed seed; a room of a larger building is furnished just as that of a
//! smaller one, so that only their number grows. Metres, y up.

use std::ops::Range;

use glam::{DMat4, DVec3};

use crate::builder::{Material, SceneBuilder};
use crate::shapes::{Polygon, box_facing_out};

/// Between two rooms.
const WALL: f64 = 0.2;

/// Floor to ceiling.
const HEIGHT: f64 = 2.7;

/// Width and height of every door.
const DOOR: [f64; 2] = [0.9, 2.1];

/// Widths and depths of the rooms.
const SIZES: Range<f64> = 3.2..5.6;

/// Every room has places for furniture, so many along its width and its depth, and no two pieces in one place.
const PLACES: [usize; 2] = [4, 3];

/// Of so many rooms one has no lamp: light comes through its doors.
const ROOMS_PER_DARK_ONE: usize = 8;

/// Exitance of the lamps, W/m^2.
const LAMP: f64 = 400.0;

/// A building, and how large it is.
pub struct Building {
    /// The parts of the scene.
    pub scene: SceneBuilder,
    /// Its largest extent in metres, to which the bake's `shooter_edge` is relative.
    pub extent: f64,
    /// Where its columns and rows of rooms begin and end.
    grid: [Vec<(f64, f64)>; 2],
}

impl Building {
    /// Number of the room that a point is in, of all places of the grid.
    #[must_use]
    pub fn room_at(&self, point: DVec3) -> usize {
        let place = |starts: &[(f64, f64)], at: f64| {
            starts[1..].partition_point(|(start, _)| start - WALL / 2.0 < at)
        };
        place(&self.grid[0], point.x) + place(&self.grid[1], point.z) * self.grid[0].len()
    }

    /// Number of places of the grid.
    #[must_use]
    pub fn rooms(&self) -> usize {
        self.grid[0].len() * self.grid[1].len()
    }
}

/// A building of so many rooms: the same for the same number.
#[must_use]
pub fn building(rooms: usize) -> Building {
    let columns = (rooms as f64).sqrt().ceil().max(1.0) as usize;
    let rows = rooms.div_ceil(columns);
    let mut dice = Dice(1);
    let xs = starts(columns, &mut dice);
    let zs = starts(rows, &mut dice);
    let mut scene = SceneBuilder::new();
    for room in 0..rooms {
        let (column, row) = (room % columns, room / columns);
        let floor = Floor {
            x: xs[column].0..xs[column].1,
            z: zs[row].0..zs[row].1,
            east: column + 1 < columns && room + 1 < rooms,
            // One column has all doors, so that light and people get everywhere; of the others every second one.
            south: room + columns < rooms && (column == 0 || (room + row).is_multiple_of(2)),
            west: column > 0,
            north: row > 0 && (column == 0 || (room - columns + row - 1).is_multiple_of(2)),
        };
        scene = furnished(scene, room, &floor);
    }
    let end = |places: &[(f64, f64)]| places.last().map_or(0.0, |place| place.1);
    Building { scene, extent: end(&xs).max(end(&zs)).max(HEIGHT), grid: [xs, zs] }
}

/// Where rooms begin and end along one axis.
fn starts(count: usize, dice: &mut Dice) -> Vec<(f64, f64)> {
    let mut from = 0.0;
    let mut place = |_| {
        let to = from + dice.within(SIZES);
        let place = (from, to);
        from = to + WALL;
        place
    };
    (0..count).map(&mut place).collect()
}

/// Where a room is, and on which sides it has a door.
struct Floor {
    x: Range<f64>,
    z: Range<f64>,
    east: bool,
    south: bool,
    west: bool,
    north: bool,
}

fn furnished(scene: SceneBuilder, room: usize, floor: &Floor) -> SceneBuilder {
    // Its own dice: furniture does not depend on how many rooms there are.
    let mut dice = Dice(1000 + room as u64);
    let tint = DVec3::new(dice.within(0.5..0.8), dice.within(0.5..0.8), dice.within(0.5..0.8));
    let painted = |reflectance: DVec3| Material { reflectance, ..Material::grey(0.0) };
    let mut scene = scene
        .part(&format!("walls {room}"), &walls(floor), painted(tint))
        .part(&format!("floor {room}"), &[level(floor, 0.0, true)], painted(tint * 0.5))
        .part(&format!("ceiling {room}"), &[level(floor, HEIGHT, false)], Material::grey(0.8));
    let mut places: Vec<usize> = (0..PLACES[0] * PLACES[1]).collect();
    let pieces = 6 + dice.below(5);
    for piece in 0..pieces {
        let place = places.swap_remove(dice.below(places.len()));
        let size = [
            (floor.x.end - floor.x.start) / PLACES[0] as f64,
            (floor.z.end - floor.z.start) / PLACES[1] as f64,
        ];
        let middle = DVec3::new(
            floor.x.start + size[0] * ((place % PLACES[0]) as f64 + 0.5),
            0.0,
            floor.z.start + size[1] * ((place / PLACES[0]) as f64 + 0.5),
        );
        // Turned about its middle it stays within its place.
        let reach = 0.45 * size[0].min(size[1]);
        let slant = dice.within(0.4..1.1);
        let (half_width, half_depth) = (reach * slant.cos(), reach * slant.sin());
        let corner = DVec3::new(half_width, 0.0, half_depth);
        let faces = box_facing_out(-corner, corner + DVec3::Y * dice.within(0.4..1.9));
        let colour = DVec3::new(dice.within(0.2..0.8), dice.within(0.2..0.8), dice.within(0.2..0.8));
        scene = scene.part(&format!("piece {piece} of room {room}"), &faces, painted(colour)).placed(
            DMat4::from_translation(middle)
                * DMat4::from_rotation_y(dice.within(0.0..std::f64::consts::FRAC_PI_2)),
        );
    }
    if room % ROOMS_PER_DARK_ONE == ROOMS_PER_DARK_ONE - 1 {
        return scene;
    }
    let middle =
        DVec3::new((floor.x.start + floor.x.end) / 2.0, HEIGHT - 0.3, (floor.z.start + floor.z.end) / 2.0);
    let half = DVec3::new(0.3, 0.03, 0.3);
    let mut faces = box_facing_out(middle - half, middle + half);
    // The face that looks down.
    let shade = faces.remove(2);
    scene.part(&format!("lamp {room}"), &[shade], Material::grey(0.5).emitting(LAMP)).part(
        &format!("housing {room}"),
        &faces,
        Material::grey(0.5),
    )
}

/// A floor, or a ceiling.
fn level(floor: &Floor, y: f64, faces_up: bool) -> Polygon {
    let corners = [
        (floor.x.start, floor.z.start),
        (floor.x.start, floor.z.end),
        (floor.x.end, floor.z.end),
        (floor.x.end, floor.z.start),
    ]
    .map(|(x, z)| DVec3::new(x, y, z));
    if faces_up { corners.to_vec() } else { corners.into_iter().rev().collect() }
}

/// All walls of a room, and the insides of the doors to its east and south, up to the next room.
fn walls(floor: &Floor) -> Vec<Polygon> {
    let [low, high] =
        [DVec3::new(floor.x.start, 0.0, floor.z.start), DVec3::new(floor.x.end, HEIGHT, floor.z.end)];
    let (along_x, along_z) = (DVec3::X * (high.x - low.x), DVec3::Z * (high.z - low.z));
    let corner = |x: f64, z: f64| DVec3::new(x, 0.0, z);
    // From left to right as the room sees each wall.
    let mut polygons = wall(corner(low.x, low.z), along_x, floor.north);
    polygons.extend(wall(corner(high.x, low.z), along_z, floor.east));
    polygons.extend(wall(corner(high.x, high.z), -along_x, floor.south));
    polygons.extend(wall(corner(low.x, high.z), -along_z, floor.west));
    if floor.east {
        polygons.extend(doorway(corner(high.x, low.z), along_z, DVec3::X * WALL));
    }
    if floor.south {
        polygons.extend(doorway(corner(high.x, high.z), -along_x, DVec3::Z * WALL));
    }
    polygons
}

/// Where a door begins and ends along a wall: in its first half, away from the corner.
fn door(along: DVec3) -> [DVec3; 2] {
    let length = along.length();
    let middle = along * 0.5;
    let half = along * (DOOR[0] / 2.0 / length);
    [middle - half, middle + half]
}

/// A wall from left to right, with a door or without.
fn wall(left: DVec3, along: DVec3, has_door: bool) -> Vec<Polygon> {
    let panel = |from: DVec3, to: DVec3, bottom: f64| -> Polygon {
        let (low, high) = (DVec3::Y * bottom, DVec3::Y * HEIGHT);
        vec![left + from + low, left + to + low, left + to + high, left + from + high]
    };
    if !has_door {
        return vec![panel(DVec3::ZERO, along, 0.0)];
    }
    let [from, to] = door(along);
    vec![panel(DVec3::ZERO, from, 0.0), panel(from, to, DOOR[1]), panel(to, along, 0.0)]
}

/// The inside of a door through a wall: both jambs, the lintel and the threshold, seen from within.
fn doorway(left: DVec3, along: DVec3, through: DVec3) -> Vec<Polygon> {
    let [from, to] = door(along).map(|side| left + side);
    let up = DVec3::Y * DOOR[1];
    vec![
        vec![from, from + up, from + up + through, from + through],
        vec![to, to + through, to + up + through, to + up],
        vec![from + up, to + up, to + up + through, from + up + through],
        vec![from, from + through, to + through, to],
    ]
}

/// Numbers that look random and are always the same: SplitMix64.
struct Dice(u64);

impl Dice {
    fn throw(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        mixed ^ (mixed >> 31)
    }

    fn within(&mut self, range: Range<f64>) -> f64 {
        let part = (self.throw() >> 11) as f64 / (1_u64 << 53) as f64;
        range.start + part * (range.end - range.start)
    }

    fn below(&mut self, count: usize) -> usize {
        (self.throw() % count as u64) as usize
    }
}
