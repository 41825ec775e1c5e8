//! `melange serve` and `melange demo`: the service on an address of this machine.

use crate::domain::document::Document;
use crate::http::{self, Service};
use crate::queue;
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
    let workers = Workers::new(store.clone(), threads(arguments.workers), wake.clone()).await?;
    let service = Service { store: store.clone(), wake, workers: workers.threads() };
    if demo && queue::sweeps(&mut *store.read().await?, 1, 0).await?.1 == 0 {
        let sweep = Arc::new(Document::parse(MELT_SWEEP)?.into_sweep()?);
        queue::enqueue(&store, &sweep, service.workers).await?;
    }
    let stop = CancellationToken::new();
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
