//! One number of all runs of a sweep, for who needs every one of them.

use super::is_number;
use super::sheet::ROWS_AT_ONCE;
use crate::domain::status::Status;
use crate::store::Connection;
use futures_util::TryStreamExt;
use sqlx::{AssertSqlSafe, Row};
use std::collections::BTreeMap;

/// A number of a sweep's runs.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Results {
    /// Of the runs that have it as a result, in the order of their index.
    pub values: Vec<f64>,
    /// How many others there are, by status.
    pub without: BTreeMap<String, usize>,
}

/// A number that [`is_number`] knows, of each of a sweep's runs that converged or were completed.
pub async fn results(connection: &mut Connection, sweep: i64, y: &str) -> sqlx::Result<Results> {
    assert!(is_number(y), "the caller checks the column");
    let sql = format!(
        "SELECT status, CAST(\"{y}\" AS DOUBLE PRECISION) AS y FROM runs WHERE sweep = $1 ORDER BY run_index"
    );
    let mut rows = sqlx::query(AssertSqlSafe(sql)).bind(sweep).fetch(connection);
    let mut results = Results::default();
    let mut taken = 0_usize;
    let solved = [Status::Converged.name(), Status::Completed.name()];
    while let Some(row) = rows.try_next().await? {
        let status: &str = row.get("status");
        let is_result = |y: &f64| y.is_finite() && solved.contains(&status);
        match row.get::<Option<f64>, _>("y").filter(is_result) {
            Some(value) => results.values.push(value),
            None => *results.without.entry(status.to_owned()).or_default() += 1,
        }
        taken += 1;
        if taken.is_multiple_of(ROWS_AT_ONCE) {
            tokio::task::yield_now().await;
        }
    }
    Ok(results)
}
