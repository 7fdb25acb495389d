use glam::DVec3;
use kernel::geometry::{ConvexPolygon, PlaneId};
use kernel::replica::{EncodedReplica, Receiver, Receivers, encode_receivers, encode_scene};
use kernel::row::{Precision, RowRequest, Shape, Shooter};

use bake::solver::{ShareEnergy, ShareId};

/// Patches along each edge of a wall, which are the shares.
const SHARES: usize = 4;

/// Receivers along each edge of a wall in the second step.
const RECEIVERS: usize = 5;

/// A cubic room with a screen in it.
pub struct Room {
    pub scene: EncodedReplica,
    /// A receiver in the middle of each share.
    pub coarse: EncodedReplica,
    /// More of them.
    pub fine: EncodedReplica,
    pub shares: Vec<ShareEnergy<f64>>,
    pub direct: Vec<f64>,
    /// Receivers in `fine`.
    pub fine_count: usize,
    shooters: Vec<Shooter>,
}

impl Room {
    pub fn new() -> Self {
        let (coarse, patches) = walls(SHARES, 1);
        let (fine, _) = walls(RECEIVERS, 1000);
        let corners = [[0.2, 0.5, 0.3], [0.7, 0.45, 0.3], [0.7, 0.45, 0.8], [0.2, 0.5, 0.8]];
        let screen = ConvexPolygon { plane: PlaneId(6), corners: corners.map(DVec3::from_array).to_vec() };
        let shares = (0..patches.len()).map(|receiver| {
            let reflectance = [0.7, 0.5, 0.3][receiver % 3];
            ShareEnergy { receiver, area: patches[receiver].area_vector().length(), reflectance }
        });
        let shooters = (0..)
            .zip(&patches)
            .map(|(key, patch)| Shooter { key, shape: Shape::Polygons(vec![patch.clone()]) });
        Self {
            scene: encode_scene(&[walls(1, 0).1, vec![screen]].concat()),
            // The light falls on one wall, and a little everywhere.
            direct: (0..patches.len())
                .map(|receiver| if receiver < 16 { 10.0 } else { 0.1 * (receiver % 7) as f64 })
                .collect(),
            shares: shares.collect(),
            shooters: shooters.collect(),
            fine_count: fine.receivers.len(),
            coarse: encode_receivers(&coarse),
            fine: encode_receivers(&fine),
        }
    }

    /// Asks for the rows of shares over the coarse receivers, or the fine ones.
    pub fn request(&self, shares: &[ShareId], over_fine: bool) -> RowRequest {
        let (receivers, count) =
            if over_fine { (&self.fine, self.fine_count) } else { (&self.coarse, self.shares.len()) };
        RowRequest {
            scene: self.scene.digest,
            receivers: receivers.digest,
            first_receiver: 0,
            receiver_count: count as u32,
            shooters: shares.iter().map(|share| self.shooters[share.index()].clone()).collect(),
            precision: Precision::DEFAULT,
        }
    }
}

/// The six walls of the unit cube, each of `n` x `n` squares, with a receiver in the middle of each.
fn walls(n: usize, first_key: u64) -> (Receivers, Vec<ConvexPolygon>) {
    let (mut receivers, mut patches) = (vec![], vec![]);
    for wall in 0..6 {
        let (axis, far) = (wall / 2, wall % 2 == 1);
        let point = |u: f64, v: f64| {
            let mut point = [0.0; 3];
            point[axis] = if far { 1.0 } else { 0.0 };
            (point[(axis + 1) % 3], point[(axis + 2) % 3]) = (u / n as f64, v / n as f64);
            DVec3::from_array(point)
        };
        let mut normal = DVec3::ZERO;
        normal[axis] = if far { -1.0 } else { 1.0 };
        let plane = PlaneId(wall as u32);
        for (u, v) in (0..n * n).map(|index| ((index / n) as f64, (index % n) as f64)) {
            let mut corners =
                vec![point(u, v), point(u + 1.0, v), point(u + 1.0, v + 1.0), point(u, v + 1.0)];
            if far {
                corners.reverse();
            }
            patches.push(ConvexPolygon { plane, corners });
            receivers.push(Receiver { position: point(u + 0.5, v + 0.5), normal, plane });
        }
    }
    (Receivers { first_key, receivers }, patches)
}
