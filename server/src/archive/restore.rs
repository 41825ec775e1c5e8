//! A data directory made of a backup. Nothing of the backup is believed before the copy of it has been compared
//! with its manifest, its catalogue and its hashes; the backup itself is only read, and not by SQLite.

use super::REPAIR;
use super::backup::{Copied, Manifest};
use super::catalogue::{self, Listed};
use super::files;
use super::verify::{Findings, verify};
use crate::people;
use crate::store::{DATABASE, Holder, Store, archive_of, holder_of};
use anyhow::{Context, bail, ensure};
use std::fs;
use std::io;
use std::path::{Component, Path, PathBuf};

/// What was restored.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Restored {
    /// Files of the archive.
    pub copied: Copied,
    /// When the backup was made, RFC 3339 in UTC.
    pub made_at: String,
}

/// Sentences on damage that are told; more are counted.
const TOLD: usize = 10;

/// Makes the data directory `to`, which must not exist or be empty, of the backup `from`. It is put together under
/// a temporary name and is there as a whole or not at all.
pub async fn restore(from: &Path, to: &Path) -> anyhow::Result<Restored> {
    if holder_of(from) != Holder::Nobody {
        bail!(
            "{} is in use as a data directory: what changes while it is copied is no backup; make one of it with \
             `melange backup`",
            from.display()
        );
    }
    let (backup, target) = (from.to_owned(), to.to_owned());
    let (manifest, staging) = blocking(move || begin(&backup, &target)).await?;
    let staged = staging.path().join("data");
    let (backup, copy) = (from.to_owned(), staged.clone());
    let of_manifest = manifest.clone();
    blocking(move || copy_database(&backup, &copy, &of_manifest)).await?;
    // Refuses the schema of a newer version, and brings an older one up to date: in the copy.
    let store = Store::open_existing(&staged)
        .await
        .with_context(|| format!("the backup {} cannot be restored", from.display()))?;
    let filled = match fill(&store, from).await {
        Ok(filled) => end_sessions(&store).await.map(|()| filled),
        Err(error) => Err(error),
    };
    store.close().await;
    let copied = filled?;
    let (target, made_at) = (to.to_owned(), manifest.made_at);
    blocking(move || publish(&staged, &target))
        .await
        .with_context(|| format!("cannot put the data directory {} in its place", to.display()))?;
    drop(staging);
    Ok(Restored { copied, made_at })
}

/// Browsers that were logged in when the backup was made may have been logged out since.
async fn end_sessions(store: &Store) -> anyhow::Result<()> {
    let mut tx = store.write().await?;
    people::close_all_sessions(&mut tx).await?;
    Ok(tx.commit().await?)
}

async fn blocking<T: Send + 'static>(
    work: impl FnOnce() -> anyhow::Result<T> + Send + 'static,
) -> anyhow::Result<T> {
    tokio::task::spawn_blocking(work).await?
}

/// Checks where the backup comes from and goes to; its manifest, and a folder on the disk of the target that is
/// removed when it is dropped.
fn begin(from: &Path, to: &Path) -> anyhow::Result<(Manifest, tempfile::TempDir)> {
    let manifest = Manifest::read(from)?;
    let is_there = to.exists();
    if is_there {
        /// What the root of a fresh disk has in it.
        const LOST: &str = "lost+found";
        let mut is_empty = to.is_dir();
        for entry in is_empty.then(|| fs::read_dir(to)).transpose()?.into_iter().flatten() {
            is_empty &= entry?.file_name() == LOST;
        }
        ensure!(
            is_empty,
            "{} is not empty: a backup is restored to a folder of its own",
            to.display()
        );
    }
    // Beside a new directory; within one that is there, which may be a disk of its own.
    let place = if is_there { to } else { parent(to) };
    fs::create_dir_all(place).with_context(|| format!("cannot make {}", place.display()))?;
    let staging = tempfile::Builder::new().prefix(".melange-restore-").tempdir_in(place);
    let staging = staging.with_context(|| format!("cannot write in {}", place.display()))?;
    fs::create_dir_all(archive_of(&staging.path().join("data")))?;
    Ok((manifest, staging))
}

fn parent(path: &Path) -> &Path {
    path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Copies the database, which must be the one that was backed up.
fn copy_database(from: &Path, staged: &Path, manifest: &Manifest) -> anyhow::Result<()> {
    let (source, target) = (from.join(DATABASE), staged.join(DATABASE));
    files::copy(&source, &target).with_context(|| format!("cannot copy {}", source.display()))?;
    let (found, _) = files::hash(&target)?;
    ensure!(
        found == manifest.database_blake3,
        "the backup {} is damaged: its database {DATABASE} is not the one that was backed up (if it has been \
         served since, it is a data directory of its own: make a backup of it)",
        from.display()
    );
    Ok(())
}

/// Copies what the catalogue lists, and verifies the whole.
async fn fill(store: &Store, from: &Path) -> anyhow::Result<Copied> {
    let listed = catalogue::all_files(&mut *store.read().await?).await?;
    let (source, target) = (archive_of(from), store.archive());
    blocking(move || copy_files(&source, &target, &listed)).await?;
    let findings = verify(&mut *store.read().await?, &store.archive()).await?;
    let damage = damage(&findings);
    if !damage.is_empty() {
        let more = damage.len().saturating_sub(TOLD);
        let more = if more > 0 { format!("\nand {more} more") } else { String::new() };
        bail!(
            "the backup {} is damaged, and nothing was restored:\n{}{more}",
            from.display(),
            damage[..damage.len().min(TOLD)].join("\n")
        );
    }
    Ok(Copied { files: findings.files, bytes: findings.bytes })
}

/// Copies files; what is missing is left to the verification, which tells all that is wrong.
fn copy_files(from: &Path, to: &Path, listed: &[Listed]) -> anyhow::Result<()> {
    for file in listed {
        let path = Path::new(&file.path);
        let is_below = path.components().all(|part| matches!(part, Component::Normal(_)));
        ensure!(is_below, "the backup is damaged: it lists `{}`, outside its archive", file.path);
        let target = to.join(path);
        fs::create_dir_all(parent(&target))?;
        match files::copy(&from.join(path), &target) {
            Err(e) if e.kind() == io::ErrorKind::NotFound => {}
            copied => copied.with_context(|| format!("cannot copy {}", file.path))?,
        }
    }
    Ok(files::sync_folders(to)?)
}

/// What is wrong, a sentence each. Advice to repair it is for data directories.
fn damage(findings: &Findings) -> Vec<String> {
    let files = findings.damaged.iter().chain(&findings.unreadable);
    let mut damage: Vec<String> = files.map(|(_, sentence)| sentence.replace(REPAIR, "")).collect();
    damage.extend(findings.contradictions.iter().cloned());
    damage
}

/// Gives a verified data directory its name. Where a folder is there already its database comes last: a folder
/// with an archive and no database is not served.
fn publish(staged: &Path, to: &Path) -> anyhow::Result<()> {
    let log = staged.join(format!("{DATABASE}-wal"));
    ensure!(!log.exists(), "its database was not closed");
    files::sync_folder(staged)?;
    if to.is_dir() {
        for path in [archive_of(Path::new("")), PathBuf::from(DATABASE)] {
            fs::rename(staged.join(&path), to.join(&path))?;
            files::sync_folder(to)?;
        }
    } else {
        fs::rename(staged, to)?;
        files::sync_folder(parent(to))?;
    }
    Ok(())
}
