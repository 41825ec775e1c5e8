//! `melange runs`, `nearest`: runs of a data directory, which a service may be using.

use super::reach::REFUSED;
use crate::archive::catalogue::{self, Across, RunRow, Total};
use crate::http::error::Problem;
use crate::http::find::{self, FoundPage, NearTo, Prospects};
use crate::http::runs::order;
use crate::store::Onlooker;
use serde_json::Value;
use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;

/// How runs are printed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Format {
    /// A line for each, with the parameters that its sweep varies.
    Text,
    /// As the REST interface tells them.
    Json,
    /// A table of all their columns.
    Csv,
}

/// Arguments of `melange runs`.
#[derive(Debug, clap::Args)]
pub struct RunsArguments {
    /// Which runs, such as 'tag = "paper" and melt_rate_m_per_day < 0.7'; see docs/finding.md.
    #[arg(long)]
    filter: Option<String>,
    /// Only those of the sweep with this id.
    #[arg(long)]
    sweep: Option<String>,
    /// Column to sort by, with `-` before it from high to low (--sort=-force_n_per_m).
    #[arg(long, allow_hyphen_values = true)]
    sort: Option<String>,
    /// Runs listed.
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    limit: u32,
    /// How they are printed.
    #[arg(long, value_enum, default_value = "text")]
    format: Format,
    /// Data directory.
    #[arg(long, default_value = "melange-data")]
    data: PathBuf,
}

/// Arguments of `melange nearest`.
#[derive(Debug, clap::Args)]
pub struct NearestArguments {
    /// A parameter to be near to, as name=value; may be given several times.
    #[arg(long = "param", value_name = "NAME=VALUE", required = true, value_parser = parameter)]
    parameters: Vec<(String, f64)>,
    /// Which runs, such as 'status = "converged"'; see docs/finding.md.
    #[arg(long)]
    filter: Option<String>,
    /// Runs listed.
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u8).range(1..=100))]
    limit: u8,
    /// How they are printed.
    #[arg(long, value_enum, default_value = "text")]
    format: Format,
    /// Data directory.
    #[arg(long, default_value = "melange-data")]
    data: PathBuf,
}

fn parameter(text: &str) -> Result<(String, f64), String> {
    let (name, value) = text.split_once('=').ok_or("a parameter is given as name=value")?;
    let value = value.trim().parse().map_err(|_| format!("`{value}` is no number"))?;
    Ok((name.trim().to_owned(), value))
}

/// Tells what is wrong; with the filter and a mark under the character if it is about one.
pub fn told(problem: Problem) -> anyhow::Result<ExitCode> {
    eprintln!("refused: {}", problem.pointed());
    Ok(ExitCode::from(REFUSED))
}

/// Lists runs.
pub async fn runs(arguments: &RunsArguments) -> anyhow::Result<ExitCode> {
    let onlooker = Onlooker::open(&arguments.data).await?;
    match look(&onlooker, arguments).await {
        Ok((page, prospects)) => {
            match arguments.format {
                Format::Json => print(&serde_json::to_string(&page)?)?,
                format => print_items(&page.items, format, &[], &prospects)?,
            }
            let shown = page.items.len() as i64;
            if arguments.format == Format::Text && shown < page.total.total {
                let at_least = if page.total.is_exact { "" } else { "at least " };
                eprintln!("{shown} of {at_least}{} runs; --limit shows more", page.total.total);
            }
            Ok(ExitCode::SUCCESS)
        }
        Err(problem) => told(problem),
    }
}

async fn look(
    onlooker: &Onlooker,
    arguments: &RunsArguments,
) -> Result<(FoundPage, Prospects), Problem> {
    /// Runs asked for at once.
    const AT_ONCE: i64 = 1_000;
    let order = arguments.sort.as_deref().map(order).transpose()?;
    let sorted_by: Vec<&str> = order.iter().map(|order| order.column).collect();
    let mut tx = onlooker.read().await?;
    let filter = arguments.filter.as_deref();
    let mut prospects = Prospects::new(&mut tx, filter, &sorted_by).await?;
    if let Some(id) = &arguments.sweep {
        prospects.only(id)?;
    }
    let candidates = prospects.candidates();
    let (mut items, mut after) = (Vec::new(), None);
    loop {
        let limit = (i64::from(arguments.limit) - items.len() as i64).min(AT_ONCE);
        let across = Across { candidates: &candidates, order, limit, after };
        let (rows, end) = catalogue::runs_across(&mut tx, &across).await?;
        items.extend(prospects.items(rows));
        after = end;
        if after.is_none() || items.len() >= arguments.limit as usize {
            break;
        }
    }
    let total = match after {
        None => Total { total: items.len() as i64, is_exact: true },
        Some(_) => catalogue::count_across(&mut tx, &candidates).await?,
    };
    Ok((FoundPage { items, next: None, total }, prospects))
}

/// Lists the nearest runs.
pub async fn nearest(arguments: &NearestArguments) -> anyhow::Result<ExitCode> {
    let onlooker = Onlooker::open(&arguments.data).await?;
    let to = NearTo {
        parameters: arguments.parameters.clone(),
        filter: arguments.filter.clone(),
        limit: Some(i64::from(arguments.limit)),
    };
    let mut tx = onlooker.read().await?;
    let found = match find::near(&mut tx, &to).await {
        Ok(found) => found,
        Err(problem) => return told(problem),
    };
    match arguments.format {
        Format::Json => print(&serde_json::to_string(&found)?)?,
        format => {
            let names: Vec<String> = to.parameters.iter().map(|(name, _)| name.clone()).collect();
            let prospects = match Prospects::new(&mut tx, None, &[]).await {
                Ok(prospects) => prospects,
                Err(problem) => return told(problem),
            };
            print_items(&found.items, format, &names, &prospects)?;
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// Prints a line; whoever reads may have heard enough.
pub fn print(line: &str) -> std::io::Result<()> {
    match writeln!(std::io::stdout().lock(), "{line}") {
        Err(error) if error.kind() == std::io::ErrorKind::BrokenPipe => Ok(()),
        done => done,
    }
}

fn print_items(
    items: &[RunRow],
    format: Format,
    names: &[String],
    prospects: &Prospects,
) -> anyhow::Result<()> {
    if format == Format::Csv {
        return print(csv(items)?.trim_end()).map_err(Into::into);
    }
    for item in items {
        let axes = prospects.axes(item.text("sweep_id"));
        print(&line(item, names, axes))?;
    }
    Ok(())
}

/// A run in one line: distance, sweep and index, status, parameters, force and length, name of its sweep.
fn line(item: &RunRow, names: &[String], axes: &[String]) -> String {
    let mut line = String::new();
    if let Some(distance) = item.0.get("distance") {
        line += &format!("{:<10.4e} ", distance.as_f64().unwrap_or(f64::NAN));
    }
    let index = item.whole("run_index").unwrap_or_default();
    line += &format!("{} {index:<6} {:<15}", item.text("sweep_id"), item.text("status"));
    let varied = axes.iter().filter(|axis| !names.contains(axis));
    let numbers = ["force_n_per_m".to_owned(), "length_m".to_owned()];
    for name in names.iter().chain(varied).chain(&numbers) {
        match item.0.get(name) {
            Some(Value::Number(number)) => {
                line += &format!(" {name}={:.6}", Significant(number.as_f64().unwrap_or_default()));
            }
            _ => line += &format!(" {name}=-"),
        }
    }
    format!("{line}  {}", item.text("sweep_name"))
}

/// A number with as many digits as its precision says.
pub struct Significant(pub f64);

impl std::fmt::Display for Significant {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let digits = f.precision().unwrap_or(6).saturating_sub(1);
        // By way of its digits, so that 4000 is no 4000.00.
        let rounded: f64 = format!("{:.digits$e}", self.0).parse().unwrap_or(self.0);
        if rounded != 0.0 && !(1e-4..1e9).contains(&rounded.abs()) {
            write!(f, "{rounded:e}")
        } else {
            write!(f, "{rounded}")
        }
    }
}

/// All columns, those first that tell which run it is.
fn csv(items: &[RunRow]) -> anyhow::Result<String> {
    const FIRST: [&str; 7] =
        ["distance", "sweep_id", "sweep_name", "owner", "run_index", "run_id", "status"];
    let Some(item) = items.first() else { return Ok(String::new()) };
    let first = FIRST.iter().copied().filter(|name| item.0.contains_key(*name));
    let rest = item.0.keys().map(String::as_str);
    let rest = rest.filter(|name| !FIRST.contains(name) && *name != "differences");
    let columns: Vec<&str> = first.chain(rest).collect();
    let mut table = csv::Writer::from_writer(Vec::new());
    table.write_record(&columns)?;
    for item in items {
        table.write_record(columns.iter().map(|name| match item.0.get(*name) {
            None | Some(Value::Null) => String::new(),
            Some(Value::String(text)) => text.clone(),
            Some(value) => value.to_string(),
        }))?;
    }
    Ok(String::from_utf8(table.into_inner()?)?)
}
