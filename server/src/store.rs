//! The data directory: one server at a time, its database and its folders. Holds no query of any room.

use anyhow::{Context, bail, ensure};
use sqlx::sqlite::{
    SqliteConnectOptions, SqliteJournalMode, SqlitePool, SqlitePoolOptions, SqliteSynchronous,
};
use sqlx::{Sqlite, Transaction, migrate::MigrateError};
use std::fs::{self, File, TryLockError};
use std::io::{Read, Seek, Write as _};
use std::ops::{Deref, DerefMut};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::{
    OwnedRwLockReadGuard, OwnedRwLockWriteGuard, OwnedSemaphorePermit, RwLock, Semaphore, watch,
};

/// A connection to the database, of a pool or of a transaction.
pub type Connection = sqlx::SqliteConnection;

/// The data directory, locked for this process.
#[derive(Debug, Clone)]
pub struct Store {
    writer: SqlitePool,
    reader: SqlitePool,
    directory: PathBuf,
    lock: Arc<File>,
    changes: watch::Sender<u64>,
    revocations: watch::Sender<u64>,
    ends: watch::Sender<u64>,
    files: Arc<RwLock<()>>,
    pairs: Arc<Semaphore>,
    long: Arc<Semaphore>,
}

/// Two transactions that read at the same time, and the turn to have two.
#[derive(Debug)]
pub struct Pair {
    /// One.
    pub one: Transaction<'static, Sqlite>,
    /// The other.
    pub other: Transaction<'static, Sqlite>,
    _turn: OwnedSemaphorePermit,
}

/// How long a statement waits for the database's lock.
const BUSY: Duration = Duration::from_secs(10);
/// Connections for reading.
const READERS: u32 = 8;
/// How many of them may be taken by what reads all runs of a sweep.
const LONG_READS: usize = 3;
/// Pages that a connection keeps in memory, as SQLite counts: minus KiB. The one that writes has indices of
/// random order to keep up; those that read have the system's cache behind them.
const WRITER_CACHE_KIB: &str = "-65536";
/// Pages of 4 KiB in the write-ahead log after which they are copied into the database: rarely enough that
/// pages of indices that every commit touches are copied once for many commits.
const CHECKPOINT_PAGES: &str = "16384";
const READER_CACHE_KIB: &str = "-8192";
/// Rows that a connection's thread reads ahead of who takes them: so that columns of a hundred thousand runs do not
/// have two threads wake each other thousands of times.
const ROWS_AHEAD: usize = 1024;
/// Name of the database in a data directory.
pub const DATABASE: &str = "melange.sqlite";
/// Name of the lock in a data directory.
const LOCK: &str = "lock";
/// Name of the file with the token of commands on the service's machine.
const OPERATOR_TOKEN: &str = "operator-token";
/// What to do about a data directory that cannot be locked.
const LOCAL_DISK: &str = "choose a data directory on a local disk with --data (on a cluster: the node's own \
                          scratch disk), and copy it elsewhere with `melange backup`";

impl Store {
    /// Opens a data directory that is there.
    pub async fn open_existing(directory: &Path) -> anyhow::Result<Self> {
        check_existing(directory)?;
        Self::open(directory).await
    }

    /// Opens a data directory, making it if there is none, and brings its schema up to date.
    pub async fn open(directory: &Path) -> anyhow::Result<Self> {
        let name = directory.display();
        fs::create_dir_all(directory.join("archive"))
            .with_context(|| format!("cannot make the data directory {name}"))?;
        if let Some(kind) = network_filesystem(directory)? {
            bail!(
                "the data directory {name} lies on {kind}, where the locks of a database do not hold; {LOCAL_DISK}"
            );
        }
        let lock = lock(directory)?;
        check_not_bereft(directory)?;
        check_writable(directory)
            .with_context(|| format!("cannot write in the data directory {name}"))?;
        let options = options(directory);
        let writing = options
            .clone()
            .create_if_missing(true)
            .journal_mode(SqliteJournalMode::Wal)
            .pragma("cache_size", WRITER_CACHE_KIB)
            .pragma("wal_autocheckpoint", CHECKPOINT_PAGES)
            // What a statement of many rows would take back if it failed.
            .pragma("temp_store", "MEMORY");
        let writer = SqlitePoolOptions::new()
            .max_connections(1)
            .connect_with(writing)
            .await
            .with_context(|| format!("cannot open the database in {name}"))?;
        sqlx::migrate!("../migrations").run(&writer).await.map_err(|e| match e {
            MigrateError::VersionMissing(version) => anyhow::anyhow!(
                "the database in {name} was made by a newer melange (its schema has step {version}, which \
                 this version does not know): use that version or a later one"
            ),
            e => anyhow::Error::new(e).context(format!("cannot bring the database in {name} up to date")),
        })?;
        let reader = SqlitePoolOptions::new()
            .max_connections(READERS)
            .connect_with(options.read_only(true))
            .await
            .with_context(|| format!("cannot open the database in {name} for reading"))?;
        Ok(Self {
            writer,
            reader,
            directory: directory.to_owned(),
            lock: Arc::new(lock),
            changes: watch::Sender::new(0),
            revocations: watch::Sender::new(0),
            ends: watch::Sender::new(0),
            files: Arc::default(),
            pairs: Arc::new(Semaphore::new(READERS as usize / 2)),
            long: Arc::new(Semaphore::new(LONG_READS)),
        })
    }

    /// Folder of the Parquet files.
    pub fn archive(&self) -> PathBuf {
        archive_of(&self.directory)
    }

    /// Starts a transaction that may write; there is one at a time.
    pub async fn write(&self) -> sqlx::Result<Write> {
        const BEGIN: &str = "BEGIN IMMEDIATE";
        let tx = match self.writer.begin_with(BEGIN).await {
            // A full disk ends a transaction by itself; the connection then still believes to be in it,
            // and is of no use any more.
            Err(sqlx::Error::InvalidSavePointStatement) => {
                self.writer.acquire().await?.close().await?;
                self.writer.begin_with(BEGIN).await?
            }
            begun => begun?,
        };
        Ok(Write { tx, changes: self.changes.clone() })
    }

    /// Starts a transaction that reads one consistent state.
    pub async fn read(&self) -> sqlx::Result<Transaction<'static, Sqlite>> {
        self.reader.begin().await
    }

    /// Starts two transactions that read. Nobody takes a second one by themselves while they hold one: as many
    /// as there are connections, each holding one and waiting for another, would wait for ever.
    pub async fn read_two(&self) -> sqlx::Result<Pair> {
        let turn = self.pairs.clone().acquire_owned().await;
        let _turn = turn.map_err(|_| sqlx::Error::PoolClosed)?;
        Ok(Pair { one: self.read().await?, other: self.read().await?, _turn })
    }

    /// A turn to read very many rows, to be had before the transaction: who waits for one holds no connection, so
    /// that some are left for short requests. Held until what was read is dealt with, it bounds the memory too.
    pub async fn long_read(&self) -> sqlx::Result<OwnedSemaphorePermit> {
        self.long.clone().acquire_owned().await.map_err(|_| sqlx::Error::PoolClosed)
    }

    /// Counts commits, for whoever waits for a change.
    pub fn changes(&self) -> watch::Receiver<u64> {
        self.changes.subscribe()
    }

    /// Counts occasions on which leases were taken from those who hold them.
    pub fn revocations(&self) -> watch::Receiver<u64> {
        self.revocations.subscribe()
    }

    /// Tells all holders of leases to look whether they still hold them.
    pub fn revoke(&self) {
        self.revocations.send_modify(|n| *n += 1);
    }

    /// Counts sweeps whose last chunk was stored, for whoever is not to learn of it late.
    pub fn ends(&self) -> watch::Receiver<u64> {
        self.ends.subscribe()
    }

    /// Tells that the last chunk of a sweep is stored.
    pub fn tell_end(&self) {
        self.ends.send_modify(|n| *n += 1);
    }

    /// Held from listing files until they are read: no listed file is removed meanwhile.
    pub async fn files_in_use(&self) -> OwnedRwLockReadGuard<()> {
        self.files.clone().read_owned().await
    }

    /// Held while files that are no longer listed are removed. Does not wait in line: readers who come while
    /// a long download holds it up would wait behind it.
    pub async fn files_to_remove(&self) -> OwnedRwLockWriteGuard<()> {
        /// Pause between two looks.
        const AGAIN: Duration = Duration::from_millis(50);
        loop {
            if let Ok(alone) = self.files.clone().try_write_owned() {
                return alone;
            }
            tokio::time::sleep(AGAIN).await;
        }
    }

    /// Writes into the lock file where this server listens, for whoever finds it locked.
    pub fn announce(&self, address: &str) -> std::io::Result<()> {
        let mut file = &*self.lock;
        file.set_len(0)?;
        file.rewind()?;
        file.write_all(address.as_bytes())
    }

    /// Leaves a token for commands on this machine, readable by whoever runs the service alone.
    pub fn leave_token(&self, token: &str) -> std::io::Result<()> {
        use std::os::unix::fs::OpenOptionsExt;
        /// For its owner alone.
        const PRIVATE: u32 = 0o600;
        let path = self.directory.join(OPERATOR_TOKEN);
        // An old one may have been made with other permissions.
        fs::remove_file(&path).or_else(|e| match e.kind() {
            std::io::ErrorKind::NotFound => Ok(()),
            _ => Err(e),
        })?;
        let mut file = File::options().write(true).create_new(true).mode(PRIVATE).open(path)?;
        file.write_all(token.as_bytes())
    }

    /// The disk that the data directory lies on.
    pub fn disk(&self) -> std::io::Result<Disk> {
        let told = rustix::fs::statvfs(&self.directory)?;
        let bytes = |blocks: u64| blocks.saturating_mul(told.f_frsize);
        Ok(Disk { free_bytes: bytes(told.f_bavail), size_bytes: bytes(told.f_blocks) })
    }

    /// Bytes of the database with its log.
    pub fn database_bytes(&self) -> u64 {
        let files = [DATABASE.to_owned(), format!("{DATABASE}-wal")];
        let found = files.iter().filter_map(|name| fs::metadata(self.directory.join(name)).ok());
        found.map(|file| file.len()).sum()
    }

    /// Closes the database after its last transaction.
    pub async fn close(&self) {
        self.reader.close().await;
        self.writer.close().await;
    }
}

/// A disk.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Disk {
    /// What this process may still write, bytes.
    pub free_bytes: u64,
    /// Its size, bytes.
    pub size_bytes: u64,
}

/// A transaction that may write. What waits for changes is told when it is committed.
#[derive(Debug)]
pub struct Write {
    tx: Transaction<'static, Sqlite>,
    changes: watch::Sender<u64>,
}

impl Write {
    /// Makes what was written durable and seen.
    pub async fn commit(self) -> sqlx::Result<()> {
        self.tx.commit().await?;
        self.changes.send_modify(|n| *n += 1);
        Ok(())
    }
}

impl Deref for Write {
    type Target = Connection;

    fn deref(&self) -> &Connection {
        &self.tx
    }
}

impl DerefMut for Write {
    fn deref_mut(&mut self) -> &mut Connection {
        &mut self.tx
    }
}

/// A data directory that is only read, without its lock: also while a server uses it.
#[derive(Debug)]
pub struct Onlooker {
    pool: SqlitePool,
    directory: PathBuf,
}

impl Onlooker {
    /// Opens the database of a data directory for reading.
    pub async fn open(directory: &Path) -> anyhow::Result<Self> {
        let name = directory.display();
        check_existing(directory)?;
        let pool = SqlitePoolOptions::new()
            .max_connections(1)
            .connect_with(options(directory).read_only(true))
            .await
            .with_context(|| format!("cannot open the database in {name} for reading"))?;
        Ok(Self { pool, directory: directory.to_owned() })
    }

    /// Starts a transaction that reads one consistent state.
    pub async fn read(&self) -> sqlx::Result<Transaction<'static, Sqlite>> {
        self.pool.begin().await
    }

    /// Folder of the Parquet files.
    pub fn archive(&self) -> PathBuf {
        archive_of(&self.directory)
    }

    /// A connection outside any transaction.
    pub async fn connection(&self) -> sqlx::Result<sqlx::pool::PoolConnection<Sqlite>> {
        self.pool.acquire().await
    }
}

/// Folder of the Parquet files of a data directory.
pub fn archive_of(directory: &Path) -> PathBuf {
    directory.join("archive")
}

/// Who holds a data directory.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Holder {
    /// Nobody.
    Nobody,
    /// A command that answers no requests.
    Command,
    /// A service at an address.
    Service(String),
}

/// Who holds a data directory.
pub fn holder_of(directory: &Path) -> Holder {
    let Ok(mut file) = File::open(directory.join(LOCK)) else { return Holder::Nobody };
    match file.try_lock_shared() {
        Err(TryLockError::WouldBlock) => {
            let mut address = String::new();
            match file.read_to_string(&mut address) {
                Ok(n) if n > 0 => Holder::Service(address),
                _ => Holder::Command,
            }
        }
        _ => Holder::Nobody,
    }
}

/// The token that the service of a data directory leaves for commands; none if it may not be read.
pub fn operator_token(directory: &Path) -> Option<String> {
    fs::read_to_string(directory.join(OPERATOR_TOKEN)).ok()
}

fn check_existing(directory: &Path) -> anyhow::Result<()> {
    let name = directory.display();
    ensure!(
        directory.join(DATABASE).is_file(),
        "there is no data directory {name}: it would hold the file {DATABASE}"
    );
    Ok(())
}

/// An archive without its database is not an empty data directory: its files would all be listed by nobody,
/// and cleared away.
fn check_not_bereft(directory: &Path) -> anyhow::Result<()> {
    let is_there = fs::metadata(directory.join(DATABASE)).is_ok_and(|database| database.len() > 0);
    if is_there {
        return Ok(());
    }
    for sweep in fs::read_dir(archive_of(directory))? {
        let path = sweep?.path();
        if path.is_dir() && fs::read_dir(&path)?.next().is_some() {
            bail!(
                "the data directory {} has files of runs but not their database {DATABASE}: put it back, from \
                 a backup if need be, or move the folder `archive` away",
                directory.display()
            );
        }
    }
    Ok(())
}

fn options(directory: &Path) -> SqliteConnectOptions {
    SqliteConnectOptions::new()
        .filename(directory.join(DATABASE))
        .synchronous(SqliteSynchronous::Full)
        .foreign_keys(true)
        .busy_timeout(BUSY)
        .row_buffer_size(ROWS_AHEAD)
        .pragma("cache_size", READER_CACHE_KIB)
}

fn lock(directory: &Path) -> anyhow::Result<File> {
    let path = directory.join(LOCK);
    let mut file = File::options()
        .read(true)
        .write(true)
        .create(true)
        .truncate(false)
        .open(&path)
        .with_context(|| format!("cannot write in the data directory {}", directory.display()))?;
    /// Whoever looks who holds the directory holds it for a moment.
    const LOOKS: usize = 10;
    const BETWEEN: Duration = Duration::from_millis(20);
    let mut locked = file.try_lock();
    for _ in 0..LOOKS {
        if !matches!(locked, Err(TryLockError::WouldBlock)) {
            break;
        }
        std::thread::sleep(BETWEEN);
        locked = file.try_lock();
    }
    match locked {
        Ok(()) => {
            // The address of a service that is gone.
            file.set_len(0).with_context(|| format!("cannot write {}", path.display()))?;
            Ok(file)
        }
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
            Err(e).with_context(|| format!("cannot lock {}; {LOCAL_DISK}", path.display()))
        }
    }
}

/// A directory that is full or read-only is found out at the start, not at the first result.
fn check_writable(directory: &Path) -> std::io::Result<()> {
    let mut file = tempfile::tempfile_in(directory)?;
    file.write_all(&[0; 4096])?;
    file.sync_all()
}

/// The name of the network filesystem a path lies on; none if it is on a disk of this machine.
fn network_filesystem(path: &Path) -> anyhow::Result<Option<&'static str>> {
    let told = rustix::fs::statfs(path)
        .with_context(|| format!("cannot tell the filesystem of {}", path.display()))?;
    Ok(network_name(told.f_type as u32))
}

/// Magic numbers of statfs(2) of filesystems that several machines share.
fn network_name(magic: u32) -> Option<&'static str> {
    Some(match magic {
        0x6969 => "NFS",
        0x517B | 0xFE53_4D42 | 0xFF53_4D42 => "SMB/CIFS",
        0x0BD0_0BD0 => "Lustre",
        0x4750_4653 => "GPFS",
        0x1983_0326 => "BeeGFS",
        0x00C3_6400 => "Ceph",
        0x5346_414F | 0x6B41_4653 => "AFS",
        0x0102_1997 => "a 9P share",
        0x0116_1970 => "GFS2",
        0x7461_636F => "OCFS2",
        0xAAD7_AAEA => "Panasas",
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn filesystems_of_networks_are_known_and_disks_are_none() {
        assert_eq!(network_name(0x6969), Some("NFS"));
        assert_eq!(network_name(0x0BD0_0BD0), Some("Lustre"));
        // ext4, xfs, btrfs, tmpfs, overlayfs
        for disk in [0xEF53, 0x5846_5342, 0x9123_683E, 0x0102_1994, 0x794C_7630] {
            assert_eq!(network_name(disk), None);
        }
        assert_eq!(network_filesystem(&std::env::temp_dir()).ok(), Some(None));
    }
}
