//! `melange sweep`: a whole sweep, solved here into a data directory.

use super::run::read;
use super::serve::threads;
use crate::archive::start;
use crate::domain::document::Document;
use crate::domain::refusal::Refusal;
use crate::queue;
use crate::store::Store;
use crate::worker::Workers;
use anyhow::Context;
use indicatif::{ProgressBar, ProgressStyle};
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::Notify;
use tokio_util::sync::CancellationToken;

/// Arguments of `melange sweep`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// File with the sweep, JSON if its first character is `{`, else TOML; `-` is standard input.
    spec: String,
    /// Data directory.
    #[arg(long, default_value = "melange-data")]
    data: PathBuf,
    /// Threads that solve; all of the machine's if not given.
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=1024))]
    workers: Option<u16>,
}

/// Pause between two looks at the sweep.
const LOOK_EVERY: Duration = Duration::from_millis(100);
/// Exit code of bad input.
const REFUSED: u8 = 2;

/// Queues the sweep and works until every run has ended.
pub async fn main(arguments: &Arguments) -> anyhow::Result<ExitCode> {
    let text = read(&arguments.spec)?;
    let refused = |refusal: Refusal| {
        eprintln!("refused: {refusal}");
        Ok(ExitCode::from(REFUSED))
    };
    let sweep = match Document::parse(&text).and_then(Document::into_sweep) {
        Ok(sweep) => Arc::new(sweep),
        Err(refusal) => return refused(refusal),
    };
    let store = Store::open(&arguments.data).await?;
    if let Err(refusal) = start::check(&store, &sweep).await? {
        return refused(refusal);
    }
    let workers =
        Workers::new(store.clone(), threads(arguments.workers), Arc::new(Notify::new())).await?;
    let id = queue::enqueue(&store, &sweep, workers.threads()).await?;
    let stop = CancellationToken::new();
    let working = tokio::spawn(workers.work(stop.clone()));
    let bar = ProgressBar::new(sweep.count() as u64).with_style(
        ProgressStyle::with_template("{bar:40} {pos}/{len} runs, {per_sec}, {eta} left")
            .context("the bar's template is wrong")?,
    );
    let counts = loop {
        let row = queue::sweep(&mut *store.read().await?, &id)
            .await?
            .context("the sweep is gone from the data directory")?;
        bar.set_position(row.counts.ended() as u64);
        if row.counts.ended() == row.counts.total {
            break row.counts;
        }
        tokio::time::sleep(LOOK_EVERY).await;
    };
    bar.finish();
    stop.cancel();
    working.await.context("the workers broke off")?;
    store.close().await;
    println!("{}", serde_json::json!({ "id": id, "counts": counts }));
    Ok(ExitCode::SUCCESS)
}
