//! The queue: sweeps and their chunks. The unit is the chunk, a stretch of a sweep's runs that one worker
//! solves. All of the queue's SQL stands in this folder. Knows no solver and no transport.
//!
//! Counts are kept by state and change by moving runs from one state to another, so that they add up.

mod admit;
mod edit;
mod find;
mod lease;
mod look;
mod seal;
mod submit;
mod trash;
mod verbs;

pub use admit::{Admission, admit, is_id_free};
pub use edit::edit;
pub use find::{Varied, facts, varied};
pub use lease::{Lease, LeaseLost, finish, give_back, holds, lease, measured, reclaim, take};
pub use look::{
    Imported, SweepRow, Which, depth, document, health, numbered, pace, seconds_per_unit, sweep,
    sweep_in_brief, sweeps,
};
pub use seal::refuse_if_sealed;
pub use submit::{EnqueueError, Enqueued, Submission, check_quota, enqueue, known_submission};
pub use trash::{Trashed, delete, empty, is_due, recover, trash, trashed};
pub use verbs::{VerbError, deleted, forget, requeue, verb};

use crate::domain::status::{Pending, Phase, Status};
use crate::store::Connection;

/// Moves runs of a sweep from one count to another.
async fn move_runs(
    connection: &mut Connection,
    sweep: i64,
    from: &str,
    to: &str,
    runs: i64,
) -> sqlx::Result<()> {
    add_runs(connection, sweep, from, -runs).await?;
    add_runs(connection, sweep, to, runs).await
}

/// Adds runs to a count of a sweep.
async fn add_runs(
    connection: &mut Connection,
    sweep: i64,
    state: &str,
    runs: i64,
) -> sqlx::Result<()> {
    if runs == 0 {
        return Ok(());
    }
    // Fewer than there are is an error of the database's: a count never falls below zero.
    let sql = if runs < 0 {
        "UPDATE tallies SET runs = runs + $3 WHERE sweep = $1 AND status = $2"
    } else {
        "INSERT INTO tallies (sweep, status, runs) VALUES ($1, $2, $3) \
         ON CONFLICT (sweep, status) DO UPDATE SET runs = tallies.runs + $3"
    };
    let changed = sqlx::query(sql).bind(sweep).bind(state).bind(runs).execute(connection).await?;
    if changed.rows_affected() == 0 { Err(sqlx::Error::RowNotFound) } else { Ok(()) }
}

/// Ends a sweep that has nothing queued and nothing under way; whether it has ended.
async fn settle(connection: &mut Connection, sweep: i64) -> sqlx::Result<bool> {
    let left: i64 = sqlx::query_scalar(
        "SELECT COALESCE(SUM(runs), 0) FROM tallies \
         WHERE sweep = $1 AND status IN ('queued', 'running')",
    )
    .bind(sweep)
    .fetch_one(&mut *connection)
    .await?;
    if left == 0 {
        sqlx::query("UPDATE sweeps SET phase = 'ended' WHERE sweep = $1 AND phase <> 'deleted'")
            .bind(sweep)
            .execute(connection)
            .await?;
    }
    Ok(left == 0)
}

/// Puts the statuses of solved runs into the counts, in place of running ones.
async fn count_ended(
    connection: &mut Connection,
    sweep: i64,
    statuses: impl Iterator<Item = Status>,
) -> sqlx::Result<()> {
    let mut runs = [0_i64; Status::STORED.len()];
    for status in statuses {
        if let Some(i) = Status::STORED.iter().position(|s| *s == status) {
            runs[i] += 1;
        }
    }
    for (status, runs) in Status::STORED.iter().zip(runs).filter(|(_, runs)| *runs > 0) {
        move_runs(connection, sweep, Pending::Running.name(), status.name(), runs).await?;
    }
    Ok(())
}

/// Writes a sweep's phase.
async fn set_phase(connection: &mut Connection, sweep: i64, phase: Phase) -> sqlx::Result<()> {
    sqlx::query("UPDATE sweeps SET phase = $1 WHERE sweep = $2")
        .bind(phase.name())
        .bind(sweep)
        .execute(connection)
        .await?;
    Ok(())
}

/// Now, in milliseconds since 1970.
fn now_ms() -> i64 {
    let since = std::time::SystemTime::UNIX_EPOCH.elapsed().unwrap_or_default();
    i64::try_from(since.as_millis()).unwrap_or(i64::MAX)
}
