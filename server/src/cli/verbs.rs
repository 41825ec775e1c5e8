//! `melange pause`, `resume`, `stop`, `cancel`, `retry`, `delete`, `sweeps`: asked of the service that holds
//! the data directory, or done there if nobody does.

use crate::client::{Client, Refused};
use crate::domain::status::Verb;
use crate::http::error::Problem;
use crate::http::sweeps::Sweep;
use crate::http::verbs;
use crate::queue;
use crate::store::{self, Holder, Store};
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

/// A data directory.
#[derive(Debug, clap::Args)]
pub struct ListArguments {
    /// Data directory.
    #[arg(long, default_value = "melange-data")]
    data: PathBuf,
    /// Only sweeps with this tag.
    #[arg(long)]
    tag: Option<String>,
    /// Sweeps listed, the newest first.
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u16).range(1..=1000))]
    limit: u16,
}

/// Exit code of what the sweep's state does not allow.
const REFUSED: u8 = 2;

/// Asks something of a sweep and prints what it is then; without a verb, deletes it.
pub async fn main(arguments: &Arguments, verb: Option<Verb>) -> anyhow::Result<ExitCode> {
    let Arguments { id, data } = arguments;
    let told = match store::holder_of(data) {
        Holder::Service(address) => {
            let client = Client::new(address);
            let path = format!("/sweeps/{id}");
            tokio::task::spawn_blocking(move || match verb {
                Some(verb) => client.post(&format!("{path}/{}", verb.name()), b""),
                None => client.delete(&path),
            })
            .await?
        }
        Holder::Nobody | Holder::Command => {
            let store = Store::open_existing(data).await?;
            let told = match verb {
                Some(verb) => verbs::act(&store, id, verb).await.map(Some),
                None => verbs::remove(&store, id).await.map(|()| None),
            };
            store.close().await;
            told.map_err(|problem: Problem| anyhow!(Refused(problem.sentence().to_owned())))
                .and_then(|sweep| Ok(serde_json::to_value(sweep)?))
        }
    };
    match told {
        Ok(sweep) => {
            println!("{}", line(&sweep).unwrap_or_else(|| format!("{id} deleted")));
            Ok(ExitCode::SUCCESS)
        }
        Err(error) => match error.downcast::<Refused>() {
            Ok(Refused(sentence)) => {
                eprintln!("refused: {sentence}");
                Ok(ExitCode::from(REFUSED))
            }
            Err(error) => Err(error),
        },
    }
}

/// Lists sweeps, one line each.
pub async fn list(arguments: &ListArguments) -> anyhow::Result<ExitCode> {
    let onlooker = store::Onlooker::open(&arguments.data).await?;
    let which = queue::Which {
        tag: arguments.tag.as_deref(),
        limit: i64::from(arguments.limit),
        offset: 0,
    };
    let (rows, total) = queue::sweeps(&mut *onlooker.read().await?, which).await?;
    let shown = rows.len();
    for row in rows {
        println!("{}", line(&serde_json::to_value(Sweep::from(row))?).unwrap_or_default());
    }
    if (shown as i64) < total {
        eprintln!("{shown} of {total} sweeps; --limit shows more");
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
