//! The service in a browser: a page with the jobs and a viewer (`web/`), on the port of the gRPC service.
//!
//! | module | what lives there |
//! |---|---|
//! | `page` | the page's files, embedded in the program |
//! | `policy` | what browsers may do with the page |
//!
//! The page uses gRPC-web, so there is no second API; an upload is a call of `SubmitScene` with all messages in one request body.

mod page;
mod policy;

use axum::Router;
use axum::http::StatusCode;
use axum::http::header::CONTENT_TYPE;
use axum::middleware::map_response;
use axum::routing::get;
use pipeline::options::form;

/// Returns the HTTP routes: the files of the page, the options of its form, and 404 for all others.
pub fn routes() -> Router {
    let options = async || ([(CONTENT_TYPE, "application/json")], form().to_string());
    page::routes()
        .route("/options.json", get(options))
        .fallback(async || StatusCode::NOT_FOUND)
        .layer(map_response(policy::guard))
}
