//! All the queue's SQL. The unit is the chunk: a stretch of a sweep's runs that one worker solves in
//! order. Knows no solver and no transport.

use crate::domain::status::{Counts, Status};
use crate::domain::sweep::SweepSpec;
use crate::store::{Connection, Store};
use sqlx::{QueryBuilder, Row, Sqlite};
use std::sync::Arc;
use uuid::Uuid;

/// A chunk held by a worker.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Lease {
    /// The sweep's id.
    pub sweep_id: String,
    /// Number of the chunk within the sweep.
    pub chunk: i64,
    /// Index of its first run.
    pub first_run: usize,
    /// Number of its runs.
    pub run_count: usize,
    /// Proof of holding it.
    pub token: String,
}

/// A sweep as the queue knows it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SweepRow {
    /// Id, ascending in time.
    pub id: String,
    /// Name, for people.
    pub name: String,
    /// The document, as JSON.
    pub document: String,
    /// When it was submitted, RFC 3339 in UTC.
    pub created_at: String,
    /// Its runs by state.
    pub counts: Counts,
}

/// The lease is no longer this worker's; its work is not to be stored.
#[derive(Debug, thiserror::Error)]
#[error("the lease on chunk {chunk} of sweep {sweep_id} is lost")]
pub struct LeaseLost {
    sweep_id: String,
    chunk: i64,
}

/// A sweep could not be queued.
#[derive(Debug, thiserror::Error)]
pub enum EnqueueError {
    /// The database refused.
    #[error("the queue cannot be written: {0}")]
    Database(#[from] sqlx::Error),
    /// Cutting the sweep into chunks broke off.
    #[error("cutting the sweep into chunks broke off: {0}")]
    Broken(#[from] tokio::task::JoinError),
}

/// Measured work that a chunk should hold, s.
const CHUNK_SECONDS: f64 = 0.2;
/// Chunks per worker that a sweep is cut into at least, if it has the runs.
const CHUNKS_PER_WORKER: usize = 4;
/// Most runs of a chunk: a row of the catalogue has 33 values, and a statement takes 32,766.
const MAX_CHUNK_RUNS: usize = 500;
/// Seconds per cell of a steady or diagnostic run, and per cell and step of a transient, until
/// measured.
const FIRST_GUESS_SECONDS: [f64; 2] = [1e-4, 1e-5];

/// Puts a sweep into the queue and returns its id.
pub async fn enqueue(
    store: &Store,
    sweep: &Arc<SweepSpec>,
    workers: usize,
) -> Result<String, EnqueueError> {
    let id = Uuid::now_v7().simple().to_string();
    let total = sweep.count();
    let document = serde_json::to_string(sweep.document()).expect("a document is plain data");
    let created_at = humantime::format_rfc3339_millis(std::time::SystemTime::now()).to_string();
    let seconds_per_unit = seconds_per_unit(&mut *store.read().await?, &sweep.run(0)).await?;
    let most = total.div_ceil(CHUNKS_PER_WORKER * workers).clamp(1, MAX_CHUNK_RUNS);
    let cut = sweep.clone();
    let stretches =
        tokio::task::spawn_blocking(move || cut.stretches(CHUNK_SECONDS / seconds_per_unit, most))
            .await?;
    let mut tx = store.write().await?;
    sqlx::query(
        "INSERT INTO sweeps (id, name, document, total, created_at) VALUES ($1, $2, $3, $4, $5)",
    )
    .bind(&id)
    .bind(sweep.name())
    .bind(document)
    .bind(total as i64)
    .bind(created_at)
    .execute(&mut *tx)
    .await?;
    /// Chunks per statement.
    const BATCH: usize = 5_000;
    for (batch, stretches) in stretches.chunks(BATCH).enumerate() {
        let mut insert = QueryBuilder::<Sqlite>::new(
            "INSERT INTO chunks (sweep_id, chunk, first_run, run_count, state) ",
        );
        insert.push_values(stretches.iter().enumerate(), |mut row, (i, stretch)| {
            row.push_bind(&id)
                .push_bind((batch * BATCH + i) as i64)
                .push_bind(stretch.start as i64)
                .push_bind(stretch.len() as i64)
                .push_bind("queued");
        });
        insert.build().execute(&mut *tx).await?;
    }
    tx.commit().await?;
    Ok(id)
}

async fn seconds_per_unit(
    connection: &mut Connection,
    run: &crate::domain::run::RunSpec,
) -> sqlx::Result<f64> {
    let measured: Option<f64> =
        sqlx::query_scalar("SELECT seconds_per_unit FROM measured_rates WHERE regime = $1")
            .bind(run.shared.regime.name())
            .fetch_optional(connection)
            .await?;
    let guess = FIRST_GUESS_SECONDS[usize::from(run.shared.steps.is_some())];
    Ok(measured.filter(|s| *s > 0.0).unwrap_or(guess))
}

/// Takes the next chunk of the oldest sweep that has one.
pub async fn lease(store: &Store) -> sqlx::Result<Option<Lease>> {
    let token = Uuid::now_v7().simple().to_string();
    let mut tx = store.write().await?;
    let row = sqlx::query(
        "UPDATE chunks SET state = 'leased', lease_token = $1 \
         WHERE (sweep_id, chunk) IN ( \
             SELECT sweep_id, chunk FROM chunks WHERE state = 'queued' \
             ORDER BY sweep_id, chunk LIMIT 1) \
         RETURNING sweep_id, chunk, first_run, run_count",
    )
    .bind(&token)
    .fetch_optional(&mut *tx)
    .await?;
    tx.commit().await?;
    Ok(row.map(|row| Lease {
        sweep_id: row.get("sweep_id"),
        chunk: row.get("chunk"),
        first_run: row.get::<i64, _>("first_run") as usize,
        run_count: row.get::<i64, _>("run_count") as usize,
        token,
    }))
}

/// Marks a chunk done and counts its runs, within the transaction that stores them. Refused if the
/// lease is lost; the caller then rolls back.
pub async fn finish(
    connection: &mut Connection,
    lease: &Lease,
    statuses: impl Iterator<Item = Status>,
) -> sqlx::Result<Result<(), LeaseLost>> {
    let changed = sqlx::query(
        "UPDATE chunks SET state = 'done', lease_token = NULL \
         WHERE sweep_id = $1 AND chunk = $2 AND state = 'leased' AND lease_token = $3",
    )
    .bind(&lease.sweep_id)
    .bind(lease.chunk)
    .bind(&lease.token)
    .execute(&mut *connection)
    .await?
    .rows_affected();
    if changed == 0 {
        return Ok(Err(LeaseLost { sweep_id: lease.sweep_id.clone(), chunk: lease.chunk }));
    }
    let mut runs = [0_i64; Status::STORED.len()];
    for status in statuses {
        if let Some(i) = Status::STORED.iter().position(|s| *s == status) {
            runs[i] += 1;
        }
    }
    for (status, runs) in Status::STORED.iter().zip(runs).filter(|(_, runs)| *runs > 0) {
        sqlx::query(
            "INSERT INTO tallies (sweep_id, status, runs) VALUES ($1, $2, $3) \
             ON CONFLICT (sweep_id, status) DO UPDATE SET runs = tallies.runs + excluded.runs",
        )
        .bind(&lease.sweep_id)
        .bind(status.name())
        .bind(runs)
        .execute(&mut *connection)
        .await?;
    }
    Ok(Ok(()))
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

/// Gives a chunk back that could not be stored.
pub async fn give_back(store: &Store, lease: &Lease) -> sqlx::Result<()> {
    let mut tx = store.write().await?;
    sqlx::query(
        "UPDATE chunks SET state = 'queued', lease_token = NULL \
         WHERE sweep_id = $1 AND chunk = $2 AND lease_token = $3",
    )
    .bind(&lease.sweep_id)
    .bind(lease.chunk)
    .bind(&lease.token)
    .execute(&mut *tx)
    .await?;
    tx.commit().await
}

/// Takes all leases back. The data directory belongs to one process, so at its start every lease is
/// a dead one's.
pub async fn reclaim(store: &Store) -> sqlx::Result<u64> {
    let mut tx = store.write().await?;
    let reclaimed = sqlx::query(
        "UPDATE chunks SET state = 'queued', lease_token = NULL WHERE state = 'leased'",
    )
    .execute(&mut *tx)
    .await?
    .rows_affected();
    tx.commit().await?;
    Ok(reclaimed)
}

/// A sweep by id.
pub async fn sweep(connection: &mut Connection, id: &str) -> sqlx::Result<Option<SweepRow>> {
    let row = sqlx::query("SELECT id, name, document, total, created_at FROM sweeps WHERE id = $1")
        .bind(id)
        .fetch_optional(&mut *connection)
        .await?;
    match row {
        Some(row) => Ok(Some(with_counts(connection, &row).await?)),
        None => Ok(None),
    }
}

/// Sweeps from the newest to the oldest, and how many there are.
pub async fn sweeps(
    connection: &mut Connection,
    limit: i64,
    offset: i64,
) -> sqlx::Result<(Vec<SweepRow>, i64)> {
    let rows = sqlx::query(
        "SELECT id, name, document, total, created_at FROM sweeps ORDER BY id DESC LIMIT $1 OFFSET $2",
    )
    .bind(limit)
    .bind(offset)
    .fetch_all(&mut *connection)
    .await?;
    let mut sweeps = Vec::with_capacity(rows.len());
    for row in &rows {
        sweeps.push(with_counts(connection, row).await?);
    }
    let total = sqlx::query_scalar("SELECT COUNT(*) FROM sweeps").fetch_one(connection).await?;
    Ok((sweeps, total))
}

async fn with_counts(
    connection: &mut Connection,
    row: &sqlx::sqlite::SqliteRow,
) -> sqlx::Result<SweepRow> {
    let id: String = row.get("id");
    let mut counts = Counts { total: row.get("total"), ..Counts::default() };
    let waiting = sqlx::query(
        "SELECT state, SUM(run_count) AS runs FROM chunks \
         WHERE state IN ('queued', 'leased') AND sweep_id = $1 GROUP BY state",
    )
    .bind(&id)
    .fetch_all(&mut *connection)
    .await?;
    for row in waiting {
        match row.get::<&str, _>("state") {
            "queued" => counts.queued = row.get("runs"),
            _ => counts.running = row.get("runs"),
        }
    }
    let ended = sqlx::query("SELECT status, runs FROM tallies WHERE sweep_id = $1")
        .bind(&id)
        .fetch_all(connection)
        .await?;
    for row in ended {
        if let Some(status) = Status::from_name(row.get("status")) {
            counts.add(status, row.get("runs"));
        }
    }
    Ok(SweepRow {
        id,
        name: row.get("name"),
        document: row.get("document"),
        created_at: row.get("created_at"),
        counts,
    })
}
