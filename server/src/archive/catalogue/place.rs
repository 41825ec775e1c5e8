//! Where the rows of runs stand in files.

use super::super::ArchiveError;
use super::super::schema::{Kind, SCHEMA_VERSION};
use super::seals::sealed_file;
use crate::store::Connection;
use sqlx::sqlite::SqliteRow;
use sqlx::{FromRow, Row};

/// A file as the catalogue knows it.
#[derive(Debug, Clone, PartialEq, Eq, FromRow)]
pub struct Listed {
    /// Path below the archive's folder.
    pub path: String,
    /// Hash of its bytes.
    pub blake3: String,
    /// Its bytes.
    pub byte_count: i64,
    /// Its rows.
    pub row_count: i64,
    /// Version of its schema.
    pub schema_version: i64,
}

/// A stretch of rows of a file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Place {
    /// The file.
    pub file: Listed,
    /// First row.
    pub first_row: i64,
    /// Rows.
    pub row_count: i64,
}

/// Rows of a sweep's table that stand together.
#[derive(Debug, Clone, PartialEq)]
pub struct Piece {
    /// Where.
    pub place: Place,
    /// Ids and the sweep's indices of the wanted runs, ascending, where not every row is a run of this sweep
    /// under its own index.
    pub wanted: Option<Vec<(u128, i64)>>,
}

/// A table of a sweep: groups of pieces, in the order of the runs' indices. The pieces of a group have runs
/// between each other's.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Layout {
    /// The groups.
    pub groups: Vec<Vec<Piece>>,
}

impl Layout {
    /// Rows of the table, where its pieces say how many; of a piece with wanted runs, these.
    pub fn rows(&self) -> usize {
        let of =
            |piece: &Piece| piece.wanted.as_ref().map_or(piece.place.row_count as usize, Vec::len);
        self.groups.iter().flatten().map(of).sum()
    }

    /// The one file that is the whole table in this version's columns, if there is one.
    pub fn as_one_file(&self) -> Option<&Listed> {
        self.as_whole_file().filter(|f| f.schema_version == SCHEMA_VERSION)
    }

    /// The one file that is the whole table, if there is one.
    pub fn as_whole_file(&self) -> Option<&Listed> {
        let mut next_row = 0;
        let mut found: Option<&Listed> = None;
        for group in &self.groups {
            let [Piece { place, wanted: None, .. }] = group.as_slice() else { return None };
            if place.first_row != next_row || found.is_some_and(|f| f.path != place.file.path) {
                return None;
            }
            next_row += place.row_count;
            found = Some(&place.file);
        }
        found.filter(|f| f.row_count == next_row)
    }
}

fn place(row: &SqliteRow) -> sqlx::Result<Place> {
    Ok(Place {
        file: Listed::from_row(row)?,
        first_row: row.get("first_row"),
        row_count: row.get("part_rows"),
    })
}

/// Where the tables of a chunk's solved runs stand.
pub async fn of_home(
    connection: &mut Connection,
    home_sweep: i64,
    home_chunk: i64,
) -> sqlx::Result<Vec<(Kind, Place)>> {
    let rows = sqlx::query(
        "SELECT p.kind, p.first_row, p.row_count AS part_rows, \
         f.path, f.blake3, f.byte_count, f.row_count, f.schema_version \
         FROM parts p JOIN files f ON f.path = p.path WHERE p.sweep = $1 AND p.chunk = $2",
    )
    .bind(home_sweep)
    .bind(home_chunk)
    .fetch_all(connection)
    .await?;
    let kinds = rows.iter().filter_map(|row| Some((row, Kind::from_name(row.get("kind"))?)));
    kinds.map(|(row, kind)| Ok((kind, place(row)?))).collect()
}

/// Chunk and place of a table's rows that a sweep's own chunks solved, in the order of the chunks' runs.
pub async fn parts(
    connection: &mut Connection,
    sweep: i64,
    kind: Kind,
) -> sqlx::Result<Vec<(i64, Place)>> {
    let rows = sqlx::query(
        "SELECT p.chunk, p.first_row, p.row_count AS part_rows, \
         f.path, f.blake3, f.byte_count, f.row_count, f.schema_version \
         FROM parts p JOIN files f ON f.path = p.path \
         LEFT JOIN homes h ON h.sweep = p.sweep AND h.chunk = p.chunk \
             AND h.home_sweep = p.sweep AND h.home_chunk = p.chunk \
         WHERE p.sweep = $1 AND p.kind = $2 ORDER BY h.first_index, p.chunk",
    )
    .bind(sweep)
    .bind(kind.name())
    .fetch_all(connection)
    .await?;
    rows.iter().map(|row| Ok((row.get("chunk"), place(row)?))).collect()
}

/// Where a table of a sweep stands.
pub async fn layout(
    connection: &mut Connection,
    sweep: i64,
    kind: Kind,
) -> Result<Layout, ArchiveError> {
    if let Some(sealed) = sealed_file(connection, sweep, kind).await? {
        let whole = |file: Listed| Place { first_row: 0, row_count: file.row_count, file };
        let piece = sealed.map(|file| vec![Piece { place: whole(file), wanted: None }]);
        return Ok(Layout { groups: piece.into_iter().collect() });
    }
    lay_out(connection, sweep, kind, false).await
}

/// Where a table of a sweep stands, with the wanted runs of every piece.
pub async fn layout_by_run(
    connection: &mut Connection,
    sweep: i64,
    kind: Kind,
) -> Result<Layout, ArchiveError> {
    lay_out(connection, sweep, kind, true).await
}

async fn lay_out(
    connection: &mut Connection,
    sweep: i64,
    kind: Kind,
    by_run: bool,
) -> Result<Layout, ArchiveError> {
    let rows = homes(connection, sweep, kind).await?;
    // Rows of the query whose runs lie between each other's belong together.
    let mut groups: Vec<&[SqliteRow]> = Vec::new();
    let (mut first, mut end) = (0, -1);
    for (i, row) in rows.iter().enumerate() {
        if i > first && row.get::<i64, _>("first_index") > end {
            groups.push(&rows[first..i]);
            first = i;
        }
        end = end.max(row.get("last_index"));
    }
    groups.extend(Some(&rows[first..]).filter(|rest| !rest.is_empty()));
    let mut layout = Layout::default();
    for group in groups {
        let mut pieces = Vec::with_capacity(group.len());
        for row in group {
            let place = place(row)?;
            let home = (row.get("home_sweep"), row.get("home_chunk"));
            let chunk: i64 = row.get("chunk");
            let is_whole = home == (sweep, chunk)
                && row.get::<i64, _>("is_mixed") == 0
                && row.get::<i64, _>("runs") == row.get::<i64, _>("home_runs");
            let wanted = if is_whole && group.len() == 1 && !by_run {
                None
            } else {
                let range = row.get("first_index")..=row.get("last_index");
                Some(indices(connection, sweep, chunk, home, range).await?)
            };
            pieces.push(Piece { place, wanted });
        }
        layout.groups.push(pieces);
    }
    Ok(layout)
}

/// What a sweep's table is, as a hash: it changes whenever the table's rows, their order or their files do.
/// Looks at no run, since a chunk's runs are stored once, under a number that no other chunk gets, and then
/// only ever taken out: how many there are in a home tells which.
pub async fn mark(
    connection: &mut Connection,
    sweep: i64,
    kind: Kind,
) -> sqlx::Result<blake3::Hash> {
    let mut hasher = blake3::Hasher::new();
    if let Some(sealed) = sealed_file(connection, sweep, kind).await? {
        hasher.update(b"sealed");
        if let Some(file) = sealed {
            hasher.update(&file.schema_version.to_le_bytes()).update(file.blake3.as_bytes());
        }
        return Ok(hasher.finalize());
    }
    for row in homes(connection, sweep, kind).await? {
        let place = place(&row)?;
        for column in ["chunk", "home_sweep", "home_chunk", "runs", "first_index", "last_index"] {
            hasher.update(&row.get::<i64, _>(column).to_le_bytes());
        }
        for number in [row.get("is_mixed"), row.get("home_runs"), place.first_row, place.row_count]
        {
            hasher.update(&i64::to_le_bytes(number));
        }
        hasher.update(&place.file.schema_version.to_le_bytes());
        // A hash has one length, and so nothing runs into the next row.
        hasher.update(place.file.blake3.as_bytes());
    }
    Ok(hasher.finalize())
}

/// The homes of a sweep's runs, each with the place of the table's rows, in the order of the runs.
async fn homes(
    connection: &mut Connection,
    sweep: i64,
    kind: Kind,
) -> sqlx::Result<Vec<SqliteRow>> {
    sqlx::query(
        "SELECT h.chunk, h.home_sweep, h.home_chunk, h.runs, h.first_index, h.last_index, h.is_mixed, \
         p.first_row, p.row_count AS part_rows, r.row_count AS home_runs, \
         f.path, f.blake3, f.byte_count, f.row_count, f.schema_version \
         FROM homes h \
         JOIN parts r ON r.sweep = h.home_sweep AND r.chunk = h.home_chunk AND r.kind = 'runs' \
         JOIN parts p ON p.sweep = h.home_sweep AND p.chunk = h.home_chunk AND p.kind = $2 \
         JOIN files f ON f.path = p.path \
         WHERE h.sweep = $1 ORDER BY h.first_index, h.chunk, h.home_sweep, h.home_chunk",
    )
    .bind(sweep)
    .bind(kind.name())
    .fetch_all(connection)
    .await
}

/// A chunk's ids and indices of the runs that live in one home, ascending.
async fn indices(
    connection: &mut Connection,
    sweep: i64,
    chunk: i64,
    home: (i64, i64),
    range: std::ops::RangeInclusive<i64>,
) -> sqlx::Result<Vec<(u128, i64)>> {
    let rows: Vec<(String, i64)> = sqlx::query_as(
        "SELECT run_id, run_index FROM runs WHERE sweep = $1 AND run_index >= $2 AND run_index <= $3 \
         AND chunk = $4 AND home_sweep = $5 AND home_chunk = $6",
    )
    .bind(sweep)
    .bind(range.start())
    .bind(range.end())
    .bind(chunk)
    .bind(home.0)
    .bind(home.1)
    .fetch_all(connection)
    .await?;
    let mut indices: Vec<(u128, i64)> =
        rows.into_iter().filter_map(|(id, index)| Some((id_number(&id)?, index))).collect();
    indices.sort_unstable();
    Ok(indices)
}

/// A run's id as a number, which is half as long.
pub fn id_number(id: &str) -> Option<u128> {
    u128::from_str_radix(id, 16).ok()
}
