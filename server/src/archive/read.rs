//! One run back from its files. Knows the tables, not their SQL.

use super::ArchiveError;
use super::catalogue::{self, Entry};
use super::schema::Kind;
use crate::domain::outcome::{
    EffectiveParameters, Outcome, PROFILE, Profile, SERIES, Series, StoredState,
};
use crate::domain::status::Status;
use crate::store::Store;
use arrow_array::cast::AsArray;
use arrow_array::types::Float64Type;
use arrow_array::{Array, BooleanArray, Float64Array, RecordBatch, StringArray};
use parquet::arrow::arrow_reader::{ParquetRecordBatchReader, ParquetRecordBatchReaderBuilder};
use std::fs::File;
use std::path::Path;

/// Opens a file of the archive.
pub fn open(archive: &Path, path: &str) -> Result<ParquetRecordBatchReader, ArchiveError> {
    let file = File::open(archive.join(path)).map_err(|source| ArchiveError::File {
        path: path.to_owned(),
        doing: "read",
        source,
    })?;
    ParquetRecordBatchReaderBuilder::try_new(file)
        .and_then(|builder| builder.build())
        .map_err(|source| ArchiveError::Parquet { path: path.to_owned(), source })
}

/// A run by id with its whole result, read off the async threads.
pub async fn stored(store: &Store, run_id: &str) -> Result<Option<Outcome>, ArchiveError> {
    let entry = catalogue::run(&mut *store.read().await?, run_id).await?;
    let Some(entry) = entry else { return Ok(None) };
    let archive = store.archive();
    tokio::task::spawn_blocking(move || outcome(&archive, &entry)).await?.map(Some)
}

/// The whole result of a run.
pub fn outcome(archive: &Path, entry: &Entry) -> Result<Outcome, ArchiveError> {
    let run_id = entry.row.text("run_id");
    let file = |kind: Kind| {
        entry.files.iter().find(|(k, _)| k == kind.name()).map(|(_, path)| path.as_str())
    };
    let mut rows = match file(Kind::Profiles) {
        Some(path) => profiles(archive, path, run_id)?,
        None => Vec::new(),
    };
    let is_transient = entry.scalars.end_time_a.is_some();
    let profile = rows.last().map(|(_, _, profile)| profile.clone());
    let states = is_transient.then(|| {
        rows.retain(|(_, requested, _)| *requested);
        rows.into_iter()
            .filter_map(|(time_a, _, profile)| Some(StoredState { time_a: time_a?, profile }))
            .collect()
    });
    let series = match file(Kind::Series).filter(|_| is_transient) {
        Some(path) => Some(series(archive, path, run_id)?),
        None => None,
    };
    let text = |name: &str| entry.row.text(name).to_owned();
    Ok(Outcome {
        status: Status::from_name(entry.row.text("status")).ok_or_else(|| {
            ArchiveError::Status { run_id: run_id.to_owned(), status: text("status") }
        })?,
        detail: text("detail"),
        parameters: EffectiveParameters(entry.parameters),
        regime: text("regime"),
        upstream_closure: text("upstream_closure"),
        scalars: entry.scalars,
        iterations: entry.row.0.get("iterations").and_then(|v| v.as_u64()).unwrap_or_default(),
        root_evidence: Some(text("root_evidence")).filter(|t| !t.is_empty()),
        validity: Some(text("validity")).filter(|t| !t.is_empty()),
        grid_convergence: Some(text("grid_convergence")).filter(|t| !t.is_empty()),
        grid_error: None,
        transects: Vec::new(),
        profile,
        series,
        states,
    })
}

type StateRow = (Option<f64>, bool, Profile);

fn profiles(archive: &Path, path: &str, run_id: &str) -> Result<Vec<StateRow>, ArchiveError> {
    let mut found = Vec::new();
    for batch in open(archive, path)? {
        let batch = batch.map_err(|e| damaged(path, e))?;
        let ids: &StringArray = column(&batch, path, "run_id")?;
        let times: &Float64Array = column(&batch, path, "time_a")?;
        let requested: &BooleanArray = column(&batch, path, "requested")?;
        for row in (0..batch.num_rows()).filter(|row| ids.value(*row) == run_id) {
            let mut profile = Profile::default();
            for info in &PROFILE {
                let lists: &arrow_array::ListArray = column(&batch, path, info.name)?;
                let values = lists.value(row);
                (info.set)(&mut profile, values.as_primitive::<Float64Type>().values().to_vec());
            }
            let time_a = times.is_valid(row).then(|| times.value(row));
            found.push((time_a, requested.value(row), profile));
        }
    }
    Ok(found)
}

fn series(archive: &Path, path: &str, run_id: &str) -> Result<Series, ArchiveError> {
    let mut found = Series::default();
    for batch in open(archive, path)? {
        let batch = batch.map_err(|e| damaged(path, e))?;
        let ids: &StringArray = column(&batch, path, "run_id")?;
        for info in SERIES {
            // A column that is younger than the file is missing, like a number that does not exist.
            let values: Option<&Float64Array> = match batch.column_by_name(info.name) {
                Some(_) => Some(column(&batch, path, info.name)?),
                None => None,
            };
            let rows = (0..batch.num_rows()).filter(|row| ids.value(*row) == run_id);
            let number =
                |row| values.filter(|v| v.is_valid(row)).map_or(f64::NAN, |v| v.value(row));
            (info.get_mut)(&mut found).extend(rows.map(number));
        }
    }
    Ok(found)
}

fn column<'a, A: Array + 'static>(
    batch: &'a RecordBatch,
    path: &str,
    column: &'static str,
) -> Result<&'a A, ArchiveError> {
    batch
        .column_by_name(column)
        .and_then(|array| array.as_any().downcast_ref())
        .ok_or(ArchiveError::Column { path: path.to_owned(), column })
}

fn damaged(path: &str, e: impl std::error::Error + Send + Sync + 'static) -> ArchiveError {
    let source = parquet::errors::ParquetError::External(Box::new(e));
    ArchiveError::Parquet { path: path.to_owned(), source }
}
