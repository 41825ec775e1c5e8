//! `melange soak`: strains solver and service, and measures what the service takes.

use crate::cli::serve::threads;
use crate::soak::{branches, engine, solver, throughput};
use anyhow::{Context, ensure};
use clap::ValueEnum;
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;
use std::fmt::Display;
use std::io::Write;
use std::path::PathBuf;
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
    /// Branches of steady states of parameters drawn at random, and their stability against time.
    Branches(BranchesArguments),
    /// The service, killed at the steps of its commits and at random moments.
    Engine(EngineArguments),
    /// What the service takes beside the bare solver.
    Throughput(ThroughputArguments),
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

#[derive(Debug, clap::Args)]
struct BranchesArguments {
    /// Branches.
    #[arg(long)]
    count: u64,
    /// Seed; the same seed draws the same branches, and fewer of them are the first ones.
    #[arg(long)]
    seed: u64,
    /// Threads that solve; all of the machine's if not given.
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// How the report is printed.
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
}

#[derive(Debug, clap::Args)]
struct EngineArguments {
    /// Kills, three of five at the steps of a commit in turn, the others at random moments.
    #[arg(long)]
    kills: u32,
    /// Seed of sweeps, steps' passings and moments.
    #[arg(long)]
    seed: u64,
    /// Data directory, which must not exist or be empty; a temporary one if not given.
    #[arg(long)]
    data: Option<PathBuf>,
    /// How the report is printed.
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
}

#[derive(Debug, clap::Args)]
struct ThroughputArguments {
    /// Pairs of the service and the bare solver, one after the other.
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u16).range(1..=1000))]
    pairs: u16,
    /// Melt rates, and as many widths.
    #[arg(long, default_value_t = 100, value_parser = clap::value_parser!(u16).range(2..=1000))]
    runs_per_side: u16,
    /// Transients of three years.
    #[arg(long, default_value_t = 200, value_parser = clap::value_parser!(u16).range(0..=10_000))]
    transients: u16,
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
pub async fn main(arguments: Arguments) -> anyhow::Result<ExitCode> {
    // All of it blocks, for long.
    tokio::task::spawn_blocking(move || match arguments.subject {
        Subject::Solver(arguments) => solver_main(&arguments),
        Subject::Branches(arguments) => branches_main(&arguments),
        Subject::Engine(arguments) => engine_main(arguments),
        Subject::Throughput(arguments) => throughput_main(&arguments),
    })
    .await?
}

fn solver_main(arguments: &SolverArguments) -> anyhow::Result<ExitCode> {
    let SolverArguments { count, seed, threads: asked, transients, format } = *arguments;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads(asked)).build()?;
    let report = pool.install(|| solver::run(solver::Request { count, seed, transients }));
    told(&report, format, report.is_clean())
}

fn branches_main(arguments: &BranchesArguments) -> anyhow::Result<ExitCode> {
    let BranchesArguments { count, seed, threads: asked, format } = *arguments;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads(asked)).build()?;
    let bar = bar(count, "branches")?;
    let report = pool.install(|| branches::soak(branches::Request { count, seed }, || bar.inc(1)));
    bar.finish_and_clear();
    told(&report, format, report.is_clean())
}

fn engine_main(arguments: EngineArguments) -> anyhow::Result<ExitCode> {
    let EngineArguments { kills, seed, data, format } = arguments;
    let folder = tempfile::tempdir().context("no temporary folder")?;
    let data = data.unwrap_or_else(|| folder.path().join("data"));
    ensure!(engine::is_free(&data), "{} is not empty", data.display());
    let bar = bar(u64::from(kills), "kills")?;
    let report = engine::run(engine::Request { kills, seed, data }, &bar)?;
    bar.finish_and_clear();
    told(&report, format, report.is_clean())
}

fn throughput_main(arguments: &ThroughputArguments) -> anyhow::Result<ExitCode> {
    let ThroughputArguments { pairs, runs_per_side, transients, format } = *arguments;
    let request = throughput::Request {
        pairs: usize::from(pairs),
        runs_per_side: usize::from(runs_per_side),
        transients: usize::from(transients),
        threads: threads(None),
    };
    let bar = bar(request.steps(), "measurements")?;
    let report = throughput::run(&request, &bar)?;
    bar.finish_and_clear();
    told(&report, format, true)
}

fn told<R: Display + Serialize>(
    report: &R,
    format: Format,
    is_clean: bool,
) -> anyhow::Result<ExitCode> {
    let shown = match format {
        Format::Text => report.to_string(),
        Format::Json => serde_json::to_string(report)? + "\n",
    };
    std::io::stdout().write_all(shown.as_bytes()).context("cannot write the report")?;
    Ok(if is_clean { ExitCode::SUCCESS } else { ExitCode::from(FOUND) })
}

fn bar(length: u64, what: &str) -> anyhow::Result<ProgressBar> {
    let template = format!("{{bar:40}} {{pos}}/{{len}} {what}, {{eta}} left");
    let style = ProgressStyle::with_template(&template).context("the bar's template is wrong")?;
    Ok(ProgressBar::new(length).with_style(style))
}
