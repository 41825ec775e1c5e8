//! `melange indices`: which parameter makes how much of a result's variance, from a data directory, which a
//! service may be using.

use super::find::{Significant, print, told};
use crate::analysis::indices::{IndexEstimate, Indices, Scale};
use crate::http::error::Problem;
use crate::http::indices::{Found, IndicesQuery};
use crate::store::Onlooker;
use std::path::PathBuf;
use std::process::ExitCode;

/// How indices are printed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Format {
    /// A line for each parameter.
    Text,
    /// As the REST interface tells them.
    Json,
}

/// In which scale the variance is taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum ScaleName {
    /// Of y itself.
    Linear,
    /// Of ln y.
    Log,
}

/// Arguments of `melange indices`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Id of the sweep; its points are a sample of method `saltelli`.
    sweep: String,
    /// Parameter or number of the result whose variance is shared out, such as force_n_per_m.
    #[arg(long)]
    y: String,
    /// Whether the variance is that of y or of ln y.
    #[arg(long, value_enum, default_value = "linear")]
    scale: ScaleName,
    /// Resamples for the intervals, from 100 to 10000; 1000 if not given.
    #[arg(long)]
    resamples: Option<u64>,
    /// Seed of the resamples.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// How they are printed.
    #[arg(long, value_enum, default_value = "text")]
    format: Format,
    /// Data directory.
    #[arg(long, default_value = "melange-data")]
    data: PathBuf,
}

/// Prints the indices.
pub async fn main(arguments: &Arguments) -> anyhow::Result<ExitCode> {
    let onlooker = Onlooker::open(&arguments.data).await?;
    let (name, indices) = match look(&onlooker, arguments).await {
        Ok(found) => found,
        Err(problem) => return told(problem),
    };
    match arguments.format {
        Format::Json => print(&serde_json::to_string(&indices)?)?,
        Format::Text => print(&text(&name, &indices))?,
    }
    Ok(ExitCode::SUCCESS)
}

async fn look(onlooker: &Onlooker, arguments: &Arguments) -> Result<(String, Indices), Problem> {
    let query = IndicesQuery {
        y: arguments.y.clone(),
        scale: match arguments.scale {
            ScaleName::Linear => Scale::Linear,
            ScaleName::Log => Scale::Log,
        },
        resamples: arguments.resamples,
        seed: arguments.seed,
    };
    let mut tx = onlooker.read().await?;
    let found = Found::look(&mut tx, &arguments.sweep, query).await?;
    drop(tx);
    Ok((found.name.clone(), found.indices(()).await?))
}

/// The indices as a table.
fn text(name: &str, told: &Indices) -> String {
    let what = match told.scale {
        Scale::Linear => told.y.clone(),
        Scale::Log => format!("ln {}", told.y),
    };
    let width = told.indices.iter().map(|index| index.parameter.len()).max().unwrap_or_default();
    let width = width.max("parameter".len());
    let cells = |index: &IndexEstimate| {
        let [low, high] = index.ci95;
        format!("{:>8.4}  {:<18}", index.estimate, format!("[{low:.4}, {high:.4}]"))
    };
    let mut lines = vec![
        format!("{name}: shares of the variance of {what}, {} base points", told.n),
        format!(
            "mean {:.6}, standard deviation {:.6}",
            Significant(told.mean),
            Significant(told.variance.sqrt())
        ),
        format!(
            "{:width$}  {:>8}  {:<18}  {:>8}  {:<18}",
            "parameter", "first", "95 %", "total", "95 %"
        )
        .trim_end()
        .to_owned(),
    ];
    for index in &told.indices {
        let line =
            format!("{:width$}  {}  {}", index.parameter, cells(&index.first), cells(&index.total));
        lines.push(line.trim_end().to_owned());
    }
    lines.push(format!("{:width$}  {:>8.4}", "sum", told.sum_of_first));
    lines.push(told.method.to_owned());
    lines.join("\n")
}
