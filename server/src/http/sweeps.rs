//! Sweeps over REST: submit, list, look at, fit.

use super::error::Problem;
use super::extract::{Asked, NothingAsked, Place};
use super::{DOCUMENT_BYTES, Service};
use crate::analysis::{self, Fit, Law, NoFit};
use crate::archive::{catalogue, start};
use crate::domain::document::Document;
use crate::domain::refusal::Refusal;
use crate::domain::status::{Counts, SweepState};
use crate::queue::{self, SweepRow};
use axum::Json;
use axum::body::Bytes;
use axum::extract::State;
use axum::extract::rejection::BytesRejection;
use axum::http::StatusCode;
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use utoipa::{IntoParams, ToSchema};

/// A sweep and how far it is.
#[derive(Debug, Serialize, ToSchema)]
pub struct Sweep {
    id: String,
    name: String,
    state: SweepState,
    counts: Counts,
    created_at: String,
    #[schema(value_type = Document)]
    spec: serde_json::Value,
}

impl From<SweepRow> for Sweep {
    fn from(row: SweepRow) -> Self {
        Self {
            state: row.counts.state(),
            spec: serde_json::from_str(&row.document).unwrap_or_default(),
            id: row.id,
            name: row.name,
            counts: row.counts,
            created_at: row.created_at,
        }
    }
}

/// A page of a list.
#[derive(Debug, Serialize, ToSchema)]
pub struct Page<T> {
    items: Vec<T>,
    /// Cursor of the next page; null at the end.
    next: Option<String>,
    /// All items.
    total: i64,
}

/// Which page.
#[derive(Debug, Default, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct Paging {
    /// Items of the page, from 1 to 1000; 100 if not given.
    limit: Option<i64>,
    /// The `next` of the page before.
    cursor: Option<String>,
}

impl Paging {
    /// Limit and offset, checked.
    pub fn window(limit: Option<i64>, cursor: Option<&str>) -> Result<(i64, i64), Problem> {
        const DEFAULT: i64 = 100;
        const MOST: i64 = 1000;
        let limit = limit.unwrap_or(DEFAULT);
        if !(1..=MOST).contains(&limit) {
            return Err(Refusal::value("limit", limit, format!("from 1 to {MOST}")).into());
        }
        let offset =
            match cursor {
                None => 0,
                Some(text) => text.parse().ok().filter(|offset| *offset >= 0).ok_or_else(|| {
                    Refusal::value("cursor", text, "the `next` of the page before")
                })?,
            };
        Ok((limit, offset))
    }
}

impl<T> Page<T> {
    /// The items, where the next page starts, and how many there are in all.
    pub fn new(items: Vec<T>, next: Option<i64>, total: i64) -> Self {
        Self { items, next: next.map(|n| n.to_string()), total }
    }
}

/// A sweep that was taken.
#[derive(Debug, Serialize, ToSchema)]
pub struct Submitted {
    id: String,
    /// Number of runs.
    count: usize,
    /// Runs found in the archive; none until sweeps share runs.
    reused: usize,
}

/// How a sweep is submitted.
#[derive(Debug, Default, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct Submission {
    /// Not there yet.
    dry_run: Option<bool>,
}

/// Submit a sweep, as JSON or TOML. Every run is checked before any is queued.
#[utoipa::path(
    post, path = "/sweeps", params(Submission), request_body = Document,
    responses(
        (status = 202, body = Submitted),
        (status = 400, body = Problem), (status = 413, body = Problem), (status = 422, body = Problem),
        (status = 501, body = Problem),
    )
)]
pub async fn submit(
    State(service): State<Service>,
    Asked(query): Asked<Submission>,
    body: Result<Bytes, BytesRejection>,
) -> Result<(StatusCode, Json<Submitted>), Problem> {
    if query.dry_run == Some(true) {
        return Err(Problem::not_yet("dry_run"));
    }
    let body = body?;
    if body.len() > DOCUMENT_BYTES {
        return Err(Problem::too_large(body.len(), DOCUMENT_BYTES));
    }
    let sweep = tokio::task::spawn_blocking(move || {
        let text = std::str::from_utf8(&body).map_err(|e| Refusal::sentence(e.to_string()))?;
        Document::parse(text)?.into_sweep()
    })
    .await??;
    let sweep = Arc::new(sweep);
    start::check(&service.store, &sweep).await??;
    let id = queue::enqueue(&service.store, &sweep, service.workers).await?;
    service.wake.notify_waiters();
    tracing::info!(sweep = id, runs = sweep.count(), name = sweep.name(), "sweep submitted");
    Ok((StatusCode::ACCEPTED, Json(Submitted { id, count: sweep.count(), reused: 0 })))
}

/// List sweeps, the newest first.
#[utoipa::path(
    get, path = "/sweeps", params(Paging),
    responses((status = 200, body = Page<Sweep>), (status = 400, body = Problem), (status = 422, body = Problem))
)]
pub async fn list(
    State(service): State<Service>,
    Asked(paging): Asked<Paging>,
) -> Result<Json<Page<Sweep>>, Problem> {
    let (limit, offset) = Paging::window(paging.limit, paging.cursor.as_deref())?;
    let (rows, total) = queue::sweeps(&mut *service.store.read().await?, limit, offset).await?;
    let next = Some(offset + limit).filter(|next| *next < total);
    Ok(Json(Page::new(rows.into_iter().map(Sweep::from).collect(), next, total)))
}

/// One sweep.
#[utoipa::path(
    get, path = "/sweeps/{id}", params(("id" = String, Path,)),
    responses((status = 200, body = Sweep), (status = 404, body = Problem))
)]
pub async fn one(
    State(service): State<Service>,
    Place(id): Place<String>,
    _: NothingAsked,
) -> Result<Json<Sweep>, Problem> {
    let row = queue::sweep(&mut *service.store.read().await?, &id).await?;
    row.map(|row| Json(row.into())).ok_or_else(|| Problem::not_found("sweep", &id))
}

/// Pause, resume, stop, cancel, retry: not there yet.
#[utoipa::path(
    post, path = "/sweeps/{id}/{verb}", params(("id" = String, Path,), ("verb" = String, Path,)),
    responses((status = 404, body = Problem), (status = 501, body = Problem))
)]
pub async fn verb(place: Place<(String, String)>) -> Problem {
    let Place((_, verb)) = place;
    match verb.as_str() {
        "pause" | "resume" | "stop" | "cancel" | "retry" => Problem::not_yet(&verb),
        _ => Problem::not_found("verb", &verb),
    }
}

/// Events of a sweep: not there yet; ask for the sweep again instead.
#[utoipa::path(
    get, path = "/sweeps/{id}/events", params(("id" = String, Path,)),
    responses((status = 501, body = Problem))
)]
pub async fn events() -> Problem {
    Problem::not_yet("events")
}

/// What is fitted.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct FitQuery {
    /// Parameter or scalar on the abscissa.
    x: String,
    /// Parameter or scalar on the ordinate.
    y: String,
    /// The law; a power law if not given.
    #[serde(default)]
    model: Law,
}

/// Fit a law to a sweep's runs.
#[utoipa::path(
    get, path = "/sweeps/{id}/fit", params(("id" = String, Path,), FitQuery),
    responses(
        (status = 200, body = Fit), (status = 400, body = Problem), (status = 404, body = Problem),
        (status = 409, body = Problem), (status = 422, body = Problem),
    )
)]
pub async fn fit(
    State(service): State<Service>,
    Place(id): Place<String>,
    Asked(query): Asked<FitQuery>,
) -> Result<Json<Fit>, Problem> {
    for (field, name) in [("x", &query.x), ("y", &query.y)] {
        if !catalogue::is_number(name) {
            return Err(Refusal::value(
                field,
                name.as_str(),
                "a parameter or a number of the result",
            )
            .into());
        }
    }
    let mut tx = service.store.read().await?;
    if queue::sweep(&mut tx, &id).await?.is_none() {
        return Err(Problem::not_found("sweep", &id));
    }
    let runs = catalogue::pairs(&mut tx, &id, &query.x, &query.y).await?;
    drop(tx);
    let fitted = tokio::task::spawn_blocking(move || analysis::fit(query.model, &runs)).await?;
    fitted.map(Json).map_err(|e: NoFit| Problem::conflict(e.to_string()))
}
