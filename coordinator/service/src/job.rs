//! Identifiers and the record of a job.

use std::fmt;
use std::str::FromStr;
use std::time::SystemTime;

use prost_types::Timestamp;
use protocol::api::{Job, Outcome, SceneOptions, State, SubmitSceneHeader};

/// Identifier of a job: 128 random bits, printed as 32 hexadecimal digits, so that it cannot be guessed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct JobId(pub u128);

impl JobId {
    /// Draws a new identifier.
    ///
    /// # Errors
    /// When the system has no random bits.
    pub fn random() -> Result<Self, getrandom::Error> {
        let mut bytes = [0; 16];
        getrandom::fill(&mut bytes)?;
        Ok(Self(u128::from_be_bytes(bytes)))
    }
}

impl fmt::Display for JobId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:032x}", self.0)
    }
}

/// A text is not a job identifier.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("a job is called by 32 hexadecimal digits")]
pub struct NotAJobId;

impl FromStr for JobId {
    type Err = NotAJobId;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        // `from_str_radix` alone would accept a sign and upper case.
        let is_digit = |byte: u8| matches!(byte, b'0'..=b'9' | b'a'..=b'f');
        if text.len() != 32 || !text.bytes().all(is_digit) {
            return Err(NotAJobId);
        }
        u128::from_str_radix(text, 16).map(Self).map_err(|_| NotAJobId)
    }
}

/// SHA-256 of a scene's file.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct SceneDigest(pub [u8; 32]);

impl fmt::Display for SceneDigest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

impl fmt::Debug for SceneDigest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

/// Name of a client; clients see only their own jobs.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ClientName(pub String);

impl ClientName {
    /// The only client of a service without tokens.
    #[must_use]
    pub fn everybody() -> Self {
        Self("everybody".into())
    }
}

impl fmt::Display for ClientName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

/// Position of a job in the order of submission, from 1.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Sequence(pub u64);

/// What is stored of a job, beside its files.
///
/// The request is stored as the client sent it: the API's compatibility rules keep its meaning across upgrades.
#[derive(Debug, Clone, PartialEq)]
pub struct Record {
    /// Its identifier.
    pub id: JobId,
    /// Its client.
    pub client: ClientName,
    /// Its position among all jobs of the service.
    pub sequence: Sequence,
    /// The request.
    pub header: SubmitSceneHeader,
    /// The scene; for a relight, that of the baked job.
    pub scene: SceneDigest,
    /// For a relight, what it needs of the baked job.
    pub relit: Option<Relit>,
    /// Its state.
    pub state: State,
    /// Why it failed.
    pub failure: String,
    /// When it was submitted.
    pub submitted: SystemTime,
    /// When it began to run.
    pub started: Option<SystemTime>,
    /// When it ended.
    pub ended: Option<SystemTime>,
    /// The result of a finished job.
    pub outcome: Option<Outcome>,
    /// Grows with every change.
    pub revision: u64,
    /// How often its process was killed or fell.
    pub crashes: u32,
}

/// What a relight needs of a baked job, which may be deleted meanwhile.
#[derive(Debug, Clone, PartialEq)]
pub struct Relit {
    /// The baked job.
    pub baked: JobId,
    /// Scene options of the baked job.
    pub options: SceneOptions,
}

impl Record {
    /// Returns the job under whose identifier its kept light is stored.
    #[must_use]
    pub fn light(&self) -> JobId {
        self.relit.as_ref().map_or(self.id, |relit| relit.baked)
    }

    /// Whether it is done, failed or cancelled.
    #[must_use]
    pub fn has_ended(&self) -> bool {
        matches!(self.state, State::Done | State::Failed | State::Cancelled)
    }

    /// Returns the record ended now in `state`.
    #[must_use]
    pub fn ended(&self, state: State, failure: String, outcome: Option<Outcome>) -> Self {
        Self { state, failure, outcome, ended: Some(SystemTime::now()), ..self.clone() }
    }

    /// Returns the client's view of it, without progress.
    #[must_use]
    pub fn view(&self) -> Job {
        let relight_of = match &self.header.source {
            Some(protocol::api::submit_scene_header::Source::Relight(relight)) => relight.job_id.clone(),
            _ => String::new(),
        };
        Job {
            id: self.id.to_string(),
            name: self.header.name.clone(),
            state: self.state.into(),
            failure: self.failure.clone(),
            submitted: Some(Timestamp::from(self.submitted)),
            started: self.started.map(Timestamp::from),
            ended: self.ended.map(Timestamp::from),
            priority: self.header.priority,
            ahead: 0,
            progress: None,
            outcome: self.outcome.clone(),
            scene_sha256: self.scene.0.to_vec().into(),
            relight_of,
            revision: self.revision,
        }
    }
}

/// Returns a revision greater than `last`, and than any before a restart unless the clock went back.
#[must_use]
pub fn next_revision(last: u64) -> u64 {
    let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
    (since.as_micros() as u64).max(last + 1)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn names_of_jobs_are_read_as_they_are_written_and_no_other_way() {
        let id = JobId::random().unwrap();
        assert_eq!(id.to_string().parse(), Ok(id));
        let small = JobId(0xab).to_string();
        assert_eq!(small.len(), 32);
        for wrong in ["", "ab", "../../etc/passwd", &small.to_uppercase(), &format!("+{}", &small[1..])] {
            assert_eq!(wrong.parse::<JobId>(), Err(NotAJobId), "{wrong}");
        }
    }

    proptest! {
        #[test]
        fn no_job_has_two_names(text in "[0-9a-fA-F+ -]{31,33}|[0-9a-f]{32}") {
            if let Ok(job) = text.parse::<JobId>() {
                prop_assert_eq!(job.to_string(), text);
            }
        }
    }

    #[test]
    fn revisions_grow() {
        let first = next_revision(0);
        assert!(next_revision(first) > first);
        assert_eq!(next_revision(u64::MAX / 2), u64::MAX / 2 + 1);
    }
}
