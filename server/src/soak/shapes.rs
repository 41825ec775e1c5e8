//! Sweeps to submit while a service is being killed: grids that share runs in several ways, the same runs
//! solved again, a few transients. Small chunks, so that there are many commits to be killed at.

use super::Numbers;
use serde_json::{Value, json};

/// Melt rates and widths of a grid.
const MELTS: usize = 18;
const WIDTHS: usize = 16;
/// Distance of melt rates, m d⁻¹.
const APART: f64 = 0.01;
/// Cells: few, so that a chunk takes milliseconds.
const CELLS: u64 = 20;

/// A sweep and what is to come of it.
#[derive(Debug, Clone)]
pub struct Shape {
    /// What is submitted.
    pub document: Value,
    /// Its runs.
    pub runs: i64,
    /// Whether its runs have time series, and not sensitivities.
    pub is_transient: bool,
}

/// The sweep of a number. Six in a row belong together: a grid; a grid of which every other row is the
/// first one's; the first one again, solved anew; one that overlaps it; transients; the first one again, where
/// nothing is left to solve.
pub fn shape(seed: u64, number: u64) -> Shape {
    let round = number / 6;
    let least = 0.5 + APART * Numbers::new(seed, round).next();
    let melts = |first: f64, step: f64| -> Vec<f64> {
        let melt = |i: usize| least + APART * (first + step * i as f64);
        // Rounded, so that a rate is the same number in every grid that has it.
        (0..MELTS).map(|i| (melt(i) * 1e9).round() / 1e9).collect()
    };
    let (kind, melts) = match number % 6 {
        0 => ("grid", melts(0.0, 1.0)),
        1 => ("interleaved", melts(0.0, 0.5)),
        2 => ("forced", melts(0.0, 1.0)),
        3 => ("overlapping", melts(MELTS as f64 / 2.0, 1.0)),
        4 => ("transients", melts(0.0, 1.0)),
        _ => ("the same again", melts(0.0, 1.0)),
    };
    let is_transient = kind == "transients";
    let widths = if is_transient { 1 } else { WIDTHS };
    let mut document = json!({
        "name": format!("{number}: {kind}"),
        "regime": "steady",
        "parameters": {"n_cells": CELLS},
        "axes": [
            {"parameter": "melt_rate_m_per_day", "values": melts},
            {"parameter": "width_m", "linspace": [3500.0, 4500.0, widths.max(2)]},
        ],
    });
    if kind == "forced" {
        document["force"] = json!(true);
    }
    if is_transient {
        document["regime"] = json!("transient");
        document["start"] = json!("steady");
        document["time"] = json!({"duration_a": 0.1, "fixed_dt_a": 0.02});
    } else {
        // So that there is a long table too.
        document["options"] = json!({"sensitivities": true});
    }
    Shape { document, runs: (MELTS * widths.max(2)) as i64, is_transient }
}
