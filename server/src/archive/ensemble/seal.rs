//! Sealing: all tables of a sweep are written into files of its own, in one canonical form, and hashed. From
//! then on the sweep needs no other one's files, and its files are what is exported, byte for byte.

use super::super::ArchiveError;
use super::super::bulk::{Table, damaged, merged};
use super::super::catalogue::{self, Home, Layout, SealedTables, Stretch};
use super::super::files::{self, Written};
use super::super::schema::Kind;
use super::fault;
use super::identity::Runs;
use super::manifest::{
    FORMAT, FORMAT_VERSION, FileEntry, Manifest, SPEC, SweepEntry, content_hash, spec, table_path,
};
use crate::domain::seal::{Seal, SealForm};
use crate::store::{Connection, Store};
use arrow_select::coalesce::BatchCoalescer;
use std::fs::File;
use std::path::Path;
use uuid::Uuid;

/// Rows handed to the writer at once: with more or fewer the same table would have other bytes.
const ROWS_AT_ONCE: usize = 1_024;

/// A sweep that is to be sealed.
#[derive(Debug, Clone)]
pub struct Subject {
    /// Its number.
    pub sweep: i64,
    /// Its id.
    pub id: String,
    /// Its document, whole.
    pub document: String,
}

/// A sweep's tables as they are sealed, before anything says so.
#[derive(Debug)]
pub struct Prepared {
    subject: Subject,
    homes: Vec<Home>,
    stretches: Vec<Stretch>,
    /// Runs that stand in the sweep before, and where.
    again: Vec<(i64, i64)>,
    tables: Vec<SealedTables>,
    entries: Vec<FileEntry>,
    model_version: Option<String>,
    spec: String,
    content_hash: String,
}

/// What is read of the catalogue before the tables are written.
struct Plan {
    homes: Vec<Home>,
    starts: Vec<i64>,
    layouts: Vec<(Kind, Layout)>,
}

/// Writes all tables of a sweep that has ended; they are listed by nobody until [`Prepared::commit`].
pub async fn prepare(store: &Store, subject: Subject) -> Result<Prepared, ArchiveError> {
    let in_use = store.files_in_use().await;
    let mut tx = store.read().await?;
    let mut layouts = Vec::with_capacity(Kind::ALL.len());
    for kind in Kind::ALL {
        layouts.push((kind, catalogue::layout_by_run(&mut tx, subject.sweep, kind).await?));
    }
    let homes = catalogue::homes_of(&mut tx, subject.sweep).await?;
    let starts = catalogue::starts_of(&mut tx, subject.sweep).await?;
    drop(tx);
    let archive = store.archive();
    tokio::task::spawn_blocking(move || {
        let _in_use = in_use;
        write(&archive, subject, Plan { homes, starts, layouts })
    })
    .await?
}

fn write(archive: &Path, subject: Subject, plan: Plan) -> Result<Prepared, ArchiveError> {
    let Plan { homes, starts, mut layouts } = plan;
    let runs = Runs::of(&layouts);
    let count = runs.ids.len() as i64;
    let ends = starts.iter().skip(1).copied().chain([count]);
    let stretches: Vec<Stretch> =
        starts.iter().copied().zip(ends).map(|(first, end)| Stretch { first, end }).collect();
    files::make_folder(archive, &subject.id)?;
    let token = Uuid::now_v7().simple().to_string();
    let mut tables: Vec<SealedTables> = Vec::new();
    for (kind, layout) in &mut layouts {
        if *kind != Kind::Runs {
            runs.keep_first(layout);
        }
        let path = files::path_of(&subject.id, "sealed", &token, *kind);
        match table(archive, &path, *kind, layout, &stretches) {
            Ok(Some(written)) => tables.push(written),
            Ok(None) => {}
            Err(error) => {
                files::remove(archive, tables.iter().map(|t| t.written.path.as_str()));
                return Err(error);
            }
        }
    }
    let spec = spec(&subject.document);
    let model_version = runs.model_version(&subject.document).map(str::to_owned);
    let mut entries: Vec<FileEntry> = tables.iter().map(|t| entry(&t.written, &t.sha256)).collect();
    entries.push(spec_entry(&spec));
    let content_hash = content_hash(model_version.as_deref(), &entries);
    let again = runs.again;
    Ok(Prepared {
        subject,
        homes,
        stretches,
        again,
        tables,
        entries,
        model_version,
        spec,
        content_hash,
    })
}

/// Writes one table in the order of the runs; none if it has no rows.
fn table(
    archive: &Path,
    path: &str,
    kind: Kind,
    layout: &Layout,
    stretches: &[Stretch],
) -> Result<Option<SealedTables>, ArchiveError> {
    if layout.groups.is_empty() {
        return Ok(None);
    }
    let mut counts = vec![0_i64; stretches.len()];
    let written = files::write_file(archive, path, kind, |file| {
        let mut table = Table::new(file, kind)?;
        let mut coalescer = BatchCoalescer::new(kind.schema(), ROWS_AT_ONCE);
        let mut rows = 0;
        for group in &layout.groups {
            let (batch, indices) = merged(archive, group, kind)?;
            for index in indices {
                let stretch = stretches.partition_point(|s| s.end <= index);
                counts[stretch] += 1;
                rows += 1;
            }
            coalescer.push_batch(batch).map_err(|e| damaged(kind, e))?;
            while let Some(batch) = coalescer.next_completed_batch() {
                table.write(&batch)?;
            }
        }
        coalescer.finish_buffered_batch().map_err(|e| damaged(kind, e))?;
        while let Some(batch) = coalescer.next_completed_batch() {
            table.write(&batch)?;
        }
        table.close()?;
        Ok(rows)
    })?;
    if written.rows == 0 {
        files::remove(archive, [path].into_iter());
        return Ok(None);
    }
    let target = archive.join(path);
    let sha256 = File::open(&target).and_then(files::sha256);
    let sha256 = sha256.map_err(|e| fault(&target, "read", e))?;
    let mut first_row = 0;
    let place = |count: i64| {
        first_row += count;
        (first_row - count, count)
    };
    Ok(Some(SealedTables { written, sha256, rows: counts.into_iter().map(place).collect() }))
}

/// The manifest's entry of a table.
pub fn entry(written: &Written, sha256: &str) -> FileEntry {
    FileEntry {
        path: table_path(written.kind),
        bytes: written.bytes as u64,
        blake3: written.blake3.clone(),
        sha256: sha256.to_owned(),
        rows: Some(written.rows as u64),
        schema_version: Some(written.schema_version),
    }
}

/// The manifest's entry of what was solved.
pub fn spec_entry(spec: &str) -> FileEntry {
    FileEntry {
        path: SPEC.to_owned(),
        bytes: spec.len() as u64,
        blake3: blake3::hash(spec.as_bytes()).to_hex().to_string(),
        sha256: files::sha256(spec.as_bytes()).expect("memory can be read"),
        rows: None,
        schema_version: None,
    }
}

impl Prepared {
    /// The files written so far.
    pub fn paths(&self) -> Vec<String> {
        self.tables.iter().map(|table| table.written.path.clone()).collect()
    }

    /// Seals the sweep, within the caller's transaction; the seal and the paths of files that nobody uses any
    /// more, or none if the sweep has changed since its tables were written.
    pub async fn commit(
        &self,
        connection: &mut Connection,
        sweep: SweepEntry,
        form: SealForm,
        sealed_by: &str,
    ) -> sqlx::Result<Option<(Seal, Vec<String>)>> {
        let number = self.subject.sweep;
        if catalogue::homes_of(connection, number).await? != self.homes {
            return Ok(None);
        }
        let now = std::time::SystemTime::now();
        let seal = Seal {
            sealed_at: humantime::format_rfc3339_millis(now).to_string(),
            sealed_by: sealed_by.to_owned(),
            content_hash: self.content_hash.clone(),
            melange_version: env!("CARGO_PKG_VERSION").to_owned(),
            form,
        };
        let mut files = self.entries.clone();
        files.sort_by(|a, b| a.path.cmp(&b.path));
        let manifest = Manifest {
            format: FORMAT.to_owned(),
            format_version: FORMAT_VERSION,
            content_hash: self.content_hash.clone(),
            model_version: self.model_version.clone(),
            sweep,
            seal: Some(seal.clone()),
            files,
        };
        let Self { stretches, again, tables, spec, .. } = self;
        let unused = catalogue::gather_in(connection, number, stretches, again, tables).await?;
        let files: Vec<&Written> = tables.iter().map(|table| &table.written).collect();
        catalogue::insert_seal(connection, number, &manifest, spec, &files).await?;
        Ok(Some((seal, unused)))
    }
}
