//! What people call a sweep by, changed over REST: name, tags, note, priority.

use super::Service;
use super::error::Problem;
use super::extract::{NothingAsked, Place};
use super::sweeps::Sweep;
use crate::domain::label::Edit;
use crate::domain::person::Actor;
use crate::people;
use crate::queue;
use crate::store::Store;
use axum::Json;
use axum::body::Bytes;
use axum::extract::State;
use axum::extract::rejection::BytesRejection;

/// Change a sweep's name, tags, note or priority; what is not given stays. Only its owner and admins may, but for
/// tags that are added: by these a group finds its sweeps, and every contributor may add some.
#[utoipa::path(
    patch, path = "/sweeps/{id}", params(("id" = String, Path,)), request_body = Edit,
    responses(
        (status = 200, body = Sweep), (status = 400, body = Problem),
        (status = 403, body = Problem, description = "It is somebody else's"),
        (status = 404, body = Problem),
        (status = 409, body = Problem, description = "The sweep's state does not allow it"),
        (status = 413, body = Problem), (status = 422, body = Problem),
        (status = 507, body = Problem, description = "The disk is full"),
    )
)]
pub async fn change(
    State(service): State<Service>,
    actor: Actor,
    Place(id): Place<String>,
    _: NothingAsked,
    body: Result<Bytes, BytesRejection>,
) -> Result<Json<Sweep>, Problem> {
    let edit = Edit::parse(&body?)?;
    let sweep = apply(&service.store, &actor, &id, &edit).await?;
    if !edit.is_empty() {
        tracing::info!(sweep = id, changed = edit.sentence(), "a sweep was edited");
    }
    Ok(Json(sweep))
}

/// Changes a sweep, and tells what it is then.
pub async fn apply(store: &Store, actor: &Actor, id: &str, edit: &Edit) -> Result<Sweep, Problem> {
    edit.check()?;
    let mut tx = store.write().await?;
    let row = queue::sweep_in_brief(&mut tx, id).await?;
    let row = row.ok_or_else(|| Problem::not_found("sweep", id))?;
    // Within the transaction: two who add tags at the same time both add them.
    let edit = &edit.on(&row.tags)?;
    if edit.only_adds_to(&row.tags) {
        actor.may_submit()?;
    } else {
        actor.may_change(row.owner.as_deref())?;
    }
    if !edit.is_empty() {
        queue::edit(&mut tx, &row, edit).await?;
        people::audit(&mut tx, &actor.name, "edit", id, Some(&edit.sentence())).await?;
    }
    let row = queue::sweep(&mut tx, id).await?;
    let row = row.ok_or_else(|| Problem::not_found("sweep", id))?;
    let sweep = Sweep::brief(&mut tx, row).await?;
    tx.commit().await?;
    sweep.whole().await
}
