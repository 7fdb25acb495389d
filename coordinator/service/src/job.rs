//! A job as the service knows it.

use std::fmt;
use std::str::FromStr;
use std::time::SystemTime;

use prost_types::Timestamp;
use protocol::api::{Job, Outcome, SceneOptions, State, SubmitSceneHeader};

/// Names a job: 128 random bits, 32 hexadecimal digits. Nobody can guess another's.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct JobId(pub u128);

impl JobId {
    /// Another one with each call.
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

/// What is not the name of a job.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("a job is called by 32 hexadecimal digits")]
pub struct NotAJobId;

impl FromStr for JobId {
    type Err = NotAJobId;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        // The integer's own reading would take a sign, and upper case for the same job.
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

/// Who submits jobs, and sees those of nobody else.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ClientName(pub String);

impl ClientName {
    /// Everybody, where the service knows no clients.
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

/// Jobs in the order in which they were submitted: 1, 2, ...
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Sequence(pub u64);

/// All that is kept of a job beside its files.
///
/// What was asked for is kept in the client's own words: they mean the same after an upgrade, by the rules that the API has.
#[derive(Debug, Clone, PartialEq)]
pub struct Record {
    /// Its name.
    pub id: JobId,
    /// Whose it is.
    pub client: ClientName,
    /// Its place among all jobs of the service.
    pub sequence: Sequence,
    /// What was asked for.
    pub header: SubmitSceneHeader,
    /// The scene: of a relight, that of the job that it relights.
    pub scene: SceneDigest,
    /// What a relight has of the job whose light it changes.
    pub relit: Option<Relit>,
    /// Where it stands.
    pub state: State,
    /// Why it failed.
    pub failure: String,
    /// When it was submitted.
    pub submitted: SystemTime,
    /// When it began to run, if it did.
    pub started: Option<SystemTime>,
    /// When it ended, if it did.
    pub ended: Option<SystemTime>,
    /// What came out.
    pub outcome: Option<Outcome>,
    /// Grows with every change.
    pub revision: u64,
}

/// What a relight has of a job that was baked, so that it needs no more of it: that one may be deleted meanwhile.
#[derive(Debug, Clone, PartialEq)]
pub struct Relit {
    /// The job, which was baked itself.
    pub baked: JobId,
    /// How its scene was read.
    pub options: SceneOptions,
}

impl Record {
    /// The job whose kept light this one needs or has made.
    #[must_use]
    pub fn light(&self) -> JobId {
        self.relit.as_ref().map_or(self.id, |relit| relit.baked)
    }

    /// Whether nothing more will happen to it.
    #[must_use]
    pub fn has_ended(&self) -> bool {
        matches!(self.state, State::Done | State::Failed | State::Cancelled)
    }

    /// The same with this state, now.
    #[must_use]
    pub fn ended(&self, state: State, failure: String, outcome: Option<Outcome>) -> Self {
        Self { state, failure, outcome, ended: Some(SystemTime::now()), ..self.clone() }
    }

    /// What a client sees of it, while it does not run.
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

/// The next number of a revision: greater than the last one, and than any before a restart, as long as the clock goes on.
#[must_use]
pub fn next_revision(last: u64) -> u64 {
    let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
    (since.as_micros() as u64).max(last + 1)
}

#[cfg(test)]
mod tests {
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

    #[test]
    fn revisions_grow() {
        let first = next_revision(0);
        assert!(next_revision(first) > first);
        assert_eq!(next_revision(u64::MAX / 2), u64::MAX / 2 + 1);
    }
}
