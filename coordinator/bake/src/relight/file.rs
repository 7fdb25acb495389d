//! Kept light as a file: two lines that say what it is, a BLAKE3 digest, and a protobuf message that the digest is of.

use glam::{DVec3, Vec3};
use kernel::replica::Digest;
use prost::Message;

use super::RelightError;
use super::kept::{KeptLight, KeptPart, MeshSettings};
use crate::error_budget::ErrorBudget;
use crate::mesh::PatchId;
use crate::refinement::SamplePoints;
use kernel::row::release;

/// What every file begins with.
pub(super) const MAGIC: &[u8] = b"halflight light\n";

/// A mesh of finer shooters has more patches than any machine could hold.
const LEAST_EDGE: f64 = 1e-5;

/// The message.
#[derive(Clone, PartialEq, Message)]
pub(super) struct Body {
    #[prost(bytes = "vec", tag = "1")]
    pub(super) scene: Vec<u8>,
    #[prost(double, repeated, tag = "2")]
    pub(super) sky: Vec<f64>,
    #[prost(double, tag = "3")]
    pub(super) edge: f64,
    #[prost(uint32, tag = "4")]
    pub(super) max_level: u32,
    #[prost(uint64, tag = "5")]
    pub(super) max_vertices: u64,
    #[prost(double, tag = "6")]
    pub(super) line_error: f64,
    #[prost(bool, tag = "7")]
    pub(super) is_gathered: bool,
    #[prost(uint32, repeated, tag = "8")]
    pub(super) divided: Vec<u32>,
    #[prost(uint32, tag = "9")]
    pub(super) vertices: u32,
    #[prost(message, repeated, tag = "10")]
    pub(super) parts: Vec<Part>,
    /// Of each validation sample.
    #[prost(uint32, repeated, tag = "11")]
    pub(super) patches: Vec<u32>,
    /// Of each validation sample 7 numbers.
    #[prost(double, repeated, tag = "12")]
    pub(super) points: Vec<f64>,
    #[prost(double, tag = "13")]
    pub(super) reflectance: f64,
    /// In the order of the fields of [`ErrorBudget`], without sums.
    #[prost(double, repeated, tag = "14")]
    pub(super) error: Vec<f64>,
    #[prost(bool, tag = "15")]
    pub(super) simplify: bool,
}

/// The light of a part.
#[derive(Clone, PartialEq, Message)]
pub(super) struct Part {
    #[prost(string, repeated, tag = "1")]
    pub(super) names: Vec<String>,
    #[prost(bool, tag = "2")]
    pub(super) is_sky: bool,
    #[prost(double, repeated, tag = "3")]
    pub(super) as_baked: Vec<f64>,
    #[prost(float, repeated, tag = "4")]
    pub(super) direct: Vec<f32>,
    #[prost(float, repeated, tag = "5")]
    pub(super) irradiance: Vec<f32>,
    #[prost(double, repeated, tag = "6")]
    pub(super) gathered: Vec<f64>,
    #[prost(double, tag = "7")]
    pub(super) noise: f64,
    #[prost(double, tag = "8")]
    pub(super) residual: f64,
}

impl KeptLight {
    /// Encodes it as the bytes of a file.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        sealed(&self.body().encode_to_vec())
    }

    /// Decodes the bytes of a file.
    ///
    /// # Errors
    /// When they are something else, damaged, or of another release.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, RelightError> {
        let damaged = |what: &str| RelightError::Damaged(what.into());
        let rest = bytes.strip_prefix(MAGIC).ok_or_else(|| damaged("it is no file of kept light"))?;
        let end = rest.iter().position(|byte| *byte == b'\n').ok_or_else(|| damaged("it is cut off"))?;
        let theirs = String::from_utf8_lossy(&rest[..end]).into_owned();
        if theirs != release() {
            return Err(RelightError::Version { theirs, ours: release() });
        }
        let (digest, body) =
            rest[end + 1..].split_first_chunk::<32>().ok_or_else(|| damaged("it is cut off"))?;
        if blake3::hash(body).as_bytes() != digest {
            return Err(damaged("its bytes are not those that were written"));
        }
        let body = Body::decode(body).map_err(|error| RelightError::Damaged(error.to_string()))?;
        Self::from_body(body).ok_or_else(|| damaged("its figures do not fit each other"))
    }

    pub(super) fn body(&self) -> Body {
        let (patches, points) = self.validation.to_numbers();
        let MeshSettings { edge, max_level, max_vertices, line_error, is_gathered } = self.shooting;
        let ErrorBudget { unshot, visibility, form_factors, receivers, shooters, .. } = self.error;
        Body {
            scene: self.scene.0.to_vec(),
            sky: self.sky.to_array().to_vec(),
            edge,
            max_level,
            max_vertices: max_vertices as u64,
            line_error,
            is_gathered,
            divided: self.divided.iter().map(|patch| patch.0).collect(),
            vertices: self.vertices as u32,
            parts: self.parts.iter().map(Part::from).collect(),
            patches,
            points,
            reflectance: self.reflectance,
            error: vec![unshot, visibility, form_factors, receivers, shooters],
            simplify: self.simplify,
        }
    }

    /// `None` where something cannot be.
    fn from_body(body: Body) -> Option<Self> {
        let vertices = body.vertices as usize;
        let validation = SamplePoints::from_numbers(&body.patches, &body.points)?;
        let parts = body.parts.into_iter().map(|part| part.into_kept(vertices, validation.count()));
        let [unshot, visibility, form_factors, receivers, shooters] =
            <[f64; 5]>::try_from(body.error.as_slice()).ok()?;
        let all =
            [body.edge, body.reflectance, body.line_error].into_iter().chain(body.error.iter().copied());
        let can_be =
            (LEAST_EDGE..=1.0).contains(&body.edge) && body.max_level <= 30 && body.reflectance < 1.0;
        Some(Self {
            scene: Digest::try_from(body.scene.as_slice()).ok()?,
            sky: one(&body.sky)?,
            shooting: MeshSettings {
                edge: body.edge,
                max_level: body.max_level,
                max_vertices: usize::try_from(body.max_vertices).ok()?,
                line_error: body.line_error,
                is_gathered: body.is_gathered,
            },
            divided: body.divided.into_iter().map(PatchId).collect(),
            vertices,
            parts: parts.collect::<Option<_>>()?,
            validation,
            reflectance: body.reflectance,
            error: ErrorBudget::new(unshot, visibility, form_factors, receivers, shooters),
            simplify: body.simplify,
        })
        .filter(|_| can_be && all.into_iter().all(|number| number.is_finite() && number >= 0.0))
    }
}

impl From<&KeptPart> for Part {
    fn from(part: &KeptPart) -> Self {
        let single = |values: &[Vec3]| values.iter().flat_map(Vec3::to_array).collect();
        Self {
            names: part.names.clone(),
            is_sky: part.is_sky,
            as_baked: part.as_baked.to_array().to_vec(),
            direct: single(&part.direct),
            irradiance: single(&part.irradiance),
            gathered: part.gathered.iter().flat_map(DVec3::to_array).collect(),
            noise: part.noise,
            residual: part.residual,
        }
    }
}

impl Part {
    /// `None` where its lengths do not fit, or its figures cannot be.
    fn into_kept(self, vertices: usize, samples: usize) -> Option<KeptPart> {
        let single = |values: &[f32]| -> Option<Vec<Vec3>> {
            let values: Vec<Vec3> = triples(values)?.into_iter().map(Vec3::from_array).collect();
            Some(values).filter(|all| all.len() == vertices && all.iter().all(|value| value.is_finite()))
        };
        let gathered: Vec<DVec3> = triples(&self.gathered)?.into_iter().map(DVec3::from_array).collect();
        let as_baked = one(&self.as_baked)?;
        let can_be = gathered.len() == samples
            && gathered.iter().all(|light| light.is_finite())
            && [self.noise, self.residual].iter().all(|number| number.is_finite() && *number >= 0.0);
        Some(KeptPart {
            direct: single(&self.direct)?,
            irradiance: single(&self.irradiance)?,
            names: self.names,
            is_sky: self.is_sky,
            as_baked,
            gathered,
            noise: self.noise,
            residual: self.residual,
        })
        .filter(|_| can_be)
    }
}

/// A body with what stands before it.
pub(super) fn sealed(body: &[u8]) -> Vec<u8> {
    [MAGIC, release().as_bytes(), b"\n", blake3::hash(body).as_bytes(), body].concat()
}

/// One colour, if it can be one.
fn one(numbers: &[f64]) -> Option<DVec3> {
    let colour = DVec3::from_array(numbers.try_into().ok()?);
    (colour.is_finite() && colour.min_element() >= 0.0).then_some(colour)
}

/// Numbers by three.
fn triples<T: Copy>(numbers: &[T]) -> Option<Vec<[T; 3]>> {
    let (triples, rest) = numbers.as_chunks::<3>();
    rest.is_empty().then(|| triples.to_vec())
}
