//! Sealed sweeps: what they are cited by, their files, and how their runs move into files of their own.

use super::super::ensemble::manifest::Manifest;
use super::super::files::Written;
use super::super::schema::Kind;
use super::care::{self, recount_chunk};
use super::place::Listed;
use crate::store::Connection;
use sqlx::{FromRow, Row};

/// A seal with what it holds together.
#[derive(Debug, Clone, PartialEq)]
pub struct StoredSeal {
    /// What it is cited by, and its files with their hashes.
    pub manifest: Manifest,
    /// What was solved, byte for byte as it was hashed.
    pub spec: String,
    /// Its tables.
    pub files: Vec<(Kind, Listed)>,
}

/// A table of a sealed sweep that was just written: its file, SHA-256, and first row and rows of each stretch.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SealedTables {
    /// The file.
    pub written: Written,
    /// SHA-256 of its bytes.
    pub sha256: String,
    /// First row and rows of each stretch.
    pub rows: Vec<(i64, i64)>,
}

/// Runs of a sealed sweep that stand together: a chunk of their own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stretch {
    /// Index of the first run.
    pub first: i64,
    /// Index after the last one.
    pub end: i64,
}

/// Where runs of a chunk live: a row of `homes`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, FromRow)]
pub struct Home {
    chunk: i64,
    home_sweep: i64,
    home_chunk: i64,
    runs: i64,
    first_index: i64,
    last_index: i64,
}

/// Where a sweep's runs live; changes whenever a run gets another result.
pub async fn homes_of(connection: &mut Connection, sweep: i64) -> sqlx::Result<Vec<Home>> {
    sqlx::query_as(
        "SELECT chunk, home_sweep, home_chunk, runs, first_index, last_index FROM homes \
         WHERE sweep = $1 ORDER BY chunk, home_sweep, home_chunk",
    )
    .bind(sweep)
    .fetch_all(connection)
    .await
}

/// Index of the first run of each chunk of a sweep, ascending.
pub async fn starts_of(connection: &mut Connection, sweep: i64) -> sqlx::Result<Vec<i64>> {
    sqlx::query_scalar(
        "SELECT MIN(first_index) AS first FROM homes WHERE sweep = $1 GROUP BY chunk ORDER BY first",
    )
    .bind(sweep)
    .fetch_all(connection)
    .await
}

/// Whether a sweep is sealed.
pub async fn is_sealed(connection: &mut Connection, sweep: i64) -> sqlx::Result<bool> {
    let found: Option<i64> = sqlx::query_scalar("SELECT 1 FROM seals WHERE sweep = $1")
        .bind(sweep)
        .fetch_optional(connection)
        .await?;
    Ok(found.is_some())
}

/// Whether a file is a sealed sweep's.
pub async fn is_sealed_file(connection: &mut Connection, path: &str) -> sqlx::Result<bool> {
    let found: Option<i64> = sqlx::query_scalar("SELECT 1 FROM sealed_files WHERE path = $1")
        .bind(path)
        .fetch_optional(connection)
        .await?;
    Ok(found.is_some())
}

/// Says which sealed sweeps have a damaged file: these and no others.
pub async fn set_damaged(connection: &mut Connection, sweeps: &[i64]) -> sqlx::Result<()> {
    sqlx::query("UPDATE seals SET is_damaged = 0 WHERE is_damaged = 1")
        .execute(&mut *connection)
        .await?;
    for sweep in sweeps {
        sqlx::query("UPDATE seals SET is_damaged = 1 WHERE sweep = $1")
            .bind(sweep)
            .execute(&mut *connection)
            .await?;
    }
    Ok(())
}

/// Id of the sweep that was sealed with a content hash; the first one if there are several.
pub async fn sealed_as(connection: &mut Connection, hash: &str) -> sqlx::Result<Option<String>> {
    sqlx::query_scalar(
        "SELECT s.id FROM seals l JOIN sweeps s ON s.sweep = l.sweep WHERE l.content_hash = $1 \
         ORDER BY l.sweep LIMIT 1",
    )
    .bind(hash)
    .fetch_optional(connection)
    .await
}

/// The seal of a sweep, if it has one.
pub async fn stored_seal(
    connection: &mut Connection,
    sweep: i64,
) -> sqlx::Result<Option<StoredSeal>> {
    let row = sqlx::query("SELECT manifest, spec FROM seals WHERE sweep = $1")
        .bind(sweep)
        .fetch_optional(&mut *connection)
        .await?;
    let Some(row) = row else { return Ok(None) };
    let manifest = serde_json::from_str(row.get("manifest"));
    let manifest = manifest.map_err(|e| sqlx::Error::Decode(Box::new(e)))?;
    let rows = sqlx::query(
        "SELECT s.kind, f.path, f.blake3, f.byte_count, f.row_count, f.schema_version \
         FROM sealed_files s JOIN files f ON f.path = s.path WHERE s.sweep = $1 ORDER BY s.kind",
    )
    .bind(sweep)
    .fetch_all(connection)
    .await?;
    let files = rows.iter().filter_map(|row| Some((row, Kind::from_name(row.get("kind"))?)));
    let files = files.map(|(row, kind)| Ok((kind, Listed::from_row(row)?)));
    let files = files.collect::<sqlx::Result<_>>()?;
    Ok(Some(StoredSeal { manifest, spec: row.get("spec"), files }))
}

/// A table's file of a sealed sweep; the inner none if the sweep has no such table.
pub(super) async fn sealed_file(
    connection: &mut Connection,
    sweep: i64,
    kind: Kind,
) -> sqlx::Result<Option<Option<Listed>>> {
    if !is_sealed(connection, sweep).await? {
        return Ok(None);
    }
    let file = sqlx::query_as(
        "SELECT f.path, f.blake3, f.byte_count, f.row_count, f.schema_version \
         FROM sealed_files s JOIN files f ON f.path = s.path WHERE s.sweep = $1 AND s.kind = $2",
    )
    .bind(sweep)
    .bind(kind.name())
    .fetch_optional(connection)
    .await?;
    Ok(Some(file))
}

/// Seals a sweep whose runs live in the files given.
pub async fn insert_seal(
    connection: &mut Connection,
    sweep: i64,
    manifest: &Manifest,
    spec: &str,
    files: &[&Written],
) -> sqlx::Result<()> {
    let text = serde_json::to_string(manifest).map_err(|e| sqlx::Error::Encode(Box::new(e)))?;
    sqlx::query("INSERT INTO seals (sweep, content_hash, manifest, spec) VALUES ($1, $2, $3, $4)")
        .bind(sweep)
        .bind(&manifest.content_hash)
        .bind(text)
        .bind(spec)
        .execute(&mut *connection)
        .await?;
    for file in files {
        sqlx::query("INSERT INTO sealed_files (sweep, kind, path) VALUES ($1, $2, $3)")
            .bind(sweep)
            .bind(file.kind.name())
            .bind(&file.path)
            .execute(&mut *connection)
            .await?;
    }
    sqlx::query("UPDATE sweeps SET is_compact = 1 WHERE sweep = $1")
        .bind(sweep)
        .execute(connection)
        .await?;
    Ok(())
}

/// Makes a sweep's new tables the home of its runs and of the runs that others took over from it: chunks are
/// cut anew by the stretches. `again` are indices of runs that stand in the sweep before already, with the
/// index where. Files that nobody uses any more are told.
pub async fn gather_in(
    connection: &mut Connection,
    sweep: i64,
    stretches: &[Stretch],
    again: &[(i64, i64)],
    tables: &[SealedTables],
) -> sqlx::Result<Vec<String>> {
    let base: i64 = sqlx::query_scalar(
        "SELECT 1 + MAX(COALESCE((SELECT MAX(chunk) FROM homes WHERE sweep = $1), 0), \
         COALESCE((SELECT MAX(home_chunk) FROM homes WHERE home_sweep = $1), 0), \
         COALESCE((SELECT MAX(chunk) FROM parts WHERE sweep = $1), 0))",
    )
    .bind(sweep)
    .fetch_one(&mut *connection)
    .await?;
    for (chunk, stretch) in (base..).zip(stretches) {
        sqlx::query(
            "UPDATE runs SET chunk = $2 WHERE sweep = $1 AND run_index >= $3 AND run_index < $4",
        )
        .bind(sweep)
        .bind(chunk)
        .bind(stretch.first)
        .bind(stretch.end)
        .execute(&mut *connection)
        .await?;
    }
    move_guests(connection, sweep).await?;
    sqlx::query("UPDATE runs SET home_sweep = sweep, home_chunk = chunk WHERE sweep = $1")
        .bind(sweep)
        .execute(&mut *connection)
        .await?;
    for (index, first) in again {
        sqlx::query(
            "UPDATE runs SET home_chunk = \
             (SELECT f.chunk FROM runs f WHERE f.sweep = $1 AND f.run_index = $3) \
             WHERE sweep = $1 AND run_index = $2",
        )
        .bind(sweep)
        .bind(index)
        .bind(first)
        .execute(&mut *connection)
        .await?;
    }
    sqlx::query("DELETE FROM homes WHERE sweep = $1").bind(sweep).execute(&mut *connection).await?;
    sqlx::query(
        "INSERT INTO homes \
         (sweep, chunk, home_sweep, home_chunk, runs, first_index, last_index, is_mixed) \
         SELECT sweep, chunk, home_sweep, home_chunk, COUNT(*), MIN(run_index), MAX(run_index), 1 \
         FROM runs WHERE sweep = $1 GROUP BY sweep, chunk, home_sweep, home_chunk",
    )
    .bind(sweep)
    .execute(&mut *connection)
    .await?;
    for SealedTables { written, rows, .. } in tables {
        care::insert_file(connection, written).await?;
        for (chunk, (first_row, row_count)) in (base..).zip(rows).filter(|(_, (_, n))| *n > 0) {
            care::place_in(connection, sweep, chunk, written, *first_row, *row_count).await?;
        }
    }
    sqlx::query(
        "DELETE FROM parts WHERE sweep = $1 AND NOT EXISTS \
         (SELECT 1 FROM homes h WHERE h.home_sweep = parts.sweep AND h.home_chunk = parts.chunk)",
    )
    .bind(sweep)
    .execute(&mut *connection)
    .await?;
    care::drop_unused_files(connection).await
}

/// Moves runs that other sweeps took over from this one to the chunk where this one's now are. Their numbers
/// are the same, since it is the same result.
async fn move_guests(connection: &mut Connection, sweep: i64) -> sqlx::Result<()> {
    let homes: Vec<(i64, i64)> = sqlx::query_as(
        "SELECT DISTINCT sweep, chunk FROM homes WHERE home_sweep = $1 AND sweep <> $1",
    )
    .bind(sweep)
    .fetch_all(&mut *connection)
    .await?;
    for (guest, chunk) in homes {
        sqlx::query(
            "UPDATE runs SET home_chunk = \
                 (SELECT MIN(o.chunk) FROM runs o WHERE o.run_id = runs.run_id AND o.sweep = $1) \
             WHERE sweep = $2 AND chunk = $3 AND home_sweep = $1 \
             AND run_index >= (SELECT MIN(h.first_index) FROM homes h WHERE h.sweep = $2 AND h.chunk = $3) \
             AND run_index <= (SELECT MAX(h.last_index) FROM homes h WHERE h.sweep = $2 AND h.chunk = $3) \
             AND EXISTS (SELECT 1 FROM runs o WHERE o.run_id = runs.run_id AND o.sweep = $1 \
                 AND o.home_sweep = $1 AND o.home_chunk = runs.home_chunk)",
        )
        .bind(sweep)
        .bind(guest)
        .bind(chunk)
        .execute(&mut *connection)
        .await?;
        recount_chunk(connection, guest, chunk).await?;
    }
    Ok(())
}
