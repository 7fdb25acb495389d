//! What a running program shows of itself: the same for both programs.
//!
//! | module | what lives there |
//! |---|---|
//! | `held` | counts things for as long as they are held |
//! | `logging` | logs on standard error, as text or as JSON |
//! | `page` | the port of `--metrics`: figures for Prometheus, and a sign of life |
//! | `spans` | spans for an OpenTelemetry collector; only with the feature `otlp` |

mod held;
mod logging;
mod page;
#[cfg(feature = "otlp")]
mod spans;

pub use held::Held;
pub use logging::{LogFormat, Logging, LoggingError, LoggingSettings};
pub use page::{MetricsAddress, MetricsPage};
