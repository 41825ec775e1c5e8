//! `melange soak`: draws parameters at random and tells what the solver does not manage.

use crate::cli::serve::threads;
use crate::soak;
use anyhow::Context;
use clap::ValueEnum;
use std::io::Write;
use std::process::ExitCode;

/// Arguments of `melange soak`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    #[command(subcommand)]
    subject: Subject,
}

#[derive(Debug, clap::Subcommand)]
enum Subject {
    /// Steady states of parameters drawn at random.
    Solver(SolverArguments),
}

#[derive(Debug, clap::Args)]
struct SolverArguments {
    /// Parameter sets.
    #[arg(long)]
    count: u64,
    /// Seed; the same seed draws the same sets, and fewer of them are the first ones.
    #[arg(long)]
    seed: u64,
    /// Threads that solve; all of the machine's if not given.
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Verdicts of no steady state that are tried by a march of 20 years.
    #[arg(long, default_value_t = 0)]
    transients: usize,
    /// How the report is printed.
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Format {
    Text,
    Json,
}

/// Exit code of a soak in which something failed or contradicts.
const FOUND: u8 = 1;

/// Soaks and prints the report.
pub async fn main(arguments: &Arguments) -> anyhow::Result<ExitCode> {
    let Subject::Solver(SolverArguments { count, seed, threads: asked, transients, format }) =
        arguments.subject;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads(asked)).build()?;
    let request = soak::Request { count, seed, transients };
    let report = tokio::task::spawn_blocking(move || pool.install(|| soak::run(request))).await?;
    let shown = match format {
        Format::Text => report.to_string(),
        Format::Json => serde_json::to_string(&report)? + "\n",
    };
    std::io::stdout().write_all(shown.as_bytes()).context("cannot write the report")?;
    Ok(if report.is_clean() { ExitCode::SUCCESS } else { ExitCode::from(FOUND) })
}
