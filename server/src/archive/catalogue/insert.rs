//! New runs: solved ones, and those taken over from another sweep.

use super::super::SolvedRun;
use super::super::files::Written;
use super::{AXES, SOLVE_SECONDS, care};
use crate::domain::outcome::SCALARS;
use crate::domain::parameters::{PARAMETERS, ParameterInfo};
use crate::domain::status::Status;
use crate::store::Connection;
use sqlx::error::BoxDynError;
use sqlx::sqlite::SqliteArguments;
use sqlx::{Arguments, AssertSqlSafe, QueryBuilder, Row, Sqlite};
use std::collections::{BTreeMap, HashSet};
use std::sync::{Arc, LazyLock};

/// Rows per statement; a statement takes 32,766 values.
const ROWS: usize = 100;

/// Adds a chunk's files and solved runs, within the caller's transaction. `axes` are the parameters that
/// the sweep varies.
pub async fn insert(
    connection: &mut Connection,
    sweep: i64,
    chunk: i64,
    axes: &[&str],
    files: &[Written],
    runs: &[SolvedRun],
) -> sqlx::Result<()> {
    for file in files {
        care::insert_file(connection, file).await?;
        care::place_in(connection, sweep, chunk, file, 0, file.rows).await?;
    }
    let axes: Vec<_> = PARAMETERS.iter().filter(|p| axes.contains(&p.name)).collect();
    for runs in runs.chunks(ROWS) {
        let sql = if runs.len() == ROWS { MOST_AT_ONCE.clone() } else { statement(runs.len()) };
        let mut values = SqliteArguments::default();
        values.reserve(runs.len() * columns(), 0);
        for run in runs {
            add(&mut values, (sweep, chunk), &axes, run).map_err(sqlx::Error::Encode)?;
        }
        sqlx::query_with(AssertSqlSafe(sql), values).execute(&mut *connection).await?;
    }
    let mut homes = Homes::default();
    runs.iter().for_each(|run| homes.add((sweep, chunk), run.run_index as i64));
    homes.insert(connection, sweep, chunk, false).await
}

/// The columns before the numbers, in the order of [`add`].
const COLUMNS: [&str; 17 + AXES] = [
    "sweep",
    "chunk",
    "home_sweep",
    "home_chunk",
    "run_index",
    "run_id",
    "status",
    "detail",
    "regime",
    "upstream_closure",
    "root_evidence",
    "validity",
    "grid_convergence",
    "residual_history",
    "iterations",
    "attempts",
    SOLVE_SECONDS,
    "axis_1",
    "axis_2",
    "axis_3",
    "axis_4",
];

/// Values of a row.
fn columns() -> usize {
    COLUMNS.len() + PARAMETERS.len() + SCALARS.len()
}

/// The statement that adds as many rows as one may, which nearly all are added by.
static MOST_AT_ONCE: LazyLock<Arc<str>> = LazyLock::new(|| statement(ROWS));

/// The statement that adds so many rows.
fn statement(rows: usize) -> Arc<str> {
    let row = format!("({})", vec!["?"; columns()].join(", "));
    let (names, numbers, rows) = (COLUMNS.join(", "), numbers_by_name(), vec![row; rows]);
    format!("INSERT INTO runs ({names}{numbers}) VALUES {}", rows.join(", ")).into()
}

/// Adds the values of a run's row.
fn add(
    values: &mut SqliteArguments,
    (sweep, chunk): (i64, i64),
    axes: &[&ParameterInfo],
    run: &SolvedRun,
) -> Result<(), BoxDynError> {
    let o = &run.outcome;
    for number in [sweep, chunk, sweep, chunk, run.run_index as i64] {
        values.add(number)?;
    }
    for text in [&run.run_id, o.status.name(), &o.detail, &o.regime, &o.upstream_closure] {
        values.add(text)?;
    }
    for text in [&o.root_evidence, &o.validity, &o.grid_convergence] {
        values.add(text.as_deref())?;
    }
    values.add(o.residual_history.as_ref().map(|h| serde_json::json!(h).to_string()))?;
    values.add(o.iterations as i64)?;
    values.add(o.attempts as i64)?;
    values.add(o.provenance.as_ref().and_then(|provenance| provenance.solve_seconds))?;
    for i in 0..AXES {
        values.add(axes.get(i).map(|p| (p.get)(&o.parameters.0)))?;
    }
    for p in &PARAMETERS {
        values.add((p.get)(&o.parameters.0))?;
    }
    for s in SCALARS {
        values.add((s.get)(&o.scalars))?;
    }
    Ok(())
}

/// The names of parameters and scalars, each after a comma and quoted.
fn numbers_by_name() -> String {
    let names = PARAMETERS.iter().map(|p| p.name).chain(SCALARS.iter().map(|s| s.name));
    names.map(|name| format!(", \"{name}\"")).collect()
}

/// A run taken over.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Adopted {
    /// How it ended.
    pub status: Status,
    /// Whether the same chunk has solved it, under another index.
    pub is_own: bool,
}

/// Takes runs over that are in the archive, by id: those that did not fail, or that this chunk has just
/// solved itself. Those that are not there any more are missing from the answer.
pub async fn adopt(
    connection: &mut Connection,
    sweep: i64,
    chunk: i64,
    axes: &[&str],
    runs: &[(usize, &str)],
) -> sqlx::Result<Vec<Adopted>> {
    if runs.is_empty() {
        return Ok(Vec::new());
    }
    const KEPT: &str = "run_id, status, detail, regime, upstream_closure, root_evidence, validity, \
                        grid_convergence, residual_history, iterations, attempts, solve_seconds, home_sweep, home_chunk";
    let axes: Vec<&str> =
        PARAMETERS.iter().map(|p| p.name).filter(|name| axes.contains(name)).collect();
    let axis = |i: usize| axes.get(i).map_or("NULL".to_owned(), |name| format!("\"{name}\""));
    let axis_values: Vec<String> = (0..AXES).map(axis).collect();
    let numbers = numbers_by_name();
    let sql = format!(
        "INSERT INTO runs (sweep, chunk, run_index, axis_1, axis_2, axis_3, axis_4, {KEPT}{numbers}) \
         SELECT $1, $2, $3, {}, {KEPT}{numbers} FROM runs \
         WHERE run_id = $4 AND (status <> 'failed' OR (home_sweep = $1 AND home_chunk = $2)) \
         AND {READABLE} \
         ORDER BY home_sweep DESC, home_chunk DESC LIMIT 1 \
         RETURNING status, home_sweep, home_chunk",
        axis_values.join(", ")
    );
    let mut homes = Homes::default();
    let mut adopted = Vec::with_capacity(runs.len());
    for (run_index, run_id) in runs {
        let row = sqlx::query(AssertSqlSafe(sql.as_str()))
            .bind(sweep)
            .bind(chunk)
            .bind(*run_index as i64)
            .bind(*run_id)
            .fetch_optional(&mut *connection)
            .await?;
        let Some(row) = row else { continue };
        let home: (i64, i64) = (row.get("home_sweep"), row.get("home_chunk"));
        if let Some(status) = Status::from_name(row.get("status")) {
            adopted.push(Adopted { status, is_own: home == (sweep, chunk) });
        }
        homes.add(home, *run_index as i64);
    }
    homes.insert(connection, sweep, chunk, true).await?;
    Ok(adopted)
}

/// How many runs of a chunk live where.
#[derive(Debug, Default)]
struct Homes(BTreeMap<(i64, i64), (i64, i64, i64)>);

impl Homes {
    fn add(&mut self, home: (i64, i64), index: i64) {
        let (runs, first, last) = self.0.entry(home).or_insert((0, index, index));
        (*runs, *first, *last) = (*runs + 1, index.min(*first), index.max(*last));
    }

    /// Adds them to the catalogue; `is_mixed` tells that the home's rows are not one for each run, in the
    /// order of the runs.
    async fn insert(
        &self,
        connection: &mut Connection,
        sweep: i64,
        chunk: i64,
        is_mixed: bool,
    ) -> sqlx::Result<()> {
        for ((home_sweep, home_chunk), (runs, first, last)) in &self.0 {
            sqlx::query(
                "INSERT INTO homes \
                 (sweep, chunk, home_sweep, home_chunk, runs, first_index, last_index, is_mixed) \
                 VALUES ($1, $2, $3, $4, $5, $6, $7, $8) \
                 ON CONFLICT (sweep, chunk, home_sweep, home_chunk) DO UPDATE SET \
                 runs = homes.runs + $5, first_index = MIN(homes.first_index, $6), \
                 last_index = MAX(homes.last_index, $7), is_mixed = MAX(homes.is_mixed, $8)",
            )
            .bind(sweep)
            .bind(chunk)
            .bind(home_sweep)
            .bind(home_chunk)
            .bind(runs)
            .bind(first)
            .bind(last)
            .bind(i64::from(is_mixed))
            .execute(&mut *connection)
            .await?;
        }
        Ok(())
    }
}

/// Of runs whose home is no sealed sweep with a damaged file.
const READABLE: &str = "home_sweep NOT IN (SELECT sweep FROM seals WHERE is_damaged = 1)";

/// Which of these ids have a result in the archive that did not fail.
pub async fn known(connection: &mut Connection, ids: &[String]) -> sqlx::Result<HashSet<String>> {
    /// Ids per statement.
    const IDS: usize = 500;
    let mut found = HashSet::new();
    for ids in ids.chunks(IDS) {
        let mut query =
            QueryBuilder::<Sqlite>::new("SELECT run_id FROM runs WHERE status <> 'failed' AND ");
        query.push(READABLE).push(" AND run_id IN (");
        let mut list = query.separated(", ");
        for id in ids {
            list.push_bind(id);
        }
        query.push(")");
        found.extend(query.build_query_scalar().fetch_all(&mut *connection).await?);
    }
    Ok(found)
}

/// Whether there are no runs at all.
pub async fn is_empty(connection: &mut Connection) -> sqlx::Result<bool> {
    let one: Option<i64> =
        sqlx::query_scalar("SELECT 1 FROM homes LIMIT 1").fetch_optional(connection).await?;
    Ok(one.is_none())
}
