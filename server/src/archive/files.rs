//! Files on disk: write to a temporary name, fsync, rename, fsync the folder; check what is read; clear
//! away what nobody lists. Knows no table.

use super::catalogue::Listed;
use super::schema::{Kind, SCHEMA_VERSION};
use super::{ArchiveError, SolvedRun};
use crate::faults::{Faults, Step};
use parquet::arrow::{ArrowSchemaConverter, ArrowWriter};
use parquet::basic::{Compression, Encoding, Type, ZstdLevel};
use parquet::file::properties::{WriterProperties, WriterPropertiesBuilder};
use parquet::schema::types::ColumnDescPtr;
use sha2::{Digest, Sha256};
use std::collections::HashSet;
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::{LazyLock, Mutex};

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
/// How the folder of an import under way begins.
pub const IMPORT: &str = "import-";
/// Ending of a complete file.
const COMPLETE: &str = "parquet";

/// Properties of every Parquet file written. Parameters of runs repeat, and have a dictionary; numbers on a grid and in
/// time hardly ever do: their bytes are put beside those of the same weight, of which the upper ones pack well.
pub fn properties(kind: Kind) -> WriterProperties {
    let properties = WriterProperties::builder()
        .set_compression(Compression::ZSTD(ZstdLevel::default()))
        .set_dictionary_enabled(kind == Kind::Runs);
    if kind == Kind::Runs {
        return properties.build();
    }
    let columns = ArrowSchemaConverter::new().convert(&kind.schema()).expect("types of Parquet");
    let numbers = columns.columns().iter().filter(|c| c.physical_type() == Type::DOUBLE);
    let split = |properties: WriterPropertiesBuilder, column: &ColumnDescPtr| {
        properties.set_column_encoding(column.path().clone(), Encoding::BYTE_STREAM_SPLIT)
    };
    numbers.fold(properties, split).build()
}

/// Path of a table's file below the archive's folder.
pub fn path_of(sweep_id: &str, stem: &str, token: &str, kind: Kind) -> String {
    format!("{sweep_id}/{stem}-{token}-{}.{COMPLETE}", kind.name())
}

/// A table's file before it is written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Encoded {
    kind: Kind,
    bytes: Vec<u8>,
    blake3: String,
    rows: i64,
}

/// The tables of a chunk's runs as Parquet; those without rows are left out. No runs have no tables.
pub fn encode(runs: &[SolvedRun]) -> Result<Vec<Encoded>, ArchiveError> {
    let mut tables = Vec::with_capacity(Kind::ALL.len());
    for kind in Kind::ALL {
        let batch = kind.batch(runs);
        if batch.num_rows() == 0 {
            continue;
        }
        let damaged = |source| ArchiveError::Parquet { path: kind.name().to_owned(), source };
        let mut writer = ArrowWriter::try_new(Vec::new(), kind.schema(), Some(properties(kind)))
            .map_err(damaged)?;
        writer.write(&batch).map_err(damaged)?;
        let bytes = writer.into_inner().map_err(damaged)?;
        let blake3 = blake3::hash(&bytes).to_hex().to_string();
        tables.push(Encoded { kind, bytes, blake3, rows: batch.num_rows() as i64 });
    }
    Ok(tables)
}

/// Writes a chunk's tables. `token` keeps two holders of the same chunk from writing to one name.
pub fn write_chunk(
    archive: &Path,
    sweep_id: &str,
    chunk: i64,
    token: &str,
    tables: &[Encoded],
    faults: &Faults,
) -> Result<Vec<Written>, ArchiveError> {
    faults.pass(Step::BeforeWrite);
    let folder = make_folder(archive, sweep_id)?;
    let mut written = Vec::new();
    let result = tables.iter().try_for_each(|Encoded { kind, bytes, blake3, rows }| {
        let (kind, rows, blake3) = (*kind, *rows, blake3.clone());
        let path = path_of(sweep_id, &format!("{chunk:06}"), token, kind);
        let target = archive.join(&path);
        place(&target, bytes, faults).map_err(|e| fault(&target, "written", e))?;
        let bytes = bytes.len() as i64;
        written.push(Written { path, kind, blake3, rows, bytes, schema_version: SCHEMA_VERSION });
        Ok(())
    });
    let result = result.and_then(|()| sync(&folder).map_err(|e| fault(&folder, "synced", e)));
    if let Err(error) = result {
        // What a full disk left half-written would only fill it further.
        remove(archive, written.iter().map(|w| w.path.as_str()));
        return Err(error);
    }
    faults.pass(Step::AfterRename);
    Ok(written)
}

fn place(target: &Path, bytes: &[u8], faults: &Faults) -> io::Result<()> {
    let temporary = target.with_extension(TEMPORARY);
    let result = (|| {
        let mut file = File::create(&temporary)?;
        file.write_all(bytes)?;
        faults.pass(Step::AfterWrite);
        file.sync_all()?;
        drop(file);
        faults.pass(Step::AfterFsync);
        fs::rename(&temporary, target)
    })();
    if result.is_err() {
        fs::remove_file(&temporary).ok();
    }
    result
}

/// Writes one file by way of a temporary name; what `write` returns is the number of rows.
pub fn write_file(
    archive: &Path,
    path: &str,
    kind: Kind,
    write: impl FnOnce(&mut File) -> Result<i64, ArchiveError>,
) -> Result<Written, ArchiveError> {
    let target = archive.join(path);
    let temporary = target.with_extension(TEMPORARY);
    let result = (|| {
        let mut file = File::create(&temporary).map_err(|e| fault(&temporary, "written", e))?;
        let rows = write(&mut file)?;
        file.sync_all().map_err(|e| fault(&temporary, "synced", e))?;
        let (blake3, bytes) = hash(&temporary).map_err(|e| fault(&temporary, "read", e))?;
        fs::rename(&temporary, &target).map_err(|e| fault(&target, "renamed", e))?;
        let folder = target.parent().unwrap_or(archive);
        sync(folder).map_err(|e| fault(folder, "synced", e))?;
        Ok(Written {
            path: path.to_owned(),
            kind,
            blake3,
            rows,
            bytes,
            schema_version: SCHEMA_VERSION,
        })
    })();
    if result.is_err() {
        fs::remove_file(&temporary).ok();
    }
    result
}

/// Copies a file's bytes and has the copy on the disk. Its mode is that of a new file: what was backed up to a
/// medium that cannot be written is to be written again.
pub fn copy(from: &Path, to: &Path) -> io::Result<()> {
    let mut source = File::open(from)?;
    let mut target = File::create(to)?;
    io::copy(&mut source, &mut target)?;
    target.sync_all()
}

/// Has on the disk which files a folder holds.
pub fn sync_folder(folder: &Path) -> io::Result<()> {
    sync(folder)
}

/// The same of an archive and of its folders.
pub fn sync_folders(archive: &Path) -> io::Result<()> {
    for entry in fs::read_dir(archive)? {
        let entry = entry?;
        if entry.file_type()?.is_dir() {
            sync(&entry.path())?;
        }
    }
    sync(archive)
}

fn sync(folder: &Path) -> io::Result<()> {
    File::open(folder)?.sync_all()
}

fn fault(path: &Path, doing: &'static str, source: io::Error) -> ArchiveError {
    ArchiveError::File { path: path.display().to_string(), doing, source }
}

/// Hash and length of a file's bytes.
pub fn hash(path: &Path) -> io::Result<(String, i64)> {
    let mut hasher = blake3::Hasher::new();
    hasher.update_reader(File::open(path)?)?;
    Ok((hasher.finalize().to_hex().to_string(), hasher.count() as i64))
}

/// SHA-256 of what is left of a reader, as other tools tell it.
pub fn sha256(mut reader: impl io::Read) -> io::Result<String> {
    let mut hasher = Sha256::new();
    let mut buffer = vec![0; 1 << 16];
    loop {
        let n = reader.read(&mut buffer)?;
        if n == 0 {
            break;
        }
        hasher.update(&buffer[..n]);
    }
    Ok(hex(&hasher.finalize()))
}

/// Bytes as hexadecimal digits.
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Makes the folder of a sweep, if it is not there.
pub fn make_folder(archive: &Path, sweep_id: &str) -> Result<PathBuf, ArchiveError> {
    let folder = archive.join(sweep_id);
    if !folder.is_dir() {
        fs::create_dir_all(&folder).map_err(|e| fault(&folder, "made", e))?;
        sync(archive).map_err(|e| fault(archive, "synced", e))?;
    }
    Ok(folder)
}

/// Files whose bytes this process has compared with their hash.
static CHECKED: LazyLock<Mutex<HashSet<PathBuf>>> = LazyLock::new(Mutex::default);

/// Opens a listed file, after comparing its bytes with their hash when it is read for the first time.
pub fn open(archive: &Path, listed: &Listed) -> Result<File, ArchiveError> {
    let path = archive.join(&listed.path);
    let is_checked = CHECKED.lock().is_ok_and(|checked| checked.contains(&path));
    if !is_checked {
        check(archive, listed)?;
        if let Ok(mut checked) = CHECKED.lock() {
            checked.insert(path.clone());
        }
    }
    File::open(&path).map_err(|source| unreadable(listed, source))
}

/// Compares a listed file with its hash.
pub fn check(archive: &Path, listed: &Listed) -> Result<(), ArchiveError> {
    if listed.schema_version > SCHEMA_VERSION {
        return Err(ArchiveError::Newer {
            path: listed.path.clone(),
            version: listed.schema_version,
        });
    }
    let (found, bytes) =
        hash(&archive.join(&listed.path)).map_err(|source| unreadable(listed, source))?;
    if (found.as_str(), bytes) == (listed.blake3.as_str(), listed.byte_count) {
        return Ok(());
    }
    let difference = if bytes == listed.byte_count {
        "its bytes differ from those that were written".to_owned()
    } else {
        format!("it has {bytes} bytes and should have {}", listed.byte_count)
    };
    Err(ArchiveError::Damaged { path: listed.path.clone(), difference })
}

fn unreadable(listed: &Listed, source: io::Error) -> ArchiveError {
    ArchiveError::File { path: listed.path.clone(), doing: "read", source }
}

/// Removes files that no commit will list.
pub fn remove<'a>(archive: &Path, paths: impl Iterator<Item = &'a str>) {
    for path in paths {
        let path = archive.join(path);
        match fs::remove_file(&path) {
            Ok(()) => {}
            // It stays behind as an orphan, which the next start clears away.
            Err(e) => tracing::warn!("cannot remove {}: {e}", path.display()),
        }
    }
}

/// Removes files that may be gone already.
pub fn remove_if_there<'a>(archive: &Path, paths: impl Iterator<Item = &'a str>) {
    remove(archive, paths.filter(|path| archive.join(path).exists()));
}

/// Removes the folder of a sweep that has no files any more.
pub fn remove_folder(archive: &Path, sweep_id: &str) {
    if let Err(e) = fs::remove_dir(archive.join(sweep_id))
        && e.kind() != io::ErrorKind::NotFound
    {
        tracing::warn!("cannot remove the folder of sweep {sweep_id}: {e}");
    }
}

/// Removes a folder if there is nothing in it.
pub fn remove_folder_if_empty(archive: &Path, name: &str) {
    // What is in use is not empty, and stays.
    fs::remove_dir(archive.join(name)).ok();
}

/// Removes folders that a dead process left empty.
pub fn remove_empty_folders(archive: &Path) -> io::Result<()> {
    for folder in fs::read_dir(archive)? {
        remove_folder_if_empty(archive, &folder?.file_name().to_string_lossy());
    }
    Ok(())
}

/// Files in the archive's folders that the catalogue does not list: temporary ones and complete ones.
pub fn orphans(archive: &Path, listed: &HashSet<String>) -> io::Result<Vec<String>> {
    let mut orphans = Vec::new();
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
            if ending == TEMPORARY || (ending == COMPLETE && !listed.contains(&name)) {
                orphans.push(name);
            }
        }
    }
    orphans.sort();
    Ok(orphans)
}

/// Listed files that are missing or have another size, each with a sentence.
pub fn faults(archive: &Path, listed: &[Listed]) -> Vec<String> {
    listed
        .iter()
        .filter_map(|file| match fs::metadata(archive.join(&file.path)) {
            Err(e) => Some(format!("{} cannot be read: {e}", file.path)),
            Ok(found) if found.len() as i64 != file.byte_count => Some(format!(
                "{} has {} bytes and should have {}",
                file.path,
                found.len(),
                file.byte_count
            )),
            Ok(_) => None,
        })
        .collect()
}
