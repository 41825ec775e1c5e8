//! `melange run`: one scenario, solved here and now.

use super::reach::REFUSED;
use crate::domain::document::Document;
use crate::domain::outcome::{self, Outcome, SCALARS};
use crate::domain::provenance::Provenance;
use crate::domain::refusal::Refusal;
use crate::domain::sensitivity;
use crate::domain::start::Start;
use crate::domain::status::Status;
use crate::worker::host;
use crate::worker::solve::Walker;
use anyhow::Context;
use clap::ValueEnum;
use std::io::{Read, Write};
use std::process::ExitCode;
use std::time::Instant;

/// Exit code of a verdict of physics.
const VERDICT: u8 = 0;
/// Exit code of a solver that gave up.
const FAILED: u8 = 1;

/// Arguments of `melange run`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// File with the scenario, JSON if its first character is `{`, else TOML; `-` is standard input.
    scenario: String,
    /// How the result is printed.
    #[arg(long, value_enum, default_value_t = Format::Json)]
    format: Format,
}

/// How a result is printed.
#[derive(Debug, Clone, Copy, ValueEnum)]
pub enum Format {
    /// For programs.
    Json,
    /// For people.
    Text,
}

/// Solves the scenario and prints the result.
pub async fn main(arguments: &Arguments) -> anyhow::Result<ExitCode> {
    let text = read(&arguments.scenario)?;
    let solved = tokio::task::spawn_blocking(move || Document::parse(&text).and_then(solve));
    print(solved.await?, arguments.format, |outcome| {
        let mut shown = as_text(outcome);
        if let Some(command) = drawn_by(outcome) {
            shown += &format!("\n`melange {command} {}` draws it", arguments.scenario);
        }
        shown
    })
}

/// The command that draws what the numbers of a result do not show.
fn drawn_by(outcome: &Outcome) -> Option<&'static str> {
    if !outcome.curve_rows().is_empty() {
        Some("branch")
    } else {
        outcome.calibration.as_ref().map(|_| "calibrate")
    }
}

/// Prints a result, as text in a way of its own.
pub fn print(
    solved: Result<Outcome, Refusal>,
    format: Format,
    as_text: impl Fn(&Outcome) -> String,
) -> anyhow::Result<ExitCode> {
    let (shown, code) = match solved {
        Ok(outcome) => {
            let code = if outcome.status == Status::Failed { FAILED } else { VERDICT };
            let shown = match format {
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

/// Solves the one run of a document.
pub fn solve(document: Document) -> Result<Outcome, Refusal> {
    let options = document.options_of_runs();
    let scenario = serde_json::to_value(&document).ok();
    let run = document.into_run()?;
    if let Some(Start::Run(id)) = &run.shared.start {
        return Err(Refusal::value(
            "start.run",
            id.as_str(),
            "a single run has no archive to start from; submit it as a sweep",
        ));
    }
    let begin = Instant::now();
    let solved = Walker::default().solve(&run, Err("a single run has no archive"), &|| false);
    let mut outcome = solved.ok_or_else(|| Refusal::sentence("stopped before the run ended"))?;
    outcome.provenance = Some(Provenance {
        seed: run.seed(),
        scenario,
        ..Provenance::here(host::class(), options, begin.elapsed().as_secs_f64())
    });
    Ok(outcome)
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

/// The numbers of a result, one to a line.
pub fn as_text(outcome: &Outcome) -> String {
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
    lines.extend(sensitivities(outcome));
    lines.extend(discrete_roots(outcome));
    lines.join("\n")
}

/// d ln Q/d ln p, a line for each parameter and a column for each quantity.
fn sensitivities(outcome: &Outcome) -> Vec<String> {
    let rows = &outcome.sensitivities;
    if rows.is_empty() {
        return Vec::new();
    }
    /// The quantities by their letters.
    const SYMBOLS: [(&str, &str); 6] = [
        ("length_m", "L"),
        ("thickness_0_m", "H_0"),
        ("force_n_per_m", "F"),
        ("force_quasi_static_n_per_m", "F at rest"),
        ("velocity_end_m_per_a", "U_L"),
        ("volume_m3", "V"),
    ];
    let symbol = |name: &str| SYMBOLS.iter().find(|(known, _)| *known == name).map_or("", |s| s.1);
    let names: String = rows.iter().map(|r| format!(" {:>12}", symbol(&r.quantity))).collect();
    let mut lines = vec![format!("  {:<34}{names}", "d ln Q/d ln p")];
    for (i, name) in sensitivity::parameters().enumerate() {
        let cells = rows.iter().map(|row| match row.log_by[i] {
            Some(value) => format!(" {value:>12.5}"),
            None => format!(" {:>12}", "-"),
        });
        lines.push(format!("    {name:<32}{}", cells.collect::<String>()));
    }
    lines
}

/// The discrete steady states, one to a line, the one that the rule picks first.
fn discrete_roots(outcome: &Outcome) -> Vec<String> {
    let rows = &outcome.discrete_roots;
    if rows.is_empty() {
        return Vec::new();
    }
    let mut lines = vec![format!(
        "  discrete roots {:>16} {:>14} {:>16} {:>10}  cells at rest",
        "thickness_0_m", "length_m", "force_n_per_m", "stability"
    )];
    for row in rows {
        let number = |value: Option<f64>| value.unwrap_or(f64::NAN);
        let whose = if row.is_picked == Some(true) { "the rule's" } else { "" };
        let stability = match row.stable {
            Some(true) => "stable",
            Some(false) => "unstable",
            None => "-",
        };
        let cells: Vec<String> =
            row.cells_at_rest.iter().flatten().map(|cell| cell.to_string()).collect();
        let cells = if cells.is_empty() { "none".to_owned() } else { cells.join(" ") };
        lines.push(format!(
            "    {whose:<12} {:>16.6} {:>14.4} {:>16.9e} {stability:>10}  {cells}",
            number(row.thickness_0_m),
            number(row.length_m),
            number(row.force_n_per_m),
        ));
    }
    lines
}
