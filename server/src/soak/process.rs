//! The service as a process of its own: started, asked, listened to, ended one way or the other.

use crate::client::Client;
use crate::faults::STOPPED_AT;
use anyhow::{Context, bail, ensure};
use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Longest wait for an answer; a service that is busy answers within a second.
const LONGEST: Duration = Duration::from_secs(20);
/// Longest wait for an end that was asked for.
const LONGEST_END: Duration = Duration::from_secs(60);

/// A running service.
#[derive(Debug)]
pub struct Process {
    child: Child,
    /// What asks it.
    pub client: Client,
    stopped: Arc<AtomicBool>,
}

impl Process {
    /// Starts `melange serve` on a data directory and waits until it listens; its log is added to a file.
    pub fn start(data: &Path, more: &[String], log: &Path) -> anyhow::Result<Self> {
        let log = File::options().create(true).append(true).open(log).context("no log")?;
        let mut child = Command::new(std::env::current_exe()?)
            .args(["serve", "--listen", "127.0.0.1:0", "--data"])
            .arg(data)
            .args(more)
            .env("RUST_LOG", "info")
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(log)
            .spawn()
            .context("the service cannot be started")?;
        let mut said = BufReader::new(child.stdout.take().context("its output is not piped")?);
        let stopped = Arc::new(AtomicBool::new(false));
        // A fault point may be reached before the service listens.
        let mut line = String::new();
        loop {
            line.clear();
            if said.read_line(&mut line)? == 0 {
                let status = child.wait()?;
                bail!("the service did not start: {status}");
            }
            if line.starts_with(STOPPED_AT) {
                stopped.store(true, Ordering::SeqCst);
            } else if line.contains("listens on") {
                break;
            }
        }
        let address = line.trim().rsplit(' ').next().unwrap_or_default().to_owned();
        let stops = stopped.clone();
        std::thread::spawn(move || {
            for line in said.lines().map_while(Result::ok) {
                if line.starts_with(STOPPED_AT) {
                    stops.store(true, Ordering::SeqCst);
                }
            }
        });
        Ok(Self { child, client: Client::impatient(address, LONGEST), stopped })
    }

    /// Whether it has stopped at its fault point.
    pub fn has_stopped(&self) -> bool {
        self.stopped.load(Ordering::SeqCst)
    }

    /// Whether it is still there.
    pub fn is_alive(&mut self) -> bool {
        matches!(self.child.try_wait(), Ok(None))
    }

    /// Ends it at once, as a power cut of the process would (SIGKILL).
    pub fn kill(mut self) -> anyhow::Result<()> {
        self.child.kill()?;
        self.child.wait()?;
        Ok(())
    }

    /// Asks it to end (SIGTERM), which it is to do well.
    pub fn terminate(mut self) -> anyhow::Result<()> {
        let id = Pid::from_raw(self.child.id() as i32).context("a process has an id")?;
        kill_process(id, Signal::TERM)?;
        let begin = Instant::now();
        loop {
            if let Some(status) = self.child.try_wait()? {
                ensure!(status.success(), "the service ended with {status} when asked to end");
                return Ok(());
            }
            ensure!(begin.elapsed() < LONGEST_END, "the service does not end when asked to");
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    /// Processor time it has taken so far, s; 0 where the system does not tell.
    pub fn processor_s(&self) -> f64 {
        processor_s(&self.child.id().to_string())
    }

    /// The most memory it has had, bytes; 0 where the system does not tell.
    pub fn peak_bytes(&self) -> u64 {
        let status = std::fs::read_to_string(format!("/proc/{}/status", self.child.id()));
        let status = status.unwrap_or_default();
        let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
        let kib = line.and_then(|text| text.split_whitespace().next()?.parse::<u64>().ok());
        kib.unwrap_or_default() * 1024
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        self.child.kill().ok();
        self.child.wait().ok();
    }
}

/// Processor time that a process (`self` for this one) has taken so far, s; 0 where the system does not tell.
pub fn processor_s(process: &str) -> f64 {
    /// Ticks per second in which Linux tells it.
    const TICKS: f64 = 100.0;
    let told = std::fs::read_to_string(format!("/proc/{process}/stat")).unwrap_or_default();
    // After the name, which may hold anything in its brackets: fields 12 and 13 are user's and system's.
    let fields = told.rsplit(')').next().unwrap_or_default();
    let ticks = fields.split_whitespace().skip(11).take(2).filter_map(|t| t.parse::<f64>().ok());
    ticks.sum::<f64>() / TICKS
}

/// What `melange verify` finds in a data directory that nobody uses.
pub fn verify(data: &Path) -> anyhow::Result<Value> {
    let output = Command::new(std::env::current_exe()?)
        .args(["verify", "--format", "json", "--data"])
        .arg(data)
        .output()
        .context("`melange verify` cannot be started")?;
    serde_json::from_slice(&output.stdout).with_context(|| {
        format!("`melange verify` found nothing: {}", String::from_utf8_lossy(&output.stderr))
    })
}
