//! Sweeps as one archive: a folder for each, with tables, manifest, citation and what describes it, in a tar
//! compressed by zstd. The same sealed ensemble has the same bytes.

use super::super::catalogue::{Layout, StoredSeal};
use super::super::netcdf::{self, About};
use super::super::schema::Kind;
use super::super::{ArchiveError, bulk, files};
use super::describe::readme;
use super::fault;
use super::identity::Runs;
use super::manifest::{
    FORMAT, FORMAT_VERSION, FileEntry, MANIFEST, Manifest, SPEC, SweepEntry, content_hash, spec,
    table_path,
};
use super::research_object::{ALWAYS_BESIDE, Beside, METADATA, metadata};
use super::seal::spec_entry;
use crate::domain::citation::{CitationFormat, citation};
use std::fs::File;
use std::io::{self, Read, Seek, Write};
use std::path::Path;

/// The citation in its folder.
pub const CITATION: &str = "CITATION.bib";
/// SHA-256 of every file, as `sha256sum -c` reads them.
pub const CHECKSUMS: &str = "checksums.sha256";
/// The dataset for xarray and others, where the sweep is not too large for one.
pub const DATASET: &str = "ensemble.nc";
const DATASET_BESIDE: Beside<'static> = (
    DATASET,
    "application/x-netcdf",
    "runs, profiles and series as one NetCDF-4 dataset with CF metadata",
);
/// Name of a folder before the sweep's id.
pub const FOLDER: &str = "melange-";
/// Tables are compressed already; this is for what is text.
const LEVEL: i32 = 3;

/// A sweep that is to be exported.
#[derive(Debug)]
pub struct Subject {
    /// The sweep.
    pub entry: SweepEntry,
    /// Its document, whole.
    pub document: String,
    /// Where its tables stand; with the runs of every piece if it is not sealed.
    pub layouts: Vec<(Kind, Layout)>,
    /// Its seal.
    pub seal: Option<StoredSeal>,
}

/// Where a file's bytes come from.
#[derive(Debug)]
enum Source {
    Bytes(Vec<u8>),
    File(File),
}

/// A folder that is to be written.
#[derive(Debug)]
pub struct Folder {
    name: String,
    /// Seconds since 1970 that all files have: when the sweep was submitted.
    modified_s: u64,
    files: Vec<(String, u64, Source)>,
}

/// Files beside those of the manifest, as they follow from it.
pub fn beside(manifest: &Manifest) -> Vec<Beside<'static>> {
    let mut beside = ALWAYS_BESIDE.to_vec();
    if manifest.seal.is_some() {
        beside.push((CITATION, "application/x-bibtex", "how to cite the ensemble and the paper"));
    }
    beside
}

impl Folder {
    /// Gathers a sweep's files. A table that stands in one file is that file; others are put together.
    pub fn gather(archive: &Path, subject: Subject) -> Result<Self, ArchiveError> {
        let Subject { entry, document, mut layouts, seal } = subject;
        // A sealed one is called what it was called when it was sealed, wherever it is.
        let called = seal.as_ref().map_or(&entry, |seal| &seal.manifest.sweep);
        let about = About {
            sweep_id: called.id.clone(),
            name: called.name.clone(),
            submitted_at: called.created_at.clone(),
        };
        let dataset = match netcdf::gather(archive, &layouts, &about) {
            Ok(dataset) => Some(dataset),
            // Whoever reads that many runs reads the tables.
            Err(ArchiveError::TooLarge { .. } | ArchiveError::NoRuns) => None,
            Err(error) => return Err(error),
        };
        let runs = Runs::of(&layouts);
        for (_, layout) in layouts.iter_mut().filter(|(kind, _)| *kind != Kind::Runs) {
            runs.keep_first(layout);
        }
        let mut tables: Vec<(String, u64, Source)> = Vec::new();
        let mut entries = Vec::new();
        for (kind, layout) in layouts {
            if layout.groups.is_empty() {
                continue;
            }
            let (file, length, entry) = match layout.as_whole_file().filter(|_| seal.is_some()) {
                Some(listed) => {
                    let file = files::open(archive, listed)?;
                    (file, listed.byte_count as u64, None)
                }
                None => {
                    let (mut file, length) =
                        bulk::gather(archive, &layout, kind, bulk::Format::Parquet)?;
                    let entry =
                        entry_of(&mut file, length, kind).map_err(|e| fault(archive, "read", e))?;
                    if entry.rows == Some(0) {
                        continue;
                    }
                    (file, length, Some(entry))
                }
            };
            tables.push((table_path(kind), length, Source::File(file)));
            entries.extend(entry);
        }
        let (manifest, spec) = match seal {
            Some(stored) => (stored.manifest, stored.spec),
            None => {
                let version = runs.model_version(&document);
                unsealed(entry, &document, version, entries)
            }
        };
        tables.push((SPEC.to_owned(), spec.len() as u64, Source::Bytes(spec.into_bytes())));
        Self::of(&manifest, tables, dataset).map_err(|e| fault(archive, "read", e))
    }

    /// The folder of a manifest, its files, and the dataset that is made of them; what follows from the manifest
    /// is added here.
    fn of(
        manifest: &Manifest,
        mut files: Vec<(String, u64, Source)>,
        dataset: Option<(File, u64)>,
    ) -> io::Result<Self> {
        let mut beside = beside(manifest);
        beside.extend(dataset.iter().map(|_| DATASET_BESIDE));
        let mut texts = vec![
            (MANIFEST, pretty(manifest)),
            (METADATA, pretty(&metadata(manifest, &beside))),
            ("README.md", readme(manifest)),
        ];
        if let Some(seal) = &manifest.seal {
            texts.push((CITATION, citation(seal, CitationFormat::Bibtex)));
        }
        let mut sums: Vec<(String, String)> =
            manifest.files.iter().map(|f| (f.path.clone(), f.sha256.clone())).collect();
        let sum = |text: &str| files::sha256(text.as_bytes()).expect("memory can be read");
        if let Some((mut file, length)) = dataset {
            sums.push((DATASET.to_owned(), files::sha256(&mut file)?));
            file.rewind()?;
            files.push((DATASET.to_owned(), length, Source::File(file)));
        }
        sums.extend(texts.iter().map(|(name, text)| ((*name).to_owned(), sum(text))));
        sums.sort();
        let sums: String = sums.iter().map(|(name, sum)| format!("{sum}  {name}\n")).collect();
        texts.push((CHECKSUMS, sums));
        files.extend(texts.into_iter().map(|(name, text)| {
            (name.to_owned(), text.len() as u64, Source::Bytes(text.into_bytes()))
        }));
        // The manifest goes first: whoever reads the archive then knows what is to come.
        files.sort_by(|(a, _, _), (b, _, _)| (a != MANIFEST, a).cmp(&(b != MANIFEST, b)));
        let created = humantime::parse_rfc3339(&manifest.sweep.created_at).ok();
        let modified = created.and_then(|t| t.duration_since(std::time::UNIX_EPOCH).ok());
        let modified_s = modified.map_or(0, |since| since.as_secs());
        Ok(Self { name: format!("{FOLDER}{}", manifest.sweep.id), modified_s, files })
    }
}

fn pretty(value: &impl serde::Serialize) -> String {
    serde_json::to_string_pretty(value).expect("a document is plain data") + "\n"
}

/// The manifest of a sweep that is not sealed, as it is now.
fn unsealed(
    sweep: SweepEntry,
    document: &str,
    model_version: Option<&str>,
    mut files: Vec<FileEntry>,
) -> (Manifest, String) {
    let spec = spec(document);
    files.push(spec_entry(&spec));
    files.sort_by(|a, b| a.path.cmp(&b.path));
    let manifest = Manifest {
        format: FORMAT.to_owned(),
        format_version: FORMAT_VERSION,
        content_hash: content_hash(model_version, &files),
        model_version: model_version.map(str::to_owned),
        sweep,
        seal: None,
        files,
    };
    (manifest, spec)
}

/// The manifest's entry of a table that was put together.
fn entry_of(file: &mut File, bytes: u64, kind: Kind) -> io::Result<FileEntry> {
    let mut blake3 = blake3::Hasher::new();
    blake3.update_reader(&mut *file)?;
    file.rewind()?;
    let sha256 = files::sha256(&mut *file)?;
    file.rewind()?;
    let rows = bulk::rows_of(file)?;
    file.rewind()?;
    Ok(FileEntry {
        path: table_path(kind),
        bytes,
        blake3: blake3.finalize().to_hex().to_string(),
        sha256,
        rows: Some(rows),
        schema_version: Some(super::super::schema::SCHEMA_VERSION),
    })
}

/// Writes folders into an archive; returns what they were written into.
pub fn write<W: Write>(folders: Vec<Folder>, into: W) -> io::Result<W> {
    let mut compressor = zstd::stream::write::Encoder::new(into, LEVEL)?;
    compressor.include_checksum(true)?;
    let mut tar = tar::Builder::new(compressor);
    for folder in folders {
        for (name, length, source) in folder.files {
            let mut header = tar::Header::new_ustar();
            header.set_size(length);
            header.set_mode(0o644);
            header.set_mtime(folder.modified_s);
            let path = format!("{}/{name}", folder.name);
            match source {
                Source::Bytes(bytes) => tar.append_data(&mut header, path, bytes.as_slice())?,
                // What is longer than was told would shift all that follows.
                Source::File(file) => tar.append_data(&mut header, path, file.take(length))?,
            }
        }
    }
    tar.into_inner()?.finish()
}
