//! The read-only data that a worker holds: the occluders of a scene and sets of receivers.
//!
//! A replica travels as an encoded protobuf message and is named by the BLAKE3 digest of these bytes, so that neither side
//! can mistake one scene for another, and a worker that holds a replica need not be sent it again.

use std::fmt;

use bytes::Bytes;
use glam::DVec3;
use prost::Message;

use crate::geometry::{ConvexPolygon, PlaneId};
use crate::messages::{ReceiverReplica, ReplicaKind, SceneReplica};

/// BLAKE3 digest of an encoded replica: its name.
#[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Digest(pub [u8; 32]);

impl Digest {
    /// Digest of these bytes.
    #[must_use]
    pub fn of(bytes: &[u8]) -> Self {
        Self(*blake3::hash(bytes).as_bytes())
    }

    /// The digest as it travels.
    #[must_use]
    pub fn to_bytes(self) -> Bytes {
        Bytes::copy_from_slice(&self.0)
    }
}

impl TryFrom<&[u8]> for Digest {
    type Error = ReplicaError;

    fn try_from(bytes: &[u8]) -> Result<Self, ReplicaError> {
        bytes.try_into().map(Self).map_err(|_| ReplicaError::DigestLength(bytes.len()))
    }
}

impl fmt::Debug for Digest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

impl fmt::Display for Digest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0[..6].iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

/// A replica ready to travel.
#[derive(Debug, Clone)]
pub struct EncodedReplica {
    /// Name of the replica.
    pub digest: Digest,
    /// Which message the bytes hold.
    pub kind: ReplicaKind,
    /// The encoded message.
    pub bytes: Bytes,
}

impl EncodedReplica {
    pub(crate) fn new(kind: ReplicaKind, message: &impl Message) -> Self {
        let bytes = Bytes::from(message.encode_to_vec());
        Self { digest: Digest::of(&bytes), kind, bytes }
    }
}

/// A point at which irradiance is wanted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Receiver {
    /// Position, a little inside the receiver's own surface where the vertex itself lies on other planes too.
    pub position: DVec3,
    /// Unit normal.
    pub normal: DVec3,
    /// Plane that the receiver lies in.
    pub plane: PlaneId,
}

/// A set of receivers with consecutive keys.
#[derive(Debug, Clone, PartialEq)]
pub struct Receivers {
    /// Number of the first receiver in its scene: with the shooter's, the seed of a pair's rays.
    pub first_key: u64,
    /// The receivers.
    pub receivers: Vec<Receiver>,
}

/// Why bytes are not a replica.
#[derive(Debug, thiserror::Error)]
pub enum ReplicaError {
    /// A digest of another length.
    #[error("a digest has 32 bytes, not {0}")]
    DigestLength(usize),
    /// The bytes are not the protobuf message that they should be.
    #[error("replica cannot be decoded: {0}")]
    Decode(#[from] prost::DecodeError),
    /// The message's lists do not fit each other.
    #[error("replica is inconsistent: {0}")]
    Inconsistent(&'static str),
    /// A coordinate is NaN or infinite.
    #[error("replica has a coordinate that is not finite")]
    NotFinite,
    /// A coordinate is far outside the frame.
    #[error("replica has the coordinate {0:e}, far outside the frame that scenes are scaled to")]
    Outside(f64),
}

/// The polygons of a scene: those that block light, or all that can be seen.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ScenePolygons {
    /// The polygons.
    pub polygons: Vec<ConvexPolygon>,
    /// Part of the light that each stops, from 0 to 1; empty where all stop all.
    pub opacities: Vec<f32>,
}

/// Encodes polygons that stop all light.
#[must_use]
pub fn encode_scene(polygons: &[ConvexPolygon]) -> EncodedReplica {
    encode_translucent_scene(polygons, &[])
}

/// Encodes the polygons of a scene, of which each stops a part of the light: all of it where `opacities` is empty.
#[must_use]
pub fn encode_translucent_scene(polygons: &[ConvexPolygon], opacities: &[f32]) -> EncodedReplica {
    let message = SceneReplica {
        opacities: opacities.to_vec(),
        corner_counts: polygons.iter().map(|polygon| polygon.corners.len() as u32).collect(),
        planes: polygons.iter().map(|polygon| polygon.plane.0).collect(),
        coordinates: polygons
            .iter()
            .flat_map(|polygon| &polygon.corners)
            .flat_map(|p| p.to_array())
            .collect(),
    };
    EncodedReplica::new(ReplicaKind::Scene, &message)
}

/// Decodes the polygons of a scene.
///
/// # Errors
/// When the bytes are not a scene replica, its lists do not fit each other, or a number is out of range.
pub fn decode_scene(bytes: &[u8]) -> Result<ScenePolygons, ReplicaError> {
    let message = SceneReplica::decode(bytes)?;
    let opacities = message.opacities;
    if !opacities.is_empty() && opacities.len() != message.planes.len() {
        return Err(ReplicaError::Inconsistent("every polygon needs an opacity, or none has one"));
    }
    if !opacities.iter().all(|opacity| (0.0..=1.0).contains(opacity)) {
        return Err(ReplicaError::Inconsistent("opacities lie between 0 and 1"));
    }
    if message.planes.len() != message.corner_counts.len() {
        return Err(ReplicaError::Inconsistent("every polygon needs a plane"));
    }
    let corners = points_inside(&message.coordinates)?;
    let mut rest = corners.as_slice();
    let mut polygons = Vec::with_capacity(message.planes.len());
    for (&count, &plane) in message.corner_counts.iter().zip(&message.planes) {
        if count < 3 {
            return Err(ReplicaError::Inconsistent("a polygon needs three corners or more"));
        }
        let (polygon, remaining) = rest
            .split_at_checked(count as usize)
            .ok_or(ReplicaError::Inconsistent("fewer corners than the polygons need"))?;
        polygons.push(ConvexPolygon { plane: PlaneId(plane), corners: polygon.to_vec() });
        rest = remaining;
    }
    if !rest.is_empty() {
        return Err(ReplicaError::Inconsistent("more corners than the polygons need"));
    }
    Ok(ScenePolygons { polygons, opacities })
}

/// Encodes a set of receivers.
#[must_use]
pub fn encode_receivers(set: &Receivers) -> EncodedReplica {
    let coordinates =
        |pick: fn(&Receiver) -> DVec3| set.receivers.iter().flat_map(|r| pick(r).to_array()).collect();
    let message = ReceiverReplica {
        first_key: set.first_key,
        planes: set.receivers.iter().map(|receiver| receiver.plane.0).collect(),
        positions: coordinates(|receiver| receiver.position),
        normals: coordinates(|receiver| receiver.normal),
    };
    EncodedReplica::new(ReplicaKind::Receivers, &message)
}

/// Decodes a set of receivers.
///
/// # Errors
/// When the bytes are not a receiver replica, its lists do not fit each other, or a coordinate is not finite.
pub fn decode_receivers(bytes: &[u8]) -> Result<Receivers, ReplicaError> {
    let message = ReceiverReplica::decode(bytes)?;
    let positions = points_inside(&message.positions)?;
    let normals = points(&message.normals)?;
    if positions.len() != message.planes.len() || normals.len() != message.planes.len() {
        return Err(ReplicaError::Inconsistent("every receiver needs a plane, a position and a normal"));
    }
    let receivers = message
        .planes
        .iter()
        .zip(positions)
        .zip(normals)
        .map(|((&plane, position), normal)| Receiver { position, normal, plane: PlaneId(plane) })
        .collect();
    Ok(Receivers { first_key: message.first_key, receivers })
}

/// The frame is 2048 long; this far outside, boxes of single precision have finite surfaces still.
const OUTSIDE: f64 = (1_u64 << 40) as f64;

/// Reads x, y, z triples of a scene.
pub(crate) fn points_inside(coordinates: &[f64]) -> Result<Vec<DVec3>, ReplicaError> {
    let points = points(coordinates)?;
    match coordinates.iter().find(|value| value.abs() > OUTSIDE) {
        Some(value) => Err(ReplicaError::Outside(*value)),
        None => Ok(points),
    }
}

/// Reads x, y, z triples.
pub(crate) fn points(coordinates: &[f64]) -> Result<Vec<DVec3>, ReplicaError> {
    let (triples, rest) = coordinates.as_chunks::<3>();
    if !rest.is_empty() {
        return Err(ReplicaError::Inconsistent("coordinates come in threes"));
    }
    if !coordinates.iter().all(|value| value.is_finite()) {
        return Err(ReplicaError::NotFinite);
    }
    Ok(triples.iter().copied().map(DVec3::from_array).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coordinates_far_outside_the_frame_are_refused() {
        let triangle =
            |x: f64| ConvexPolygon { plane: PlaneId(0), corners: vec![DVec3::ZERO, DVec3::X * x, DVec3::Y] };
        let scene = |x| decode_scene(&encode_scene(&[triangle(x)]).bytes);
        assert_eq!(scene(2048.0).unwrap().polygons, [triangle(2048.0)]);
        assert!(matches!(scene(-1e300), Err(ReplicaError::Outside(x)) if x == -1e300));
        assert!(matches!(scene(f64::NAN), Err(ReplicaError::NotFinite)));
        let receiver = Receiver { position: DVec3::Z * 1e13, normal: DVec3::Y, plane: PlaneId(0) };
        let set = Receivers { first_key: 0, receivers: vec![receiver] };
        assert!(matches!(decode_receivers(&encode_receivers(&set).bytes), Err(ReplicaError::Outside(_))));
    }
}
