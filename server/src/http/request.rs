//! Around every request: its id, its line in the log, its place in the metrics. Neither log nor metrics hold a
//! query, a header or a body: what is secret stands there.

use crate::telemetry::TELEMETRY;
use axum::extract::{MatchedPath, Request};
use axum::http::{HeaderName, HeaderValue, Method, StatusCode};
use axum::middleware::Next;
use axum::response::Response;
use std::time::Instant;
use tracing::Instrument;
use uuid::Uuid;

tokio::task_local! {
    /// Id of the request that the task answers.
    static ID: String;
}

/// Header of a request's id, in both directions.
const HEADER: HeaderName = HeaderName::from_static("x-request-id");
/// Longest id that is taken over from a request.
const LONGEST_ID: usize = 64;
/// Route of what no handler of the interface answers: the dashboard's files, and what is not there.
const ELSEWHERE: &str = "other";
/// Routes that are asked again and again by machines, of which the log tells in detail only.
const QUIET: [&str; 3] = ["/health", "/metrics", ELSEWHERE];
/// Methods that are told by name; what others ask for is refused, and whatever they are called is one series.
const METHODS: [Method; 7] = [
    Method::GET,
    Method::HEAD,
    Method::POST,
    Method::PUT,
    Method::PATCH,
    Method::DELETE,
    Method::OPTIONS,
];

/// Id of the request that is answered; none outside of one.
pub fn id() -> Option<String> {
    ID.try_with(Clone::clone).ok()
}

/// Answers a request, with its id in the answer.
pub async fn around(request: Request, next: Next) -> Response {
    let begin = Instant::now();
    let given = request.headers().get(HEADER).and_then(|id| id.to_str().ok());
    let id = match given.filter(|id| is_sane(id)) {
        Some(id) => id.to_owned(),
        None => Uuid::now_v7().simple().to_string(),
    };
    let method = METHODS.iter().find(|m| *m == request.method()).map_or("OTHER", Method::as_str);
    let matched = request.extensions().get::<MatchedPath>().map(|path| path.as_str().to_owned());
    let route = matched.as_deref().unwrap_or(ELSEWHERE);
    // Of the highest level, so that an error is told with its request whatever the log's filter.
    let span = tracing::error_span!("request", method, route, request_id = id);
    let answering = next.run(request).instrument(span.clone());
    let mut response = ID.scope(id.clone(), answering).await;
    let took = begin.elapsed();
    let status = response.status();
    TELEMETRY.answered(route, method, status.as_u16(), took);
    span.in_scope(|| tell(route, status, took.as_secs_f64() * 1e3));
    if let Ok(id) = HeaderValue::from_str(&id) {
        response.headers_mut().insert(HEADER, id);
    }
    response
}

/// The line of a request.
fn tell(route: &str, status: StatusCode, duration_ms: f64) {
    /// Digits after the point are microseconds.
    const PARTS: f64 = 1e3;
    let (status_code, duration_ms) = (status.as_u16(), (duration_ms * PARTS).round() / PARTS);
    if status.is_server_error() {
        tracing::error!(status = status_code, duration_ms, "could not answer");
    } else if QUIET.contains(&route) {
        tracing::debug!(status = status_code, duration_ms, "answered");
    } else {
        tracing::info!(status = status_code, duration_ms, "answered");
    }
}

/// Whether an id can stand in a log and be quoted.
fn is_sane(id: &str) -> bool {
    let is_known = |byte: u8| byte.is_ascii_alphanumeric() || b"-_.:".contains(&byte);
    (1..=LONGEST_ID).contains(&id.len()) && id.bytes().all(is_known)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ids_that_could_forge_a_log_are_not_taken_over() {
        assert!(is_sane("01JD9-a_b.c:7"));
        assert!(is_sane(&"x".repeat(LONGEST_ID)));
        for id in ["", "a b", "a\"b", "a\tb", "ä", "a{b}", &"x".repeat(LONGEST_ID + 1)] {
            assert!(!is_sane(id), "{id:?}");
        }
    }
}
