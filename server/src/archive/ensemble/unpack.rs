//! An archive from elsewhere, unpacked into a folder of its own: only entries that an export has, each once and
//! as long as its manifest says, and every byte hashed. Nothing of it is believed here.

use super::super::{ArchiveError, files};
use super::export::{CHECKSUMS, CITATION, DATASET, FOLDER};
use super::manifest::{FileEntry, MANIFEST, Manifest, SPEC};
use super::research_object::METADATA;
use super::{ImportError, fault, refused};
use sha2::{Digest, Sha256};
use std::fs::File;
use std::io::{self, BufReader, Read, Write};
use std::path::{Path, PathBuf};
use tar::EntryType;

/// What is unpacked at most.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limits {
    /// Bytes of all files together, unpacked.
    pub bytes: u64,
}

impl Default for Limits {
    fn default() -> Self {
        Self { bytes: 1 << 38 }
    }
}

/// An ensemble whose bytes are those that its manifest tells.
#[derive(Debug)]
pub struct Staged {
    /// Its manifest.
    pub manifest: Manifest,
    /// What was solved.
    pub spec: String,
    /// Its tables.
    pub tables: Vec<(FileEntry, PathBuf)>,
}

/// Unpacked bytes for each byte of the archive: tables are compressed already, and what is text is short.
const MOST_GROWTH: u64 = 100;
/// Bytes that may be unpacked whatever the archive's length.
const ALWAYS: u64 = 16 << 20;
/// Largest manifest.
const MOST_MANIFEST: u64 = 4 << 20;
/// Largest file that follows from the manifest.
const MOST_TEXT: u64 = 16 << 20;
/// Largest document: a table of a million rows and ten columns.
const MOST_SPEC: u64 = 256 << 20;
/// Most ensembles of an archive.
const MOST_ENSEMBLES: usize = 1_000;
/// How far zstd may look back, as a power of two: 8 MiB, what its strongest ordinary level takes.
const WINDOW_LOG: u32 = 23;
/// Files that follow from the others; nothing is read of them.
const DERIVED: [&str; 5] = [METADATA, "README.md", CITATION, CHECKSUMS, DATASET];

/// More than may be unpacked.
#[derive(Debug, thiserror::Error)]
#[error("the archive unpacks to more than {0} bytes, which is more than it may")]
struct TooMuch(u64);

/// Counts what is read and stops at a limit.
struct Counted<R> {
    inner: R,
    left: u64,
    most: u64,
}

impl<R: Read> Read for Counted<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let n = self.inner.read(buffer)?;
        self.left =
            self.left.checked_sub(n as u64).ok_or_else(|| io::Error::other(TooMuch(self.most)))?;
        Ok(n)
    }
}

/// A folder under way.
struct Folder {
    name: String,
    manifest: Manifest,
    seen: Vec<String>,
    spec: Option<String>,
    tables: Vec<(FileEntry, PathBuf)>,
}

/// Unpacks an archive into a folder.
pub fn unpack(archive: File, into: &Path, limits: Limits) -> Result<Vec<Staged>, ImportError> {
    let length = archive.metadata().map_err(|e| fault(into, "read", e))?.len();
    let most = limits.bytes.min(length.saturating_mul(MOST_GROWTH).saturating_add(ALWAYS));
    let mut decoder = zstd::stream::read::Decoder::new(BufReader::new(archive))
        .map_err(|e| fault(into, "read", e))?;
    decoder.window_log_max(WINDOW_LOG).map_err(|e| fault(into, "read", e))?;
    let mut tar = tar::Archive::new(Counted { inner: decoder, left: most, most });
    let mut folders: Vec<Folder> = Vec::new();
    let entries = tar.entries().map_err(unreadable)?.raw(true);
    for entry in entries {
        let mut entry = entry.map_err(unreadable)?;
        let path = String::from_utf8_lossy(&entry.path_bytes()).into_owned();
        if entry.header().entry_type() != EntryType::Regular {
            return Err(refused(format!("{path:?} is no plain file, and an export has no others")));
        }
        let (folder, name) = place(&path)?;
        take(&mut folders, folder, name, &mut entry, into)?;
    }
    let mut rest = tar.into_inner();
    // Only what fills the last block may follow.
    let mut buffer = [0; 1 << 13];
    loop {
        let n = rest.read(&mut buffer).map_err(unreadable)?;
        if buffer[..n].iter().any(|byte| *byte != 0) {
            return Err(refused("something follows the end of the archive"));
        }
        if n == 0 {
            break;
        }
    }
    if folders.is_empty() {
        return Err(refused("the archive is empty"));
    }
    folders.into_iter().map(Folder::staged).collect()
}

/// What a reader of a foreign archive met.
fn unreadable(error: io::Error) -> ImportError {
    match error.get_ref().and_then(|e| e.downcast_ref::<TooMuch>()) {
        Some(too_much) => refused(too_much.to_string()),
        None => refused(format!("this is no whole archive of an export: {error}")),
    }
}

/// Folder and name of an entry; refused unless they are those of an export.
fn place(path: &str) -> Result<(&str, &str), ImportError> {
    let known = |name: &str| {
        name == MANIFEST
            || name == SPEC
            || DERIVED.contains(&name)
            || super::manifest::table_of(name).is_some()
    };
    let is_id = |id: &str| id.len() == 32 && id.bytes().all(|b| b"0123456789abcdef".contains(&b));
    path.split_once('/')
        .filter(|(folder, name)| folder.strip_prefix(FOLDER).is_some_and(is_id) && known(name))
        .ok_or_else(|| refused(format!("{path:?} is no name that an export has")))
}

fn take(
    folders: &mut Vec<Folder>,
    name: &str,
    file: &str,
    entry: &mut impl ReadSized,
    into: &Path,
) -> Result<(), ImportError> {
    let size = entry.size();
    let at = folders.iter().position(|folder| folder.name == name);
    if file == MANIFEST {
        if at.is_some() {
            return Err(refused(format!("{name} has two manifests")));
        }
        if folders.len() >= MOST_ENSEMBLES {
            return Err(refused(format!("more than {MOST_ENSEMBLES} ensembles in one archive")));
        }
        let text = text(entry, file, MOST_MANIFEST)?;
        let manifest = Manifest::checked(&text).map_err(refused)?;
        if name.strip_prefix(FOLDER) != Some(manifest.sweep.id.as_str()) {
            return Err(refused(format!("the manifest in {name} is of another sweep")));
        }
        let (seen, tables) = (vec![MANIFEST.to_owned()], Vec::new());
        folders.push(Folder { name: name.to_owned(), manifest, seen, spec: None, tables });
        return Ok(());
    }
    let number = at.ok_or_else(|| refused(format!("{name}/{file} comes before its manifest")))?;
    let folder = &mut folders[number];
    if folder.seen.iter().any(|seen| seen == file) {
        return Err(refused(format!("{name}/{file} is there twice")));
    }
    folder.seen.push(file.to_owned());
    if DERIVED.contains(&file) {
        if size > MOST_TEXT && file != DATASET {
            return Err(refused(format!(
                "{file} has {size} bytes, and at most {MOST_TEXT} are read"
            )));
        }
        io::copy(entry, &mut io::sink()).map_err(unreadable)?;
        return Ok(());
    }
    let told = folder.manifest.files.iter().find(|told| told.path == file).cloned();
    let told = told.ok_or_else(|| refused(format!("{name}/{file} is not in its manifest")))?;
    if size != told.bytes {
        let sentence = format!("{name}/{file} has {size} bytes and should have {}", told.bytes);
        return Err(refused(sentence));
    }
    let mut hashed = Hashed::default();
    if file == SPEC {
        let text = text(entry, file, MOST_SPEC)?;
        hashed.write_all(text.as_bytes()).expect("memory takes it");
        folder.spec = Some(text);
    } else {
        let path = into.join(format!("{number}-{file}.tmp"));
        copy(entry, &path, &mut hashed)?;
        folder.tables.push((told.clone(), path));
    }
    if hashed.digests() != (told.blake3, told.sha256) {
        return Err(refused(format!("{name}/{file} has other bytes than its manifest says")));
    }
    Ok(())
}

/// An entry with its size.
trait ReadSized: Read {
    fn size(&self) -> u64;
}

impl<R: Read> ReadSized for tar::Entry<'_, R> {
    fn size(&self) -> u64 {
        tar::Entry::size(self)
    }
}

fn text(entry: &mut impl ReadSized, file: &str, most: u64) -> Result<String, ImportError> {
    let size = entry.size();
    if size > most {
        return Err(refused(format!("{file} has {size} bytes, and at most {most} are read")));
    }
    let mut bytes = Vec::new();
    entry.read_to_end(&mut bytes).map_err(unreadable)?;
    String::from_utf8(bytes).map_err(|_| refused(format!("{file} is no UTF-8")))
}

/// Copies an entry into a file and its bytes through the hashes.
fn copy(entry: &mut impl Read, path: &Path, hashed: &mut Hashed) -> Result<(), ImportError> {
    let mut file = File::create_new(path).map_err(|e| fault(path, "written", e))?;
    let mut buffer = vec![0; 1 << 17];
    loop {
        let n = entry.read(&mut buffer).map_err(unreadable)?;
        if n == 0 {
            break;
        }
        hashed.write_all(&buffer[..n]).expect("memory takes it");
        file.write_all(&buffer[..n]).map_err(|e| fault(path, "written", e))?;
    }
    file.sync_all().map_err(|e| fault(path, "synced", e))?;
    Ok(())
}

/// Both hashes of what is written to it.
#[derive(Default)]
struct Hashed {
    blake3: blake3::Hasher,
    sha256: Sha256,
}

impl Hashed {
    fn digests(self) -> (String, String) {
        (self.blake3.finalize().to_hex().to_string(), files::hex(&self.sha256.finalize()))
    }
}

impl Write for Hashed {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.blake3.update(bytes);
        self.sha256.update(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Folder {
    /// The ensemble, if every file of its manifest has come.
    fn staged(self) -> Result<Staged, ImportError> {
        let Self { name, manifest, seen, spec, tables } = self;
        if let Some(missing) = manifest.files.iter().find(|f| !seen.contains(&f.path)) {
            return Err(refused(format!("{name}/{} is missing", missing.path)));
        }
        let spec = spec.ok_or_else(|| refused(format!("{name}/{SPEC} is missing")))?;
        Ok(Staged { manifest, spec, tables })
    }
}

impl From<ArchiveError> for ImportError {
    fn from(error: ArchiveError) -> Self {
        Self::Archive(error)
    }
}
