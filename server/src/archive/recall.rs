//! What a chunk solved, back from its files with every stored number and all that it takes to solve it again.

use super::ArchiveError;
use super::catalogue::{Entry, Place, TEXT_COLUMNS};
use super::provenance;
use super::read;
use super::schema::Kind;
use crate::domain::outcome::SCALARS;
use crate::domain::parameters::{PARAMETERS, Parameters};
use crate::domain::provenance::Provenance;
use arrow_array::cast::AsArray;
use arrow_array::types::{Float64Type, Int64Type};
use arrow_array::{Array, RecordBatch};
use arrow_select::concat::concat_batches;
use parquet::errors::ParquetError;
use serde_json::Value;
use std::collections::HashMap;
use std::ops::Range;
use std::path::Path;

/// The tables of a chunk's runs, as they stand in its files.
#[derive(Debug)]
pub struct Recalled(Vec<Table>);

#[derive(Debug)]
struct Table {
    kind: Kind,
    rows: RecordBatch,
    /// Which rows are a run's, which stand together.
    of_run: HashMap<String, Range<usize>>,
}

/// What a run was solved from, as its row tells.
#[derive(Debug, Clone, PartialEq)]
pub struct Origin {
    /// Its index in the sweep that solved it.
    pub run_index: usize,
    /// Its parameters.
    pub parameters: Parameters,
    /// Its closure.
    pub upstream_closure: String,
    /// The rest.
    pub provenance: Provenance,
}

impl Recalled {
    /// Reads all tables of a chunk.
    pub fn read(archive: &Path, places: &[(Kind, Place)]) -> Result<Self, ArchiveError> {
        let tables = places.iter().map(|(kind, place)| Table::read(archive, *kind, place));
        tables.collect::<Result<_, _>>().map(Self)
    }

    /// Adds the tables of another chunk.
    pub fn join(&mut self, other: Self) {
        self.0.extend(other.0);
    }

    /// What runs began from that is not among these chunks' runs.
    pub fn missing_starts(&self) -> Vec<String> {
        let tables = self.0.iter().filter(|table| table.kind == Kind::Runs);
        let runs = tables.flat_map(|table| table.of_run.values().map(move |r| (table, r.start)));
        let mut starts: Vec<String> = runs
            .filter_map(|(table, row)| provenance::of_row(&table.rows, row).started_from)
            .filter(|id| self.rows(Kind::Runs, id).is_none())
            .collect();
        starts.sort_unstable();
        starts.dedup();
        starts
    }

    /// A run's rows of a table, in the columns of the file; none if it has none.
    pub fn rows(&self, kind: Kind, run_id: &str) -> Option<RecordBatch> {
        let mut tables = self.0.iter().filter(|table| table.kind == kind);
        tables.find_map(|table| {
            let rows = table.of_run.get(run_id)?;
            Some(table.rows.slice(rows.start, rows.len()))
        })
    }

    /// The numbers of a run's result that its row has, by name.
    pub fn numbers(&self, run_id: &str) -> HashMap<&'static str, Option<f64>> {
        let Some(row) = self.rows(Kind::Runs, run_id) else { return HashMap::new() };
        let number = |name: &'static str| {
            let column = row.column_by_name(name)?.as_primitive_opt::<Float64Type>()?;
            Some((name, column.is_valid(0).then(|| column.value(0))))
        };
        SCALARS.iter().filter_map(|info| number(info.name)).collect()
    }

    /// What a run's row says beside the numbers of its result: how it ended and what it was asked. Columns that
    /// are younger than the file are left out.
    pub fn description(&self, run_id: &str) -> Vec<(&'static str, Value)> {
        let Some(row) = self.rows(Kind::Runs, run_id) else { return Vec::new() };
        let text = |name: &'static str| {
            let column = row.column_by_name(name)?.as_string_opt::<i32>()?;
            Some((name, column.is_valid(0).then(|| column.value(0)).into()))
        };
        let number = |name: &'static str| {
            let column = row.column_by_name(name)?;
            let whole = column.as_primitive_opt::<Int64Type>().map(|c| c.value(0).into());
            let real = || column.as_primitive_opt::<Float64Type>().map(|c| c.value(0).into());
            Some((name, whole.or_else(real)?))
        };
        let texts = TEXT_COLUMNS.into_iter().filter_map(text);
        texts.chain(PARAMETERS.iter().filter_map(|info| number(info.name))).collect()
    }

    /// What a run was solved from.
    pub fn origin(&self, run_id: &str) -> Option<Origin> {
        let row = self.rows(Kind::Runs, run_id)?;
        let real = |name: &str| {
            let column = row.column_by_name(name)?;
            let whole = || Some(column.as_primitive_opt::<Int64Type>()?.value(0) as f64);
            column.as_primitive_opt::<Float64Type>().map(|c| c.value(0)).or_else(whole)
        };
        let mut parameters = Parameters::default();
        for info in &PARAMETERS {
            // One that is younger than the file has the default.
            if let Some(value) = real(info.name) {
                parameters.set(info.name, value).ok()?;
            }
        }
        let closure = row.column_by_name("upstream_closure")?.as_string_opt::<i32>()?;
        Some(Origin {
            run_index: real("run_index")? as usize,
            parameters,
            upstream_closure: closure.value(0).to_owned(),
            provenance: provenance::of_row(&row, 0),
        })
    }
}

impl Table {
    fn read(archive: &Path, kind: Kind, place: &Place) -> Result<Self, ArchiveError> {
        let path = place.file.path.as_str();
        let damaged = |e: arrow_schema::ArrowError| ArchiveError::Parquet {
            path: path.to_owned(),
            source: ParquetError::External(Box::new(e)),
        };
        let reader = read::rows(archive, place)?;
        let schema = arrow_array::RecordBatchReader::schema(&reader);
        let batches: Vec<RecordBatch> = reader.collect::<Result<_, _>>().map_err(damaged)?;
        let rows = concat_batches(&schema, &batches).map_err(damaged)?;
        let no_ids = || ArchiveError::Column { path: path.to_owned(), column: "run_id" };
        let ids = rows.column_by_name("run_id").ok_or_else(no_ids)?;
        let ids = ids.as_string_opt::<i32>().ok_or_else(no_ids)?;
        let mut of_run: HashMap<String, Range<usize>> = HashMap::new();
        for row in 0..rows.num_rows() {
            match of_run.get_mut(ids.value(row)) {
                // A run that stands in its sweep twice has its rows of the other tables once.
                Some(_) if kind == Kind::Runs => {}
                Some(range) => range.end = row + 1,
                None => drop(of_run.insert(ids.value(row).to_owned(), row..row + 1)),
            }
        }
        Ok(Self { kind, rows, of_run })
    }
}

/// Where a run comes from, with the scenario that it can be solved from again, as far as its row tells.
pub fn provenance(archive: &Path, entry: &Entry) -> Result<Provenance, ArchiveError> {
    let known = entry.solved_by.clone().unwrap_or_default();
    let Some(place) = entry.place(Kind::Runs) else { return Ok(known) };
    let recalled = Recalled::read(archive, &[(Kind::Runs, place.clone())])?;
    let Some(origin) = recalled.origin(entry.row.text("run_id")) else { return Ok(known) };
    let Origin { parameters, upstream_closure, provenance, .. } = origin;
    let options = provenance.options.as_deref();
    let scenario = options.and_then(|options| {
        crate::domain::provenance::scenario(options, &upstream_closure, &parameters)
    });
    let scenario = scenario.and_then(|document| serde_json::to_value(document).ok());
    Ok(Provenance { solved_at: known.solved_at, scenario, ..provenance })
}
