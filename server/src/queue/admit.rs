//! A sweep that comes with its results.

use super::submit::describe;
use super::{add_runs, move_runs};
use crate::domain::status::{Pending, Phase, Status};
use crate::domain::sweep::SweepSpec;
use crate::store::Connection;
use std::ops::Range;

/// A sweep from elsewhere.
#[derive(Debug)]
pub struct Admission<'a> {
    /// The id it is to have.
    pub id: &'a str,
    /// Its points and its document.
    pub sweep: &'a SweepSpec,
    /// What it is called now.
    pub name: &'a str,
    /// Words to find it by.
    pub tags: &'a [String],
    /// Its note, in Markdown.
    pub note: Option<&'a str>,
    /// Who brings it.
    pub owner: &'a str,
    /// When it was submitted where it comes from.
    pub created_at: &'a str,
    /// Hash of its data.
    pub content_hash: &'a str,
    /// Its id where it comes from.
    pub source_id: &'a str,
    /// Who submitted it there.
    pub source_owner: Option<&'a str>,
    /// Its runs by how they ended.
    pub ended: Vec<(Status, i64)>,
    /// Stretches of runs that have a result, the chunks of the sweep.
    pub done: &'a [Range<i64>],
    /// Stretches of those that have none.
    pub missing: &'a [Range<i64>],
}

/// Whether no sweep has an id.
pub async fn is_id_free(connection: &mut Connection, id: &str) -> sqlx::Result<bool> {
    let found: Option<i64> = sqlx::query_scalar("SELECT 1 FROM sweeps WHERE id = $1")
        .bind(id)
        .fetch_optional(connection)
        .await?;
    Ok(found.is_none())
}

/// Adds a sweep that has ended, and tells its number: chunk by chunk done, and cancelled where it has no results.
pub async fn admit(connection: &mut Connection, admission: &Admission<'_>) -> sqlx::Result<i64> {
    let Admission { id, sweep, owner, created_at, .. } = admission;
    let total = sweep.count() as i64;
    let number: i64 = sqlx::query_scalar("SELECT COALESCE(MAX(sweep), 0) + 1 FROM sweeps")
        .fetch_one(&mut *connection)
        .await?;
    sqlx::query(
        "INSERT INTO sweeps (sweep, id, name, axis_names, priority, is_forced, phase, total, reused, \
         found, turn, is_compact, created_at, owner, regime, note) \
         SELECT $1, $2, $3, $4, 0, 0, $5, $6, 0, 0, COALESCE(MAX(turn), 0), 1, $7, $8, $9, $10 FROM sweeps",
    )
    .bind(number)
    .bind(id)
    .bind(admission.name)
    .bind(sweep.varied().join(","))
    .bind(Phase::Ended.name())
    .bind(total)
    .bind(created_at)
    .bind(owner)
    .bind(sweep.regime().name())
    .bind(admission.note)
    .execute(&mut *connection)
    .await?;
    let document =
        serde_json::to_string(sweep.document()).map_err(|e| sqlx::Error::Encode(Box::new(e)))?;
    let summary = sweep.document().summary(&document);
    describe(connection, number, sweep, document, summary, admission.tags).await?;
    let done = admission.done.iter().map(|stretch| (stretch, "done"));
    let cancelled = admission.missing.iter().map(|stretch| (stretch, Pending::Cancelled.name()));
    for (chunk, (stretch, state)) in (0_i64..).zip(done.chain(cancelled)) {
        sqlx::query(
            "INSERT INTO chunks (sweep, chunk, first_run, end_run, run_count, state) \
             VALUES ($1, $2, $3, $4, $5, $6)",
        )
        .bind(number)
        .bind(chunk)
        .bind(stretch.start)
        .bind(stretch.end)
        .bind(stretch.end - stretch.start)
        .bind(state)
        .execute(&mut *connection)
        .await?;
    }
    add_runs(connection, number, Pending::Cancelled.name(), total).await?;
    for (status, runs) in &admission.ended {
        move_runs(connection, number, Pending::Cancelled.name(), status.name(), *runs).await?;
    }
    let now = humantime::format_rfc3339_millis(std::time::SystemTime::now()).to_string();
    sqlx::query(
        "INSERT INTO imports (sweep, content_hash, source_id, source_owner, imported_at, imported_by) \
         VALUES ($1, $2, $3, $4, $5, $6)",
    )
    .bind(number)
    .bind(admission.content_hash)
    .bind(admission.source_id)
    .bind(admission.source_owner)
    .bind(now)
    .bind(owner)
    .execute(connection)
    .await?;
    Ok(number)
}
