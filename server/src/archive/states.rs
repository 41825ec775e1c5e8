//! The last states of many runs, back from their files: each file is opened once, and of its rows only those of the
//! runs are decoded. Knows the tables, not their SQL.

use super::catalogue::{Entry, Place};
use super::read;
use super::schema::Kind;
use super::{ArchiveError, files};
use crate::domain::outcome::{PROFILE, Profile};
use arrow_array::cast::AsArray;
use arrow_array::{Array, RecordBatch, StringArray};
use arrow_schema::ArrowError;
use parquet::arrow::ProjectionMask;
use parquet::arrow::arrow_reader::{
    ArrowReaderMetadata, ArrowReaderOptions, ParquetRecordBatchReaderBuilder, RowSelection,
};
use parquet::errors::ParquetError;
use parquet::file::metadata::PageIndexPolicy;
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::fs::File;
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

/// The last state of each run; none of those that have no state.
pub fn last_states(
    archive: &Path,
    entries: &[Entry],
) -> Result<Vec<Option<Profile>>, ArchiveError> {
    let names: Vec<&str> = PROFILE.iter().map(|info| info.name).collect();
    rows_of(archive, entries, Kind::Profiles, &names, |batch, row, path| {
        read::profile(batch, row, path).map(Some)
    })
}

/// What identifies each run beside its parameters and closure, as JSON; none where its row does not tell.
pub fn options(archive: &Path, entries: &[Entry]) -> Result<Vec<Option<Arc<str>>>, ArchiveError> {
    rows_of(archive, entries, Kind::Runs, &["options"], |batch, row, _| {
        // Files before version 5 have no such column.
        let column = batch.column_by_name("options").and_then(|c| c.as_string_opt::<i32>());
        Ok(column.filter(|c| c.is_valid(row)).map(|c| Arc::from(c.value(row))))
    })
}

/// First row of a chunk's rows in a file, and the row after its last one.
type Stretch = (i64, i64);
/// The ids of the runs that are looked for in each stretch of a file.
type Wanted<'a> = BTreeMap<Stretch, BTreeSet<&'a str>>;
/// Whose row is the last one that a run has, by row.
type LastRows<'a> = BTreeMap<i64, (Stretch, &'a str)>;

/// What is read off the last row that each run has in a table.
fn rows_of<T: Clone>(
    archive: &Path,
    entries: &[Entry],
    kind: Kind,
    names: &[&str],
    get: impl Fn(&RecordBatch, usize, &str) -> Result<Option<T>, ArchiveError>,
) -> Result<Vec<Option<T>>, ArchiveError> {
    let mut in_files: BTreeMap<&str, (&Place, Wanted<'_>)> = BTreeMap::new();
    for entry in entries {
        let Some(place) = entry.place(kind) else { continue };
        let (_, wanted) =
            in_files.entry(&place.file.path).or_insert_with(|| (place, Wanted::new()));
        wanted.entry(stretch(place)).or_default().insert(entry.row.text("run_id"));
    }
    let mut found: HashMap<(&str, Stretch, &str), T> = HashMap::new();
    for (path, (place, wanted)) in &in_files {
        let table = Table::open(archive, place)?;
        let last = table.last_rows(wanted)?;
        let ranges = last.keys().map(|row| *row as usize..*row as usize + 1);
        let mut runs = last.values();
        for batch in table.read(names, ranges.collect())? {
            for row in 0..batch.num_rows() {
                let Some((stretch, id)) = runs.next() else { break };
                if let Some(value) = get(&batch, row, path)? {
                    found.insert((path, *stretch, id), value);
                }
            }
        }
    }
    let of = |entry: &Entry| {
        let place = entry.place(kind)?;
        let key = (place.file.path.as_str(), stretch(place), entry.row.text("run_id"));
        found.get(&key).cloned()
    };
    Ok(entries.iter().map(of).collect())
}

fn stretch(place: &Place) -> Stretch {
    (place.first_row, place.first_row + place.row_count)
}

/// A file of a table, with its footer and the index of its pages.
struct Table<'a> {
    path: &'a str,
    file: File,
    metadata: ArrowReaderMetadata,
}

impl<'a> Table<'a> {
    fn open(archive: &Path, place: &'a Place) -> Result<Self, ArchiveError> {
        let (path, file) = (place.file.path.as_str(), files::open(archive, &place.file)?);
        let options = ArrowReaderOptions::new().with_page_index_policy(PageIndexPolicy::Optional);
        let metadata = ArrowReaderMetadata::load(&file, options)
            .map_err(|source| ArchiveError::Parquet { path: path.to_owned(), source })?;
        Ok(Self { path, file, metadata })
    }

    /// The last row of each wanted run, by row.
    fn last_rows<'b>(&self, wanted: &Wanted<'b>) -> Result<LastRows<'b>, ArchiveError> {
        let mut last: HashMap<(Stretch, &'b str), i64> = HashMap::new();
        // Chunks have stretches of their own, in the order of their rows.
        let mut end = 0;
        let mut stretches = Vec::with_capacity(wanted.len());
        for (stretch, ids) in wanted {
            stretches.push((*stretch, ids, stretch.0.max(end)..stretch.1.max(end)));
            end = stretch.1.max(end);
        }
        let ranges: Vec<Range<usize>> =
            stretches.iter().map(|(.., rows)| rows.start as usize..rows.end as usize).collect();
        let mut rows = stretches
            .into_iter()
            .flat_map(|(stretch, ids, rows)| rows.map(move |row| (stretch, ids, row)));
        for batch in self.read(&["run_id"], ranges)? {
            let no_ids = || ArchiveError::Column { path: self.path.to_owned(), column: "run_id" };
            let ids: &StringArray = batch
                .column_by_name("run_id")
                .and_then(|column| column.as_string_opt())
                .ok_or_else(no_ids)?;
            for i in 0..ids.len() {
                let Some((stretch, wanted, row)) = rows.next() else { break };
                if let Some(id) = wanted.get(ids.value(i)) {
                    last.insert((stretch, *id), row);
                }
            }
        }
        Ok(last.into_iter().map(|(run, row)| (row, run)).collect())
    }

    /// Columns of some rows, ascending.
    fn read(
        &self,
        names: &[&str],
        rows: Vec<Range<usize>>,
    ) -> Result<Vec<RecordBatch>, ArchiveError> {
        let damaged = |source| ArchiveError::Parquet { path: self.path.to_owned(), source };
        let broken = |e: ArrowError| damaged(ParquetError::External(Box::new(e)));
        let file = self.file.try_clone().map_err(|source| ArchiveError::File {
            path: self.path.to_owned(),
            doing: "read",
            source,
        })?;
        let groups = self.metadata.metadata().row_groups();
        let total: i64 = groups.iter().map(|group| group.num_rows()).sum();
        let fields = self.metadata.schema().fields().iter().enumerate();
        let roots = fields.filter(|(_, f)| names.contains(&f.name().as_str())).map(|(i, _)| i);
        let mask = ProjectionMask::roots(self.metadata.parquet_schema(), roots);
        let selection = RowSelection::from_consecutive_ranges(rows.into_iter(), total as usize);
        ParquetRecordBatchReaderBuilder::new_with_metadata(file, self.metadata.clone())
            .with_projection(mask)
            .with_row_selection(selection)
            .build()
            .map_err(damaged)?
            .collect::<Result<_, _>>()
            .map_err(broken)
    }
}
