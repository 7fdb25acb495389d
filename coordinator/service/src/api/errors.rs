//! Refusals as gRPC statuses, with the codes and `google.rpc` details that `proto/radiosity/v1` documents.

use std::collections::HashMap;
use std::time::Duration;

use tonic::{Code, Status};
use tonic_types::{ErrorDetails, FieldViolation, StatusExt};

use crate::refusal::Refusal;

/// Domain of the reasons in `ErrorInfo`.
pub const DOMAIN: &str = "radiosity.v1";

/// Delay before a client may retry.
const AGAIN: Duration = Duration::from_secs(5);

/// Resource type in `ResourceInfo`.
const JOB: &str = "radiosity.v1.Job";

/// Returns the status code of a refusal.
#[must_use]
pub fn code(refusal: &Refusal) -> Code {
    match refusal {
        Refusal::Invalid(_) => Code::InvalidArgument,
        Refusal::SceneMissing(_) | Refusal::NotDone(_) | Refusal::NotRunning(_) | Refusal::NoLight(_) => {
            Code::FailedPrecondition
        }
        Refusal::UnknownJob(_) => Code::NotFound,
        Refusal::KeyTaken(_) => Code::AlreadyExists,
        Refusal::Exhausted { .. } => Code::ResourceExhausted,
        Refusal::Unauthenticated(_) => Code::Unauthenticated,
        Refusal::Broken(_) => Code::Aborted,
        Refusal::Ending => Code::Unavailable,
        Refusal::Failed(_) => Code::Internal,
    }
}

fn details(refusal: &Refusal, words: &str) -> ErrorDetails {
    let missing =
        |kind: &str, subject: String| ErrorDetails::with_precondition_failure_violation(kind, subject, words);
    match refusal {
        Refusal::Invalid(violations) => {
            let field = |violation: &pipeline::options::Violation| {
                FieldViolation::new(violation.field.clone(), violation.should.clone())
            };
            ErrorDetails::with_bad_request(violations.0.iter().map(field).collect::<Vec<_>>())
        }
        Refusal::SceneMissing(scene) => missing("SCENE", scene.to_string()),
        Refusal::NotDone(job) => missing("FINISHED", job.to_string()),
        Refusal::NotRunning(job) => missing("RUNNING", job.to_string()),
        Refusal::NoLight(job) => missing("LIGHT", job.to_string()),
        Refusal::UnknownJob(job) => ErrorDetails::with_resource_info(JOB, job, "", words),
        Refusal::KeyTaken(job) => ErrorDetails::with_resource_info(JOB, job.to_string(), "", words),
        Refusal::Exhausted { subject, description } => {
            ErrorDetails::with_quota_failure_violation(subject, description)
        }
        Refusal::Unauthenticated(_) => ErrorDetails::with_error_info("TOKEN", DOMAIN, HashMap::new()),
        Refusal::Broken(_) => ErrorDetails::with_error_info("UPLOAD", DOMAIN, HashMap::new()),
        Refusal::Ending => ErrorDetails::with_retry_info(Some(AGAIN)),
        Refusal::Failed(_) => ErrorDetails::with_error_info("SERVICE", DOMAIN, HashMap::new()),
    }
}

impl From<Refusal> for Status {
    fn from(refusal: Refusal) -> Self {
        let words = refusal.to_string();
        Self::with_error_details(code(&refusal), &words, details(&refusal, &words))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::job::{JobId, SceneDigest};

    #[test]
    fn each_refusal_has_its_code_and_its_details() {
        let details = |refusal: Refusal| {
            let status = Status::from(refusal);
            (status.code(), status.get_error_details())
        };
        let (code, found) = details(Refusal::invalid("bake.error", "must be less"));
        assert_eq!(code, Code::InvalidArgument);
        assert_eq!(found.bad_request().unwrap().field_violations[0].field, "bake.error");
        for (refusal, kind) in [
            (Refusal::SceneMissing(SceneDigest([1; 32])), "SCENE"),
            (Refusal::NotDone(JobId(1)), "FINISHED"),
            (Refusal::NotRunning(JobId(1)), "RUNNING"),
            (Refusal::NoLight(JobId(1)), "LIGHT"),
        ] {
            let (code, found) = details(refusal);
            assert_eq!(code, Code::FailedPrecondition);
            assert_eq!(found.precondition_failure().unwrap().violations[0].r#type, kind);
        }
        let (code, found) = details(Refusal::KeyTaken(JobId(7)));
        assert_eq!(code, Code::AlreadyExists);
        assert_eq!(found.resource_info().unwrap().resource_name, JobId(7).to_string());
        let (code, found) = details(Refusal::exhausted("disk", "full"));
        assert_eq!(code, Code::ResourceExhausted);
        assert_eq!(found.quota_failure().unwrap().violations[0].subject, "disk");
        let (code, found) = details(Refusal::Ending);
        assert_eq!(code, Code::Unavailable);
        assert!(found.retry_info().is_some());
    }
}
