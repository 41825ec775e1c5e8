//! `melange sweep`: a whole sweep, solved here into a data directory, or by the service that holds it.

use super::reach::{REFUSED, Reach};
use super::run::read;
use super::serve::threads;
use crate::archive::{reuse, start};
use crate::client::{Client, Refused};
use crate::domain::document::Document;
use crate::domain::person::Actor;
use crate::domain::refusal::Refusal;
use crate::domain::status::SweepState;
use crate::domain::sweep::{Limits, SweepSpec};
use crate::faults::Faults;
use crate::http::Service;
use crate::http::submit::{dry_run, with_table};
use crate::queue::{self, Submission, SweepRow};
use crate::store::Store;
use crate::worker::Workers;
use anyhow::{Context, anyhow, bail};
use indicatif::{ProgressBar, ProgressStyle};
use serde_json::{Value, json};
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
    /// Table of points, CSV or Parquet, its columns named after parameters.
    #[arg(long)]
    table: Option<PathBuf>,
    /// Only tell what the sweep would come to.
    #[arg(long)]
    dry_run: bool,
    /// Data directory. If a service holds it, the sweep is submitted there.
    #[arg(long, default_value = "melange-data")]
    data: PathBuf,
    /// Threads that solve; all of the machine's if not given.
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=1024))]
    workers: Option<u16>,
}

/// Pause between two looks at the sweep.
const LOOK_EVERY: Duration = Duration::from_millis(100);

/// Queues the sweep and works until every run has ended.
pub async fn main(arguments: &Arguments) -> anyhow::Result<ExitCode> {
    let document = match document(arguments)? {
        Ok(document) => document,
        Err(refusal) => return Ok(refused(&refusal.to_string())),
    };
    if let Reach::Service(client) = Reach::of(&arguments.data) {
        let dry_run = arguments.dry_run;
        return tokio::task::spawn_blocking(move || served(&client, &document, dry_run)).await?;
    }
    let sweep = match document.into_sweep(&Limits::MOST) {
        Ok(sweep) => Arc::new(sweep),
        Err(refusal) => return Ok(refused(&refusal.to_string())),
    };
    let store = Store::open(&arguments.data).await?;
    if let Err(refusal) = start::check(&store, &sweep).await? {
        return Ok(refused(&refusal.to_string()));
    }
    let found = if sweep.is_forced() { 0 } else { reuse::found(&store, &sweep).await? };
    let workers = threads(arguments.workers);
    if arguments.dry_run {
        let service = Service::new(store, workers);
        let told =
            dry_run(&service, &sweep, found).await.map_err(|p| anyhow!("{}", p.sentence()))?;
        println!("{}", serde_json::to_string(&told)?);
        return Ok(ExitCode::SUCCESS);
    }
    let told = solve(&store, &sweep, workers, found).await;
    store.close().await;
    println!("{}", told?);
    Ok(ExitCode::SUCCESS)
}

fn refused(sentence: &str) -> ExitCode {
    eprintln!("refused: {sentence}");
    ExitCode::from(REFUSED)
}

/// The document with its table.
fn document(arguments: &Arguments) -> anyhow::Result<Result<Document, Refusal>> {
    let text = read(&arguments.spec)?;
    let table = match &arguments.table {
        None => None,
        Some(path) => {
            let bytes = std::fs::read(path);
            Some(bytes.with_context(|| format!("cannot read the table {}", path.display()))?)
        }
    };
    Ok(Document::parse(&text).and_then(|document| match table {
        Some(bytes) => with_table(document, bytes.into(), Limits::MOST.max_runs),
        None => Ok(document),
    }))
}

/// Solves a sweep here.
async fn solve(
    store: &Store,
    sweep: &Arc<SweepSpec>,
    threads: usize,
    found: usize,
) -> anyhow::Result<Value> {
    let submission = Submission {
        workers: threads,
        found,
        owner: Actor::operator().name,
        ..Submission::default()
    };
    let id = queue::enqueue(store, sweep, submission).await?.id;
    let rows = work_off(store, std::slice::from_ref(&id), threads).await?;
    let row = rows.first().context("the sweep is gone from the data directory")?;
    Ok(json!({ "id": id, "counts": row.counts, "reused": row.reused }))
}

/// Works until all runs of some queued sweeps have ended, and tells how.
pub async fn work_off(
    store: &Store,
    ids: &[String],
    threads: usize,
) -> anyhow::Result<Vec<SweepRow>> {
    let wake = Arc::new(Notify::new());
    let workers = Workers::new(store.clone(), threads, wake, Faults::default()).await?;
    let stop = CancellationToken::new();
    let working = tokio::spawn(workers.work(stop.clone()));
    let rows = watch(store, ids).await;
    stop.cancel();
    working.await.context("the workers broke off")?;
    rows
}

/// Draws a bar until all runs of some sweeps have ended.
async fn watch(store: &Store, ids: &[String]) -> anyhow::Result<Vec<SweepRow>> {
    let bar = bar(0)?;
    loop {
        let mut rows = Vec::with_capacity(ids.len());
        for id in ids {
            let row = queue::sweep_in_brief(&mut *store.read().await?, id).await?;
            rows.push(row.context("the sweep is gone from the data directory")?);
        }
        let sum = |count: fn(&SweepRow) -> i64| rows.iter().map(count).sum::<i64>();
        let (ended, total) = (sum(|row| row.counts.ended()), sum(|row| row.counts.total));
        bar.set_length(total as u64);
        bar.set_position(ended as u64);
        if ended == total {
            bar.finish();
            return Ok(rows);
        }
        if let Some(row) = rows.iter().find(|row| row.state() == SweepState::Paused) {
            bail!("the sweep `{}` is paused: `melange resume {}` first", row.name, row.id);
        }
        tokio::time::sleep(LOOK_EVERY).await;
    }
}

/// Has a sweep solved by the service that holds the data directory, and watches.
fn served(client: &Client, document: &Document, dry_run: bool) -> anyhow::Result<ExitCode> {
    let body = serde_json::to_vec(document)?;
    let path = if dry_run { "/sweeps?dry_run=true" } else { "/sweeps" };
    let taken = match client.post(path, &body) {
        Ok(taken) => taken,
        Err(error) => match error.downcast::<Refused>() {
            Ok(Refused(sentence)) => return Ok(refused(&sentence)),
            Err(error) => return Err(error),
        },
    };
    if dry_run {
        println!("{taken}");
        return Ok(ExitCode::SUCCESS);
    }
    let id = taken["id"].as_str().context("the service gave no id")?;
    let bar = bar(taken["count"].as_u64().unwrap_or_default())?;
    let last = client.follow(id, |progress| {
        let count = |name: &str| progress["counts"][name].as_u64().unwrap_or_default();
        bar.set_position(count("total") - count("queued") - count("running"));
    })?;
    bar.finish();
    println!("{}", json!({ "id": id, "counts": last["counts"], "reused": last["reused"] }));
    Ok(ExitCode::SUCCESS)
}

fn bar(runs: u64) -> anyhow::Result<ProgressBar> {
    let template = "{bar:40} {pos}/{len} runs, {per_sec}, {eta} left";
    let style = ProgressStyle::with_template(template).context("the bar's template is wrong")?;
    Ok(ProgressBar::new(runs).with_style(style))
}
