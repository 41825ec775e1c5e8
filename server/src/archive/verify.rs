//! Verification: the catalogue against itself and against the files, byte by byte; and what to do again.

use super::catalogue::{self, Listed, rows_of_homes};
use super::{ArchiveError, files};
use crate::domain::taken_out::TakenOut;
use crate::store::Connection;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use std::collections::{BTreeSet, HashSet};
use std::fs::File;
use std::path::Path;

/// What a verification found.
#[derive(Debug, Clone, Default, PartialEq, Eq, serde::Serialize)]
pub struct Findings {
    /// Files looked at.
    pub files: usize,
    /// Bytes of them.
    pub bytes: i64,
    /// Files that are missing or damaged, with a sentence each.
    pub damaged: Vec<(String, String)>,
    /// Files that cannot be read or understood here, which may be whole, with a sentence each.
    pub unreadable: Vec<(String, String)>,
    /// Files that nobody lists.
    pub orphans: Vec<String>,
    /// What contradicts itself in the catalogue.
    pub contradictions: Vec<String>,
}

impl Findings {
    /// Whether everything is as it should be.
    pub fn is_clean(&self) -> bool {
        self.damaged.is_empty()
            && self.unreadable.is_empty()
            && self.orphans.is_empty()
            && self.contradictions.is_empty()
    }
}

/// Compares catalogue and files.
pub async fn verify(connection: &mut Connection, archive: &Path) -> Result<Findings, ArchiveError> {
    let contradictions = catalogue::counts(connection).await?;
    let listed = catalogue::all_files(connection).await?;
    let archive = archive.to_owned();
    tokio::task::spawn_blocking(move || {
        let names: HashSet<String> = listed.iter().map(|file| file.path.clone()).collect();
        let orphans = files::orphans(&archive, &names).map_err(|source| ArchiveError::File {
            path: archive.display().to_string(),
            doing: "listed",
            source,
        })?;
        let (mut damaged, mut unreadable) = (Vec::new(), Vec::new());
        for file in &listed {
            let checked = files::check(&archive, file).and_then(|()| readable(&archive, file));
            let Err(error) = checked else { continue };
            let found = (file.path.clone(), error.to_string());
            if error.is_loss() { damaged.push(found) } else { unreadable.push(found) }
        }
        Ok(Findings {
            files: listed.len(),
            bytes: listed.iter().map(|file| file.byte_count).sum(),
            damaged,
            unreadable,
            orphans,
            contradictions,
        })
    })
    .await?
}

/// Whether a file that is what was written is Parquet with the rows it is listed with.
fn readable(archive: &Path, file: &Listed) -> Result<(), ArchiveError> {
    let opened = File::open(archive.join(&file.path)).map_err(|source| ArchiveError::File {
        path: file.path.clone(),
        doing: "read",
        source,
    })?;
    let builder = ParquetRecordBatchReaderBuilder::try_new(opened)
        .map_err(|source| ArchiveError::Parquet { path: file.path.clone(), source })?;
    let rows = builder.metadata().file_metadata().num_rows();
    if rows == file.row_count {
        return Ok(());
    }
    let difference = format!("it has {rows} rows and should have {}", file.row_count);
    Err(ArchiveError::Damaged { path: file.path.clone(), difference })
}

/// Results that a damaged file takes with it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Lost {
    /// The sweep whose runs are to be done again.
    pub sweep: i64,
    /// Its results, taken out of the catalogue.
    pub taken: TakenOut,
}

/// What became of damaged files.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct TakenOutOfFiles {
    /// Results that are to be solved again.
    pub lost: Vec<Lost>,
    /// Files of sealed sweeps, which are not solved again: a sealed sweep never changes.
    pub sealed: Vec<String>,
}

/// Takes everything that stands in damaged files out of the catalogue, so that it can be solved again; but not
/// what is sealed.
pub async fn take_out_damaged(
    connection: &mut Connection,
    damaged: &[(String, String)],
) -> sqlx::Result<TakenOutOfFiles> {
    let mut homes: BTreeSet<(i64, i64)> = BTreeSet::new();
    let mut sealed: BTreeSet<(i64, i64)> = BTreeSet::new();
    let mut taken_out = TakenOutOfFiles::default();
    for (path, _) in damaged {
        let is_sealed = catalogue::is_sealed_file(connection, path).await?;
        if is_sealed {
            taken_out.sealed.push(path.clone());
        }
        for (sweep, chunk, guests) in rows_of_homes(connection, path).await? {
            let seen = if is_sealed { &mut sealed } else { &mut homes };
            if !seen.insert((sweep, chunk)) {
                continue;
            }
            // Others that took runs over from a sealed sweep have theirs solved again.
            for guest in guests.into_iter().filter(|guest| !is_sealed || *guest != sweep) {
                let which = catalogue::Which::Home(sweep, chunk);
                let taken = catalogue::take_out(connection, guest, which).await?;
                taken_out.lost.push(Lost { sweep: guest, taken });
            }
        }
    }
    let mut sweeps: Vec<i64> = sealed.into_iter().map(|(sweep, _)| sweep).collect();
    sweeps.dedup();
    catalogue::set_damaged(connection, &sweeps).await?;
    for (sweep, chunk) in homes {
        catalogue::drop_home(connection, sweep, chunk).await?;
    }
    Ok(taken_out)
}
