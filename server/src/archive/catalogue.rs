//! All the archive's SQL: files, and the runs' scalars for lists, filters and fits. Knows no queue.

use super::files::Written;
use super::schema::Kind;
use super::{ArchiveError, SolvedRun};
use crate::domain::outcome::{SCALARS, Scalars};
use crate::domain::parameters::{PARAMETERS, Parameters};
use crate::store::Connection;
use serde::Serialize;
use serde_json::Value;
use sqlx::{AssertSqlSafe, QueryBuilder, Row, Sqlite, sqlite::SqliteRow};
use utoipa::ToSchema;

/// Columns of the runs that are neither parameters nor scalars.
const TEXT_COLUMNS: [&str; 8] = [
    "run_id",
    "status",
    "detail",
    "regime",
    "upstream_closure",
    "root_evidence",
    "validity",
    "grid_convergence",
];
const WHOLE_COLUMNS: [&str; 2] = ["run_index", "iterations"];

/// Adds a chunk's files and runs, within the caller's transaction.
pub async fn insert(
    connection: &mut Connection,
    sweep_id: &str,
    chunk: i64,
    files: &[Written],
    runs: &[SolvedRun],
) -> sqlx::Result<()> {
    for file in files {
        sqlx::query(
            "INSERT INTO files \
             (path, sweep_id, chunk, kind, blake3, row_count, byte_count, schema_version) \
             VALUES ($1, $2, $3, $4, $5, $6, $7, $8)",
        )
        .bind(&file.path)
        .bind(sweep_id)
        .bind(chunk)
        .bind(file.kind.name())
        .bind(&file.blake3)
        .bind(file.rows)
        .bind(file.bytes)
        .bind(file.schema_version)
        .execute(&mut *connection)
        .await?;
    }
    let mut insert = QueryBuilder::<Sqlite>::new(
        "INSERT INTO runs (sweep_id, chunk, run_index, run_id, status, detail, regime, \
         upstream_closure, root_evidence, validity, grid_convergence, iterations",
    );
    let names = PARAMETERS.iter().map(|p| p.name).chain(SCALARS.iter().map(|s| s.name));
    for name in names {
        insert.push(", \"").push(name).push("\"");
    }
    insert.push(") ");
    insert.push_values(runs, |mut row, run| {
        let o = &run.outcome;
        row.push_bind(sweep_id)
            .push_bind(chunk)
            .push_bind(run.run_index as i64)
            .push_bind(&run.run_id)
            .push_bind(o.status.name())
            .push_bind(&o.detail)
            .push_bind(&o.regime)
            .push_bind(&o.upstream_closure)
            .push_bind(&o.root_evidence)
            .push_bind(&o.validity)
            .push_bind(&o.grid_convergence)
            .push_bind(o.iterations as i64);
        for p in &PARAMETERS {
            row.push_bind((p.get)(&o.parameters.0));
        }
        for s in SCALARS {
            row.push_bind((s.get)(&o.scalars));
        }
    });
    insert.build().execute(connection).await?;
    Ok(())
}

/// Paths and sizes of all files.
pub async fn files(connection: &mut Connection) -> sqlx::Result<Vec<(String, i64)>> {
    sqlx::query_as("SELECT path, byte_count FROM files").fetch_all(connection).await
}

/// Paths of a sweep's files of one table, in the order of its runs.
pub async fn files_of_sweep(
    connection: &mut Connection,
    sweep_id: &str,
    kind: Kind,
) -> sqlx::Result<Vec<String>> {
    sqlx::query_scalar("SELECT path FROM files WHERE sweep_id = $1 AND kind = $2 ORDER BY chunk")
        .bind(sweep_id)
        .bind(kind.name())
        .fetch_all(connection)
        .await
}

/// Where a run's tables stand.
#[derive(Debug, Clone, PartialEq)]
pub struct Entry {
    /// Its row.
    pub row: RunRow,
    /// Its scalars, typed.
    pub scalars: Scalars,
    /// Its parameters, typed.
    pub parameters: Parameters,
    /// Files of its chunk, by table.
    pub files: Vec<(String, String)>,
}

/// A run by id, from whichever sweep holds it.
pub async fn run(connection: &mut Connection, run_id: &str) -> Result<Option<Entry>, ArchiveError> {
    let row = sqlx::query("SELECT * FROM runs WHERE run_id = $1 ORDER BY sweep_id LIMIT 1")
        .bind(run_id)
        .fetch_optional(&mut *connection)
        .await?;
    let Some(row) = row else { return Ok(None) };
    let files = sqlx::query_as("SELECT kind, path FROM files WHERE sweep_id = $1 AND chunk = $2")
        .bind(row.get::<String, _>("sweep_id"))
        .bind(row.get::<i64, _>("chunk"))
        .fetch_all(connection)
        .await?;
    let mut scalars = Scalars::default();
    for s in SCALARS {
        (s.set)(&mut scalars, row.get(s.name));
    }
    let mut parameters = Parameters::default();
    for p in &PARAMETERS {
        parameters
            .set(p.name, row.get(p.name))
            .map_err(|e| ArchiveError::Catalogue(sqlx::Error::Decode(Box::new(e))))?;
    }
    Ok(Some(Entry { row: run_row(&row), scalars, parameters, files }))
}

/// A run's scalars, as listed: parameters and results by name; numbers that do not exist are null.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
#[serde(transparent)]
#[schema(value_type = Object)]
pub struct RunRow(pub serde_json::Map<String, Value>);

impl RunRow {
    /// Index of the run in its sweep.
    pub fn run_index(&self) -> i64 {
        self.0.get("run_index").and_then(Value::as_i64).unwrap_or_default()
    }

    /// A member as text.
    pub fn text(&self, name: &str) -> &str {
        self.0.get(name).and_then(Value::as_str).unwrap_or_default()
    }
}

fn run_row(row: &SqliteRow) -> RunRow {
    let mut map = serde_json::Map::new();
    for name in TEXT_COLUMNS {
        map.insert(name.into(), row.get::<Option<String>, _>(name).into());
    }
    for name in WHOLE_COLUMNS {
        map.insert(name.into(), row.get::<i64, _>(name).into());
    }
    for p in &PARAMETERS {
        let value: f64 = row.get(p.name);
        map.insert(p.name.into(), if p.whole { (value as i64).into() } else { value.into() });
    }
    for s in SCALARS {
        map.insert(s.name.into(), row.get::<Option<f64>, _>(s.name).into());
    }
    RunRow(map)
}

/// Whether runs can be sorted or fitted by a name.
pub fn is_column(name: &str) -> bool {
    TEXT_COLUMNS.contains(&name) || WHOLE_COLUMNS.contains(&name) || is_number(name)
}

/// Whether a name is a parameter or a scalar.
pub fn is_number(name: &str) -> bool {
    name == "iterations"
        || PARAMETERS.iter().any(|p| p.name == name)
        || SCALARS.iter().any(|s| s.name == name)
}

/// The order of a page of runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Order<'a> {
    /// A column that [`is_column`] knows.
    pub column: &'a str,
    /// From high to low.
    pub descending: bool,
}

impl Order<'_> {
    /// Whether pages can go on from a run's index: runs that are stored meanwhile then neither shift
    /// nor double any. Other orders count from the start, which holds for a sweep that is complete.
    pub fn is_by_index(&self) -> bool {
        self.column == "run_index" && !self.descending
    }
}

/// A page of a sweep's runs and how many there are. `from` is the number of runs before the page, or,
/// by index, the index the page starts at.
pub async fn runs(
    connection: &mut Connection,
    sweep_id: &str,
    order: Order<'_>,
    limit: i64,
    from: i64,
) -> sqlx::Result<(Vec<RunRow>, i64)> {
    let Order { column, descending } = order;
    assert!(is_column(column), "the caller checks the column");
    let direction = if descending { "DESC" } else { "ASC" };
    let sql = if order.is_by_index() {
        "SELECT * FROM runs WHERE sweep_id = $1 AND run_index >= $3 ORDER BY run_index LIMIT $2"
            .into()
    } else {
        format!(
            "SELECT * FROM runs WHERE sweep_id = $1 ORDER BY \"{column}\" {direction}, run_index \
             LIMIT $2 OFFSET $3"
        )
    };
    let rows = sqlx::query(AssertSqlSafe(sql))
        .bind(sweep_id)
        .bind(limit)
        .bind(from)
        .fetch_all(&mut *connection)
        .await?;
    let total =
        sqlx::query_scalar("SELECT COALESCE(SUM(runs), 0) FROM tallies WHERE sweep_id = $1")
            .bind(sweep_id)
            .fetch_one(connection)
            .await?;
    Ok((rows.iter().map(run_row).collect(), total))
}

/// Status and two numbers of each of a sweep's runs, for columns that [`is_number`] knows.
pub async fn pairs(
    connection: &mut Connection,
    sweep_id: &str,
    x: &str,
    y: &str,
) -> sqlx::Result<Vec<(String, Option<f64>, Option<f64>)>> {
    assert!(is_number(x) && is_number(y), "the caller checks the columns");
    let sql = format!(
        "SELECT status, CAST(\"{x}\" AS DOUBLE PRECISION), CAST(\"{y}\" AS DOUBLE PRECISION) \
         FROM runs WHERE sweep_id = $1 ORDER BY run_index"
    );
    sqlx::query_as(AssertSqlSafe(sql)).bind(sweep_id).fetch_all(connection).await
}
