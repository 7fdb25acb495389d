//! Protection against pages of other sites, which reach the service from a user's browser.

use std::net::IpAddr;
use std::sync::Arc;

use axum::extract::{Request, State};
use axum::http::header::{HOST, ORIGIN};
use axum::http::{HeaderMap, StatusCode, Uri};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};

/// Host names that a service answers to.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Names {
    /// Any: callers have a token or a certificate, or the service is open to its network.
    Any,
    /// `localhost`, addresses, and these: for services that need neither token nor certificate.
    These(Vec<String>),
}

/// Refuses requests from a page of another site.
pub async fn only_own_pages(request: Request, next: Next) -> Response {
    if is_foreign(request.uri(), request.headers()) {
        return (StatusCode::FORBIDDEN, "a page of another site may not ask this service").into_response();
    }
    next.run(request).await
}

/// Refuses other host names, so that DNS rebinding does not turn another site's page into an own one.
pub async fn only_by_name(State(names): State<Arc<[String]>>, request: Request, next: Next) -> Response {
    let host = host(request.uri(), request.headers());
    if host.is_some_and(|host| !is_own(host, &names)) {
        let words = "this service is called localhost, or by its address; --listen-names gives it others";
        return (StatusCode::MISDIRECTED_REQUEST, words).into_response();
    }
    next.run(request).await
}

/// Returns the requested host and port: from the URI in HTTP/2, from a header in HTTP/1.
fn host<'a>(uri: &'a Uri, headers: &'a HeaderMap) -> Option<&'a str> {
    let authority = uri.authority().map(|authority| authority.as_str());
    authority.or_else(|| headers.get(HOST).and_then(|host| host.to_str().ok()))
}

/// Whether the browser marks the request as sent by a page of another site.
fn is_foreign(uri: &Uri, headers: &HeaderMap) -> bool {
    let Some(origin) = headers.get(ORIGIN) else { return false };
    let site = origin.to_str().ok().and_then(|origin| origin.split_once("://")).map(|(_, site)| site);
    site.is_none() || site != host(uri, headers)
}

fn is_own(host: &str, names: &[String]) -> bool {
    let name = host.rsplit_once(':').map_or(host, |(name, port)| {
        if port.bytes().all(|byte| byte.is_ascii_digit()) { name } else { host }
    });
    let name = name.trim_start_matches('[').trim_end_matches(']');
    let is_called = |own: &str| name.eq_ignore_ascii_case(own);
    is_called("localhost") || name.parse::<IpAddr>().is_ok() || names.iter().any(|own| is_called(own))
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
    fn addresses_localhost_and_its_names_are_the_services_own() {
        for name in ["localhost", "LOCALHOST:7000", "127.0.0.1:7000", "[::1]:7000", "[::1]", "10.0.0.1"] {
            assert!(is_own(name, &[]), "{name}");
        }
        for name in ["evil.example:7000", "localhost.evil.example", "1.2.3.4.evil.example", "bake", ""] {
            assert!(!is_own(name, &[]), "{name}");
        }
        let names = ["bake".to_owned()];
        assert!(is_own("Bake:7000", &names) && is_own("localhost", &names) && !is_own("bake.evil", &names));
    }
}
