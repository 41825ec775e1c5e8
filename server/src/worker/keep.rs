//! Storing a solved chunk: its files, then the one transaction that lists them. What is solved is not thrown
//! away because a disk is full: it is tried again until it is stored, the lease is lost or the process ends.

use super::chunk::Work;
use super::claims::Claim;
use super::{AFTER_TROUBLE, Workers};
use crate::archive::files::Encoded;
use crate::archive::{SolvedRun, catalogue, files};
use crate::domain::status::Status;
use crate::domain::sweep::SweepSpec;
use crate::faults::Step;
use crate::queue::{self, Lease, LeaseLost};
use crate::store::Connection;
use crate::telemetry::TELEMETRY;
use std::sync::Arc;
use std::time::Instant;
use tokio_util::sync::CancellationToken;

/// What came of a chunk's work.
pub struct Done {
    /// Solved, by ascending index, each id once.
    pub solved: Vec<SolvedRun>,
    /// Known before, or solved under another index of this chunk.
    pub known: Work,
    /// Time that a unit of work took; none if nothing was solved.
    pub seconds_per_unit: Option<f64>,
    /// The tables of the solved runs; none if there are none.
    pub tables: Vec<Encoded>,
}

/// Runs that were known have been deleted since.
#[derive(Debug, thiserror::Error)]
#[error("runs that were known have been deleted meanwhile; the chunk is solved again")]
struct Gone;

impl Workers {
    /// Stores a solved chunk, and leases the next one.
    pub(super) async fn keep(
        &self,
        lease: &Lease,
        sweep: &SweepSpec,
        mut done: Done,
        claim: Claim,
        stop: &CancellationToken,
    ) -> anyhow::Result<Option<Lease>> {
        let _claim = claim;
        let tables = Arc::new(std::mem::take(&mut done.tables));
        loop {
            let stored = self.store_once(lease, sweep, &done, &tables, stop).await;
            let Err(error) = stored else { return stored };
            let is_vain = error.is::<LeaseLost>() || error.is::<Gone>();
            if is_vain || stop.is_cancelled() {
                return Err(error);
            }
            TELEMETRY.chunk_store_failures.inc();
            tracing::error!(
                sweep = lease.sweep_id,
                chunk = lease.chunk,
                "cannot store it, and tries again: {error:#}"
            );
            tokio::select! {
                () = stop.cancelled() => return Err(error),
                () = tokio::time::sleep(AFTER_TROUBLE) => {}
            }
        }
    }

    async fn store_once(
        &self,
        lease: &Lease,
        sweep: &SweepSpec,
        done: &Done,
        tables: &Arc<Vec<Encoded>>,
        stop: &CancellationToken,
    ) -> anyhow::Result<Option<Lease>> {
        let begin = Instant::now();
        // A chunk whose runs are all known has no files of its own.
        let written = if tables.is_empty() {
            Vec::new()
        } else {
            let (archive, tables) = (self.store.archive(), tables.clone());
            let (held, faults) = (lease.clone(), self.faults.clone());
            tokio::task::spawn_blocking(move || {
                let Lease { sweep_id, chunk, token, .. } = &held;
                files::write_chunk(&archive, sweep_id, *chunk, token, &tables, &faults)
            })
            .await??
        };
        let write = begin.elapsed();
        let mut next = None;
        let stored = self.commit(lease, sweep, &written, done, stop, &mut next).await;
        let commit = begin.elapsed() - write;
        TELEMETRY.chunk_write_seconds.observe(write.as_secs_f64());
        TELEMETRY.chunk_commit_seconds.observe(commit.as_secs_f64());
        tracing::debug!(
            sweep = lease.sweep_id,
            chunk = lease.chunk,
            runs = lease.run_count,
            write_ms = write.as_millis(),
            commit_ms = commit.as_millis(),
            "chunk"
        );
        let Err((error, is_certain)) = stored else { return Ok(next) };
        // A commit that failed may have happened: then the lease is gone, the next one is held, and what is
        // listed stays. A full disk still lets read.
        let is_nothing_stored = is_certain || self.holds(lease).await;
        if is_nothing_stored {
            files::remove(&self.store.archive(), written.iter().map(|w| w.path.as_str()));
            return Err(error);
        }
        Ok(next)
    }

    /// The one transaction of a chunk: its end, its files, its runs, and the lease of the `next` one unless the
    /// process ends. An error tells whether it is certain that nothing was committed.
    async fn commit(
        &self,
        lease: &Lease,
        sweep: &SweepSpec,
        written: &[files::Written],
        done: &Done,
        stop: &CancellationToken,
        next: &mut Option<Lease>,
    ) -> Result<(), (anyhow::Error, bool)> {
        let nothing = |error: anyhow::Error| (error, true);
        let mut tx = self.store.write().await.map_err(|e| nothing(e.into()))?;
        let added = self.add(&mut tx, lease, sweep, written, done).await.map_err(nothing)?;
        if !stop.is_cancelled() {
            *next = queue::take(&mut tx).await.map_err(|e| nothing(e.into()))?;
        }
        self.faults.pass(Step::InTransaction);
        // A commit that fails may have happened.
        tx.commit().await.map_err(|e| (e.into(), false))?;
        self.faults.pass(Step::AfterCommit);
        added.count();
        TELEMETRY.chunks_leased.inc_by(u64::from(next.is_some()));
        if added.has_ended {
            self.store.tell_end();
        }
        Ok(())
    }

    /// Adds what a chunk came to.
    async fn add(
        &self,
        tx: &mut Connection,
        lease: &Lease,
        sweep: &SweepSpec,
        written: &[files::Written],
        done: &Done,
    ) -> anyhow::Result<Added> {
        let Lease { sweep: number, chunk, .. } = *lease;
        let axes = sweep.varied();
        catalogue::insert(tx, number, chunk, &axes, written, &done.solved).await?;
        // A chunk is solved by one process.
        if let Some(by) = done.solved.first().and_then(|run| run.outcome.provenance.as_ref()) {
            catalogue::insert_solved(tx, number, chunk, by).await?;
        }
        let known: Vec<(usize, &str)> =
            done.known.iter().map(|(i, id)| (*i, id.as_str())).collect();
        let adopted = catalogue::adopt(tx, number, chunk, &axes, &known).await?;
        if adopted.len() < known.len() {
            return Err(Gone.into());
        }
        let statuses = done.solved.iter().map(|run| run.outcome.status);
        let statuses: Vec<Status> = statuses.chain(adopted.iter().map(|run| run.status)).collect();
        let reused = adopted.iter().filter(|run| !run.is_own).count();
        let has_ended = queue::finish(tx, lease, statuses.iter().copied(), reused).await??;
        if let Some(seconds_per_unit) = done.seconds_per_unit {
            let regime = sweep.run(lease.first_run).shared.regime.name();
            queue::measured(tx, regime, seconds_per_unit).await?;
        }
        Ok(Added { statuses, reused, has_ended })
    }
}

/// What a chunk has added to its sweep.
struct Added {
    /// How its runs ended.
    statuses: Vec<Status>,
    /// How many of them were taken over from other sweeps.
    reused: usize,
    /// Whether its sweep has ended with it.
    has_ended: bool,
}

impl Added {
    /// Counts it, once it is committed.
    fn count(&self) {
        TELEMETRY.chunks_finished.inc();
        TELEMETRY.runs_reused.inc_by(self.reused as u64);
        for status in Status::STORED {
            let runs = self.statuses.iter().filter(|s| **s == status).count();
            TELEMETRY.ended(status.name(), runs as u64);
        }
    }
}
