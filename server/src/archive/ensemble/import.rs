//! An ensemble from elsewhere becomes one of this archive's: compared with what is here, its files renamed, its
//! runs listed within the caller's transaction.

use super::super::catalogue::{self, Known};
use super::super::files::{self, Written};
use super::super::schema::Kind;
use super::super::{ArchiveError, SolvedRun};
use super::check::{Checked, check};
use super::table::{Table, solved};
use super::unpack::{self, unpack};
use super::{ImportError, fault, refused};
use crate::domain::outcome::SCALARS;
use crate::domain::sweep::Limits;
use crate::store::Connection;
use serde::Serialize;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tempfile::TempDir;
use tokio::sync::mpsc;
use utoipa::ToSchema;
use uuid::Uuid;

/// Ensembles that were checked, in a folder that goes with them.
#[derive(Debug)]
pub struct Arrivals {
    /// The ensembles.
    pub ensembles: Vec<Arc<Checked>>,
    folder: TempDir,
}

/// Unpacks and checks an archive in a folder of its own. If the process dies, the next start clears it away, as
/// files that nobody lists.
pub fn receive(
    archive: &Path,
    file: File,
    unpacked: unpack::Limits,
    limits: &Limits,
) -> Result<Arrivals, ImportError> {
    let folder = tempfile::Builder::new().prefix(files::IMPORT).tempdir_in(archive);
    let folder = folder.map_err(|e| fault(archive, "written", e))?;
    let bytes = unpacked.bytes.min(free(archive).map_err(|e| fault(archive, "looked at", e))? / 2);
    let staged = unpack(file, folder.path(), unpack::Limits { bytes })?;
    for (i, one) in staged.iter().enumerate() {
        let hash = &one.manifest.content_hash;
        if staged[..i].iter().any(|other| other.manifest.content_hash == *hash) {
            return Err(refused(format!("the ensemble {hash} is there twice")));
        }
    }
    let checked = staged.into_iter().map(|one| check(one, limits).map(Arc::new));
    Ok(Arrivals { ensembles: checked.collect::<Result<_, _>>()?, folder })
}

/// Bytes that are free on a folder's disk, of which an import takes no more than half: others write there too.
fn free(folder: &Path) -> std::io::Result<u64> {
    let told = rustix::fs::statvfs(folder)?;
    Ok(told.f_bavail.saturating_mul(told.f_frsize))
}

impl Arrivals {
    /// Removes what was staged; what was taken has left it already.
    pub fn close(self) {
        drop(self.ensembles);
        if let Err(e) = self.folder.close() {
            tracing::warn!("cannot remove the folder of an import: {e}");
        }
    }
}

/// How the runs of an ensemble stand to those that are here.
#[derive(Debug, Clone, Default, PartialEq, Serialize, ToSchema)]
pub struct Comparison {
    /// Runs that are here with the same numbers, bit for bit.
    pub identical: usize,
    /// Runs that are here with numbers that differ by no more than their rounding.
    pub close: usize,
    /// Runs that are here with other numbers.
    pub conflicts: usize,
    /// The first of those.
    pub named: Vec<Conflict>,
}

/// A run with other numbers than here.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Conflict {
    /// The run.
    pub run_id: String,
    /// Where they differ.
    pub column: String,
    /// What is here.
    pub here: serde_json::Value,
    /// What came.
    pub there: serde_json::Value,
}

/// Conflicts that are named.
const MOST_NAMED: usize = 20;
/// Relative difference of two solutions of one run: what rounding does to the shortest mélanges. The same code
/// on another way differs by 1e-10; other code by far more.
const ROUNDING: f64 = 1e-7;
/// Numbers that are rounding themselves.
const NOISE: [&str; 5] = [
    "residual_norm",
    "mass_budget_defect",
    "grid_error_length_m",
    "grid_error_thickness_0_m",
    "grid_error_force_n_per_m",
];

/// How two results of a run differ: not at all, by rounding (nothing told), or in a column.
enum Difference {
    None,
    Rounding,
    Column(&'static str, serde_json::Value, serde_json::Value),
}

fn difference(here: &Known, there: &SolvedRun) -> Difference {
    let status = there.outcome.status.name();
    if here.status != status {
        return Difference::Column("status", here.status.clone().into(), status.into());
    }
    let mut worst = Difference::None;
    for s in SCALARS {
        let (a, b) = ((s.get)(&here.scalars), (s.get)(&there.outcome.scalars));
        if a.map(f64::to_bits) == b.map(f64::to_bits) {
            continue;
        }
        let is_close = match (a, b) {
            (Some(a), Some(b)) => (a - b).abs() <= ROUNDING * a.abs().max(b.abs()),
            _ => false,
        };
        if !is_close && !NOISE.contains(&s.name) {
            return Difference::Column(s.name, a.into(), b.into());
        }
        worst = Difference::Rounding;
    }
    worst
}

/// Compares an ensemble's runs with those that are here. Failures are no results, and compared with nothing.
pub async fn compare(
    connection: &mut Connection,
    ensemble: &Arc<Checked>,
) -> Result<Comparison, ImportError> {
    let mut told = Comparison::default();
    let mut batches = read(ensemble.clone(), None);
    while let Some(batch) = batches.recv().await {
        let runs = batch?;
        let ids: Vec<&str> = runs.iter().map(|run| run.run_id.as_str()).collect();
        let known = catalogue::known_results(connection, &ids).await;
        let known = known.map_err(ArchiveError::from)?;
        for run in runs.iter().filter(|run| run.outcome.status.name() != "failed") {
            let mut here = known.iter().filter(|known| known.run_id == run.run_id).peekable();
            if here.peek().is_none() {
                continue;
            }
            let differences: Vec<Difference> = here.map(|known| difference(known, run)).collect();
            let conflict = differences.iter().find_map(|d| match d {
                Difference::Column(column, here, there) => Some((*column, here, there)),
                _ => None,
            });
            if differences.iter().any(|d| matches!(d, Difference::None)) {
                told.identical += 1;
            } else if let Some((column, here, there)) = conflict {
                told.conflicts += 1;
                if told.named.len() < MOST_NAMED {
                    let (here, there) = (here.clone(), there.clone());
                    let run_id = run.run_id.clone();
                    told.named.push(Conflict { run_id, column: column.to_owned(), here, there });
                }
            } else {
                told.close += 1;
            }
        }
    }
    Ok(told)
}

/// Reads an ensemble's runs, stretch by stretch, beside the async threads; from where the table is now, if it has
/// been moved.
fn read(
    ensemble: Arc<Checked>,
    moved_to: Option<PathBuf>,
) -> mpsc::Receiver<Result<Vec<SolvedRun>, ImportError>> {
    let (send, receive) = mpsc::channel(2);
    tokio::task::spawn_blocking(move || {
        let outcome = each_stretch(&ensemble, moved_to.as_deref(), &mut |runs| {
            send.blocking_send(Ok(runs)).is_ok()
        });
        if let Err(why) = outcome {
            // Whoever does not listen any more has met an error of their own.
            send.blocking_send(Err(refused(format!("runs.parquet: {why}")))).ok();
        }
    });
    receive
}

fn each_stretch(
    ensemble: &Checked,
    moved_to: Option<&Path>,
    take: &mut dyn FnMut(Vec<SolvedRun>) -> bool,
) -> Result<(), String> {
    let Some(table) = ensemble.tables.iter().find(|table| table.kind == Kind::Runs) else {
        return Ok(());
    };
    let mut ends = ensemble.stretches.iter().map(|s| s.end);
    let mut end = ends.next().unwrap_or_default();
    let mut runs = Vec::new();
    let indices = ensemble.runs.ids.iter().map(|(index, _)| *index);
    let mut indices = indices.peekable();
    for batch in Table::open(moved_to.unwrap_or(&table.path), Kind::Runs, &table.entry)? {
        let batch = batch?;
        for row in 0..batch.num_rows() {
            let index = indices.next().ok_or("it has changed")?;
            if index >= end {
                if !take(std::mem::take(&mut runs)) {
                    return Ok(());
                }
                end = ends.next().ok_or("it has changed")?;
            }
            let spec = ensemble.sweep.run(index as usize);
            runs.push(solved(&batch, row, &spec, &ensemble.model_version)?);
        }
    }
    if !runs.is_empty() {
        take(runs);
    }
    Ok(())
}

/// Moves an ensemble's files into the archive, listed by nobody yet.
pub fn place(archive: &Path, id: &str, ensemble: &Checked) -> Result<Vec<Written>, ArchiveError> {
    let token = Uuid::now_v7().simple().to_string();
    let folder = files::make_folder(archive, id)?;
    let mut placed = Vec::with_capacity(ensemble.tables.len());
    for table in &ensemble.tables {
        let path = files::path_of(id, "imported", &token, table.kind);
        let target: PathBuf = archive.join(&path);
        if let Err(e) = fs::rename(&table.path, &target) {
            files::remove(archive, placed.iter().map(|w: &Written| w.path.as_str()));
            return Err(fault(&target, "renamed", e));
        }
        placed.push(Written {
            path,
            kind: table.kind,
            blake3: table.entry.blake3.clone(),
            rows: table.entry.rows.unwrap_or_default() as i64,
            bytes: table.entry.bytes as i64,
            schema_version: table.entry.schema_version.unwrap_or_default(),
        });
    }
    File::open(&folder).and_then(|f| f.sync_all()).map_err(|e| fault(&folder, "synced", e))?;
    Ok(placed)
}

/// Lists an ensemble's files and runs as a sweep's, within the caller's transaction; sealed if it was.
pub async fn list(
    connection: &mut Connection,
    archive: &Path,
    sweep: i64,
    ensemble: &Arc<Checked>,
    placed: &[Written],
) -> Result<(), ImportError> {
    let axes = ensemble.sweep.varied();
    let runs = placed.iter().find(|written| written.kind == Kind::Runs);
    let mut batches = read(ensemble.clone(), runs.map(|written| archive.join(&written.path)));
    let mut chunk = 0;
    while let Some(batch) = batches.recv().await {
        let added = catalogue::insert(connection, sweep, chunk, &axes, &[], &batch?).await;
        added.map_err(ArchiveError::from)?;
        chunk += 1;
    }
    let listed = async {
        catalogue::send_home(connection, sweep, &ensemble.runs.again).await?;
        for (written, table) in placed.iter().zip(&ensemble.tables) {
            catalogue::insert_file(connection, written).await?;
            for (chunk, (first_row, rows)) in (0..).zip(&table.rows).filter(|(_, (_, n))| *n > 0) {
                catalogue::place_in(connection, sweep, chunk, written, *first_row, *rows).await?;
            }
        }
        let manifest = &ensemble.staged.manifest;
        if manifest.seal.is_some() {
            let files: Vec<&Written> = placed.iter().collect();
            let spec = &ensemble.staged.spec;
            catalogue::insert_seal(connection, sweep, manifest, spec, &files).await?;
        }
        Ok(())
    };
    listed.await.map_err(|e: sqlx::Error| ArchiveError::from(e).into())
}
