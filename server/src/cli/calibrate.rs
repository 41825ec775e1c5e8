//! `melange calibrate`: the parameters that observations tell, printed with what is known of them.

use super::plot;
use super::run::{Format, as_text, print, read, solve};
use crate::domain::calibrated::{Calibrated, CalibrationRow};
use crate::domain::document::{Document, Regime};
use crate::domain::outcome::Outcome;
use crate::domain::refusal::Refusal;
use std::process::ExitCode;

/// Arguments of `melange calibrate`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// File with a scenario of the regime `calibration`; `-` is standard input.
    scenario: String,
    /// How the result is printed.
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
}

/// Calibrates and prints what was found.
pub async fn main(arguments: &Arguments) -> anyhow::Result<ExitCode> {
    let text = read(&arguments.scenario)?;
    let solved = tokio::task::spawn_blocking(move || calibrated(&text)).await?;
    print(solved, arguments.format, tables)
}

fn calibrated(text: &str) -> Result<Outcome, Refusal> {
    let document = Document::parse(text)?;
    if let Some(regime) = document.regime.filter(|regime| *regime != Regime::Calibration) {
        let permitted = "calibration; `melange run` solves the others";
        return Err(Refusal::value("regime", regime.name(), permitted));
    }
    solve(document)
}

/// The result as tables.
fn tables(outcome: &Outcome) -> String {
    let Some(found) = &outcome.calibration else { return as_text(outcome) };
    let mut parts = vec![format!("{}: {}", outcome.status.name(), outcome.detail)];
    parts.push(estimates(found));
    let directions = found.of_kind("direction").into_iter().map(|row| {
        let error = row.standard_error_ln.map_or("not determined".into(), |e| format!("{e:.3e}"));
        format!("  {error:>14}  {}", text(&row.product))
    });
    parts
        .push(titled("standard error of the logarithm of what is known independently", directions));
    parts.push(residuals(found));
    parts.push(titled("starts", found.of_kind("start").into_iter().map(start)));
    if let Some(sampling) = found.of_kind("sampling").first() {
        parts.push(samples(found, sampling));
    }
    parts.join("\n\n")
}

fn titled(title: &str, lines: impl Iterator<Item = String>) -> String {
    [title.to_owned()].into_iter().chain(lines).collect::<Vec<_>>().join("\n")
}

fn text(text: &Option<String>) -> &str {
    text.as_deref().unwrap_or_default()
}

/// A number, or a dash where there is none.
fn number(value: Option<f64>) -> String {
    value.map_or("-".to_owned(), plot::number)
}

fn estimates(found: &Calibrated) -> String {
    let line = |row: &CalibrationRow| {
        let interval = match (row.ci95.as_deref(), &row.at_bound) {
            (_, Some(bound)) => format!("at its {bound} value"),
            (Some([low, high]), None) => {
                format!("{} to {}", plot::number(*low), plot::number(*high))
            }
            _ => "not determined".to_owned(),
        };
        let (value, error) = (number(row.value), number(row.standard_error_ln));
        format!("  {:<32} {value:>14} {error:>14}  {interval}", text(&row.parameter))
    };
    let head = format!("{:<34} {:>14} {:>14}  95 %", "parameter", "estimate", "error of ln p");
    titled(&head, found.of_kind("estimate").into_iter().map(line))
}

fn residuals(found: &Calibrated) -> String {
    let line = |row: &CalibrationRow| {
        let place = |m: Option<f64>| m.map_or("-".to_owned(), |m| format!("{m:.0}"));
        format!(
            "  {:<26} {:>8} {:>8} {:>14} {:>14} {:>9.3}{}",
            text(&row.quantity),
            place(row.x_m),
            place(row.y_m),
            number(row.value),
            number(row.prediction),
            row.residual.unwrap_or(f64::NAN),
            if row.is_beyond == Some(true) { "  beyond the end" } else { "" }
        )
    };
    let head = format!(
        "{:<28} {:>8} {:>8} {:>14} {:>14} {:>9}",
        "observation", "x_m", "y_m", "observed", "predicted", "residual"
    );
    titled(&head, found.of_kind("residual").into_iter().map(line))
}

fn start(row: &CalibrationRow) -> String {
    let list = |numbers: &Option<Vec<f64>>| -> String {
        let numbers = numbers.as_deref().unwrap_or_default();
        numbers.iter().map(|n| format!("{n:.4e}")).collect::<Vec<_>>().join(", ")
    };
    let number = row.start.unwrap_or_default();
    let (from, ending) = (list(&row.from), text(&row.ending));
    match row.chi2 {
        Some(chi2) => {
            format!("  {number:>3}  {from}  to  {}  chi2 {chi2:.4e}, {ending}", list(&row.to))
        }
        None => format!("  {number:>3}  {from}  {ending}: {}", text(&row.detail)),
    }
}

fn samples(found: &Calibrated, sampling: &CalibrationRow) -> String {
    let line = |row: &CalibrationRow| {
        let quantile = |k: usize| number(row.quantiles.as_ref().and_then(|q| q.get(k).copied()));
        format!(
            "  {:<32} {:>14} {:>14} {:>14} {:>10.0}",
            text(&row.parameter),
            quantile(0),
            quantile(1),
            quantile(2),
            row.effective_samples.unwrap_or(f64::NAN)
        )
    };
    let head = format!(
        "{:<34} {:>14} {:>14} {:>14} {:>10}",
        format!("samples ({:.0} % taken)", 100.0 * sampling.acceptance.unwrap_or(f64::NAN)),
        "2.5 %",
        "50 %",
        "97.5 %",
        "effective"
    );
    titled(&head, found.of_kind("marginal").into_iter().map(line))
}
