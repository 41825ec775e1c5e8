//! Solves what the queue holds: lease a chunk, solve it on rayon, hand the rows to the archive, finish.
//! No transaction is open while a solve runs, and no solve runs on an async thread.

pub mod solve;

use crate::archive::{ArchiveError, SolvedRun, catalogue, files, read};
use crate::domain::document::{Document, Start};
use crate::domain::outcome::Profile;
use crate::domain::sweep::SweepSpec;
use crate::queue::{self, Lease, LeaseLost};
use crate::store::{Connection, Store};
use anyhow::Context;
use solve::Walker;
use std::collections::HashMap;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};
use tokio::sync::{Notify, oneshot};
use tokio::task::JoinSet;
use tokio_util::sync::CancellationToken;

/// The workers of this process.
#[derive(Debug, Clone)]
pub struct Workers {
    store: Store,
    pool: Arc<rayon::ThreadPool>,
    sweeps: Arc<Mutex<HashMap<String, Arc<SweepSpec>>>>,
    wake: Arc<Notify>,
}

/// Chunks under way per thread: while one is written, the next is solved.
const CHUNKS_PER_THREAD: usize = 2;
/// Pause before a worker that met trouble tries again.
const AFTER_TROUBLE: Duration = Duration::from_secs(1);
/// Longest that a worker sleeps over a queue that nobody said has grown.
const LONGEST_SLEEP: Duration = Duration::from_secs(2);

impl Workers {
    /// Clears away what a dead process left behind, and makes a pool of threads.
    pub async fn new(store: Store, threads: usize, wake: Arc<Notify>) -> anyhow::Result<Self> {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .thread_name(|i| format!("solver-{i}"))
            .build()
            .context("cannot start the solver's threads")?;
        let reclaimed = queue::reclaim(&store).await?;
        let listed = catalogue::files(&mut *store.read().await?).await?;
        let names = listed.iter().map(|(path, _)| path.clone()).collect();
        let archive = store.archive();
        let (orphans, faults) = tokio::task::spawn_blocking(move || {
            (files::remove_orphans(&archive, &names), files::faults(&archive, &listed))
        })
        .await?;
        let orphans = orphans.context("cannot look through the archive")?;
        if reclaimed > 0 || orphans > 0 {
            tracing::info!(
                chunks = reclaimed,
                files = orphans,
                "took back what a dead process left"
            );
        }
        for fault in faults {
            tracing::error!("the archive is damaged: {fault}");
        }
        Ok(Self { store, pool: Arc::new(pool), sweeps: Arc::default(), wake })
    }

    /// Number of threads that solve.
    pub fn threads(&self) -> usize {
        self.pool.current_num_threads()
    }

    /// Works until told to stop, then finishes the chunks under way.
    pub async fn work(self, stop: CancellationToken) {
        let mut slots = JoinSet::new();
        for _ in 0..CHUNKS_PER_THREAD * self.threads() {
            let (workers, stop) = (self.clone(), stop.clone());
            slots.spawn(async move { workers.slot(&stop).await });
        }
        slots.join_all().await;
    }

    async fn slot(&self, stop: &CancellationToken) {
        while !stop.is_cancelled() {
            let pause = match queue::lease(&self.store).await {
                Ok(Some(lease)) => match self.chunk(&lease).await {
                    Ok(()) => continue,
                    Err(error) => {
                        tracing::error!(sweep = lease.sweep_id, chunk = lease.chunk, "{error:#}");
                        if let Err(error) = queue::give_back(&self.store, &lease).await {
                            tracing::error!("cannot give the chunk back: {error}");
                        }
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
    }

    /// One chunk from lease to commit.
    async fn chunk(&self, lease: &Lease) -> anyhow::Result<()> {
        let sweep = self.sweep(&lease.sweep_id).await?;
        let starts = self.starts(&sweep, lease).await?;
        let (send, receive) = oneshot::channel();
        let (spec, held) = (sweep.clone(), lease.clone());
        self.pool.spawn(move || {
            // The receiver is gone only when the process ends.
            send.send(solve_chunk(&spec, &held, &starts)).ok();
        });
        let (runs, duration) = receive.await.context("the solver's threads are gone")?;

        let archive = self.store.archive();
        let held = lease.clone();
        let (written, runs) = tokio::task::spawn_blocking(move || {
            let written =
                files::write_chunk(&archive, &held.sweep_id, held.chunk, &held.token, &runs);
            written.map(|written| (written, runs))
        })
        .await??;
        let mut tx = self.store.write().await?;
        let added = self.add(&mut tx, lease, &sweep, &written, &runs, duration).await;
        if added.is_err() {
            files::remove(&self.store.archive(), &written);
        }
        added?;
        // A commit that fails may have happened: the files stay, listed or as orphans.
        tx.commit().await?;
        Ok(())
    }

    /// What the one transaction of a chunk holds: its end, its files, its runs.
    async fn add(
        &self,
        tx: &mut Connection,
        lease: &Lease,
        sweep: &SweepSpec,
        written: &[files::Written],
        runs: &[SolvedRun],
        duration: Duration,
    ) -> anyhow::Result<()> {
        let statuses = runs.iter().map(|run| run.outcome.status);
        let finished: Result<(), LeaseLost> = queue::finish(tx, lease, statuses).await?;
        finished?;
        catalogue::insert(tx, &lease.sweep_id, lease.chunk, written, runs).await?;
        let first = sweep.run(lease.first_run);
        let work = first.work() * runs.len() as f64;
        queue::measured(tx, first.regime.name(), duration.as_secs_f64() / work).await?;
        Ok(())
    }

    async fn sweep(&self, id: &str) -> anyhow::Result<Arc<SweepSpec>> {
        /// Sweeps kept at hand.
        const KEPT: usize = 16;
        let known = self.sweeps.lock().expect("no panic while it is held").get(id).cloned();
        if let Some(sweep) = known {
            return Ok(sweep);
        }
        let row = queue::sweep(&mut *self.store.read().await?, id)
            .await?
            .with_context(|| format!("sweep {id} is gone"))?;
        let spec = tokio::task::spawn_blocking(move || {
            Document::parse(&row.document).and_then(Document::into_sweep)
        })
        .await??;
        let spec = Arc::new(spec);
        let mut sweeps = self.sweeps.lock().expect("no panic while it is held");
        if sweeps.len() >= KEPT {
            sweeps.clear();
        }
        sweeps.insert(id.to_owned(), spec.clone());
        Ok(spec)
    }

    /// The stored states that runs of a chunk name as their start.
    async fn starts(
        &self,
        sweep: &SweepSpec,
        lease: &Lease,
    ) -> anyhow::Result<HashMap<String, Profile>> {
        let mut starts = HashMap::new();
        if let Some(Start::Run(id)) = &sweep.document().start
            && let Some(profile) = start_profile(&self.store, id).await?
        {
            tracing::debug!(sweep = lease.sweep_id, run = id, "starting from a stored run");
            starts.insert(id.clone(), profile);
        }
        Ok(starts)
    }
}

/// The last state of a stored run, if there is one.
pub async fn start_profile(store: &Store, run_id: &str) -> Result<Option<Profile>, ArchiveError> {
    let entry = catalogue::run(&mut *store.read().await?, run_id).await?;
    let Some(entry) = entry else { return Ok(None) };
    Ok(read::outcome(&store.archive(), &entry)?.profile)
}

fn solve_chunk(
    sweep: &SweepSpec,
    lease: &Lease,
    starts: &HashMap<String, Profile>,
) -> (Vec<SolvedRun>, Duration) {
    let begin = Instant::now();
    let mut walker = Walker::default();
    let runs = (lease.first_run..lease.first_run + lease.run_count)
        .map(|run_index| {
            let run = sweep.run(run_index);
            let start = match &run.start {
                Some(Start::Run(id)) => starts.get(id),
                _ => None,
            };
            SolvedRun { run_index, run_id: run.id(), outcome: walker.solve(&run, start) }
        })
        .collect();
    (runs, begin.elapsed())
}
