//! The data directory: one server at a time, its database and its folders. Holds no query of any room.

use anyhow::{Context, bail};
use sqlx::sqlite::{
    SqliteConnectOptions, SqliteJournalMode, SqlitePool, SqlitePoolOptions, SqliteSynchronous,
};
use sqlx::{Sqlite, Transaction};
use std::fs::{self, File, TryLockError};
use std::io::{Read, Seek, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

/// A connection to the database, of a pool or of a transaction.
pub type Connection = sqlx::SqliteConnection;

/// The data directory, locked for this process.
#[derive(Debug, Clone)]
pub struct Store {
    writer: SqlitePool,
    reader: SqlitePool,
    directory: PathBuf,
    lock: Arc<File>,
}

/// How long a statement waits for the database's lock.
const BUSY: Duration = Duration::from_secs(10);
/// Connections for reading.
const READERS: u32 = 4;

impl Store {
    /// Opens a data directory, making it if there is none, and brings its schema up to date.
    pub async fn open(directory: &Path) -> anyhow::Result<Self> {
        let name = directory.display();
        fs::create_dir_all(directory.join("archive"))
            .with_context(|| format!("cannot make the data directory {name}"))?;
        let lock = lock(directory)?;
        let options = SqliteConnectOptions::new()
            .filename(directory.join("melange.sqlite"))
            .create_if_missing(true)
            .journal_mode(SqliteJournalMode::Wal)
            .synchronous(SqliteSynchronous::Full)
            .foreign_keys(true)
            .busy_timeout(BUSY);
        let writer = SqlitePoolOptions::new()
            .max_connections(1)
            .connect_with(options.clone())
            .await
            .with_context(|| format!("cannot open the database in {name}"))?;
        sqlx::migrate!("../migrations")
            .run(&writer)
            .await
            .with_context(|| format!("cannot bring the database in {name} up to date"))?;
        let reader = SqlitePoolOptions::new()
            .max_connections(READERS)
            .connect_with(options.read_only(true))
            .await
            .with_context(|| format!("cannot open the database in {name} for reading"))?;
        Ok(Self { writer, reader, directory: directory.to_owned(), lock: Arc::new(lock) })
    }

    /// Folder of the Parquet files.
    pub fn archive(&self) -> PathBuf {
        self.directory.join("archive")
    }

    /// Starts a transaction that may write; there is one at a time.
    pub async fn write(&self) -> sqlx::Result<Transaction<'static, Sqlite>> {
        self.writer.begin_with("BEGIN IMMEDIATE").await
    }

    /// Starts a transaction that reads one consistent state.
    pub async fn read(&self) -> sqlx::Result<Transaction<'static, Sqlite>> {
        self.reader.begin().await
    }

    /// Writes into the lock file where this server listens, for whoever finds it locked.
    pub fn announce(&self, address: &str) -> std::io::Result<()> {
        let mut file = &*self.lock;
        file.set_len(0)?;
        file.rewind()?;
        file.write_all(address.as_bytes())
    }

    /// Closes the database after its last transaction.
    pub async fn close(&self) {
        self.reader.close().await;
        self.writer.close().await;
    }
}

fn lock(directory: &Path) -> anyhow::Result<File> {
    let path = directory.join("lock");
    let mut file = File::options()
        .read(true)
        .write(true)
        .create(true)
        .truncate(false)
        .open(&path)
        .with_context(|| format!("cannot write in the data directory {}", directory.display()))?;
    match file.try_lock() {
        Ok(()) => Ok(file),
        Err(TryLockError::WouldBlock) => {
            let mut address = String::new();
            file.read_to_string(&mut address).ok();
            let place = if address.is_empty() { String::new() } else { format!(" at {address}") };
            bail!(
                "the data directory {} is in use by another melange{place}; submit to it over REST, \
                 or choose another --data",
                directory.display()
            )
        }
        Err(TryLockError::Error(e)) => {
            Err(e).with_context(|| format!("cannot lock {}", path.display()))
        }
    }
}
