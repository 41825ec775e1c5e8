//! Submission: a sweep becomes rows of chunks.

use super::add_runs;
use super::look::seconds_per_unit;
use crate::domain::status::{Pending, Phase};
use crate::domain::sweep::SweepSpec;
use crate::people;
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
    /// Who submits it.
    pub owner: String,
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
    /// Its owner may not have so many runs.
    #[error("{owner} may have {most} runs{what}, and it would be {would}")]
    Quota {
        /// Who.
        owner: String,
        /// At most so many.
        most: i64,
        /// Which ones: all, or those waiting or under way.
        what: &'static str,
        /// So many it would be.
        would: i64,
    },
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
    let Submission { workers, found, idempotency, owner } = submission;
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
    let (key, digest) = idempotency.map(|(key, digest)| (own_key(&owner, &key), digest)).unzip();
    let mut tx = store.write().await?;
    if let Some(key) = &key
        && let Some(known) = known_by(&mut tx, key).await?
    {
        return Ok(known);
    }
    check_quota(&mut tx, &owner, total as i64, total as i64).await?;
    let number: i64 = sqlx::query_scalar("SELECT COALESCE(MAX(sweep), 0) + 1 FROM sweeps")
        .fetch_one(&mut *tx)
        .await?;
    let id = Uuid::now_v7().simple().to_string();
    sqlx::query(
        "INSERT INTO sweeps (sweep, id, name, axis_names, priority, is_forced, phase, total, reused, \
         found, turn, is_compact, idempotency_key, submission_digest, created_at, owner, regime) \
         SELECT $1, $2, $3, $4, $5, $6, $7, $8, 0, $9, COALESCE(MAX(turn), 0), 1, $10, $11, $12, $13, $14 FROM sweeps",
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
    .bind(&owner)
    .bind(sweep.regime().name())
    .execute(&mut *tx)
    .await?;
    describe(&mut tx, number, sweep, document, summary, sweep.tags()).await?;
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
    people::audit(&mut tx, &owner, "submit", &id, Some(sweep.name())).await?;
    tx.commit().await?;
    Ok(Enqueued { id, count: total, found, digest })
}

/// Writes down what was submitted, the ranges of its parameters, and its tags.
pub(super) async fn describe(
    connection: &mut Connection,
    number: i64,
    sweep: &SweepSpec,
    document: String,
    summary: Option<String>,
    tags: &[String],
) -> sqlx::Result<()> {
    for (parameter, low, high) in sweep.ranges() {
        sqlx::query(
            "INSERT INTO sweep_ranges (parameter, sweep, low, high) VALUES ($1, $2, $3, $4)",
        )
        .bind(parameter)
        .bind(number)
        .bind(low)
        .bind(high)
        .execute(&mut *connection)
        .await?;
    }
    sqlx::query("INSERT INTO documents (sweep, document, summary) VALUES ($1, $2, $3)")
        .bind(number)
        .bind(document)
        .bind(summary)
        .execute(&mut *connection)
        .await?;
    for tag in tags {
        sqlx::query("INSERT INTO tags (sweep, tag) VALUES ($1, $2)")
            .bind(number)
            .bind(tag)
            .execute(&mut *connection)
            .await?;
    }
    Ok(())
}

/// Refuses so many more runs, some of them pending, where they are beyond what their owner may have, or where that is exceeded already. Sweeps in the trash do not count.
pub async fn check_quota(
    connection: &mut Connection,
    owner: &str,
    count: i64,
    pending: i64,
) -> Result<(), EnqueueError> {
    let quota = people::one(connection, owner).await?.map(|p| p.quota).unwrap_or_default();
    if quota == people::Quota::default() {
        return Ok(());
    }
    let row = sqlx::query(
        "SELECT COALESCE(SUM(s.total), 0) AS runs, COALESCE(SUM((SELECT SUM(t.runs) FROM tallies t \
             WHERE t.sweep = s.sweep AND t.status IN ('queued', 'running'))), 0) AS pending \
         FROM sweeps s WHERE s.owner = $1 AND s.trashed_ms IS NULL AND s.phase <> 'deleted'",
    )
    .bind(owner)
    .fetch_one(connection)
    .await?;
    for (most, would, what) in [
        (quota.most_runs, row.get::<i64, _>("runs") + count, ""),
        (quota.most_pending_runs, row.get::<i64, _>("pending") + pending, " waiting or under way"),
    ] {
        if let Some(most) = most.filter(|most| would > *most) {
            return Err(EnqueueError::Quota { owner: owner.into(), most, what, would });
        }
    }
    Ok(())
}

/// The sweep that came from a person with an idempotency key.
pub async fn known_submission(
    connection: &mut Connection,
    owner: &str,
    key: &str,
) -> sqlx::Result<Option<Enqueued>> {
    known_by(connection, &own_key(owner, key)).await
}

/// A key as it is stored: everybody has keys of their own. No name has a line's end in it.
fn own_key(owner: &str, key: &str) -> String {
    format!("{owner}\n{key}")
}

async fn known_by(connection: &mut Connection, key: &str) -> sqlx::Result<Option<Enqueued>> {
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
