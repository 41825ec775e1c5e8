//! `melange tag`, `note`: what people call a sweep by, changed by the service that holds the data directory, or
//! there if nobody does.

use super::reach::{Reach, ask};
use super::run::read;
use super::verbs::answer;
use crate::client::Refused;
use crate::domain::label::Edit;
use crate::domain::person::Actor;
use crate::http::edit;
use crate::http::error::Problem;
use crate::store::Store;
use anyhow::{anyhow, ensure};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Arguments of `melange tag`.
#[derive(Debug, clap::Args)]
pub struct TagArguments {
    /// The sweep's id.
    id: String,
    /// A tag to add; may be given several times.
    #[arg(long, value_name = "TAG")]
    add: Vec<String>,
    /// A tag to take away; may be given several times.
    #[arg(long, value_name = "TAG")]
    remove: Vec<String>,
    /// Data directory.
    #[arg(long, default_value = "melange-data")]
    data: PathBuf,
}

/// Arguments of `melange note`.
#[derive(Debug, clap::Args)]
pub struct NoteArguments {
    /// The sweep's id.
    id: String,
    /// File with the note in Markdown; `-` is standard input. An empty one takes the note away.
    file: String,
    /// Data directory.
    #[arg(long, default_value = "melange-data")]
    data: PathBuf,
}

/// Adds tags and takes others away.
pub async fn tag(arguments: &TagArguments) -> anyhow::Result<ExitCode> {
    let TagArguments { id, add, remove, data } = arguments;
    ensure!(!add.is_empty() || !remove.is_empty(), "nothing to do: give --add or --remove");
    let some = |tags: &Vec<String>| Some(tags.clone()).filter(|tags| !tags.is_empty());
    let change = Edit { add_tags: some(add), remove_tags: some(remove), ..Edit::default() };
    let mut body = serde_json::Map::new();
    for (name, tags) in [("add_tags", &change.add_tags), ("remove_tags", &change.remove_tags)] {
        if let Some(tags) = tags {
            body.insert(name.into(), json!(tags));
        }
    }
    edited(data, id, Value::Object(body), &change).await
}

/// Writes a note.
pub async fn note(arguments: &NoteArguments) -> anyhow::Result<ExitCode> {
    let NoteArguments { id, file, data } = arguments;
    let text = read(file)?;
    let body = json!({ "note": text });
    let change = Edit { note: Some(Some(text)), ..Edit::default() };
    edited(data, id, body, &change).await
}

/// Has a sweep changed: by the service, which gets the body, or here.
async fn edited(data: &Path, id: &str, body: Value, change: &Edit) -> anyhow::Result<ExitCode> {
    let told = match Reach::of(data) {
        Reach::Service(client) => {
            let path = format!("/sweeps/{id}");
            ask(move || client.patch(&path, body.to_string().as_bytes())).await
        }
        Reach::Directory => {
            let store = Store::open_existing(data).await?;
            let told = edit::apply(&store, &Actor::operator(), id, change).await;
            store.close().await;
            told.map_err(refused).and_then(|sweep| Ok(serde_json::to_value(sweep)?))
        }
    };
    answer(told)
}

fn refused(problem: Problem) -> anyhow::Error {
    anyhow!(Refused(problem.sentence().to_owned()))
}
