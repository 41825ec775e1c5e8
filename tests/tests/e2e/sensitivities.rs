//! Derivatives of steady states: against differences of runs, in sweeps, as a table.

use crate::number;
use crate::tables::read;
use arrow_array::Array;
use arrow_array::cast::AsArray;
use arrow_array::types::Float64Type;
use melange_tests::{Server, folder, melange, run};
use serde_json::{Value, json};

const QUANTITIES: [&str; 6] = [
    "length_m",
    "thickness_0_m",
    "force_n_per_m",
    "force_quasi_static_n_per_m",
    "velocity_end_m_per_a",
    "volume_m3",
];

fn solved(scenario: &Value) -> Value {
    let (code, result) = run(&scenario.to_string());
    assert_eq!((code, result["status"].as_str()), (0, Some("converged")), "{result}");
    result
}

fn steady(parameters: Value) -> Value {
    json!({"regime": "steady", "parameters": parameters, "options": {"sensitivities": true}})
}

#[test]
fn derivatives_are_those_of_neighbouring_runs() {
    let base = json!({"n_cells": 24, "width_gradient": 0.005, "water_drag_n_per_m": 0.0});
    let result = solved(&steady(base.clone()));
    let told = result["sensitivities"].as_array().expect("sensitivities");
    let names: Vec<&str> = told.iter().filter_map(|row| row["quantity"].as_str()).collect();
    assert_eq!(names, QUANTITIES);
    for (name, step) in [("melt_rate_m_per_day", 1e-4), ("d_m", 1e-4), ("mu_s", 1e-5), ("b", 1e-4)]
    {
        let value = number(&result["parameters"][name]);
        let beside = [1.0 - step, 1.0 + step].map(|share| {
            let mut parameters = base.clone();
            parameters[name] = json!(value * share);
            solved(&json!({"regime": "steady", "parameters": parameters}))
        });
        for row in told {
            let quantity = row["quantity"].as_str().expect("a name");
            assert_eq!(row["value"], result[quantity]);
            let change = number(&beside[1][quantity]) - number(&beside[0][quantity]);
            let expected = change / (2.0 * step * value);
            let by = number(&row[format!("by_{name}")]);
            assert!((by / expected - 1.0).abs() < 1e-3, "{quantity} by {name}: {by}, {expected}");
            let log = number(&row[format!("log_by_{name}")]);
            assert!((log / (by * value / number(&row["value"])) - 1.0).abs() < 1e-12);
        }
    }
    for row in told {
        // A parameter that is 0 has no logarithm; its derivative is there.
        assert!(
            row["by_water_drag_n_per_m"].is_number() && row["log_by_water_drag_n_per_m"].is_null()
        );
        // Of all cells together, the melt is that of the parameter, in m per day and not in m per year.
        let cells: f64 =
            row["by_melt_per_m_per_a"].as_array().expect("cells").iter().map(number).sum();
        assert_eq!(row["by_melt_per_m_per_a"].as_array().map(Vec::len), Some(24));
        let all = number(&row["by_melt_rate_m_per_day"]) / 365.25;
        assert!((cells / all - 1.0).abs() < 1e-9, "{cells}, {all}");
    }
}

#[test]
fn they_are_asked_for_and_part_of_what_a_run_is() {
    let plain = solved(&json!({"regime": "steady", "parameters": {"n_cells": 20}}));
    assert!(plain.get("sensitivities").is_none());
    let transient = json!({"regime": "transient", "time": {"duration_a": 0.1},
        "options": {"sensitivities": true}});
    let (code, refusal) = run(&transient.to_string());
    assert_eq!((code, &refusal["field"]), (2, &json!("options.sensitivities")), "{refusal}");

    let folder = folder();
    let server = Server::start("serve", folder.path(), &[]);
    let mut sweep = json!({"regime": "steady", "parameters": {"n_cells": 20},
        "axes": [{"parameter": "melt_rate_m_per_day", "values": [0.6, 0.7, 1.8]},
                 {"parameter": "width_m", "values": [4000, 7000]}]});
    let plain = server.submit(&sweep);
    server.wait(&plain);
    sweep["options"] = json!({"sensitivities": true});
    let id = server.submit(&sweep);
    let ended = server.wait(&id);
    assert_eq!(ended["reused"], 0, "other runs than those without");
    let converged = ended["counts"]["converged"].as_i64().expect("a count");
    assert!(converged >= 4, "{ended}");
    let again = server.submit(&sweep);
    assert_eq!(server.wait(&again)["reused"], 6);

    let table = |id: &str, ending: &str| {
        server.get(&format!("/api/v1/sweeps/{id}/sensitivities.{ending}")).body
    };
    assert_eq!(read(table(&plain, "parquet")).iter().map(|b| b.num_rows()).sum::<usize>(), 0);
    for id in [&id, &again] {
        let batches = read(table(id, "parquet"));
        let rows: usize = batches.iter().map(|b| b.num_rows()).sum();
        assert_eq!(rows as i64, 6 * converged);
        let first = &batches[0];
        let schema = first.schema();
        let field = schema.field_with_name("by_melt_rate_m_per_day").expect("the column");
        assert_eq!(field.metadata()["unit"], "(unit) per (m d-1)");
        let cells = first.column_by_name("by_melt_per_m_per_a").expect("the column");
        assert_eq!(cells.as_list::<i32>().value(0).len(), 20);
        let log = first.column_by_name("log_by_water_drag_n_per_m").expect("the column");
        assert_eq!(log.null_count(), first.num_rows());
        let by = first.column_by_name("by_d_m").expect("the column");
        assert!(by.as_primitive::<Float64Type>().iter().flatten().all(f64::is_finite));
        let csv = String::from_utf8(table(id, "csv")).expect("UTF-8");
        assert_eq!(csv.lines().count(), 1 + rows);
        assert!(!csv.contains("NaN"));
    }
    let runs = server.json(&format!("/api/v1/sweeps/{id}/runs"));
    let run_id = runs["items"][0]["run_id"].as_str().expect("an id");
    let stored = server.json(&format!("/api/v1/runs/{run_id}"));
    let rows = stored["sensitivities"].as_array().expect("rows");
    let names: Vec<&str> = rows.iter().filter_map(|row| row["quantity"].as_str()).collect();
    assert_eq!(names, QUANTITIES);
    assert_eq!(rows[0]["value"], stored["length_m"]);
    assert_eq!(rows[0]["unit"], "m");
}

#[test]
fn they_are_printed_in_logarithms() {
    let output =
        melange(&["run", "-", "--format", "text"], &steady(json!({"n_cells": 20})).to_string());
    let text = String::from_utf8(output.stdout).expect("UTF-8");
    let line =
        text.lines().find(|line| line.trim_start().starts_with("water_drag")).expect("a line");
    assert!(text.contains("d ln Q/d ln p") && line.contains(" -"), "{text}");
}
