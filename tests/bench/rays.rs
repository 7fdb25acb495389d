//! Rays for another program to cast too, and what the occluder here makes of them; driven by `tests/bench/rays`.
//!
//! `rays SCENE.glb FOLDER COUNT` takes all facets of a scene, `rays clutter:PIECES FOLDER COUNT` boxes and balls in a room.
//! It writes `triangles.f32`, with nine numbers each, and for each kind of rays `KIND.f32`, with six numbers each: both ends, or
//! of `closest` the origin and the direction. `closest.distances.f32` has how far each of those went, or infinity. `FOLDER` must
//! be there. One line of JSON on standard output has the figures: hits, and seconds of processor time of
//! the one thread that does everything.

use std::env;
use std::error::Error;
use std::fs;
use std::hint::black_box;
use std::path::Path;
use std::time::Instant;

use glam::DVec3;
use kernel::geometry::{ConvexPolygon, PlaneId, uniform_point};
use kernel::hemisphere::{Hit, SeenPolygons, directions};
use kernel::occluder::Occluder;
use scene::{ImportOptions, import};
use serde_json::{Map, Value, json};

/// How far ends of rays lie off the surfaces, in scene extents: more than the rounding of f32, so that both programs see the
/// same.
const LIFT: f64 = 1e-3;

/// Rays of a bundle: those of a pair of receiver and polygon that is sampled.
const BUNDLE: usize = 16;

/// Extent of the far end of a bundle, in scene extents.
const SPREAD: f64 = 0.05;

/// Rays of a hemisphere.
const HEMISPHERE: u32 = 256;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = env::args().skip(1).collect();
    let [scene, folder, count] = arguments.as_slice() else {
        return Err("usage: rays SCENE.glb|clutter:PIECES FOLDER COUNT".into());
    };
    let folder = Path::new(folder);
    let polygons = match scene.strip_prefix("clutter:") {
        Some(pieces) => clutter(pieces.parse()?),
        None => facets(Path::new(scene))?,
    };
    let triangles: Vec<[DVec3; 3]> = polygons.iter().flat_map(fan).collect();
    write(&folder.join("triangles.f32"), triangles.as_flattened())?;
    let (occluder, build_seconds) = built(&polygons);
    let mut kinds = Map::new();
    let places = Places::new(&polygons);
    for (kind, rays) in [("any", places.any(count.parse()?)), ("bundles", places.bundles(count.parse()?))] {
        write(&folder.join(format!("{kind}.f32")), rays.as_flattened())?;
        let clock = Clock::start();
        let hits = rays.iter().filter(|[from, to]| occluder.blocks(*from, *to, [PlaneId::NONE; 2])).count();
        let seconds = clock.seconds();
        kinds.insert(kind.into(), json!({ "rays": rays.len(), "hits": hits, "seconds": seconds }));
    }
    kinds.insert("closest".into(), closest(&polygons, &places.hemispheres(count.parse()?), folder)?);
    println!(
        "{}",
        json!({
            "polygons": polygons.len(),
            "triangles": triangles.len(),
            "build_seconds": build_seconds,
            "kinds": Value::Object(kinds),
        })
    );
    Ok(())
}

/// Casts rays, given by origin and direction, to what they meet first.
fn closest(polygons: &[ConvexPolygon], rays: &[[DVec3; 2]], folder: &Path) -> Result<Value, Box<dyn Error>> {
    let clock = Clock::start();
    let seen = SeenPolygons::new(polygons, &[]);
    let build_seconds = clock.seconds();
    let clock = Clock::start();
    let distance = |hit: Option<Hit>| hit.map_or(f32::INFINITY, |hit| hit.distance as f32);
    let distances: Vec<f32> =
        rays.iter().map(|[from, along]| distance(seen.nearest(*from, *along, 0.0, PlaneId::NONE))).collect();
    let seconds = clock.seconds();
    let hits = distances.iter().filter(|distance| distance.is_finite()).count();
    write(&folder.join("closest.f32"), rays.as_flattened())?;
    let bytes: Vec<u8> = distances.into_iter().flat_map(f32::to_le_bytes).collect();
    fs::write(folder.join("closest.distances.f32"), bytes)?;
    Ok(json!({ "rays": rays.len(), "hits": hits, "seconds": seconds, "build_seconds": build_seconds }))
}

/// Builds are repeated for this long: the system's clock of a thread is coarse.
const SHORTEST: f64 = 0.2;

/// The occluder, and the time that building it takes.
fn built(polygons: &[ConvexPolygon]) -> (Occluder, f64) {
    let clock = Clock::start();
    let mut builds = 0.0;
    loop {
        let occluder = black_box(Occluder::new(black_box(polygons)));
        builds += 1.0;
        let seconds = clock.seconds();
        if seconds >= SHORTEST {
            return (occluder, seconds / builds);
        }
    }
}

/// Time that this thread has had on a core, where the system tells; elsewhere the time that has passed.
struct Clock {
    start: Instant,
    used: Option<f64>,
}

impl Clock {
    fn start() -> Self {
        Self { start: Instant::now(), used: Self::used() }
    }

    fn used() -> Option<f64> {
        let text = fs::read_to_string("/proc/thread-self/schedstat").ok()?;
        text.split(' ').next()?.parse::<f64>().ok().map(|nanoseconds| nanoseconds * 1e-9)
    }

    fn seconds(&self) -> f64 {
        let passed = self.start.elapsed().as_secs_f64();
        self.used.zip(Self::used()).map_or(passed, |(before, now)| now - before)
    }
}

/// The coordinates as f32, which they are rounded to already.
fn write(path: &Path, points: &[DVec3]) -> std::io::Result<()> {
    let bytes: Vec<u8> =
        points.iter().flat_map(|p| p.as_vec3().to_array()).flat_map(f32::to_le_bytes).collect();
    fs::write(path, bytes)
}

/// All facets of a scene, those with everything on one side too.
fn facets(path: &Path) -> Result<Vec<ConvexPolygon>, Box<dyn Error>> {
    let scene = import(path, &ImportOptions::default())?;
    let facets = scene.surfaces.iter().flat_map(|surface| &surface.facets);
    let rounded = |facet: &scene::Facet| facet.corners.iter().map(|corner| round(corner.position)).collect();
    Ok(facets.map(|facet| ConvexPolygon { plane: facet.plane, corners: rounded(facet) }).collect())
}

fn fan(polygon: &ConvexPolygon) -> impl Iterator<Item = [DVec3; 3]> {
    polygon.corners[1..].windows(2).map(|pair| [polygon.corners[0], pair[0], pair[1]])
}

fn round(point: DVec3) -> DVec3 {
    point.as_vec3().as_dvec3()
}

/// A room of 10 m with boxes and balls in it, half of the pieces each.
fn clutter(pieces: u64) -> Vec<ConvexPolygon> {
    let mut shapes = box_around(DVec3::ZERO, DVec3::splat(5.0));
    for piece in 0..pieces {
        let mut random = Random(piece << 32);
        let centre = random.point() * 9.4 - 4.7;
        if piece % 2 == 0 {
            shapes.extend(box_around(centre, random.point() * 0.25 + 0.02));
        } else {
            shapes.extend(ball(centre, random.number() * 0.25 + 0.02));
        }
    }
    let plane = |index: usize| PlaneId(index as u32);
    let rounded = |corners: Vec<DVec3>| corners.into_iter().map(round).collect();
    shapes
        .into_iter()
        .enumerate()
        .map(|(index, corners)| ConvexPolygon { plane: plane(index), corners: rounded(corners) })
        .collect()
}

fn box_around(centre: DVec3, half: DVec3) -> Vec<Vec<DVec3>> {
    let side = |axis: usize, sign: f64| {
        let turned = |x: f64, y: f64| {
            let mut corner = DVec3::ZERO;
            (corner[axis], corner[(axis + 1) % 3], corner[(axis + 2) % 3]) = (sign, x, y);
            centre + corner * half
        };
        vec![turned(-1.0, -1.0), turned(1.0, -1.0), turned(1.0, 1.0), turned(-1.0, 1.0)]
    };
    (0..3).flat_map(|axis| [side(axis, -1.0), side(axis, 1.0)]).collect()
}

/// An octahedron on a sphere, whose triangles are cut in four twice: 128 of them.
fn ball(centre: DVec3, radius: f64) -> Vec<Vec<DVec3>> {
    let signs = [-1.0, 1.0];
    let octants = signs.iter().flat_map(|x| signs.iter().flat_map(|y| signs.iter().map(|z| (*x, *y, *z))));
    let mut triangles: Vec<[DVec3; 3]> =
        octants.map(|(x, y, z)| [DVec3::X * x, DVec3::Y * y, DVec3::Z * z]).collect();
    for _ in 0..2 {
        triangles = triangles
            .into_iter()
            .flat_map(|[a, b, c]| {
                let [ab, bc, ca] = [a + b, b + c, c + a].map(DVec3::normalize);
                [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
            })
            .collect();
    }
    triangles.into_iter().map(|corners| corners.map(|corner| centre + corner * radius).to_vec()).collect()
}

/// Points a little off the surfaces, on either side, uniform over the area.
struct Places<'a> {
    polygons: &'a [ConvexPolygon],
    /// Area of all polygons up to each.
    areas: Vec<f64>,
    size: f64,
}

impl<'a> Places<'a> {
    fn new(polygons: &'a [ConvexPolygon]) -> Self {
        let sum = |total: &mut f64, polygon: &ConvexPolygon| {
            *total += polygon.area();
            Some(*total)
        };
        let areas = polygons.iter().scan(0.0, sum).collect();
        let corners = || polygons.iter().flat_map(|polygon| polygon.corners.iter().copied());
        let low = corners().fold(DVec3::INFINITY, DVec3::min);
        let high = corners().fold(DVec3::NEG_INFINITY, DVec3::max);
        Self { polygons, areas, size: (high - low).max_element() }
    }

    fn place(&self, random: &mut Random) -> DVec3 {
        self.side(random).0
    }

    /// A place, and the unit vector that leads away from its surface.
    fn side(&self, random: &mut Random) -> (DVec3, DVec3) {
        let wanted = random.number() * self.areas.last().copied().unwrap_or(0.0);
        let polygon =
            &self.polygons[self.areas.partition_point(|area| *area < wanted).min(self.areas.len() - 1)];
        let point = uniform_point(&polygon.corners, random.number(), random.number());
        let side = if random.number() < 0.5 { -1.0 } else { 1.0 };
        let away = polygon.normal() * side;
        (point + away * (LIFT * self.size), away)
    }

    /// From points over their hemispheres, as rows of receivers cast them: origins and directions.
    fn hemispheres(&self, count: u64) -> Vec<[DVec3; 2]> {
        (0..count / u64::from(HEMISPHERE))
            .flat_map(|index| {
                let mut random = Random(index << 32 | 3 << 24);
                let (from, away) = self.side(&mut random);
                let directions = directions(away, HEMISPHERE, index as u32);
                directions.into_iter().map(move |(_, along)| [from, along].map(round))
            })
            .collect()
    }

    /// From anywhere to anywhere.
    fn any(&self, count: u64) -> Vec<[DVec3; 2]> {
        (0..count)
            .map(|index| {
                let mut random = Random(index << 32 | 1 << 24);
                [self.place(&mut random), self.place(&mut random)].map(round)
            })
            .collect()
    }

    /// From one point to many that lie close to each other, as a pair that is sampled casts them.
    fn bundles(&self, count: u64) -> Vec<[DVec3; 2]> {
        (0..count / BUNDLE as u64)
            .flat_map(|index| {
                let mut random = Random(index << 32 | 2 << 24);
                let (from, to) = (self.place(&mut random), self.place(&mut random));
                let ends: [DVec3; BUNDLE] =
                    std::array::from_fn(|_| to + (random.point() - 0.5) * (SPREAD * self.size));
                ends.map(|to| [from, to].map(round))
            })
            .collect()
    }
}

/// Numbers that look random: SplitMix64 (Steele, Lea, Flood 2014).
struct Random(u64);

impl Random {
    fn number(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let value = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let value = (value ^ (value >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((value ^ (value >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn point(&mut self) -> DVec3 {
        DVec3::new(self.number(), self.number(), self.number())
    }
}
