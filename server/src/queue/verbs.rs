//! What a user asks of a sweep: pause, resume, stop, cancel, retry; and what is left of deleted ones.

use super::{move_runs, set_phase, settle};
use crate::domain::status::{Pending, Phase, Verb};
use crate::domain::taken_out::TakenOut;
use crate::store::Connection;
use sqlx::Row;

/// A verb that the sweep's state does not allow.
#[derive(Debug, thiserror::Error)]
pub enum VerbError {
    /// The database refused.
    #[error("the queue cannot be written: {0}")]
    Database(#[from] sqlx::Error),
    /// The state.
    #[error("{0}")]
    State(String),
}

/// Does what a verb says. To do a verb's state again changes nothing; `retry` is for whoever knows the
/// failed runs, see [`requeue`], and `recover` for the trash.
pub async fn verb(
    connection: &mut Connection,
    sweep: i64,
    phase: Phase,
    verb: Verb,
) -> Result<(), VerbError> {
    let refused = |why: &str| Err(VerbError::State(format!("this sweep {why}")));
    match (verb, phase) {
        (_, Phase::Deleted) => refused("is deleted"),
        (Verb::Retry | Verb::Recover, _) => Ok(()),
        (Verb::Pause, Phase::Open) => Ok(set_phase(connection, sweep, Phase::Paused).await?),
        (Verb::Pause, Phase::Paused) | (Verb::Resume, Phase::Open) => Ok(()),
        (Verb::Pause, Phase::Stopping) => refused("is stopping, and will start no more chunks"),
        (Verb::Pause, Phase::Ended) => refused("has ended: there is nothing to pause"),
        (Verb::Resume, Phase::Paused | Phase::Stopping | Phase::Ended) => {
            let queued = move_chunks(connection, sweep, "cancelled", Pending::Queued).await?;
            if phase == Phase::Ended && queued == 0 {
                return refused("is complete: there is nothing to resume");
            }
            Ok(set_phase(connection, sweep, Phase::Open).await?)
        }
        (Verb::Stop | Verb::Cancel, Phase::Ended) => Ok(()),
        (Verb::Stop, _) => {
            move_chunks(connection, sweep, "queued", Pending::Cancelled).await?;
            set_phase(connection, sweep, Phase::Stopping).await?;
            Ok(settle(connection, sweep).await.map(drop)?)
        }
        (Verb::Cancel, _) => {
            move_chunks(connection, sweep, "queued", Pending::Cancelled).await?;
            move_chunks(connection, sweep, "leased", Pending::Cancelled).await?;
            Ok(settle(connection, sweep).await.map(drop)?)
        }
    }
}

/// Moves all of a sweep's chunks of one state to another, and their runs with them.
pub(super) async fn move_chunks(
    connection: &mut Connection,
    sweep: i64,
    from: &str,
    to: Pending,
) -> sqlx::Result<i64> {
    let runs: i64 = sqlx::query_scalar(
        "SELECT COALESCE(SUM(run_count), 0) FROM chunks WHERE sweep = $1 AND state = $2",
    )
    .bind(sweep)
    .bind(from)
    .fetch_one(&mut *connection)
    .await?;
    sqlx::query("UPDATE chunks SET state = $1, lease_token = NULL WHERE sweep = $2 AND state = $3")
        .bind(to.name())
        .bind(sweep)
        .bind(from)
        .execute(&mut *connection)
        .await?;
    let counted_as = if from == "leased" { Pending::Running.name() } else { from };
    move_runs(connection, sweep, counted_as, to.name(), runs).await?;
    Ok(runs)
}

/// Queues runs again whose results were taken out, within the same transaction: each stretch as a chunk.
pub async fn requeue(
    connection: &mut Connection,
    sweep: i64,
    taken: &TakenOut,
) -> sqlx::Result<()> {
    sqlx::query("UPDATE sweeps SET reused = reused - $1 WHERE sweep = $2 AND reused >= $1")
        .bind(taken.adopted)
        .bind(sweep)
        .execute(&mut *connection)
        .await?;
    let last: i64 =
        sqlx::query_scalar("SELECT COALESCE(MAX(chunk), -1) FROM chunks WHERE sweep = $1")
            .bind(sweep)
            .fetch_one(&mut *connection)
            .await?;
    for (chunk, stretch) in (last + 1..).zip(&taken.stretches) {
        sqlx::query(
            "INSERT INTO chunks (sweep, chunk, first_run, end_run, run_count, state) \
             VALUES ($1, $2, $3, $4, $5, 'queued')",
        )
        .bind(sweep)
        .bind(chunk)
        .bind(stretch.start)
        .bind(stretch.end)
        .bind(stretch.end - stretch.start)
        .execute(&mut *connection)
        .await?;
    }
    for (status, runs) in &taken.statuses {
        move_runs(connection, sweep, status.name(), Pending::Queued.name(), *runs).await?;
    }
    if !taken.stretches.is_empty() {
        sqlx::query("UPDATE sweeps SET phase = 'open' WHERE sweep = $1 AND phase = 'ended'")
            .bind(sweep)
            .execute(connection)
            .await?;
    }
    Ok(())
}

/// Number and id of a sweep that waits to be cleared away.
pub async fn deleted(connection: &mut Connection) -> sqlx::Result<Vec<(i64, String)>> {
    let rows = sqlx::query("SELECT sweep, id FROM sweeps WHERE phase = 'deleted' ORDER BY sweep")
        .fetch_all(connection)
        .await?;
    Ok(rows.iter().map(|row| (row.get("sweep"), row.get("id"))).collect())
}

/// Removes a deleted sweep from the queue, when the archive holds nothing of it any more.
pub async fn forget(connection: &mut Connection, sweep: i64) -> sqlx::Result<()> {
    for sql in [
        "DELETE FROM tallies WHERE sweep = $1",
        "DELETE FROM tags WHERE sweep = $1",
        "DELETE FROM sweep_ranges WHERE sweep = $1",
        "DELETE FROM documents WHERE sweep = $1",
        "DELETE FROM imports WHERE sweep = $1",
        "DELETE FROM chunks WHERE sweep = $1",
        "DELETE FROM sweeps WHERE sweep = $1 AND phase = 'deleted'",
    ] {
        sqlx::query(sql).bind(sweep).execute(&mut *connection).await?;
    }
    Ok(())
}
