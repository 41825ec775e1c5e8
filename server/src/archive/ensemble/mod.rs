//! A sweep as something that travels and is cited: sealing, its manifest, the folder it is exported as, and
//! what is checked before one is believed. Knows no queue and no transport.

pub mod check;
pub mod describe;
pub mod export;
pub mod identity;
pub mod import;
pub mod manifest;
pub mod pages;
pub mod research_object;
pub mod seal;
pub mod table;
pub mod unpack;

use super::ArchiveError;
use std::io;
use std::path::Path;

/// Why an archive from elsewhere is not taken.
#[derive(Debug, thiserror::Error)]
pub enum ImportError {
    /// It is not what an export is.
    #[error("{0}")]
    Refused(String),
    /// It has results that contradict those that are here.
    #[error("{0}")]
    Conflict(String),
    /// This data directory is in trouble.
    #[error("{0}")]
    Archive(ArchiveError),
}

fn refused(sentence: impl Into<String>) -> ImportError {
    ImportError::Refused(sentence.into())
}

/// Trouble with a file on the way in or out.
fn fault(path: &Path, doing: &'static str, source: io::Error) -> ArchiveError {
    ArchiveError::File { path: path.display().to_string(), doing, source }
}
