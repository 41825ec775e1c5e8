//! The runs of a dataset: identity, status, parameters and numbers, each along `run`.

use super::dataset::{Dataset, Variable, unwritten};
use crate::archive::ArchiveError;
use crate::archive::catalogue::id_number;
use crate::archive::schema::Kind;
use crate::domain::status::Status;
use arrow_array::RecordBatch;
use arrow_array::cast::AsArray;
use arrow_array::types::{Float64Type, Int64Type, UInt64Type};
use arrow_schema::DataType;
use arrow_select::concat::concat_batches;
use std::collections::HashMap;
use std::io;

/// Coordinates of what lies along `run` alone.
pub const ALONG_RUN: &str = "run_id";

/// All runs, in the order of their indices.
#[derive(Debug)]
pub struct Runs {
    table: RecordBatch,
    ids: Vec<u128>,
    with_id: HashMap<u128, Vec<usize>>,
    cells: Vec<usize>,
}

impl Runs {
    /// From the rows of their table.
    pub fn new(batches: &[RecordBatch]) -> Result<Self, ArchiveError> {
        let table = concat_batches(&Kind::Runs.schema(), batches)
            .map_err(|e| unwritten(io::Error::other(e)))?;
        let number = |id: Option<&str>| id.and_then(id_number).unwrap_or_default();
        let ids: Vec<u128> = table.column(0).as_string::<i32>().iter().map(number).collect();
        let mut with_id: HashMap<u128, Vec<usize>> = HashMap::with_capacity(ids.len());
        ids.iter().enumerate().for_each(|(run, id)| with_id.entry(*id).or_default().push(run));
        let cells = table.column_by_name("n_cells").map(|column| {
            column.as_primitive::<Int64Type>().values().iter().map(|n| *n as usize).collect()
        });
        Ok(Self { table, ids, with_id, cells: cells.unwrap_or_default() })
    }

    /// How many.
    pub fn count(&self) -> usize {
        self.ids.len()
    }

    /// Numbers of them all.
    pub fn numbers(&self) -> u64 {
        (self.count() * self.table.num_columns()) as u64
    }

    /// Their ids.
    pub fn ids(&self) -> &[u128] {
        &self.ids
    }

    /// Those with an id, ascending.
    pub fn with_id(&self, id: u128) -> &[usize] {
        self.with_id.get(&id).map(Vec::as_slice).unwrap_or_default()
    }

    /// Cells of each one's grid.
    pub fn cells(&self) -> &[usize] {
        &self.cells
    }

    /// Puts them into a dataset.
    pub fn put(&self, dataset: &mut Dataset) -> Result<(), ArchiveError> {
        dataset.dimension("run", self.count())?;
        for (field, column) in self.table.schema().fields().iter().zip(self.table.columns()) {
            let of = |key: &str| field.metadata().get(key).map(String::as_str).unwrap_or_default();
            // The place in the sweep is the coordinate of the runs.
            let (name, coordinates) = match field.name().as_str() {
                "run_index" => ("run", ""),
                "run_id" => ("run_id", ""),
                name => (name, ALONG_RUN),
            };
            let variable = Variable {
                name,
                dimensions: &["run"],
                unit: of("unit"),
                meaning: of("meaning"),
                coordinates,
            };
            match field.data_type() {
                DataType::Float64 => {
                    let column = column.as_primitive::<Float64Type>();
                    let values: Vec<f64> =
                        column.iter().map(|value| value.unwrap_or(f64::NAN)).collect();
                    dataset.reals(variable, &values)?;
                }
                DataType::Int64 => {
                    dataset.wholes(variable, column.as_primitive::<Int64Type>().iter())?;
                }
                // Documents, which may be long; Parquet has them.
                DataType::Utf8 if name == "options" => {}
                DataType::Utf8 => {
                    let column = column.as_string::<i32>();
                    let texts: Vec<&str> = column.iter().map(Option::unwrap_or_default).collect();
                    dataset.texts(variable, &texts)?;
                    if name == "status" {
                        flags(dataset, &texts)?;
                    }
                }
                // Seeds, as text: all their digits count, and many runs have none.
                DataType::UInt64 => {
                    let seeds = column.as_primitive::<UInt64Type>().iter();
                    let texts: Vec<String> = seeds
                        .map(|seed| seed.map_or_else(String::new, |s| s.to_string()))
                        .collect();
                    dataset
                        .texts(variable, &texts.iter().map(String::as_str).collect::<Vec<_>>())?;
                }
                // Residual histories.
                _ => {}
            }
        }
        Ok(())
    }
}

/// The status as flags, for whoever does not compare texts.
fn flags(dataset: &mut Dataset, texts: &[&str]) -> Result<(), ArchiveError> {
    let names = Status::STORED.map(Status::name);
    let place = |text: &&str| names.iter().position(|name| name == text);
    let values: Vec<i8> = texts.iter().map(|text| place(text).map_or(-1, |i| i as i8)).collect();
    let variable = Variable {
        name: "status_flag",
        dimensions: &["run"],
        unit: "1",
        meaning: "how the run ended, as a flag",
        coordinates: ALONG_RUN,
    };
    dataset.flags(variable, &names, &values)
}
