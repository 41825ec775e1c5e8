//! A copy of a data directory, also of one that is in use: a consistent copy of the database, then the
//! files it lists.

use super::catalogue::{self, Listed};
use super::files;
use crate::store::{DATABASE, Onlooker, archive_of};
use anyhow::{Context, bail, ensure};
use serde::{Deserialize, Serialize};
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::Path;
use std::time::SystemTime;

/// What was copied.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize)]
pub struct Copied {
    /// Files.
    pub files: usize,
    /// Bytes of them.
    pub bytes: i64,
}

/// What a backup says of itself. It is written last: a folder without it is a backup that broke off.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Manifest {
    /// Version of melange that made it.
    pub melange: String,
    /// When, RFC 3339 in UTC.
    pub made_at: String,
    /// Hash of the database.
    pub database_blake3: String,
    /// Files of the archive, which the database lists with their hashes.
    pub files: usize,
    /// Bytes of them.
    pub bytes: i64,
}

impl Manifest {
    /// Name of its file in a backup.
    const NAME: &str = "backup.json";

    /// That of a backup.
    pub fn read(backup: &Path) -> anyhow::Result<Self> {
        let name = backup.display();
        ensure!(backup.is_dir(), "there is no folder {name}");
        let text = match fs::read(backup.join(Self::NAME)) {
            Err(e) if e.kind() == io::ErrorKind::NotFound => bail!(
                "{name} is no whole backup: the file {}, which `melange backup` writes last, is not there; if it is \
                 a data directory, make a backup of it",
                Self::NAME
            ),
            read => read.with_context(|| format!("cannot read {} in {name}", Self::NAME))?,
        };
        serde_json::from_slice(&text)
            .with_context(|| format!("the backup {name} is damaged: {}", Self::NAME))
    }

    /// Writes that of a backup whose files are all there.
    fn write(backup: &Path, copied: Copied) -> io::Result<()> {
        let (database_blake3, _) = files::hash(&backup.join(DATABASE))?;
        let manifest = Self {
            melange: env!("CARGO_PKG_VERSION").into(),
            made_at: humantime::format_rfc3339_seconds(SystemTime::now()).to_string(),
            database_blake3,
            files: copied.files,
            bytes: copied.bytes,
        };
        let mut text = serde_json::to_vec_pretty(&manifest)?;
        text.push(b'\n');
        File::open(backup.join(DATABASE))?.sync_all()?;
        files::sync_folders(&archive_of(backup))?;
        let temporary = backup.join(format!("{}.tmp", Self::NAME));
        let mut file = File::create(&temporary)?;
        file.write_all(&text)?;
        file.sync_all()?;
        fs::rename(&temporary, backup.join(Self::NAME))?;
        files::sync_folder(backup)
    }
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
            Ok(copied) => {
                drop(copy);
                let folder = to.to_owned();
                tokio::task::spawn_blocking(move || Manifest::write(&folder, copied))
                    .await?
                    .context("cannot write what the backup says of itself")?;
                return Ok(copied);
            }
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
            files::copy(&from.join(&file.path), &target)?;
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
