//! End to end: what a user does with the binary, and what must not happen to their data.

mod architecture;
mod archives;
mod believing;
mod branches;
mod browser;
mod calibrations;
mod command_line;
mod contract;
mod discrete_roots;
mod engine;
mod ensembles_page;
mod faults;
mod figures_page;
mod finding;
mod foreign;
mod hostile;
mod indices;
mod journey;
mod laws;
mod laws_page;
mod operating;
mod people;
mod profiles_page;
mod reading;
mod reproduction;
mod rest;
mod returning;
mod scenarios;
mod sealing;
mod sensitivities;
mod shell_page;
mod soak;
mod states;
mod storage;
mod tables;
mod travelling;
mod verbs;

use serde_json::{Value, json};

/// The paper's melt sweep with n points.
fn melt_sweep(n: usize) -> Value {
    json!({
        "name": "melt",
        "regime": "steady",
        "axes": [{"parameter": "melt_rate_m_per_day", "linspace": [0.5, 1.0, n]}],
    })
}

fn number(v: &Value) -> f64 {
    v.as_f64().unwrap_or_else(|| panic!("{v} is not a number"))
}

fn assert_close(what: &str, got: &Value, expected: &Value, relative: f64) {
    let (got, expected) = (number(got), number(expected));
    let error = if got == expected { 0.0 } else { (got - expected).abs() / expected.abs() };
    assert!(error <= relative, "{what}: {got} is not {expected} (relative error {error:.2e})");
}

fn assert_all_close(what: &str, got: &Value, expected: &Value, relative: f64) {
    let (got, expected) =
        (got.as_array().expect("an array"), expected.as_array().expect("an array"));
    assert_eq!(got.len(), expected.len(), "{what}");
    for (i, (g, e)) in got.iter().zip(expected).enumerate() {
        assert_close(&format!("{what}[{i}]"), g, e, relative);
    }
}
