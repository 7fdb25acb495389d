use bytes::Bytes;
use kernel::messages;
use kernel::picture::FinishedTile;
use kernel::picture::{TileError, TileRequest, decode_pixels};
use kernel::replica::Digest;
use kernel::row::FinishedJob;
use kernel::row::{Row, RowDecodeError, RowRequest, decode_row};
use protocol::worker::{Finished, RowStatistics, digest_of_rows};

use super::summary::FinishedWork;
use crate::scheduler::JobId;

/// Largest plausible cost of a row, small enough to be summed over a bake: 13 days in nanoseconds, or as many rays.
const LARGEST_FIGURE: u64 = 1 << 50;

/// The answer to a job, decoded and checked.
#[derive(Debug, Clone, PartialEq)]
pub struct Answer {
    /// The job.
    pub job: JobId,
    /// One row for each shooter of the request.
    pub rows: Vec<Row>,
    /// Cost of each row.
    pub statistics: Vec<RowStatistics>,
    /// Digest of the encoded rows.
    pub digest: Digest,
    /// Length of the encoded rows in bytes.
    pub bytes: u64,
}

/// An answer of either kind, decoded and checked.
pub(super) struct Checked {
    /// The rows or the tile.
    pub(super) work: FinishedWork,
    /// Digest of its encoding.
    pub(super) digest: Digest,
    /// Length of its encoding in bytes.
    pub(super) bytes: u64,
}

impl From<Answer> for Checked {
    fn from(Answer { job, rows, statistics, digest, bytes }: Answer) -> Self {
        Self { work: FinishedWork::Rows(FinishedJob { job, rows, statistics }), digest, bytes }
    }
}

/// Decodes a tile and checks that it answers this request.
///
/// # Errors
/// When it does not fit the request, or is impossible.
pub(super) fn check_tile(
    request: &TileRequest,
    finished: &messages::FinishedTile,
) -> Result<Checked, AnswerError> {
    let job = JobId(finished.job_id);
    let (rays, busy_nanoseconds) = (finished.rays, finished.busy_nanoseconds);
    if rays.max(busy_nanoseconds) > LARGEST_FIGURE {
        return Err(AnswerError::Cost(job));
    }
    let (pixels, digest) = decode_pixels(request, finished).map_err(|error| AnswerError::Tile(job, error))?;
    let work = FinishedWork::Tile(FinishedTile { job, pixels, rays, busy_nanoseconds });
    Ok(Checked { work, digest, bytes: finished.pixels.len() as u64 })
}

/// Why an answer does not fit its request.
#[derive(Debug, thiserror::Error)]
pub enum AnswerError {
    /// Wrong number of rows.
    #[error("{found} rows for job {job}, which asks for {expected}")]
    Rows {
        /// The job.
        job: JobId,
        /// Rows asked for.
        expected: usize,
        /// Rows that came.
        found: usize,
    },
    /// Wrong number of statistics.
    #[error("statistics of {found} rows for job {job}, which asks for {expected}")]
    Statistics {
        /// The job.
        job: JobId,
        /// Rows asked for.
        expected: usize,
        /// Statistics that came.
        found: usize,
    },
    /// An impossible cost.
    #[error("impossible statistics of job {0}")]
    Cost(JobId),
    /// The rows changed on the way.
    #[error("rows of job {0} do not match their digest")]
    Digest(JobId),
    /// Pixels that do not fit the tile.
    #[error("job {0}: {1}")]
    Tile(JobId, TileError),
    /// Bytes that are not a row.
    #[error("job {0}: {1}")]
    Row(JobId, RowDecodeError),
}

impl Answer {
    /// Decodes an answer and checks that it is one to this request.
    ///
    /// # Errors
    /// When it does not fit the request, or is impossible.
    pub fn check(request: &RowRequest, finished: &Finished) -> Result<Self, AnswerError> {
        let job = JobId(finished.job_id);
        let expected = request.shooters.len();
        let found = finished.rows.len();
        if found != expected {
            return Err(AnswerError::Rows { job, expected, found });
        }
        let found = finished.statistics.len();
        if found != expected {
            return Err(AnswerError::Statistics { job, expected, found });
        }
        if !finished.statistics.iter().all(can_be) {
            return Err(AnswerError::Cost(job));
        }
        let digest = digest_of_rows(&finished.rows);
        if finished.digest != digest.0.as_slice() {
            return Err(AnswerError::Digest(job));
        }
        let decode = |bytes: &Bytes| decode_row(bytes, request.receiver_count as usize);
        let rows: Result<_, _> = finished.rows.iter().map(decode).collect();
        Ok(Self {
            job,
            rows: rows.map_err(|error| AnswerError::Row(job, error))?,
            statistics: finished.statistics.clone(),
            digest,
            bytes: finished.rows.iter().map(|row| row.len() as u64).sum(),
        })
    }
}

/// Whether a cost is possible, and can be summed over a bake.
fn can_be(cost: &RowStatistics) -> bool {
    let RowStatistics { rays, factors, sampled_pairs, busy_nanoseconds, pairs, occluded_pairs, .. } = *cost;
    let counts = [rays, factors, sampled_pairs, busy_nanoseconds, pairs, occluded_pairs];
    let sums = [cost.sampling_variance, cost.factor_sum, cost.factor_error_sum];
    counts.iter().all(|count| *count <= LARGEST_FIGURE)
        && sums.iter().all(|sum| (0.0..=LARGEST_FIGURE as f64).contains(sum))
}

#[cfg(test)]
mod tests {
    use kernel::row::{Precision, Shape, Shooter, encode_row};

    use super::*;

    fn request() -> RowRequest {
        RowRequest {
            scene: Digest::of(b"scene"),
            receivers: Digest::of(b"receivers"),
            first_receiver: 0,
            receiver_count: 3,
            shooters: vec![Shooter { key: 1, shape: Shape::Point(glam::DVec3::ZERO) }],
            precision: Precision::DEFAULT,
        }
    }

    fn answer(cost: RowStatistics) -> Finished {
        let rows = vec![encode_row(&Row::new(&[0.0, 0.5, 0.25]))];
        let digest = digest_of_rows(&rows).to_bytes();
        Finished { job_id: 7, rows, statistics: vec![cost], digest }
    }

    #[test]
    fn an_answer_is_what_was_asked_for() {
        let cost = RowStatistics { rays: 9, factor_sum: 0.75, ..RowStatistics::default() };
        let checked = Answer::check(&request(), &answer(cost)).unwrap();
        assert_eq!((checked.job, checked.rows[0].to_dense()), (JobId(7), vec![0.0, 0.5, 0.25]));
        let longer = RowRequest { receiver_count: 1, ..request() };
        assert!(matches!(Answer::check(&longer, &answer(cost)), Err(AnswerError::Row(..))));
        let more = Finished { rows: vec![], ..answer(cost) };
        assert!(matches!(Answer::check(&request(), &more), Err(AnswerError::Rows { .. })));
        let fewer = Finished { statistics: vec![], ..answer(cost) };
        assert!(matches!(Answer::check(&request(), &fewer), Err(AnswerError::Statistics { .. })));
        let changed = Finished { digest: Bytes::new(), ..answer(cost) };
        assert!(matches!(Answer::check(&request(), &changed), Err(AnswerError::Digest(_))));
    }

    #[test]
    fn figures_that_cannot_be_summed_are_refused() {
        let none = RowStatistics::default();
        for cost in [
            RowStatistics { rays: u64::MAX, ..none },
            RowStatistics { busy_nanoseconds: 1 << 60, ..none },
            RowStatistics { factor_sum: f64::NAN, ..none },
            RowStatistics { sampling_variance: f64::INFINITY, ..none },
            RowStatistics { factor_error_sum: -1.0, ..none },
        ] {
            let refused = Answer::check(&request(), &answer(cost));
            assert!(matches!(refused, Err(AnswerError::Cost(JobId(7)))), "{cost:?}");
        }
    }
}
