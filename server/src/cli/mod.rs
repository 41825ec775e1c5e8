//! The command line: the composition root. It wires the rooms together and decides nothing.

pub mod run;

use clap::{Parser, Subcommand};
use std::process::ExitCode;

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
}

/// Runs the command given.
pub async fn main() -> anyhow::Result<ExitCode> {
    match Arguments::parse().command {
        Command::Run(arguments) => run::main(&arguments).await,
    }
}
