//! One run back from its files. Knows the tables, not their SQL.

use super::catalogue::{self, Entry, Place};
use super::schema::Kind;
use super::{ArchiveError, files, long, recall};
use crate::domain::calibrated::Calibrated;
use crate::domain::curve::{BranchCurve, CurveRow, FoldCurve};
use crate::domain::document::Regime;
use crate::domain::outcome::{Outcome, PROFILE, Profile, SERIES, Series, StoredState};
use crate::domain::rows::Row;
use crate::domain::status::Status;
use crate::store::Store;
use arrow_array::cast::AsArray;
use arrow_array::types::Float64Type;
use arrow_array::{Array, BooleanArray, Float64Array, RecordBatch, StringArray};
use parquet::arrow::arrow_reader::{
    ParquetRecordBatchReader, ParquetRecordBatchReaderBuilder, RowSelection, RowSelector,
};
use std::path::Path;

/// Opens a stretch of a file's rows.
pub fn rows(archive: &Path, place: &Place) -> Result<ParquetRecordBatchReader, ArchiveError> {
    let file = files::open(archive, &place.file)?;
    let damaged = |source| ArchiveError::Parquet { path: place.file.path.clone(), source };
    let builder = ParquetRecordBatchReaderBuilder::try_new(file).map_err(damaged)?;
    let (first, end) = (place.first_row, place.first_row + place.row_count);
    // Only the groups of rows that the stretch touches are opened.
    let (mut groups, mut skipped, mut row) = (Vec::new(), 0, 0);
    for (i, group) in builder.metadata().row_groups().iter().enumerate() {
        let next = row + group.num_rows();
        if row < end && next > first {
            if groups.is_empty() {
                skipped = (first - row) as usize;
            }
            groups.push(i);
        }
        row = next;
    }
    let selection = vec![RowSelector::skip(skipped), RowSelector::select(place.row_count as usize)];
    builder
        .with_row_groups(groups)
        .with_row_selection(RowSelection::from(selection))
        .build()
        .map_err(damaged)
}

/// A run by id with its whole result, read off the async threads.
pub async fn stored(store: &Store, run_id: &str) -> Result<Option<Outcome>, ArchiveError> {
    let in_use = store.files_in_use().await;
    let entry = catalogue::run(&mut *store.read().await?, run_id).await?;
    let Some(entry) = entry else { return Ok(None) };
    let archive = store.archive();
    tokio::task::spawn_blocking(move || {
        let _in_use = in_use;
        let provenance = Some(recall::provenance(&archive, &entry)?);
        Ok(Some(Outcome { provenance, ..outcome(&archive, &entry)? }))
    })
    .await?
}

/// The whole result of a run.
pub fn outcome(archive: &Path, entry: &Entry) -> Result<Outcome, ArchiveError> {
    let run_id = entry.row.text("run_id");
    let mut rows = match entry.place(Kind::Profiles) {
        Some(place) => profiles(archive, place, run_id)?,
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
    let series = match entry.place(Kind::Series).filter(|_| is_transient) {
        Some(place) => Some(series(archive, place, run_id)?),
        None => None,
    };
    let curve: Vec<CurveRow> = long_rows(archive, entry, Kind::Branches)?;
    let curve = Some(curve).filter(|rows| !rows.is_empty());
    let (branch, fold_curve) = if entry.row.text("regime") == Regime::FoldCurve.name() {
        (None, curve.map(FoldCurve))
    } else {
        (curve.map(BranchCurve), None)
    };
    Ok(Outcome {
        profile,
        series,
        states,
        branch,
        fold_curve,
        calibration: Some(long_rows(archive, entry, Kind::Calibrations)?)
            .filter(|rows| !rows.is_empty())
            .map(Calibrated),
        sensitivities: long_rows(archive, entry, Kind::Sensitivities)?,
        discrete_roots: long_rows(archive, entry, Kind::Roots)?,
        ..without_tables(entry)?
    })
}

/// The result of a run, but for its tables: nothing is read from files.
pub fn without_tables(entry: &Entry) -> Result<Outcome, ArchiveError> {
    let text = |name: &str| entry.row.text(name).to_owned();
    let told = |name: &str| Some(text(name)).filter(|t| !t.is_empty());
    let status = Status::from_name(entry.row.text("status"))
        .ok_or_else(|| ArchiveError::Status { run_id: text("run_id"), status: text("status") })?;
    let (regime, closure) = (entry.row.text("regime"), entry.row.text("upstream_closure"));
    Ok(Outcome {
        detail: text("detail"),
        scalars: entry.scalars,
        iterations: entry.row.whole("iterations").unwrap_or_default(),
        attempts: entry.row.whole("attempts").unwrap_or(1),
        residual_history: entry.residual_history.clone(),
        root_evidence: told("root_evidence"),
        validity: told("validity"),
        grid_convergence: told("grid_convergence"),
        ..Outcome::bare(status, entry.parameters, regime, closure)
    })
}

/// The rows of a run in a long table.
fn long_rows<R: Row>(archive: &Path, entry: &Entry, kind: Kind) -> Result<Vec<R>, ArchiveError> {
    let Some(place) = entry.place(kind) else { return Ok(Vec::new()) };
    let (path, run_id) = (place.file.path.as_str(), entry.row.text("run_id"));
    let mut found = Vec::new();
    for batch in rows(archive, place)? {
        let batch = batch.map_err(|e| damaged(path, e))?;
        let ids: &StringArray = column(&batch, path, "run_id")?;
        for row in (0..batch.num_rows()).filter(|row| ids.value(*row) == run_id) {
            found.push(long::row(&batch, row));
        }
    }
    Ok(found)
}

type StateRow = (Option<f64>, bool, Profile);

fn profiles(archive: &Path, place: &Place, run_id: &str) -> Result<Vec<StateRow>, ArchiveError> {
    let path = place.file.path.as_str();
    let mut found = Vec::new();
    for batch in rows(archive, place)? {
        let batch = batch.map_err(|e| damaged(path, e))?;
        let ids: &StringArray = column(&batch, path, "run_id")?;
        let times: &Float64Array = column(&batch, path, "time_a")?;
        let requested: &BooleanArray = column(&batch, path, "requested")?;
        for row in (0..batch.num_rows()).filter(|row| ids.value(*row) == run_id) {
            let profile = profile(&batch, row, path)?;
            let time_a = times.is_valid(row).then(|| times.value(row));
            found.push((time_a, requested.value(row), profile));
        }
    }
    Ok(found)
}

/// The state of a row of the table of profiles.
pub fn profile(batch: &RecordBatch, row: usize, path: &str) -> Result<Profile, ArchiveError> {
    let mut profile = Profile::default();
    for info in &PROFILE {
        let lists: &arrow_array::ListArray = column(batch, path, info.name)?;
        let values = lists.value(row);
        (info.set)(&mut profile, values.as_primitive::<Float64Type>().values().to_vec());
    }
    Ok(profile)
}

fn series(archive: &Path, place: &Place, run_id: &str) -> Result<Series, ArchiveError> {
    let path = place.file.path.as_str();
    let mut found = Series::default();
    for batch in rows(archive, place)? {
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
