//! Submission over REST: a sweep as JSON or TOML, or as a form with a table beside it; dry runs; and keys
//! that keep a repeated submission from queueing twice.

use super::Service;
use super::error::Problem;
use super::extract::Asked;
use crate::archive::{reuse, start, upload};
use crate::domain::document::Document;
use crate::domain::outcome::EffectiveParameters;
use crate::domain::person::Actor;
use crate::domain::refusal::Refusal;
use crate::domain::sweep::SweepSpec;
use crate::domain::table::TableForm;
use crate::queue::{self, Enqueued, Submission};
use axum::Json;
use axum::body::Bytes;
use axum::extract::multipart::Multipart;
use axum::extract::{FromRequest, Request, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use utoipa::{IntoParams, ToSchema};

/// A sweep that was taken.
#[derive(Debug, Serialize, ToSchema)]
pub struct Submitted {
    id: String,
    /// Number of runs.
    count: usize,
    /// Runs found in the archive, which are not solved again.
    reused: usize,
}

/// What a sweep would come to.
#[derive(Debug, Serialize, ToSchema)]
pub struct DryRun {
    /// Number of runs.
    count: usize,
    /// Runs found in the archive, which would not be solved again.
    reused: usize,
    /// Parameters of the first run.
    #[schema(value_type = std::collections::BTreeMap<String, f64>)]
    first: EffectiveParameters,
    /// Parameters of the last run.
    #[schema(value_type = std::collections::BTreeMap<String, f64>)]
    last: EffectiveParameters,
    /// Time for the runs that would be solved, at the rate measured on this machine, if nothing else is
    /// queued.
    estimated_seconds: f64,
    /// Size on disk.
    estimated_bytes: f64,
    /// Threads that solve.
    workers: usize,
}

/// How a sweep is submitted.
#[derive(Debug, Default, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct Asking {
    /// Only tell what the sweep would come to.
    #[serde(default)]
    dry_run: bool,
}

/// The header with a client's key.
const KEY: &str = "idempotency-key";
/// Longest key.
const KEY_BYTES: usize = 255;

/// What was sent.
struct Sent {
    spec: Bytes,
    table: Option<Bytes>,
    digest: String,
}

/// Submit a sweep, as JSON or TOML; or as a form with the fields `spec` and `table`, the latter CSV or
/// Parquet. Every run is checked before any is queued. With an `Idempotency-Key`, a repeated submission is
/// answered with the sweep that is there already.
#[utoipa::path(
    post, path = "/sweeps",
    params(Asking, ("Idempotency-Key" = Option<String>, Header, description = "Any text of up to 255 characters")),
    request_body(content((Document = "application/json"), (String = "application/toml"), (Object = "multipart/form-data"))),
    responses(
        (status = 200, body = DryRun, description = "What a dry run tells"),
        (status = 202, body = Submitted),
        (status = 400, body = Problem), (status = 403, body = Problem), (status = 413, body = Problem), (status = 422, body = Problem),
        (status = 507, body = Problem, description = "The disk is full"),
    )
)]
pub async fn submit(
    State(service): State<Service>,
    actor: Actor,
    Asked(asking): Asked<Asking>,
    request: Request,
) -> Result<Response, Problem> {
    actor.may_submit()?;
    let key = key(request.headers())?.filter(|_| !asking.dry_run);
    let sent = receive(&service, request).await?;
    if let Some(key) = &key {
        let known =
            queue::known_submission(&mut *service.store.read().await?, &actor.name, key).await?;
        if let Some(known) = known {
            return repeated(known, key, &sent.digest);
        }
    }
    let digest = sent.digest.clone();
    let limits = service.limits;
    let sweep =
        tokio::task::spawn_blocking(move || read(sent, limits.max_runs)?.into_sweep(&limits))
            .await??;
    let sweep = Arc::new(sweep);
    start::check(&service.store, &sweep).await??;
    let found = if sweep.is_forced() { 0 } else { reuse::found(&service.store, &sweep).await? };
    if asking.dry_run {
        return Ok(Json(dry_run(&service, &sweep, found).await?).into_response());
    }
    let idempotency = key.clone().map(|key| (key, digest.clone()));
    let owner = actor.name.clone();
    let submission = Submission { workers: service.workers, found, idempotency, owner };
    let enqueued = queue::enqueue(&service.store, &sweep, submission).await?;
    if let Some(key) = &key
        && enqueued.digest.as_ref() != Some(&digest)
    {
        return repeated(enqueued, key, &digest);
    }
    service.wake.notify_waiters();
    let (runs, name) = (sweep.count(), sweep.name());
    tracing::info!(sweep = enqueued.id, runs, reused = found, name, "sweep submitted");
    Ok(taken(enqueued))
}

fn taken(enqueued: Enqueued) -> Response {
    let Enqueued { id, count, found, .. } = enqueued;
    (StatusCode::ACCEPTED, Json(Submitted { id, count, reused: found })).into_response()
}

fn repeated(known: Enqueued, key: &str, digest: &str) -> Result<Response, Problem> {
    if known.digest.as_deref() == Some(digest) {
        return Ok(taken(known));
    }
    let permitted = format!("a new key: this one came with another document, sweep {}", known.id);
    Err(Refusal::value("Idempotency-Key", key, permitted).into())
}

fn key(headers: &HeaderMap) -> Result<Option<String>, Problem> {
    let Some(value) = headers.get(KEY) else { return Ok(None) };
    match value.to_str() {
        Ok(text) if (1..=KEY_BYTES).contains(&text.len()) => Ok(Some(text.to_owned())),
        _ => {
            let permitted = format!("from 1 to {KEY_BYTES} visible characters");
            let shown = String::from_utf8_lossy(value.as_bytes()).into_owned();
            Err(Refusal::value("Idempotency-Key", shown, permitted).into())
        }
    }
}

async fn receive(service: &Service, request: Request) -> Result<Sent, Problem> {
    let most = service.most_bytes;
    let content_type = request.headers().get(header::CONTENT_TYPE);
    let is_form = content_type
        .and_then(|v| v.to_str().ok())
        .is_some_and(|v| v.starts_with("multipart/form-data"));
    let mut hasher = blake3::Hasher::new();
    let (spec, table) = if is_form {
        let mut form = Multipart::from_request(request, &()).await?;
        let (mut spec, mut table) = (None, None);
        while let Some(field) = form.next_field().await? {
            let name = field.name().unwrap_or_default().to_owned();
            let place = match name.as_str() {
                "spec" => &mut spec,
                "table" => &mut table,
                _ => {
                    return Err(Refusal::value(
                        name,
                        "",
                        "a form has the fields `spec` and `table`",
                    )
                    .into());
                }
            };
            if place.replace(field.bytes().await?).is_some() {
                return Err(Refusal::value(name, "", "each field once").into());
            }
        }
        let spec =
            spec.ok_or_else(|| Refusal::missing("spec", "a form has the sweep in `spec`"))?;
        (spec, table)
    } else {
        (Bytes::from_request(request, &()).await?, None)
    };
    let bytes = spec.len() + table.as_ref().map_or(0, Bytes::len);
    if bytes > most {
        return Err(Problem::too_large(bytes, most));
    }
    for part in [Some(&spec), table.as_ref()].into_iter().flatten() {
        hasher.update(&(part.len() as u64).to_le_bytes());
        hasher.update(part);
    }
    Ok(Sent { spec, table, digest: hasher.finalize().to_hex().to_string() })
}

/// The document, with the table put in.
fn read(sent: Sent, most_runs: usize) -> Result<Document, Refusal> {
    let text = std::str::from_utf8(&sent.spec).map_err(|e| Refusal::sentence(e.to_string()))?;
    let document = Document::parse(text)?;
    match sent.table {
        Some(bytes) => with_table(document, bytes, most_runs),
        None => Ok(document),
    }
}

/// Puts a table of points, CSV or Parquet, into a document.
pub fn with_table(
    mut document: Document,
    bytes: Bytes,
    most_rows: usize,
) -> Result<Document, Refusal> {
    /// How every Parquet file begins.
    const PARQUET: &[u8] = b"PAR1";
    if document.table.is_some() {
        return Err(Refusal::out_of_place("table", "the document has one and another was sent"));
    }
    let table = if bytes.starts_with(PARQUET) {
        upload::from_parquet(bytes, most_rows)?
    } else {
        TableForm::from_csv(&bytes)?
    };
    document.table = Some(table);
    Ok(document)
}

/// What a sweep would come to.
pub async fn dry_run(
    service: &Service,
    sweep: &Arc<SweepSpec>,
    found: usize,
) -> Result<DryRun, Problem> {
    /// Bytes on disk per stored number, of its eight: 10,000 profiles of 50 cells take 21.3 MB; series, which
    /// are smoother, take 5.
    const BYTES_PER_NUMBER: f64 = 7.1;
    /// Bytes on disk of a run's row: 600 in the catalogue with its indices, 200 in the table of runs.
    const BYTES_PER_RUN: f64 = 800.0;
    let mut tx = service.store.read().await?;
    let seconds = queue::seconds_per_unit(&mut tx, &sweep.run(0)).await?;
    drop(tx);
    let spec = sweep.clone();
    let (work, numbers) = tokio::task::spawn_blocking(move || spec.extent()).await?;
    let count = sweep.count();
    let share = (count - found.min(count)) as f64 / count as f64;
    let threads = service.workers.min(count).max(1) as f64;
    let parameters = |index| EffectiveParameters(*sweep.run(index).parameters());
    Ok(DryRun {
        count,
        reused: found,
        first: parameters(0),
        last: parameters(count - 1),
        estimated_seconds: work * seconds * share / threads,
        estimated_bytes: count as f64 * BYTES_PER_RUN + numbers as f64 * share * BYTES_PER_NUMBER,
        workers: service.workers,
    })
}
