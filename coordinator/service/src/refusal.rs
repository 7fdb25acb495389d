//! Errors for clients.

use std::io;

use pipeline::options::{InvalidOptions, Violation};

use crate::job::{JobId, SceneDigest};

/// Why a request is refused. Each variant has its own status code and details, see `api::errors`.
#[derive(Debug, thiserror::Error)]
pub enum Refusal {
    /// Invalid fields.
    #[error(transparent)]
    Invalid(#[from] InvalidOptions),
    /// The scene must be uploaded.
    #[error("the service does not have scene {0} of this client: send its bytes")]
    SceneMissing(SceneDigest),
    /// The job is not done.
    #[error("job {0} is not done: watch it, or fetch a preview")]
    NotDone(JobId),
    /// The light of the job was not kept.
    #[error("the light of job {0} was not kept: submit its scene with the new lights")]
    NoLight(JobId),
    /// The job has no preview.
    #[error("job {0} has no preview: it does not run, or has not begun to shoot")]
    NotRunning(JobId),
    /// The job does not exist, or is another client's.
    #[error("there is no job {0}: `coordinator jobs` lists those there are")]
    UnknownJob(String),
    /// Another submission had this idempotency key.
    #[error(
        "job {0} was submitted with the same idempotency key and asks for something else: choose another key"
    )]
    KeyTaken(JobId),
    /// A limit is reached.
    #[error("{description}")]
    Exhausted {
        /// What is limited, as `client:NAME` or `disk`.
        subject: String,
        /// The limit and what can be done.
        description: String,
    },
    /// The caller has no valid token.
    #[error("{0}")]
    Unauthenticated(&'static str),
    /// The upload was interrupted, or took too long.
    #[error("the upload was aborted: {0}")]
    Broken(String),
    /// The service is ending.
    #[error("the service is ending: try again")]
    Ending,
    /// The service failed.
    #[error("the service failed: {0}")]
    Failed(String),
}

impl Refusal {
    /// Refuses one invalid field.
    pub fn invalid(field: impl Into<String>, should: impl Into<String>) -> Self {
        Self::Invalid(InvalidOptions(vec![Violation::new(field, should)]))
    }

    /// Refuses because a limit is reached.
    pub fn exhausted(subject: impl Into<String>, description: impl Into<String>) -> Self {
        Self::Exhausted { subject: subject.into(), description: description.into() }
    }
}

/// Whether the error means that the disk is full.
#[must_use]
pub fn is_full(error: &io::Error) -> bool {
    matches!(
        error.kind(),
        io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded | io::ErrorKind::FileTooLarge
    )
}

impl From<io::Error> for Refusal {
    fn from(error: io::Error) -> Self {
        if is_full(&error) {
            return Self::exhausted(
                "disk",
                "there is no room on the service's disk: delete jobs, or ask its operator",
            );
        }
        // Its text may contain paths of the service.
        tracing::error!(%error, "the disk fails");
        Self::Failed("its disk cannot be used; its log says more".into())
    }
}
