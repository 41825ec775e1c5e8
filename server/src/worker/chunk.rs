//! One chunk from lease to a solved chunk; `keep` stores it.

use super::Workers;
use super::keep::Done;
use super::solve::StoredStart;
use super::walk::{Solved, Task, Way, walk};
use crate::archive::{ArchiveError, catalogue, files};
use crate::domain::sweep::SweepSpec;
use crate::queue::Lease;
use anyhow::Context;
use std::collections::{HashMap, HashSet};
use std::ops::Range;
use std::sync::Arc;
use tokio::sync::oneshot;
use tokio_util::sync::CancellationToken;

/// What is to be done of a chunk: indices with their ids, in the order of the indices.
pub(super) type Work = Vec<(usize, String)>;

impl Workers {
    /// One chunk from lease to commit, which leases the next one; given back if told to stop before it is
    /// solved.
    pub(super) async fn chunk(
        &self,
        lease: &Lease,
        stop: &CancellationToken,
    ) -> anyhow::Result<Option<Lease>> {
        let sweep = self.sweep(lease).await?;
        let start = self.start(&sweep).await?;
        let work = self.work_of(lease, &sweep).await?;
        let claim = tokio::select! {
            claim = self.claims.claim(work.iter().map(|(_, id)| id.clone()).collect()) => claim,
            () = stop.cancelled() => {
                self.try_give_back(lease).await?;
                return Ok(None);
            }
        };
        let ids: Vec<String> = work.iter().map(|(_, id)| id.clone()).collect();
        let known = if sweep.is_forced() {
            HashSet::new()
        } else {
            catalogue::known(&mut *self.store.read().await?, &ids).await?
        };
        let (send, receive) = oneshot::channel();
        let todo = Todo {
            sweep: sweep.clone(),
            stretch: lease.first_run..lease.end_run,
            work,
            known,
            start,
            stop: stop.clone(),
        };
        // It counts as soon as it waits for a thread.
        let task = self.tasks.begin();
        self.pool.spawn(move || {
            todo.solve(task, move |done| {
                // The receiver is gone when the lease was taken away or the process ends.
                send.send(done).ok();
            });
        });
        let done = receive.await.context("the solver's threads are gone")?;
        match done {
            Some(done) => self.keep(lease, &sweep, done?, claim, stop).await,
            None => {
                self.try_give_back(lease).await?;
                Ok(None)
            }
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

/// A chunk on its way to a thread of the pool.
struct Todo {
    sweep: Arc<SweepSpec>,
    stretch: Range<usize>,
    work: Work,
    known: HashSet<String>,
    start: Result<StoredStart, String>,
    stop: CancellationToken,
}

impl Todo {
    /// Solves the runs that are not known, each near the one before, and hands over what is to be kept; none
    /// if told to stop.
    fn solve(
        self,
        task: Task,
        then: impl FnOnce(Option<Result<Done, ArchiveError>>) + Send + Sync + 'static,
    ) {
        let Self { sweep, stretch, work, known, start, stop } = self;
        let mut seen = HashSet::new();
        // A point that stands in a sweep twice is solved once.
        let (known, unsolved): (Work, Work) =
            work.into_iter().partition(|(_, id)| known.contains(id) || !seen.insert(id.clone()));
        let mut ids: HashMap<usize, String> = unsolved.into_iter().collect();
        let order = sweep.visiting_order(stretch);
        let runs = order.into_iter().filter_map(|i| Some((i, ids.remove(&i)?))).collect();
        walk(Way { sweep, runs, start, stop }, task, move |solved| {
            let Some(Solved { mut runs, seconds_per_unit }) = solved else { return then(None) };
            // Part of a worker's work, so that so many workers take so many cores.
            let tables = files::encode(&runs);
            runs.iter_mut().for_each(|run| run.outcome.drop_tables());
            then(Some(tables.map(|tables| Done { solved: runs, known, seconds_per_unit, tables })));
        });
    }
}
