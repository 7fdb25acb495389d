//! Whatever the bytes of a replica, it is refused, or jobs can be computed with it.
#![no_main]

use glam::DVec3;
use kernel::geometry::PlaneId;
use kernel::replica::{Receiver, Receivers, decode_receivers, decode_scene};
use kernel::row::{Precision, Shape, Shooter};
use libfuzzer_sys::fuzz_target;
use protocol::worker::ReplicaKind;
use worker::engine::{ReceiverSet, Scene, compute_row};

/// More makes a round slow and finds nothing new.
const MOST_POLYGONS: usize = 64;
const MOST_RECEIVERS: usize = 128;

fuzz_target!(|input: (bool, &[u8])| {
    let (kind, bytes) = input;
    let kind = if kind { ReplicaKind::Scene } else { ReplicaKind::Receivers };
    let (polygons, receivers) = match kind {
        ReplicaKind::Scene => {
            let Ok(scene) = decode_scene(bytes) else { return };
            let polygons = scene.polygons;
            let corner = |polygon: usize| polygons.get(polygon).map_or(DVec3::ZERO, |p| p.corners[0]);
            let receiver =
                |i| Receiver { position: corner(i) + DVec3::Y, normal: DVec3::NEG_Y, plane: PlaneId(7) };
            let receivers = Receivers { first_key: 0, receivers: (0..33).map(receiver).collect() };
            (polygons, receivers)
        }
        _ => {
            let Ok(receivers) = decode_receivers(bytes) else { return };
            (vec![], receivers)
        }
    };
    if polygons.len() > MOST_POLYGONS || receivers.receivers.len() > MOST_RECEIVERS {
        return;
    }
    let set = ReceiverSet::new(receivers);
    let scene = Scene::new(&polygons);
    let mut shapes = vec![Shape::Point(DVec3::Y * 0.5), Shape::Directional(DVec3::NEG_Y), Shape::Sky(16)];
    shapes.extend(polygons.first().map(|polygon| Shape::Polygons(vec![polygon.clone()])));
    for shape in shapes {
        let shooter = Shooter { key: 3, shape };
        // Keys of a replica are checked with the job.
        let (row, _) = compute_row(&scene, &set.groups, 0, &shooter, &Precision::DEFAULT);
        assert_eq!(row.len(), set.groups.receivers().len());
    }
});
