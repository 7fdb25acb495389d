//! Rows of a building without any visibility: all within a room see each other, and nobody sees into another room.
//!
//! What they cost grows with the rooms and not with their square, and is little. What a bake takes beside its rows shows with
//! them, in memory and in time, up to buildings of any size.

use std::collections::{HashMap, VecDeque};
use std::f64::consts::PI;
use std::time::Duration;

use bake::{BakeError, RowService};
use cluster::{FinishedJob, JobId};
use glam::DVec3;
use kernel::geometry::{ConvexPolygon, area_vector};
use kernel::replica::{Digest, EncodedReplica, Receiver, decode_receivers};
use kernel::row::{Row, RowRequest, Shape, Shooter, encode_row};
use protocol::worker::{ReplicaKind, RowStatistics};
use scene::Frame;

use crate::building::Building;

/// Computes such rows, and counts what they would weigh on the wire.
pub struct RoomsOnly<'a> {
    building: &'a Building,
    frame: Frame,
    sets: HashMap<Digest, ReceiverSet>,
    jobs: VecDeque<(JobId, RowRequest)>,
    /// Bytes of all rows as they travel.
    pub bytes: u64,
}

/// The receivers of a set by room, with their index in the set.
type ReceiverSet = Vec<Vec<(usize, Receiver)>>;

impl<'a> RoomsOnly<'a> {
    /// For a building, imported with this frame.
    #[must_use]
    pub fn new(building: &'a Building, frame: Frame) -> Self {
        Self { building, frame, sets: HashMap::new(), jobs: VecDeque::new(), bytes: 0 }
    }

    fn room_at(&self, position: DVec3) -> usize {
        self.building.room_at(self.frame.to_world(position))
    }

    fn row(&self, request: &RowRequest, shooter: &Shooter) -> Row {
        let by_room = &self.sets[&request.receivers];
        let (first, count) = (request.first_receiver as usize, request.receiver_count as usize);
        let Shape::Polygons(polygons) = &shooter.shape else { return Row::of_some(count, &[]) };
        let middles: Vec<DVec3> = polygons.iter().map(middle).collect();
        let parts: Vec<(DVec3, DVec3)> =
            polygons.iter().zip(&middles).map(|(polygon, at)| (*at, area_vector(&polygon.corners))).collect();
        let receivers = &by_room[self.room_at(middles[0])];
        let factors: Vec<(usize, f32)> = receivers
            .iter()
            .filter(|(index, _)| (first..first + count).contains(index))
            .map(|(index, receiver)| {
                (
                    *index - first,
                    parts.iter().map(|(at, area)| form_factor(receiver, *at, *area)).sum::<f64>() as f32,
                )
            })
            .collect();
        Row::of_some(count, &factors)
    }
}

/// Of a polygon as if it were a disc that the receiver faces: near it does not run away.
fn form_factor(receiver: &Receiver, middle: DVec3, area_vector: DVec3) -> f64 {
    let to = middle - receiver.position;
    let squared = to.length_squared();
    let (there, here) = (-area_vector.dot(to), receiver.normal.dot(to));
    if there <= 0.0 || here <= 0.0 {
        return 0.0;
    }
    here * there / (squared * (PI * squared + area_vector.length()))
}

fn middle(polygon: &ConvexPolygon) -> DVec3 {
    polygon.corners.iter().sum::<DVec3>() / polygon.corners.len() as f64
}

impl RowService for RoomsOnly<'_> {
    fn publish(&mut self, replica: EncodedReplica) {
        if replica.kind != ReplicaKind::Receivers {
            return;
        }
        let receivers =
            decode_receivers(&replica.bytes).expect("what was just encoded can be decoded").receivers;
        let mut by_room = vec![vec![]; self.building.rooms()];
        for (index, receiver) in receivers.iter().enumerate() {
            by_room[self.room_at(receiver.position)].push((index, *receiver));
        }
        self.sets.insert(replica.digest, by_room);
    }

    fn release(&mut self, digest: Digest) {
        self.sets.remove(&digest);
    }

    fn submit(&mut self, requests: Vec<(JobId, RowRequest)>) {
        self.jobs.extend(requests);
    }

    fn withdraw(&mut self) {
        self.jobs.clear();
    }

    fn next(&mut self, _: Duration) -> Result<Option<FinishedJob>, BakeError> {
        let (job, request) = self.jobs.pop_front().expect("nobody waits for more rows than were asked for");
        let row = |shooter| self.row(&request, shooter);
        let rows: Vec<Row> = request.shooters.iter().map(row).collect();
        let statistics = rows
            .iter()
            .map(|row| RowStatistics {
                pairs: row.receivers() as u64,
                factors: row.count() as u64,
                ..RowStatistics::default()
            })
            .collect();
        self.bytes += rows.iter().map(|row| encode_row(row).len() as u64).sum::<u64>();
        Ok(Some(FinishedJob { job, rows, statistics }))
    }
}
