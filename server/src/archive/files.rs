//! Files on disk: write to a temporary name, fsync, rename, fsync the folder; and what a start clears
//! away. Knows no table.

use super::schema::{Kind, SCHEMA_VERSION};
use super::{ArchiveError, SolvedRun};
use parquet::arrow::ArrowWriter;
use parquet::basic::{Compression, ZstdLevel};
use parquet::file::properties::WriterProperties;
use std::collections::HashSet;
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// A file that stands under its final name.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Written {
    /// Path below the archive's folder, with `/`.
    pub path: String,
    /// Table.
    pub kind: Kind,
    /// Hash of its bytes.
    pub blake3: String,
    /// Rows.
    pub rows: i64,
    /// Bytes.
    pub bytes: i64,
    /// Version of its schema.
    pub schema_version: i64,
}

/// Ending of a file that is not complete yet.
const TEMPORARY: &str = "tmp";
/// Ending of a complete file.
const COMPLETE: &str = "parquet";

/// Properties of every Parquet file written.
pub fn properties() -> WriterProperties {
    WriterProperties::builder().set_compression(Compression::ZSTD(ZstdLevel::default())).build()
}

/// Writes a chunk's tables; those without rows are left out, but for the runs. `token` keeps two
/// holders of the same chunk from writing to one name.
pub fn write_chunk(
    archive: &Path,
    sweep_id: &str,
    chunk: i64,
    token: &str,
    runs: &[SolvedRun],
) -> Result<Vec<Written>, ArchiveError> {
    let folder = archive.join(sweep_id);
    let fault = |path: &Path, doing| {
        let path = path.display().to_string();
        move |source| ArchiveError::File { path, doing, source }
    };
    fs::create_dir_all(&folder).map_err(fault(&folder, "made"))?;
    let mut written = Vec::new();
    for kind in Kind::ALL {
        let batch = kind.batch(runs);
        if batch.num_rows() == 0 && kind != Kind::Runs {
            continue;
        }
        let path = format!("{sweep_id}/{chunk:06}-{token}-{}.{COMPLETE}", kind.name());
        let damaged = |source| ArchiveError::Parquet { path: path.clone(), source };
        let mut writer =
            ArrowWriter::try_new(Vec::new(), kind.schema(), Some(properties())).map_err(damaged)?;
        writer.write(&batch).map_err(damaged)?;
        let bytes = writer.into_inner().map_err(damaged)?;
        let target = archive.join(&path);
        place(&target, &bytes).map_err(fault(&target, "written"))?;
        written.push(Written {
            path,
            kind,
            blake3: blake3::hash(&bytes).to_hex().to_string(),
            rows: batch.num_rows() as i64,
            bytes: bytes.len() as i64,
            schema_version: SCHEMA_VERSION,
        });
    }
    File::open(&folder).and_then(|f| f.sync_all()).map_err(fault(&folder, "synced"))?;
    Ok(written)
}

fn place(target: &Path, bytes: &[u8]) -> io::Result<()> {
    let temporary = target.with_extension(TEMPORARY);
    let mut file = File::create(&temporary)?;
    file.write_all(bytes)?;
    file.sync_all()?;
    drop(file);
    fs::rename(&temporary, target)
}

/// Removes files that could not be stored in the catalogue. What stays behind is an orphan, and the
/// next start removes it.
pub fn remove(archive: &Path, written: &[Written]) {
    for file in written {
        fs::remove_file(archive.join(&file.path)).ok();
    }
}

/// Removes our files that the catalogue does not list; returns how many there were.
pub fn remove_orphans(archive: &Path, listed: &HashSet<String>) -> io::Result<usize> {
    let mut removed = 0;
    for sweep in fs::read_dir(archive)? {
        let sweep = sweep?;
        if !sweep.file_type()?.is_dir() {
            continue;
        }
        for file in fs::read_dir(sweep.path())? {
            let path: PathBuf = file?.path();
            let ending = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
            let name = format!(
                "{}/{}",
                sweep.file_name().to_string_lossy(),
                path.file_name().unwrap_or_default().to_string_lossy()
            );
            let orphan = ending == TEMPORARY || (ending == COMPLETE && !listed.contains(&name));
            if orphan {
                fs::remove_file(&path)?;
                removed += 1;
            }
        }
    }
    Ok(removed)
}

/// Listed files that are missing or have another size, each with a sentence.
pub fn faults(archive: &Path, listed: &[(String, i64)]) -> Vec<String> {
    listed
        .iter()
        .filter_map(|(path, bytes)| match fs::metadata(archive.join(path)) {
            Err(e) => Some(format!("{path} cannot be read: {e}")),
            Ok(found) if found.len() as i64 != *bytes => {
                Some(format!("{path} has {} bytes and should have {bytes}", found.len()))
            }
            Ok(_) => None,
        })
        .collect()
}
