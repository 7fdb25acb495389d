use super::error::RequestError;
use super::shooter::Shooter;
use crate::messages;
use crate::replica::Digest;

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
    /// Accuracy of the rows.
    pub precision: Precision,
}

/// Accuracy of rows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Precision {
    /// Rays spent on a whole hemisphere; a pair gets its form factor's part.
    pub rays_per_hemisphere: u32,
    /// Least number of rays for a pair that could be blocked; a power of two.
    pub minimum_rays: u32,
    /// Largest number of rays for a pair; a power of two.
    pub maximum_rays: u32,
    /// Another seed is another, independent draw of all rays.
    pub seed: u64,
    /// Largest number of occluders of a pair whose visibility is computed; with more it is sampled with rays.
    pub exact_occluders: u32,
    /// Relative error that a form factor may have before occlusion: distant polygons may be treated as points.
    pub form_factor_error: f64,
    /// Relative error to which each factor of a row may be rounded, up or down at random, to save bytes; at 0 factors have all
    /// digits of f32.
    pub factor_rounding: f64,
}

impl Precision {
    /// The default of a bake.
    pub const DEFAULT: Self = Self {
        rays_per_hemisphere: 1024,
        minimum_rays: 4,
        maximum_rays: 256,
        seed: 0,
        exact_occluders: 40,
        form_factor_error: 1e-5,
        factor_rounding: 1e-4,
    };

    fn to_message(self) -> messages::Precision {
        messages::Precision {
            rays_per_hemisphere: self.rays_per_hemisphere,
            minimum_rays: self.minimum_rays,
            maximum_rays: self.maximum_rays,
            seed: self.seed,
            exact_occluders: self.exact_occluders,
            form_factor_error: self.form_factor_error,
            factor_rounding: self.factor_rounding,
        }
    }

    fn from_message(message: &messages::Precision) -> Result<Self, RequestError> {
        let powers = message.minimum_rays.is_power_of_two() && message.maximum_rays.is_power_of_two();
        // The sequence of sample points ends at 2^16.
        if !powers || message.maximum_rays > 1 << 16 || message.minimum_rays > message.maximum_rays {
            return Err(RequestError::Invalid(
                "numbers of rays are powers of two up to 65536, least before largest",
            ));
        }
        if !(0.0..1.0).contains(&message.form_factor_error) {
            return Err(RequestError::Invalid("the error of form factors is a part of them, from 0 to 1"));
        }
        if !(0.0..1.0).contains(&message.factor_rounding) {
            return Err(RequestError::Invalid("factors are rounded by a part of them, from 0 to 1"));
        }
        Ok(Self {
            rays_per_hemisphere: message.rays_per_hemisphere,
            minimum_rays: message.minimum_rays,
            maximum_rays: message.maximum_rays,
            seed: message.seed,
            exact_occluders: message.exact_occluders,
            form_factor_error: message.form_factor_error,
            factor_rounding: message.factor_rounding,
        })
    }
}

impl RowRequest {
    /// The request as it travels.
    #[must_use]
    pub fn to_job(&self, job_id: u64) -> messages::RowJob {
        let before = std::iter::once(None).chain(self.shooters.iter().map(Some));
        messages::RowJob {
            job_id,
            scene_digest: self.scene.to_bytes(),
            receivers_digest: self.receivers.to_bytes(),
            first_receiver: self.first_receiver,
            receiver_count: self.receiver_count,
            shooters: self
                .shooters
                .iter()
                .zip(before)
                .map(|(own, before)| own.to_message_after(before))
                .collect(),
            precision: Some(self.precision.to_message()),
        }
    }

    /// Reads a request that came over the network.
    ///
    /// # Errors
    /// When a part is missing, a coordinate is not finite or the precision is out of range.
    pub fn from_job(job: &messages::RowJob) -> Result<Self, RequestError> {
        let precision = job.precision.as_ref().ok_or(RequestError::Invalid("precision is missing"))?;
        let mut shooters: Vec<Shooter> = vec![];
        for message in &job.shooters {
            shooters.push(Shooter::from_message(message, shooters.last())?);
        }
        Ok(Self {
            scene: Digest::try_from(job.scene_digest.as_ref())?,
            receivers: Digest::try_from(job.receivers_digest.as_ref())?,
            first_receiver: job.first_receiver,
            receiver_count: job.receiver_count,
            shooters,
            precision: Precision::from_message(precision)?,
        })
    }
}
