//! `melange branch`: a branch of steady states, or a curve of its folds, drawn in the terminal.

use super::plot::{Mark, plot};
use super::run::{Format, as_text, print, read, solve};
use crate::domain::curve::{CurveRow, of_kind};
use crate::domain::document::{Document, Regime};
use crate::domain::outcome::Outcome;
use crate::domain::refusal::Refusal;
use std::process::ExitCode;

/// Arguments of `melange branch`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// File with a scenario of the regime `branch` or `fold_curve`; `-` is standard input.
    scenario: String,
    /// How the result is printed.
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
}

/// Mark of a stable state, or of one whose stability was not asked for.
const STABLE: char = '*';
/// Mark of an unstable state.
const UNSTABLE: char = '.';
/// Mark of a fold.
const FOLD: char = 'F';
/// Mark of a root at a value asked for.
const ROOT: char = 'o';

/// Follows the branch and prints it.
pub async fn main(arguments: &Arguments) -> anyhow::Result<ExitCode> {
    let text = read(&arguments.scenario)?;
    let solved = tokio::task::spawn_blocking(move || followed(&text)).await?;
    print(solved, arguments.format, drawn)
}

fn followed(text: &str) -> Result<Outcome, Refusal> {
    let document = Document::parse(text)?;
    if let Some(regime) =
        document.regime.filter(|r| !matches!(r, Regime::Branch | Regime::FoldCurve))
    {
        let permitted = "branch or fold_curve; `melange run` solves the others";
        return Err(Refusal::value("regime", regime.name(), permitted));
    }
    solve(document)
}

/// The result as a drawing and tables.
fn drawn(outcome: &Outcome) -> String {
    let rows = outcome.curve_rows();
    let Some(first) = rows.first() else { return as_text(outcome) };
    let control = first.control.as_deref().unwrap_or_default();
    let control_label = with_unit(control, first.control_unit.as_deref());
    let mut parts = vec![format!("{}: {}", outcome.status.name(), outcome.detail)];
    let folds = of_kind(rows, "fold");
    let x = |row: &CurveRow| row.control_value.unwrap_or(f64::NAN);
    if outcome.fold_curve.is_some() {
        let second = first.second.as_deref().unwrap_or_default();
        let second_label = with_unit(second, first.second_unit.as_deref());
        let mark = |row: &&CurveRow| Mark {
            x: row.second_value.unwrap_or(f64::NAN),
            y: x(row),
            mark: FOLD,
        };
        let curve: Vec<Mark> = folds.iter().map(mark).collect();
        parts.push(plot(&curve, &[], &second_label, &control_label));
    } else {
        let y = |row: &CurveRow| row.length_m.unwrap_or(f64::NAN);
        let mark = |row: &&CurveRow| Mark { x: x(row), y: y(row), mark: sign(row) };
        let curve: Vec<Mark> = of_kind(rows, "point").iter().map(mark).collect();
        let special = of_kind(rows, "root").into_iter().map(|row| (row, ROOT));
        let special = special.chain(folds.iter().map(|row| (*row, FOLD)));
        let marks: Vec<Mark> =
            special.map(|(row, mark)| Mark { x: x(row), y: y(row), mark }).collect();
        parts.push(plot(&curve, &marks, &control_label, "length_m"));
        parts.push(legend(rows));
    }
    for (kind, title) in [("fold", "folds"), ("root", "roots")] {
        let rows = of_kind(rows, kind);
        if !rows.is_empty() {
            parts.push(table(title, &rows));
        }
    }
    let crossings: Vec<String> = of_kind(rows, "crossing").into_iter().map(crossing).collect();
    if !crossings.is_empty() {
        parts.push(format!("crossings\n{}", crossings.join("\n")));
    }
    let ends = of_kind(rows, "end")
        .into_iter()
        .map(|row| format!("  {:<12} {}", told(&row.reason), told(&row.detail)));
    parts.push(format!("ends\n{}", ends.collect::<Vec<_>>().join("\n")));
    parts.join("\n\n")
}

fn told(text: &Option<String>) -> &str {
    text.as_deref().unwrap_or_default()
}

fn with_unit(name: &str, unit: Option<&str>) -> String {
    match unit {
        Some(unit) if unit != "1" => format!("{name} ({unit})"),
        _ => name.to_owned(),
    }
}

fn sign(row: &CurveRow) -> char {
    if row.stable == Some(false) { UNSTABLE } else { STABLE }
}

fn legend(rows: &[CurveRow]) -> String {
    let is_told = rows.iter().any(|row| row.stable.is_some());
    let states = if is_told {
        format!("{STABLE} stable   {UNSTABLE} unstable")
    } else {
        format!("{STABLE} steady state")
    };
    let roots = if of_kind(rows, "root").is_empty() {
        String::new()
    } else {
        format!("   {ROOT} root at a value asked for")
    };
    format!("  {states}   {FOLD} fold{roots}")
}

/// Folds or roots, one to a line.
fn table(title: &str, rows: &[&CurveRow]) -> String {
    let has_second = rows.iter().any(|row| row.second_value.is_some());
    let is_fold = title == "folds";
    let mut head = String::from(title);
    head += "\n ";
    if has_second {
        head += &format!(" {:>14}", rows.first().map_or("", |row| told(&row.second)));
    }
    let control = rows.first().map_or("", |row| told(&row.control));
    head += &format!(
        " {control:>20} {:>12} {:>14} {:>14}",
        "length_m", "thickness_0_m", "force_n_per_m"
    );
    head += if is_fold { "  kind" } else { "  the rule's  stability" };
    let mut lines = vec![head];
    for row in rows {
        let mut line = String::from(" ");
        if let Some(second) = row.second_value {
            line += &format!(" {second:>14.6}");
        }
        let number = |value: Option<f64>| value.unwrap_or(f64::NAN);
        line += &format!(
            " {:>20.8} {:>12.2} {:>14.4} {:>14.6e}",
            number(row.control_value),
            number(row.length_m),
            number(row.thickness_0_m),
            number(row.force_n_per_m)
        );
        if !is_fold {
            let answer =
                row.is_picked.map_or("-", |is_picked| if is_picked { "yes" } else { "no" });
            line += &format!("  {answer:<10}");
        }
        line += match (is_fold, row.is_maximum, row.stable) {
            (true, Some(true), _) => "  maximum",
            (true, ..) => "  minimum",
            (false, _, Some(true)) => "  stable",
            (false, _, Some(false)) => "  unstable",
            (false, _, None) => "  not asked for",
        };
        if row.is_on_kink == Some(true) {
            line += ", on a kink";
        }
        lines.push(line);
    }
    lines.join("\n")
}

fn crossing(row: &CurveRow) -> String {
    let pair = |numbers: &Option<Vec<f64>>| match numbers.as_deref() {
        Some([a, b]) => (*a, *b),
        _ => (f64::NAN, f64::NAN),
    };
    let ((from, to), (before, after)) = (pair(&row.bracket), pair(&row.unstable_counts));
    format!(
        "  between {} = {from} and {to}: from {before} growing perturbations to {after}",
        told(&row.control)
    )
}
