//! What the service takes beside the bare solver: the same sweep by REST, from its submission until its table
//! is there, and in this process with nothing around the solver, in turn. And how the service answers meanwhile.

use super::median;
use super::process::{Process, processor_s};
use super::tables::{self, Table};
use crate::client::Client;
use crate::domain::document::Document;
use crate::domain::status::Status;
use crate::domain::sweep::{Limits, SweepSpec};
use crate::worker::NICENESS;
use crate::worker::walk::{Tasks, Way, walk};
use anyhow::{Context, ensure};
use indicatif::ProgressBar;
use serde::Serialize;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fmt;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, mpsc};
use std::time::{Duration, Instant};
use tempfile::TempDir;
use tokio_util::sync::CancellationToken;

/// What is measured.
#[derive(Debug, Clone, Copy)]
pub struct Request {
    /// Pairs of service and bare solver.
    pub pairs: usize,
    /// Melt rates, and as many widths.
    pub runs_per_side: usize,
    /// Transients of three years; none are measured if 0.
    pub transients: usize,
    /// Threads that solve; one thread is measured besides.
    pub threads: usize,
}

impl Request {
    /// Number of measurements.
    pub fn steps(&self) -> u64 {
        2 * (self.counts().len() * self.pairs) as u64 + 1 + u64::from(self.transients > 0)
    }

    /// The numbers of threads.
    fn counts(&self) -> Vec<usize> {
        if self.threads > 1 { vec![self.threads, 1] } else { vec![1] }
    }
}

/// Pause between two questions of who watches a service at work.
const ASK_EVERY: Duration = Duration::from_millis(10);
/// Transients of one mean.
const TRANSIENTS_OF_A_MEAN: usize = 20;
/// Their length and their steps, a.
const TRANSIENT_A: f64 = 3.0;
const STEP_A: f64 = 0.01;

/// Seconds that a sweep took by REST.
#[derive(Debug, Clone, Copy, Default, Serialize)]
pub struct Taken {
    /// Until its submission was answered.
    pub submitted: f64,
    /// From there until it was complete.
    pub solved: f64,
    /// From there until its table was there.
    pub downloaded: f64,
}

impl Taken {
    fn whole(&self) -> f64 {
        self.submitted + self.solved + self.downloaded
    }
}

/// Service and bare solver with as many threads.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Side {
    /// Threads that solve.
    pub threads: usize,
    /// What each sweep took by REST, s.
    pub service: Vec<Taken>,
    /// What the bare solver took each time, s.
    pub bare: Vec<f64>,
    /// Processor time of the service, from its start until the table was there, s.
    pub service_processor: Vec<f64>,
    /// Processor time of the bare solver, s. Other than the time on the clock, it hardly depends on what else
    /// the machine does.
    pub bare_processor: Vec<f64>,
}

impl Side {
    fn service_s(&self) -> f64 {
        median(self.service.iter().map(Taken::whole).collect())
    }

    fn bare_s(&self) -> f64 {
        median(self.bare.clone())
    }

    /// The medians over the pairs of how many times as long the service takes: by the clock, by the
    /// processor.
    fn ratios(&self) -> [f64; 2] {
        let clock = self.service.iter().zip(&self.bare).map(|(s, b)| s.whole() / b);
        let processor = self.service_processor.iter().zip(&self.bare_processor);
        [median(clock.collect()), median(processor.map(|(s, b)| s / b).collect())]
    }
}

/// How long answers took, ms.
#[derive(Debug, Clone, Copy, Default, Serialize)]
pub struct Answers {
    /// How many.
    pub count: usize,
    /// Half of them took at most so long.
    pub median_ms: f64,
    /// 99 of 100 took at most so long.
    pub p99_ms: f64,
    /// The slowest.
    pub max_ms: f64,
}

/// A service at work while it is asked.
#[derive(Debug, Clone, Copy, Default, Serialize)]
pub struct Watched {
    /// What the sweep took.
    pub taken: Taken,
    /// `GET /health`.
    pub health: Answers,
    /// A page of 100 runs of the sweep under way.
    pub page: Answers,
}

/// Transients by REST.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Transients {
    /// How many.
    pub runs: usize,
    /// Time until the last one was stored, s.
    pub seconds: f64,
    /// Bytes in files by table, and of the database.
    pub bytes: BTreeMap<String, u64>,
}

/// What was measured.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Report {
    /// Steady runs of a sweep.
    pub runs: usize,
    /// Pairs by number of threads.
    pub sides: Vec<Side>,
    /// With all threads and somebody who asks.
    pub watched: Watched,
    /// Most memory that the service had, bytes.
    pub peak_bytes: u64,
    /// Bytes of the downloaded table of runs.
    pub table_bytes: usize,
    /// Bytes in files by table, and of the database.
    pub bytes: BTreeMap<String, u64>,
    /// Transients, if they were asked for.
    pub transients: Option<Transients>,
}

/// Measures.
pub fn run(request: &Request, bar: &ProgressBar) -> anyhow::Result<Report> {
    let document = steady(request.runs_per_side);
    let sweep = Arc::new(Document::parse(&document)?.into_sweep(&Limits::MOST)?);
    let mut report = Report { runs: sweep.count(), ..Report::default() };
    report.sides =
        request.counts().iter().map(|n| Side { threads: *n, ..Side::default() }).collect();
    for _ in 0..request.pairs {
        for side in &mut report.sides {
            let service = Service::start(side.threads)?;
            let (id, mut taken) = service.solve(&document)?;
            let begin = Instant::now();
            let table = service.process.client.download(&format!("/sweeps/{id}/runs.parquet"))?;
            taken.downloaded = begin.elapsed().as_secs_f64();
            side.service_processor.push(service.process.processor_s());
            report.table_bytes = table.len();
            let fault = tables::fault_of_runs(&Table::read(table)?, sweep.count() as i64)?;
            ensure!(fault.is_none(), "the table is not whole: {}", fault.unwrap_or_default());
            side.service.push(taken);
            report.peak_bytes = report.peak_bytes.max(service.process.peak_bytes());
            service.end()?;
            bar.inc(1);
            let before = processor_s("self");
            side.bare.push(bare(&sweep, side.threads)?);
            side.bare_processor.push(processor_s("self") - before);
            bar.inc(1);
        }
    }
    let service = Service::start(request.threads)?;
    report.watched = watched(&service, &document)?;
    report.bytes = service.end()?;
    bar.inc(1);
    if request.transients > 0 {
        report.transients = Some(transients(request)?);
        bar.inc(1);
    }
    Ok(report)
}

/// The sweep: melt rates by widths.
fn steady(side: usize) -> String {
    json!({
        "name": "throughput", "regime": "steady",
        "axes": [
            {"parameter": "melt_rate_m_per_day", "linspace": [0.5, 1.0, side]},
            {"parameter": "width_m", "linspace": [3500.0, 4500.0, side]},
        ],
    })
    .to_string()
}

/// A service with a data directory of its own.
struct Service {
    process: Process,
    folder: TempDir,
}

impl Service {
    fn start(threads: usize) -> anyhow::Result<Self> {
        let folder = tempfile::tempdir().context("no temporary folder")?;
        let workers = ["--workers".to_owned(), threads.to_string()];
        let process =
            Process::start(&folder.path().join("data"), &workers, &folder.path().join("log"))?;
        Ok(Self { process, folder })
    }

    /// Submits a sweep and waits until it is complete; its id and the time it took.
    fn solve(&self, document: &str) -> anyhow::Result<(String, Taken)> {
        let begin = Instant::now();
        let id = self.submit(document)?;
        let submitted = begin.elapsed().as_secs_f64();
        self.wait(&id)?;
        let solved = begin.elapsed().as_secs_f64() - submitted;
        Ok((id, Taken { submitted, solved, downloaded: 0.0 }))
    }

    fn submit(&self, document: &str) -> anyhow::Result<String> {
        let taken = self.process.client.post("/sweeps", document.as_bytes())?;
        Ok(taken["id"].as_str().context("a submission without an id")?.to_owned())
    }

    /// Follows a sweep's events until it is complete; the last of them.
    fn wait(&self, id: &str) -> anyhow::Result<Value> {
        let last = self.process.client.follow(id, |_| {})?;
        ensure!(last["state"] == "complete", "the sweep does not complete: {last}");
        Ok(last)
    }

    /// Ends the service; the bytes that it leaves, by table.
    fn end(self) -> anyhow::Result<BTreeMap<String, u64>> {
        self.process.terminate()?;
        let mut bytes = BTreeMap::new();
        add_sizes(&self.folder.path().join("data"), &mut bytes)?;
        Ok(bytes)
    }
}

fn add_sizes(folder: &Path, bytes: &mut BTreeMap<String, u64>) -> anyhow::Result<()> {
    for entry in std::fs::read_dir(folder)? {
        let entry = entry?;
        if entry.file_type()?.is_dir() {
            add_sizes(&entry.path(), bytes)?;
            continue;
        }
        let name = entry.file_name().to_string_lossy().into_owned();
        let table = name.strip_suffix(".parquet").and_then(|stem| stem.rsplit('-').next());
        *bytes.entry(table.unwrap_or("database").to_owned()).or_default() +=
            entry.metadata()?.len();
    }
    Ok(())
}

/// Solves a sweep with nothing around the solver; the time it took, s.
fn bare(sweep: &Arc<SweepSpec>, threads: usize) -> anyhow::Result<f64> {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        // As the service's threads: what else runs on the machine weighs on both alike.
        .start_handler(|_| {
            rustix::process::nice(NICENESS).ok();
        })
        .build()?;
    let tasks = Arc::new(Tasks::new(threads));
    let begin = Instant::now();
    // One way through the whole sweep: a thread that has nothing to do takes half of what another has left.
    let order = sweep.visiting_order(0..sweep.count());
    let runs = order.into_iter().map(|index| (index, String::new())).collect();
    let start = Err("no run starts from another".to_owned());
    let way = Way { sweep: sweep.clone(), runs, start, stop: CancellationToken::new() };
    let (task, (send, receive)) = (tasks.begin(), mpsc::channel());
    pool.spawn(move || {
        walk(way, task, move |solved| {
            send.send(solved).ok();
        });
    });
    let runs = receive.recv()?.context("the bare solver stopped")?.runs;
    let solved = runs.iter().filter(|run| run.outcome.status == Status::Converged).count();
    let seconds = begin.elapsed().as_secs_f64();
    ensure!(solved == sweep.count(), "the bare solver solved {solved} of {} runs", sweep.count());
    Ok(seconds)
}

/// A sweep, while somebody keeps asking for other things.
fn watched(service: &Service, document: &str) -> anyhow::Result<Watched> {
    let is_over = AtomicBool::new(false);
    let begin = Instant::now();
    let id = service.submit(document)?;
    let submitted = begin.elapsed().as_secs_f64();
    let page = format!("/sweeps/{id}/runs?limit=100");
    std::thread::scope(|scope| {
        let asking = scope.spawn(|| ask(&service.process.client, &page, &is_over));
        let waited = service.wait(&id);
        is_over.store(true, Ordering::SeqCst);
        let solved = begin.elapsed().as_secs_f64() - submitted;
        let asked = asking.join().map_err(|_| anyhow::anyhow!("who asks broke off"))?;
        waited?;
        let (health, page) = asked?;
        let taken = Taken { submitted, solved, downloaded: 0.0 };
        Ok(Watched { taken, health: answers(health), page: answers(page) })
    })
}

/// Asks for the service's health and a page of runs in turn; how long the answers took, ms.
fn ask(client: &Client, page: &str, is_over: &AtomicBool) -> anyhow::Result<(Vec<f64>, Vec<f64>)> {
    let (mut health, mut pages) = (Vec::new(), Vec::new());
    while !is_over.load(Ordering::SeqCst) {
        let begin = Instant::now();
        client.health()?;
        health.push(begin.elapsed().as_secs_f64() * 1e3);
        std::thread::sleep(ASK_EVERY);
        let begin = Instant::now();
        client.download(page)?;
        pages.push(begin.elapsed().as_secs_f64() * 1e3);
        std::thread::sleep(ASK_EVERY);
    }
    Ok((health, pages))
}

fn answers(mut took_ms: Vec<f64>) -> Answers {
    took_ms.sort_unstable_by(f64::total_cmp);
    let at = |share: f64| {
        let rank = (share * took_ms.len() as f64).ceil() as usize;
        took_ms.get(rank.saturating_sub(1)).copied().unwrap_or_default()
    };
    Answers { count: took_ms.len(), median_ms: at(0.5), p99_ms: at(0.99), max_ms: at(1.0) }
}

/// Transients of several mean melt rates, by REST.
fn transients(request: &Request) -> anyhow::Result<Transients> {
    let service = Service::start(request.threads)?;
    let runs = request.transients;
    let means = runs.div_ceil(TRANSIENTS_OF_A_MEAN);
    let begin = Instant::now();
    let mut ids = Vec::new();
    for mean in 0..means {
        let melt = 0.6 + 0.3 * mean as f64 / means as f64;
        let widths = TRANSIENTS_OF_A_MEAN.min(runs - mean * TRANSIENTS_OF_A_MEAN);
        let sinusoid = json!({"mean": melt, "amplitude": 0.2, "period_a": 1.0});
        let document = json!({
            "name": format!("melt {melt}"), "regime": "transient", "start": "steady",
            "parameters": {"melt_rate_m_per_day": melt},
            "forcing": {"melt_rate_m_per_day": {"sinusoid": sinusoid}},
            "time": {"duration_a": TRANSIENT_A, "fixed_dt_a": STEP_A},
            "axes": [{"parameter": "width_m", "linspace": [3500.0, 4500.0, widths.max(2)]}],
        });
        ids.push(service.submit(&document.to_string())?);
    }
    let mut solved = 0;
    for id in &ids {
        let counts = &service.wait(id)?["counts"];
        solved += counts["total"].as_u64().unwrap_or_default() as usize;
        ensure!(counts["completed"] == counts["total"], "transients did not complete: {counts}");
    }
    let seconds = begin.elapsed().as_secs_f64();
    Ok(Transients { runs: solved, seconds, bytes: service.end()? })
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let runs = self.runs as f64;
        writeln!(f, "{} steady runs by REST, until their table is there", self.runs)?;
        for side in &self.sides {
            let (service, bare) = (side.service_s(), side.bare_s());
            let [clock, processor] = side.ratios();
            let part = |of: fn(&Taken) -> f64| median(side.service.iter().map(of).collect());
            writeln!(
                f,
                "{} threads: service {service:.2} s ({:.0} runs/s), bare solver {bare:.2} s ({:.0} runs/s), \
                 ratio {clock:.3}; submission {:.3} s, solving {:.2} s, table {:.3} s; \
                 processor time {:.2} s, bare solver {:.2} s, ratio {processor:.3}",
                side.threads,
                runs / service,
                runs / bare,
                part(|t| t.submitted),
                part(|t| t.solved),
                part(|t| t.downloaded),
                median(side.service_processor.clone()),
                median(side.bare_processor.clone()),
            )?;
        }
        if let [all, one] = self.sides.as_slice() {
            writeln!(
                f,
                "{} threads are {:.2} times as fast as one (bare solver: {:.2})",
                all.threads,
                one.service_s() / all.service_s(),
                one.bare_s() / all.bare_s(),
            )?;
        }
        let Watched { taken, health, page } = &self.watched;
        writeln!(
            f,
            "asked every {} ms meanwhile ({:.2} s):",
            ASK_EVERY.as_millis(),
            taken.whole()
        )?;
        for (name, a) in [("health", health), ("page", page)] {
            writeln!(
                f,
                "  {name:<8} median {:.2} ms, 99 of 100 within {:.2} ms, slowest {:.2} ms ({} answers)",
                a.median_ms, a.p99_ms, a.max_ms, a.count
            )?;
        }
        let mb = |bytes: u64| bytes as f64 / 1e6;
        let sizes = |bytes: &BTreeMap<String, u64>| {
            let each = bytes.iter().map(|(table, n)| format!("{table} {:.2} MB", mb(*n)));
            each.collect::<Vec<_>>().join(", ")
        };
        writeln!(
            f,
            "peak memory {:.0} MB; downloaded table {:.2} MB; on disk {}",
            mb(self.peak_bytes),
            self.table_bytes as f64 / 1e6,
            sizes(&self.bytes)
        )?;
        if let Some(Transients { runs, seconds, bytes }) = &self.transients {
            let (rate, on_disk) = (*runs as f64 / seconds, sizes(bytes));
            writeln!(
                f,
                "{runs} transients of {TRANSIENT_A} a in steps of {STEP_A} a: {seconds:.2} s ({rate:.1} runs/s); on disk {on_disk}"
            )?;
        }
        Ok(())
    }
}
