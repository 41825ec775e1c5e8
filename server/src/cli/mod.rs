//! The command line: the composition root. It wires the rooms together and decides nothing.

pub mod reproduce;
pub mod run;
pub mod serve;
pub mod soak;
pub mod sweep;

use clap::{Parser, Subcommand};
use std::io::IsTerminal;
use std::process::ExitCode;
use tracing_subscriber::EnvFilter;

/// The ensemble service for ice mélange.
#[derive(Debug, Parser)]
#[command(version, about)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Solve one scenario and print its result.
    Run(run::Arguments),
    /// Solve a sweep into a data directory.
    Sweep(sweep::Arguments),
    /// Serve the REST interface and the dashboard, and solve what is submitted.
    Serve(serve::Arguments),
    /// Serve, and queue the paper's melt sweep when the archive is empty.
    Demo(serve::Arguments),
    /// Run the paper's experiments and print its claims beside what comes out.
    Reproduce(reproduce::Arguments),
    /// Draw parameters at random and tell what the solver does not manage.
    Soak(soak::Arguments),
}

/// Runs the command given.
pub async fn main() -> anyhow::Result<ExitCode> {
    let arguments = Arguments::parse();
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new("info"));
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        .with_ansi(std::io::stderr().is_terminal())
        .init();
    match arguments.command {
        Command::Run(arguments) => run::main(&arguments).await,
        Command::Sweep(arguments) => sweep::main(&arguments).await,
        Command::Serve(arguments) => serve::main(&arguments, false).await,
        Command::Demo(arguments) => serve::main(&arguments, true).await,
        Command::Reproduce(arguments) => reproduce::main(&arguments).await,
        Command::Soak(arguments) => soak::main(&arguments).await,
    }
}
