//! Near light: where a share fills much of a receiver's sky, its parts count each with its own radiosity.
//!
//! Rows take a share's radiosity as constant. Beside a corner that is far off: the receiver sees the few parts next to it, which are
//! darker than the mean of a share that reaches well into the room. What the row tells of visibility holds for all parts alike.

use glam::DVec3;
use kernel::form_factor::point_to_polygon;
use kernel::replica::Receiver;
use kernel::row::Row;
use rayon::prelude::*;
use smallvec::SmallVec;

use super::local_radiosity::{LocalRadiosity, Part};
use crate::error::Result;
use crate::jobs::Monitor;
use crate::mesh::Mesh;
use crate::solver::ShareId;

/// Form factor from which on a share is near.
const NEAR: f32 = 0.015;

/// Form factor from which on a part counts by its own parts.
const LARGE: f64 = 0.02;

/// Pairs that a thread takes at a time.
const AT_ONCE: usize = 64;

/// Rows that a thread takes at a time.
const ROWS_AT_ONCE: usize = 64;

/// Pairs after which a cancelled bake ends: some hundredths of a second.
const BETWEEN_CHECKS: usize = 1 << 14;

/// A share that is near to a receiver.
#[derive(Debug, Clone, Copy, PartialEq)]
struct NearShare {
    receiver: u32,
    share: ShareId,
    factor: f32,
}

/// The shares that are near to some receivers.
#[derive(Debug, Clone, Default)]
pub struct NearShares(Vec<NearShare>);

impl NearShares {
    /// Adds the receivers that a share is near to, given its row.
    pub fn add(&mut self, share: ShareId, row: &Row) {
        row.for_each(|receiver, factor| {
            if factor >= NEAR {
                self.0.push(NearShare { receiver: receiver as u32, share, factor });
            }
        });
    }

    /// Adds the same for several shares.
    pub fn add_all(&mut self, shares: &[ShareId], rows: &[&Row]) {
        let of_some = |(shares, rows): (&[ShareId], &[&Row])| {
            let mut some = Self::default();
            shares.iter().zip(rows).for_each(|(share, row)| some.add(*share, row));
            some
        };
        let all: Vec<Self> =
            shares.par_chunks(ROWS_AT_ONCE).zip(rows.par_chunks(ROWS_AT_ONCE)).map(of_some).collect();
        all.into_iter().for_each(|some| self.0.extend(some.0));
    }

    /// Sorts them by receiver, when all rows were added.
    pub fn sort(&mut self) {
        self.0.sort_unstable_by_key(|near| (near.receiver, near.share));
        self.0.shrink_to_fit();
    }

    /// What the parts of near shares give each receiver beside what these do as wholes, pair by pair.
    pub fn each_light(
        &self,
        monitor: &mut Monitor,
        mesh: &Mesh,
        receivers: &[Receiver],
        local: &LocalRadiosity,
        mut take: impl FnMut(usize, ShareId, DVec3),
    ) -> Result<()> {
        let light = |near: &NearShare| difference(mesh, &receivers[near.receiver as usize], near, local);
        for some in self.0.chunks(BETWEEN_CHECKS) {
            monitor.check()?;
            let all: Vec<DVec3> = some.par_iter().with_min_len(AT_ONCE).map(light).collect();
            some.iter().zip(all).for_each(|(near, light)| take(near.receiver as usize, near.share, light));
        }
        Ok(())
    }

    /// Adds the same to the light of the receivers. Light that is taken away leaves none below zero.
    pub fn add_light(
        &self,
        monitor: &mut Monitor,
        mesh: &Mesh,
        receivers: &[Receiver],
        local: &LocalRadiosity,
        light: &mut [DVec3],
    ) -> Result<()> {
        self.each_light(monitor, mesh, receivers, local, |receiver, _, near| light[receiver] += near)?;
        light.iter_mut().for_each(|light| *light = light.max(DVec3::ZERO));
        Ok(())
    }
}

/// What a receiver gets from the parts of a share beside what it gets from the whole.
fn difference(mesh: &Mesh, receiver: &Receiver, near: &NearShare, local: &LocalRadiosity) -> DVec3 {
    let share = near.share.index();
    let mut seen = Seen { mesh, receiver, local, light: DVec3::ZERO, factor: 0.0 };
    local.parts(share).iter().for_each(|part| seen.add(*part));
    if seen.factor <= 0.0 {
        return DVec3::ZERO;
    }
    (seen.light / seen.factor - local.of_share(share)) * f64::from(near.factor)
}

/// What a receiver would get from parts if nothing stood between.
struct Seen<'a> {
    mesh: &'a Mesh,
    receiver: &'a Receiver,
    local: &'a LocalRadiosity,
    light: DVec3,
    factor: f64,
}

impl Seen<'_> {
    fn add(&mut self, part: Part) {
        let mean = self.local.of_part(part);
        if mean.area <= 0.0 {
            return;
        }
        let corners: SmallVec<[DVec3; 8]> = match part {
            Part::Patch(id) => {
                self.mesh.patch(id).corners.iter().map(|corner| self.mesh.position(*corner)).collect()
            }
            Part::Quarter(id, corner) => SmallVec::from_slice(&self.mesh.corner_quad(id, corner)),
        };
        let factor = point_to_polygon(self.receiver.position, self.receiver.normal, &corners);
        match part {
            Part::Patch(id) if factor >= LARGE => {
                for corner in 0..self.mesh.patch(id).corners.len() {
                    self.add(self.local.part(self.mesh, id, corner));
                }
            }
            _ => {
                self.light += mean.radiosity * factor;
                self.factor += factor;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use kernel::geometry::PlaneId;
    use scene::Scene;

    use super::*;
    use crate::observer::Unobserved;
    use crate::rows::ShareMesh;
    use crate::test_scenes::{SIZE, divide, facet, scene};

    /// Light that rises from a corner into a wall.
    fn rising(position: DVec3) -> f64 {
        1.0 + (position.y / 100.0).min(3.0)
    }

    /// A wall above the x axis, divided so often after its shares were dealt out.
    fn wall(levels: u32) -> (Scene, ShareMesh) {
        let corners = [[0.0, 0.0, 0.0], [SIZE, 0.0, 0.0], [SIZE, SIZE, 0.0], [0.0, SIZE, 0.0]];
        let scene = scene(vec![vec![facet(0, &corners)]], vec![]);
        let mesh = Mesh::new(&scene, SIZE, SIZE, 12, &[]);
        let shares = mesh.shares(&scene);
        let mut wall = ShareMesh::new(&scene, mesh, shares);
        (0..levels).for_each(|_| divide(&mut wall.mesh, 1));
        (scene, wall)
    }

    /// What the shares of a wall give a receiver on the floor so far in front of it: as wholes, and with their parts.
    fn beside_a_wall(distance: f64) -> [f64; 2] {
        let (scene, shares) = wall(5);
        let vertices = &shares.mesh.vertices;
        let light: Vec<DVec3> = vertices.iter().map(|vertex| DVec3::splat(rising(vertex.position))).collect();
        let wholes = vec![DVec3::ONE; shares.shares.len()];
        let local = LocalRadiosity::new(&scene, &shares, &vec![true; light.len()], &light, wholes);
        let even: Vec<DVec3> = (0..shares.shares.len()).map(|share| local.of_share(share)).collect();
        let position = DVec3::new(0.4 * SIZE, 0.0, distance);
        let receiver = Receiver { position, normal: DVec3::Y, plane: PlaneId(1) };
        let mut near = NearShares::default();
        let mut as_wholes = 0.0;
        for (index, share) in shares.shares.iter().enumerate() {
            let factor: f64 =
                share.polygons.iter().map(|part| point_to_polygon(position, DVec3::Y, &part.corners)).sum();
            as_wholes += factor * even[index].x;
            near.add(ShareId(index as u32), &Row::new(&[factor as f32]));
        }
        near.sort();
        let mut with_parts = as_wholes;
        let (mesh, mut observer) = (&shares.mesh, Unobserved);
        let mut monitor = Monitor::new(&mut observer);
        near.each_light(&mut monitor, mesh, &[receiver], &local, |_, _, light| with_parts += light.x)
            .unwrap();
        [as_wholes, with_parts]
    }

    /// The same from strips of the wall, thin against its distance.
    fn from_strips(distance: f64) -> f64 {
        let strips = 4000;
        let height = SIZE / f64::from(strips);
        let of_strip = |index: u32| {
            let (low, high) = (height * f64::from(index), height * f64::from(index + 1));
            let corners = [
                DVec3::new(0.0, low, 0.0),
                DVec3::new(SIZE, low, 0.0),
                DVec3::new(SIZE, high, 0.0),
                DVec3::new(0.0, high, 0.0),
            ];
            let factor = point_to_polygon(DVec3::new(0.4 * SIZE, 0.0, distance), DVec3::Y, &corners);
            // Half of what falls on the wall leaves it.
            0.5 * factor * rising(DVec3::Y * (low + high) / 2.0)
        };
        (0..strips).map(of_strip).sum()
    }

    #[test]
    fn a_receiver_in_a_corner_sees_the_parts_next_to_it() {
        for distance in [20.0, 60.0, 200.0] {
            let exact = from_strips(distance);
            let [as_wholes, with_parts] = beside_a_wall(distance).map(|light| (light / exact - 1.0).abs());
            assert!(with_parts < 0.01, "{distance}: off by {with_parts}");
            assert!(with_parts < 0.25 * as_wholes, "{distance}: {with_parts}, as wholes {as_wholes}");
        }
    }

    /// What sees nothing does not count, however dark it is: one corner of a leaf, or a whole leaf.
    #[test]
    fn parts_that_see_nothing_do_not_count() {
        let (scene, wall) = wall(3);
        let vertices = &wall.mesh.vertices;
        for hidden in [0.0, 0.3 * SIZE] {
            let exposed: Vec<bool> =
                vertices.iter().map(|vertex| vertex.position.max_element() > hidden).collect();
            assert!(!exposed.iter().all(|exposed| *exposed));
            let light: Vec<DVec3> = exposed.iter().map(|exposed| DVec3::splat(f64::from(*exposed))).collect();
            let local = LocalRadiosity::new(&scene, &wall, &exposed, &light, vec![]);
            for share in 0..wall.shares.len() {
                assert!((local.of_share(share) - DVec3::splat(0.5)).length() < 1e-12, "{hidden}");
            }
        }
    }
}
