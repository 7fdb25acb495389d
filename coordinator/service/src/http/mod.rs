//! The service in a browser: a page with the jobs and a viewer (`web/`), on the port of the gRPC service.
//!
//! | module | what lives there |
//! |---|---|
//! | `page` | the page's files, as they are in the program, and how they are answered |
//! | `policy` | what browsers may do with the page |
//!
//! The page speaks gRPC-web, so there is no second API for it: also an upload is a call of `SubmitScene`, all of whose messages are the
//! body of one request.

mod page;
mod policy;

use axum::Router;
use axum::http::StatusCode;
use axum::middleware::map_response;

/// The routes of HTTP: the page. What is none of its files is not found.
pub fn routes() -> Router {
    page::routes().fallback(async || StatusCode::NOT_FOUND).layer(map_response(policy::guard))
}
