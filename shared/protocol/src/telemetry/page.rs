use std::convert::Infallible;
use std::io;
use std::net::{AddrParseError, SocketAddr};
use std::str::FromStr;
use std::sync::Arc;
use std::thread;
use std::time::Duration;

use bytes::Bytes;
use http_body_util::Full;
use hyper::body::Incoming;
use hyper::header::{CONTENT_TYPE, HeaderValue};
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper::{Method, Request, Response, StatusCode};
use hyper_util::rt::{TokioIo, TokioTimer};
use prometheus_client::encoding::text::encode;
use prometheus_client::registry::Registry;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{Semaphore, oneshot};
use tokio::time::{sleep, timeout};

/// Most connections at the same time: a scraper has one.
const MOST_CONNECTIONS: usize = 16;

/// Time limit of a connection for its one request and the answer.
const PATIENCE: Duration = Duration::from_secs(10);

/// Largest request in bytes.
const QUESTION_BYTES: usize = 16 << 10;

/// Pause after the system refuses a connection.
const PAUSE: Duration = Duration::from_millis(100);

const OPEN_METRICS: HeaderValue =
    HeaderValue::from_static("application/openmetrics-text; version=1.0.0; charset=utf-8");
const TEXT: HeaderValue = HeaderValue::from_static("text/plain; charset=utf-8");

/// Value of the option `--metrics`: an address, or none if a variable of a compose file is empty.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MetricsAddress(pub Option<SocketAddr>);

impl FromStr for MetricsAddress {
    type Err = AddrParseError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        if text.is_empty() { Ok(Self(None)) } else { text.parse().map(|address| Self(Some(address))) }
    }
}

/// A port that serves a registry at `/metrics` and a health check at `/healthz`, until it is dropped. It has a thread of its own, so
/// that it answers whatever the process does.
pub struct MetricsPage {
    address: SocketAddr,
    _leaving: oneshot::Sender<Infallible>,
}

impl MetricsPage {
    /// Opens the port; port 0 takes a free one.
    ///
    /// # Errors
    /// When the address is taken or not of this machine, or a thread cannot be started.
    pub fn start(address: SocketAddr, registry: Registry) -> io::Result<Self> {
        let listener = std::net::TcpListener::bind(address)?;
        listener.set_nonblocking(true)?;
        let address = listener.local_addr()?;
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
        let (leaving, left) = oneshot::channel();
        let work = move || {
            runtime.block_on(async {
                tokio::select! {
                    outcome = serve(listener, registry) => {
                        if let Err(error) = outcome {
                            tracing::warn!(%error, "the page of metrics is gone");
                        }
                    }
                    _ = left => {}
                }
            });
        };
        thread::Builder::new().name("metrics".into()).spawn(work)?;
        tracing::info!(%address, "metrics");
        Ok(Self { address, _leaving: leaving })
    }

    /// Its address.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.address
    }
}

async fn serve(listener: std::net::TcpListener, registry: Registry) -> io::Result<()> {
    let listener = TcpListener::from_std(listener)?;
    let registry = Arc::new(registry);
    let places = Arc::new(Semaphore::new(MOST_CONNECTIONS));
    loop {
        let Ok((socket, _)) = listener.accept().await else {
            sleep(PAUSE).await;
            continue;
        };
        // Closing it tells the caller sooner than letting it wait.
        let Ok(place) = Arc::clone(&places).try_acquire_owned() else { continue };
        let registry = Arc::clone(&registry);
        tokio::spawn(async move {
            // Errors of a connection are the caller's.
            let _ = timeout(PATIENCE, converse(socket, &registry)).await;
            drop(place);
        });
    }
}

async fn converse(socket: TcpStream, registry: &Registry) -> hyper::Result<()> {
    let service = service_fn(|request: Request<Incoming>| {
        let response = answer(request.method(), request.uri().path(), registry);
        async { Ok::<_, Infallible>(response) }
    });
    http1::Builder::new()
        .keep_alive(false)
        .max_buf_size(QUESTION_BYTES)
        .timer(TokioTimer::new())
        .header_read_timeout(PATIENCE)
        .serve_connection(TokioIo::new(socket), service)
        .await
}

fn answer(method: &Method, path: &str, registry: &Registry) -> Response<Full<Bytes>> {
    let (status, kind, text) = match (method, path) {
        (&Method::GET | &Method::HEAD, "/metrics") => {
            let mut text = String::new();
            match encode(&mut text, registry) {
                Ok(()) => (StatusCode::OK, OPEN_METRICS, text),
                Err(error) => (StatusCode::INTERNAL_SERVER_ERROR, TEXT, error.to_string()),
            }
        }
        (&Method::GET | &Method::HEAD, "/healthz") => (StatusCode::OK, TEXT, "ok\n".into()),
        _ => (StatusCode::NOT_FOUND, TEXT, "only /metrics and /healthz are here\n".into()),
    };
    let mut response = Response::new(Full::from(text));
    *response.status_mut() = status;
    response.headers_mut().insert(CONTENT_TYPE, kind);
    response
}

#[cfg(test)]
mod tests {
    use std::io::{Read, Write};
    use std::net::TcpStream;

    use prometheus_client::metrics::counter::Counter;

    use super::*;

    fn ask(page: &MetricsPage, question: &str) -> String {
        let mut socket = TcpStream::connect(page.address()).unwrap();
        write!(socket, "{question}\r\nHost: test\r\n\r\n").unwrap();
        let mut answer = String::new();
        socket.read_to_string(&mut answer).unwrap();
        answer
    }

    #[test]
    fn metrics_are_shown() {
        let counter: Counter = Counter::default();
        let mut registry = Registry::with_prefix("test");
        registry.register("rows", "Rows", counter.clone());
        let page = MetricsPage::start("127.0.0.1:0".parse().unwrap(), registry).unwrap();
        counter.inc_by(7);
        let metrics = ask(&page, "GET /metrics HTTP/1.1");
        assert!(metrics.starts_with("HTTP/1.1 200"), "{metrics}");
        assert!(metrics.contains("application/openmetrics-text"), "{metrics}");
        assert!(metrics.contains("\ntest_rows_total 7\n") && metrics.ends_with("# EOF\n"), "{metrics}");
        assert!(ask(&page, "GET /healthz HTTP/1.1").ends_with("\r\n\r\nok\n"));
        assert!(ask(&page, "GET / HTTP/1.1").starts_with("HTTP/1.1 404"));
        assert!(ask(&page, "POST /metrics HTTP/1.1").starts_with("HTTP/1.1 404"));
        assert!(ask(&page, "\x16\x03\x01 garbage").starts_with("HTTP/1.1 400"));
    }
}
