//! Looking at sweeps: counts, lists, pace.

use super::now_ms;
use crate::domain::run::RunSpec;
use crate::domain::seal::Seal;
use crate::domain::status::{Counts, Phase, SweepState};
use crate::store::Connection;
use serde::{Deserialize, Serialize};
use sqlx::sqlite::SqliteRow;
use sqlx::{QueryBuilder, Row, Sqlite};
use std::collections::HashMap;
use utoipa::ToSchema;

/// A sweep as the queue knows it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SweepRow {
    /// Number, for other tables.
    pub number: i64,
    /// Id, ascending in time.
    pub id: String,
    /// Name, for people.
    pub name: String,
    /// The document as JSON; in lists without long lists of its own.
    pub document: String,
    /// Whether `document` leaves something out.
    pub is_cut: bool,
    /// Parameters that vary, with commas between.
    pub axis_names: String,
    /// When it was submitted, RFC 3339 in UTC.
    pub created_at: String,
    /// Higher ones go first.
    pub priority: i64,
    /// Who submitted it; none if that was before there were owners.
    pub owner: Option<String>,
    /// Since when it lies in the trash, ms since 1970.
    pub trashed_ms: Option<i64>,
    /// Words to find it by.
    pub tags: Vec<String>,
    /// Its note in Markdown, in lists the beginning of a long one; none if it has none.
    pub note: Option<String>,
    /// Whether `note` leaves something out.
    pub note_is_cut: bool,
    /// Whether its runs are solved although they are known.
    pub is_forced: bool,
    /// Runs taken over from other sweeps so far.
    pub reused: i64,
    /// What it waits for.
    pub phase: Phase,
    /// Its runs by state.
    pub counts: Counts,
    /// What it is cited by, if it is sealed.
    pub seal: Option<Seal>,
    /// Where it came from, if it was not submitted here.
    pub imported: Option<Imported>,
}

/// Where a sweep came from.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
pub struct Imported {
    /// Its id there.
    id: String,
    /// Who submitted it there.
    owner: Option<String>,
    /// When it came, RFC 3339 in UTC.
    imported_at: String,
    /// Who brought it.
    imported_by: String,
}

impl SweepRow {
    /// The parameters that vary.
    pub fn axes(&self) -> Vec<&str> {
        self.axis_names.split(',').filter(|name| !name.is_empty()).collect()
    }

    /// The state that users see.
    pub fn state(&self) -> SweepState {
        self.phase.state(&self.counts)
    }
}

/// Which sweeps a list holds.
#[derive(Debug, Clone, Copy, Default)]
pub struct Which {
    /// Those in the trash, in place of the others.
    pub is_trash: bool,
    /// At most so many.
    pub limit: i64,
    /// After so many.
    pub offset: i64,
}

/// How fast a sweep goes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pace {
    /// Runs that ended per second, lately.
    pub runs_per_s: f64,
    /// Seconds until the rest has ended, at this rate.
    pub seconds_left: f64,
}

/// Period whose chunks tell the pace, ms.
const LATELY_MS: i64 = 10_000;
/// Seconds per cell of a steady or diagnostic run, and per cell and step of a transient, until
/// measured.
const FIRST_GUESS_SECONDS: [f64; 2] = [6e-6, 2e-6];

/// Seconds per unit of work (see [`RunSpec::work`]) of runs like this one: measured, or a guess.
pub async fn seconds_per_unit(connection: &mut Connection, run: &RunSpec) -> sqlx::Result<f64> {
    let measured: Option<f64> =
        sqlx::query_scalar("SELECT seconds_per_unit FROM measured_rates WHERE regime = $1")
            .bind(run.shared.regime.name())
            .fetch_optional(connection)
            .await?;
    let guess = FIRST_GUESS_SECONDS[usize::from(run.shared.steps.is_some())];
    Ok(measured.filter(|s| *s > 0.0).unwrap_or(guess))
}

/// A sweep's columns: the whole document, or what is left of a long one in brief; then the rest, of sweeps
/// that are not deleted.
const WHOLE: &str = "SELECT s.sweep, id, name, document, 0 AS is_cut, note, 0 AS note_is_cut";
const BRIEF: &str = "SELECT s.sweep, id, name, COALESCE(summary, document) AS document, \
                      CASE WHEN summary IS NULL THEN 0 ELSE 1 END AS is_cut, SUBSTR(note, 1, 200) AS note, \
                      CASE WHEN LENGTH(note) > 200 THEN 1 ELSE 0 END AS note_is_cut";
const COLUMNS: &str =
    ", axis_names, created_at, owner, trashed_ms, priority, is_forced, reused, phase, total";
/// Sweeps that are there, and those that lie in the trash.
pub(super) const SWEEPS: &str = " FROM sweeps s JOIN documents d ON d.sweep = s.sweep \
     WHERE s.phase <> 'deleted' AND s.trashed_ms IS NULL";
const TRASH: &str = " FROM sweeps s JOIN documents d ON d.sweep = s.sweep \
     WHERE s.phase <> 'deleted' AND s.trashed_ms IS NOT NULL";

/// A sweep by id, with its whole document.
pub async fn sweep(connection: &mut Connection, id: &str) -> sqlx::Result<Option<SweepRow>> {
    by_id(connection, WHOLE, id).await
}

/// A sweep by id for whoever does not need its whole document, which may be long.
pub async fn sweep_in_brief(
    connection: &mut Connection,
    id: &str,
) -> sqlx::Result<Option<SweepRow>> {
    by_id(connection, BRIEF, id).await
}

async fn by_id(
    connection: &mut Connection,
    document: &str,
    id: &str,
) -> sqlx::Result<Option<SweepRow>> {
    let mut query = QueryBuilder::<Sqlite>::new(document);
    query.push(COLUMNS).push(SWEEPS).push(" AND id = ").push_bind(id);
    let rows = query.build().fetch_all(&mut *connection).await?;
    Ok(with_counts(connection, &rows).await?.pop())
}

/// Sweeps from the newest to the oldest, and how many there are.
pub async fn sweeps(
    connection: &mut Connection,
    which: Which,
) -> sqlx::Result<(Vec<SweepRow>, i64)> {
    let these = if which.is_trash { TRASH } else { SWEEPS };
    let mut query = QueryBuilder::new(BRIEF);
    query.push(COLUMNS).push(these);
    query.push(" ORDER BY s.sweep DESC LIMIT ").push_bind(which.limit);
    query.push(" OFFSET ").push_bind(which.offset);
    let rows = query.build().fetch_all(&mut *connection).await?;
    let sweeps = with_counts(connection, &rows).await?;
    let mut count = QueryBuilder::new("SELECT COUNT(*)");
    count.push(these);
    let total = count.build_query_scalar().fetch_one(connection).await?;
    Ok((sweeps, total))
}

/// The sweeps with these numbers, from the newest to the oldest.
pub async fn numbered(connection: &mut Connection, numbers: &[i64]) -> sqlx::Result<Vec<SweepRow>> {
    if numbers.is_empty() {
        return Ok(Vec::new());
    }
    let mut query = QueryBuilder::new(BRIEF);
    query.push(COLUMNS).push(SWEEPS).push(" AND s.sweep IN (");
    let mut list = query.separated(", ");
    numbers.iter().for_each(|number| {
        list.push_bind(*number);
    });
    query.push(") ORDER BY s.sweep DESC");
    let rows = query.build().fetch_all(&mut *connection).await?;
    with_counts(connection, &rows).await
}

async fn with_counts(
    connection: &mut Connection,
    rows: &[SqliteRow],
) -> sqlx::Result<Vec<SweepRow>> {
    if rows.is_empty() {
        return Ok(Vec::new());
    }
    let numbers: Vec<i64> = rows.iter().map(|row| row.get("sweep")).collect();
    let of_these = |sql: &str| {
        let mut query = QueryBuilder::<Sqlite>::new(sql);
        query.push(" WHERE sweep IN (");
        let mut list = query.separated(", ");
        numbers.iter().for_each(|n| {
            list.push_bind(*n);
        });
        query.push(")");
        query
    };
    let mut counts: HashMap<i64, Counts> = HashMap::new();
    let mut query = of_these("SELECT sweep, status, runs FROM tallies");
    for row in query.build().fetch_all(&mut *connection).await? {
        let counts = counts.entry(row.get("sweep")).or_default();
        if !counts.add_named(row.get("status"), row.get("runs")) {
            tracing::error!(status = row.get::<&str, _>("status"), "a count of an unknown state");
        }
    }
    let mut tags: HashMap<i64, Vec<String>> = HashMap::new();
    let mut query = of_these("SELECT sweep, tag FROM tags");
    query.push(" ORDER BY tag");
    for row in query.build().fetch_all(&mut *connection).await? {
        tags.entry(row.get("sweep")).or_default().push(row.get("tag"));
    }
    let mut seals: HashMap<i64, Seal> = HashMap::new();
    let mut query = of_these("SELECT sweep, manifest FROM seals");
    for row in query.build().fetch_all(&mut *connection).await? {
        let manifest: serde_json::Value =
            serde_json::from_str(row.get("manifest")).unwrap_or_default();
        match Seal::deserialize(&manifest["seal"]) {
            Ok(seal) => drop(seals.insert(row.get("sweep"), seal)),
            Err(e) => tracing::error!("a seal cannot be read: {e}"),
        }
    }
    let mut imports: HashMap<i64, Imported> = HashMap::new();
    let mut query =
        of_these("SELECT sweep, source_id, source_owner, imported_at, imported_by FROM imports");
    for row in query.build().fetch_all(connection).await? {
        let imported = Imported {
            id: row.get("source_id"),
            owner: row.get("source_owner"),
            imported_at: row.get("imported_at"),
            imported_by: row.get("imported_by"),
        };
        imports.insert(row.get("sweep"), imported);
    }
    let sweep = |row: &SqliteRow| {
        let number = row.get("sweep");
        SweepRow {
            number,
            id: row.get("id"),
            name: row.get("name"),
            document: row.get("document"),
            is_cut: row.get::<i64, _>("is_cut") != 0,
            axis_names: row.get("axis_names"),
            created_at: row.get("created_at"),
            owner: row.get("owner"),
            trashed_ms: row.get("trashed_ms"),
            priority: row.get("priority"),
            tags: tags.remove(&number).unwrap_or_default(),
            note: row.get("note"),
            note_is_cut: row.get::<i64, _>("note_is_cut") != 0,
            is_forced: row.get::<i64, _>("is_forced") != 0,
            reused: row.get("reused"),
            phase: Phase::from_name(row.get("phase")).unwrap_or(Phase::Open),
            counts: Counts {
                total: row.get("total"),
                ..counts.remove(&number).unwrap_or_default()
            },
            seal: seals.remove(&number),
            imported: imports.remove(&number),
        }
    };
    Ok(rows.iter().map(sweep).collect())
}

/// How fast a sweep goes; none if nothing of it ended lately.
pub async fn pace(connection: &mut Connection, sweep: &SweepRow) -> sqlx::Result<Option<Pace>> {
    let now = now_ms();
    let row = sqlx::query(
        "SELECT COALESCE(SUM(run_count), 0) AS runs, COALESCE(MIN(ended_ms), 0) AS first, COUNT(*) AS chunks \
         FROM chunks WHERE sweep = $1 AND ended_ms > $2 AND state = 'done'",
    )
    .bind(sweep.number)
    .bind(now - LATELY_MS)
    .fetch_one(connection)
    .await?;
    let (runs, first, chunks): (i64, i64, i64) =
        (row.get("runs"), row.get("first"), row.get("chunks"));
    if chunks < 2 || now <= first {
        return Ok(None);
    }
    // The first chunk ended at the beginning of the period, so its runs do not count.
    let runs = runs as f64 * (chunks - 1) as f64 / chunks as f64;
    let runs_per_s = runs / ((now - first) as f64 / 1e3);
    let left = sweep.counts.queued + sweep.counts.running;
    Ok(Some(Pace { runs_per_s, seconds_left: left as f64 / runs_per_s }))
}

/// Sweeps in one state, with their runs that have no result.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Depth {
    /// What they wait for.
    pub phase: Phase,
    /// How many they are.
    pub sweeps: i64,
    /// Their runs: all, and those queued, running and cancelled.
    pub counts: Counts,
}

/// How deep the queue is: sweeps by phase and by what distinguishes the states of one phase, whether they have
/// begun and whether runs were cancelled.
pub async fn depth(connection: &mut Connection) -> sqlx::Result<Vec<Depth>> {
    let rows = sqlx::query(
        "SELECT phase, COUNT(*) AS sweeps, SUM(total) AS total, SUM(queued) AS queued, \
             SUM(running) AS running, SUM(cancelled) AS cancelled FROM ( \
             SELECT s.phase AS phase, s.total AS total, \
                 COALESCE(SUM(CASE WHEN t.status = 'queued' THEN t.runs ELSE 0 END), 0) AS queued, \
                 COALESCE(SUM(CASE WHEN t.status = 'running' THEN t.runs ELSE 0 END), 0) AS running, \
                 COALESCE(SUM(CASE WHEN t.status = 'cancelled' THEN t.runs ELSE 0 END), 0) AS cancelled \
             FROM sweeps s LEFT JOIN tallies t ON t.sweep = s.sweep \
             WHERE s.phase <> 'deleted' AND s.trashed_ms IS NULL GROUP BY s.sweep, s.phase, s.total) a \
         GROUP BY phase, queued < total, cancelled > 0",
    )
    .fetch_all(connection)
    .await?;
    let depth = |row: &SqliteRow| Depth {
        phase: Phase::from_name(row.get("phase")).unwrap_or(Phase::Open),
        sweeps: row.get("sweeps"),
        counts: Counts {
            total: row.get("total"),
            queued: row.get("queued"),
            running: row.get("running"),
            cancelled: row.get("cancelled"),
            ..Counts::default()
        },
    };
    Ok(rows.iter().map(depth).collect())
}

/// Number of sweeps, asked for to see that the database answers.
pub async fn health(connection: &mut Connection) -> sqlx::Result<i64> {
    sqlx::query_scalar(
        "SELECT COUNT(*) FROM sweeps WHERE phase <> 'deleted' AND trashed_ms IS NULL",
    )
    .fetch_one(connection)
    .await
}

/// What was submitted as a sweep, by its number, as JSON.
pub async fn document(connection: &mut Connection, sweep: i64) -> sqlx::Result<Option<String>> {
    sqlx::query_scalar("SELECT document FROM documents WHERE sweep = $1")
        .bind(sweep)
        .fetch_optional(connection)
        .await
}
