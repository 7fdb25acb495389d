use std::f64::consts::FRAC_PI_4;

use glam::DVec3;
use kernel::geometry::PlaneId;
use kernel::row::Spot;
use scene::{AreaLight, AreaShape, Facet, LightKind, Scene};

use super::*;
use crate::test_scenes::{facet, scene};

const EXTENT: f64 = 1000.0;
const ERROR: f64 = 0.03;
/// Bound of the distance between computed and expected points.
const EXACT: f64 = 1e-6;

/// A horizontal rectangle, facing up.
fn level(plane: u32, y: f64, [x0, x1]: [f64; 2], [z0, z1]: [f64; 2]) -> Facet {
    facet(plane, &[[x0, y, z0], [x0, y, z1], [x1, y, z1], [x1, y, z0]])
}

fn floor() -> Facet {
    level(0, 0.0, [-500.0, 500.0], [-500.0, 500.0])
}

/// The six faces of a box, facing out or in.
fn faces(first_plane: u32, low: [f64; 3], high: [f64; 3], out: bool) -> Vec<Facet> {
    let at = |x: usize, y: usize, z: usize| [[low, high][x][0], [low, high][y][1], [low, high][z][2]];
    let mut faces = vec![];
    for axis in 0..3 {
        for side in 0..2 {
            let corner = |u: usize, v: usize| {
                let mut sides = [side; 3];
                (sides[(axis + 1) % 3], sides[(axis + 2) % 3]) = (u, v);
                at(sides[0], sides[1], sides[2])
            };
            let mut corners = vec![corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
            if (side == 1) != out {
                corners.reverse();
            }
            faces.push(facet(first_plane + faces.len() as u32, &corners));
        }
    }
    faces
}

fn point(x: f64, y: f64, z: f64) -> LightKind {
    LightKind::Point { position: DVec3::new(x, y, z) }
}

fn sun(x: f64, y: f64, z: f64) -> LightKind {
    LightKind::Directional { along: DVec3::new(x, y, z).normalize() }
}

fn lines_of(scene: &Scene) -> Vec<Vec<Vec<Contact>>> {
    shadow_lines(scene, EXTENT, ERROR)
}

fn count(lines: &[Vec<Vec<Contact>>]) -> usize {
    lines.iter().flatten().map(Vec::len).sum()
}

/// Both lists have the same lines, in whatever order and direction.
fn assert_lines(found: &[Contact], expected: &[[[f64; 3]; 2]]) {
    let expected: Vec<Contact> = expected.iter().map(|ends| ends.map(DVec3::from_array)).collect();
    let is_same = |a: &Contact, b: &Contact| {
        let apart = |b: [DVec3; 2]| a[0].distance(b[0]).max(a[1].distance(b[1]));
        apart(*b).min(apart([b[1], b[0]])) <= EXACT
    };
    for line in &expected {
        assert!(found.iter().any(|other| is_same(line, other)), "{line:?} is not among {found:?}");
    }
    assert_eq!(found.len(), expected.len(), "{found:?}");
}

fn outline(y: f64, [x0, x1]: [f64; 2], [z0, z1]: [f64; 2]) -> Vec<[[f64; 3]; 2]> {
    let corners = [[x0, y, z0], [x0, y, z1], [x1, y, z1], [x1, y, z0]];
    (0..4).map(|i| [corners[i], corners[(i + 1) % 4]]).collect()
}

#[test]
fn quad_over_a_floor_under_a_point_light() {
    let quad = level(1, 100.0, [-50.0, 50.0], [-30.0, 30.0]);
    for reversed in [false, true] {
        let mut quad = quad.clone();
        if reversed {
            quad.corners.reverse();
            quad.normal = -quad.normal;
        }
        let scene = scene(vec![vec![floor()], vec![quad]], vec![point(0.0, 400.0, 0.0)]);
        let lines = lines_of(&scene);
        let (x, z) = (50.0 * 4.0 / 3.0, 40.0);
        assert_lines(&lines[0][0], &outline(0.0, [-x, x], [-z, z]));
        assert_eq!(count(&lines), 4);
    }
}

#[test]
fn quad_over_a_floor_under_the_sun() {
    let quad = level(1, 100.0, [-50.0, 50.0], [-30.0, 30.0]);
    let scene = scene(vec![vec![floor()], vec![quad]], vec![sun(0.6, -0.8, 0.0)]);
    let lines = lines_of(&scene);
    assert_lines(&lines[0][0], &outline(0.0, [25.0, 125.0], [-30.0, 30.0]));
}

#[test]
fn spots_cast_shadows_inside_their_cone_only() {
    let quads =
        vec![level(1, 100.0, [-50.0, 50.0], [-30.0, 30.0]), level(2, 100.0, [-450.0, -400.0], [-30.0, 30.0])];
    let spot = LightKind::Spot(Spot {
        position: DVec3::new(0.0, 400.0, 0.0),
        direction: -DVec3::Y,
        inner_cosine: 0.9,
        outer_cosine: FRAC_PI_4.cos(),
    });
    let lines = lines_of(&scene(vec![vec![floor()], quads], vec![spot]));
    let (x, z) = (50.0 * 4.0 / 3.0, 40.0);
    assert_lines(&lines[0][0], &outline(0.0, [-x, x], [-z, z]));
}

#[test]
fn a_box_casts_the_shadow_of_its_outline() {
    // Each face is a surface of its own.
    let faces = faces(1, [-50.0, 100.0, -30.0], [50.0, 150.0, 30.0], true);
    let mut surfaces = vec![vec![floor()]];
    surfaces.extend(faces.into_iter().map(|face| vec![face]));
    let lines = lines_of(&scene(surfaces, vec![point(0.0, 400.0, 0.0)]));
    let by = 400.0 / 250.0;
    assert_lines(&lines[0][0], &outline(0.0, [-50.0 * by, 50.0 * by], [-30.0 * by, 30.0 * by]));
}

#[test]
fn lines_end_where_shadows_overlap() {
    // Shadows: [-50, 50]^2, and [0, 100] x [20, 120] from farther up.
    let quads =
        vec![level(1, 100.0, [-50.0, 50.0], [-50.0, 50.0]), level(2, 200.0, [0.0, 100.0], [20.0, 120.0])];
    let lines = lines_of(&scene(vec![vec![floor()], quads], vec![sun(0.0, -1.0, 0.0)]));
    let outline: Vec<[[f64; 3]; 2]> = [
        [[-50.0, -50.0], [50.0, -50.0]],
        [[50.0, -50.0], [50.0, 20.0]],
        [[50.0, 20.0], [100.0, 20.0]],
        [[100.0, 20.0], [100.0, 120.0]],
        [[100.0, 120.0], [0.0, 120.0]],
        [[0.0, 120.0], [0.0, 50.0]],
        [[0.0, 50.0], [-50.0, 50.0]],
        [[-50.0, 50.0], [-50.0, -50.0]],
    ]
    .iter()
    .map(|ends| ends.map(|[x, z]| [x, 0.0, z]))
    .collect();
    assert_lines(&lines[0][0], &outline);
    // The upper quad shades the lower one.
    let on_lower = [[[0.0, 100.0, 20.0], [50.0, 100.0, 20.0]], [[0.0, 100.0, 20.0], [0.0, 100.0, 50.0]]];
    assert_lines(&lines[1][0], &on_lower);
}

#[test]
fn shadow_of_a_wall_starts_at_its_foot() {
    let wall = facet(1, &[[0.0, 0.0, -50.0], [0.0, 0.0, 50.0], [0.0, 100.0, 50.0], [0.0, 100.0, -50.0]]);
    let lines = lines_of(&scene(vec![vec![floor()], vec![wall]], vec![point(-200.0, 300.0, 0.0)]));
    let (near, far) = ([[0.0, 0.0, -50.0], [0.0, 0.0, 50.0]], [[100.0, 0.0, -75.0], [100.0, 0.0, 75.0]]);
    assert_lines(&lines[0][0], &[[near[0], far[0]], [near[1], far[1]], far]);
}

#[test]
fn a_shadow_ends_where_a_box_stands_on_the_floor() {
    let quad = level(1, 100.0, [-200.0, 0.0], [-20.0, 20.0]);
    let standing = faces(2, [-100.0, 0.0, -10.0], [-60.0, 30.0, 10.0], true);
    let lines = lines_of(&scene(vec![vec![floor()], vec![quad], standing], vec![sun(0.0, -1.0, 0.0)]));
    assert_lines(&lines[0][0], &outline(0.0, [-200.0, 0.0], [-20.0, 20.0]));
    // A shadow that runs into the box ends at its foot, and goes on over it.
    let quad = level(1, 100.0, [-200.0, 0.0], [0.0, 20.0]);
    let standing = faces(2, [-100.0, 0.0, -10.0], [-60.0, 30.0, 10.0], true);
    let lines = lines_of(&scene(vec![vec![floor()], vec![quad], standing], vec![sun(0.0, -1.0, 0.0)]));
    let on_floor: Vec<Contact> = lines[0][0].clone();
    let front: Vec<&Contact> =
        on_floor.iter().filter(|line| line.iter().all(|end| end.z.abs() < 1.0)).collect();
    let mut ends: Vec<f64> = front.iter().flat_map(|line| line.map(|end| end.x)).collect();
    ends.sort_by(f64::total_cmp);
    for (end, expected) in ends.iter().zip([-200.0, -100.0, -60.0, 0.0]) {
        assert!((end - expected).abs() <= EXACT, "{ends:?}");
    }
    let on_top: Vec<Contact> = lines[2].iter().flatten().copied().collect();
    assert_lines(&on_top, &[[[-100.0, 30.0, 0.0], [-60.0, 30.0, 0.0]]]);
}

#[test]
fn facets_of_one_plane_each_get_their_part() {
    let floors =
        vec![level(0, 0.0, [-500.0, 10.0], [-500.0, 500.0]), level(0, 0.0, [10.0, 500.0], [-500.0, 500.0])];
    let quad = level(1, 100.0, [-50.0, 50.0], [-30.0, 30.0]);
    let lines = lines_of(&scene(vec![floors, vec![quad]], vec![sun(0.0, -1.0, 0.0)]));
    let (left, right) =
        (outline(0.0, [-50.0, 10.0], [-30.0, 30.0]), outline(0.0, [10.0, 50.0], [-30.0, 30.0]));
    assert_lines(&lines[0][0], &[left[0], left[1], left[3]]);
    assert_lines(&lines[0][1], &[right[1], right[2], right[3]]);
}

#[test]
fn round_shadows_are_whole_chains() {
    let turn = std::f64::consts::TAU / 64.0;
    let corner = |i: u32| {
        let (z, x) = (f64::from(i) * turn).sin_cos();
        [60.0 * x, 100.0, 60.0 * z]
    };
    let disk = facet(1, &(0..64).map(corner).collect::<Vec<_>>());
    let lines = lines_of(&scene(vec![vec![floor()], vec![disk]], vec![point(0.0, 400.0, 0.0)]));
    assert_eq!(lines[0][0].len(), 64);
    let apart = lines[0][0].iter().flatten().map(|end| (end.length() - 80.0).abs()).fold(0.0, f64::max);
    assert!(apart <= EXACT, "{apart:e}");
}

#[test]
fn lines_that_no_one_sees_are_left_out() {
    let quad = || vec![level(1, 100.0, [-50.0, 50.0], [-30.0, 30.0])];
    let with = |lights: Vec<LightKind>| scene(vec![vec![floor()], quad()], lights);
    let area = AreaLight {
        shape: AreaShape::Rectangle,
        centre: DVec3::Y * 400.0,
        across: DVec3::X,
        along: -DVec3::Z,
        plane: PlaneId(9),
    };
    // Under the floor, over a closed lid, without light, or with an area.
    assert_eq!(count(&lines_of(&with(vec![point(0.0, -400.0, 0.0)]))), 0);
    assert_eq!(count(&lines_of(&with(vec![LightKind::Area(area)]))), 0);
    let lid = vec![level(7, 300.0, [-5000.0, 5000.0], [-5000.0, 5000.0])];
    let lidded = scene(vec![vec![floor()], quad(), lid], vec![point(0.0, 400.0, 0.0)]);
    assert_eq!(count(&lines_of(&lidded)), 0);
    let mut dark = with(vec![point(0.0, 400.0, 0.0)]);
    dark.lights[0].intensity = DVec3::ZERO;
    assert_eq!(count(&lines_of(&dark)), 0);
    // Glass casts no sharp shadow.
    let mut glass = with(vec![point(0.0, 400.0, 0.0)]);
    glass.surfaces[1].opacity = 0.5;
    assert_eq!(count(&lines_of(&glass)), 0);
    // Where the error asked for is large, and where another light outshines the jump.
    assert_eq!(count(&shadow_lines(&with(vec![point(0.0, 400.0, 0.0)]), EXTENT, 0.5)), 0);
    let mut outshone = with(vec![point(0.0, 400.0, 0.0), sun(0.0, -1.0, 0.0)]);
    outshone.lights[1].intensity *= 1e3;
    let lines = lines_of(&outshone);
    assert_lines(&lines[0][0], &outline(0.0, [-50.0, 50.0], [-30.0, 30.0]));
}

/// Quads and boxes at places that look random.
fn crowd() -> Scene {
    let mut state = 1_u64;
    let mut random = move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f64 / (1_u64 << 24) as f64
    };
    let mut surfaces = vec![vec![floor()]];
    for index in 0..40 {
        let (x, y, z) = (800.0 * random() - 400.0, 200.0 * random(), 800.0 * random() - 400.0);
        let size = [10.0 + 90.0 * random(), 5.0 + 40.0 * random(), 10.0 + 90.0 * random()];
        surfaces.push(faces(1 + 6 * index, [x, y, z], [x + size[0], y + size[1], z + size[2]], true));
    }
    scene(surfaces, vec![point(30.0, 600.0, -70.0), sun(0.3, -0.8, 0.4)])
}

#[test]
fn the_same_lines_whatever_the_threads() {
    let scene = crowd();
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| lines_of(&scene))
    };
    let lines = with(1);
    assert!(count(&lines) > 200, "{}", count(&lines));
    assert_eq!(lines, with(3));
}

/// A hair beside a line there is light, on the other side shadow: at nearly all places, since narrow gaps are not looked for.
#[test]
fn lines_divide_light_from_shadow() {
    let scene = crowd();
    let sources = source::sources(&scene);
    let polygons: Vec<ConvexPolygon> = casters(&scene).map(Facet::polygon).collect();
    let occluder = Occluder::new(&polygons);
    let (mut right, mut all) = (0, 0);
    for (surface, own) in lines_of(&scene).iter().enumerate() {
        for (index, lines) in own.iter().enumerate() {
            let facet = &scene.surfaces[surface].facets[index];
            for [start, end] in lines {
                let across = (*end - *start).cross(facet.normal).normalize();
                for t in [0.1, 0.35, 0.6, 0.9] {
                    let divides = |source: &source::Source| {
                        let hidden = [1.0, -1.0].map(|side| {
                            let point = start.lerp(*end, t) + across * (0.02 * side);
                            source.is_hidden(&occluder, point, facet.plane)
                        });
                        hidden[0] != hidden[1]
                    };
                    all += 1;
                    right += usize::from(sources.iter().any(divides));
                }
            }
        }
    }
    assert!(right as f64 >= 0.98 * all as f64, "{right} of {all}");
}

#[test]
fn junk_gives_finite_lines() {
    let degenerate = vec![
        facet(20, &[[1.0, 2.0, 3.0]; 3]),
        facet(21, &[[0.0, 50.0, 0.0], [10.0, 50.0, 0.0], [20.0, 50.0, 0.0]]),
        facet(22, &[[0.0, 50.0, 0.0], [0.0, 50.0, 0.0], [20.0, 50.0, 7.0], [20.0, 50.0, 7.0]]),
    ];
    // Its plane goes through the lights; one light is a corner of it.
    let upright = facet(23, &[[0.0, 10.0, 0.0], [0.0, 400.0, 0.0], [80.0, 400.0, 0.0], [80.0, 10.0, 0.0]]);
    let above = level(24, 600.0, [-50.0, 50.0], [-50.0, 50.0]);
    let around = faces(25, [-20.0, 380.0, -20.0], [20.0, 420.0, 20.0], false);
    let lights = || {
        vec![
            point(0.0, 400.0, 0.0),
            point(40.0, 200.0, 0.0),
            point(0.0, 0.0, 0.0),
            point(1e12, 1e12, 0.0),
            sun(0.0, -1.0, 0.0),
            sun(1.0, 0.0, 0.0),
        ]
    };
    let parts = [degenerate, vec![upright], vec![above], around];
    for count in 0..=parts.len() {
        let mut surfaces = vec![vec![floor()]];
        surfaces.extend(parts[..count].iter().cloned());
        let lines = lines_of(&scene(surfaces, lights()));
        assert!(lines.iter().flatten().flatten().flatten().all(|end| end.is_finite()), "{count}");
    }
    assert_eq!(count(&lines_of(&scene(vec![], lights()))), 0);
    assert_eq!(count(&lines_of(&scene(vec![vec![]], lights()))), 0);
}

#[test]
fn a_light_in_a_box_casts_no_shadow_outside() {
    let closed = faces(1, [-20.0, 380.0, -20.0], [20.0, 420.0, 20.0], false);
    let scene = scene(vec![vec![floor()], closed], vec![point(0.0, 400.0, 0.0)]);
    assert_eq!(count(&lines_of(&scene)), 0);
}
