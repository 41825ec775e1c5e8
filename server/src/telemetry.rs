//! What the process counts and times, for an operator's monitoring: instruments that any room may use, and their
//! text for Prometheus. Knows no room; what stands in the database or on the disk is handed to it.

use prometheus::local::LocalHistogram;
use prometheus::process_collector::ProcessCollector;
use prometheus::{
    Encoder, Histogram, HistogramOpts, HistogramVec, IntCounter, IntCounterVec, IntGauge,
    IntGaugeVec, Opts, Registry, TextEncoder,
};
use std::sync::LazyLock;
use std::time::Duration;

/// The instruments of this process; there is one set, as there is one process.
pub static TELEMETRY: LazyLock<Telemetry> = LazyLock::new(Telemetry::new);

/// Media type of the text.
pub const CONTENT_TYPE: &str = prometheus::TEXT_FORMAT;

/// Limits of the classes of times of requests and commits, s.
const SHORT_SECONDS: [f64; 13] =
    [0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 10.0, 60.0];
/// Limits of the classes of times of runs, s: a steady state beside a neighbour takes half a millisecond, a
/// calibration with samples minutes.
const RUN_SECONDS: [f64; 15] =
    [0.0002, 0.0005, 0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 10.0, 60.0, 600.0];

/// Instruments.
#[derive(Debug)]
pub struct Telemetry {
    registry: Registry,
    requests: IntCounterVec,
    request_seconds: HistogramVec,
    /// Chunks that a worker took from the queue.
    pub chunks_leased: IntCounter,
    /// Chunks that were stored.
    pub chunks_finished: IntCounter,
    /// Chunks that were given back without a result.
    pub chunks_returned: IntCounter,
    /// Attempts to store a chunk that failed.
    pub chunk_store_failures: IntCounter,
    /// Time to write and sync a chunk's files, s.
    pub chunk_write_seconds: Histogram,
    /// Time of the transaction that ends a chunk, s.
    pub chunk_commit_seconds: Histogram,
    runs_ended: IntCounterVec,
    /// Runs that were taken over from the archive.
    pub runs_reused: IntCounter,
    run_solve_seconds: Histogram,
    /// Threads that solve.
    pub worker_threads: IntGauge,
    build: IntGaugeVec,
    sweeps: IntGaugeVec,
    queue_runs: IntGaugeVec,
    archive_files: IntGauge,
    archive_bytes: IntGauge,
    database_bytes: IntGauge,
    disk_free_bytes: IntGauge,
    disk_size_bytes: IntGauge,
}

/// What stands in the data directory at the moment of a scrape.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Standing {
    /// Sweeps by the state that users see.
    pub sweeps: Vec<(&'static str, i64)>,
    /// Runs without a result, by what they wait for.
    pub queue_runs: Vec<(&'static str, i64)>,
    /// Files that the catalogue lists.
    pub archive_files: i64,
    /// Bytes of them.
    pub archive_bytes: i64,
    /// Bytes of the database with its log.
    pub database_bytes: u64,
    /// Bytes that this process may still write to the disk of the data directory.
    pub disk_free_bytes: u64,
    /// Size of that disk, bytes.
    pub disk_size_bytes: u64,
}

impl Telemetry {
    fn new() -> Self {
        let registry = Registry::new();
        registry.register(Box::new(ProcessCollector::for_self())).expect("it is the first one");
        let r = &registry;
        Self {
            requests: counters(
                r,
                "melange_http_requests_total",
                "Requests answered, by route, method and status.",
                &["route", "method", "status"],
            ),
            request_seconds: times(
                r,
                "melange_http_request_duration_seconds",
                "Time until the head of the answer was there, by route and method.",
                &["route", "method"],
            ),
            chunks_leased: counter(
                r,
                "melange_chunks_leased_total",
                "Chunks of sweeps that a worker took from the queue.",
            ),
            chunks_finished: counter(
                r,
                "melange_chunks_finished_total",
                "Chunks whose results were stored.",
            ),
            chunks_returned: counter(
                r,
                "melange_chunks_returned_total",
                "Chunks given back without a result: the service ended, or they could not be worked on.",
            ),
            chunk_store_failures: counter(
                r,
                "melange_chunk_store_failures_total",
                "Attempts to store a chunk that failed; each is repeated while the service runs.",
            ),
            chunk_write_seconds: time(
                r,
                "melange_chunk_write_seconds",
                "Time to write and sync the files of a chunk.",
                &SHORT_SECONDS,
            ),
            chunk_commit_seconds: time(
                r,
                "melange_chunk_commit_seconds",
                "Time of the transaction that ends a chunk, with its wait for the database.",
                &SHORT_SECONDS,
            ),
            runs_ended: counters(
                r,
                "melange_runs_ended_total",
                "Runs that ended, by status; those taken over from the archive included.",
                &["status"],
            ),
            runs_reused: counter(
                r,
                "melange_runs_reused_total",
                "Runs taken over from the archive while chunks were worked on.",
            ),
            run_solve_seconds: time(
                r,
                "melange_run_solve_seconds",
                "Time of a solver's thread for one run, whatever its status.",
                &RUN_SECONDS,
            ),
            worker_threads: gauge(r, "melange_worker_threads", "Threads that solve."),
            build: gauges(r, "melange_build_info", "1, with the version served.", &["version"]),
            sweeps: gauges(r, "melange_sweeps", "Sweeps, by state.", &["state"]),
            queue_runs: gauges(
                r,
                "melange_queue_runs",
                "Runs without a result: queued, running (in a chunk that a worker holds), paused (queued, in a \
                 sweep that is paused).",
                &["state"],
            ),
            archive_files: gauge(r, "melange_archive_files", "Files that the catalogue lists."),
            archive_bytes: gauge(r, "melange_archive_bytes", "Size of these files."),
            database_bytes: gauge(
                r,
                "melange_database_bytes",
                "Size of the database with its write-ahead log.",
            ),
            disk_free_bytes: gauge(
                r,
                "melange_data_disk_free_bytes",
                "Space that the service may still use on the disk of its data directory.",
            ),
            disk_size_bytes: gauge(
                r,
                "melange_data_disk_size_bytes",
                "Size of the disk of the data directory.",
            ),
            registry,
        }
    }

    /// Counts a request that was answered after a time.
    pub fn answered(&self, route: &str, method: &str, status: u16, took: Duration) {
        self.requests.with_label_values(&[route, method, &status.to_string()]).inc();
        self.request_seconds.with_label_values(&[route, method]).observe(took.as_secs_f64());
    }

    /// Counts runs that ended.
    pub fn ended(&self, status: &str, runs: u64) {
        self.runs_ended.with_label_values(&[status]).inc_by(runs);
    }

    /// Where a thread notes the times of its runs, s, which are counted together when it is dropped.
    pub fn solve_times(&self) -> LocalHistogram {
        self.run_solve_seconds.local()
    }

    /// All series as text, with what stands in the data directory.
    pub fn text(&self, standing: &Standing) -> prometheus::Result<Vec<u8>> {
        self.build.with_label_values(&[env!("CARGO_PKG_VERSION")]).set(1);
        for (state, sweeps) in &standing.sweeps {
            self.sweeps.with_label_values(&[state]).set(*sweeps);
        }
        for (state, runs) in &standing.queue_runs {
            self.queue_runs.with_label_values(&[state]).set(*runs);
        }
        self.archive_files.set(standing.archive_files);
        self.archive_bytes.set(standing.archive_bytes);
        self.database_bytes.set(whole(standing.database_bytes));
        self.disk_free_bytes.set(whole(standing.disk_free_bytes));
        self.disk_size_bytes.set(whole(standing.disk_size_bytes));
        let mut text = Vec::new();
        TextEncoder::new().encode(&self.registry.gather(), &mut text)?;
        Ok(text)
    }
}

fn whole(bytes: u64) -> i64 {
    i64::try_from(bytes).unwrap_or(i64::MAX)
}

/// Names and labels are this file's own, and each is used once.
const SOUND: &str = "a name of its own";

fn register<T: prometheus::core::Collector + Clone + 'static>(
    registry: &Registry,
    made: prometheus::Result<T>,
) -> T {
    let instrument = made.expect(SOUND);
    registry.register(Box::new(instrument.clone())).expect(SOUND);
    instrument
}

fn counter(registry: &Registry, name: &str, help: &str) -> IntCounter {
    register(registry, IntCounter::new(name, help))
}

fn counters(registry: &Registry, name: &str, help: &str, labels: &[&str]) -> IntCounterVec {
    register(registry, IntCounterVec::new(Opts::new(name, help), labels))
}

fn gauge(registry: &Registry, name: &str, help: &str) -> IntGauge {
    register(registry, IntGauge::new(name, help))
}

fn gauges(registry: &Registry, name: &str, help: &str, labels: &[&str]) -> IntGaugeVec {
    register(registry, IntGaugeVec::new(Opts::new(name, help), labels))
}

fn time(registry: &Registry, name: &str, help: &str, classes: &[f64]) -> Histogram {
    let options = HistogramOpts::new(name, help).buckets(classes.to_vec());
    register(registry, Histogram::with_opts(options))
}

fn times(registry: &Registry, name: &str, help: &str, labels: &[&str]) -> HistogramVec {
    let options = HistogramOpts::new(name, help).buckets(SHORT_SECONDS.to_vec());
    register(registry, HistogramVec::new(options, labels))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(telemetry: &Telemetry, standing: &Standing) -> String {
        let text = telemetry.text(standing).expect("instruments can be written");
        String::from_utf8(text).expect("UTF-8")
    }

    #[test]
    fn what_is_counted_is_told() {
        let telemetry = Telemetry::new();
        telemetry.answered("/health", "GET", 200, Duration::from_millis(3));
        telemetry.ended("converged", 7);
        let times = telemetry.solve_times();
        times.observe(0.003);
        times.observe(0.3);
        let before = text(&telemetry, &Standing::default());
        assert!(before.contains("melange_run_solve_seconds_count 0"), "{before}");
        drop(times);
        let standing = Standing {
            sweeps: vec![("running", 2)],
            queue_runs: vec![("queued", 30)],
            disk_free_bytes: 3 << 40,
            ..Standing::default()
        };
        let text = text(&telemetry, &standing);
        for line in [
            r#"melange_http_requests_total{method="GET",route="/health",status="200"} 1"#,
            r#"melange_http_request_duration_seconds_bucket{method="GET",route="/health",le="0.005"} 1"#,
            r#"melange_runs_ended_total{status="converged"} 7"#,
            r#"melange_run_solve_seconds_bucket{le="0.005"} 1"#,
            "melange_run_solve_seconds_count 2",
            r#"melange_sweeps{state="running"} 2"#,
            r#"melange_queue_runs{state="queued"} 30"#,
            "melange_data_disk_free_bytes 3298534883328",
        ] {
            assert!(text.lines().any(|found| found == line), "{line} is not in\n{text}");
        }
    }
}
