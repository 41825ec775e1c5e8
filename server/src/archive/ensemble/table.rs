//! A table from elsewhere: whether its columns, types and bytes are those of an export, before a row is decoded;
//! then its rows, with only finite numbers.

use super::super::SolvedRun;
use super::super::provenance;
use super::super::schema::{Kind, SCHEMA_VERSION};
use super::manifest::FileEntry;
use super::pages;
use crate::domain::outcome::{Outcome, SCALARS, Scalars};
use crate::domain::parameters::PARAMETERS;
use crate::domain::run::RunSpec;
use crate::domain::status::Status;
use arrow_array::cast::AsArray;
use arrow_array::types::{Float64Type, Int64Type};
use arrow_array::{Array, RecordBatch};
use arrow_schema::{DataType, Field, Schema};
use parquet::arrow::arrow_reader::{ParquetRecordBatchReader, ParquetRecordBatchReaderBuilder};
use parquet::file::FOOTER_SIZE;
use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::Path;

/// Largest footer.
const MOST_FOOTER: u32 = 64 << 20;
/// Largest group of rows, unpacked, bytes.
const MOST_GROUP_BYTES: i64 = 4 << 30;
/// Rows decoded at once: each may hold the longest text of a dictionary in each of its columns.
const ROWS_AT_ONCE: usize = 128;
/// Longest text in a row, bytes.
const MOST_TEXT: usize = 1 << 16;

/// A table that may be read.
#[derive(Debug)]
pub struct Table {
    reader: ParquetRecordBatchReader,
    kind: Kind,
}

impl Table {
    /// Opens a table of a kind whose file and rows are as told; else what is wrong as a sentence.
    pub fn open(path: &Path, kind: Kind, told: &FileEntry) -> Result<Self, String> {
        let version = told.schema_version.unwrap_or_default();
        if version > SCHEMA_VERSION {
            return Err(format!(
                "it has schema version {version}, which this version of melange does not know: use a newer one"
            ));
        }
        let broken = |e: &dyn std::error::Error| format!("it is no Parquet that is read here: {e}");
        let file = File::open(path).map_err(|e| broken(&e))?;
        let length = file.metadata().map_err(|e| broken(&e))?.len();
        let mut footer = [0; FOOTER_SIZE];
        let at = length.checked_sub(FOOTER_SIZE as u64).ok_or("it is no Parquet")?;
        file.read_exact_at(&mut footer, at).map_err(|e| broken(&e))?;
        let footer_bytes = u32::from_le_bytes([footer[0], footer[1], footer[2], footer[3]]);
        if footer_bytes > MOST_FOOTER || u64::from(footer_bytes) > at {
            return Err(format!("its footer has {footer_bytes} bytes"));
        }
        let opened = file.try_clone().map_err(|e| broken(&e))?;
        let builder = ParquetRecordBatchReaderBuilder::try_new(opened).map_err(|e| broken(&e))?;
        check_schema(builder.schema(), kind, version)?;
        let metadata = builder.metadata();
        let rows = metadata.file_metadata().num_rows();
        let grouped = metadata.row_groups().iter().try_fold(0_i64, |sum, group| {
            let is_small = (0..=MOST_GROUP_BYTES).contains(&group.total_byte_size());
            sum.checked_add(Some(group.num_rows()).filter(|n| *n >= 0 && is_small)?)
        });
        if u64::try_from(rows).ok() != told.rows || grouped != Some(rows) {
            return Err(
                "it has other rows than its manifest says, or groups of rows too large".into()
            );
        }
        pages::check(&file, length, metadata)?;
        let reader = builder.with_batch_size(ROWS_AT_ONCE).build().map_err(|e| broken(&e))?;
        Ok(Self { reader, kind })
    }
}

impl Iterator for Table {
    type Item = Result<RecordBatch, String>;

    fn next(&mut self) -> Option<Self::Item> {
        let batch = self.reader.next()?;
        Some(batch.and_then(|batch| self.kind.conform(&batch)).map_err(|e| e.to_string()).and_then(
            |batch| {
                check_values(&batch)?;
                Ok(batch)
            },
        ))
    }
}

/// Whether columns are those of a table; an older version may lack some that can be null.
fn check_schema(schema: &Schema, kind: Kind, version: i64) -> Result<(), String> {
    let wanted = kind.schema();
    let is_same = |a: &Field, b: &Field| {
        let types = match (a.data_type(), b.data_type()) {
            (DataType::List(a), DataType::List(b)) => a.data_type() == b.data_type(),
            (a, b) => a == b,
        };
        types
            && a.is_nullable() == b.is_nullable()
            && a.metadata().get("unit") == b.metadata().get("unit")
    };
    for (i, field) in schema.fields().iter().enumerate() {
        let name = field.name();
        if schema.fields()[..i].iter().any(|f| f.name() == name) {
            return Err(format!("it has the column {name:?} twice"));
        }
        match wanted.field_with_name(name) {
            Ok(known) if is_same(field, known) => {}
            Ok(known) => {
                return Err(format!(
                    "its column {name} is not of the type and unit {}",
                    known.data_type()
                ));
            }
            Err(_) => return Err(format!("it has a column {name:?}, which no export has")),
        }
    }
    for field in wanted.fields() {
        let may_lack = version < SCHEMA_VERSION && field.is_nullable();
        if schema.field_with_name(field.name()).is_err() && !may_lack {
            return Err(format!("it lacks the column {}", field.name()));
        }
    }
    Ok(())
}

/// Whether all numbers are finite and all texts short.
fn check_values(batch: &RecordBatch) -> Result<(), String> {
    for (field, column) in batch.schema().fields().iter().zip(batch.columns()) {
        let is_finite = |array: &dyn Array| match array.as_primitive_opt::<Float64Type>() {
            Some(numbers) => numbers.iter().flatten().all(f64::is_finite),
            None => true,
        };
        let fits = match field.data_type() {
            DataType::Utf8 => {
                column.as_string::<i32>().iter().flatten().all(|t| t.len() <= MOST_TEXT)
            }
            DataType::List(_) => {
                let list = column.as_list::<i32>();
                list.values().null_count() == 0 && is_finite(list.values())
            }
            _ => is_finite(column),
        };
        let is_whole = field.is_nullable() || column.null_count() == 0;
        if !fits || !is_whole {
            return Err(format!("its column {} has values that no result has", field.name()));
        }
    }
    Ok(())
}

/// The run of a row, which has to be the one that was solved; what is wrong as a sentence. Without its tables.
pub fn solved(
    batch: &RecordBatch,
    row: usize,
    spec: &RunSpec,
    model_version: &str,
) -> Result<SolvedRun, String> {
    let text = |name: &str| {
        let column = batch.column_by_name(name).map(|c| c.as_string::<i32>());
        column.filter(|c| c.is_valid(row)).map(|c| c.value(row).to_owned())
    };
    let whole = |name: &str| {
        let column = batch.column_by_name(name).map(|c| c.as_primitive::<Int64Type>());
        column.filter(|c| c.is_valid(row)).map(|c| c.value(row))
    };
    let real = |name: &str| {
        let column = batch.column_by_name(name).map(|c| c.as_primitive::<Float64Type>());
        column.filter(|c| c.is_valid(row)).map(|c| c.value(row))
    };
    let run_id = text("run_id").unwrap_or_default();
    let run_index = whole("run_index").and_then(|i| usize::try_from(i).ok()).unwrap_or_default();
    if run_id != spec.id_of_model(Some(model_version)) {
        return Err(format!(
            "run {run_index} has the id {run_id:?}, which is not that of what was solved"
        ));
    }
    let wrong = |what: &str| format!("run {run_id} has another {what} than what was solved");
    if text("regime").as_deref() != Some(spec.shared.regime.name()) {
        return Err(wrong("regime"));
    }
    if text("upstream_closure").as_deref() != Some(spec.model.closure().name()) {
        return Err(wrong("upstream_closure"));
    }
    for p in &PARAMETERS {
        let value = (p.get)(spec.parameters());
        let told = if p.whole { whole(p.name).map(|n| n as f64) } else { real(p.name) };
        // Minus zero and zero are one parameter.
        if told != Some(value) {
            return Err(wrong(p.name));
        }
    }
    let status = text("status").unwrap_or_default();
    let status = Status::from_name(&status)
        .ok_or_else(|| format!("run {run_id} has the status {status:?}, which is none"))?;
    let mut scalars = Scalars::default();
    for s in SCALARS {
        (s.set)(&mut scalars, real(s.name));
    }
    let count = |name: &str, least: i64| whole(name).unwrap_or(least).max(least) as u64;
    let history = batch.column_by_name("residual_history").map(|c| c.as_list::<i32>());
    let residual_history = history
        .filter(|h| h.is_valid(row))
        .map(|h| h.value(row).as_primitive::<Float64Type>().values().to_vec());
    Ok(SolvedRun {
        run_index,
        run_id,
        outcome: Outcome {
            detail: text("detail").unwrap_or_default(),
            scalars,
            iterations: count("iterations", 0),
            attempts: count("attempts", 1),
            residual_history,
            root_evidence: text("root_evidence"),
            validity: text("validity"),
            grid_convergence: text("grid_convergence"),
            provenance: Some(provenance::of_row(batch, row)),
            ..Outcome::bare(
                status,
                *spec.parameters(),
                spec.shared.regime.name(),
                spec.model.closure().name(),
            )
        },
    })
}
