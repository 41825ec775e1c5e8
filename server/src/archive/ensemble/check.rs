//! An ensemble from elsewhere against itself: what was solved, the runs' ids and parameters, counts, and which
//! rows belong to which run. What passes may be believed as far as its numbers can be: nobody has solved it again.

use super::super::catalogue::{Stretch, id_number};
use super::super::schema::Kind;
use super::identity::Runs;
use super::manifest::FileEntry;
use super::table::{Table, solved};
use super::unpack::Staged;
use super::{ImportError, refused};
use crate::domain::document::Document;
use crate::domain::label::Edit;
use crate::domain::status::{Counts, Status};
use crate::domain::sweep::{Limits, SweepSpec};
use arrow_array::cast::AsArray;
use arrow_array::{Array, RecordBatch};
use std::ops::Range;
use std::path::PathBuf;
use std::sync::Arc;

/// An ensemble that contradicts itself nowhere.
#[derive(Debug)]
pub struct Checked {
    /// As it came.
    pub staged: Staged,
    /// What was solved.
    pub sweep: Arc<SweepSpec>,
    /// Version of the model that the ids are of.
    pub model_version: String,
    /// Ids and indices of its runs.
    pub runs: Runs,
    /// Runs that stand together, the chunks of the sweep.
    pub stretches: Vec<Stretch>,
    /// Runs that have no result.
    pub missing: Vec<Range<i64>>,
    /// Its runs by how they ended.
    pub ended: Vec<(Status, i64)>,
    /// Its tables.
    pub tables: Vec<CheckedTable>,
}

/// A table that is what it should be.
#[derive(Debug)]
pub struct CheckedTable {
    /// Which.
    pub kind: Kind,
    /// The staged file.
    pub path: PathBuf,
    /// As the manifest tells it.
    pub entry: FileEntry,
    /// First row and rows of each stretch.
    pub rows: Vec<(i64, i64)>,
}

/// Most runs and stored numbers of a stretch: one of its runs is found by reading all of it.
const MOST_RUNS: usize = 1_000;
const MOST_NUMBERS: u64 = 1_000_000;

/// Rows of runs in a table: index of the run and number of its rows, ascending.
type RowsOf = Vec<(i64, i64)>;

/// Checks an ensemble whose bytes are those that its manifest tells.
pub fn check(staged: Staged, limits: &Limits) -> Result<Checked, ImportError> {
    let manifest = &staged.manifest;
    let id = manifest.sweep.id.clone();
    let wrong = |file: &str, why: String| refused(format!("melange-{id}/{file}: {why}"));
    let model_version = manifest.model_version.clone().ok_or_else(|| {
        wrong("manifest.json", "the ids of its runs are of no model version that is known".into())
    })?;
    let mut document = Document::parse(&staged.spec).map_err(|e| wrong("spec.json", e.detail))?;
    let note = Edit { note: Some(manifest.sweep.note.clone()), ..Edit::default() };
    note.check().map_err(|e| wrong("manifest.json", e.detail))?;
    document.name = Some(manifest.sweep.name.clone());
    document.tags = manifest.sweep.tags.clone();
    let sweep = document.into_sweep(limits).map_err(|e| wrong("spec.json", e.detail))?;
    if sweep.count() as i64 != manifest.sweep.counts.total {
        let why = format!(
            "it has {} runs and should have {}",
            sweep.count(),
            manifest.sweep.counts.total
        );
        return Err(wrong("spec.json", why));
    }
    let mut runs = Runs::default();
    // Stored numbers of each run.
    let mut numbers: Vec<u64> = Vec::new();
    let mut counts = Counts { total: manifest.sweep.counts.total, ..Counts::default() };
    let mut rows: Vec<(usize, RowsOf)> = Vec::new();
    let mut tables: Vec<(Kind, FileEntry, PathBuf)> = staged
        .tables
        .iter()
        .filter_map(|(entry, path)| Some((entry.table()?, entry.clone(), path.clone())))
        .collect();
    // The runs first: the others are about them.
    tables.sort_by_key(|(kind, _, _)| *kind != Kind::Runs);
    for (i, (kind, entry, path)) in tables.iter().enumerate() {
        let wrong = |why: String| wrong(&entry.path, why);
        let mut rows_of = RowsOf::new();
        for batch in Table::open(path, *kind, entry).map_err(wrong)? {
            let batch = batch.map_err(wrong)?;
            if *kind == Kind::Runs {
                for row in 0..batch.num_rows() {
                    let last = runs.ids.last().map(|(index, _)| *index);
                    let index = index_of(&batch, row, last, sweep.count()).map_err(wrong)?;
                    let run = sweep.run(index as usize);
                    let run = solved(&batch, row, &run, &model_version).map_err(wrong)?;
                    counts.add(run.outcome.status, 1);
                    runs.add(index, id_number(&run.run_id).unwrap_or_default());
                    numbers.push(0);
                    rows_of.push((index, 1));
                }
            } else {
                add_rows(&batch, *kind, &runs, &mut numbers, &mut rows_of).map_err(wrong)?;
            }
        }
        rows.push((i, rows_of));
    }
    let told = manifest.sweep.counts;
    let stored = |counts: &Counts| Status::STORED.map(|status| (status, counts.of(status)));
    if stored(&counts) != stored(&told) {
        let why = "its runs ended otherwise than its manifest says".into();
        return Err(wrong("runs.parquet", why));
    }
    if manifest.seal.is_some() && runs.ids.len() != sweep.count() {
        return Err(wrong("runs.parquet", "it is sealed and lacks runs".into()));
    }
    let stretches = stretches(&runs, &numbers);
    let missing = missing(&stretches, sweep.count() as i64);
    let ended = stored(&counts).into_iter().filter(|(_, n)| *n > 0).collect();
    let placed = rows.into_iter().map(|(i, rows_of)| {
        let (kind, entry, path) = tables[i].clone();
        CheckedTable { kind, path, entry, rows: by_stretch(&stretches, &rows_of) }
    });
    let tables = placed.collect();
    let sweep = Arc::new(sweep);
    Ok(Checked { sweep, model_version, runs, stretches, missing, ended, tables, staged })
}

/// The index of a row's run, which has to come after the last one.
fn index_of(
    batch: &RecordBatch,
    row: usize,
    last: Option<i64>,
    count: usize,
) -> Result<i64, String> {
    let column = batch.column_by_name("run_index");
    let column = column.map(|c| c.as_primitive::<arrow_array::types::Int64Type>());
    let index = column.filter(|c| c.is_valid(row)).map(|c| c.value(row));
    index.filter(|i| (0..count as i64).contains(i) && last.is_none_or(|last| *i > last)).ok_or_else(
        || format!("its runs are not in the order of their indices from 0 to {}", count - 1),
    )
}

/// Counts the rows of a long table's runs, which have to stand in the order of the runs.
fn add_rows(
    batch: &RecordBatch,
    kind: Kind,
    runs: &Runs,
    numbers: &mut [u64],
    rows_of: &mut RowsOf,
) -> Result<(), String> {
    let ids = batch.column(0).as_string::<i32>();
    for row in 0..batch.num_rows() {
        let id = ids.value(row);
        let index = id_number(id).and_then(|id| runs.first.get(&id)).copied();
        let index =
            index.ok_or_else(|| format!("it has rows of {id:?}, which is no run of its own"))?;
        let mut stored = batch.num_columns() as u64;
        let mut lengths = Vec::new();
        for column in batch.columns().iter().filter_map(|c| c.as_list_opt::<i32>()) {
            let length = if column.is_valid(row) { column.value_length(row) as u64 } else { 0 };
            stored += length;
            lengths.push(length);
        }
        if kind == Kind::Profiles && !is_grid(&lengths) {
            return Err(format!("the arrays of run {id} do not fit each other"));
        }
        match rows_of.last_mut() {
            Some((last, n)) if *last == index => *n += 1,
            Some((last, _)) if *last > index => {
                return Err("its rows are not in the order of the runs".into());
            }
            _ => rows_of.push((index, 1)),
        }
        let at = runs.ids.partition_point(|(i, _)| *i < index);
        if let Some(sum) = numbers.get_mut(at) {
            *sum += stored;
        }
    }
    Ok(())
}

/// Whether there are three arrays on nodes and three on the cells between them.
fn is_grid(lengths: &[u64]) -> bool {
    let [x, velocity, mu_w, cells, thickness, fluidity] = lengths else { return false };
    *x > 1
        && velocity == x
        && mu_w == x
        && *cells == x - 1
        && thickness == cells
        && fluidity == cells
}

/// Runs without gaps that together are not too much to read for one of them.
fn stretches(runs: &Runs, numbers: &[u64]) -> Vec<Stretch> {
    let mut stretches: Vec<Stretch> = Vec::new();
    let mut held = 0;
    for ((index, _), stored) in runs.ids.iter().zip(numbers) {
        match stretches.last_mut() {
            Some(last)
                if last.end == *index
                    && last.end - last.first < MOST_RUNS as i64
                    && held + stored <= MOST_NUMBERS =>
            {
                last.end += 1;
                held += stored;
            }
            _ => {
                stretches.push(Stretch { first: *index, end: index + 1 });
                held = *stored;
            }
        }
    }
    stretches
}

/// Stretches between those that have results.
fn missing(stretches: &[Stretch], count: i64) -> Vec<Range<i64>> {
    let (mut missing, mut next) = (Vec::new(), 0);
    let end = Stretch { first: count, end: count };
    for stretch in stretches.iter().chain([&end]) {
        let mut first = next;
        while first < stretch.first {
            let end = stretch.first.min(first + MOST_RUNS as i64);
            missing.push(first..end);
            first = end;
        }
        next = stretch.end;
    }
    missing
}

/// First row and rows of each stretch.
fn by_stretch(stretches: &[Stretch], rows_of: &RowsOf) -> Vec<(i64, i64)> {
    let (mut placed, mut first_row, mut at) = (Vec::with_capacity(stretches.len()), 0, 0);
    for stretch in stretches {
        let mut rows = 0;
        while let Some((_, n)) = rows_of.get(at).filter(|(index, _)| *index < stretch.end) {
            rows += n;
            at += 1;
        }
        placed.push((first_row, rows));
        first_row += rows;
    }
    placed
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stretches_have_no_gaps_and_what_is_between_is_missing() {
        let mut runs = Runs::default();
        for index in [1, 2, 5, 6, 7] {
            runs.add(index, index as u128);
        }
        let cut = stretches(&runs, &[10, 10, MOST_NUMBERS, 10, 10]);
        let ends: Vec<(i64, i64)> = cut.iter().map(|s| (s.first, s.end)).collect();
        assert_eq!(ends, [(1, 3), (5, 6), (6, 8)]);
        assert_eq!(missing(&cut, 10), [0..1, 3..5, 8..10]);
        let rows = by_stretch(&cut, &vec![(1, 2), (6, 3), (7, 1)]);
        assert_eq!(rows, [(0, 2), (2, 0), (2, 4)]);
    }
}
