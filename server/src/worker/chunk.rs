//! One chunk from lease to a solved chunk; `keep` stores it.

use super::Workers;
use super::keep::Done;
use super::solve::StoredStart;
use super::walk::{Solved, Walking, walk};
use crate::archive::{ArchiveError, catalogue, files};
use crate::domain::sweep::SweepSpec;
use crate::queue::{self, Lease};
use anyhow::Context;
use std::collections::{HashMap, HashSet};
use std::sync::Arc;
use tokio::sync::oneshot;
use tokio_util::sync::CancellationToken;

/// What is to be done of a chunk: indices with their ids, in the order of the indices.
pub(super) type Work = Vec<(usize, String)>;

impl Workers {
    /// One chunk from lease to commit; given back if told to stop before it is solved.
    pub(super) async fn chunk(
        &self,
        lease: &Lease,
        stop: &CancellationToken,
    ) -> anyhow::Result<()> {
        let sweep = self.sweep(lease).await?;
        let start = self.start(&sweep).await?;
        let work = self.work_of(lease, &sweep).await?;
        let claim = tokio::select! {
            claim = self.claims.claim(work.iter().map(|(_, id)| id.clone()).collect()) => claim,
            () = stop.cancelled() => return Ok(queue::give_back(&self.store, lease).await?),
        };
        let ids: Vec<String> = work.iter().map(|(_, id)| id.clone()).collect();
        let known = if sweep.is_forced() {
            HashSet::new()
        } else {
            catalogue::known(&mut *self.store.read().await?, &ids).await?
        };
        let (send, receive) = oneshot::channel();
        let (spec, held, stopping) = (sweep.clone(), lease.clone(), stop.clone());
        let walking = self.walking.clone();
        self.pool.spawn(move || {
            let start = start.as_ref().map_err(String::as_str);
            let stop = || stopping.is_cancelled();
            let done = solve(&spec, &held, work, &known, start, &walking, &stop);
            // The receiver is gone when the lease was taken away or the process ends.
            send.send(done).ok();
        });
        let done = receive.await.context("the solver's threads are gone")?;
        match done {
            Some(done) => self.keep(lease, &sweep, done?, claim, stop).await,
            None => Ok(queue::give_back(&self.store, lease).await?),
        }
    }

    /// The runs of a chunk with their ids.
    async fn work_of(&self, lease: &Lease, sweep: &Arc<SweepSpec>) -> anyhow::Result<Work> {
        let stretch = lease.first_run..lease.end_run;
        let spec = sweep.clone();
        let ids = move || stretch.map(|i| (i, spec.run(i).id())).collect();
        Ok(tokio::task::spawn_blocking(ids).await?)
    }
}

/// Solves a chunk's runs that are not known, each near the one before; none if told to stop.
fn solve(
    sweep: &SweepSpec,
    lease: &Lease,
    work: Work,
    known: &HashSet<String>,
    start: Result<&StoredStart, &str>,
    walking: &Arc<Walking>,
    stop: &(dyn Fn() -> bool + Sync),
) -> Option<Result<Done, ArchiveError>> {
    let mut seen = HashSet::new();
    // A point that stands in a sweep twice is solved once.
    let (known, unsolved): (Work, Work) =
        work.into_iter().partition(|(_, id)| known.contains(id) || !seen.insert(id.clone()));
    let mut ids: HashMap<usize, String> = unsolved.into_iter().collect();
    let order = sweep.visiting_order(lease.first_run..lease.end_run);
    let way: Work = order.into_iter().filter_map(|i| Some((i, ids.remove(&i)?))).collect();
    let Solved { runs, seconds_per_unit } = walk(sweep, &way, start, walking, stop)?;
    // Part of a worker's work, so that so many workers take so many cores.
    let tables = files::encode(&runs);
    Some(tables.map(|tables| Done { solved: runs, known, seconds_per_unit, tables }))
}
