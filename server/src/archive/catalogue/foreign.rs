//! Tables of somebody's earlier results: kept apart from runs, and never taken for them.

use crate::domain::foreign::{ColumnMap, ForeignRow};
use crate::domain::outcome::SCALARS;
use crate::domain::parameters::PARAMETERS;
use crate::store::Connection;
use serde::Serialize;
use sqlx::sqlite::SqliteRow;
use sqlx::{QueryBuilder, Row, Sqlite};
use std::collections::BTreeMap;
use utoipa::ToSchema;

/// A table of somebody's earlier results.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Foreign {
    /// Its id, which begins with `foreign-`.
    pub id: String,
    /// Its name.
    pub name: String,
    /// Who computed it, when, and by which code.
    pub source: String,
    /// Who brought it.
    pub owner: String,
    /// When it was brought, RFC 3339 in UTC.
    pub created_at: String,
    /// BLAKE3 of table and map as they were sent.
    pub digest: String,
    /// The column map.
    pub map: ColumnMap,
    /// Parameters that the map does not name, and the defaults that are taken for them.
    pub assumed: BTreeMap<String, f64>,
    /// Rows.
    pub row_count: i64,
}

/// A run to compare with.
#[derive(Debug, Clone, PartialEq)]
pub struct Counterpart {
    /// Its id.
    pub run_id: String,
    /// How it ended.
    pub status: String,
    /// Its parameters.
    pub parameters: BTreeMap<String, f64>,
    /// The numbers that it has.
    pub results: BTreeMap<String, f64>,
}

/// Adds a table.
pub async fn insert_foreign(
    connection: &mut Connection,
    table: &Foreign,
    rows: &[ForeignRow],
) -> sqlx::Result<()> {
    let number: i64 = sqlx::query_scalar("SELECT COALESCE(MAX(number), 0) + 1 FROM foreign_tables")
        .fetch_one(&mut *connection)
        .await?;
    sqlx::query(
        "INSERT INTO foreign_tables \
         (number, id, name, source, owner, created_at, digest, map, row_count) \
         VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9)",
    )
    .bind(number)
    .bind(&table.id)
    .bind(&table.name)
    .bind(&table.source)
    .bind(&table.owner)
    .bind(&table.created_at)
    .bind(&table.digest)
    .bind(json(&table.map)?)
    .bind(table.row_count)
    .execute(&mut *connection)
    .await?;
    /// Rows per statement.
    const AT_ONCE: usize = 1_000;
    for (batch, rows) in rows.chunks(AT_ONCE).enumerate() {
        let mut texts = Vec::with_capacity(rows.len());
        for row in rows {
            texts.push((json(&row.parameters)?, json(&row.results)?));
        }
        let mut insert = QueryBuilder::<Sqlite>::new(
            "INSERT INTO foreign_rows (number, row_index, parameters, results) ",
        );
        insert.push_values(
            texts.into_iter().enumerate(),
            |mut values, (i, (parameters, results))| {
                values
                    .push_bind(number)
                    .push_bind((batch * AT_ONCE + i) as i64)
                    .push_bind(parameters)
                    .push_bind(results);
            },
        );
        insert.build().execute(&mut *connection).await?;
    }
    Ok(())
}

fn json(value: &impl Serialize) -> sqlx::Result<String> {
    serde_json::to_string(value).map_err(|e| sqlx::Error::Encode(Box::new(e)))
}

const COLUMNS: &str =
    "SELECT id, name, source, owner, created_at, digest, map, row_count FROM foreign_tables";

fn foreign(row: &SqliteRow) -> sqlx::Result<Foreign> {
    let map: ColumnMap =
        serde_json::from_str(row.get("map")).map_err(|e| sqlx::Error::Decode(Box::new(e)))?;
    Ok(Foreign {
        id: row.get("id"),
        name: row.get("name"),
        source: row.get("source"),
        owner: row.get("owner"),
        created_at: row.get("created_at"),
        digest: row.get("digest"),
        assumed: map.assumed(),
        map,
        row_count: row.get("row_count"),
    })
}

/// All tables, the newest first.
pub async fn foreign_tables(connection: &mut Connection) -> sqlx::Result<Vec<Foreign>> {
    let mut query = QueryBuilder::<Sqlite>::new(COLUMNS);
    query.push(" ORDER BY number DESC");
    query.build().fetch_all(connection).await?.iter().map(foreign).collect()
}

/// A table by id.
pub async fn foreign_table(connection: &mut Connection, id: &str) -> sqlx::Result<Option<Foreign>> {
    let mut query = QueryBuilder::<Sqlite>::new(COLUMNS);
    query.push(" WHERE id = ").push_bind(id);
    query.build().fetch_optional(connection).await?.as_ref().map(foreign).transpose()
}

/// Rows of a table, from one on.
pub async fn foreign_rows(
    connection: &mut Connection,
    id: &str,
    from: i64,
    limit: i64,
) -> sqlx::Result<Vec<ForeignRow>> {
    let rows = sqlx::query(
        "SELECT r.parameters, r.results FROM foreign_rows r \
         JOIN foreign_tables t ON t.number = r.number \
         WHERE t.id = $1 AND r.row_index >= $2 ORDER BY r.row_index LIMIT $3",
    )
    .bind(id)
    .bind(from)
    .bind(limit)
    .fetch_all(connection)
    .await?;
    let numbers =
        |text: &str| serde_json::from_str(text).map_err(|e| sqlx::Error::Decode(Box::new(e)));
    let row = |row: &SqliteRow| {
        let (parameters, results) = (numbers(row.get("parameters"))?, numbers(row.get("results"))?);
        Ok(ForeignRow { parameters, results })
    };
    rows.iter().map(row).collect()
}

/// Removes a table.
pub async fn remove_foreign(connection: &mut Connection, id: &str) -> sqlx::Result<()> {
    sqlx::query(
        "DELETE FROM foreign_rows WHERE number = (SELECT number FROM foreign_tables WHERE id = $1)",
    )
    .bind(id)
    .execute(&mut *connection)
    .await?;
    sqlx::query("DELETE FROM foreign_tables WHERE id = $1").bind(id).execute(connection).await?;
    Ok(())
}

/// Steady states of a closure that did not fail, from the place after the last one told; those that lie within
/// the table's range of every parameter. The next place is none at the end.
pub async fn candidates(
    connection: &mut Connection,
    closure: &str,
    ranges: &BTreeMap<String, (f64, f64)>,
    after: (i64, i64),
) -> sqlx::Result<(Vec<Counterpart>, Option<(i64, i64)>)> {
    /// Runs looked at once.
    const AT_ONCE: i64 = 5_000;
    let mut query = QueryBuilder::<Sqlite>::new(
        "SELECT * FROM runs WHERE regime = 'steady' AND status <> 'failed' AND upstream_closure = ",
    );
    query.push_bind(closure.to_owned());
    for p in &PARAMETERS {
        if let Some((low, high)) = ranges.get(p.name) {
            query.push(format!(" AND \"{}\" >= ", p.name)).push_bind(*low);
            query.push(format!(" AND \"{}\" <= ", p.name)).push_bind(*high);
        }
    }
    query.push(" AND (sweep > ").push_bind(after.0);
    query.push(" OR (sweep = ").push_bind(after.0).push(" AND run_index > ").push_bind(after.1);
    query.push(")) ORDER BY sweep, run_index LIMIT ").push_bind(AT_ONCE);
    let rows = query.build().fetch_all(connection).await?;
    let next = rows.last().filter(|_| rows.len() as i64 == AT_ONCE);
    let next = next.map(|row| (row.get("sweep"), row.get("run_index")));
    let candidate = |row: &SqliteRow| {
        let results = SCALARS
            .iter()
            .filter_map(|s| Some((s.name.to_owned(), row.get::<Option<f64>, _>(s.name)?)));
        Counterpart {
            run_id: row.get("run_id"),
            status: row.get("status"),
            parameters: PARAMETERS.iter().map(|p| (p.name.to_owned(), row.get(p.name))).collect(),
            results: results.collect(),
        }
    };
    Ok((rows.iter().map(candidate).collect(), next))
}
