//! What browsers may not be made to do: pages of other sites reach the service from the user's own machine.

use std::net::IpAddr;

use axum::extract::Request;
use axum::http::header::{HOST, ORIGIN};
use axum::http::{HeaderMap, StatusCode, Uri};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};

/// By which names a service may be called.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Names {
    /// By any: who calls has a token or a certificate, or the service is meant for a whole network.
    Any,
    /// By those of this machine: it is all that a caller needs to be on.
    ThisMachine,
}

/// Refuses what comes from a page of another site.
pub async fn only_own_pages(request: Request, next: Next) -> Response {
    if is_foreign(request.uri(), request.headers()) {
        return (StatusCode::FORBIDDEN, "a page of another site may not ask this service").into_response();
    }
    next.run(request).await
}

/// Refuses names that are not this machine's: a page of another site whose name leads here would count as the service's own.
/// For services on loopback that demand neither token nor certificate.
pub async fn only_this_machine(request: Request, next: Next) -> Response {
    let host = host(request.uri(), request.headers());
    if host.is_some_and(|host| !is_this_machine(host)) {
        let words = "without --clients this service is called localhost, or by its address";
        return (StatusCode::MISDIRECTED_REQUEST, words).into_response();
    }
    next.run(request).await
}

/// Host and port that are asked: in the URI with HTTP/2, in a header with HTTP/1.
fn host<'a>(uri: &'a Uri, headers: &'a HeaderMap) -> Option<&'a str> {
    let authority = uri.authority().map(|authority| authority.as_str());
    authority.or_else(|| headers.get(HOST).and_then(|host| host.to_str().ok()))
}

/// Whether a browser says that the request comes from a page of another site.
fn is_foreign(uri: &Uri, headers: &HeaderMap) -> bool {
    let Some(origin) = headers.get(ORIGIN) else { return false };
    let site = origin.to_str().ok().and_then(|origin| origin.split_once("://")).map(|(_, site)| site);
    site.is_none() || site != host(uri, headers)
}

fn is_this_machine(host: &str) -> bool {
    let name = host.rsplit_once(':').map_or(host, |(name, port)| {
        if port.bytes().all(|byte| byte.is_ascii_digit()) { name } else { host }
    });
    let name = name.trim_start_matches('[').trim_end_matches(']');
    name.eq_ignore_ascii_case("localhost") || name.parse::<IpAddr>().is_ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn foreign(uri: &str, headers: &[(&'static str, &str)]) -> bool {
        let headers = headers.iter().map(|(name, value)| (name.parse().unwrap(), value.parse().unwrap()));
        is_foreign(&uri.parse().unwrap(), &headers.collect())
    }

    #[test]
    fn pages_of_other_sites_are_told_by_their_origin() {
        assert!(!foreign("/", &[("host", "localhost:7000")]));
        assert!(!foreign("/", &[("host", "localhost:7000"), ("origin", "http://localhost:7000")]));
        assert!(!foreign("https://bake.example:7000/", &[("origin", "https://bake.example:7000")]));
        assert!(foreign("/", &[("host", "localhost:7000"), ("origin", "http://evil.example")]));
        assert!(foreign("/", &[("host", "localhost:7000"), ("origin", "http://localhost:8000")]));
        assert!(foreign("/", &[("host", "localhost:7000"), ("origin", "null")]));
    }

    #[test]
    fn addresses_and_localhost_are_this_machine() {
        for name in ["localhost", "LOCALHOST:7000", "127.0.0.1:7000", "[::1]:7000", "[::1]", "10.0.0.1"] {
            assert!(is_this_machine(name), "{name}");
        }
        for name in ["evil.example:7000", "localhost.evil.example", "1.2.3.4.evil.example", ""] {
            assert!(!is_this_machine(name), "{name}");
        }
    }
}
