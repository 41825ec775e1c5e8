//! Submission: a sweep becomes rows of chunks.

use super::add_runs;
use super::look::seconds_per_unit;
use crate::domain::status::{Pending, Phase};
use crate::domain::sweep::SweepSpec;
use crate::store::{Connection, Store};
use sqlx::{QueryBuilder, Row, Sqlite};
use std::sync::Arc;
use uuid::Uuid;

/// What a submission says beside the sweep.
#[derive(Debug, Clone, Default)]
pub struct Submission {
    /// Number of threads that will solve.
    pub workers: usize,
    /// Runs found in the archive.
    pub found: usize,
    /// The client's key and the hash of what it sent with it.
    pub idempotency: Option<(String, String)>,
}

/// A sweep that was taken.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Enqueued {
    /// Its id.
    pub id: String,
    /// Its runs.
    pub count: usize,
    /// Runs found in the archive.
    pub found: usize,
    /// Hash of what was sent, if it came with a key.
    pub digest: Option<String>,
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
/// Most runs of a chunk: one commit stores them all.
const MAX_CHUNK_RUNS: usize = 1_000;

/// Puts a sweep into the queue, unless its key is known: then the sweep that came with it is told.
pub async fn enqueue(
    store: &Store,
    sweep: &Arc<SweepSpec>,
    submission: Submission,
) -> Result<Enqueued, EnqueueError> {
    let Submission { workers, found, idempotency } = submission;
    let total = sweep.count();
    let created_at = humantime::format_rfc3339_millis(std::time::SystemTime::now()).to_string();
    let seconds_per_unit = seconds_per_unit(&mut *store.read().await?, &sweep.run(0)).await?;
    let most = total.div_ceil(CHUNKS_PER_WORKER * workers.max(1)).clamp(1, MAX_CHUNK_RUNS);
    let cut = sweep.clone();
    let (stretches, document, summary) = tokio::task::spawn_blocking(move || {
        let document = serde_json::to_string(cut.document()).expect("a document is plain data");
        let summary = cut.document().summary(&document);
        (cut.stretches(CHUNK_SECONDS / seconds_per_unit, most), document, summary)
    })
    .await?;
    let (key, digest) = idempotency.unzip();
    let mut tx = store.write().await?;
    if let Some(key) = &key
        && let Some(known) = known_submission(&mut tx, key).await?
    {
        return Ok(known);
    }
    let number: i64 = sqlx::query_scalar("SELECT COALESCE(MAX(sweep), 0) + 1 FROM sweeps")
        .fetch_one(&mut *tx)
        .await?;
    let id = Uuid::now_v7().simple().to_string();
    sqlx::query(
        "INSERT INTO sweeps (sweep, id, name, axis_names, priority, is_forced, phase, total, reused, \
         found, turn, is_compact, idempotency_key, submission_digest, created_at) \
         SELECT $1, $2, $3, $4, $5, $6, $7, $8, 0, $9, COALESCE(MAX(turn), 0), 1, $10, $11, $12 FROM sweeps",
    )
    .bind(number)
    .bind(&id)
    .bind(sweep.name())
    .bind(sweep.varied().join(","))
    .bind(sweep.priority())
    .bind(i64::from(sweep.is_forced()))
    .bind(Phase::Open.name())
    .bind(total as i64)
    .bind(found as i64)
    .bind(&key)
    .bind(&digest)
    .bind(created_at)
    .execute(&mut *tx)
    .await?;
    sqlx::query("INSERT INTO documents (sweep, document, summary) VALUES ($1, $2, $3)")
        .bind(number)
        .bind(document)
        .bind(summary)
        .execute(&mut *tx)
        .await?;
    for tag in sweep.tags() {
        sqlx::query("INSERT INTO tags (sweep, tag) VALUES ($1, $2)")
            .bind(number)
            .bind(tag)
            .execute(&mut *tx)
            .await?;
    }
    /// Chunks per statement.
    const BATCH: usize = 5_000;
    for (batch, stretches) in stretches.chunks(BATCH).enumerate() {
        let mut insert = QueryBuilder::<Sqlite>::new(
            "INSERT INTO chunks (sweep, chunk, first_run, end_run, run_count, state) ",
        );
        insert.push_values(stretches.iter().enumerate(), |mut row, (i, stretch)| {
            row.push_bind(number)
                .push_bind((batch * BATCH + i) as i64)
                .push_bind(stretch.start as i64)
                .push_bind(stretch.end as i64)
                .push_bind(stretch.len() as i64)
                .push_bind("queued");
        });
        insert.build().execute(&mut *tx).await?;
    }
    add_runs(&mut tx, number, Pending::Queued.name(), total as i64).await?;
    tx.commit().await?;
    Ok(Enqueued { id, count: total, found, digest })
}

/// The sweep that came with an idempotency key.
pub async fn known_submission(
    connection: &mut Connection,
    key: &str,
) -> sqlx::Result<Option<Enqueued>> {
    let row = sqlx::query(
        "SELECT id, total, found, submission_digest FROM sweeps WHERE idempotency_key = $1",
    )
    .bind(key)
    .fetch_optional(connection)
    .await?;
    Ok(row.map(|row| Enqueued {
        id: row.get("id"),
        count: row.get::<i64, _>("total") as usize,
        found: row.get::<i64, _>("found") as usize,
        digest: row.get("submission_digest"),
    }))
}
