//! Solves what the queue holds: lease a chunk, solve it on rayon, hand the rows to the archive, finish.
//! No transaction is open while a solve runs, and no solve runs on an async thread.

mod dress;
mod record;
pub mod solve;

use crate::archive::{SolvedRun, catalogue, files, read};
use crate::domain::document::Document;
use crate::domain::start::Start;
use crate::domain::sweep::SweepSpec;
use crate::queue::{self, Lease, LeaseLost};
use crate::store::{Connection, Store};
use anyhow::Context;
use solve::{StoredStart, Walker};
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
                Ok(Some(lease)) => match self.chunk(&lease, stop).await {
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

    /// One chunk from lease to commit; given back if told to stop before it is solved.
    async fn chunk(&self, lease: &Lease, stop: &CancellationToken) -> anyhow::Result<()> {
        let sweep = self.sweep(&lease.sweep_id).await?;
        let start = self.start(&sweep).await;
        let (send, receive) = oneshot::channel();
        let (spec, held, stop) = (sweep.clone(), lease.clone(), stop.clone());
        self.pool.spawn(move || {
            let start = start.as_ref().map_err(String::as_str);
            let solved = solve_chunk(&spec, &held, start, &|| stop.is_cancelled());
            // The receiver is gone only when the process ends.
            send.send(solved).ok();
        });
        let solved = receive.await.context("the solver's threads are gone")?;
        let Some((runs, duration)) = solved else {
            queue::give_back(&self.store, lease).await?;
            return Ok(());
        };

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
        let stretch = lease.first_run..lease.first_run + lease.run_count;
        let work: f64 = stretch.map(|i| sweep.run(i).work()).sum();
        let regime = sweep.run(lease.first_run).shared.regime.name();
        queue::measured(tx, regime, duration.as_secs_f64() / work).await?;
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

    /// The stored state that the sweep names as its start, or why there is none; a start that cannot be
    /// read is a failure of its runs, not of the chunk.
    async fn start(&self, sweep: &SweepSpec) -> Result<StoredStart, String> {
        let Some(Start::Run(id)) = &sweep.document().start else {
            return Err("the sweep names no run to start from".into());
        };
        match read::stored(&self.store, id).await {
            Ok(Some(outcome)) => {
                let terminus_x_m = outcome.scalars.terminus_x_m.unwrap_or(0.0);
                let state = outcome.profile.map(|profile| StoredStart { profile, terminus_x_m });
                state.ok_or_else(|| "it has no state".into())
            }
            Ok(None) => Err("it is not in the archive".into()),
            Err(error) => Err(error.to_string()),
        }
    }
}

/// The chunk's runs, solved in order, and how long it took; none if told to stop.
fn solve_chunk(
    sweep: &SweepSpec,
    lease: &Lease,
    start: Result<&StoredStart, &str>,
    stop: &dyn Fn() -> bool,
) -> Option<(Vec<SolvedRun>, Duration)> {
    let begin = Instant::now();
    let mut walker = Walker::default();
    let mut runs = Vec::with_capacity(lease.run_count);
    for run_index in lease.first_run..lease.first_run + lease.run_count {
        if stop() {
            return None;
        }
        let run = sweep.run(run_index);
        let outcome = walker.solve(&run, start, stop)?;
        runs.push(SolvedRun { run_index, run_id: run.id(), outcome });
    }
    Some((runs, begin.elapsed()))
}
