use std::io::IsTerminal;
use std::str::FromStr;

use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::util::{SubscriberInitExt, TryInitError};
use tracing_subscriber::{EnvFilter, Layer, Registry, fmt};

/// How logs are written.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum LogFormat {
    /// Text lines.
    #[default]
    Text,
    /// One JSON object per line, with a field for each value.
    Json,
}

impl FromStr for LogFormat {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        match text {
            // An empty variable, as compose files have it, is one that is not given.
            "text" | "" => Ok(Self::Text),
            "json" => Ok(Self::Json),
            _ => Err("write text or json"),
        }
    }
}

impl std::fmt::Display for LogFormat {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Text => "text",
            Self::Json => "json",
        })
    }
}

/// Defaults of a program's logs.
#[derive(Debug, Clone, Copy)]
pub struct LoggingSettings {
    /// The program, for a collector of spans.
    pub program: &'static str,
    /// The format.
    pub format: LogFormat,
    /// Filter without `RUST_LOG`, in its syntax.
    pub default_filter: &'static str,
    /// Whether text lines have the time. JSON always has it.
    pub times: bool,
}

/// Why a program cannot log.
#[derive(Debug, thiserror::Error)]
pub enum LoggingError {
    /// A logger is installed already.
    #[error("cannot log: {0}")]
    Taken(#[from] TryInitError),
    /// Spans cannot be sent.
    #[cfg(feature = "otlp")]
    #[error("cannot send spans to OTEL_EXPORTER_OTLP_ENDPOINT: {0}")]
    Spans(String),
}

/// Whether lines are coloured: only a terminal shows colours, and <https://no-color.org> turns them off.
fn wants_colours() -> bool {
    std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty())
}

/// Logs and spans of this program. Hold it until the end: dropping it sends the remaining spans to the collector.
pub struct Logging {
    #[cfg(feature = "otlp")]
    _spans: Option<super::spans::Exporter>,
}

impl Logging {
    /// Starts logging to standard error, for the whole process.
    ///
    /// # Errors
    /// When it was started before, or spans are configured and cannot be sent.
    pub fn start(settings: &LoggingSettings) -> Result<Self, LoggingError> {
        let filter =
            EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new(settings.default_filter));
        let lines = fmt::layer::<Registry>().with_writer(std::io::stderr).with_ansi(wants_colours());
        let lines = match (settings.format, settings.times) {
            (LogFormat::Text, true) => lines.boxed(),
            (LogFormat::Text, false) => lines.without_time().boxed(),
            (LogFormat::Json, _) => lines.json().flatten_event(true).with_span_list(false).boxed(),
        };
        let lines = lines.with_filter(filter).boxed();

        #[cfg(feature = "otlp")]
        let (layers, spans) = match super::spans::exporter(settings.program).map_err(LoggingError::Spans)? {
            Some((layer, exporter)) => (vec![lines, layer], Some(exporter)),
            None => (vec![lines], None),
        };
        #[cfg(not(feature = "otlp"))]
        let layers = vec![lines];
        tracing_subscriber::registry().with(layers).try_init()?;
        Ok(Self {
            #[cfg(feature = "otlp")]
            _spans: spans,
        })
    }
}
