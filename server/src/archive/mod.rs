//! What is kept: Parquet files of runs, profiles and series, and their catalogue. Knows no queue and no
//! transport. A file counts once the catalogue lists it; readers never look into folders.

pub mod bulk;
pub mod catalogue;
pub mod files;
pub mod read;
pub mod schema;
pub mod start;

use crate::domain::outcome::Outcome;

/// A solved run with its place in the sweep.
#[derive(Debug, Clone, PartialEq)]
pub struct SolvedRun {
    /// Index in the sweep.
    pub run_index: usize,
    /// Identity.
    pub run_id: String,
    /// Result.
    pub outcome: Outcome,
}

/// What can go wrong with the archive.
#[derive(Debug, thiserror::Error)]
pub enum ArchiveError {
    /// The database refused.
    #[error("the catalogue cannot be read or written: {0}")]
    Catalogue(#[from] sqlx::Error),
    /// A file could not be read or written.
    #[error("the archive's file {path} cannot be {doing}: {source}")]
    File {
        /// Which.
        path: String,
        /// What was tried.
        doing: &'static str,
        /// Why.
        source: std::io::Error,
    },
    /// A file is not the Parquet it should be.
    #[error("the archive's file {path} is damaged: {source}")]
    Parquet {
        /// Which.
        path: String,
        /// Why.
        source: parquet::errors::ParquetError,
    },
    /// A reader broke off.
    #[error("reading the archive broke off: {0}")]
    Broken(#[from] tokio::task::JoinError),
    /// A run has a status that this version does not know.
    #[error("run {run_id} has the status `{status}`, which this version does not know")]
    Status {
        /// Which run.
        run_id: String,
        /// The status.
        status: String,
    },
    /// A file lacks a column.
    #[error("the archive's file {path} lacks the column {column}")]
    Column {
        /// Which.
        path: String,
        /// The column.
        column: &'static str,
    },
}
