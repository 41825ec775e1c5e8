//! Where runs come from, as the last columns of the table of runs; null in files before version 5.

use super::SolvedRun;
use super::schema::field;
use crate::domain::provenance::{COLUMNS, Provenance, STARTS};
use arrow_array::builder::{Float64Builder, StringBuilder, UInt64Builder};
use arrow_array::cast::AsArray;
use arrow_array::types::{Float64Type, UInt64Type};
use arrow_array::{Array, ArrayRef, RecordBatch};
use arrow_schema::{DataType, Field};
use std::sync::Arc;

/// The fields.
pub fn fields() -> impl Iterator<Item = Field> {
    COLUMNS.iter().map(|c| {
        let kind = match c.name {
            "solve_seconds" => DataType::Float64,
            "seed" => DataType::UInt64,
            _ => DataType::Utf8,
        };
        field(c.name, kind, true, c.unit, c.meaning)
    })
}

/// Whether a column is one of these.
pub fn is_column(name: &str) -> bool {
    COLUMNS.iter().any(|column| column.name == name)
}

/// The columns of runs.
pub fn columns(runs: &[SolvedRun]) -> Vec<ArrayRef> {
    let made = || runs.iter().map(|run| run.outcome.provenance.as_ref());
    let text = |get: fn(&Provenance) -> Option<&str>| -> ArrayRef {
        let mut column = StringBuilder::new();
        made().for_each(|p| column.append_option(p.and_then(get)));
        Arc::new(column.finish())
    };
    let mut seconds = Float64Builder::new();
    made().for_each(|p| seconds.append_option(p.and_then(|p| p.solve_seconds)));
    let mut seeds = UInt64Builder::new();
    made().for_each(|p| seeds.append_option(p.and_then(|p| p.seed)));
    vec![
        text(|p| p.model_version.as_deref()),
        text(|p| p.program_version.as_deref()),
        text(|p| p.host_class.as_deref()),
        Arc::new(seconds.finish()),
        Arc::new(seeds.finish()),
        text(|p| p.start),
        text(|p| p.started_from.as_deref()),
        text(|p| p.options.as_deref()),
    ]
}

/// What a row says; a column that is younger than the file is none.
pub fn of_row(batch: &RecordBatch, row: usize) -> Provenance {
    let text = |name: &str| {
        let column = batch.column_by_name(name)?.as_string_opt::<i32>()?;
        column.is_valid(row).then(|| column.value(row))
    };
    let owned = |name: &str| text(name).map(str::to_owned);
    let column = |name: &str| batch.column_by_name(name).filter(|c| c.is_valid(row));
    let start = text("start");
    Provenance {
        model_version: owned("model_version"),
        program_version: owned("program_version"),
        host_class: owned("host_class"),
        solve_seconds: column("solve_seconds")
            .and_then(|c| Some(c.as_primitive_opt::<Float64Type>()?.value(row))),
        seed: column("seed").and_then(|c| Some(c.as_primitive_opt::<UInt64Type>()?.value(row))),
        start: STARTS.into_iter().find(|name| start == Some(name)),
        started_from: owned("started_from"),
        solved_at: None,
        scenario: None,
        options: text("options").map(Into::into),
    }
}
