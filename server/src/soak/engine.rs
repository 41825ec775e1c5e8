//! Kills the service, at the steps of its commits and at random moments, and tells what did not survive:
//! every run once, every table whole, nothing left over. Knows the service from outside only.

use super::process::{Process, verify};
use super::shapes::{Shape, shape};
use super::tables::{self, Table};
use super::{Numbers, median};
use crate::faults::{FaultPoint, Step};
use anyhow::Context;
use indicatif::ProgressBar;
use serde::Serialize;
use serde_json::Value;
use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// What a soak is asked for.
#[derive(Debug, Clone)]
pub struct Request {
    /// Kills.
    pub kills: u32,
    /// Seed of moments, passings and parameters.
    pub seed: u64,
    /// Data directory, new or of an earlier soak.
    pub data: PathBuf,
}

/// Sweeps under way at the same time.
const AT_ONCE: usize = 2;
/// Of five kills, so many are at fault points.
const AT_POINTS_OF_FIVE: u32 = 3;
/// The last passing of a step at which it is stopped.
const LATEST_PASSING: u32 = 5;
/// Random kills come within so many chunk times of the first lease.
const CHUNK_TIMES: f64 = 3.0;
/// Pause between two looks.
const LOOK_EVERY: Duration = Duration::from_millis(5);
/// Longest wait for a fault point, for a sweep, or for a service to be heard again.
const LONGEST: Duration = Duration::from_secs(120);
/// How soon a service that does not answer says that it has stopped.
const SOON: Duration = Duration::from_secs(1);

/// What a soak came to.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Report {
    /// Kills.
    pub kills: u32,
    /// Seed.
    pub seed: u64,
    /// Kills at each step of a commit.
    pub at_step: BTreeMap<&'static str, u32>,
    /// Kills at random moments, by what the sweeps were doing at the last look before.
    pub at_random: BTreeMap<&'static str, u32>,
    /// Files that nobody listed, found after kills: temporary ones, those of chunks, those put together.
    pub orphans: BTreeMap<&'static str, usize>,
    /// Kills that left such files.
    pub kills_with_orphans: u32,
    /// Median time between two commits, ms.
    pub chunk_ms: f64,
    /// Sweeps that were completed.
    pub sweeps: usize,
    /// Runs stored for them.
    pub runs: i64,
    /// Those of them that were taken over from other sweeps.
    pub reused: i64,
    /// Time it took, s.
    pub seconds: f64,
    /// What was wrong; nothing should be.
    pub wrong: Vec<String>,
}

impl Report {
    /// Whether nothing was wrong.
    pub fn is_clean(&self) -> bool {
        self.wrong.is_empty()
    }
}

/// A sweep that was submitted.
struct Sweep {
    id: String,
    shape: Shape,
}

struct Soak {
    request: Request,
    log: PathBuf,
    submitted: u64,
    open: Vec<Sweep>,
    done: Vec<Sweep>,
    report: Report,
}

/// Kills and tells.
pub fn run(request: Request, bar: &ProgressBar) -> anyhow::Result<Report> {
    let begin = Instant::now();
    let folder = tempfile::tempdir().context("no temporary folder for the service's log")?;
    let report = Report { kills: request.kills, seed: request.seed, ..Report::default() };
    let log = folder.path().join("log");
    let mut soak = Soak { request, log, submitted: 0, open: Vec::new(), done: Vec::new(), report };
    if let Err(error) = soak.whole(bar) {
        soak.wrong(format!("the soak broke off: {error:#}"));
    }
    soak.read_log();
    soak.report.seconds = begin.elapsed().as_secs_f64();
    Ok(soak.report)
}

impl Soak {
    fn wrong(&mut self, sentence: String) {
        tracing::error!("{sentence}");
        self.report.wrong.push(sentence);
    }

    fn start(&self, fault: Option<FaultPoint>) -> anyhow::Result<Process> {
        let fault = fault.map(|point| vec!["--fault".to_owned(), point.to_string()]);
        Process::start(&self.request.data, &fault.unwrap_or_default(), &self.log)
    }

    fn whole(&mut self, bar: &ProgressBar) -> anyhow::Result<()> {
        let mut service = self.start(None)?;
        let chunk = self.measure(&service)?;
        self.report.chunk_ms = chunk.as_secs_f64() * 1e3;
        service.terminate()?;
        let mut points = 0;
        for kill in 0..self.request.kills {
            let mut numbers = Numbers::new(self.request.seed, u64::MAX - u64::from(kill));
            if kill % 5 < AT_POINTS_OF_FIVE {
                let step = Step::ALL[points % Step::ALL.len()];
                let point = FaultPoint { step, passing: numbers.up_to(LATEST_PASSING) };
                points += 1;
                service = self.start(Some(point))?;
                if self.until_stopped(&mut service, point)? {
                    *self.report.at_step.entry(step.name()).or_default() += 1;
                }
            } else {
                service = self.start(None)?;
                let when =
                    self.until_a_moment(&service, chunk.mul_f64(CHUNK_TIMES * numbers.next()))?;
                *self.report.at_random.entry(when).or_default() += 1;
            }
            service.kill()?;
            self.after_kill(kill)?;
            bar.inc(1);
        }
        self.end()
    }

    /// The median time between two commits of a sweep that nobody disturbs.
    fn measure(&mut self, service: &Process) -> anyhow::Result<Duration> {
        self.submit(service)?;
        let mut ended = Vec::new();
        let mut last = 0;
        let begin = Instant::now();
        while !self.open.is_empty() {
            let id = self.open[0].id.clone();
            let sweep = service.client.get(&format!("/sweeps/{id}"))?;
            self.counts_add_up(&sweep);
            let counts = &sweep["counts"];
            let now = count(counts, "total") - count(counts, "queued") - count(counts, "running");
            if now > last {
                (last, _) = (now, ended.push(begin.elapsed().as_secs_f64()));
            }
            if sweep["state"] == "complete" {
                self.look(service)?;
            }
            anyhow::ensure!(
                begin.elapsed() < LONGEST,
                "the first sweep does not complete: {sweep}"
            );
        }
        let gaps = ended.windows(2).map(|w| w[1] - w[0]).collect();
        Ok(Duration::from_secs_f64(median(gaps)))
    }

    fn submit(&mut self, service: &Process) -> anyhow::Result<()> {
        let shape = shape(self.request.seed, self.submitted);
        let taken = service.client.post("/sweeps", shape.document.to_string().as_bytes())?;
        let id = taken["id"].as_str().context("a submission without an id")?.to_owned();
        self.submitted += 1;
        self.open.push(Sweep { id, shape });
        Ok(())
    }

    fn counts_add_up(&mut self, sweep: &Value) {
        let counts = sweep["counts"].as_object();
        let parts: i64 = counts
            .into_iter()
            .flatten()
            .filter(|(name, _)| *name != "total")
            .filter_map(|(_, n)| n.as_i64())
            .sum();
        if Some(parts) != sweep["counts"]["total"].as_i64() {
            self.wrong(format!("the counts do not add up: {sweep}"));
        }
    }

    /// Looks at the sweeps under way, checks those that are complete, and submits others in their place.
    /// What is queued and what is running of those under way.
    fn look(&mut self, service: &Process) -> anyhow::Result<(i64, i64)> {
        let (mut queued, mut running) = (0, 0);
        let mut i = 0;
        while i < self.open.len() {
            let sweep = service.client.get(&format!("/sweeps/{}", self.open[i].id))?;
            self.counts_add_up(&sweep);
            if sweep["state"] == "complete" {
                self.check(service, i, &sweep)?;
                let done = self.open.remove(i);
                self.report.sweeps += 1;
                self.report.runs += count(&sweep["counts"], "total");
                self.report.reused += sweep["reused"].as_i64().unwrap_or_default();
                self.done.push(done);
                continue;
            }
            queued += count(&sweep["counts"], "queued");
            running += count(&sweep["counts"], "running");
            i += 1;
        }
        Ok((queued, running))
    }

    /// Checks a complete sweep: every run once, and every table whole. An error is a service that does not
    /// answer, which is what it is killed for; what is wrong is noted.
    fn check(&mut self, service: &Process, open: usize, sweep: &Value) -> anyhow::Result<()> {
        let found = faults(service, &self.open[open], sweep)?;
        found.into_iter().for_each(|fault| self.wrong(fault));
        Ok(())
    }

    /// Keeps the service busy until it stops at its fault point; whether it did.
    fn until_stopped(&mut self, service: &mut Process, point: FaultPoint) -> anyhow::Result<bool> {
        let begin = Instant::now();
        while !service.has_stopped() {
            if begin.elapsed() > LONGEST {
                self.wrong(format!("the service never came to its fault point {point}"));
                return Ok(false);
            }
            let kept_busy = (|| {
                while self.open.len() < AT_ONCE {
                    self.submit(service)?;
                }
                self.look(service)
            })();
            if let Err(error) = kept_busy {
                self.unheard(service, &error)?;
            }
            std::thread::sleep(LOOK_EVERY);
        }
        Ok(true)
    }

    /// A service that does not answer has stopped, or something is wrong.
    fn unheard(&mut self, service: &mut Process, error: &anyhow::Error) -> anyhow::Result<()> {
        let begin = Instant::now();
        while begin.elapsed() < SOON {
            if service.has_stopped() {
                return Ok(());
            }
            std::thread::sleep(LOOK_EVERY);
        }
        self.wrong(format!("the service does not answer: {error:#}"));
        anyhow::ensure!(service.is_alive(), "the service has ended by itself");
        Ok(())
    }

    /// Waits for a moment after the first lease; what the sweeps are doing then.
    fn until_a_moment(
        &mut self,
        service: &Process,
        moment: Duration,
    ) -> anyhow::Result<&'static str> {
        self.look(service)?;
        while self.open.len() < AT_ONCE {
            self.submit(service)?;
        }
        std::thread::sleep(moment);
        let (queued, running) = self.look(service)?;
        Ok(match (queued, running) {
            (_, 1..) => "under_way",
            (1.., _) => "before_a_lease",
            _ => "after_the_end",
        })
    }

    /// A killed service leaves files that nobody lists, and nothing else.
    fn after_kill(&mut self, kill: u32) -> anyhow::Result<()> {
        let findings = verify(&self.request.data)?;
        let orphans = list(&findings, "orphans");
        self.report.kills_with_orphans += u32::from(!orphans.is_empty());
        for path in orphans.iter().filter_map(Value::as_str) {
            *self.report.orphans.entry(kind_of_orphan(path)).or_default() += 1;
        }
        for kind in ["damaged", "contradictions"] {
            for finding in list(&findings, kind) {
                self.wrong(format!("after kill {}: {kind}: {finding}", kill + 1));
            }
        }
        Ok(())
    }

    /// Lets everything complete, looks at every sweep once more, ends the service and verifies.
    fn end(&mut self) -> anyhow::Result<()> {
        let service = self.start(None)?;
        let begin = Instant::now();
        while !self.open.is_empty() {
            self.look(&service)?;
            anyhow::ensure!(begin.elapsed() < LONGEST, "the last sweeps do not complete");
            std::thread::sleep(LOOK_EVERY);
        }
        let done = std::mem::take(&mut self.done);
        for known in &done {
            let sweep = service.client.get(&format!("/sweeps/{}", known.id))?;
            for fault in faults(&service, known, &sweep)? {
                self.wrong(format!("at the end: {fault}"));
            }
        }
        service.terminate()?;
        let findings = verify(&self.request.data)?;
        for kind in ["damaged", "orphans", "contradictions"] {
            for finding in list(&findings, kind) {
                self.wrong(format!("at the end: {kind}: {finding}"));
            }
        }
        Ok(())
    }

    /// What the service says is an error in its log is wrong.
    fn read_log(&mut self) {
        let log = std::fs::read_to_string(&self.log).unwrap_or_default();
        for line in log.lines().filter(|l| l.contains(" ERROR ") || l.contains("panicked at")) {
            self.wrong(format!("the service's log says: {line}"));
        }
    }
}

/// What is wrong with a complete sweep.
fn faults(service: &Process, known: &Sweep, sweep: &Value) -> anyhow::Result<Vec<String>> {
    let Sweep { id, shape } = known;
    let name = sweep["name"].as_str().unwrap_or_default();
    let mut wrong = Vec::new();
    let counts = &sweep["counts"];
    let total = shape.runs;
    let solved = count(counts, "converged") + count(counts, "completed");
    if sweep["state"] != "complete" || solved != total || count(counts, "total") != total {
        wrong.push(format!("sweep {id} ({name}) should have {total} solved runs: {sweep}"));
    }
    let listed = service.client.get(&format!("/sweeps/{id}/runs?limit=1"))?;
    if listed["total"].as_i64() != Some(total) {
        wrong.push(format!("sweep {id} ({name}) lists {} runs of {total}", listed["total"]));
    }
    let table = |name: &str| -> anyhow::Result<Vec<u8>> {
        service.client.download(&format!("/sweeps/{id}/{name}.parquet"))
    };
    let mut note = |name: &str, fault: anyhow::Result<Option<String>>| {
        if let Some(fault) = fault.unwrap_or_else(|error| Some(format!("{error:#}"))) {
            wrong.push(format!("{name}.parquet of sweep {id}: {fault}"));
        }
    };
    let (runs, profiles, series) = (table("runs")?, table("profiles")?, table("series")?);
    let runs = match Table::read(runs) {
        Ok(runs) => runs,
        Err(error) => {
            note("runs", Err(error));
            return Ok(wrong);
        }
    };
    note("runs", tables::fault_of_runs(&runs, total));
    note("profiles", Table::read(profiles).and_then(|t| tables::fault_of_rows(&t, &runs)));
    let sensitivities = table("sensitivities")?;
    for (name, bytes, is_there) in [
        ("series", series, shape.is_transient),
        ("sensitivities", sensitivities, !shape.is_transient),
    ] {
        let fault = Table::read(bytes).and_then(|rows| {
            if is_there {
                return tables::fault_of_rows(&rows, &runs);
            }
            let rows = rows.ids()?.len();
            Ok((rows > 0).then(|| format!("there are {rows} rows and should be none")))
        });
        note(name, fault);
    }
    Ok(wrong)
}

fn count(counts: &Value, name: &str) -> i64 {
    counts[name].as_i64().unwrap_or_default()
}

fn kind_of_orphan(path: &str) -> &'static str {
    if !path.ends_with(".parquet") {
        "temporary"
    } else if path.contains("/all-") {
        "put_together"
    } else {
        "of_chunks"
    }
}

fn list<'a>(findings: &'a Value, kind: &str) -> &'a [Value] {
    findings[kind].as_array().map(Vec::as_slice).unwrap_or_default()
}

/// Whether a folder can be soaked in: new, or empty.
pub fn is_free(data: &Path) -> bool {
    std::fs::read_dir(data).map_or(true, |mut entries| entries.next().is_none())
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { kills, seed, chunk_ms, sweeps, runs, reused, seconds, .. } = self;
        writeln!(
            f,
            "{kills} kills, seed {seed}, {seconds:.0} s, {chunk_ms:.1} ms between commits"
        )?;
        for (step, kills) in self.at_step.iter().chain(&self.at_random) {
            writeln!(f, "  {step:<16} {kills:>5}")?;
        }
        let with = self.kills_with_orphans;
        writeln!(f, "{with} kills left files that nobody listed, which the next start removed:")?;
        for (kind, files) in &self.orphans {
            writeln!(f, "  {kind:<16} {files:>5}")?;
        }
        writeln!(f, "{sweeps} sweeps complete, {runs} runs, {reused} of them taken over")?;
        for sentence in &self.wrong {
            writeln!(f, "wrong: {sentence}")?;
        }
        if self.is_clean() {
            writeln!(f, "every run once, every table whole, nothing left over")?;
        }
        Ok(())
    }
}
