//! `melange import-table` and `melange compare`: somebody's earlier results beside runs of this model.

use super::ensembles::{answer, refused_by};
use super::reach::{Reach, ask};
use crate::domain::person::Actor;
use crate::http::foreign::{compared, keep};
use crate::store::{Onlooker, Store};
use anyhow::Context;
use serde_json::Value;
use std::path::PathBuf;
use std::process::ExitCode;

/// Arguments of `melange import-table`.
#[derive(Debug, clap::Args)]
pub struct TableArguments {
    /// The table, CSV with a header.
    file: PathBuf,
    /// The column map, TOML or JSON: `source`, and under `columns` where each parameter and result stands.
    #[arg(long)]
    map: PathBuf,
    /// Name of the table here.
    #[arg(long)]
    name: String,
    /// Data directory; it is made if there is none.
    #[arg(long, default_value = "melange-data")]
    data: PathBuf,
}

/// Arguments of `melange compare`.
#[derive(Debug, clap::Args)]
pub struct CompareArguments {
    /// Id of the table, which begins with `foreign-`.
    id: String,
    /// Data directory; it may be in use.
    #[arg(long, default_value = "melange-data")]
    data: PathBuf,
    /// Print the comparison as JSON, with so many rows.
    #[arg(long)]
    json: Option<usize>,
}

/// Brings a table and prints its id.
pub async fn table_main(arguments: &TableArguments) -> anyhow::Result<ExitCode> {
    let TableArguments { file, map, name, data } = arguments;
    let read = |path: &PathBuf| {
        std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))
    };
    let (table, map) = (read(file)?, read(map)?);
    let told = match Reach::of(data) {
        Reach::Service(client) => {
            let name = name.clone();
            let parts = move || {
                client.post_form(
                    "/foreign",
                    &[("name", name.as_bytes()), ("map", &map), ("table", &table)],
                )
            };
            ask(parts).await
        }
        Reach::Directory => {
            let store = Store::open(data).await?;
            let kept = keep(&store, &Actor::operator(), name.as_bytes(), &map, table.into()).await;
            store.close().await;
            kept.map_err(refused_by).and_then(|kept| Ok(serde_json::to_value(kept)?))
        }
    };
    answer(told, |table| {
        let assumed = table["assumed"].as_object().map(|a| a.keys().cloned().collect::<Vec<_>>());
        format!(
            "{}  {} rows of {}\nnot named by the map, so at their defaults: {}",
            table["id"].as_str().unwrap_or_default(),
            table["row_count"],
            table["source"],
            assumed.unwrap_or_default().join(", "),
        )
    })
}

/// Compares a table with what was solved here, and prints how far its results lie apart.
pub async fn compare_main(arguments: &CompareArguments) -> anyhow::Result<ExitCode> {
    let onlooker = Onlooker::open(&arguments.data).await?;
    let rows = arguments.json.unwrap_or_default();
    let told = compared(&mut *onlooker.read().await?, &arguments.id, 0, rows).await;
    let told = told.map_err(refused_by).and_then(|told| Ok(serde_json::to_value(told)?));
    answer(told, |told| if arguments.json.is_some() { told.to_string() } else { text(told) })
}

fn text(told: &Value) -> String {
    let mut text = format!(
        "{} of {} rows have a steady state at the same parameters",
        told["matched"], told["rows"]
    );
    for (name, spread) in told["summary"].as_object().into_iter().flatten() {
        let number = |member: &str| spread[member].as_f64().unwrap_or_default();
        text += &format!(
            "\n{name}: median difference {:.2e}, largest {:.2e} in row {} ({} rows)",
            number("median"),
            number("largest"),
            spread["largest_in_row"],
            spread["n"],
        );
    }
    text
}
