//! The Parquet schema, version 5: columns, units, meanings, and the arrays of solved runs. The tables
//! of the domain say which columns there are.

use super::SolvedRun;
use super::long;
use super::provenance;
use crate::domain::calibrated::CalibrationRow;
use crate::domain::curve::CurveRow;
use crate::domain::discrete_root::RootRow;
use crate::domain::outcome::{PROFILE, Profile, SCALARS, SERIES};
use crate::domain::parameters::PARAMETERS;
use crate::domain::sensitivity::SensitivityRow;
use arrow_array::builder::{
    BooleanBuilder, Float64Builder, Int64Builder, ListBuilder, StringBuilder,
};
use arrow_array::{ArrayRef, RecordBatch, new_null_array};
use arrow_schema::{ArrowError, DataType, Field, Schema};
use std::collections::HashMap;
use std::sync::Arc;

/// Version of the schema, in the footer of each file and in the catalogue.
pub const SCHEMA_VERSION: i64 = 5;

/// The tables of the archive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// One row per run: parameters and scalars.
    Runs,
    /// One row per run and stored time: arrays on the grid.
    Profiles,
    /// One row per run and output time.
    Series,
    /// One row per point, fold, root, crossing and end of a branch or a curve of folds.
    Branches,
    /// One row per steady state and quantity: its derivatives.
    Sensitivities,
    /// One row per estimate, observation, start and sample of a calibration.
    Calibrations,
    /// One row per discrete root of a steady state.
    Roots,
}

impl Kind {
    /// All tables.
    pub const ALL: [Kind; 7] = [
        Kind::Runs,
        Kind::Profiles,
        Kind::Series,
        Kind::Branches,
        Kind::Sensitivities,
        Kind::Calibrations,
        Kind::Roots,
    ];

    /// Name in file names and in the catalogue.
    pub fn name(self) -> &'static str {
        match self {
            Kind::Runs => "runs",
            Kind::Profiles => "profiles",
            Kind::Series => "series",
            Kind::Branches => "branches",
            Kind::Sensitivities => "sensitivities",
            Kind::Calibrations => "calibrations",
            Kind::Roots => "roots",
        }
    }

    /// The table of a name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }

    /// What its rows are.
    pub fn meaning(self) -> &'static str {
        match self {
            Kind::Runs => "one row per run: parameters and numbers of the result",
            Kind::Profiles => {
                "one row per run and stored time: arrays on the grid, from the terminus to the end"
            }
            Kind::Series => "one row per output time of a transient",
            Kind::Branches => {
                "one row per point, fold, root, crossing and end of a branch or a curve of folds"
            }
            Kind::Sensitivities => "one row per steady state and quantity: its derivatives",
            Kind::Calibrations => {
                "one row per estimate, observation, start and sample of a calibration"
            }
            Kind::Roots => "one row per discrete root of a steady state",
        }
    }

    /// The table's schema.
    pub fn schema(self) -> Arc<Schema> {
        let fields = match self {
            Kind::Runs => run_fields(),
            Kind::Profiles => profile_fields(),
            Kind::Series => series_fields(),
            Kind::Branches => long::fields::<CurveRow>(),
            Kind::Sensitivities => long::fields::<SensitivityRow>(),
            Kind::Calibrations => long::fields::<CalibrationRow>(),
            Kind::Roots => long::fields::<RootRow>(),
        };
        let metadata = HashMap::from([
            ("melange_schema_version".to_owned(), SCHEMA_VERSION.to_string()),
            ("melange_table".to_owned(), self.name().to_owned()),
        ]);
        Arc::new(Schema::new_with_metadata(fields, metadata))
    }

    /// The runs as rows of the table.
    pub fn batch(self, runs: &[SolvedRun]) -> RecordBatch {
        let columns = match self {
            Kind::Runs => run_columns(runs),
            Kind::Profiles => profile_columns(runs),
            Kind::Series => series_columns(runs),
            Kind::Branches => long::columns(runs, |outcome| outcome.curve_rows()),
            Kind::Sensitivities => long::columns(runs, |outcome| &outcome.sensitivities),
            Kind::Calibrations => long::columns(runs, |outcome| outcome.calibration_rows()),
            Kind::Roots => long::columns(runs, |outcome| &outcome.discrete_roots),
        };
        RecordBatch::try_new(self.schema(), columns)
            .expect("columns are built from the schema's tables")
    }
}

impl Kind {
    /// A file's rows in this version's columns: a column that is younger than the file is null.
    pub fn conform(self, batch: &RecordBatch) -> Result<RecordBatch, ArrowError> {
        let schema = self.schema();
        let column = |field: &Arc<Field>| {
            let found = batch.column_by_name(field.name()).cloned();
            found.unwrap_or_else(|| new_null_array(field.data_type(), batch.num_rows()))
        };
        let columns = schema.fields().iter().map(column).collect();
        RecordBatch::try_new(schema, columns)
    }
}

pub(super) fn field(
    name: &str,
    kind: DataType,
    nullable: bool,
    unit: &str,
    meaning: &str,
) -> Field {
    Field::new(name, kind, nullable).with_metadata(HashMap::from([
        ("unit".to_owned(), unit.to_owned()),
        ("meaning".to_owned(), meaning.to_owned()),
    ]))
}

pub(super) fn run_id_field() -> Field {
    let meaning = "identity of the run: blake3 of model version, options and parameters";
    field("run_id", DataType::Utf8, false, "1", meaning)
}

fn run_fields() -> Vec<Field> {
    let mut fields = vec![
        run_id_field(),
        field("run_index", DataType::Int64, false, "1", "place of the run in its sweep"),
        field("status", DataType::Utf8, false, "1", "how the run ended"),
        field("detail", DataType::Utf8, false, "1", "one sentence on how the run ended"),
        field("regime", DataType::Utf8, false, "1", "what was solved for"),
        field("upstream_closure", DataType::Utf8, false, "1", "closure at the terminus"),
    ];
    for p in &PARAMETERS {
        let kind = if p.whole { DataType::Int64 } else { DataType::Float64 };
        fields.push(field(p.name, kind, false, p.unit, p.meaning));
    }
    for s in SCALARS {
        fields.push(field(s.name, DataType::Float64, true, s.unit, s.meaning));
    }
    fields.push(field("iterations", DataType::Int64, false, "1", "Newton iterations"));
    for (name, meaning) in [
        ("root_evidence", "rule that picked the root"),
        ("validity", "what the state does that the model is not made for; null if nothing"),
        ("grid_convergence", "what three grids say of the errors; null if not asked for"),
    ] {
        fields.push(field(name, DataType::Utf8, true, "1", meaning));
    }
    let meaning = "attempts made, the last of which gave the answer if there is one; null in files before version 3";
    fields.push(field("attempts", DataType::Int64, true, "1", meaning));
    let meaning = "nondimensional residual norms of a failed run's last solve, oldest first; null if there are none";
    fields.push(field("residual_history", list_of_numbers(), true, "1", meaning));
    fields.extend(provenance::fields());
    fields
}

fn run_columns(runs: &[SolvedRun]) -> Vec<ArrayRef> {
    let text = |get: fn(&SolvedRun) -> Option<&str>| -> ArrayRef {
        let mut column = StringBuilder::new();
        runs.iter().for_each(|r| column.append_option(get(r)));
        Arc::new(column.finish())
    };
    let whole = |get: &dyn Fn(&SolvedRun) -> i64| -> ArrayRef {
        let mut column = Int64Builder::new();
        runs.iter().for_each(|r| column.append_value(get(r)));
        Arc::new(column.finish())
    };
    let real = |get: &dyn Fn(&SolvedRun) -> Option<f64>| -> ArrayRef {
        let mut column = Float64Builder::new();
        runs.iter().for_each(|r| column.append_option(get(r)));
        Arc::new(column.finish())
    };
    let mut columns = vec![
        text(|r| Some(&r.run_id)),
        whole(&|r| r.run_index as i64),
        text(|r| Some(r.outcome.status.name())),
        text(|r| Some(&r.outcome.detail)),
        text(|r| Some(&r.outcome.regime)),
        text(|r| Some(&r.outcome.upstream_closure)),
    ];
    for p in &PARAMETERS {
        columns.push(if p.whole {
            whole(&|r| (p.get)(&r.outcome.parameters.0) as i64)
        } else {
            real(&|r| Some((p.get)(&r.outcome.parameters.0)))
        });
    }
    for s in SCALARS {
        columns.push(real(&|r| (s.get)(&r.outcome.scalars)));
    }
    columns.push(whole(&|r| r.outcome.iterations as i64));
    columns.push(text(|r| r.outcome.root_evidence.as_deref()));
    columns.push(text(|r| r.outcome.validity.as_deref()));
    columns.push(text(|r| r.outcome.grid_convergence.as_deref()));
    columns.push(whole(&|r| r.outcome.attempts as i64));
    let mut histories = ListBuilder::new(Float64Builder::new());
    for run in runs {
        let history = run.outcome.residual_history.as_deref();
        histories.values().append_slice(history.unwrap_or_default());
        histories.append(history.is_some());
    }
    columns.push(Arc::new(histories.finish()));
    columns.extend(provenance::columns(runs));
    columns
}

pub(super) fn list_of_numbers() -> DataType {
    DataType::List(Arc::new(Field::new("item", DataType::Float64, true)))
}

pub(super) fn list_of_wholes() -> DataType {
    DataType::List(Arc::new(Field::new("item", DataType::Int64, true)))
}

fn profile_fields() -> Vec<Field> {
    let mut fields = vec![
        run_id_field(),
        field(
            "time_a",
            DataType::Float64,
            true,
            "a",
            "time since the start; null if there is no time",
        ),
        field(
            "requested",
            DataType::Boolean,
            false,
            "1",
            "whether the time was asked for; false for the last state of a transient that was not",
        ),
    ];
    for p in &PROFILE {
        fields.push(field(p.name, list_of_numbers(), false, p.unit, p.meaning));
    }
    fields
}

/// The stored states of a run: time, whether it was asked for, state. The last one is the profile of
/// the result.
fn stored_states(run: &SolvedRun) -> Vec<(Option<f64>, bool, &Profile)> {
    let o = &run.outcome;
    let mut rows: Vec<(Option<f64>, bool, &Profile)> =
        o.states.iter().flatten().map(|s| (Some(s.time_a), true, &s.profile)).collect();
    if let Some(last) = &o.profile {
        let time_a = o.scalars.end_time_a;
        if time_a.is_none() || rows.last().is_none_or(|(t, _, _)| *t != time_a) {
            rows.push((time_a, time_a.is_none(), last));
        }
    }
    rows
}

fn profile_columns(runs: &[SolvedRun]) -> Vec<ArrayRef> {
    let mut ids = StringBuilder::new();
    let mut times = Float64Builder::new();
    let mut requested = BooleanBuilder::new();
    let mut arrays = PROFILE.map(|_| ListBuilder::new(Float64Builder::new()));
    for run in runs {
        for (time_a, asked_for, profile) in stored_states(run) {
            ids.append_value(&run.run_id);
            times.append_option(time_a);
            requested.append_value(asked_for);
            for (info, array) in PROFILE.iter().zip(&mut arrays) {
                array.values().append_slice((info.get)(profile));
                array.append(true);
            }
        }
    }
    let mut columns: Vec<ArrayRef> =
        vec![Arc::new(ids.finish()), Arc::new(times.finish()), Arc::new(requested.finish())];
    columns.extend(arrays.iter_mut().map(|a| Arc::new(a.finish()) as ArrayRef));
    columns
}

fn series_fields() -> Vec<Field> {
    let mut fields = vec![run_id_field()];
    for s in SERIES {
        fields.push(field(s.name, DataType::Float64, true, s.unit, s.meaning));
    }
    fields
}

fn series_columns(runs: &[SolvedRun]) -> Vec<ArrayRef> {
    let mut ids = StringBuilder::new();
    let mut arrays: Vec<Float64Builder> = SERIES.iter().map(|_| Float64Builder::new()).collect();
    for run in runs {
        let Some(series) = &run.outcome.series else { continue };
        for _ in &series.time_a {
            ids.append_value(&run.run_id);
        }
        for (info, array) in SERIES.iter().zip(&mut arrays) {
            for value in (info.get)(series) {
                array.append_option(Some(*value).filter(|v| v.is_finite()));
            }
        }
    }
    let mut columns: Vec<ArrayRef> = vec![Arc::new(ids.finish())];
    columns.extend(arrays.iter_mut().map(|a| Arc::new(a.finish()) as ArrayRef));
    columns
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::outcome::Outcome;
    use crate::domain::status::Status;
    use arrow_array::cast::AsArray;
    use arrow_array::types::{Float64Type, Int64Type};
    use arrow_array::{Array, RecordBatch};

    fn run(run_index: usize, attempts: u64, residual_history: Option<Vec<f64>>) -> SolvedRun {
        let bare = Outcome::bare(Status::Failed, Default::default(), "steady", "published");
        let outcome = Outcome { attempts, residual_history, ..bare };
        SolvedRun { run_index, run_id: format!("{run_index}"), outcome }
    }

    #[test]
    fn attempts_and_residual_histories_are_columns_of_the_runs() {
        let runs = [run(0, 1, None), run(1, 3, Some(vec![2.0, 1.0]))];
        let batch = Kind::Runs.batch(&runs);
        let column = |name: &str| batch.column_by_name(name).expect("a column").clone();
        let attempts = column("attempts");
        assert_eq!(attempts.as_primitive::<Int64Type>().values().to_vec(), [1, 3]);
        let histories = column("residual_history");
        assert!(histories.is_null(0));
        let told = histories.as_list::<i32>().value(1);
        assert_eq!(told.as_primitive::<Float64Type>().values().to_vec(), [2.0, 1.0]);
        for field in batch.schema().fields() {
            let metadata = field.metadata();
            assert!(metadata.contains_key("unit") && metadata.contains_key("meaning"), "{field}");
        }
    }

    #[test]
    fn files_of_version_2_are_read_with_nulls() {
        let young = ["attempts", "residual_history"];
        let batch = Kind::Runs.batch(&[run(0, 1, None)]);
        let old: Vec<usize> = (0..batch.num_columns())
            .filter(|i| !young.contains(&batch.schema().field(*i).name().as_str()))
            .collect();
        let old: RecordBatch = batch.project(&old).expect("columns");
        let read = Kind::Runs.conform(&old).expect("it conforms");
        assert_eq!(read.schema(), Kind::Runs.schema());
        for name in young {
            assert!(read.column_by_name(name).expect("a column").is_null(0), "{name}");
        }
    }
}
