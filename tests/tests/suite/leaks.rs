//! No light through a closed wall, also where rays hit exactly the edges and corners of its triangles.

use glam::{DQuat, DVec3};
use kernel::geometry::{ConvexPolygon, PlaneId};
use kernel::occluder::Occluder;
use kernel::replica::Receiver;
use kernel::row::{Precision, Shape, Shooter};
use kernel::visibility::ReceiverGroups;
use tests::shapes;
use worker::engine::{Scene, compute_row};

/// Planes of the ends of rays: no wall has them.
const BELOW: PlaneId = PlaneId(1_000_000);
const ABOVE: PlaneId = PlaneId(1_000_001);

/// A coordinate system in which all numbers are as round or as crooked as `turn` makes them, at the size that scenes have
/// in their frame.
struct Placing {
    turn: DQuat,
    offset: DVec3,
}

impl Placing {
    fn all() -> [Self; 2] {
        let crooked = DQuat::from_axis_angle(DVec3::new(0.3, 0.5, 0.7).normalize(), 0.6180);
        [(DQuat::IDENTITY, DVec3::ZERO), (crooked, DVec3::new(31.7, -5.3, 77.1))]
            .map(|(turn, offset)| Self { turn, offset })
    }

    fn place(&self, point: DVec3) -> DVec3 {
        self.turn * (point * 900.0) + self.offset
    }

    fn wall(&self, polygons: &[Vec<DVec3>]) -> Vec<ConvexPolygon> {
        let place = |corner: &DVec3| self.place(*corner);
        let polygon = |corners: &Vec<DVec3>| ConvexPolygon {
            plane: PlaneId(0),
            corners: corners.iter().map(place).collect(),
        };
        polygons.iter().map(polygon).collect()
    }
}

/// Number of segments that pass a wall.
fn leaks(occluder: &Occluder, segments: impl Iterator<Item = (DVec3, DVec3)>) -> (usize, usize) {
    segments.fold((0, 0), |(leaks, count), (from, to)| {
        (leaks + usize::from(!occluder.blocks(from, to, [BELOW, ABOVE])), count + 1)
    })
}

/// From every inner lattice point below the wall to every one above it: the middle of each segment lies on a vertex, an edge
/// or a diagonal of the wall.
#[test]
fn walls_of_triangles() {
    for placing in Placing::all() {
        for cells in [10, 13, 16] {
            let occluder = Occluder::new(&placing.wall(&shapes::triangle_grid(cells)));
            let lattice: Vec<DVec3> = (1..cells)
                .flat_map(|i| (1..cells).map(move |j| (i, j)))
                .map(|(i, j)| {
                    let place = |k: u32| -1.0 + 2.0 * f64::from(k) / f64::from(cells);
                    DVec3::new(place(i), place(j), 0.0)
                })
                .collect();
            let segments = lattice
                .iter()
                .flat_map(|from| lattice.iter().map(move |to| (*from - DVec3::Z * 0.5, *to + DVec3::Z * 0.5)))
                .map(|(from, to)| (placing.place(from), placing.place(to)));
            let (leaks, count) = leaks(&occluder, segments);
            assert!(count >= 6_000);
            assert_eq!(leaks, 0, "{cells} x {cells}: of {count} segments");
        }
    }
}

/// From points inside a sphere through every vertex and the middle of every edge.
#[test]
fn closed_sphere() {
    for placing in Placing::all() {
        let faces = shapes::icosphere(4);
        let wall: Vec<Vec<DVec3>> = faces.iter().map(|face| face.to_vec()).collect();
        let occluder = Occluder::new(&placing.wall(&wall));
        let mut targets: Vec<DVec3> = faces
            .iter()
            .flat_map(|&[a, b, c]| [a, b, c, a.midpoint(b), b.midpoint(c), c.midpoint(a)])
            .collect();
        targets.sort_by(|a, b| a.to_array().partial_cmp(&b.to_array()).unwrap());
        targets.dedup();
        // From the middle, and from points spread over the inside by the golden angle.
        let origins = (0..18).map(|i| {
            let height = f64::from(i) / 18.0 - 0.5;
            let (sine, cosine) = (2.399_963 * f64::from(i)).sin_cos();
            if i == 0 { DVec3::ZERO } else { DVec3::new(0.6 * cosine, 0.6 * sine, height) }
        });
        let segments = origins
            .flat_map(|origin| targets.iter().map(move |target| (origin, origin + (*target - origin) * 2.5)))
            .map(|(from, to)| (placing.place(from), placing.place(to)));
        let (leaks, count) = leaks(&occluder, segments);
        assert!(count >= 184_000, "{count}");
        assert_eq!(leaks, 0, "of {count} rays");
    }
}

/// A square behind a larger wall has no visible form factor, neither where the wall is cut out of it nor where rays sample it.
#[test]
fn form_factors_through_a_wall() {
    let precision = Precision {
        rays_per_hemisphere: 4096,
        minimum_rays: 64,
        maximum_rays: 256,
        seed: 1,
        ..Precision::DEFAULT
    };
    for placing in Placing::all() {
        let square = [[0.5, 0.5], [0.5, -0.5], [-0.5, -0.5], [-0.5, 0.5]];
        let corners = square.map(|[x, y]| placing.place(DVec3::new(x, y, 0.25))).to_vec();
        let shooter =
            Shooter { key: 0, shape: Shape::Polygons(vec![ConvexPolygon { plane: ABOVE, corners }]) };
        let place = |k: i32| f64::from(k - 4) / 8.0;
        let receivers: Vec<Receiver> = (0..81)
            .map(|i| Receiver {
                position: placing.place(DVec3::new(place(i / 9), place(i % 9), -0.25)),
                normal: placing.turn * DVec3::Z,
                plane: BELOW,
            })
            .collect();
        let open =
            compute_row(&Scene::new(&[]), &ReceiverGroups::new(receivers.clone()), 0, &shooter, &precision).0;
        assert!(open.iter().all(|factor| *factor > 0.1));
        for cells in [1, 2, 3, 10, 13, 16] {
            let wall = Scene::new(&placing.wall(&shapes::triangle_grid(cells)));
            let (row, statistics) =
                compute_row(&wall, &ReceiverGroups::new(receivers.clone()), 0, &shooter, &precision);
            for (i, factor) in row.iter().enumerate() {
                assert_eq!(*factor, 0.0, "{cells} x {cells}, receiver {i}");
            }
            // Both ways to decide visibility are used.
            assert!(cells != 1 || statistics.sampled_pairs == 0);
            assert!(cells != 16 || statistics.sampled_pairs > 0);
        }
    }
}
