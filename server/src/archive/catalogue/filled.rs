//! A catalogue filled by one statement, for tests that need many runs and no solver.

use crate::domain::parameters::PARAMETERS;
use crate::store::Store;
use sqlx::AssertSqlSafe;
use std::collections::BTreeMap;

/// A store with sweep 1 of so many converged steady runs of the base case in one chunk; `columns` are told otherwise,
/// each by an SQL expression of the run's number i.
pub async fn filled(runs: i64, columns: &[(&str, &str)]) -> (tempfile::TempDir, Store) {
    let folder = tempfile::tempdir().expect("a folder");
    let store = Store::open(folder.path()).await.expect("a store");
    let fixed = [
        ("sweep", "1"),
        ("run_index", "i"),
        ("run_id", "'id' || i"),
        ("chunk", "0"),
        ("home_sweep", "1"),
        ("home_chunk", "0"),
        ("status", "'converged'"),
        ("detail", "''"),
        ("regime", "'steady'"),
        ("upstream_closure", "'published'"),
        ("iterations", "i % 1000"),
    ];
    let told = fixed.iter().chain(columns).map(|(name, value)| (*name, (*value).to_owned()));
    let base = PARAMETERS.iter().map(|p| (p.name, p.default.to_string()));
    let all: BTreeMap<&str, String> = base.chain(told).collect();
    let names: Vec<String> = all.keys().map(|name| format!("\"{name}\"")).collect();
    let values: Vec<String> = all.into_values().collect();
    let sql = format!(
        "WITH RECURSIVE n (i) AS (SELECT 0 UNION ALL SELECT i + 1 FROM n WHERE i < {}) \
         INSERT INTO runs ({}) SELECT {} FROM n",
        runs - 1,
        names.join(", "),
        values.join(", "),
    );
    let mut tx = store.write().await.expect("a transaction");
    sqlx::query(AssertSqlSafe(sql)).execute(&mut *tx).await.expect("the rows fit the schema");
    sqlx::query("INSERT INTO homes VALUES (1, 0, 1, 0, $1, 0, $2, 0)")
        .bind(runs)
        .bind(runs - 1)
        .execute(&mut *tx)
        .await
        .expect("the row fits the schema");
    tx.commit().await.expect("it commits");
    (folder, store)
}
