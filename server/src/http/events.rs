//! Progress of a sweep as server-sent events. Each event is a whole picture, so that none is missed when a
//! connection breaks: whoever comes back gets the present one, unless it is the last one seen.

use super::Service;
use super::error::Problem;
use super::extract::{NothingAsked, Place};
use crate::archive::catalogue;
use crate::domain::status::{Counts, SweepState};
use crate::queue;
use axum::extract::State;
use axum::http::{HeaderMap, StatusCode};
use axum::response::sse::{Event, KeepAlive, Sse};
use axum::response::{IntoResponse, Response};
use futures_util::stream;
use serde::Serialize;
use std::convert::Infallible;
use std::time::Duration;
use tokio::sync::watch;
use tokio::time::Instant;
use utoipa::ToSchema;

/// Shortest time between two events of a connection, but for the end of the sweep.
const AT_MOST_EVERY: Duration = Duration::from_millis(200);
/// Longest time between two events of a sweep under way: pace and time left change without a commit.
const AT_LEAST_EVERY: Duration = Duration::from_secs(2);
/// Failures told.
const FAILURES: i64 = 5;

/// How far a sweep is.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Progress {
    id: String,
    state: SweepState,
    counts: Counts,
    reused: i64,
    /// Runs that ended per second, lately; null if nothing did.
    runs_per_s: Option<f64>,
    /// Seconds until the rest has ended, at this rate.
    seconds_left: Option<f64>,
    /// The last failures: index, id and reason.
    #[schema(value_type = Vec<Object>)]
    failures: Vec<serde_json::Value>,
}

impl Progress {
    /// Identifies the picture, but for pace and time left.
    fn event_id(&self) -> String {
        let told = serde_json::json!([self.state, self.counts]);
        blake3::hash(told.to_string().as_bytes()).to_hex()[..16].to_owned()
    }

    fn is_last(&self) -> bool {
        matches!(self.state, SweepState::Complete | SweepState::Cancelled)
    }
}

/// How far a sweep is now; none if it is not there.
pub async fn progress(service: &Service, id: &str) -> Result<Option<Progress>, Problem> {
    let mut tx = service.store.read().await?;
    let Some(row) = queue::sweep_in_brief(&mut tx, id).await? else { return Ok(None) };
    let pace = queue::pace(&mut tx, &row).await?;
    let failures = if row.counts.failed > 0 {
        catalogue::failures(&mut tx, row.number, FAILURES).await?
    } else {
        Vec::new()
    };
    Ok(Some(Progress {
        state: row.state(),
        id: row.id,
        counts: row.counts,
        reused: row.reused,
        runs_per_s: pace.map(|p| p.runs_per_s),
        seconds_left: pace.map(|p| p.seconds_left).filter(|s| s.is_finite()),
        failures,
    }))
}

/// Where a stream of events is.
struct Stream {
    service: Service,
    changes: watch::Receiver<u64>,
    ends: watch::Receiver<u64>,
    people: watch::Receiver<u64>,
    told: Option<Instant>,
    id: String,
    last_seen: Option<String>,
    is_over: bool,
}

/// Progress of a sweep, as server-sent events: `progress` with counts, pace, time left and the last
/// failures; `end` when nothing more will change, after which the stream closes, and 204 for who comes
/// back with the id of that event.
#[utoipa::path(
    get, path = "/sweeps/{id}/events",
    params(("id" = String, Path,), ("Last-Event-ID" = Option<String>, Header,)),
    responses(
        (status = 200, content_type = "text/event-stream", body = Progress),
        (status = 204, description = "The last event has been seen"),
        (status = 400, body = Problem), (status = 404, body = Problem),
    )
)]
pub async fn events(
    State(service): State<Service>,
    Place(id): Place<String>,
    _: NothingAsked,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let (changes, ends) = (service.store.changes(), service.store.ends());
    let people = service.people_changed.subscribe();
    let now = progress(&service, &id).await?.ok_or_else(|| Problem::not_found("sweep", &id))?;
    let last_seen = headers.get("last-event-id").and_then(|v| v.to_str().ok()).map(str::to_owned);
    if now.is_last() && last_seen.as_deref() == Some(&now.event_id()) {
        return Ok(StatusCode::NO_CONTENT.into_response());
    }
    let begin =
        Stream { service, changes, ends, people, told: None, id, last_seen, is_over: false };
    let events = stream::unfold(begin, |stream| async move { stream.next().await });
    Ok(Sse::new(events).keep_alive(KeepAlive::default()).into_response())
}

impl Stream {
    /// The next event and the stream after it; none after the end.
    async fn next(mut self) -> Option<(Result<Event, Infallible>, Self)> {
        let stop = self.service.stop.clone();
        loop {
            // Who may what has changed: whoever may still look comes back.
            let is_anew = self.people.has_changed().unwrap_or(true);
            if self.is_over || stop.is_cancelled() || is_anew {
                return None;
            }
            if let Some(told) = self.told.take() {
                tokio::select! {
                    () = stop.cancelled() => continue,
                    () = tokio::time::sleep_until(told + AT_MOST_EVERY) => {}
                    // The sender lives as long as the store.
                    _ = self.ends.changed() => {}
                }
            }
            self.changes.mark_unchanged();
            self.ends.mark_unchanged();
            let told = match progress(&self.service, &self.id).await {
                Ok(Some(progress)) => progress,
                // Deleted, or the database does not answer: whoever comes back is told which.
                Ok(None) | Err(_) => return None,
            };
            let event_id = told.event_id();
            if self.last_seen.as_ref() != Some(&event_id) {
                self.is_over = told.is_last();
                let name = if self.is_over { "end" } else { "progress" };
                let event = Event::default().event(name).id(&event_id).json_data(&told);
                self.last_seen = Some(event_id);
                self.told = Some(Instant::now());
                let event = event.unwrap_or_else(|e| Event::default().comment(e.to_string()));
                return Some((Ok(event), self));
            }
            tokio::select! {
                () = stop.cancelled() => {}
                _ = self.changes.changed() => {}
                // Seen again above.
                _ = self.people.changed() => self.people.mark_changed(),
                () = tokio::time::sleep(AT_LEAST_EVERY) => {
                    // What is the same but for the pace is told again now and then.
                    if told.state == SweepState::Running {
                        self.last_seen = None;
                    }
                }
            }
        }
    }
}
