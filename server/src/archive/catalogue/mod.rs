//! The catalogue: which runs there are, their numbers, and where their tables stand. All of the archive's
//! SQL stands in this folder. Knows no queue.

mod across;
mod arrivals;
mod at;
mod care;
#[cfg(test)]
mod filled;
mod filter;
mod foreign;
mod insert;
mod list;
mod nearest;
mod place;
mod results;
mod seals;
mod sheet;
mod solved;

pub use across::{Across, Candidate, Spot, count_across, holding, runs_across};
pub use arrivals::{Known, imported_as, known_results, send_home};
pub use at::runs_at;
pub use care::{
    Which, all_files, bytes_of, clear_runs, compacted, copy_database, counts, drop_home,
    drop_homes, drop_unused_files, guests_of, insert_file, place_in, rows_of_homes, size, take_out,
    waiting_for_compaction,
};
pub use foreign::{
    Counterpart, Foreign, candidates, foreign_rows, foreign_table, foreign_tables, insert_foreign,
    remove_foreign,
};
pub use insert::{adopt, insert, is_empty, known};
pub use list::{
    Listing, Order, Total, count, count_stored, failures, is_column, is_number, kind_of, runs,
};
pub use nearest::{Near, nearest};
pub use place::{Layout, Listed, Piece, Place, id_number, layout, layout_by_run, mark, parts};
pub use results::results;
pub use seals::{
    Home, SealedTables, StoredSeal, Stretch, gather_in, homes_of, insert_seal, is_sealed_file,
    sealed_as, set_damaged, starts_of, stored_seal,
};
pub use sheet::{Column, Extract, Sheet, Unsolved, sheet, sheet_rows, unsolved};
pub use solved::{
    Address, address, addresses, chunks_of, entries, insert_solved, places_of, tells_provenance,
};

use super::ArchiveError;
use super::schema::Kind;
use crate::domain::outcome::{SCALARS, Scalars};
use crate::domain::parameters::{PARAMETERS, Parameters};
use crate::domain::provenance::Provenance;
use crate::store::Connection;
use serde::Serialize;
use serde_json::Value;
use sqlx::{Row, sqlite::SqliteRow};
use utoipa::ToSchema;

/// Columns of the runs that are neither parameters nor scalars.
pub const TEXT_COLUMNS: [&str; 8] = [
    "run_id",
    "status",
    "detail",
    "regime",
    "upstream_closure",
    "root_evidence",
    "validity",
    "grid_convergence",
];
const WHOLE_COLUMNS: [&str; 3] = ["run_index", "iterations", "attempts"];
/// The time that a run took, which is no number of its result.
const SOLVE_SECONDS: &str = "solve_seconds";
/// Parameters of a sweep that the catalogue has an index of.
pub const AXES: usize = 4;

/// A run with everything but its tables, and where those stand.
#[derive(Debug, Clone, PartialEq)]
pub struct Entry {
    /// Its row.
    pub row: RunRow,
    /// Its scalars, typed.
    pub scalars: Scalars,
    /// Its parameters, typed.
    pub parameters: Parameters,
    /// Residual norms of a failed run's last attempt.
    pub residual_history: Option<Vec<f64>>,
    /// Its tables.
    pub places: Vec<(Kind, Place)>,
    /// Who solved it and when, as far as that is known.
    pub solved_by: Option<Provenance>,
}

impl Entry {
    /// Where a table of the run stands.
    pub fn place(&self, kind: Kind) -> Option<&Place> {
        self.places.iter().find(|(k, _)| *k == kind).map(|(_, place)| place)
    }
}

/// A run by id, from whichever sweep holds it; the newest result that did not fail,
/// if it was solved again.
pub async fn run(connection: &mut Connection, run_id: &str) -> Result<Option<Entry>, ArchiveError> {
    let row = sqlx::query(
        "SELECT * FROM runs WHERE run_id = $1 \
         ORDER BY status = 'failed', home_sweep DESC, home_chunk DESC LIMIT 1",
    )
    .bind(run_id)
    .fetch_optional(&mut *connection)
    .await?;
    let Some(row) = row else { return Ok(None) };
    let home = (row.get("home_sweep"), row.get("home_chunk"));
    let places = place::of_home(connection, home.0, home.1).await?;
    let solved_by = solved::solved_by(connection, home).await?;
    Ok(Some(Entry { solved_by, ..entry(&row, places)? }))
}

/// A run's row, with where its tables stand.
fn entry(row: &SqliteRow, places: Vec<(Kind, Place)>) -> Result<Entry, ArchiveError> {
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
    let history: Option<String> = row.get("residual_history");
    let residual_history = history.and_then(|text| serde_json::from_str(&text).ok());
    let row = run_row(row);
    Ok(Entry { row, scalars, parameters, residual_history, places, solved_by: None })
}

/// A run's scalars, as listed: parameters and results by name; numbers that do not exist are null.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
#[serde(transparent)]
#[schema(value_type = Object)]
pub struct RunRow(pub serde_json::Map<String, Value>);

impl RunRow {
    /// A member as text.
    pub fn text(&self, name: &str) -> &str {
        self.0.get(name).and_then(Value::as_str).unwrap_or_default()
    }

    /// A member as a whole number.
    pub fn whole(&self, name: &str) -> Option<u64> {
        self.0.get(name).and_then(Value::as_u64)
    }
}

fn run_row(row: &SqliteRow) -> RunRow {
    let mut map = serde_json::Map::new();
    for name in TEXT_COLUMNS {
        map.insert(name.into(), row.get::<Option<String>, _>(name).into());
    }
    for name in WHOLE_COLUMNS {
        map.insert(name.into(), row.get::<Option<i64>, _>(name).into());
    }
    for p in &PARAMETERS {
        let value: f64 = row.get(p.name);
        map.insert(p.name.into(), if p.whole { (value as i64).into() } else { value.into() });
    }
    for s in SCALARS {
        map.insert(s.name.into(), row.get::<Option<f64>, _>(s.name).into());
    }
    map.insert(SOLVE_SECONDS.into(), row.get::<Option<f64>, _>(SOLVE_SECONDS).into());
    RunRow(map)
}

#[cfg(test)]
mod tests;
