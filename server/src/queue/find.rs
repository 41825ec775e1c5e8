//! What sweeps are found by, all sweeps at once.

use super::look::SWEEPS;
use crate::domain::filter::Filter;
use crate::domain::found::SweepFacts;
use crate::domain::parameters::PARAMETERS;
use crate::domain::same::same;
use crate::domain::status::{Counts, Phase};
use crate::store::Connection;
use serde::Serialize;
use sqlx::{QueryBuilder, Row, Sqlite};
use std::collections::HashMap;
use utoipa::ToSchema;

/// What there is to know of all sweeps, from the newest to the oldest: their notes only if a filter asks for
/// them, and the ranges of the parameters that it asks for or that are named.
pub async fn facts(
    connection: &mut Connection,
    filter: Option<&Filter>,
    parameters: &[&str],
) -> sqlx::Result<Vec<SweepFacts>> {
    let asks = |name: &str| filter.is_some_and(|filter| filter.mentions(name));
    let note = if asks("note") { "note" } else { "NULL AS note" };
    let mut query =
        QueryBuilder::<Sqlite>::new("SELECT s.sweep, id, name, owner, created_at, regime, ");
    query.push("phase, priority, reused, total, axis_names, ").push(note).push(SWEEPS);
    query.push(" ORDER BY s.sweep DESC");
    let rows = query.build().fetch_all(&mut *connection).await?;
    let mut tags: HashMap<i64, Vec<String>> = HashMap::new();
    if asks("tag") {
        let rows = sqlx::query("SELECT sweep, tag FROM tags").fetch_all(&mut *connection).await?;
        for row in rows {
            tags.entry(row.get("sweep")).or_default().push(row.get("tag"));
        }
    }
    let mut counts: HashMap<i64, Counts> = HashMap::new();
    let tallies = sqlx::query("SELECT sweep, status, runs FROM tallies");
    for row in tallies.fetch_all(&mut *connection).await? {
        counts.entry(row.get("sweep")).or_default().add_named(row.get("status"), row.get("runs"));
    }
    let mut ranges: HashMap<i64, Vec<(String, f64, f64)>> = HashMap::new();
    for parameter in PARAMETERS.iter().map(|p| p.name) {
        if !asks(parameter) && !parameters.contains(&parameter) {
            continue;
        }
        let of_it = sqlx::query("SELECT sweep, low, high FROM sweep_ranges WHERE parameter = $1");
        for row in of_it.bind(parameter).fetch_all(&mut *connection).await? {
            let range = (parameter.to_owned(), row.get("low"), row.get("high"));
            ranges.entry(row.get("sweep")).or_default().push(range);
        }
    }
    let fact = |row: &sqlx::sqlite::SqliteRow| {
        let number: i64 = row.get("sweep");
        let counts =
            Counts { total: row.get("total"), ..counts.remove(&number).unwrap_or_default() };
        let axes = row.get::<&str, _>("axis_names").split(',').filter(|name| !name.is_empty());
        SweepFacts {
            number,
            id: row.get("id"),
            name: row.get("name"),
            owner: row.get("owner"),
            note: row.get("note"),
            tags: tags.remove(&number).unwrap_or_default(),
            created_at: row.get("created_at"),
            regime: row.get("regime"),
            state: Phase::from_name(row.get("phase")).unwrap_or(Phase::Open).state(&counts),
            priority: row.get("priority"),
            reused: row.get("reused"),
            counts,
            axes: axes.map(str::to_owned).collect(),
            ranges: ranges.remove(&number).unwrap_or_default(),
        }
    };
    Ok(rows.iter().map(fact).collect())
}

/// A parameter that differs among a sweep's runs.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Varied {
    /// Its name.
    pub parameter: String,
    /// The least value among all runs of the sweep, also those that have not ended.
    pub min: f64,
    /// The greatest one.
    pub max: f64,
}

/// The parameters that differ among the runs of these sweeps by more than rounding, by the sweep's number, in the order of their names. A
/// sweep without stored ranges has none here.
pub async fn varied(
    connection: &mut Connection,
    sweeps: &[i64],
) -> sqlx::Result<HashMap<i64, Vec<Varied>>> {
    let mut varied: HashMap<i64, Vec<Varied>> = HashMap::new();
    if sweeps.is_empty() {
        return Ok(varied);
    }
    let mut query = QueryBuilder::<Sqlite>::new(
        "SELECT sweep, parameter, low, high FROM sweep_ranges WHERE low < high AND parameter IN (",
    );
    let mut list = query.separated(", ");
    PARAMETERS.iter().for_each(|parameter| {
        list.push_bind(parameter.name);
    });
    query.push(") AND sweep IN (");
    let mut list = query.separated(", ");
    sweeps.iter().for_each(|sweep| {
        list.push_bind(*sweep);
    });
    query.push(") ORDER BY parameter");
    for row in query.build().fetch_all(connection).await? {
        let (min, max) = (row.get("low"), row.get("high"));
        if !same(min, max) {
            let parameter = row.get("parameter");
            varied.entry(row.get("sweep")).or_default().push(Varied { parameter, min, max });
        }
    }
    Ok(varied)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::{DATABASE, Store};
    use sqlx::sqlite::{SqliteConnectOptions, SqlitePoolOptions};
    use sqlx::{AssertSqlSafe, migrate::Migrator};

    /// Sweeps of a version before there were ranges: one whose runs are all there, one with a run missing.
    #[tokio::test]
    async fn older_sweeps_get_the_ranges_of_their_runs_if_all_are_there() {
        let folder = tempfile::tempdir().expect("a folder");
        let options = SqliteConnectOptions::new()
            .filename(folder.path().join(DATABASE))
            .create_if_missing(true);
        let pool = SqlitePoolOptions::new()
            .max_connections(1)
            .connect_with(options)
            .await
            .expect("a database");
        let mut before: Migrator = sqlx::migrate!("../migrations");
        before.migrations.to_mut().retain(|step| step.version < 6);
        before.run(&pool).await.expect("they apply");
        let names: String = PARAMETERS.iter().map(|p| format!(", \"{}\"", p.name)).collect();
        for (sweep, total, regime) in [(1, 3, "steady"), (2, 4, "quasi_static")] {
            let mut all = vec![
                format!(
                    "INSERT INTO sweeps (sweep, id, name, axis_names, priority, is_forced, phase, total, reused, \
                     found, turn, is_compact, created_at) \
                     VALUES ({sweep}, 's{sweep}', 'x', 'b', 0, 0, 'ended', {total}, 0, 0, 0, 1, '2026')"
                ),
                format!(
                    "INSERT INTO documents (sweep, document) VALUES \
                     ({sweep}, '{{\"name\":\"\\\"regime\\\":\\\"branch\\\"\",\"regime\":\"{regime}\"}}')"
                ),
            ];
            for index in 0..3 {
                let value = |p: &crate::domain::parameters::ParameterInfo| match p.name {
                    "b" => format!(", {}", 100 + index),
                    _ => format!(", {}", p.default),
                };
                let values: String = PARAMETERS.iter().map(value).collect();
                all.push(format!(
                    "INSERT INTO runs (sweep, run_index, run_id, chunk, home_sweep, home_chunk, status, detail, \
                     regime, upstream_closure, iterations{names}) VALUES ({sweep}, {index}, 'i', 0, {sweep}, 0, \
                     'converged', '', '{regime}', 'published', 1{values})"
                ));
            }
            for sql in all {
                sqlx::query(AssertSqlSafe(sql)).execute(&pool).await.expect("it fits");
            }
        }
        pool.close().await;
        let store = Store::open(folder.path()).await.expect("it is brought up to date");
        // What differs by rounding does not vary.
        let mut tx = store.write().await.expect("a transaction");
        let rounded = "UPDATE sweep_ranges SET low = 9009.999999999998, high = 9010 WHERE parameter = 'd_m' AND sweep = 1";
        sqlx::query(rounded).execute(&mut *tx).await.expect("it fits");
        tx.commit().await.expect("it commits");
        let mut tx = store.read().await.expect("a transaction");
        let facts = facts(&mut tx, None, &["b", "A", "n_cells"]).await.expect("it reads");
        let regimes: Vec<_> = facts.iter().map(|facts| facts.regime.as_deref()).collect();
        assert_eq!(regimes, [Some("quasi_static"), Some("steady")]);
        assert_eq!(facts[0].ranges, []);
        assert_eq!(facts[1].range("b"), Some((100.0, 102.0)));
        assert_eq!(facts[1].range("A"), Some((0.5, 0.5)));
        assert_eq!(facts[1].range("n_cells"), Some((50.0, 50.0)));
        assert_eq!(facts[1].range("d_m"), None, "it was not asked for");
        let varied = varied(&mut tx, &[1, 2]).await.expect("it reads");
        let of_b = Varied { parameter: "b".into(), min: 100.0, max: 102.0 };
        assert_eq!(varied, HashMap::from([(1, vec![of_b])]));
    }
}
