//! What an ensemble from elsewhere meets in the catalogue.

use super::care::recount_chunk;
use crate::domain::outcome::{SCALARS, Scalars};
use crate::store::Connection;
use sqlx::{QueryBuilder, Row, Sqlite};

/// A result that is here.
#[derive(Debug, Clone, PartialEq)]
pub struct Known {
    /// The run's id.
    pub run_id: String,
    /// How it ended.
    pub status: String,
    /// Its numbers.
    pub scalars: Scalars,
}

/// The results of runs that are here and did not fail; several of a run that was solved again.
pub async fn known_results(connection: &mut Connection, ids: &[&str]) -> sqlx::Result<Vec<Known>> {
    /// Ids per statement.
    const IDS: usize = 500;
    let mut found = Vec::new();
    for ids in ids.chunks(IDS) {
        let mut query = QueryBuilder::<Sqlite>::new(
            "SELECT * FROM runs WHERE status <> 'failed' AND run_id IN (",
        );
        let mut list = query.separated(", ");
        for id in ids {
            list.push_bind((*id).to_owned());
        }
        query.push(")");
        for row in query.build().fetch_all(&mut *connection).await? {
            let mut scalars = Scalars::default();
            for s in SCALARS {
                (s.set)(&mut scalars, row.get(s.name));
            }
            found.push(Known { run_id: row.get("run_id"), status: row.get("status"), scalars });
        }
    }
    Ok(found)
}

/// Id of the sweep that came from elsewhere with a content hash.
pub async fn imported_as(connection: &mut Connection, hash: &str) -> sqlx::Result<Option<String>> {
    sqlx::query_scalar(
        "SELECT s.id FROM imports i JOIN sweeps s ON s.sweep = i.sweep \
         WHERE i.content_hash = $1 AND s.phase <> 'deleted' AND s.trashed_ms IS NULL \
         ORDER BY i.sweep LIMIT 1",
    )
    .bind(hash)
    .fetch_optional(connection)
    .await
}

/// Says of runs that stand in a sweep before, each with the index where, that their tables are there.
pub async fn send_home(
    connection: &mut Connection,
    sweep: i64,
    again: &[(i64, i64)],
) -> sqlx::Result<()> {
    for (index, first) in again {
        let chunk: i64 = sqlx::query_scalar(
            "UPDATE runs SET home_chunk = \
             (SELECT f.chunk FROM runs f WHERE f.sweep = $1 AND f.run_index = $3) \
             WHERE sweep = $1 AND run_index = $2 RETURNING chunk",
        )
        .bind(sweep)
        .bind(index)
        .bind(first)
        .fetch_one(&mut *connection)
        .await?;
        recount_chunk(connection, sweep, chunk).await?;
    }
    Ok(())
}
