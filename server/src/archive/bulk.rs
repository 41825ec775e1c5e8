//! A whole sweep's table as one file, Parquet or CSV, made from the files of its chunks.

use super::ArchiveError;
use super::files::properties;
use super::read;
use super::schema::Kind;
use arrow_array::cast::AsArray;
use arrow_array::types::{Float64Type, Int64Type};
use arrow_array::{Array, RecordBatch};
use arrow_schema::DataType;
use parquet::arrow::ArrowWriter;
use std::fs::File;
use std::io::{self, Seek};
use std::path::Path;

/// The format of a bulk file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// Apache Parquet.
    Parquet,
    /// Comma separated, with a header; empty where there is no number.
    Csv,
}

/// Writes a sweep's table into a nameless file of the archive's disk; returns it rewound, with its length.
pub fn gather(
    archive: &Path,
    paths: &[String],
    kind: Kind,
    format: Format,
) -> Result<(File, u64), ArchiveError> {
    let fault = |source| ArchiveError::File {
        path: format!("a copy of all {}", kind.name()),
        doing: "written",
        source,
    };
    let damaged = |source| ArchiveError::Parquet { path: kind.name().to_owned(), source };
    let mut file = tempfile::tempfile_in(archive).map_err(fault)?;
    match format {
        Format::Parquet => {
            let mut writer = ArrowWriter::try_new(&mut file, kind.schema(), Some(properties()))
                .map_err(damaged)?;
            for path in paths {
                for batch in read::open(archive, path)? {
                    let batch = batch.and_then(|batch| kind.conform(&batch));
                    let batch = batch.map_err(|e| damaged(e.into()))?;
                    writer.write(&batch).map_err(damaged)?;
                }
            }
            writer.close().map_err(damaged)?;
        }
        Format::Csv => {
            let mut writer = csv::Writer::from_writer(io::BufWriter::new(&mut file));
            let csv_fault = |e: csv::Error| fault(e.into());
            let schema = kind.schema();
            writer.write_record(schema.fields().iter().map(|f| f.name())).map_err(csv_fault)?;
            for path in paths {
                for batch in read::open(archive, path)? {
                    let batch = batch.and_then(|batch| kind.conform(&batch));
                    let batch = batch.map_err(|e| damaged(e.into()))?;
                    for row in 0..batch.num_rows() {
                        writer.write_record(cells(&batch, row)).map_err(csv_fault)?;
                    }
                }
            }
            writer.flush().map_err(fault)?;
        }
    }
    file.rewind().map_err(fault)?;
    let length = file.metadata().map_err(fault)?.len();
    Ok((file, length))
}

/// The cells of a row as text; numbers in the shortest form that reads back to the same bits.
fn cells(batch: &RecordBatch, row: usize) -> Vec<String> {
    batch
        .columns()
        .iter()
        .map(|column| match column.data_type() {
            _ if column.is_null(row) => String::new(),
            DataType::Utf8 => column.as_string::<i32>().value(row).to_owned(),
            DataType::Int64 => column.as_primitive::<Int64Type>().value(row).to_string(),
            DataType::Float64 => format!("{:?}", column.as_primitive::<Float64Type>().value(row)),
            DataType::Boolean => column.as_boolean().value(row).to_string(),
            // Only profiles have lists, and they are not offered as CSV.
            _ => String::new(),
        })
        .collect()
}
