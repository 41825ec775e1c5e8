//! `melange serve` and `melange demo`: the service on an address of this machine.

use crate::domain::document::Document;
use crate::domain::sweep::{Limits, MOST_RUNS};
use crate::faults::{FaultPoint, Faults};
use crate::http::{self, Service};
use crate::queue::{self, Submission};
use crate::store::Store;
use crate::worker::Workers;
use anyhow::{Context, bail};
use std::net::SocketAddr;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use tokio::net::TcpListener;
use tokio::sync::Notify;
use tokio_util::sync::CancellationToken;

/// Arguments of `melange serve` and `melange demo`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Data directory.
    #[arg(long, default_value = "melange-data")]
    pub data: PathBuf,
    /// Address to listen on; loopback only. Port 0 takes a free one.
    #[arg(long, default_value = "127.0.0.1:8080")]
    pub listen: SocketAddr,
    /// Threads that solve; all of the machine's if not given.
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub workers: Option<u16>,
    /// Most runs of a sweep.
    #[arg(long, default_value_t = Limits::default().max_runs, value_parser = runs)]
    max_runs: usize,
    /// Largest submission taken, MiB.
    #[arg(long, default_value_t = (http::MOST_BYTES >> 20) as u32, value_parser = clap::value_parser!(u32).range(1..=4096))]
    max_body_mib: u32,
    /// Where to stop so that a soak can kill the process there.
    #[arg(long, hide = true)]
    fault: Option<FaultPoint>,
}

fn runs(text: &str) -> Result<usize, String> {
    let runs = text.parse().ok().filter(|n| (1..=MOST_RUNS).contains(n));
    runs.ok_or_else(|| format!("permitted are from 1 to {MOST_RUNS} runs"))
}

/// Exit code of a process interrupted twice.
const INTERRUPTED: i32 = 130;

/// The paper's melt sweep (Fig. 5) at 51 points, which `demo` queues.
const MELT_SWEEP: &str = include_str!("../../../examples/melt-sweep.toml");

/// The number of threads asked for, or of the machine's cores.
pub fn threads(asked: Option<u16>) -> usize {
    asked.map_or_else(|| std::thread::available_parallelism().map_or(1, |n| n.get()), usize::from)
}

/// Serves until interrupted; with `demo`, queues the paper's melt sweep if the archive is empty.
pub async fn main(arguments: &Arguments, demo: bool) -> anyhow::Result<ExitCode> {
    if !arguments.listen.ip().is_loopback() {
        bail!(
            "listening on {} is refused: beyond loopback it would need tokens, which are not there yet",
            arguments.listen
        );
    }
    let store = Store::open(&arguments.data).await?;
    let listener = TcpListener::bind(arguments.listen)
        .await
        .with_context(|| format!("cannot listen on {}", arguments.listen))?;
    let address = format!("http://{}", listener.local_addr()?);
    store.announce(&address).context("cannot write the lock file")?;

    let wake = Arc::new(Notify::new());
    let faults = arguments.fault.map_or_else(Faults::default, Faults::at);
    let threads = threads(arguments.workers);
    let workers = Workers::new(store.clone(), threads, wake.clone(), faults).await?;
    let limits = Limits { max_runs: arguments.max_runs };
    let most_bytes = (arguments.max_body_mib as usize) << 20;
    let stop = CancellationToken::new();
    let (held, stopping) = (store.clone(), stop.clone());
    let service =
        Service { store: held, wake, workers: threads, limits, most_bytes, stop: stopping };
    if demo && queue::health(&mut *store.read().await?).await? == 0 {
        let sweep = Arc::new(Document::parse(MELT_SWEEP)?.into_sweep(&limits)?);
        let submission = Submission { workers: threads, ..Submission::default() };
        queue::enqueue(&store, &sweep, submission).await?;
    }
    let working = tokio::spawn(workers.work(stop.clone()));
    println!("melange listens on {address}");
    let interrupted = stop.clone();
    tokio::spawn(async move {
        interruption().await;
        interrupted.cancel();
        // Whoever asks a second time does not want to wait.
        interruption().await;
        std::process::exit(INTERRUPTED);
    });
    axum::serve(listener, http::router(service))
        .with_graceful_shutdown(async move { stop.cancelled().await })
        .await
        .context("the server broke off")?;
    working.await.context("the workers broke off")?;
    store.close().await;
    Ok(ExitCode::SUCCESS)
}

async fn interruption() {
    use tokio::signal::unix::{SignalKind, signal};
    let terminate = async {
        match signal(SignalKind::terminate()) {
            Ok(mut signal) => {
                signal.recv().await;
            }
            Err(_) => std::future::pending().await,
        }
    };
    tokio::select! {
        _ = tokio::signal::ctrl_c() => {}
        () = terminate => {}
    }
}
