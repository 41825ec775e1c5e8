//! `melange import`: sweeps from an archive, taken by the service that holds the data directory, or here.

use super::ensembles::{answer, refused_by};
use super::reach::{Reach, ask};
use crate::domain::person::Actor;
use crate::domain::sweep::Limits;
use crate::http::travel::{Importing, take_in};
use crate::store::Store;
use anyhow::Context;
use serde_json::Value;
use std::fs::File;
use std::path::PathBuf;
use std::process::ExitCode;

/// Arguments of `melange import`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// The archive that `melange export` wrote.
    file: PathBuf,
    /// Data directory; it is made if there is none.
    #[arg(long, default_value = "melange-data")]
    data: PathBuf,
    /// Only tell what would be taken.
    #[arg(long)]
    dry_run: bool,
    /// Take it even if it has other numbers of runs that are here; both are kept.
    #[arg(long)]
    accept_conflicts: bool,
}

/// Takes an archive in and tells what became of each ensemble.
pub async fn main(arguments: &Arguments) -> anyhow::Result<ExitCode> {
    let Arguments { file: path, data, dry_run, accept_conflicts } = arguments;
    let (dry_run, accept_conflicts) = (*dry_run, *accept_conflicts);
    let file = File::open(path).with_context(|| format!("cannot read {}", path.display()))?;
    let told = match Reach::of(data) {
        Reach::Service(client) => {
            let path = format!("/import?dry_run={dry_run}&accept_conflicts={accept_conflicts}");
            ask(move || client.post_file(&path, file)).await
        }
        Reach::Directory => {
            let store = Store::open(data).await?;
            let asked = Importing { dry_run, accept_conflicts };
            let taken = take_in(&store, &Actor::operator(), file, asked, Limits::MOST).await;
            store.close().await;
            taken.map_err(refused_by).and_then(|taken| Ok(serde_json::to_value(taken)?))
        }
    };
    answer(told, |told| {
        let lines = told["ensembles"].as_array().into_iter().flatten().map(line);
        lines.collect::<Vec<String>>().join("\n")
    })
}

/// What became of an ensemble, in one line and one for each conflict that is named.
fn line(arrival: &Value) -> String {
    let text = |name: &str| arrival[name].as_str().unwrap_or_default();
    let count = |name: &str| arrival[name].as_u64().unwrap_or_default();
    let (source, id) = (text("source_id"), text("id"));
    let became = match text("outcome") {
        "imported" if source == id => format!("{id} imported"),
        "imported" => format!("{source} imported as {id}"),
        "already_here" => format!("{source} is already here, as {id}"),
        _ => format!("{source} would be imported"),
    };
    let sealed = if arrival["sealed"] == true { "sealed" } else { "not sealed" };
    let mut line = format!(
        "{became}: {sealed}, {} runs, {} of them here with the same numbers, {} but for rounding, {} with others",
        count("runs"),
        count("identical"),
        count("close"),
        count("conflicts"),
    );
    for conflict in arrival["named"].as_array().into_iter().flatten() {
        line += &format!(
            "\n  run {}: {} is {} here and {} there",
            conflict["run_id"].as_str().unwrap_or_default(),
            conflict["column"].as_str().unwrap_or_default(),
            conflict["here"],
            conflict["there"],
        );
    }
    line
}
