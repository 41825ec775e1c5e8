//! Leases: who works on which chunk. Between sweeps, the higher priority goes first; among equals, the one
//! with the fewest chunks under way, then the one whose last turn is longest ago.

use super::{count_ended, move_runs, now_ms, settle};
use crate::domain::status::{Pending, Status};
use crate::store::{Connection, Store};
use sqlx::Row;
use uuid::Uuid;

/// A chunk held by a worker.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Lease {
    /// The sweep's number.
    pub sweep: i64,
    /// The sweep's id.
    pub sweep_id: String,
    /// Number of the chunk within the sweep.
    pub chunk: i64,
    /// Index of the first run of its stretch.
    pub first_run: usize,
    /// Index after the last one.
    pub end_run: usize,
    /// Runs of the stretch.
    pub run_count: usize,
    /// Proof of holding it.
    pub token: String,
}

/// The lease is no longer this worker's; its work is not to be stored.
#[derive(Debug, thiserror::Error)]
#[error("the lease on chunk {chunk} of sweep {sweep_id} is lost")]
pub struct LeaseLost {
    sweep_id: String,
    chunk: i64,
}

/// The sweep whose turn it is and its first queued chunk.
const NEXT: &str = "SELECT s.sweep, s.id, c.chunk, c.first_run, c.end_run, c.run_count \
    FROM sweeps s JOIN chunks c ON c.sweep = s.sweep AND c.state = 'queued' AND c.chunk = ( \
        SELECT MIN(q.chunk) FROM chunks q WHERE q.state = 'queued' AND q.sweep = s.sweep) \
    WHERE s.phase = 'open' \
    ORDER BY s.priority DESC, \
        (SELECT COUNT(*) FROM chunks l WHERE l.state = 'leased' AND l.sweep = s.sweep), \
        s.turn, s.sweep \
    LIMIT 1";

/// Takes the next chunk, if there is one, in a transaction of its own.
pub async fn lease(store: &Store) -> sqlx::Result<Option<Lease>> {
    // Looked up first without the writer's lock: most looks of an idle service find nothing.
    if sqlx::query(NEXT).fetch_optional(&mut *store.read().await?).await?.is_none() {
        return Ok(None);
    }
    let mut tx = store.write().await?;
    let lease = take(&mut tx).await?;
    tx.commit().await?;
    Ok(lease)
}

/// Takes the next chunk, if there is one, within the caller's transaction.
pub async fn take(connection: &mut Connection) -> sqlx::Result<Option<Lease>> {
    let Some(row) = sqlx::query(NEXT).fetch_optional(&mut *connection).await? else {
        return Ok(None);
    };
    let lease = Lease {
        sweep: row.get("sweep"),
        sweep_id: row.get("id"),
        chunk: row.get("chunk"),
        first_run: row.get::<i64, _>("first_run") as usize,
        end_run: row.get::<i64, _>("end_run") as usize,
        run_count: row.get::<i64, _>("run_count") as usize,
        token: Uuid::now_v7().simple().to_string(),
    };
    sqlx::query(
        "UPDATE chunks SET state = 'leased', lease_token = $1 WHERE sweep = $2 AND chunk = $3",
    )
    .bind(&lease.token)
    .bind(lease.sweep)
    .bind(lease.chunk)
    .execute(&mut *connection)
    .await?;
    sqlx::query("UPDATE sweeps SET turn = 1 + (SELECT MAX(t.turn) FROM sweeps t) WHERE sweep = $1")
        .bind(lease.sweep)
        .execute(&mut *connection)
        .await?;
    let runs = lease.run_count as i64;
    let (queued, running) = (Pending::Queued.name(), Pending::Running.name());
    move_runs(connection, lease.sweep, queued, running, runs).await?;
    Ok(Some(lease))
}

/// Whether a lease is still held.
pub async fn holds(connection: &mut Connection, lease: &Lease) -> sqlx::Result<bool> {
    let held: i64 = sqlx::query_scalar(
        "SELECT COUNT(*) FROM chunks WHERE sweep = $1 AND chunk = $2 AND lease_token = $3",
    )
    .bind(lease.sweep)
    .bind(lease.chunk)
    .bind(&lease.token)
    .fetch_one(connection)
    .await?;
    Ok(held > 0)
}

/// Marks a chunk done and counts its runs, within the transaction that stores them; `reused` of them were
/// taken over from other sweeps. Tells whether the sweep has ended with it. Refused if the lease is lost; the
/// caller then rolls back.
pub async fn finish(
    connection: &mut Connection,
    lease: &Lease,
    statuses: impl Iterator<Item = Status>,
    reused: usize,
) -> sqlx::Result<Result<bool, LeaseLost>> {
    let changed = sqlx::query(
        "UPDATE chunks SET state = 'done', lease_token = NULL, ended_ms = $4 \
         WHERE sweep = $1 AND chunk = $2 AND state = 'leased' AND lease_token = $3",
    )
    .bind(lease.sweep)
    .bind(lease.chunk)
    .bind(&lease.token)
    .bind(now_ms())
    .execute(&mut *connection)
    .await?
    .rows_affected();
    if changed == 0 {
        return Ok(Err(LeaseLost { sweep_id: lease.sweep_id.clone(), chunk: lease.chunk }));
    }
    count_ended(connection, lease.sweep, statuses).await?;
    sqlx::query("UPDATE sweeps SET reused = reused + $1, is_compact = 0 WHERE sweep = $2")
        .bind(reused as i64)
        .bind(lease.sweep)
        .execute(&mut *connection)
        .await?;
    Ok(Ok(settle(connection, lease.sweep).await?))
}

/// Keeps how long a unit of work took, as a moving average.
pub async fn measured(
    connection: &mut Connection,
    regime: &str,
    seconds_per_unit: f64,
) -> sqlx::Result<()> {
    sqlx::query(
        "INSERT INTO measured_rates (regime, seconds_per_unit) VALUES ($1, $2) \
         ON CONFLICT (regime) DO UPDATE \
         SET seconds_per_unit = 0.8 * measured_rates.seconds_per_unit + 0.2 * excluded.seconds_per_unit",
    )
    .bind(regime)
    .bind(seconds_per_unit)
    .execute(connection)
    .await?;
    Ok(())
}

/// Gives a chunk back that was not stored; whether it was held, since a lost lease is nothing to give back.
pub async fn give_back(store: &Store, lease: &Lease) -> sqlx::Result<bool> {
    let mut tx = store.write().await?;
    let is_held = holds(&mut tx, lease).await?;
    if is_held {
        take_back(&mut tx, lease.sweep, lease.chunk, lease.run_count as i64).await?;
        tx.commit().await?;
    }
    Ok(is_held)
}

/// Queues a leased chunk again, or cancels it if its sweep is stopping.
async fn take_back(
    connection: &mut Connection,
    sweep: i64,
    chunk: i64,
    runs: i64,
) -> sqlx::Result<()> {
    let phase: String = sqlx::query_scalar("SELECT phase FROM sweeps WHERE sweep = $1")
        .bind(sweep)
        .fetch_one(&mut *connection)
        .await?;
    let is_stopping = phase == "stopping";
    let to = if is_stopping { Pending::Cancelled } else { Pending::Queued };
    sqlx::query("UPDATE chunks SET state = $1, lease_token = NULL WHERE sweep = $2 AND chunk = $3")
        .bind(to.name())
        .bind(sweep)
        .bind(chunk)
        .execute(&mut *connection)
        .await?;
    move_runs(connection, sweep, Pending::Running.name(), to.name(), runs).await?;
    settle(connection, sweep).await.map(drop)
}

/// Takes all leases back. The data directory belongs to one process, so at its start every lease is
/// a dead one's.
pub async fn reclaim(store: &Store) -> sqlx::Result<usize> {
    let mut tx = store.write().await?;
    let leased = sqlx::query("SELECT sweep, chunk, run_count FROM chunks WHERE state = 'leased'")
        .fetch_all(&mut *tx)
        .await?;
    for row in &leased {
        take_back(&mut tx, row.get("sweep"), row.get("chunk"), row.get("run_count")).await?;
    }
    tx.commit().await?;
    Ok(leased.len())
}
