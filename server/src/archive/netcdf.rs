//! A sweep as one NetCDF-4 dataset with CF metadata: its runs, their states and their series. The long tables
//! and residual histories have no shape that fits and stay in Parquet. Knows no transport.
//!
//! Dimensions: `run`; `node` and `cell` where there are states; `snapshot` where they have times; `time_a` (or `output`)
//! where there are series. Time is none of CF's axes, since it counts from no date. What is shorter than its dimension, and what does not exist, is NaN (text: empty).

mod dataset;
mod members;
mod runs;
mod series;
mod states;

use super::ArchiveError;
use super::bulk;
use super::catalogue::Layout;
use super::schema::Kind;
use dataset::{Dataset, unwritten};
use std::fs::File;
use std::io::{BufWriter, Seek, Write};
use std::path::Path;
use std::sync::{Mutex, PoisonError};

/// The tables that a dataset is made of.
pub const KINDS: [Kind; 3] = [Kind::Runs, Kind::Profiles, Kind::Series];

/// Most numbers of a dataset: 128 MiB. The writer has the whole dataset in memory, about four times over.
pub const MOST_NUMBERS: u64 = 1 << 24;

/// What the dataset tells of its sweep.
#[derive(Debug, Clone)]
pub struct About {
    /// Id of the sweep.
    pub sweep_id: String,
    /// Its name.
    pub name: String,
    /// When it was submitted.
    pub submitted_at: String,
}

/// A sweep's dataset as an open, nameless file on the archive's disk, and its length.
pub fn gather(
    archive: &Path,
    layouts: &[(Kind, Layout)],
    about: &About,
) -> Result<(File, u64), ArchiveError> {
    let mut file = tempfile::tempfile_in(archive).map_err(unwritten)?;
    write(archive, layouts, about, &mut file)?;
    file.rewind().map_err(unwritten)?;
    let length = file.metadata().map_err(unwritten)?.len();
    Ok((file, length))
}

/// Writes a sweep's dataset. `layouts` has those of [`KINDS`]. The bytes depend on nothing but the arguments.
pub fn write(
    archive: &Path,
    layouts: &[(Kind, Layout)],
    about: &About,
    target: &mut File,
) -> Result<(), ArchiveError> {
    let nothing = Layout::default();
    let of = |kind| layouts.iter().find(|(k, _)| *k == kind).map_or(&nothing, |(_, l)| l);
    // Before anything is read: what there is at least.
    bound(KINDS.map(|kind| (of(kind).rows() * kind.schema().fields().len()) as u64))?;
    let mut batches = Vec::new();
    bulk::each_batch(archive, of(Kind::Runs), Kind::Runs, &mut |batch| {
        batches.push(batch.clone());
        Ok(())
    })?;
    let runs = runs::Runs::new(&batches)?;
    drop(batches);
    if runs.count() == 0 {
        return Err(ArchiveError::NoRuns);
    }
    let states = states::States::look(archive, of(Kind::Profiles), &runs)?;
    let series = series::Times::look(archive, of(Kind::Series), &runs)?;
    bound([runs.numbers(), states.numbers(&runs), series.numbers(&runs)])?;
    /// Written one at a time: the writer has the whole dataset in memory.
    static ONE: Mutex<()> = Mutex::new(());
    let _one = ONE.lock().unwrap_or_else(PoisonError::into_inner);

    let mut dataset = Dataset::new(about)?;
    runs.put(&mut dataset)?;
    states.put(&mut dataset, archive, of(Kind::Profiles), &runs)?;
    series.put(&mut dataset, archive, of(Kind::Series), &runs)?;
    let mut target = BufWriter::new(target);
    dataset.write(&mut target)?;
    target.flush().map_err(unwritten)
}

fn bound(numbers: [u64; 3]) -> Result<(), ArchiveError> {
    let numbers = numbers.iter().sum();
    if numbers > MOST_NUMBERS {
        return Err(ArchiveError::TooLarge { numbers, most: MOST_NUMBERS });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::archive::catalogue::{Listed, Piece, Place};

    fn about() -> About {
        About { sweep_id: "1".into(), name: String::new(), submitted_at: "then".into() }
    }

    #[test]
    fn what_is_too_large_is_refused_before_it_is_read() {
        let archive = tempfile::tempdir().expect("a folder");
        let rows = (MOST_NUMBERS / 10) as i64;
        let file = Listed {
            path: "nowhere".into(),
            blake3: String::new(),
            byte_count: 0,
            row_count: rows,
            schema_version: 4,
        };
        let place = Place { file, first_row: 0, row_count: rows };
        let layout = Layout { groups: vec![vec![Piece { place, wanted: None }]] };
        for kind in KINDS {
            // Series have eleven columns, the others more, or arrays.
            let found = gather(archive.path(), &[(kind, layout.clone())], &about());
            let is_large = matches!(found, Err(ArchiveError::TooLarge { .. }));
            assert!(is_large || kind == Kind::Profiles, "{kind:?}: {found:?}");
        }
    }

    #[test]
    fn a_sweep_without_runs_has_no_dataset() {
        let archive = tempfile::tempdir().expect("a folder");
        let found = gather(archive.path(), &[], &about());
        assert!(matches!(found, Err(ArchiveError::NoRuns)), "{found:?}");
    }
}
