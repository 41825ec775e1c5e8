//! Discrete roots of steady states: by themselves, in sweeps, as a table, as text.

use crate::number;
use crate::tables::read;
use arrow_array::RecordBatch;
use arrow_array::cast::AsArray;
use arrow_array::types::{Float64Type, Int64Type};
use melange_tests::{Server, folder, melange, root, run};
use serde_json::{Value, json};

/// Roots of the base case: H0, to the last digit told, and the cells at rest.
const KNOWN: [(f64, f64, &[i64]); 4] = [
    (149.415358, 1e-6, &[]),
    (149.415217, 1e-6, &[]),
    (149.415183, 1e-6, &[48]),
    (148.0598, 1e-4, &[1]),
];

const NUMBERS: [&str; 7] = [
    "length_m",
    "thickness_0_m",
    "force_n_per_m",
    "force_quasi_static_n_per_m",
    "velocity_end_m_per_a",
    "volume_m3",
    "residual_norm",
];

fn asked() -> Value {
    json!({"regime": "steady", "options": {"discrete_roots": true}})
}

/// The known roots are among these; the first one is picked and the run's own, no other is.
fn check(result: &Value) {
    let roots = result["discrete_roots"].as_array().expect("roots");
    for (thickness_m, digit, cells) in KNOWN {
        let is_it = |root: &&Value| (number(&root["thickness_0_m"]) - thickness_m).abs() < digit;
        let root = roots.iter().find(is_it);
        let root = root.unwrap_or_else(|| panic!("{thickness_m} m is missing: {roots:?}"));
        assert_eq!(root["cells_at_rest"], json!(cells), "{root}");
        assert_eq!(root["is_picked"], thickness_m == KNOWN[0].0, "{root}");
    }
    for (i, root) in roots.iter().enumerate() {
        assert_eq!((&root["root"], &root["is_picked"]), (&json!(i), &json!(i == 0)));
        assert_eq!(root["stable"], true, "{root}");
        assert!(number(&root["growth_rate_re_per_a"]) < 0.0);
        assert!(number(&root["residual_norm"]) < 1e-9, "{root}");
    }
    for name in NUMBERS {
        assert_eq!(roots[0][name], result[name], "{name}");
    }
    let detail = result["detail"].as_str().expect("a detail");
    let told = format!("; one of {} discrete roots found; the rule picks ", roots.len());
    assert!(detail.contains(&told) && detail.contains("no cell at rest"), "{detail}");
}

#[test]
fn the_known_roots_of_the_base_case_are_told() {
    let (code, result) = run(&asked().to_string());
    assert_eq!((code, result["status"].as_str()), (0, Some("converged")), "{result}");
    check(&result);
    // The run itself is as it is without.
    let (_, plain) = run(r#"{"regime": "steady"}"#);
    for (name, value) in plain.as_object().expect("members") {
        let is_its_own = ["detail", "provenance"].contains(&name.as_str());
        assert!(is_its_own || *value == result[name], "{name}");
    }
    assert!(plain.get("discrete_roots").is_none());
    let transient = json!({"regime": "transient", "time": {"duration_a": 0.1},
        "options": {"discrete_roots": true}});
    let (code, refusal) = run(&transient.to_string());
    assert_eq!((code, &refusal["field"]), (2, &json!("options.discrete_roots")), "{refusal}");
}

fn rows(batches: &[RecordBatch]) -> usize {
    batches.iter().map(|batch| batch.num_rows()).sum()
}

#[test]
fn roots_are_a_table_of_a_sweep() {
    let folder = folder();
    let server = Server::start("serve", folder.path(), &[]);
    let mut sweep = json!({"regime": "steady",
        "axes": [{"parameter": "melt_rate_m_per_day", "values": [0.6, 0.7]}]});
    let plain = server.submit(&sweep);
    server.wait(&plain);
    sweep["options"] = json!({"discrete_roots": true});
    let id = server.submit(&sweep);
    let ended = server.wait(&id);
    assert_eq!((&ended["reused"], &ended["counts"]["converged"]), (&json!(0), &json!(2)));
    let again = server.submit(&sweep);
    assert_eq!(server.wait(&again)["reused"], 2);

    let table =
        |id: &str, ending: &str| server.get(&format!("/api/v1/sweeps/{id}/roots.{ending}")).body;
    assert_eq!(rows(&read(table(&plain, "parquet"))), 0);
    let runs = server.json(&format!("/api/v1/sweeps/{id}/runs"));
    let mut base = runs["items"].as_array().expect("items").iter();
    let base = base.find(|run| run["melt_rate_m_per_day"] == 0.6).expect("the base case");
    let run_id = base["run_id"].as_str().expect("an id");
    let stored = server.json(&format!("/api/v1/runs/{run_id}"));
    check(&stored);
    let told = stored["discrete_roots"].as_array().expect("roots");
    for id in [&id, &again] {
        let batches = read(table(id, "parquet"));
        let mut found = Vec::new();
        for batch in &batches {
            let column = |name: &str| batch.column_by_name(name).expect("the column");
            let ids = column("run_id").as_string::<i32>();
            let cells = column("cells_at_rest").as_list::<i32>();
            for row in (0..batch.num_rows()).filter(|row| ids.value(*row) == run_id) {
                let number =
                    |name: &str| json!(column(name).as_primitive::<Float64Type>().value(row));
                let flag = |name: &str| json!(column(name).as_boolean().value(row));
                let mut read = json!({
                    "root": column("root").as_primitive::<Int64Type>().value(row),
                    "is_picked": flag("is_picked"),
                    "stable": flag("stable"),
                    "cells_at_rest": cells.value(row).as_primitive::<Int64Type>().values().to_vec(),
                    "growth_rate_re_per_a": number("growth_rate_re_per_a"),
                });
                NUMBERS.iter().for_each(|name| read[*name] = number(name));
                found.push(read);
            }
            let schema = batch.schema();
            let field = schema.field_with_name("growth_rate_re_per_a").expect("the column");
            assert_eq!(field.metadata()["unit"], "a-1");
        }
        assert_eq!(&found, told);
        let csv = String::from_utf8(table(id, "csv")).expect("UTF-8");
        assert_eq!(csv.lines().count(), 1 + rows(&batches));
        assert!(csv.contains(",[48],true,") && !csv.contains("NaN"), "{csv}");
    }
}

#[test]
fn roots_are_listed_in_the_terminal() {
    let example = root().join("examples/discrete-roots.toml").display().to_string();
    let output = melange(&["run", &example, "--format", "text"], "");
    let text = String::from_utf8(output.stdout).expect("UTF-8");
    let line = |part: &str| {
        let found = text.lines().find(|line| line.trim_start().starts_with(part));
        found.unwrap_or_else(|| panic!("{part} is missing:\n{text}"))
    };
    assert!(line("discrete roots").ends_with("cells at rest"));
    assert!(line("the rule's").contains("149.415358") && line("the rule's").ends_with("none"));
    assert!(line("149.415183").ends_with("stable  48"), "{text}");
    assert!(line("148.0597").ends_with("stable  1"), "{text}");
}
