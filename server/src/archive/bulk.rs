//! A whole sweep's table as one file, Parquet or CSV, made from the files its runs live in; and the files
//! of a sweep put together.

use super::ArchiveError;
use super::catalogue::{Layout, Piece, Place, id_number};
use super::files::{self, Written, properties};
use super::read;
use super::schema::{Kind, SCHEMA_VERSION};
use super::splice;
use arrow_array::cast::AsArray;
use arrow_array::types::{Float64Type, Int64Type, UInt64Type};
use arrow_array::{Array, ArrayRef, Int64Array, RecordBatch};
use arrow_schema::{ArrowError, DataType};
use arrow_select::interleave::interleave_record_batch;
use parquet::arrow::ArrowWriter;
use parquet::file::metadata::ParquetMetaDataReader;
use std::fs::File;
use std::io::{self, Seek, Write};
use std::path::Path;
use std::sync::Arc;

/// The format of a bulk file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// Apache Parquet.
    Parquet,
    /// Comma separated, with a header; empty where there is no number, lists as JSON.
    Csv,
}

/// Encoded bytes of a group of rows, after which the next one begins.
const ROW_GROUP_BYTES: usize = 32 << 20;

/// A sweep's table as one open file, and its length: the file it stands in, if it is alone there, else a
/// nameless copy on the archive's disk.
pub fn gather(
    archive: &Path,
    layout: &Layout,
    kind: Kind,
    format: Format,
) -> Result<(File, u64), ArchiveError> {
    let fault = |source| ArchiveError::File {
        path: format!("a copy of all {}", kind.name()),
        doing: "written",
        source,
    };
    let mut file = match layout.as_one_file().filter(|_| format == Format::Parquet) {
        Some(listed) => files::open(archive, listed)?,
        None => {
            let mut file = tempfile::tempfile_in(archive).map_err(fault)?;
            match format {
                Format::Parquet if let Some(places) = splice::whole_files(layout) => {
                    splice::splice(&mut file, archive, &places, kind)?;
                }
                Format::Parquet => {
                    let mut table = Table::new(&mut file, kind)?;
                    each_batch(archive, layout, kind, &mut |batch| table.write(batch))?;
                    table.close()?;
                }
                Format::Csv => csv(&mut file, archive, layout, kind, &fault)?,
            }
            file
        }
    };
    file.rewind().map_err(fault)?;
    let length = file.metadata().map_err(fault)?.len();
    Ok((file, length))
}

/// What stands for the bytes of a bulk file before it is made: changes with the tables that it is made of, and with
/// the versions of what makes it.
pub fn mark(sweep_id: &str, name: &str, tables: &[blake3::Hash]) -> String {
    let versions = format!(
        "{} {SCHEMA_VERSION} {}",
        env!("CARGO_PKG_VERSION"),
        parquet::file::properties::DEFAULT_CREATED_BY
    );
    let mut hasher = blake3::Hasher::new();
    for part in [sweep_id, name, &versions] {
        hasher.update(part.as_bytes()).update(&[0]);
    }
    for table in tables {
        hasher.update(table.as_bytes());
    }
    /// Digits of the hash: enough to never meet another one.
    const DIGITS: usize = 32;
    hasher.finalize().to_hex().chars().take(DIGITS).collect()
}

/// Rows of a Parquet file, by its footer.
pub fn rows_of(file: &File) -> io::Result<u64> {
    let metadata = ParquetMetaDataReader::new().parse_and_finish(file).map_err(io::Error::other)?;
    Ok(metadata.file_metadata().num_rows() as u64)
}

/// Puts the rows of many places into one new file, in their order; tells the file and each place's first
/// row in it.
pub fn put_together(
    archive: &Path,
    path: &str,
    kind: Kind,
    places: &[Place],
) -> Result<(Written, Vec<i64>), ArchiveError> {
    let mut first_rows = Vec::with_capacity(places.len());
    let written = files::write_file(archive, path, kind, |file| {
        let mut table = Table::new(file, kind)?;
        let mut rows = 0;
        for place in places {
            first_rows.push(rows);
            for batch in read::rows(archive, place)? {
                let batch = conform(kind, batch)?;
                rows += batch.num_rows() as i64;
                table.write(&batch)?;
            }
        }
        table.close()?;
        Ok(rows)
    })?;
    Ok((written, first_rows))
}

/// A Parquet file under way, in groups of rows of moderate size.
pub(super) struct Table<W: Write + Send> {
    writer: ArrowWriter<W>,
    kind: Kind,
}

impl<W: Write + Send> Table<W> {
    pub(super) fn new(file: W, kind: Kind) -> Result<Self, ArchiveError> {
        let writer = ArrowWriter::try_new(file, kind.schema(), Some(properties(kind)))
            .map_err(|e| damaged(kind, e))?;
        Ok(Self { writer, kind })
    }

    pub(super) fn write(&mut self, batch: &RecordBatch) -> Result<(), ArchiveError> {
        self.writer.write(batch).map_err(|e| damaged(self.kind, e))?;
        if self.writer.in_progress_size() > ROW_GROUP_BYTES {
            self.writer.flush().map_err(|e| damaged(self.kind, e))?;
        }
        Ok(())
    }

    pub(super) fn close(self) -> Result<(), ArchiveError> {
        self.writer.close().map(drop).map_err(|e| damaged(self.kind, e))
    }
}

pub(super) fn damaged(kind: Kind, e: impl Into<parquet::errors::ParquetError>) -> ArchiveError {
    ArchiveError::of_parquet(format!("a copy of all {}", kind.name()), "written", e.into())
}

fn conform(
    kind: Kind,
    batch: Result<RecordBatch, ArrowError>,
) -> Result<RecordBatch, ArchiveError> {
    batch.and_then(|batch| kind.conform(&batch)).map_err(|e| damaged(kind, e))
}

/// Hands over the rows of a sweep's table, in the order of the runs' indices, each run's rows together.
pub(super) fn each_batch(
    archive: &Path,
    layout: &Layout,
    kind: Kind,
    take: &mut dyn FnMut(&RecordBatch) -> Result<(), ArchiveError>,
) -> Result<(), ArchiveError> {
    for group in &layout.groups {
        if let [Piece { place, wanted: None, .. }] = group.as_slice() {
            for batch in read::rows(archive, place)? {
                take(&conform(kind, batch)?)?;
            }
        } else {
            take(&merged(archive, group, kind)?.0)?;
        }
    }
    Ok(())
}

/// The rows of a group's wanted runs, each run under the sweep's own index, and the index of each row's run.
pub(super) fn merged(
    archive: &Path,
    group: &[Piece],
    kind: Kind,
) -> Result<(RecordBatch, Vec<i64>), ArchiveError> {
    let mut batches = Vec::new();
    // Index in the sweep, batch, row.
    let mut rows: Vec<(i64, usize, usize)> = Vec::new();
    for Piece { place, wanted } in group {
        for batch in read::rows(archive, place)? {
            let batch = conform(kind, batch)?;
            let ids = batch.column(0).as_string::<i32>();
            for row in 0..batch.num_rows() {
                let id = id_number(ids.value(row)).unwrap_or_default();
                let wanted = wanted.as_deref().unwrap_or_default();
                let from = wanted.partition_point(|(i, _)| *i < id);
                let of_id = wanted[from..].iter().take_while(|(i, _)| *i == id);
                rows.extend(of_id.map(|(_, index)| (*index, batches.len(), row)));
            }
            batches.push(batch);
        }
    }
    // Stable: the rows of one run stay in their order.
    rows.sort_by_key(|(index, _, _)| *index);
    if kind == Kind::Runs {
        // A run that stands twice in a sealed sweep's file is one run of a sweep that took it over.
        rows.dedup_by_key(|(index, _, _)| *index);
    }
    let places: Vec<(usize, usize)> = rows.iter().map(|(_, batch, row)| (*batch, *row)).collect();
    if places.is_empty() {
        return Ok((RecordBatch::new_empty(kind.schema()), Vec::new()));
    }
    let references: Vec<&RecordBatch> = batches.iter().collect();
    let merged = interleave_record_batch(&references, &places).map_err(|e| damaged(kind, e))?;
    let indices: Vec<i64> = rows.iter().map(|(i, _, _)| *i).collect();
    let numbered: ArrayRef = Arc::new(Int64Array::from(indices.clone()));
    let schema = merged.schema();
    let columns = schema.fields().iter().zip(merged.columns()).map(|(field, column)| {
        if field.name() == "run_index" { numbered.clone() } else { column.clone() }
    });
    let batch = RecordBatch::try_new(kind.schema(), columns.collect());
    Ok((batch.map_err(|e| damaged(kind, e))?, indices))
}

fn csv(
    file: &mut File,
    archive: &Path,
    layout: &Layout,
    kind: Kind,
    fault: &dyn Fn(io::Error) -> ArchiveError,
) -> Result<(), ArchiveError> {
    let mut writer = csv::Writer::from_writer(io::BufWriter::new(file));
    let csv_fault = |e: csv::Error| match e.into_kind() {
        csv::ErrorKind::Io(e) => fault(e),
        other => fault(io::Error::other(format!("{other:?}"))),
    };
    let schema = kind.schema();
    writer.write_record(schema.fields().iter().map(|f| f.name())).map_err(csv_fault)?;
    each_batch(archive, layout, kind, &mut |batch| {
        for row in 0..batch.num_rows() {
            writer.write_record(cells(batch, row)).map_err(csv_fault)?;
        }
        Ok(())
    })?;
    writer.flush().map_err(fault)
}

/// The cells of a row as text; numbers in the shortest form that reads back to the same bits.
fn cells(batch: &RecordBatch, row: usize) -> Vec<String> {
    batch.columns().iter().map(|column| cell(column, row)).collect()
}

fn cell(column: &ArrayRef, row: usize) -> String {
    if column.is_null(row) {
        return String::new();
    }
    match column.data_type() {
        DataType::Utf8 => column.as_string::<i32>().value(row).to_owned(),
        DataType::Int64 => column.as_primitive::<Int64Type>().value(row).to_string(),
        DataType::UInt64 => column.as_primitive::<UInt64Type>().value(row).to_string(),
        DataType::Float64 => format!("{:?}", column.as_primitive::<Float64Type>().value(row)),
        DataType::Boolean => column.as_boolean().value(row).to_string(),
        DataType::List(_) => {
            let list = column.as_list::<i32>().value(row);
            let numbers: Vec<String> = (0..list.len()).map(|i| cell(&list, i)).collect();
            format!("[{}]", numbers.join(","))
        }
        other => unreachable!("no table has a column of {other}"),
    }
}
