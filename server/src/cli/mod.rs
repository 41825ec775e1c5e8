//! The command line: the composition root. It wires the rooms together and decides nothing.

pub mod branch;
pub mod calibrate;
pub mod care;
pub mod plot;
pub mod reproduce;
pub mod run;
pub mod serve;
pub mod soak;
pub mod sweep;
pub mod verbs;

use crate::domain::status::Verb;
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
    /// Follow steady states along a parameter, or a fold along two, and draw them.
    Branch(branch::Arguments),
    /// Find the parameters whose steady state agrees best with observations.
    Calibrate(calibrate::Arguments),
    /// Solve a sweep into a data directory.
    Sweep(sweep::Arguments),
    /// Serve the REST interface and the dashboard, and solve what is submitted.
    Serve(serve::Arguments),
    /// Serve, and queue the paper's melt sweep when the archive is empty.
    Demo(serve::Arguments),
    /// List the sweeps of a data directory.
    Sweeps(verbs::ListArguments),
    /// Start no more chunks of a sweep until it is resumed.
    Pause(verbs::Arguments),
    /// Go on with a sweep after a pause, a stop or a cancellation.
    Resume(verbs::Arguments),
    /// Finish what is under way of a sweep and cancel the rest.
    Stop(verbs::Arguments),
    /// Cancel what has no result yet of a sweep, also what is under way.
    Cancel(verbs::Arguments),
    /// Queue the failed runs of a sweep again.
    Retry(verbs::Arguments),
    /// Delete a sweep; runs that another one uses stay.
    Delete(verbs::Arguments),
    /// Compare a data directory's catalogue with its files, byte by byte.
    Verify(care::VerifyArguments),
    /// Copy a data directory, also while it is in use.
    Backup(care::BackupArguments),
    /// Run the paper's experiments and print its claims beside what comes out.
    Reproduce(reproduce::Arguments),
    /// Strain solver and service and tell what does not hold; measure what the service costs.
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
        Command::Branch(arguments) => branch::main(&arguments).await,
        Command::Calibrate(arguments) => calibrate::main(&arguments).await,
        Command::Sweep(arguments) => sweep::main(&arguments).await,
        Command::Serve(arguments) => serve::main(&arguments, false).await,
        Command::Demo(arguments) => serve::main(&arguments, true).await,
        Command::Sweeps(arguments) => verbs::list(&arguments).await,
        Command::Pause(arguments) => verbs::main(&arguments, Some(Verb::Pause)).await,
        Command::Resume(arguments) => verbs::main(&arguments, Some(Verb::Resume)).await,
        Command::Stop(arguments) => verbs::main(&arguments, Some(Verb::Stop)).await,
        Command::Cancel(arguments) => verbs::main(&arguments, Some(Verb::Cancel)).await,
        Command::Retry(arguments) => verbs::main(&arguments, Some(Verb::Retry)).await,
        Command::Delete(arguments) => verbs::main(&arguments, None).await,
        Command::Verify(arguments) => care::verify_main(&arguments).await,
        Command::Backup(arguments) => care::backup_main(&arguments).await,
        Command::Reproduce(arguments) => reproduce::main(&arguments).await,
        Command::Soak(arguments) => soak::main(arguments).await,
    }
}
