//! `melange serve` and `melange demo`: the service on an address of this machine.

use crate::domain::document::Document;
use crate::domain::person::Actor;
use crate::domain::sweep::{Limits, MOST_RUNS};
use crate::faults::{FaultPoint, Faults};
use crate::http::{self, Service};
use crate::people;
use crate::queue::{self, Submission};
use crate::store::Store;
use crate::worker::{self, Workers};
use anyhow::{Context, bail};
use std::net::SocketAddr;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Duration;
use tokio::net::TcpListener;
use tokio::sync::Notify;
use tokio_util::sync::CancellationToken;

/// Arguments of `melange serve` and `melange demo`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Data directory.
    #[arg(long, default_value = "melange-data")]
    pub data: PathBuf,
    /// Address to listen on; beyond loopback only when there are people (`melange user`). Port 0 takes a free
    /// one.
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
    /// Days for which deleted sweeps lie in the trash and can be recovered.
    #[arg(long, value_name = "DAYS", default_value_t = (worker::KEPT.as_secs() / DAY.as_secs()) as u32)]
    keep_deleted_days: u32,
    /// Name of this host, beside localhost, that a service without people answers to: behind a proxy, say. May
    /// be given several times.
    #[arg(long, value_name = "NAME")]
    host: Vec<String>,
    /// Browsers reach the service by https, through a proxy: their cookies are not sent without it.
    #[arg(long)]
    https: bool,
    /// Seconds that requests under way are given to end when the service is told to end.
    #[arg(long, default_value_t = 10, value_parser = clap::value_parser!(u32).range(0..=3600))]
    grace_s: u32,
    /// Largest archive taken by an import, MiB.
    #[arg(long, default_value_t = http::MOST_ARCHIVE_BYTES >> 20, value_parser = clap::value_parser!(u64).range(1..=1 << 24))]
    max_import_mib: u64,
    /// Where to stop so that a soak can kill the process there.
    #[arg(long, hide = true)]
    fault: Option<FaultPoint>,
}

fn runs(text: &str) -> Result<usize, String> {
    let runs = text.parse().ok().filter(|n| (1..=MOST_RUNS).contains(n));
    runs.ok_or_else(|| format!("permitted are from 1 to {MOST_RUNS} runs"))
}

/// A day.
const DAY: Duration = Duration::from_secs(24 * 3600);
/// Exit code of a process interrupted twice.
const INTERRUPTED: i32 = 130;

/// Longest wait for the connections to the database, when all work has ended.
const LONGEST_CLOSE: Duration = Duration::from_secs(2);

/// The paper's melt sweep (Fig. 5) at 51 points, which `demo` queues.
const MELT_SWEEP: &str = include_str!("../../../examples/melt-sweep.toml");

/// The number of threads asked for, or of the machine's cores.
pub fn threads(asked: Option<u16>) -> usize {
    asked.map_or_else(|| std::thread::available_parallelism().map_or(1, |n| n.get()), usize::from)
}

/// Serves until interrupted; with `demo`, queues the paper's melt sweep if the archive is empty.
pub async fn main(arguments: &Arguments, demo: bool) -> anyhow::Result<ExitCode> {
    let stop = CancellationToken::new();
    // From the beginning: who is told to end while it brings a database up to date ends when that is done, also
    // as the first process of a container, which no signal ends by itself.
    let interrupted = stop.clone();
    tokio::spawn(async move {
        interruption().await;
        interrupted.cancel();
        // Whoever asks a second time does not want to wait.
        interruption().await;
        std::process::exit(INTERRUPTED);
    });
    let store = Store::open(&arguments.data).await?;
    let is_peopled = people::exist(&mut *store.read().await?).await?;
    if !arguments.listen.ip().is_loopback() && !is_peopled {
        bail!(
            "listening on {} is refused: beyond loopback a service needs people with tokens; add the first one \
             with `melange user add NAME --role admin --data {}`",
            arguments.listen,
            arguments.data.display()
        );
    }
    let listener = TcpListener::bind(arguments.listen)
        .await
        .with_context(|| format!("cannot listen on {}", arguments.listen))?;
    let address = format!("http://{}", listener.local_addr()?);
    let operator = people::secret();
    store.leave_token(&operator).context("cannot leave a token for commands on this machine")?;
    store.announce(&address).context("cannot write the lock file")?;

    let wake = Arc::new(Notify::new());
    let faults = arguments.fault.map_or_else(Faults::default, Faults::at);
    let threads = threads(arguments.workers);
    let workers = Workers::new(store.clone(), threads, wake.clone(), faults).await?;
    let workers = workers.keeping(DAY * arguments.keep_deleted_days);
    let limits = Limits { max_runs: arguments.max_runs };
    let most_bytes = (arguments.max_body_mib as usize) << 20;
    let service = Service {
        wake,
        limits,
        most_bytes,
        most_archive_bytes: arguments.max_import_mib << 20,
        stop: stop.clone(),
        operator: Some(people::hash(&operator).into()),
        hosts: arguments.host.clone().into(),
        is_https: arguments.https,
        ..Service::new(store.clone(), threads)
    };
    if demo && queue::health(&mut *store.read().await?).await? == 0 {
        let sweep = Arc::new(Document::parse(MELT_SWEEP)?.into_sweep(&limits)?);
        let submission =
            Submission { workers: threads, owner: Actor::operator().name, ..Submission::default() };
        queue::enqueue(&store, &sweep, submission).await?;
    }
    let working = tokio::spawn(workers.work(stop.clone()));
    println!("melange listens on {address}");
    let router = http::router(service).into_make_service_with_connect_info::<SocketAddr>();
    let stopped = stop.clone();
    let serving = axum::serve(listener, router)
        .with_graceful_shutdown(async move { stopped.cancelled().await });
    let grace = Duration::from_secs(arguments.grace_s.into());
    tokio::select! {
        served = serving.into_future() => served.context("the server broke off")?,
        () = after(&stop, grace) => {
            tracing::warn!("cuts off requests that have not ended {} s after the service was told to end", arguments.grace_s);
        }
    }
    working.await.context("the workers broke off")?;
    // A request that was cut off may hold a connection for reading, which loses nothing.
    tokio::time::timeout(LONGEST_CLOSE, store.close()).await.ok();
    tracing::info!("ends as it was told to");
    Ok(ExitCode::SUCCESS)
}

/// A time after the process was told to end.
async fn after(stop: &CancellationToken, time: Duration) {
    stop.cancelled().await;
    tokio::time::sleep(time).await;
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
