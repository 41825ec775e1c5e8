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
use std::borrow::Cow;
use std::collections::{BTreeMap, HashSet};

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
        let rows: Vec<_> = runs.iter().map(|run| values((sweep, chunk), &axes, run)).collect();
        insert_rows(connection, &rows).await?;
    }
    let mut homes = Homes::default();
    runs.iter().for_each(|run| homes.add((sweep, chunk), run.run_index as i64));
    homes.insert(connection, sweep, chunk, false).await
}

/// The columns before the numbers, in the order of [`values`].
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

/// A value of a row.
#[derive(Debug)]
enum Value<'a> {
    Integer(i64),
    Number(Option<f64>),
    Text(Option<Cow<'a, str>>),
}

impl<'a> Value<'a> {
    fn text(text: &'a str) -> Self {
        Self::Text(Some(text.into()))
    }

    /// Whether both are stored alike.
    fn is(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Integer(a), Self::Integer(b)) => a == b,
            (Self::Number(a), Self::Number(b)) => a.map(f64::to_bits) == b.map(f64::to_bits),
            (Self::Text(a), Self::Text(b)) => a == b,
            _ => false,
        }
    }

    fn add_to(&self, arguments: &mut SqliteArguments) -> Result<(), BoxDynError> {
        match self {
            Self::Integer(value) => arguments.add(value),
            Self::Number(value) => arguments.add(value),
            Self::Text(value) => arguments.add(value.as_deref()),
        }
    }
}

/// The values of a run's row: [`COLUMNS`], parameters, scalars.
fn values<'a>(
    (sweep, chunk): (i64, i64),
    axes: &[&ParameterInfo],
    run: &'a SolvedRun,
) -> Vec<Value<'a>> {
    let o = &run.outcome;
    let integers = [sweep, chunk, sweep, chunk, run.run_index as i64].map(Value::Integer);
    let texts = [&run.run_id, o.status.name(), &o.detail, &o.regime, &o.upstream_closure];
    let evidence = [&o.root_evidence, &o.validity, &o.grid_convergence];
    let history = o.residual_history.as_ref().map(|h| serde_json::json!(h).to_string().into());
    let solve_seconds = o.provenance.as_ref().and_then(|provenance| provenance.solve_seconds);
    let axis = |i: usize| axes.get(i).map(|p| (p.get)(&o.parameters.0));
    let parameters = PARAMETERS.iter().map(|p| Some((p.get)(&o.parameters.0)));
    let scalars = SCALARS.iter().map(|s| (s.get)(&o.scalars));
    integers
        .into_iter()
        .chain(texts.map(Value::text))
        .chain(evidence.map(|text| Value::Text(text.as_deref().map(Cow::from))))
        .chain([Value::Text(history)])
        .chain([o.iterations, o.attempts].map(|count| Value::Integer(count as i64)))
        .chain([Value::Number(solve_seconds)])
        .chain((0..AXES).map(axis).chain(parameters).chain(scalars).map(Value::Number))
        .collect()
}

/// Adds rows by one statement, to which what they share is told once. If it fails, the transaction is to be given
/// up: SQLite then need not remember each page as it was before the statement, which takes a tenth of its time.
async fn insert_rows(connection: &mut Connection, rows: &[Vec<Value<'_>>]) -> sqlx::Result<()> {
    let Some(first) = rows.first() else { return Ok(()) };
    // The number of the run is never shared, not even if there is but one row.
    let is_shared = |&i: &usize| {
        COLUMNS.get(i) != Some(&"run_index") && rows.iter().all(|row| row[i].is(&first[i]))
    };
    let (shared, own): (Vec<usize>, Vec<usize>) = (0..first.len()).partition(is_shared);
    let mut arguments = SqliteArguments::default();
    arguments.reserve(shared.len() + rows.len() * own.len(), 0);
    let of_rows = rows.iter().flat_map(|row| own.iter().map(move |i| &row[*i]));
    for value in shared.iter().map(|i| &first[*i]).chain(of_rows) {
        value.add_to(&mut arguments).map_err(sqlx::Error::Encode)?;
    }
    let all: Vec<String> =
        COLUMNS.map(str::to_owned).into_iter().chain(numbers_by_name()).collect();
    let names: Vec<&str> = shared.iter().chain(&own).map(|i| all[*i].as_str()).collect();
    let places = |n: usize| vec!["?"; n].join(", ");
    let sql = format!(
        "INSERT OR FAIL INTO runs ({}) SELECT {}, own.* FROM (VALUES {}) AS own",
        names.join(", "),
        places(shared.len()),
        vec![format!("({})", places(own.len())); rows.len()].join(", "),
    );
    sqlx::query_with(AssertSqlSafe(sql), arguments).execute(connection).await?;
    Ok(())
}

/// The names of parameters and scalars, quoted.
fn numbers_by_name() -> impl Iterator<Item = String> {
    let names = PARAMETERS.iter().map(|p| p.name).chain(SCALARS.iter().map(|s| s.name));
    names.map(|name| format!("\"{name}\""))
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
    let numbers: String = numbers_by_name().map(|name| format!(", {name}")).collect();
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::outcome::{Outcome, Scalars};
    use crate::domain::parameters::Parameters;
    use crate::store::Store;
    use sqlx::sqlite::SqliteRow;

    /// A run unlike its neighbours in whatever a run can differ in, and like some of them in all but its number.
    fn run(run_index: usize) -> SolvedRun {
        let status = if run_index.is_multiple_of(3) { Status::Failed } else { Status::Converged };
        let parameters = Parameters { d_m: 20.0 + (run_index / 120) as f64, ..Default::default() };
        let force = (!run_index.is_multiple_of(3)).then_some(run_index as f64 * 1e5);
        let outcome = Outcome {
            detail: format!("it's {}", run_index % 2),
            validity: (run_index % 5 == 1).then(|| "thin".to_owned()),
            residual_history: (status == Status::Failed).then(|| vec![2.0, run_index as f64]),
            scalars: Scalars { force_n_per_m: force, length_m: Some(-0.0), ..Default::default() },
            iterations: 7,
            ..Outcome::bare(status, parameters, "steady", "published")
        };
        SolvedRun { run_index, run_id: format!("id{}", run_index / 2), outcome }
    }

    async fn stored(store: &Store) -> Vec<SqliteRow> {
        sqlx::query("SELECT * FROM runs ORDER BY run_index")
            .fetch_all(&mut *store.read().await.expect("a connection"))
            .await
            .expect("rows")
    }

    #[tokio::test]
    async fn each_run_has_its_own_values_and_those_it_shares() {
        let folder = tempfile::tempdir().expect("a folder");
        let store = Store::open(folder.path()).await.expect("a store");
        for (chunk, runs) in [0..1, 1..3, 3..340].into_iter().enumerate() {
            let runs: Vec<SolvedRun> = runs.map(run).collect();
            let mut tx = store.write().await.expect("a transaction");
            insert(&mut tx, 5, chunk as i64, &["d_m"], &[], &runs).await.expect("rows");
            tx.commit().await.expect("it commits");
        }
        let rows = stored(&store).await;
        assert_eq!(rows.len(), 340);
        for (i, row) in rows.iter().enumerate() {
            let run = run(i);
            let o = &run.outcome;
            let places: [i64; 3] = [row.get("sweep"), row.get("home_sweep"), row.get("run_index")];
            assert_eq!(places, [5, 5, i as i64]);
            let chunk = [1, 3].partition_point(|begin| *begin <= i) as i64;
            let chunks: [i64; 2] = [row.get("chunk"), row.get("home_chunk")];
            assert_eq!(chunks, [chunk; 2]);
            assert_eq!(row.get::<String, _>("run_id"), run.run_id);
            assert_eq!(row.get::<String, _>("status"), o.status.name());
            assert_eq!(row.get::<String, _>("detail"), o.detail);
            assert_eq!(row.get::<Option<String>, _>("validity"), o.validity);
            assert_eq!(row.get::<Option<String>, _>("root_evidence"), None);
            let history: Option<String> = row.get("residual_history");
            assert_eq!(history, o.residual_history.as_ref().map(|h| format!("[2.0,{:?}]", h[1])));
            assert_eq!(row.get::<i64, _>("iterations"), 7);
            assert_eq!(row.get::<Option<f64>, _>("axis_2"), None);
            for name in ["d_m", "axis_1"] {
                assert_eq!(row.get::<f64, _>(name), o.parameters.0.d_m);
            }
            for p in &PARAMETERS {
                assert_eq!(row.get::<f64, _>(p.name), (p.get)(&o.parameters.0), "{}", p.name);
            }
            for s in SCALARS {
                assert_eq!(row.get::<Option<f64>, _>(s.name), (s.get)(&o.scalars), "{}", s.name);
            }
        }
    }

    #[tokio::test]
    async fn of_a_chunk_that_is_refused_nothing_stays() {
        let folder = tempfile::tempdir().expect("a folder");
        let store = Store::open(folder.path()).await.expect("a store");
        let runs: Vec<SolvedRun> = [0, 1, 2, 1].map(run).into();
        let mut tx = store.write().await.expect("a transaction");
        let refused = insert(&mut tx, 5, 0, &[], &[], &runs).await.expect_err("a run twice");
        assert!(refused.to_string().contains("UNIQUE"), "{refused}");
        drop(tx);
        assert!(stored(&store).await.is_empty());
        let mut tx = store.write().await.expect("a transaction");
        insert(&mut tx, 5, 0, &[], &[], &runs[..3]).await.expect("rows");
        tx.commit().await.expect("it commits");
        assert_eq!(stored(&store).await.len(), 3);
    }
}
