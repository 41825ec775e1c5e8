//! What is kept: Parquet files of runs, profiles, series and curves, and their catalogue. Knows no queue and no
//! transport. A file counts once the catalogue lists it; readers never look into folders.

pub mod backup;
pub mod bulk;
pub mod catalogue;
pub mod columns;
pub mod compact;
pub mod ensemble;
pub mod files;
pub mod gathered;
pub mod likeness;
pub mod long;
pub mod netcdf;
pub mod provenance;
pub mod read;
pub mod recall;
pub mod restore;
pub mod reuse;
pub mod schema;
pub mod splice;
pub mod start;
pub mod states;
pub mod upload;
pub mod verify;

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

/// What to do about a file that is damaged or missing, at the end of a sentence about it.
pub const REPAIR: &str =
    "; `melange verify --repair` has its runs solved again, unless they are sealed";

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
    /// A file's bytes are not those that were written.
    #[error("the archive's file {path} is damaged: {difference}{REPAIR}")]
    Damaged {
        /// Which.
        path: String,
        /// How it differs.
        difference: String,
    },
    /// A file was written by a later version.
    #[error(
        "the archive's file {path} has schema version {version}, which this version of melange does not know: use a newer one"
    )]
    Newer {
        /// Which.
        path: String,
        /// Its version.
        version: i64,
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
    /// A sweep is larger than a NetCDF file is made of.
    #[error(
        "the sweep's dataset has {numbers} numbers, and at most {most} are put into one NetCDF file; its Parquet \
         tables have no such bound"
    )]
    TooLarge {
        /// Its numbers.
        numbers: u64,
        /// Most of them.
        most: u64,
    },
    /// There is nothing to make a dataset of.
    #[error("no run of the sweep has ended yet: there is nothing to make a dataset of")]
    NoRuns,
    /// A file lacks a column.
    #[error("the archive's file {path} lacks the column {column}")]
    Column {
        /// Which.
        path: String,
        /// The column.
        column: &'static str,
    },
}

impl ArchiveError {
    /// Whether what a file held is gone; else it may be there, though it cannot be read now.
    pub fn is_loss(&self) -> bool {
        match self {
            Self::Damaged { .. } | Self::Parquet { .. } => true,
            Self::File { source, .. } => source.kind() == std::io::ErrorKind::NotFound,
            _ => false,
        }
    }

    /// What Parquet says of a file that is read or written; trouble of the disk is that, and not damage.
    pub fn of_parquet(
        path: String,
        doing: &'static str,
        source: parquet::errors::ParquetError,
    ) -> Self {
        use parquet::errors::ParquetError;
        match source {
            ParquetError::External(inner) => match inner.downcast::<std::io::Error>() {
                Ok(source) => Self::File { path, doing, source: *source },
                Err(inner) => Self::Parquet { path, source: ParquetError::External(inner) },
            },
            source => Self::Parquet { path, source },
        }
    }
}
