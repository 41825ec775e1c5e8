//! Calibrations: what the example's observations tell, in tables and in the terminal, and what is refused.

use crate::number;
use crate::tables::read;
use arrow_array::cast::AsArray;
use melange_tests::{Server, folder, melange, root, run};
use serde_json::{Value, json};

/// What the example's observations were made with.
const TRUTH: [(&str, f64); 2] = [("b", 2e4), ("mu_s", 0.32)];

fn example() -> String {
    root().join("examples/calibration.toml").display().to_string()
}

/// Exact observations of the base case on 20 cells; a fit of them ends well within their standard errors.
fn exact() -> Value {
    let (_, truth) = run(r#"{"regime": "steady", "parameters": {"n_cells": 20}}"#);
    let observed = |quantity: &str, standard_error: f64| json!({"quantity": quantity, "value": truth[quantity], "standard_error": standard_error});
    json!({
        "regime": "calibration", "parameters": {"n_cells": 20, "b": 2e4, "mu_s": 0.25},
        "calibration": {
            "parameters": {"b": [1e3, 1e5], "mu_s": [0.1, 0.6]}, "starts": 2,
            "observations": [observed("length_m", 50.0), observed("thickness_0_m", 1.0),
                observed("velocity_end_m_per_a", 100.0)],
        },
    })
}

#[test]
fn the_truth_lies_within_what_the_example_tells() {
    let output = melange(&["calibrate", &example(), "--format", "json"], "");
    assert!(output.status.success());
    let result: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!(result["status"], "converged", "{}", result["detail"]);
    let found = &result["calibration"];
    for (k, (name, truth)) in TRUTH.into_iter().enumerate() {
        let estimate = &found["estimates"][k];
        assert_eq!(estimate["parameter"], name);
        let (low, high) = (number(&estimate["ci95"][0]), number(&estimate["ci95"][1]));
        assert!(low < truth && truth < high && high < 2.0 * low, "{estimate}");
        let marginal = &found["mcmc"]["marginals"][k];
        let (low, high) = (number(&marginal["quantiles"][0]), number(&marginal["quantiles"][2]));
        assert!(low < truth && truth < high, "{marginal}");
        let expected = number(&estimate["value"]) * number(&estimate["standard_error_ln"]);
        assert!((number(&estimate["standard_error"]) / expected - 1.0).abs() < 1e-12);
    }
    let correlation = number(&found["estimates"][0]["correlation"][1]);
    assert!((-1.0..-0.9).contains(&correlation), "{correlation}");
    assert_eq!(found["fit"]["degrees_of_freedom"], 14);
    assert_eq!(found["residuals"].as_array().map(Vec::len), Some(16));
    assert_eq!(found["starts"].as_array().map(Vec::len), Some(4));
    let least = &found["identifiability"][0];
    assert!(
        number(&least["standard_error_ln"])
            > number(&found["identifiability"][1]["standard_error_ln"])
    );
    assert_eq!(result["parameters"]["b"], 10_000.0);
    let length = found["residuals"][15]["prediction"].clone();
    assert_eq!(length, result["length_m"]);

    let output = melange(&["calibrate", &example()], "");
    let text = String::from_utf8(output.stdout).expect("UTF-8");
    for expected in ["estimate", "mu_s", "thickness_m", "starts", "97.5 %", "chi2"] {
        assert!(text.contains(expected), "{expected} is missing:\n{text}");
    }
    let output = melange(&["run", &example(), "--format", "text"], "");
    let text = String::from_utf8(output.stdout).expect("UTF-8");
    let command = format!("`melange calibrate {}` draws it", example());
    assert_eq!(text.lines().last(), Some(command.as_str()));
}

#[test]
fn a_sweep_of_calibrations_is_stored_and_shared() {
    let exact = exact();
    let (code, printed) = run(&exact.to_string());
    assert_eq!((code, printed["status"].as_str()), (0, Some("converged")), "{printed}");
    for (k, truth) in [1e4, 0.3].into_iter().enumerate() {
        let value = number(&printed["calibration"]["estimates"][k]["value"]);
        assert!((value / truth - 1.0).abs() < 5e-3, "{value} and {truth}");
    }
    let folder = folder();
    let server = Server::start("serve", folder.path(), &[]);
    let mut sweep = exact.clone();
    sweep["parameters"].as_object_mut().expect("members").remove("mu_s");
    sweep["axes"] = json!([{"parameter": "mu_s", "values": [0.25, 0.35]}]);
    sweep["calibration"]["mcmc"] = json!({"walkers": 8, "steps": 20, "burn_in": 10, "seed": 3});
    let dry = server.post("/api/v1/sweeps?dry_run=true", &sweep.to_string()).json();
    assert!(number(&dry["estimated_seconds"]) > 0.01, "{dry}");
    let id = server.submit(&sweep);
    assert_eq!(server.wait(&id)["counts"]["converged"], 2);
    // The same observations as columns are the same runs.
    let rows = sweep["calibration"]["observations"].as_array().expect("rows").clone();
    let column = |name: &str| -> Vec<Value> { rows.iter().map(|row| row[name].clone()).collect() };
    sweep["calibration"]["observations"] = json!({"quantity": column("quantity"),
        "x_m": [null, null, null], "value": column("value"), "standard_error": column("standard_error")});
    let again = server.submit(&sweep);
    assert_eq!(server.wait(&again)["reused"], 2);
    sweep["calibration"]["seed"] = 1.into();
    let other = server.submit(&sweep);
    assert_eq!(server.wait(&other)["reused"], 0);

    let batches = read(server.get(&format!("/api/v1/sweeps/{id}/calibrations.parquet")).body);
    let kinds: Vec<String> = batches
        .iter()
        .flat_map(|batch| {
            let column = batch.column_by_name("kind").expect("kinds").as_string::<i32>();
            column.iter().flatten().map(str::to_owned).collect::<Vec<_>>()
        })
        .collect();
    for (kind, count) in
        [("estimate", 4), ("residual", 6), ("start", 4), ("marginal", 4), ("sample", 160)]
    {
        assert_eq!(kinds.iter().filter(|k| *k == kind).count(), count, "{kind}");
    }
    let csv = server.get(&format!("/api/v1/sweeps/{id}/calibrations.csv")).body;
    let csv = String::from_utf8(csv).expect("UTF-8");
    assert!(csv.lines().count() == 1 + kinds.len() && !csv.contains("NaN") && !csv.contains("inf"));
    let runs = server.json(&format!("/api/v1/sweeps/{id}/runs"));
    let run_id = runs["items"][0]["run_id"].as_str().expect("an id");
    let stored = server.json(&format!("/api/v1/runs/{run_id}"));
    for part in ["fit", "estimates", "identifiability", "residuals", "starts"] {
        assert_eq!(stored["calibration"][part], printed["calibration"][part], "{part}");
    }
    assert_eq!(stored["calibration"]["mcmc"]["marginals"].as_array().map(Vec::len), Some(2));
    assert!(server.terminate());
    let data = folder.path().to_str().expect("UTF-8");
    let output = melange(&["verify", "--data", data], "");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stdout));
}

#[test]
fn what_cannot_be_found_is_refused() {
    let exact = exact();
    let with = |path: &str, value: Value| {
        let mut scenario = exact.clone();
        let (object, member) = path.rsplit_once('/').expect("a path");
        scenario.pointer_mut(object).expect("a member")[member] = value;
        scenario
    };
    let at = "/calibration/observations/0";
    for (scenario, field, word) in [
        (json!({"regime": "calibration"}), "calibration", "missing"),
        (
            with("/calibration/parameters", json!({"b": [0, 1e5]})),
            "calibration.parameters.b[0]",
            "from 1 on",
        ),
        (
            with("/calibration/parameters", json!({"b": [1e5, 1e4]})),
            "calibration.parameters.b[1]",
            "above",
        ),
        (with("/calibration/parameters", json!({"b": [1e5, 1e6]})), "parameters.b", "first start"),
        (with("/calibration/parameters", json!({"c": [1, 2]})), "calibration.parameters", "mu_s"),
        (
            with("/calibration/parameters", json!({})),
            "calibration.observations",
            "at least one parameter",
        ),
        (
            with(&format!("{at}/quantity"), json!("speed")),
            "calibration.observations[0].quantity",
            "thickness_m",
        ),
        (
            with(&format!("{at}/quantity"), json!("thickness_m")),
            "calibration.observations[0].x_m",
            "missing",
        ),
        (
            with(&format!("{at}/x_m"), json!(3)),
            "calibration.observations[0].x_m",
            "no such coordinate",
        ),
        (
            with(&format!("{at}/standard_error"), json!(0)),
            "calibration.observations[0].standard_error",
            "above 0",
        ),
        (with("/calibration/starts", json!(0)), "calibration.starts", "from 1 to"),
        (with("/calibration/mcmc", json!({"walkers": 7})), "calibration.mcmc.walkers", "even"),
        (
            with("/calibration/mcmc", json!({"steps": 1e9 as u64})),
            "calibration.mcmc.steps",
            "at most",
        ),
        (
            with("/calibration/mcmc", json!({"steps": 10_000})),
            "calibration.mcmc.thin",
            "100000 samples",
        ),
        (with("/calibration/mcmc", json!({"thin": 0})), "calibration.mcmc.thin", "from 1 on"),
        (
            with("/calving_law", json!({"rate_m_per_a": 6000})),
            "calving_law",
            "not for `calibration`",
        ),
    ] {
        let (code, refusal) = run(&scenario.to_string());
        assert_eq!((code, refusal["field"].as_str()), (2, Some(field)), "{scenario}: {refusal}");
        assert!(refusal["detail"].as_str().expect("why").contains(word), "{word}: {refusal}");
    }
    let mut ragged = exact.clone();
    ragged["calibration"]["observations"] =
        json!({"quantity": ["length_m"], "value": [1, 2], "standard_error": [1]});
    let (code, refusal) = run(&ragged.to_string());
    assert_eq!(code, 2);
    assert!(refusal["detail"].as_str().expect("why").contains("different lengths"), "{refusal}");
}
