//! The dashboard's files, embedded in the binary. Nothing is fetched from elsewhere.

use super::error::Problem;
use axum::http::header::HeaderName;
use axum::http::{HeaderValue, Method, Uri, header};
use axum::response::{IntoResponse, Response};
use rust_embed::RustEmbed;

/// What a page of ours may load and do: nothing from elsewhere, no script within it, and no other site may show
/// it in a frame. A second fence behind the notes' own, whose text comes from people.
const FENCE: [(HeaderName, HeaderValue); 3] = [
    (
        header::CONTENT_SECURITY_POLICY,
        HeaderValue::from_static(
            "default-src 'self'; img-src 'self' data: blob:; style-src 'self' 'unsafe-inline'; object-src 'none'; \
             base-uri 'none'; form-action 'self'; frame-ancestors 'none'",
        ),
    ),
    (header::X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff")),
    (header::REFERRER_POLICY, HeaderValue::from_static("no-referrer")),
];

/// Puts the fence around an answer.
pub async fn fence(mut response: Response) -> Response {
    response.headers_mut().extend(FENCE);
    response
}

#[derive(RustEmbed)]
#[folder = "$OUT_DIR/web"]
struct Assets;

/// A file of the dashboard; its page at `/`.
pub async fn file(method: Method, uri: Uri) -> Response {
    let path = uri.path().trim_start_matches('/');
    let path = if path.is_empty() { "index.html" } else { path };
    if method != Method::GET && method != Method::HEAD {
        return Problem::method_not_allowed().into_response();
    }
    match Assets::get(path) {
        Some(asset) => {
            // Vite puts a hash of the content into the names below assets/.
            let cache = if path.starts_with("assets/") {
                "public, max-age=31536000, immutable"
            } else {
                "no-cache"
            };
            let headers = [
                (header::CONTENT_TYPE, asset.metadata.mimetype().to_owned()),
                (header::CACHE_CONTROL, cache.to_owned()),
            ];
            (headers, asset.data.into_owned()).into_response()
        }
        None => Problem::not_found("resource", uri.path()).into_response(),
    }
}
