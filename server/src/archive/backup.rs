//! A copy of a data directory, also of one that is in use: a consistent copy of the database, then the
//! files it lists.

use super::catalogue::{self, Listed};
use super::files;
use crate::store::{DATABASE, Onlooker, archive_of};
use anyhow::{Context, ensure};
use std::fs;
use std::io;
use std::path::Path;

/// What was copied.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize)]
pub struct Copied {
    /// Files.
    pub files: usize,
    /// Bytes of them.
    pub bytes: i64,
}

/// Copies of the database that are tried: files may be put together or deleted while they are copied.
const TRIES: usize = 5;

/// Copies a data directory to a folder that does not exist or is empty. Every file is compared with its hash.
pub async fn backup(from: &Path, to: &Path) -> anyhow::Result<Copied> {
    let onlooker = Onlooker::open(from).await?;
    fs::create_dir_all(to).with_context(|| format!("cannot make {}", to.display()))?;
    let is_empty = fs::read_dir(to)?.next().is_none();
    ensure!(is_empty, "{} is not empty: a backup needs a folder of its own", to.display());
    for left in (0..TRIES).rev() {
        let target = to.join(DATABASE);
        if target.exists() {
            fs::remove_file(&target)?;
        }
        let path = target.to_str().context("the path of the backup is not UTF-8")?;
        let mut connection = onlooker.connection().await?;
        catalogue::copy_database(&mut connection, path)
            .await
            .with_context(|| format!("cannot copy the database to {path}"))?;
        drop(connection);
        let copy = Onlooker::open(to).await?;
        let listed = catalogue::all_files(&mut *copy.read().await?).await?;
        let (source, copied_to) = (onlooker.archive(), archive_of(to));
        let copied =
            tokio::task::spawn_blocking(move || copy_files(&source, &copied_to, &listed)).await?;
        match copied {
            Ok(copied) => return Ok(copied),
            Err(e) if left > 0 && e.kind() == io::ErrorKind::NotFound => {
                tracing::info!("files have moved while they were copied; looking again");
            }
            Err(e) => return Err(e).context("cannot copy the archive's files"),
        }
    }
    unreachable!("the last try returns")
}

/// Copies what is not there yet, and removes what is not listed.
fn copy_files(from: &Path, to: &Path, listed: &[Listed]) -> io::Result<Copied> {
    fs::create_dir_all(to)?;
    let mut copied = Copied::default();
    for file in listed {
        let target = to.join(&file.path);
        if let Some(folder) = target.parent() {
            fs::create_dir_all(folder)?;
        }
        if !target.exists() {
            fs::copy(from.join(&file.path), &target)?;
        }
        files::check(to, file).map_err(io::Error::other)?;
        copied.files += 1;
        copied.bytes += file.byte_count;
    }
    let names = listed.iter().map(|file| file.path.clone()).collect();
    for orphan in files::orphans(to, &names)? {
        fs::remove_file(to.join(orphan))?;
    }
    Ok(copied)
}
