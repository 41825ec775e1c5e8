//! `melange user` and `melange audit`: who the people are and what they changed, asked of the service that
//! holds the data directory, or done there if nobody does. Whoever may write in the directory may do this.

use super::reach::{Reach, ask};
use crate::client::Client;
use crate::domain::person::{Actor, Role};
use crate::people::{self, Person, Quota, Unfit};
use crate::store::{Onlooker, Store};
use clap::Subcommand;
use serde_json::{Value, json};
use std::path::PathBuf;
use std::process::ExitCode;

/// Arguments of `melange user`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    #[command(subcommand)]
    command: Command,
    /// Data directory.
    #[arg(long, default_value = "melange-data", global = true)]
    data: PathBuf,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Add a person and print their token, once. The first one must be an admin; from then on the service
    /// lets nobody in without a token.
    Add {
        /// Their name.
        name: String,
        /// What they may do: reader, contributor or admin.
        #[arg(long, value_parser = role)]
        role: Role,
        #[command(flatten)]
        limits: Limits,
    },
    /// List all people.
    List,
    /// Change a person's role or limits; what is not given stays.
    Set {
        /// Their name.
        name: String,
        /// What they may do from now on: reader, contributor or admin.
        #[arg(long, value_parser = role)]
        role: Option<Role>,
        #[command(flatten)]
        limits: Limits,
    },
    /// Give a person a new token in the place of the old one, also after it was revoked.
    Token {
        /// Their name.
        name: String,
    },
    /// Take no token of a person any more; what they own stays theirs.
    Revoke {
        /// Their name.
        name: String,
    },
}

#[derive(Debug, Clone, Copy, clap::Args)]
struct Limits {
    /// Most runs of all their sweeps together; `none` for no limit.
    #[arg(long, value_name = "N", value_parser = limit)]
    most_runs: Option<Limit>,
    /// Most runs of theirs that wait or are under way; `none` for no limit.
    #[arg(long, value_name = "N", value_parser = limit)]
    most_pending_runs: Option<Limit>,
}

#[derive(Debug, Clone, Copy)]
struct Limit(Option<i64>);

fn role(text: &str) -> Result<Role, String> {
    Role::from_name(text).ok_or_else(|| "permitted are reader, contributor and admin".into())
}

fn limit(text: &str) -> Result<Limit, String> {
    if text == "none" {
        return Ok(Limit(None));
    }
    let runs = text.parse().ok().filter(|runs| *runs >= 0);
    runs.map(|runs| Limit(Some(runs)))
        .ok_or_else(|| "permitted are numbers from 0 and `none`".into())
}

/// Does what is asked.
pub async fn main(arguments: Arguments) -> anyhow::Result<ExitCode> {
    let Arguments { command, data } = arguments;
    let done = match Reach::of(&data) {
        Reach::Service(client) => ask(move || served(&client, &command)).await,
        Reach::Directory => {
            let store = match &command {
                Command::Add { .. } => Store::open(&data).await?,
                _ => Store::open_existing(&data).await?,
            };
            let done = here(&store, &command).await;
            store.close().await;
            done
        }
    };
    super::reach::told(done, |lines| lines.iter().for_each(|line| println!("{line}")))
}

fn served(client: &Client, command: &Command) -> anyhow::Result<Vec<String>> {
    let token = |told: Value| vec![told["token"].as_str().unwrap_or_default().to_owned()];
    Ok(match command {
        Command::Add { name, role, limits } => {
            let new = json!({
                "name": name,
                "role": role,
                "most_runs": limits.most_runs.and_then(|l| l.0),
                "most_pending_runs": limits.most_pending_runs.and_then(|l| l.0),
            });
            token(client.post("/people", new.to_string().as_bytes())?)
        }
        Command::List => {
            let people = client.get("/people")?;
            people.as_array().into_iter().flatten().map(line).collect()
        }
        Command::Set { name, role, limits } => {
            let mut changed = serde_json::Map::new();
            if let Some(role) = role {
                changed.insert("role".into(), json!(role));
            }
            for (member, limit) in
                [("most_runs", limits.most_runs), ("most_pending_runs", limits.most_pending_runs)]
            {
                if let Some(Limit(runs)) = limit {
                    changed.insert(member.into(), json!(runs));
                }
            }
            let body = Value::Object(changed).to_string();
            vec![line(&client.patch(&format!("/people/{name}"), body.as_bytes())?)]
        }
        Command::Token { name } => token(client.post(&format!("/people/{name}/token"), b"")?),
        Command::Revoke { name } => {
            client.delete(&format!("/people/{name}"))?;
            vec![format!("{name}: no token of theirs is taken any more")]
        }
    })
}

async fn here(store: &Store, command: &Command) -> anyhow::Result<Vec<String>> {
    let who = Actor::operator().name;
    let mut tx = store.write().await?;
    let (action, name, detail, lines) = match command {
        Command::List => {
            let people = people::all(&mut tx).await?;
            let told: Result<Vec<_>, _> = people.iter().map(serde_json::to_value).collect();
            return Ok(told?.iter().map(line).collect());
        }
        Command::Add { name, role, limits } => {
            let quota = Quota {
                most_runs: limits.most_runs.and_then(|l| l.0),
                most_pending_runs: limits.most_pending_runs.and_then(|l| l.0),
            };
            let token = people::add(&mut tx, name, *role, quota).await?;
            ("add person", name, Some(people::detail(*role, quota)), vec![token])
        }
        Command::Set { name, role, limits } => {
            let was = people::one(&mut tx, name).await?;
            let was = was.ok_or_else(|| Unfit::Nobody(name.clone()))?;
            let anew = |limit: Option<Limit>, was| limit.map_or(was, |Limit(runs)| runs);
            let quota = Quota {
                most_runs: anew(limits.most_runs, was.quota.most_runs),
                most_pending_runs: anew(limits.most_pending_runs, was.quota.most_pending_runs),
            };
            let role = role.unwrap_or(was.role);
            people::set(&mut tx, name, role, quota).await?;
            let is = Person { role, quota, ..was };
            let detail = people::detail(role, quota);
            ("change person", name, Some(detail), vec![line(&serde_json::to_value(is)?)])
        }
        Command::Token { name } => {
            ("new token", name, None, vec![people::renew(&mut tx, name).await?])
        }
        Command::Revoke { name } => {
            people::revoke(&mut tx, name).await?;
            ("revoke", name, None, vec![format!("{name}: no token of theirs is taken any more")])
        }
    };
    people::audit(&mut tx, &who, action, name, detail.as_deref()).await?;
    tx.commit().await?;
    Ok(lines)
}

/// A person in one line.
fn line(person: &Value) -> String {
    let text = |member: &str| person[member].as_str().unwrap_or_default().to_owned();
    let limit = |member: &str| match person[member].as_i64() {
        Some(runs) => runs.to_string(),
        None => "any".into(),
    };
    let revoked = match person["revoked_at"].as_str() {
        Some(at) => format!(", revoked {at}"),
        None => String::new(),
    };
    format!(
        "{:<20} {:<12} {} runs, {} pending; added {}{revoked}",
        text("name"),
        text("role"),
        limit("most_runs"),
        limit("most_pending_runs"),
        text("created_at"),
    )
}

/// Arguments of `melange audit`.
#[derive(Debug, clap::Args)]
pub struct AuditArguments {
    /// Data directory; it may be in use.
    #[arg(long, default_value = "melange-data")]
    data: PathBuf,
    /// Only changes of this: a sweep's id, a person's name.
    #[arg(long)]
    subject: Option<String>,
    /// Only changes by this person.
    #[arg(long)]
    who: Option<String>,
    /// Changes printed, the newest first.
    #[arg(long, default_value_t = 50, value_parser = clap::value_parser!(u32).range(1..))]
    limit: u32,
}

/// Prints what was changed, by whom and when.
pub async fn audit(arguments: &AuditArguments) -> anyhow::Result<ExitCode> {
    let onlooker = Onlooker::open(&arguments.data).await?;
    let which = people::Which {
        subject: arguments.subject.as_deref(),
        who: arguments.who.as_deref(),
        before: None,
        limit: i64::from(arguments.limit),
    };
    for change in people::changes(&mut *onlooker.read().await?, which).await? {
        let detail = change.detail.map(|detail| format!("  {detail}")).unwrap_or_default();
        let (at, who) = (change.changed_at, change.who);
        println!("{at} {who:<20} {:<14} {}{detail}", change.action, change.subject);
    }
    Ok(ExitCode::SUCCESS)
}
