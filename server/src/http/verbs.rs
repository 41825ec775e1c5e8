//! What a user asks of a sweep: pause, resume, stop, cancel, retry, delete, recover.

use super::Service;
use super::error::Problem;
use super::extract::{Asked, NothingAsked, Place};
use super::sweeps::Sweep;
use crate::archive::catalogue;
use crate::domain::person::Actor;
use crate::domain::status::{Phase, Verb};
use crate::people;
use crate::queue::{self, Trashed};
use crate::store::Store;
use axum::Json;
use axum::extract::State;
use axum::http::StatusCode;
use serde::Deserialize;
use utoipa::IntoParams;

/// Pause, resume, stop, cancel a sweep, retry its failed runs, or recover it from the trash.
#[utoipa::path(
    post, path = "/sweeps/{id}/{verb}",
    params(("id" = String, Path,), ("verb" = Verb, Path,)),
    responses(
        (status = 200, body = Sweep), (status = 400, body = Problem), (status = 404, body = Problem),
        (status = 403, body = Problem, description = "It is somebody else's"),
        (status = 409, body = Problem, description = "The sweep's state does not allow it"),
        (status = 507, body = Problem, description = "The disk is full"),
    )
)]
pub async fn verb(
    State(service): State<Service>,
    actor: Actor,
    Place((id, verb)): Place<(String, String)>,
    _: NothingAsked,
) -> Result<Json<Sweep>, Problem> {
    let verb = Verb::from_name(&verb).ok_or_else(|| Problem::not_found("verb", &verb))?;
    let sweep = act(&service.store, &actor, &id, verb).await?;
    service.wake.notify_waiters();
    tracing::info!(sweep = id, verb = verb.name(), "asked of a sweep");
    Ok(Json(sweep))
}

/// Does what a verb says, and tells what the sweep is then, in brief.
pub async fn act(store: &Store, actor: &Actor, id: &str, verb: Verb) -> Result<Sweep, Problem> {
    let mut tx = store.write().await?;
    if verb == Verb::Recover {
        let sweep = queue::trashed(&mut tx, id).await?;
        let sweep = sweep.ok_or_else(|| Problem::not_found("sweep in the trash", id))?;
        actor.may_change(sweep.owner.as_deref())?;
        queue::recover(&mut tx, sweep.number).await?;
    }
    let row = queue::sweep_in_brief(&mut tx, id).await?;
    let row = row.ok_or_else(|| Problem::not_found("sweep", id))?;
    actor.may_change(row.owner.as_deref())?;
    queue::refuse_if_sealed(&mut tx, row.number).await?;
    people::audit(&mut tx, &actor.name, verb.name(), id, None).await?;
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
    if let (Verb::Recover | Verb::Resume | Verb::Retry, Some(owner)) = (verb, &row.owner) {
        queue::check_quota(&mut tx, owner, 0, 0).await?;
    }
    let row = queue::sweep_in_brief(&mut tx, id).await?;
    let row = row.ok_or_else(|| Problem::not_found("sweep", id))?;
    let sweep = Sweep::brief(&mut tx, row).await?;
    tx.commit().await?;
    if verb == Verb::Cancel {
        store.revoke();
    }
    Ok(sweep)
}

/// How a sweep is deleted.
#[derive(Debug, Default, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct Deleting {
    /// At once and for good, also what lies in the trash already.
    #[serde(default)]
    for_good: bool,
}

/// Delete a sweep: what has no result yet is cancelled, and the sweep lies in the trash, from which it can be
/// recovered for a time (30 days unless the operator says otherwise). Runs that another sweep uses stay.
#[utoipa::path(
    delete, path = "/sweeps/{id}", params(("id" = String, Path,), Deleting),
    responses(
        (status = 204, description = "Deleted"), (status = 400, body = Problem), (status = 403, body = Problem),
        (status = 404, body = Problem), (status = 409, body = Problem, description = "It is sealed"),
        (status = 507, body = Problem),
    )
)]
pub async fn delete(
    State(service): State<Service>,
    actor: Actor,
    Place(id): Place<String>,
    Asked(deleting): Asked<Deleting>,
) -> Result<StatusCode, Problem> {
    remove(&service.store, &actor, &id, deleting.for_good).await?;
    tracing::info!(sweep = id, for_good = deleting.for_good, "deleted a sweep");
    Ok(StatusCode::NO_CONTENT)
}

/// Cancels a sweep and puts it into the trash, or deletes it for good; then a worker clears it away.
pub async fn remove(store: &Store, actor: &Actor, id: &str, for_good: bool) -> Result<(), Problem> {
    let mut tx = store.write().await?;
    let found = match queue::sweep_in_brief(&mut tx, id).await? {
        Some(row) => Some(Trashed { number: row.number, name: row.name, owner: row.owner }),
        None if for_good => queue::trashed(&mut tx, id).await?,
        None => None,
    };
    let sweep = found.ok_or_else(|| Problem::not_found("sweep", id))?;
    actor.may_change(sweep.owner.as_deref())?;
    queue::refuse_if_sealed(&mut tx, sweep.number).await?;
    let action = if for_good { "delete for good" } else { "delete" };
    people::audit(&mut tx, &actor.name, action, id, Some(&sweep.name)).await?;
    if for_good {
        queue::delete(&mut tx, sweep.number).await?;
    } else {
        queue::trash(&mut tx, sweep.number).await?;
    }
    tx.commit().await?;
    store.revoke();
    Ok(())
}
