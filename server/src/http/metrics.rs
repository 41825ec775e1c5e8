//! What an operator's monitoring asks for.

use super::Service;
use super::error::Problem;
use super::extract::NothingAsked;
use crate::archive::catalogue;
use crate::domain::status::{Phase, SweepState};
use crate::queue;
use crate::telemetry::{CONTENT_TYPE, Standing, TELEMETRY};
use axum::extract::State;
use axum::http::header;
use axum::response::IntoResponse;

/// Counts, times and sizes in the text format of Prometheus: requests, runs, chunks, the queue, the archive, the
/// disk, the process.
#[utoipa::path(
    get, path = "/metrics",
    responses(
        (status = 200, content_type = "text/plain; version=0.0.4", body = String),
        (status = 400, body = Problem), (status = 500, body = Problem),
        (status = 503, body = Problem), (status = 507, body = Problem),
    )
)]
pub async fn metrics(
    State(service): State<Service>,
    _: NothingAsked,
) -> Result<impl IntoResponse, Problem> {
    let mut tx = service.store.read().await?;
    let depth = queue::depth(&mut tx).await?;
    let (archive_files, archive_bytes) = catalogue::size(&mut tx).await?;
    drop(tx);
    let store = service.store.clone();
    let (disk, database_bytes) =
        tokio::task::spawn_blocking(move || (store.disk(), store.database_bytes())).await?;
    let disk = disk.map_err(|error| Problem::inner(&error))?;
    let mut standing = Standing {
        sweeps: SweepState::ALL.map(|state| (state.name(), 0)).to_vec(),
        archive_files,
        archive_bytes,
        database_bytes,
        disk_free_bytes: disk.free_bytes,
        disk_size_bytes: disk.size_bytes,
        ..Standing::default()
    };
    let (mut queued, mut running, mut paused) = (0, 0, 0);
    for part in depth {
        let state = part.phase.state(&part.counts);
        let count = standing.sweeps.iter_mut().find(|(name, _)| *name == state.name());
        count.into_iter().for_each(|(_, sweeps)| *sweeps += part.sweeps);
        running += part.counts.running;
        *if part.phase == Phase::Paused { &mut paused } else { &mut queued } += part.counts.queued;
    }
    standing.queue_runs = vec![("queued", queued), ("running", running), ("paused", paused)];
    let text = TELEMETRY.text(&standing).map_err(|error| Problem::inner(&error))?;
    Ok(([(header::CONTENT_TYPE, CONTENT_TYPE)], text))
}
