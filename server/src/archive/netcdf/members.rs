//! Which rows of a table with many rows per run belong to which runs. A run that a sweep has under two indices
//! has its rows twice, behind each other.

use super::runs::Runs;
use crate::archive::ArchiveError;
use crate::archive::bulk::each_batch;
use crate::archive::catalogue::{Layout, id_number};
use crate::archive::schema::Kind;
use arrow_array::RecordBatch;
use arrow_array::cast::AsArray;
use std::collections::HashMap;
use std::path::Path;

/// Rows of each run, in the order of the runs.
#[derive(Debug)]
pub struct Members {
    rows: Vec<usize>,
}

impl Members {
    /// Counts the rows; `see` gets each, as batch and row.
    pub fn count(
        archive: &Path,
        layout: &Layout,
        kind: Kind,
        runs: &Runs,
        mut see: impl FnMut(&RecordBatch, usize),
    ) -> Result<Self, ArchiveError> {
        let mut of_id: HashMap<u128, usize> = HashMap::new();
        each_batch(archive, layout, kind, &mut |batch| {
            let ids = batch.column(0).as_string::<i32>();
            for row in 0..batch.num_rows() {
                let id = id_number(ids.value(row)).unwrap_or_default();
                *of_id.entry(id).or_default() += 1;
                see(batch, row);
            }
            Ok(())
        })?;
        let each = |id: &u128| of_id.get(id).map_or(0, |rows| rows / runs.with_id(*id).len());
        Ok(Self { rows: runs.ids().iter().map(each).collect() })
    }

    /// Most rows of any run.
    pub fn most(&self) -> usize {
        self.rows.iter().copied().max().unwrap_or_default()
    }

    /// Hands over batch, row, run and place among the run's rows, of each row.
    pub fn each(
        &self,
        archive: &Path,
        layout: &Layout,
        kind: Kind,
        runs: &Runs,
        mut take: impl FnMut(&RecordBatch, usize, usize, usize),
    ) -> Result<(), ArchiveError> {
        let mut seen: HashMap<u128, usize> = HashMap::new();
        each_batch(archive, layout, kind, &mut |batch| {
            let ids = batch.column(0).as_string::<i32>();
            for row in 0..batch.num_rows() {
                let id = id_number(ids.value(row)).unwrap_or_default();
                let among = seen.entry(id).or_default();
                let with_id = runs.with_id(id);
                if let Some(rows) = with_id.first().map(|run| self.rows[*run].max(1))
                    && let Some(run) = with_id.get(*among / rows)
                {
                    take(batch, row, *run, *among % rows);
                }
                *among += 1;
            }
            Ok(())
        })
    }

    /// Whether all runs that have rows have as many.
    pub fn are_even(&self) -> bool {
        let most = self.most();
        self.rows.iter().all(|rows| [0, most].contains(rows))
    }
}

/// The one row that all rows of a table are, as bits: of a run without numbers nothing is asked.
pub fn common(values: &[f64], along: usize) -> Option<&[f64]> {
    let mut rows = values.chunks_exact(along).filter(|row| row.iter().any(|v| !v.is_nan()));
    let first = rows.next()?;
    let same = |row: &[f64]| row.iter().zip(first).all(|(a, b)| a.to_bits() == b.to_bits());
    (first.iter().all(|v| !v.is_nan()) && rows.all(same)).then_some(first)
}
