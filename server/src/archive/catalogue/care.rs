//! Keeping the catalogue: results taken out, sweeps cleared away, files put together, and what a
//! verification compares.

use super::super::files::Written;
use super::place::Listed;
use crate::domain::status::Status;
use crate::domain::taken_out::TakenOut;
use crate::store::Connection;
use sqlx::{QueryBuilder, Row, Sqlite};
use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};

/// Adds a file to the catalogue.
pub async fn insert_file(connection: &mut Connection, file: &Written) -> sqlx::Result<()> {
    sqlx::query(
        "INSERT INTO files (path, kind, blake3, row_count, byte_count, schema_version) \
         VALUES ($1, $2, $3, $4, $5, $6)",
    )
    .bind(&file.path)
    .bind(file.kind.name())
    .bind(&file.blake3)
    .bind(file.rows)
    .bind(file.bytes)
    .bind(file.schema_version)
    .execute(connection)
    .await?;
    Ok(())
}

/// Says that rows of a file are what a chunk solved, in place of where they stood before.
pub async fn place_in(
    connection: &mut Connection,
    sweep: i64,
    chunk: i64,
    file: &Written,
    first_row: i64,
    row_count: i64,
) -> sqlx::Result<()> {
    sqlx::query(
        "INSERT INTO parts (sweep, chunk, kind, path, first_row, row_count) \
         VALUES ($1, $2, $3, $4, $5, $6) \
         ON CONFLICT (sweep, chunk, kind) DO UPDATE SET path = $4, first_row = $5",
    )
    .bind(sweep)
    .bind(chunk)
    .bind(file.kind.name())
    .bind(&file.path)
    .bind(first_row)
    .bind(row_count)
    .execute(connection)
    .await?;
    Ok(())
}

/// All files.
pub async fn all_files(connection: &mut Connection) -> sqlx::Result<Vec<Listed>> {
    sqlx::query_as(
        "SELECT path, blake3, byte_count, row_count, schema_version FROM files ORDER BY path",
    )
    .fetch_all(connection)
    .await
}

/// How many files there are, and how many bytes they have.
pub async fn size(connection: &mut Connection) -> sqlx::Result<(i64, i64)> {
    sqlx::query_as("SELECT COUNT(*), COALESCE(SUM(byte_count), 0) FROM files")
        .fetch_one(connection)
        .await
}

/// Bytes of the files that hold what these sweeps solved, by their number: of a file that holds other rows too, the
/// share of its rows. What was taken over from other sweeps is in their files and does not count.
pub async fn bytes_of(
    connection: &mut Connection,
    sweeps: &[i64],
) -> sqlx::Result<HashMap<i64, i64>> {
    if sweeps.is_empty() {
        return Ok(HashMap::new());
    }
    let mut query = QueryBuilder::<Sqlite>::new(
        "SELECT p.sweep, SUM(CAST(f.byte_count AS DOUBLE PRECISION) * p.row_count / f.row_count) AS bytes \
         FROM parts p JOIN files f ON f.path = p.path WHERE f.row_count > 0 AND p.sweep IN (",
    );
    let mut list = query.separated(", ");
    sweeps.iter().for_each(|sweep| {
        list.push_bind(*sweep);
    });
    query.push(") GROUP BY p.sweep");
    let rows = query.build().fetch_all(connection).await?;
    Ok(rows
        .iter()
        .map(|row| (row.get("sweep"), row.get::<f64, _>("bytes").round() as i64))
        .collect())
}

/// Files of which no part is used any more leave the catalogue; their paths.
pub async fn drop_unused_files(connection: &mut Connection) -> sqlx::Result<Vec<String>> {
    sqlx::query_scalar(
        "DELETE FROM files WHERE NOT EXISTS (SELECT 1 FROM parts p WHERE p.path = files.path) \
         RETURNING path",
    )
    .fetch_all(connection)
    .await
}

/// Sweeps that have ended and whose files have not been put together: number and id.
pub async fn waiting_for_compaction(
    connection: &mut Connection,
) -> sqlx::Result<Vec<(i64, String)>> {
    sqlx::query_as(
        "SELECT sweep, id FROM sweeps WHERE phase = 'ended' AND is_compact = 0 \
         AND NOT EXISTS (SELECT 1 FROM seals WHERE seals.sweep = sweeps.sweep) ORDER BY sweep",
    )
    .fetch_all(connection)
    .await
}

/// Says that a sweep's files have been put together.
pub async fn compacted(connection: &mut Connection, sweep: i64) -> sqlx::Result<()> {
    sqlx::query("UPDATE sweeps SET is_compact = 1 WHERE sweep = $1")
        .bind(sweep)
        .execute(connection)
        .await?;
    Ok(())
}

/// Removes up to `most` of a sweep's runs; how many there were.
pub async fn clear_runs(connection: &mut Connection, sweep: i64, most: i64) -> sqlx::Result<u64> {
    let removed = sqlx::query(
        "DELETE FROM runs WHERE sweep = $1 AND run_index IN ( \
             SELECT r.run_index FROM runs r WHERE r.sweep = $1 ORDER BY r.run_index LIMIT $2)",
    )
    .bind(sweep)
    .bind(most)
    .execute(&mut *connection)
    .await?
    .rows_affected();
    if removed == 0 {
        sqlx::query("DELETE FROM homes WHERE sweep = $1").bind(sweep).execute(connection).await?;
    }
    Ok(removed)
}

/// Whether runs of another sweep live in the files of this one.
pub async fn guests_of(connection: &mut Connection, sweep: i64) -> sqlx::Result<bool> {
    let guests: Option<i64> =
        sqlx::query_scalar("SELECT 1 FROM homes WHERE home_sweep = $1 AND sweep <> $1 LIMIT 1")
            .bind(sweep)
            .fetch_optional(connection)
            .await?;
    Ok(guests.is_some())
}

/// Says that the files hold nothing of a chunk any more.
pub async fn drop_home(connection: &mut Connection, sweep: i64, chunk: i64) -> sqlx::Result<()> {
    for sql in [
        "DELETE FROM parts WHERE sweep = $1 AND chunk = $2",
        "DELETE FROM solved WHERE sweep = $1 AND chunk = $2",
    ] {
        sqlx::query(sql).bind(sweep).bind(chunk).execute(&mut *connection).await?;
    }
    Ok(())
}

/// Says that the files hold nothing of a sweep any more.
pub async fn drop_homes(connection: &mut Connection, sweep: i64) -> sqlx::Result<()> {
    for sql in ["DELETE FROM parts WHERE sweep = $1", "DELETE FROM solved WHERE sweep = $1"] {
        sqlx::query(sql).bind(sweep).execute(&mut *connection).await?;
    }
    Ok(())
}

/// Which results are taken out of the catalogue.
#[derive(Debug, Clone, Copy)]
pub enum Which {
    /// Those that failed.
    Failed,
    /// Those that live in the files of a chunk.
    Home(i64, i64),
}

/// Takes results of a sweep out of the catalogue, so that their runs can be done again.
pub async fn take_out(
    connection: &mut Connection,
    sweep: i64,
    which: Which,
) -> sqlx::Result<TakenOut> {
    let rows = match which {
        Which::Failed => {
            sqlx::query(
                "SELECT run_index, chunk, status, home_sweep, home_chunk FROM runs \
                 WHERE sweep = $1 AND status = 'failed' ORDER BY run_index",
            )
            .bind(sweep)
            .fetch_all(&mut *connection)
            .await?
        }
        // By way of the indices that the home's runs lie between, of which there is an index.
        Which::Home(home_sweep, home_chunk) => {
            sqlx::query(
                "SELECT r.run_index, r.chunk, r.status, r.home_sweep, r.home_chunk FROM homes h \
                 JOIN runs r ON r.sweep = h.sweep AND r.chunk = h.chunk \
                     AND r.run_index >= h.first_index AND r.run_index <= h.last_index \
                     AND r.home_sweep = h.home_sweep AND r.home_chunk = h.home_chunk \
                 WHERE h.home_sweep = $2 AND h.home_chunk = $3 AND h.sweep = $1 ORDER BY r.run_index",
            )
            .bind(sweep)
            .bind(home_sweep)
            .bind(home_chunk)
            .fetch_all(&mut *connection)
            .await?
        }
    };
    let mut taken = TakenOut::default();
    let mut chunks = BTreeSet::new();
    for row in &rows {
        let (index, chunk): (i64, i64) = (row.get("run_index"), row.get("chunk"));
        let home: (i64, i64) = (row.get("home_sweep"), row.get("home_chunk"));
        taken.add(index, Status::from_name(row.get("status")), home != (sweep, chunk));
        chunks.insert(chunk);
        sqlx::query("DELETE FROM runs WHERE sweep = $1 AND run_index = $2")
            .bind(sweep)
            .bind(index)
            .execute(&mut *connection)
            .await?;
    }
    for chunk in chunks {
        recount_chunk(connection, sweep, chunk).await?;
    }
    Ok(taken)
}

/// Counts anew where the runs of a chunk live. Its files hold more than its runs now.
pub(super) async fn recount_chunk(
    connection: &mut Connection,
    sweep: i64,
    chunk: i64,
) -> sqlx::Result<()> {
    let span: (Option<i64>, Option<i64>) = sqlx::query_as(
        "SELECT MIN(first_index), MAX(last_index) FROM homes WHERE sweep = $1 AND chunk = $2",
    )
    .bind(sweep)
    .bind(chunk)
    .fetch_one(&mut *connection)
    .await?;
    sqlx::query("DELETE FROM homes WHERE sweep = $1 AND chunk = $2")
        .bind(sweep)
        .bind(chunk)
        .execute(&mut *connection)
        .await?;
    sqlx::query(
        "INSERT INTO homes \
         (sweep, chunk, home_sweep, home_chunk, runs, first_index, last_index, is_mixed) \
         SELECT sweep, chunk, home_sweep, home_chunk, COUNT(*), MIN(run_index), MAX(run_index), 1 FROM runs \
         WHERE sweep = $1 AND chunk = $2 AND run_index >= $3 AND run_index <= $4 \
         GROUP BY sweep, chunk, home_sweep, home_chunk",
    )
    .bind(sweep)
    .bind(chunk)
    .bind(span.0)
    .bind(span.1)
    .execute(connection)
    .await?;
    Ok(())
}

/// The chunks whose rows stand in a file, and the sweeps with runs that live there.
pub async fn rows_of_homes(
    connection: &mut Connection,
    path: &str,
) -> sqlx::Result<Vec<(i64, i64, HashSet<i64>)>> {
    let rows: Vec<(i64, i64, Option<i64>)> = sqlx::query_as(
        "SELECT p.sweep, p.chunk, h.sweep FROM parts p \
         LEFT JOIN homes h ON h.home_sweep = p.sweep AND h.home_chunk = p.chunk WHERE p.path = $1",
    )
    .bind(path)
    .fetch_all(connection)
    .await?;
    let mut homes: BTreeMap<(i64, i64), HashSet<i64>> = BTreeMap::new();
    for (sweep, chunk, guest) in rows {
        homes.entry((sweep, chunk)).or_default().extend(guest);
    }
    Ok(homes.into_iter().map(|((sweep, chunk), guests)| (sweep, chunk, guests)).collect())
}

/// Statements that find what contradicts itself, each with what it means; a row of theirs is one sentence.
const CONTRADICTIONS: [(&str, &str); 9] = [
    (
        "the counts of a sweep do not add up to its total",
        "SELECT s.id || ': ' || COALESCE(SUM(t.runs), 0) || ' of ' || s.total FROM sweeps s \
         LEFT JOIN tallies t ON t.sweep = s.sweep WHERE s.phase <> 'deleted' \
         GROUP BY s.sweep HAVING COALESCE(SUM(t.runs), 0) <> s.total",
    ),
    (
        "the count of a status differs from the runs stored",
        "SELECT s.id || ': ' || t.status || ' ' || t.runs FROM tallies t \
         JOIN sweeps s ON s.sweep = t.sweep AND s.phase <> 'deleted' \
         WHERE t.status NOT IN ('queued', 'running', 'cancelled') AND t.runs <> \
         (SELECT COUNT(*) FROM runs r WHERE r.sweep = t.sweep AND r.status = t.status)",
    ),
    (
        "runs of a status that is not counted",
        "SELECT s.id || ': ' || r.status FROM runs r \
         JOIN sweeps s ON s.sweep = r.sweep AND s.phase <> 'deleted' \
         WHERE NOT EXISTS (SELECT 1 FROM tallies t WHERE t.sweep = r.sweep AND t.status = r.status) \
         GROUP BY s.sweep, r.status",
    ),
    (
        "the queued, running or cancelled chunks differ from their count",
        "SELECT s.id || ': ' || t.status || ' ' || t.runs FROM tallies t \
         JOIN sweeps s ON s.sweep = t.sweep AND s.phase <> 'deleted' \
         WHERE t.status IN ('queued', 'running', 'cancelled') AND t.runs <> \
         (SELECT COALESCE(SUM(c.run_count), 0) FROM chunks c WHERE c.sweep = t.sweep AND c.state = \
         CASE t.status WHEN 'running' THEN 'leased' ELSE t.status END)",
    ),
    (
        "runs whose rows are in no file",
        "SELECT s.id || ': ' || h.runs || ' runs of chunk ' || h.chunk FROM homes h \
         JOIN sweeps s ON s.sweep = h.sweep WHERE NOT EXISTS \
         (SELECT 1 FROM parts p WHERE p.sweep = h.home_sweep AND p.chunk = h.home_chunk AND p.kind = 'runs')",
    ),
    (
        "where runs live is counted wrongly",
        "WITH there (sweep, chunk, home_sweep, home_chunk, runs) AS ( \
             SELECT sweep, chunk, home_sweep, home_chunk, COUNT(*) FROM runs \
             GROUP BY sweep, chunk, home_sweep, home_chunk), \
         counted (sweep, chunk, home_sweep, home_chunk, runs) AS ( \
             SELECT sweep, chunk, home_sweep, home_chunk, runs FROM homes) \
         SELECT s.id || ': chunk ' || d.chunk FROM ( \
             SELECT sweep, chunk FROM (SELECT * FROM there EXCEPT SELECT * FROM counted) \
             UNION SELECT sweep, chunk FROM (SELECT * FROM counted EXCEPT SELECT * FROM there)) d \
         JOIN sweeps s ON s.sweep = d.sweep AND s.phase <> 'deleted'",
    ),
    (
        "a chunk that is to be done has a result already",
        "SELECT s.id || ': chunk ' || c.chunk FROM chunks c \
         JOIN sweeps s ON s.sweep = c.sweep AND s.phase <> 'deleted' WHERE c.state <> 'done' AND EXISTS ( \
         SELECT 1 FROM runs r WHERE r.sweep = c.sweep AND r.run_index >= c.first_run \
         AND r.run_index < c.end_run)",
    ),
    (
        "the database is damaged",
        "SELECT quick_check FROM pragma_quick_check WHERE quick_check <> 'ok' LIMIT 5",
    ),
    (
        "rows of a chunk lie beyond the end of their file",
        "SELECT p.path FROM parts p JOIN files f ON f.path = p.path \
         WHERE p.first_row + p.row_count > f.row_count",
    ),
];

/// What contradicts itself in the catalogue, a sentence each.
pub async fn counts(connection: &mut Connection) -> sqlx::Result<Vec<String>> {
    let mut found = Vec::new();
    for (meaning, sql) in CONTRADICTIONS {
        let rows: Vec<String> = sqlx::query_scalar(sql).fetch_all(&mut *connection).await?;
        found.extend(rows.into_iter().map(|row| format!("{meaning}: {row}")));
    }
    Ok(found)
}

/// Writes a consistent copy of the database to a path where there is none.
pub async fn copy_database(connection: &mut Connection, target: &str) -> sqlx::Result<()> {
    sqlx::query("VACUUM INTO $1").bind(target).execute(connection).await?;
    Ok(())
}
