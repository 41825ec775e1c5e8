//! `melange run`: one scenario, solved here and now.

use crate::domain::document::Document;
use crate::domain::outcome::{self, Outcome, SCALARS};
use crate::domain::refusal::Refusal;
use crate::domain::start::Start;
use crate::domain::status::Status;
use crate::worker::solve::Walker;
use anyhow::Context;
use clap::ValueEnum;
use std::io::{Read, Write};
use std::process::ExitCode;

/// Exit code of a verdict of physics.
const VERDICT: u8 = 0;
/// Exit code of a solver that gave up.
const FAILED: u8 = 1;
/// Exit code of bad input.
const REFUSED: u8 = 2;

/// Arguments of `melange run`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// File with the scenario, JSON if its first character is `{`, else TOML; `-` is standard input.
    scenario: String,
    /// How the result is printed.
    #[arg(long, value_enum, default_value_t = Format::Json)]
    format: Format,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Format {
    Json,
    Text,
}

/// Solves the scenario and prints the result.
pub async fn main(arguments: &Arguments) -> anyhow::Result<ExitCode> {
    let text = read(&arguments.scenario)?;
    let solved = tokio::task::spawn_blocking(move || solve(&text)).await?;
    let (shown, code) = match solved {
        Ok(outcome) => {
            let code = if outcome.status == Status::Failed { FAILED } else { VERDICT };
            let shown = match arguments.format {
                Format::Json => serde_json::to_string(&outcome)?,
                Format::Text => as_text(&outcome),
            };
            (shown, code)
        }
        Err(refusal) => {
            eprintln!("refused: {refusal}");
            (serde_json::to_string(&outcome::refused(&refusal))?, REFUSED)
        }
    };
    writeln!(std::io::stdout(), "{shown}").context("cannot write the result")?;
    Ok(ExitCode::from(code))
}

fn solve(text: &str) -> Result<Outcome, Refusal> {
    let run = Document::parse(text)?.into_run()?;
    if let Some(Start::Run(id)) = &run.shared.start {
        return Err(Refusal::value(
            "start.run",
            id.as_str(),
            "a single run has no archive to start from; submit it as a sweep",
        ));
    }
    let solved = Walker::default().solve(&run, Err("a single run has no archive"), &|| false);
    solved.ok_or_else(|| Refusal::sentence("stopped before the run ended"))
}

/// The text of a file, or of standard input for `-`.
pub fn read(path: &str) -> anyhow::Result<String> {
    if path == "-" {
        let mut text = String::new();
        std::io::stdin().read_to_string(&mut text).context("cannot read standard input")?;
        Ok(text)
    } else {
        std::fs::read_to_string(path).with_context(|| format!("cannot read {path}"))
    }
}

fn as_text(outcome: &Outcome) -> String {
    let mut lines = vec![format!("{}: {}", outcome.status.name(), outcome.detail)];
    for info in SCALARS {
        if let Some(value) = (info.get)(&outcome.scalars) {
            let unit = if info.unit == "1" { "" } else { info.unit };
            lines.push(format!("  {:<28} {value:>16.9e} {unit:<6} {}", info.name, info.meaning));
        }
    }
    for (name, text) in
        [("validity", &outcome.validity), ("grid_convergence", &outcome.grid_convergence)]
    {
        if let Some(text) = text {
            lines.push(format!("  {name:<28} {text}"));
        }
    }
    lines.join("\n")
}
