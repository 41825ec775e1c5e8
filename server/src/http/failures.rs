//! Runs of a sweep that came to no result, by why, over REST.

use super::Service;
use super::error::Problem;
use super::extract::{NothingAsked, Place};
use crate::archive::catalogue;
use crate::domain::reason::{Failures, Gathering};
use crate::queue;
use axum::Json;
use axum::extract::State;

/// A sweep's ended runs that are neither converged nor completed, by what they say of why. Those that say the same
/// but for numbers are one group.
#[utoipa::path(
    get, path = "/sweeps/{id}/failures", params(("id" = String, Path,)),
    responses(
        (status = 200, body = Failures), (status = 400, body = Problem), (status = 404, body = Problem),
    )
)]
pub async fn failures(
    State(service): State<Service>,
    Place(id): Place<String>,
    _: NothingAsked,
) -> Result<Json<Failures>, Problem> {
    let _turn = service.store.long_read().await?;
    let mut tx = service.store.read().await?;
    let row = queue::sweep_in_brief(&mut tx, &id).await?;
    let row = row.ok_or_else(|| Problem::not_found("sweep", &id))?;
    let mut gathering = Gathering::default();
    let take = |run: catalogue::Unsolved<'_>| {
        gathering.add(run.status, run.run_index, run.run_id, run.detail);
    };
    catalogue::unsolved(&mut tx, row.number, take).await?;
    drop(tx);
    Ok(Json(gathering.told()))
}
