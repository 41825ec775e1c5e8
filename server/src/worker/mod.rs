//! Solves what the queue holds: lease a chunk, take over what is known, solve the rest on rayon, hand the
//! rows to the archive, finish. No transaction is open while a solve runs, and no solve runs on an async
//! thread.

mod chunk;
mod claims;
mod dress;
pub mod host;
pub mod janitor;
mod keep;
mod record;
pub mod rerun;
pub mod solve;
pub mod walk;

use crate::archive::{catalogue, files, read};
use crate::domain::document::Document;
use crate::domain::outcome::Outcome;
use crate::domain::start::Start;
use crate::domain::sweep::{Limits, SweepSpec};
use crate::faults::Faults;
use crate::queue::{self, Lease, LeaseLost};
use crate::store::Store;
use crate::telemetry::TELEMETRY;
use anyhow::Context;
use claims::Claims;
use solve::StoredStart;
use std::collections::HashMap;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::{Mutex, Notify, watch};
use tokio::task::JoinSet;
use tokio_util::sync::CancellationToken;
use walk::Tasks;

/// The workers of this process.
#[derive(Debug, Clone)]
pub struct Workers {
    store: Store,
    pool: Arc<rayon::ThreadPool>,
    sweeps: Arc<Mutex<HashMap<String, Arc<SweepSpec>>>>,
    claims: Claims,
    tasks: Arc<Tasks>,
    wake: Arc<Notify>,
    faults: Faults,
    kept: Duration,
}

/// How long deleted sweeps lie in the trash if nobody says otherwise.
pub const KEPT: Duration = Duration::from_secs(30 * 24 * 3600);
/// Chunks under way per thread: while one is written, the next is solved.
const CHUNKS_PER_THREAD: usize = 2;
/// Pause before a worker that met trouble tries again.
const AFTER_TROUBLE: Duration = Duration::from_secs(1);
/// Longest that a worker sleeps over a queue that nobody said has grown.
const LONGEST_SLEEP: Duration = Duration::from_secs(2);
/// How much the solver's threads yield to those that answer requests.
pub const NICENESS: i32 = 10;

impl Workers {
    /// Clears away what a dead process left behind, and makes a pool of threads.
    pub async fn new(
        store: Store,
        threads: usize,
        wake: Arc<Notify>,
        faults: Faults,
    ) -> anyhow::Result<Self> {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .thread_name(|i| format!("solver-{i}"))
            // On Linux a thread's niceness is its own; a thread that stays eager does no harm.
            .start_handler(|_| {
                rustix::process::nice(NICENESS).ok();
            })
            .build()
            .context("cannot start the solver's threads")?;
        let reclaimed = queue::reclaim(&store).await?;
        let listed = catalogue::all_files(&mut *store.read().await?).await?;
        let archive = store.archive();
        let (orphans, faulty) = tokio::task::spawn_blocking(move || {
            let names = listed.iter().map(|file| file.path.clone()).collect();
            let orphans = files::orphans(&archive, &names)?;
            files::remove(&archive, orphans.iter().map(String::as_str));
            files::remove_empty_folders(&archive)?;
            std::io::Result::Ok((orphans.len(), files::faults(&archive, &listed)))
        })
        .await?
        .context("cannot look through the archive")?;
        if reclaimed > 0 || orphans > 0 {
            tracing::info!(
                chunks = reclaimed,
                files = orphans,
                "took back what a dead process left"
            );
        }
        for fault in faulty {
            tracing::error!("the archive is damaged: {fault}; see `melange verify`");
        }
        let (sweeps, claims) = Default::default();
        let tasks = Arc::new(Tasks::new(threads));
        Ok(Self { store, pool: Arc::new(pool), sweeps, claims, tasks, wake, faults, kept: KEPT })
    }

    /// With another time for which deleted sweeps lie in the trash.
    pub fn keeping(self, kept: Duration) -> Self {
        Self { kept, ..self }
    }

    /// Number of threads that solve.
    pub fn threads(&self) -> usize {
        self.pool.current_num_threads()
    }

    /// Works until told to stop, then finishes the chunks under way.
    pub async fn work(self, stop: CancellationToken) {
        TELEMETRY.worker_threads.set(self.threads() as i64);
        let mut slots = JoinSet::new();
        for _ in 0..CHUNKS_PER_THREAD * self.threads() {
            let (workers, stop) = (self.clone(), stop.clone());
            slots.spawn(async move { workers.slot(&stop).await });
        }
        let (store, kept, stop) = (self.store.clone(), self.kept, stop.clone());
        slots.spawn(async move { janitor::work(&store, kept, &stop).await });
        slots.join_all().await;
    }

    async fn slot(&self, stop: &CancellationToken) {
        let mut next = None;
        // From before a chunk is leased, so that none is taken away unnoticed.
        let mut revocations = self.store.revocations();
        while !stop.is_cancelled() {
            let leased = match next.take() {
                Some(lease) => Ok(Some(lease)),
                None => queue::lease(&self.store).await.inspect(|leased| {
                    TELEMETRY.chunks_leased.inc_by(u64::from(leased.is_some()));
                }),
            };
            let since = std::mem::replace(&mut revocations, self.store.revocations());
            let pause = match leased {
                Ok(Some(lease)) => match self.leased(&lease, since, stop).await {
                    Ok(leased) => {
                        next = leased;
                        continue;
                    }
                    // As happens when a sweep is cancelled or deleted meanwhile.
                    Err(error) if error.is::<LeaseLost>() => {
                        tracing::info!("not stored: {error}");
                        continue;
                    }
                    Err(error) => {
                        tracing::error!(sweep = lease.sweep_id, chunk = lease.chunk, "{error:#}");
                        self.give_back(&lease, stop).await;
                        AFTER_TROUBLE
                    }
                },
                Ok(None) => LONGEST_SLEEP,
                Err(error) => {
                    tracing::error!("cannot lease a chunk: {error}");
                    AFTER_TROUBLE
                }
            };
            tokio::select! {
                () = stop.cancelled() => {}
                () = self.wake.notified(), if pause == LONGEST_SLEEP => {}
                () = tokio::time::sleep(pause) => {}
            }
        }
        if let Some(lease) = next {
            self.give_back(&lease, stop).await;
        }
    }

    async fn try_give_back(&self, lease: &Lease) -> sqlx::Result<()> {
        let is_returned = queue::give_back(&self.store, lease).await?;
        TELEMETRY.chunks_returned.inc_by(u64::from(is_returned));
        Ok(())
    }

    /// Gives a chunk back, however often that has to be tried: in this process nobody else takes it up.
    async fn give_back(&self, lease: &Lease, stop: &CancellationToken) {
        while let Err(error) = self.try_give_back(lease).await {
            tracing::error!(
                sweep = lease.sweep_id,
                chunk = lease.chunk,
                "cannot give it back: {error}"
            );
            tokio::select! {
                // The next start takes it back.
                () = stop.cancelled() => return,
                () = tokio::time::sleep(AFTER_TROUBLE) => {}
            }
        }
    }

    /// Works on a chunk, and stops when the lease is taken away or the process is to end; leases the next one
    /// when it is stored.
    async fn leased(
        &self,
        lease: &Lease,
        mut revocations: watch::Receiver<u64>,
        stop: &CancellationToken,
    ) -> anyhow::Result<Option<Lease>> {
        let stop = stop.child_token();
        let watching = async {
            while revocations.changed().await.is_ok() {
                if !self.holds(lease).await {
                    stop.cancel();
                }
            }
            std::future::pending().await
        };
        tokio::select! {
            done = self.chunk(lease, &stop) => done,
            () = watching => Ok(None),
        }
    }

    /// Whether a lease is still held, however often that has to be asked.
    async fn holds(&self, lease: &Lease) -> bool {
        loop {
            let held = match self.store.read().await {
                Ok(mut tx) => queue::holds(&mut tx, lease).await,
                Err(error) => Err(error),
            };
            match held {
                Ok(held) => return held,
                Err(_) => tokio::time::sleep(AFTER_TROUBLE).await,
            }
        }
    }

    async fn sweep(&self, lease: &Lease) -> anyhow::Result<Arc<SweepSpec>> {
        /// Sweeps kept at hand.
        const KEPT: usize = 16;
        let id = &lease.sweep_id;
        // Held while a document is read, so that it is read once.
        let mut sweeps = self.sweeps.lock().await;
        if let Some(sweep) = sweeps.get(id) {
            return Ok(sweep.clone());
        }
        let row = queue::sweep(&mut *self.store.read().await?, id)
            .await?
            .with_context(|| format!("sweep {id} is gone"))?;
        let spec = tokio::task::spawn_blocking(move || {
            // It was within the limits when it was submitted.
            Document::parse(&row.document).and_then(|d| d.into_sweep(&Limits::MOST))
        })
        .await??;
        let spec = Arc::new(spec);
        if sweeps.len() >= KEPT {
            sweeps.clear();
        }
        sweeps.insert(id.to_owned(), spec.clone());
        Ok(spec)
    }

    /// The stored state that the sweep names as its start, or why there is none; a start that cannot be
    /// read is a failure of its runs, not of the chunk.
    async fn start(&self, sweep: &SweepSpec) -> anyhow::Result<Result<StoredStart, String>> {
        let Some(Start::Run(id)) = &sweep.document().start else {
            return Ok(Err("the sweep names no run to start from".into()));
        };
        Ok(match read::stored(&self.store, id).await {
            Ok(outcome) => stored_start(outcome),
            Err(error) if error.is_loss() => Err(error.to_string()),
            // The chunk is tried again.
            Err(error) => return Err(error.into()),
        })
    }
}

/// The last state of a stored run, to start from, or why there is none.
fn stored_start(outcome: Option<Outcome>) -> Result<StoredStart, String> {
    let Some(outcome) = outcome else { return Err("it is not in the archive".into()) };
    let terminus_x_m = outcome.scalars.terminus_x_m.unwrap_or(0.0);
    let state = outcome.profile.map(|profile| StoredStart { profile, terminus_x_m });
    state.ok_or_else(|| "it has no state".into())
}
