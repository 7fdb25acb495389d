//! The files of the page, embedded in the program.

use std::sync::Arc;

use axum::Router;
use axum::http::header::{
    ACCEPT_ENCODING, CACHE_CONTROL, CONTENT_ENCODING, CONTENT_TYPE, ETAG, IF_NONE_MATCH, VARY,
};
use axum::http::{HeaderMap, HeaderValue, StatusCode};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use bytes::Bytes;
use include_dir::{Dir, include_dir};

/// The built page of `web/`, or the plain page (`build.rs`).
static FOLDER: Dir<'_> = include_dir!("$OUT_DIR/page");

/// The file served at `/`.
const INDEX: &str = "index.html";

/// Extension of the compressed copy that the build puts beside a file.
const COMPRESSED: &str = ".gz";

/// Folder of files whose names contain a digest, so that they never change.
const NEVER_CHANGING: &str = "assets/";

/// A file of the page.
struct File {
    /// Path within the page.
    name: &'static str,
    whole: Content,
    compressed: Option<Content>,
}

/// Bytes of a file and their entity tag.
struct Content {
    bytes: &'static [u8],
    /// Tags them by their digest.
    tag: HeaderValue,
}

/// Returns a route for each file.
pub(super) fn routes() -> Router {
    files(&FOLDER).into_iter().fold(Router::new(), |router, file| {
        let path = file.path();
        let file = Arc::new(file);
        router.route(&path, get(move |headers: HeaderMap| async move { file.answer(&headers) }))
    })
}

/// Lists the files under a folder, each with its compressed copy.
fn files(folder: &'static Dir<'static>) -> Vec<File> {
    let deeper = folder.dirs().flat_map(files);
    let here = folder.files().filter_map(|file| {
        let name = file.path().to_str().filter(|name| !name.ends_with(COMPRESSED))?;
        let compressed = FOLDER.get_file(format!("{name}{COMPRESSED}"));
        let compressed = compressed.map(|file| Content::new(file.contents()));
        Some(File { name, whole: Content::new(file.contents()), compressed })
    });
    here.chain(deeper).collect()
}

impl Content {
    fn new(bytes: &'static [u8]) -> Self {
        let tag = format!("\"{}\"", blake3::hash(bytes).to_hex());
        // Quoted digits are a valid header value.
        let tag = HeaderValue::from_str(&tag).unwrap_or(HeaderValue::from_static("\"\""));
        Self { bytes, tag }
    }
}

impl File {
    fn path(&self) -> String {
        if self.name == INDEX { "/".to_owned() } else { format!("/{}", self.name) }
    }

    /// Returns the response to a request with these headers.
    fn answer(&self, asked: &HeaderMap) -> Response {
        let compressed = self.compressed.as_ref().filter(|_| takes_gzip(asked));
        let content = compressed.unwrap_or(&self.whole);
        let is_known = asked.get_all(IF_NONE_MATCH).iter().any(|known| names(known, &content.tag));
        let mut response = if is_known {
            StatusCode::NOT_MODIFIED.into_response()
        } else {
            Bytes::from_static(content.bytes).into_response()
        };
        let headers = response.headers_mut();
        let kept =
            if self.name.starts_with(NEVER_CHANGING) { "max-age=31536000, immutable" } else { "no-cache" };
        headers.insert(CACHE_CONTROL, HeaderValue::from_static(kept));
        headers.insert(VARY, HeaderValue::from_static("accept-encoding"));
        headers.insert(ETAG, content.tag.clone());
        headers.insert(CONTENT_TYPE, media_type(self.name));
        if compressed.is_some() {
            headers.insert(CONTENT_ENCODING, HeaderValue::from_static("gzip"));
        }
        response
    }
}

fn takes_gzip(asked: &HeaderMap) -> bool {
    let accepted = asked.get_all(ACCEPT_ENCODING).iter().filter_map(|value| value.to_str().ok());
    accepted.flat_map(|value| value.split(',')).any(|coding| {
        let (name, parameters) = coding.split_once(';').unwrap_or((coding, ""));
        let quality = parameters.trim().strip_prefix("q=").map_or(Ok(1.0), str::parse::<f64>);
        matches!(name.trim(), "gzip" | "*") && quality.is_ok_and(|quality| quality > 0.0)
    })
}

/// Whether the browser's tags contain this one.
fn names(known: &HeaderValue, tag: &HeaderValue) -> bool {
    let Ok(known) = known.to_str() else { return false };
    known.split(',').any(|one| one.trim().trim_start_matches("W/") == tag)
}

/// Returns the media type for a file name.
fn media_type(name: &str) -> HeaderValue {
    HeaderValue::from_static(match name.rsplit('.').next() {
        Some("html") => "text/html; charset=utf-8",
        Some("js") => "text/javascript; charset=utf-8",
        Some("css") => "text/css; charset=utf-8",
        Some("svg") => "image/svg+xml",
        Some("txt") => "text/plain; charset=utf-8",
        _ => "application/octet-stream",
    })
}

#[cfg(test)]
mod tests;
