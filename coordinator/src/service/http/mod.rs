//! The service in a browser, on the port of the gRPC service: what is not a call of gRPC comes here.

use axum::Router;
use axum::http::StatusCode;

use super::Service;
use super::clients::Clients;

/// The routes of HTTP.
pub fn routes(_service: Service, _clients: Clients) -> Router {
    Router::new().fallback(async || StatusCode::NOT_FOUND)
}
