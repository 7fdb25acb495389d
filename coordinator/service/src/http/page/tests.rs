use axum::body::Body;
use axum::http::header::{CONTENT_SECURITY_POLICY, X_CONTENT_TYPE_OPTIONS};
use axum::http::{Method, Request};
use tower::ServiceExt;

use super::*;

async fn ask(path: &str, headers: &[(&str, &str)]) -> Response {
    let request = headers
        .iter()
        .fold(Request::builder().uri(path), |request, (name, value)| request.header(*name, *value));
    super::super::routes().oneshot(request.body(Body::empty()).unwrap()).await.unwrap()
}

async fn text(response: Response) -> String {
    let bytes = axum::body::to_bytes(response.into_body(), usize::MAX).await.unwrap();
    String::from_utf8(bytes.to_vec()).unwrap()
}

/// Everything that the page refers to, by `src` and `href`.
fn references(page: &str) -> Vec<&str> {
    let after = [" src=\"", " href=\""].into_iter().flat_map(|attribute| page.split(attribute).skip(1));
    after.filter_map(|rest| rest.split('"').next()).collect()
}

#[tokio::test]
async fn whatever_is_asked_for_the_answer_is_under_the_policy() {
    for path in ["/", "/options.json", "/nothing", "/assets/nothing.js", "/../Cargo.toml"] {
        let response = ask(path, &[]).await;
        let policy = response.headers()[CONTENT_SECURITY_POLICY].to_str().unwrap();
        assert!(policy.starts_with("default-src 'none'; script-src 'self';"), "{path}: {policy}");
        assert!(!policy.contains("unsafe"), "{path}: {policy}");
        assert_eq!(response.headers()[X_CONTENT_TYPE_OPTIONS], "nosniff", "{path}");
    }
    assert_eq!(ask("/nothing", &[]).await.status(), StatusCode::NOT_FOUND);
    assert_eq!(ask("/index.html.gz", &[]).await.status(), StatusCode::NOT_FOUND);
}

#[tokio::test]
async fn the_form_of_the_page_has_its_options() {
    let options = ask("/options.json", &[]).await;
    assert_eq!(options.headers()[CONTENT_TYPE], "application/json");
    let options: serde_json::Value = serde_json::from_str(&text(options).await).unwrap();
    assert_eq!(options[0]["path"], "bake.quality");
    assert_eq!((&options[1]["path"], &options[1]["range"][1]), (&"bake.error".into(), &0.5.into()));
}

#[tokio::test]
async fn the_page_has_nothing_inline_and_all_that_it_refers_to() {
    let response = ask("/", &[]).await;
    assert_eq!(response.headers()[CONTENT_TYPE], "text/html; charset=utf-8");
    let page = text(response).await;
    assert!(page.contains("<title>Halflight</title>"), "{page}");
    for (inline, script) in [("<style", false), (" style=", false), ("<script", true), (" onload=", false)] {
        for rest in page.split(inline).skip(1) {
            assert!(script && rest.split('>').next().unwrap().contains(" src="), "inline {inline}{rest}");
        }
    }
    for reference in references(&page) {
        let path = reference.strip_prefix('.').unwrap_or(reference);
        assert_eq!(ask(path, &[]).await.status(), StatusCode::OK, "{reference}");
    }
}

#[tokio::test]
async fn what_a_browser_has_is_not_sent_again() {
    let first = ask("/", &[]).await;
    let tag = first.headers()[ETAG].to_str().unwrap().to_owned();
    let weak = format!("\"other\", W/{tag}");
    for known in [&tag, &weak] {
        let again = ask("/", &[("if-none-match", known)]).await;
        assert_eq!(again.status(), StatusCode::NOT_MODIFIED);
        assert_eq!(text(again).await, "");
    }
    assert_eq!(ask("/", &[("if-none-match", "\"other\"")]).await.status(), StatusCode::OK);
}

#[tokio::test]
async fn files_are_compressed_for_those_who_take_it() {
    for file in files(&FOLDER).iter().filter(|file| file.compressed.is_some()) {
        let path = file.path();
        let whole = ask(&path, &[]).await;
        assert!(!whole.headers().contains_key(CONTENT_ENCODING));
        assert!(
            !ask(&path, &[("accept-encoding", "gzip;q=0, br")])
                .await
                .headers()
                .contains_key(CONTENT_ENCODING)
        );
        let short = ask(&path, &[("accept-encoding", "br, gzip")]).await;
        assert_eq!(short.headers()[CONTENT_ENCODING], "gzip");
        assert_eq!(short.headers()[CONTENT_TYPE], whole.headers()[CONTENT_TYPE]);
        assert_ne!(short.headers()[ETAG], whole.headers()[ETAG]);
    }
}

#[tokio::test]
async fn who_posts_to_the_page_is_refused() {
    let request = Request::builder().method(Method::POST).uri("/").body(Body::empty()).unwrap();
    let response = super::super::routes().oneshot(request).await.unwrap();
    assert_eq!(response.status(), StatusCode::METHOD_NOT_ALLOWED);
    assert!(response.headers().contains_key(CONTENT_SECURITY_POLICY));
}
