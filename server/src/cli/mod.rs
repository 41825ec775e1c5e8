//! The command line: the composition root. It wires the rooms together and decides nothing.

pub mod branch;
pub mod calibrate;
pub mod care;
pub mod columns;
pub mod edit;
pub mod ensembles;
pub mod find;
pub mod foreign;
pub mod health;
pub mod import;
pub mod indices;
pub mod plot;
pub mod reach;
pub mod reproduce;
pub mod rerun;
pub mod run;
pub mod serve;
pub mod soak;
pub mod sweep;
pub mod user;
pub mod verbs;

use crate::domain::status::Verb;
use clap::{Parser, Subcommand, ValueEnum};
use std::io::IsTerminal;
use std::process::ExitCode;
use tracing_subscriber::EnvFilter;

/// The ensemble service for ice mélange.
#[derive(Debug, Parser)]
#[command(version, about)]
struct Arguments {
    /// How the log is written, on standard error.
    #[arg(long, global = true, value_enum, default_value_t = LogFormat::Text)]
    log_format: LogFormat,
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum LogFormat {
    /// Lines for people.
    Text,
    /// A JSON object a line.
    Json,
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
    /// List runs of all sweeps, or of one.
    Runs(find::RunsArguments),
    /// List the stored runs nearest to given parameters.
    Nearest(find::NearestArguments),
    /// Tell which parameter makes how much of a result's variance, of a sweep drawn for that.
    Indices(indices::Arguments),
    /// Add tags to a sweep, or take some away.
    Tag(edit::TagArguments),
    /// Give a sweep a note in Markdown.
    Note(edit::NoteArguments),
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
    /// Put a sweep into the trash, or delete it for good; runs that another one uses stay.
    Delete(verbs::DeleteArguments),
    /// Take a sweep out of the trash.
    Recover(verbs::Arguments),
    /// Say who may do what, and give out tokens.
    User(user::Arguments),
    /// Print what was changed, by whom and when.
    Audit(user::AuditArguments),
    /// Seal a sweep: it never changes again, has a content hash and can be cited.
    Seal(ensembles::SealArguments),
    /// Write sweeps into one archive that travels, also while the data directory is in use.
    Export(ensembles::ExportArguments),
    /// Take sweeps from an archive that an export wrote; all of it is checked before any of it is believed.
    Import(import::Arguments),
    /// Bring a table of somebody's earlier results, for comparison.
    ImportTable(foreign::TableArguments),
    /// Compare a table of earlier results with the steady states solved here.
    Compare(foreign::CompareArguments),
    /// Compare a data directory's catalogue with its files, byte by byte.
    Verify(care::VerifyArguments),
    /// Print the tables' columns with types, units and meanings.
    Columns(columns::Arguments),
    /// Copy a data directory, also while it is in use.
    Backup(care::BackupArguments),
    /// Make a data directory of a backup, after comparing every byte with what was backed up.
    Restore(care::RestoreArguments),
    /// Tell whether a service is up; exit code 1 if it is not.
    Health(health::Arguments),
    /// Solve stored runs again and compare them with what is stored.
    Rerun(rerun::Arguments),
    /// Run the paper's experiments and print its claims beside what comes out.
    Reproduce(reproduce::Arguments),
    /// Strain solver and service and tell what does not hold; measure what the service costs.
    Soak(soak::Arguments),
}

/// Runs the command given.
pub async fn main() -> anyhow::Result<ExitCode> {
    let arguments = Arguments::parse();
    log(arguments.log_format);
    match arguments.command {
        Command::Run(arguments) => run::main(&arguments).await,
        Command::Branch(arguments) => branch::main(&arguments).await,
        Command::Calibrate(arguments) => calibrate::main(&arguments).await,
        Command::Sweep(arguments) => sweep::main(&arguments).await,
        Command::Serve(arguments) => serve::main(&arguments, false).await,
        Command::Demo(arguments) => serve::main(&arguments, true).await,
        Command::Sweeps(arguments) => verbs::list(&arguments).await,
        Command::Runs(arguments) => find::runs(&arguments).await,
        Command::Nearest(arguments) => find::nearest(&arguments).await,
        Command::Indices(arguments) => indices::main(&arguments).await,
        Command::Tag(arguments) => edit::tag(&arguments).await,
        Command::Note(arguments) => edit::note(&arguments).await,
        Command::Pause(arguments) => verbs::main(&arguments, Verb::Pause).await,
        Command::Resume(arguments) => verbs::main(&arguments, Verb::Resume).await,
        Command::Stop(arguments) => verbs::main(&arguments, Verb::Stop).await,
        Command::Cancel(arguments) => verbs::main(&arguments, Verb::Cancel).await,
        Command::Retry(arguments) => verbs::main(&arguments, Verb::Retry).await,
        Command::Delete(arguments) => verbs::delete(&arguments).await,
        Command::Recover(arguments) => verbs::main(&arguments, Verb::Recover).await,
        Command::User(arguments) => user::main(arguments).await,
        Command::Audit(arguments) => user::audit(&arguments).await,
        Command::Seal(arguments) => ensembles::seal_main(&arguments).await,
        Command::Export(arguments) => ensembles::export_main(&arguments).await,
        Command::Import(arguments) => import::main(&arguments).await,
        Command::ImportTable(arguments) => foreign::table_main(&arguments).await,
        Command::Compare(arguments) => foreign::compare_main(&arguments).await,
        Command::Verify(arguments) => care::verify_main(&arguments).await,
        Command::Columns(arguments) => columns::main(&arguments),
        Command::Backup(arguments) => care::backup_main(&arguments).await,
        Command::Restore(arguments) => care::restore_main(&arguments).await,
        Command::Health(arguments) => health::main(arguments).await,
        Command::Rerun(arguments) => rerun::main(&arguments).await,
        Command::Reproduce(arguments) => reproduce::main(&arguments).await,
        Command::Soak(arguments) => soak::main(arguments).await,
    }
}

/// Begins the log, of what RUST_LOG asks for.
fn log(format: LogFormat) {
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new("info"));
    let log = tracing_subscriber::fmt().with_env_filter(filter).with_writer(std::io::stderr);
    match format {
        LogFormat::Text => log.with_ansi(std::io::stderr().is_terminal()).init(),
        // A request is one span, whose members stand beside those of the line.
        LogFormat::Json => {
            log.json().flatten_event(true).with_current_span(true).with_span_list(false).init();
        }
    }
}
