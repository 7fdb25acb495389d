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
use axum::http::header::CONTENT_TYPE;
use axum::middleware::map_response;
use axum::routing::get;
use pipeline::options::form;

/// The routes of HTTP: the page, and the options of its form.
pub fn routes() -> Router {
    let options = async || ([(CONTENT_TYPE, "application/json")], form().to_string());
    page::routes()
        .route("/options.json", get(options))
        .fallback(async || StatusCode::NOT_FOUND)
        .layer(map_response(policy::guard))
}
