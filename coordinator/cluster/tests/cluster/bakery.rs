//! Something to compute: a few receivers under a lamp, with a screen between them.

use std::collections::BTreeMap;

use bake::RowService;
use cluster::{Handle, JobId};
use glam::DVec3;
use kernel::geometry::{ConvexPolygon, PlaneId};
use kernel::replica::{Digest, EncodedReplica, Receiver, Receivers, encode_receivers, encode_scene};
use kernel::row::{Precision, Row, RowRequest, Shape, Shooter, encode_row};
use kernel::visibility::ReceiverGroups;
use protocol::worker::RowJob;
use worker::engine::{Scene, compute_row};

/// A small scene, and jobs that it gives.
pub struct Bakery {
    occluders: Vec<ConvexPolygon>,
    receivers: Receivers,
    scene_replica: EncodedReplica,
    receivers_replica: EncodedReplica,
}

fn square(plane: u32, centre: DVec3, half_side: f64) -> ConvexPolygon {
    let corner = |x, z| centre + DVec3::new(x, 0.0, z) * half_side;
    // Seen from below it turns counter-clockwise: light leaves downwards.
    let corners = vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
    ConvexPolygon { plane: PlaneId(plane), corners }
}

impl Bakery {
    pub fn new() -> Self {
        let occluders = vec![square(1, DVec3::new(300.0, 500.0, 0.0), 100.0)];
        let receiver =
            |i| Receiver { position: DVec3::X * f64::from(i) * 10.0, normal: DVec3::Y, plane: PlaneId(0) };
        let receivers = Receivers { first_key: 40, receivers: (0..90).map(receiver).collect() };
        let (scene_replica, receivers_replica) = (encode_scene(&occluders), encode_receivers(&receivers));
        Self { occluders, receivers, scene_replica, receivers_replica }
    }

    pub fn publish(&self, handle: &mut Handle) {
        self.replicas().into_iter().for_each(|replica| handle.publish(replica));
    }

    pub fn replicas(&self) -> [EncodedReplica; 2] {
        [self.scene_replica.clone(), self.receivers_replica.clone()]
    }

    pub fn digests(&self) -> [Digest; 2] {
        [self.scene_replica.digest, self.receivers_replica.digest]
    }

    /// Three lamps over ranges of receivers.
    pub fn requests(&self) -> Vec<RowRequest> {
        let shooter = |key: u64| Shooter {
            key,
            shape: Shape::Polygons(vec![square(2, DVec3::new(key as f64 * 100.0, 1000.0, 0.0), 50.0)]),
        };
        let request = |first_receiver| RowRequest {
            scene: self.scene_replica.digest,
            receivers: self.receivers_replica.digest,
            first_receiver,
            receiver_count: 50,
            shooters: [1, 3, 5].map(shooter).to_vec(),
            precision: Precision {
                rays_per_hemisphere: 4096,
                minimum_rays: 16,
                maximum_rays: 256,
                seed: 7,
                ..Precision::DEFAULT
            },
        };
        (0..40).map(request).collect()
    }

    /// What workers must answer to [`Self::requests`].
    pub fn rows(&self) -> BTreeMap<u64, Vec<Row>> {
        let scene = Scene::new(&self.occluders);
        let rows = |request: RowRequest| {
            let first = request.first_receiver as usize;
            let receivers = &self.receivers.receivers[first..first + request.receiver_count as usize];
            let first_key = self.receivers.first_key + u64::from(request.first_receiver);
            let groups = ReceiverGroups::new(receivers.to_vec());
            let row =
                |shooter| Row::new(&compute_row(&scene, &groups, first_key, shooter, &request.precision).0);
            request.shooters.iter().map(row).collect()
        };
        (0..).zip(self.requests().into_iter().map(rows)).collect()
    }
}

/// Submits all requests, with their places as ids.
pub fn submit_all(handle: &mut Handle, bakery: &Bakery) {
    handle.submit((0..).map(JobId).zip(bakery.requests()).collect());
}

/// Waits for as many results as there are requests.
pub fn take_all(handle: &mut Handle, bakery: &Bakery) -> BTreeMap<u64, Vec<Row>> {
    let results = bakery.requests().into_iter().map(|_| handle.next().unwrap());
    results.map(|finished| (finished.job.0, finished.rows)).collect()
}

/// Rows for a job in which nobody sees anybody.
pub fn dark_rows(job: &RowJob) -> Vec<tonic::codegen::Bytes> {
    job.shooters.iter().map(|_| encode_row(&Row::new(&vec![0.0; job.receiver_count as usize]))).collect()
}

#[test]
fn the_screen_throws_a_shadow() {
    let rows = Bakery::new().rows();
    let factors: usize = rows.values().flatten().map(Row::receivers).sum();
    let lit: usize = rows.values().flatten().map(Row::count).sum();
    assert!(lit > 0 && lit < factors, "{lit} of {factors}");
}
