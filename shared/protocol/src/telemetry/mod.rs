//! Logs, metrics and spans of a running program.
//!
//! | module | contents |
//! |---|---|
//! | `held` | counts things for as long as they are held |
//! | `logging` | logs on standard error, as text or as JSON |
//! | `page` | the port of `--metrics`: metrics for Prometheus, and a health check |
//! | `spans` | spans for an OpenTelemetry collector; only with the feature `otlp` |

mod held;
mod logging;
mod page;
#[cfg(feature = "otlp")]
mod spans;

pub use held::Held;
pub use logging::{LogFormat, Logging, LoggingError, LoggingSettings};
pub use page::{MetricsAddress, MetricsPage};
