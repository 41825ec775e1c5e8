//! Solves stored runs again from what is stored of them, and compares. Writes nothing, and knows no lease.

mod repeat;

use super::solve::StoredStart;
use super::{NICENESS, stored_start};
use crate::archive::catalogue::{self, Address, Entry, Place};
use crate::archive::likeness::Difference;
use crate::archive::recall::Recalled;
use crate::archive::schema::Kind;
use crate::archive::{ArchiveError, read};
use crate::domain::document::Document;
use crate::domain::start::Start;
use crate::queue;
use crate::store::{Connection, Onlooker};
use anyhow::{Context, bail};
use serde::Serialize;
use std::collections::{HashMap, HashSet};
use std::sync::Arc;
use tokio::sync::{Mutex, oneshot};
use tokio::task::JoinSet;

/// What came of a comparison.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Every stored number and word is what comes out now, bit by bit.
    Bitwise,
    /// Solved by another build, on another class of host or from another start, it agrees to the tolerance.
    Within,
    /// It differs by more than it may.
    Differs,
    /// There was nothing to compare with, or no way to solve it.
    NotCompared,
}

/// A run that was solved again.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Repeated {
    /// Its id.
    pub run_id: String,
    /// Its index in the sweep that was asked for.
    pub run_index: i64,
    /// What came of it.
    pub verdict: Verdict,
    /// Whether the same bits were to come out: same build, same class of host, same start.
    pub is_same_build: bool,
    /// The number that differs most, relative to its scale.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub largest: Option<Difference>,
    /// Why it is neither the same nor within the tolerance, or how the solver went another way.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub detail: Option<String>,
}

/// Runs to be solved again.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    homes: Vec<Vec<Address>>,
}

impl Plan {
    /// The runs of a sweep or the one of a run's id; none if there is no such thing.
    pub async fn of(
        onlooker: &Onlooker,
        id: &str,
        sample: Option<(usize, u64)>,
    ) -> anyhow::Result<Option<Self>> {
        let mut tx = onlooker.read().await?;
        if !catalogue::tells_provenance(&mut tx).await {
            bail!(
                "the data directory was last used by an older melange, and is only read here: start `melange serve` \
                 on it once, or on a copy made by `melange backup`, to bring it up to date"
            );
        }
        let addresses = match queue::sweep_in_brief(&mut tx, id).await? {
            Some(sweep) => catalogue::addresses(&mut tx, sweep.number).await?,
            None => match catalogue::address(&mut tx, id).await? {
                Some(address) => vec![address],
                None => return Ok(None),
            },
        };
        let addresses = match sample {
            Some((n, seed)) => drawn(addresses, n, seed),
            None => addresses,
        };
        let homes = addresses.chunk_by(|a, b| a.home == b.home).map(<[Address]>::to_vec);
        Ok(Some(Self { homes: homes.collect() }))
    }

    /// How many they are.
    pub fn count(&self) -> usize {
        self.homes.iter().map(Vec::len).sum()
    }
}

/// So many of the runs, the same for the same seed: those of the smallest hashes.
fn drawn(mut addresses: Vec<Address>, n: usize, seed: u64) -> Vec<Address> {
    let draw = |address: &Address| {
        let mut hasher = blake3::Hasher::new();
        hasher.update(&seed.to_le_bytes()).update(&address.run_index.to_le_bytes());
        *hasher.finalize().as_bytes()
    };
    addresses.sort_by_cached_key(draw);
    addresses.truncate(n);
    addresses.sort_unstable();
    addresses
}

/// Solves runs again.
#[derive(Debug, Clone)]
pub struct Repeater {
    onlooker: Arc<Onlooker>,
    pool: Arc<rayon::ThreadPool>,
    tolerance: f64,
    /// The documents of sweeps, for runs whose rows do not tell all.
    documents: Arc<Mutex<HashMap<i64, Arc<str>>>>,
}

/// What a chunk's runs are solved again from.
struct Work {
    entries: Vec<Entry>,
    recalled: Recalled,
    start: Result<StoredStart, String>,
    /// What identifies the runs beside parameters and closure, where their rows do not tell.
    options: Option<Arc<str>>,
}

impl Repeater {
    /// With threads of its own, and a relative tolerance for runs that need not have the same bits.
    pub fn new(onlooker: Onlooker, threads: usize, tolerance: f64) -> anyhow::Result<Self> {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .start_handler(|_| {
                rustix::process::nice(NICENESS).ok();
            })
            .build()
            .context("cannot start the solver's threads")?;
        let (onlooker, pool) = (Arc::new(onlooker), Arc::new(pool));
        Ok(Self { onlooker, pool, tolerance, documents: Arc::default() })
    }

    /// Solves the runs of a plan again and compares; told how many are done after each chunk. In the order of
    /// their indices.
    pub async fn repeat(&self, plan: Plan, tell: impl Fn(usize)) -> anyhow::Result<Vec<Repeated>> {
        let mut tasks = JoinSet::new();
        let mut repeated = Vec::with_capacity(plan.count());
        let mut homes = plan.homes.into_iter();
        loop {
            // As many chunks are held as threads can solve.
            while tasks.len() < self.pool.current_num_threads()
                && let Some(home) = homes.next()
            {
                let repeater = self.clone();
                tasks.spawn(async move { repeater.home(home).await });
            }
            let Some(done) = tasks.join_next().await else { break };
            repeated.extend(done.context("the solver broke off")??);
            tell(repeated.len());
        }
        repeated.sort_by_key(|run: &Repeated| run.run_index);
        Ok(repeated)
    }

    /// Runs that live in one chunk's files.
    async fn home(&self, addresses: Vec<Address>) -> anyhow::Result<Vec<Repeated>> {
        /// Looks at files that a service is putting together meanwhile.
        const LOOKS: usize = 5;
        let mut look = 1;
        let work = loop {
            match self.work(&addresses).await {
                Ok(work) => break work,
                Err(error) if look < LOOKS && is_loss(&error) => look += 1,
                Err(error) if is_loss(&error) => return self.unread(&addresses, &error).await,
                Err(error) => return Err(error),
            }
        };
        let (send, receive) = oneshot::channel();
        let tolerance = self.tolerance;
        self.pool.spawn(move || {
            send.send(repeat::all(&work, tolerance)).ok();
        });
        receive.await.context("the solver's threads are gone")
    }

    /// Reads what a chunk's runs are solved again from.
    async fn work(&self, addresses: &[Address]) -> anyhow::Result<Work> {
        let mut tx = self.onlooker.read().await?;
        let entries = catalogue::entries(&mut tx, addresses).await?;
        let places = entries.first().map(|entry| entry.places.clone()).unwrap_or_default();
        let sweep = addresses.first().map(|address| address.sweep).unwrap_or_default();
        let document = self.document(&mut tx, sweep).await?;
        let mut recalled = self.recall(places).await?;
        // Sealing and importing cut chunks anew: what a run began from may be in another one now.
        if let Some((home, first)) = addresses.first().map(|address| address.home) {
            let mut read = HashSet::from([first]);
            loop {
                let missing = recalled.missing_starts();
                let mut chunks = catalogue::chunks_of(&mut tx, home, &missing).await?;
                chunks.retain(|chunk| read.insert(*chunk));
                if chunks.is_empty() {
                    break;
                }
                for chunk in chunks {
                    let places = catalogue::places_of(&mut tx, (home, chunk)).await?;
                    recalled.join(self.recall(places).await?);
                }
            }
        }
        drop(tx);
        let document = document.map(|text| Document::parse(&text)).transpose()?;
        let start = match document.as_ref().and_then(|document| document.start.clone()) {
            Some(Start::Run(id)) => self.start(&id).await?,
            _ => Err("the run names no run to start from".into()),
        };
        let options = document.and_then(|document| document.options_of_any_length());
        Ok(Work { entries, recalled, start, options })
    }

    async fn recall(&self, places: Vec<(Kind, Place)>) -> anyhow::Result<Recalled> {
        let archive = self.onlooker.archive();
        let read = move || Recalled::read(&archive, &places);
        Ok(tokio::task::spawn_blocking(read).await??)
    }

    /// The document of a sweep, which all its runs share but for their points.
    async fn document(&self, tx: &mut Connection, sweep: i64) -> anyhow::Result<Option<Arc<str>>> {
        let mut documents = self.documents.lock().await;
        if let Some(document) = documents.get(&sweep) {
            return Ok(Some(document.clone()));
        }
        let document = queue::document(tx, sweep).await?.map(Arc::<str>::from);
        if let Some(document) = &document {
            documents.insert(sweep, document.clone());
        }
        Ok(document)
    }

    /// The stored state that runs start from, or why there is none.
    async fn start(&self, run_id: &str) -> anyhow::Result<Result<StoredStart, String>> {
        let entry = catalogue::run(&mut *self.onlooker.read().await?, run_id).await?;
        let Some(entry) = entry else { return Ok(stored_start(None)) };
        let archive = self.onlooker.archive();
        let read = tokio::task::spawn_blocking(move || read::outcome(&archive, &entry)).await?;
        Ok(stored_start(Some(read?)))
    }

    /// Runs whose files cannot be read.
    async fn unread(
        &self,
        addresses: &[Address],
        error: &anyhow::Error,
    ) -> anyhow::Result<Vec<Repeated>> {
        let entries = catalogue::entries(&mut *self.onlooker.read().await?, addresses).await?;
        let why = format!("{error:#}");
        Ok(entries.iter().map(|entry| repeat::not_compared(entry, &why)).collect())
    }
}

fn is_loss(error: &anyhow::Error) -> bool {
    error.downcast_ref().is_some_and(ArchiveError::is_loss)
}
