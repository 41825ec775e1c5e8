//! `melange pause`, `resume`, `stop`, `cancel`, `retry`, `delete`, `recover`, `sweeps`: asked of the service that holds
//! the data directory, or done there if nobody does.

use super::find;
use super::reach::{self, Reach, ask};
use crate::client::Refused;
use crate::domain::person::Actor;
use crate::domain::status::Verb;
use crate::http::error::Problem;
use crate::http::sweeps::{self, Listing};
use crate::http::verbs;
use crate::store::{Onlooker, Store};
use anyhow::anyhow;
use serde_json::Value;
use std::path::PathBuf;
use std::process::ExitCode;

/// A sweep of a data directory.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// The sweep's id.
    id: String,
    /// Data directory.
    #[arg(long, default_value = "melange-data")]
    data: PathBuf,
}

/// A sweep that is deleted.
#[derive(Debug, clap::Args)]
pub struct DeleteArguments {
    #[command(flatten)]
    sweep: Arguments,
    /// At once and for good, also what lies in the trash already.
    #[arg(long)]
    for_good: bool,
}

/// A data directory.
#[derive(Debug, clap::Args)]
pub struct ListArguments {
    /// Data directory.
    #[arg(long, default_value = "melange-data")]
    data: PathBuf,
    /// Only sweeps with this tag.
    #[arg(long)]
    tag: Option<String>,
    /// Which sweeps, such as 'owner = "ada" and failed > 0'; see docs/finding.md.
    #[arg(long)]
    filter: Option<String>,
    /// Sweeps in the trash, in place of the others.
    #[arg(long)]
    trash: bool,
    /// Sweeps listed, the newest first.
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u16).range(1..=1000))]
    limit: u16,
}

/// Asks something of a sweep and prints what it is then.
pub async fn main(arguments: &Arguments, verb: Verb) -> anyhow::Result<ExitCode> {
    let Arguments { id, data } = arguments;
    let told = match Reach::of(data) {
        Reach::Service(client) => {
            let path = format!("/sweeps/{id}/{}", verb.name());
            ask(move || client.post(&path, b"")).await
        }
        Reach::Directory => {
            let store = Store::open_existing(data).await?;
            let told = verbs::act(&store, &Actor::operator(), id, verb).await;
            store.close().await;
            refusal(told).and_then(|sweep| Ok(serde_json::to_value(sweep)?))
        }
    };
    answer(told)
}

/// Prints a sweep as it is now, or why it was refused.
pub fn answer(told: anyhow::Result<Value>) -> anyhow::Result<ExitCode> {
    reach::told(told, |sweep| println!("{}", line(&sweep).unwrap_or_default()))
}

/// Deletes a sweep.
pub async fn delete(arguments: &DeleteArguments) -> anyhow::Result<ExitCode> {
    let DeleteArguments { sweep: Arguments { id, data }, for_good } = arguments;
    let told = match Reach::of(data) {
        Reach::Service(client) => {
            let path = format!("/sweeps/{id}?for_good={for_good}");
            ask(move || client.delete(&path).map(drop)).await
        }
        Reach::Directory => {
            let store = Store::open_existing(data).await?;
            let told = verbs::remove(&store, &Actor::operator(), id, *for_good).await;
            store.close().await;
            refusal(told)
        }
    };
    let then = if *for_good { "for good" } else { "; `melange recover` takes it out of the trash" };
    reach::told(told, |()| println!("{id} deleted {then}"))
}

/// A problem, told as a refusal.
fn refusal<T>(told: Result<T, Problem>) -> anyhow::Result<T> {
    told.map_err(|problem| anyhow!(Refused(problem.sentence().to_owned())))
}

/// Lists sweeps, one line each.
pub async fn list(arguments: &ListArguments) -> anyhow::Result<ExitCode> {
    let onlooker = Onlooker::open(&arguments.data).await?;
    let listing = Listing {
        limit: Some(i64::from(arguments.limit)),
        tag: arguments.tag.clone(),
        filter: arguments.filter.clone(),
        trash: arguments.trash,
        cursor: None,
    };
    let page = match sweeps::page(&mut *onlooker.read().await?, &listing).await {
        Ok(page) => page,
        Err(problem) => return find::told(problem),
    };
    for sweep in &page.items {
        println!("{}", line(&serde_json::to_value(sweep)?).unwrap_or_default());
    }
    let shown = page.items.len();
    if (shown as i64) < page.total {
        eprintln!("{shown} of {} sweeps; --limit shows more", page.total);
    }
    Ok(ExitCode::SUCCESS)
}

/// A sweep in one line: id, state, runs ended, name.
fn line(sweep: &Value) -> Option<String> {
    let counts = &sweep["counts"];
    let count = |name: &str| counts[name].as_i64().unwrap_or_default();
    let ended = count("total") - count("queued") - count("running");
    let mut line = format!(
        "{} {:<9} {ended}/{} runs",
        sweep["id"].as_str()?,
        sweep["state"].as_str()?,
        count("total"),
    );
    for (name, runs) in counts.as_object()? {
        if name != "total" && runs.as_i64() != Some(0) {
            line += &format!(", {runs} {name}");
        }
    }
    Some(format!("{line}  {}", sweep["name"].as_str()?))
}
