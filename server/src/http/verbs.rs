//! What a user asks of a sweep: pause, resume, stop, cancel, retry, delete.

use super::Service;
use super::error::Problem;
use super::extract::{NothingAsked, Place};
use super::sweeps::Sweep;
use crate::archive::catalogue;
use crate::domain::status::{Phase, Verb};
use crate::queue;
use crate::store::Store;
use axum::Json;
use axum::extract::State;
use axum::http::StatusCode;

/// Pause, resume, stop, cancel a sweep, or retry its failed runs.
#[utoipa::path(
    post, path = "/sweeps/{id}/{verb}",
    params(("id" = String, Path,), ("verb" = Verb, Path,)),
    responses(
        (status = 200, body = Sweep), (status = 400, body = Problem), (status = 404, body = Problem),
        (status = 409, body = Problem, description = "The sweep's state does not allow it"),
        (status = 507, body = Problem, description = "The disk is full"),
    )
)]
pub async fn verb(
    State(service): State<Service>,
    Place((id, verb)): Place<(String, String)>,
    _: NothingAsked,
) -> Result<Json<Sweep>, Problem> {
    let verb = Verb::from_name(&verb).ok_or_else(|| Problem::not_found("verb", &verb))?;
    let sweep = act(&service.store, &id, verb).await?;
    service.wake.notify_waiters();
    tracing::info!(sweep = id, verb = verb.name(), "asked of a sweep");
    Ok(Json(sweep))
}

/// Does what a verb says, and tells what the sweep is then, in brief.
pub async fn act(store: &Store, id: &str, verb: Verb) -> Result<Sweep, Problem> {
    let mut tx = store.write().await?;
    let row = queue::sweep_in_brief(&mut tx, id).await?;
    let row = row.ok_or_else(|| Problem::not_found("sweep", id))?;
    if verb == Verb::Retry {
        if row.phase == Phase::Stopping {
            let why = "this sweep is stopping: resume it, or wait until it has stopped";
            return Err(Problem::conflict(why));
        }
        let taken = catalogue::take_out(&mut tx, row.number, catalogue::Which::Failed).await?;
        queue::requeue(&mut tx, row.number, &taken).await?;
    } else {
        queue::verb(&mut tx, row.number, row.phase, verb).await?;
    }
    let row = queue::sweep_in_brief(&mut tx, id).await?;
    tx.commit().await?;
    if verb == Verb::Cancel {
        store.revoke();
    }
    row.map(Sweep::from).ok_or_else(|| Problem::not_found("sweep", id))
}

/// Delete a sweep: it is cancelled and disappears. Runs that another sweep uses stay.
#[utoipa::path(
    delete, path = "/sweeps/{id}", params(("id" = String, Path,)),
    responses((status = 204, description = "Deleted"), (status = 400, body = Problem), (status = 404, body = Problem), (status = 507, body = Problem))
)]
pub async fn delete(
    State(service): State<Service>,
    Place(id): Place<String>,
    _: NothingAsked,
) -> Result<StatusCode, Problem> {
    remove(&service.store, &id).await?;
    tracing::info!(sweep = id, "deleted a sweep");
    Ok(StatusCode::NO_CONTENT)
}

/// Cancels a sweep and hides it; a worker clears it away.
pub async fn remove(store: &Store, id: &str) -> Result<(), Problem> {
    let mut tx = store.write().await?;
    let row = queue::sweep_in_brief(&mut tx, id).await?;
    let row = row.ok_or_else(|| Problem::not_found("sweep", id))?;
    queue::delete(&mut tx, row.number).await?;
    tx.commit().await?;
    store.revoke();
    Ok(())
}
