//! A way through the runs of a chunk, each near the one before; shared with threads that have nothing to do.

use super::host;
use super::solve::{StoredStart, Walker};
use crate::archive::SolvedRun;
use crate::domain::provenance::Provenance;
use crate::domain::sweep::SweepSpec;
use crate::telemetry::TELEMETRY;
use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};
use tokio_util::sync::CancellationToken;

/// Runs to be solved, each near the one before.
#[derive(Debug)]
pub struct Way {
    /// The sweep that they belong to.
    pub sweep: Arc<SweepSpec>,
    /// Their indices and ids, in the order in which they are solved.
    pub runs: Vec<(usize, String)>,
    /// The stored state that they start from, or why there is none.
    pub start: Result<StoredStart, String>,
    /// Tells when they are not wanted any more.
    pub stop: CancellationToken,
}

/// What came of a way.
pub struct Solved {
    /// The runs, by ascending index.
    pub runs: Vec<SolvedRun>,
    /// Time that a unit of work took; none if there was nothing to solve.
    pub seconds_per_unit: Option<f64>,
}

/// Solves the runs of a way on the threads of the pool on one of which this is called, and hands over what
/// came of it; none if told to stop. No thread waits for another: whoever is done last hands over.
pub fn walk(way: Way, task: Task, then: impl FnOnce(Option<Solved>) + Send + Sync + 'static) {
    let all = 0..way.runs.len();
    go(Arc::new(Walk { way, sum: Mutex::default(), then: Box::new(then) }), all, task);
}

/// How many tasks a pool of threads has, under way or waiting.
#[derive(Debug)]
pub struct Tasks {
    threads: usize,
    count: AtomicUsize,
}

/// A task of a pool, until it is dropped.
#[derive(Debug)]
pub struct Task(Arc<Tasks>);

impl Tasks {
    /// Of a pool with so many threads.
    pub fn new(threads: usize) -> Self {
        Self { threads, count: AtomicUsize::new(0) }
    }

    /// One more.
    pub fn begin(self: &Arc<Self>) -> Task {
        self.count.fetch_add(1, Ordering::Relaxed);
        Task(self.clone())
    }

    /// One more, if a thread has nothing to do.
    fn begin_if_idle(self: &Arc<Self>) -> Option<Task> {
        let one_more = |n| (n < self.threads).then_some(n + 1);
        let begun = self.count.fetch_update(Ordering::Relaxed, Ordering::Relaxed, one_more);
        begun.ok().map(|_| Task(self.clone()))
    }
}

impl Drop for Task {
    fn drop(&mut self) {
        self.0.count.fetch_sub(1, Ordering::Relaxed);
    }
}

/// A way under way.
struct Walk {
    way: Way,
    sum: Mutex<Sum>,
    then: Box<dyn FnOnce(Option<Solved>) + Send + Sync>,
}

/// What is solved so far, with the time and the units of work it took.
#[derive(Default)]
struct Sum {
    runs: Vec<SolvedRun>,
    seconds: f64,
    units: f64,
}

/// Fewest runs of a way that is divided anyway: each part begins without a neighbour.
const DIVIDED: usize = 8;

/// Whether to divide a way of so many runs, told how long its first run took, which began without a neighbour,
/// and how long the last one did: fewer are divided if half of them take longer than such a beginning.
fn is_worth_dividing(runs: usize, first: Duration, last: Duration) -> bool {
    runs >= DIVIDED || (runs >= 2 && last * (runs / 2) as u32 >= first)
}

/// Goes a part of a way; who is the last to be done ends the walk, which is part of its task.
fn go(walk: Arc<Walk>, part: Range<usize>, task: Task) {
    solve(&walk, part, &task.0);
    if let Some(walk) = Arc::into_inner(walk) {
        walk.end();
    }
}

/// Solves a part of a way run by run. When a thread has nothing to do, which is so at the end of a sweep, it
/// gets the second half of what is left.
fn solve(walk: &Arc<Walk>, mut part: Range<usize>, tasks: &Arc<Tasks>) {
    let Way { sweep, runs: way, start, stop } = &walk.way;
    let begin = Instant::now();
    let start = start.as_ref().map_err(String::as_str);
    let mut walker = Walker::default();
    let options = sweep.options();
    let (mut first, mut ended) = (None, begin);
    let mut units = 0.0;
    let times = TELEMETRY.solve_times();
    let mut runs: Vec<SolvedRun> = Vec::with_capacity(part.len());
    while let Some(next) = part.next() {
        if stop.is_cancelled() {
            return;
        }
        let (run_index, run_id) = &way[next];
        let run = sweep.run(*run_index);
        units += run.work();
        let Some(mut outcome) = walker.solve(&run, start, &|| stop.is_cancelled()) else { return };
        let took = ended.elapsed();
        ended += took;
        times.observe(took.as_secs_f64());
        let (began, from) = walker.began().told();
        // The walker has solved these runs and no others.
        let started_from = from.map(|solve| runs[solve].run_id.clone());
        outcome.provenance = Some(Provenance {
            start: Some(began),
            started_from,
            seed: run.seed().or(sweep.seed()),
            ..Provenance::here(host::class(), options.clone(), took.as_secs_f64())
        });
        runs.push(SolvedRun { run_index: *run_index, run_id: run_id.clone(), outcome });
        if is_worth_dividing(part.len(), *first.get_or_insert(took), took)
            && let Some(task) = tasks.begin_if_idle()
        {
            let middle = part.start + part.len().div_ceil(2);
            let (others, walk) = (middle..part.end, walk.clone());
            rayon::spawn(move || go(walk, others, task));
            part.end = middle;
        }
    }
    let mut sum = walk.sum.lock().unwrap_or_else(PoisonError::into_inner);
    sum.runs.append(&mut runs);
    sum.seconds += begin.elapsed().as_secs_f64();
    sum.units += units;
}

impl Walk {
    fn end(self) {
        let sum = self.sum.into_inner().unwrap_or_else(PoisonError::into_inner);
        let Sum { mut runs, seconds, units } = sum;
        let is_whole = runs.len() == self.way.runs.len();
        runs.sort_unstable_by_key(|run| run.run_index);
        let seconds_per_unit = (units > 0.0).then(|| seconds / units);
        (self.then)(is_whole.then_some(Solved { runs, seconds_per_unit }));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_runs_are_divided_if_they_take_long() {
        let ms = Duration::from_millis;
        assert!(is_worth_dividing(8, ms(100), ms(1)));
        assert!(!is_worth_dividing(7, ms(4), ms(1)));
        assert!(is_worth_dividing(6, ms(3), ms(1)));
        assert!(is_worth_dividing(2, ms(5), ms(5)));
        assert!(!is_worth_dividing(1, ms(1), ms(9)));
        assert!(!is_worth_dividing(0, ms(1), ms(9)));
    }
}
