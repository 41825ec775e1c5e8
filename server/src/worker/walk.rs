//! A way through the runs of a chunk, each near the one before; shared with threads that have nothing to do.

use super::solve::{StoredStart, Walker};
use crate::archive::SolvedRun;
use crate::domain::sweep::SweepSpec;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

/// What came of a way.
pub struct Solved {
    /// The runs, by ascending index.
    pub runs: Vec<SolvedRun>,
    /// Time that a unit of work took; none if there was nothing to solve.
    pub seconds_per_unit: Option<f64>,
}

/// Solves the runs of a way, given by index and id, on the threads of this pool; none if told to stop.
pub fn walk(
    sweep: &SweepSpec,
    way: &[(usize, String)],
    start: Result<&StoredStart, &str>,
    walking: &Arc<Walking>,
    stop: &(dyn Fn() -> bool + Sync),
) -> Option<Solved> {
    let walk = Walk { sweep, start, stop, walking, sum: Mutex::default() };
    rayon::scope(|scope| walk.go(scope, way, walking.begin()));
    let Sum { mut runs, seconds, units } =
        walk.sum.into_inner().unwrap_or_else(PoisonError::into_inner);
    if runs.len() < way.len() {
        return None;
    }
    runs.sort_unstable_by_key(|run| run.run_index);
    Some(Solved { runs, seconds_per_unit: (units > 0.0).then(|| seconds / units) })
}

/// How many of a pool's threads walk.
#[derive(Debug)]
pub struct Walking {
    threads: usize,
    walking: AtomicUsize,
}

/// One that walks, until it is dropped.
struct Walks(Arc<Walking>);

impl Walking {
    /// Of a pool with so many threads.
    pub fn new(threads: usize) -> Self {
        Self { threads, walking: AtomicUsize::new(0) }
    }

    fn begin(self: &Arc<Self>) -> Walks {
        self.walking.fetch_add(1, Ordering::Relaxed);
        Walks(self.clone())
    }

    /// One more, if a thread has nothing to do.
    fn begin_if_idle(self: &Arc<Self>) -> Option<Walks> {
        let one_more = |n| (n < self.threads).then_some(n + 1);
        let begun = self.walking.fetch_update(Ordering::Relaxed, Ordering::Relaxed, one_more);
        begun.ok().map(|_| Walks(self.clone()))
    }
}

impl Drop for Walks {
    fn drop(&mut self) {
        self.0.walking.fetch_sub(1, Ordering::Relaxed);
    }
}

/// A way through the runs of a chunk.
struct Walk<'a> {
    sweep: &'a SweepSpec,
    start: Result<&'a StoredStart, &'a str>,
    stop: &'a (dyn Fn() -> bool + Sync),
    walking: &'a Arc<Walking>,
    sum: Mutex<Sum>,
}

/// What is solved so far, with the time and the units of work it took.
#[derive(Default)]
struct Sum {
    runs: Vec<SolvedRun>,
    seconds: f64,
    units: f64,
}

/// Fewest runs of a way that is divided: each part begins without a neighbour.
const DIVIDED: usize = 8;

impl<'a> Walk<'a> {
    /// Goes a way run by run. When a thread has nothing to do, which is so at the end of a sweep, it gets
    /// the second half of what is left.
    fn go<'s>(&'s self, scope: &rayon::Scope<'s>, mut way: &'s [(usize, String)], me: Walks) {
        let _me = me;
        let begin = Instant::now();
        let mut walker = Walker::default();
        let mut units = 0.0;
        let mut runs = Vec::with_capacity(way.len());
        while let Some(((run_index, run_id), rest)) = way.split_first() {
            if (self.stop)() {
                return;
            }
            let run = self.sweep.run(*run_index);
            units += run.work();
            let Some(outcome) = walker.solve(&run, self.start, self.stop) else { return };
            runs.push(SolvedRun { run_index: *run_index, run_id: run_id.clone(), outcome });
            way = rest;
            if way.len() >= DIVIDED
                && let Some(other) = self.walking.begin_if_idle()
            {
                let (mine, others) = way.split_at(way.len().div_ceil(2));
                scope.spawn(move |scope| self.go(scope, others, other));
                way = mine;
            }
        }
        let mut sum = self.sum.lock().unwrap_or_else(PoisonError::into_inner);
        sum.runs.append(&mut runs);
        sum.seconds += begin.elapsed().as_secs_f64();
        sum.units += units;
    }
}
