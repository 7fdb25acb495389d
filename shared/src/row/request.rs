use glam::DVec3;

use crate::geometry::{ConvexPolygon, PlaneId};
use crate::protocol::{self, shooter};
use crate::replica::{Digest, ReplicaError, points};

/// Rows of some shooters over a range of one set of receivers.
#[derive(Debug, Clone, PartialEq)]
pub struct RowRequest {
    /// The occluders.
    pub scene: Digest,
    /// The receivers.
    pub receivers: Digest,
    /// First receiver of the range.
    pub first_receiver: u32,
    /// Number of receivers in the range.
    pub receiver_count: u32,
    /// One row each.
    pub shooters: Vec<Shooter>,
    /// What visibility may cost.
    pub sampling: Sampling,
}

/// What light leaves from.
#[derive(Debug, Clone, PartialEq)]
pub struct Shooter {
    /// Stable number of the shooter in its scene: part of the seed of its rays.
    pub key: u64,
    /// Where the light leaves.
    pub shape: Shape,
}

/// The shape of a shooter.
#[derive(Debug, Clone, PartialEq)]
pub enum Shape {
    /// Convex polygons that do not overlap; rows hold visible form factors.
    Polygons(Vec<ConvexPolygon>),
    /// An isotropic point light; rows hold V cos / r^2.
    Point(DVec3),
    /// A point light weighted by the cosine of a horizontal plane through it; rows hold 2 V |cos(plane)| cos / r^2.
    PlanarPoint(DVec3),
}

/// How visibility is sampled.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sampling {
    /// Rays spent on a whole hemisphere; a pair gets its form factor's part.
    pub rays_per_hemisphere: u32,
    /// Least number of rays for a pair that could be blocked; a power of two.
    pub minimum_rays: u32,
    /// Largest number of rays for a pair; a power of two.
    pub maximum_rays: u32,
    /// Another seed is another, independent draw of all rays.
    pub seed: u64,
}

/// Why a job is not a request for rows.
#[derive(Debug, thiserror::Error)]
pub enum RequestError {
    /// A digest or a coordinate is wrong.
    #[error(transparent)]
    Replica(#[from] ReplicaError),
    /// A part of the message is missing or out of range.
    #[error("job makes no sense: {0}")]
    Invalid(&'static str),
}

impl RowRequest {
    /// The request as it travels.
    #[must_use]
    pub fn to_job(&self, job_id: u64) -> protocol::RowJob {
        protocol::RowJob {
            job_id,
            scene_digest: self.scene.to_bytes(),
            receivers_digest: self.receivers.to_bytes(),
            first_receiver: self.first_receiver,
            receiver_count: self.receiver_count,
            shooters: self.shooters.iter().map(Shooter::to_message).collect(),
            sampling: Some(protocol::Sampling {
                rays_per_hemisphere: self.sampling.rays_per_hemisphere,
                minimum_rays: self.sampling.minimum_rays,
                maximum_rays: self.sampling.maximum_rays,
                seed: self.sampling.seed,
            }),
        }
    }

    /// Reads a request that came over the network.
    ///
    /// # Errors
    /// When a part is missing, a coordinate is not finite or the sampling is out of range.
    pub fn from_job(job: &protocol::RowJob) -> Result<Self, RequestError> {
        let sampling = job.sampling.ok_or(RequestError::Invalid("sampling is missing"))?;
        let powers = sampling.minimum_rays.is_power_of_two() && sampling.maximum_rays.is_power_of_two();
        // The sequence of sample points ends at 2^16.
        if !powers || sampling.maximum_rays > 1 << 16 || sampling.minimum_rays > sampling.maximum_rays {
            return Err(RequestError::Invalid(
                "numbers of rays are powers of two up to 65536, least before largest",
            ));
        }
        Ok(Self {
            scene: Digest::try_from(job.scene_digest.as_ref())?,
            receivers: Digest::try_from(job.receivers_digest.as_ref())?,
            first_receiver: job.first_receiver,
            receiver_count: job.receiver_count,
            shooters: job.shooters.iter().map(Shooter::from_message).collect::<Result<_, _>>()?,
            sampling: Sampling {
                rays_per_hemisphere: sampling.rays_per_hemisphere,
                minimum_rays: sampling.minimum_rays,
                maximum_rays: sampling.maximum_rays,
                seed: sampling.seed,
            },
        })
    }
}

impl Shooter {
    fn to_message(&self) -> protocol::Shooter {
        let point = |p: &DVec3| protocol::Point { coordinates: p.to_array().to_vec() };
        let shape = match &self.shape {
            Shape::Polygons(polygons) => shooter::Shape::Polygons(protocol::Polygons {
                polygons: polygons
                    .iter()
                    .map(|polygon| protocol::ConvexPolygon {
                        plane: polygon.plane.0,
                        coordinates: polygon.corners.iter().flat_map(|p| p.to_array()).collect(),
                    })
                    .collect(),
            }),
            Shape::Point(position) => shooter::Shape::Point(point(position)),
            Shape::PlanarPoint(position) => shooter::Shape::PlanarPoint(point(position)),
        };
        protocol::Shooter { key: self.key, shape: Some(shape) }
    }

    fn from_message(message: &protocol::Shooter) -> Result<Self, RequestError> {
        let one = |point: &protocol::Point| match points(&point.coordinates)?.as_slice() {
            [position] => Ok(*position),
            _ => Err(RequestError::Invalid("a point light has one position")),
        };
        let shape = match message.shape.as_ref().ok_or(RequestError::Invalid("shooter without a shape"))? {
            shooter::Shape::Polygons(set) => Shape::Polygons(
                set.polygons
                    .iter()
                    .map(|polygon| {
                        let corners = points(&polygon.coordinates)?;
                        if corners.len() < 3 {
                            return Err(RequestError::Invalid("a polygon needs three corners or more"));
                        }
                        Ok(ConvexPolygon { plane: PlaneId(polygon.plane), corners })
                    })
                    .collect::<Result<_, _>>()?,
            ),
            shooter::Shape::Point(position) => Shape::Point(one(position)?),
            shooter::Shape::PlanarPoint(position) => Shape::PlanarPoint(one(position)?),
        };
        Ok(Self { key: message.key, shape })
    }
}
