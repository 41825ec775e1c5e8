//! Branches of steady states and curves of their folds: by themselves, in the terminal, in sweeps.

use crate::tables::read;
use crate::{assert_close, number};
use arrow_array::cast::AsArray;
use arrow_array::types::Float64Type;
use melange_tests::{Server, folder, melange, root, run};
use serde_json::{Value, json};
use std::thread::sleep;
use std::time::Duration;

/// The branch of `examples/collapse.toml`, with another number of cells.
fn collapse(n_cells: u32) -> Value {
    json!({
        "regime": "branch", "melt_shape": "linear",
        "parameters": {"melt_rate_m_per_day": 0.35, "width_m": 5600, "n_cells": n_cells},
        "branch": {"control": "melt_rate_m_per_day", "from": 0.1, "to": 0.5, "roots_at": [0.42]},
    })
}

fn example(name: &str) -> String {
    root().join("examples").join(name).display().to_string()
}

fn rows<'a>(curve: &'a Value, kind: &str) -> &'a Vec<Value> {
    curve[kind].as_array().unwrap_or_else(|| panic!("no {kind}"))
}

/// The fold is that of the extended system, solved to rounding by other means.
#[test]
fn a_branch_turns_round_where_the_mélange_collapses() {
    for (n_cells, melt, length, h0) in
        [(20, 0.425_457_37, 10_323.8, 39.642), (50, 0.425_173_58, 10_077.9, 39.537)]
    {
        let (code, result) = run(&collapse(n_cells).to_string());
        assert_eq!((code, result["status"].as_str()), (0, Some("converged")), "{result}");
        let branch = &result["branch"];
        assert_eq!(
            (&branch["control"], &branch["unit"]),
            (&json!("melt_rate_m_per_day"), &json!("m d-1"))
        );
        let folds = rows(branch, "folds");
        assert_eq!(folds.len(), 1, "{folds:?}");
        assert_close("melt", &folds[0]["control_value"], &json!(melt), 1e-6);
        assert_close("L", &folds[0]["length_m"], &json!(length), 1e-5);
        assert_close("H0", &folds[0]["thickness_0_m"], &json!(h0), 2e-5);
        assert_eq!(folds[0]["is_maximum"], true);
        assert!(folds[0].get("stable").is_none() && folds[0].get("is_picked").is_none());
        let points = rows(branch, "points");
        assert!(points.len() > 10, "{} points", points.len());
        for pair in points.windows(2) {
            assert!(number(&pair[1]["arclength"]) > number(&pair[0]["arclength"]));
        }
        for point in points {
            let (re, im) = (&point["growth_rate_re_per_a"], &point["growth_rate_im_per_a"]);
            assert_eq!(
                (re.as_array().map(Vec::len), im.as_array().map(Vec::len)),
                (Some(3), Some(3))
            );
            assert_eq!(point["stable"], number(&re[0]) < 0.0, "{point}");
            assert_eq!(point["stable"], point["unstable_count"] == 0, "{point}");
            assert_eq!(point["segment"] == 0, point["stable"] == true, "{point}");
        }
        let roots = rows(branch, "roots");
        let stable: Vec<&Value> = roots.iter().map(|root| &root["stable"]).collect();
        assert_eq!(stable, [&json!(true), &json!(false)], "{roots:?}");
        let picked: Vec<&Value> = roots.iter().map(|root| &root["is_picked"]).collect();
        assert_eq!(picked, [&json!(true), &json!(false)], "{roots:?}");
        for root in roots {
            assert_close("melt", &root["control_value"], &json!(0.42), 1e-12);
        }
        assert!(points.iter().all(|point| point.get("is_picked").is_none()));
        assert_eq!(rows(branch, "ends").len(), 2);
        let start = points.iter().find(|point| point["step"] == 0.0).expect("a start");
        assert_eq!(start["length_m"], result["length_m"]);
        // The start is the steady state of its parameters.
        let mut steady = collapse(n_cells);
        steady["regime"] = "steady".into();
        steady.as_object_mut().expect("members").remove("branch");
        let (_, steady) = run(&steady.to_string());
        assert_close("L", &result["length_m"], &steady["length_m"], 1e-7);
        assert_close("F", &result["force_n_per_m"], &steady["force_n_per_m"], 1e-7);
    }
}

#[test]
fn a_branch_is_drawn_in_the_terminal() {
    let output = melange(&["branch", &example("collapse.toml")], "");
    assert!(output.status.success());
    let text = String::from_utf8(output.stdout).expect("UTF-8");
    for expected in [
        "F",
        "0.42545737",
        "39.6423",
        "maximum",
        "the rule's  stability",
        "yes         stable",
        "no          unstable",
        "ends",
    ] {
        assert!(text.contains(expected), "{expected} is missing:\n{text}");
    }
    let file = example("collapse.toml");
    let output = melange(&["run", &file, "--format", "text"], "");
    let text = String::from_utf8(output.stdout).expect("UTF-8");
    assert_eq!(text.lines().last(), Some(format!("`melange branch {file}` draws it").as_str()));
    let output = melange(&["branch", &example("collapse.toml"), "--format", "json"], "");
    let result: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!(result["regime"], "branch");
    let output = melange(&["branch", "-"], r#"{"regime": "steady"}"#);
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&output.stderr).contains("`melange run`"));
}

/// With less ice calving the more the mélange pushes, along the law's own numbers.
#[test]
fn a_branch_along_a_calving_law_and_one_without_a_start() {
    let base = json!({"regime": "branch", "parameters": {"n_cells": 20},
        "calving_law": {"rate_m_per_a": 7000, "per_force_m2_per_a_n": 1e-4},
        "branch": {"control": "rate_m_per_a", "from": 6000, "to": 8000, "stability": false,
            "roots_at": [7000]}});
    let (code, result) = run(&base.to_string());
    assert_eq!((code, result["status"].as_str()), (0, Some("converged")), "{result}");
    for point in rows(&result["branch"], "points") {
        assert!(point.get("stable").is_none() && number(&point["length_m"]) > 0.0, "{point}");
    }
    let roots = rows(&result["branch"], "roots");
    assert!(!roots.is_empty() && roots.iter().all(|root| root.get("is_picked").is_none()));
    let rate = 7000.0 - 1e-4 * number(&result["force_n_per_m"]);
    let inflow = rate * 600.0 * 4000.0;
    assert_close("inflow", &result["inflow_m3_per_a"], &json!(inflow), 1e-9);

    let mut none = collapse(20);
    none["parameters"] = json!({"melt_rate_m_per_day": 1.8, "width_m": 7000, "n_cells": 20});
    none["branch"]["to"] = 2.0.into();
    let (code, result) = run(&none.to_string());
    assert_eq!((code, result["status"].as_str()), (0, Some("no_steady_state")), "{result}");
    assert!(result.get("branch").is_none() && result["length_m"].is_null());
}

/// The thresholds at the ends are those of branches of their own.
#[test]
fn a_fold_is_followed_through_widths() {
    let text = std::fs::read_to_string(example("collapse-threshold.toml")).expect("the example");
    let output = melange(&["run", "-"], &text);
    let result: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!(result["status"], "converged", "{result}");
    let curve = &result["fold_curve"];
    assert_eq!(
        (&curve["control"], &curve["second"]),
        (&json!("melt_rate_m_per_day"), &json!("width_m"))
    );
    let points = rows(curve, "points");
    let at = |width: f64| {
        let found = points.iter().find(|p| number(&p["second_value"]) == width);
        found.unwrap_or_else(|| panic!("no fold at {width}"))
    };
    for (width, melt) in [(4000.0, 0.603_616), (5600.0, 0.425_457_37), (7000.0, 0.340_707)] {
        assert_close("melt", &at(width)["control_value"], &json!(melt), 1e-6);
        assert_eq!(at(width)["is_maximum"], true);
    }
    assert_eq!(at(5600.0)["length_m"], result["length_m"]);
    let ends: Vec<&Value> = rows(curve, "ends").iter().map(|end| &end["reason"]).collect();
    assert_eq!(ends, ["bound", "bound"]);

    let mut second = json!({
        "regime": "fold_curve", "melt_shape": "linear",
        "parameters": {"melt_rate_m_per_day": 0.35, "width_m": 5600, "n_cells": 20},
        "fold_curve": {"control": "melt_rate_m_per_day", "from": 0.1, "to": 0.7,
            "second": "width_m", "second_from": 4000, "second_to": 7000},
    });
    second["fold_curve"]["fold"] = 1.into();
    let (code, none) = run(&second.to_string());
    assert_eq!((code, none["status"].as_str()), (0, Some("no_fold")), "{none}");
    assert!(none["detail"].as_str().expect("why").contains("1 fold between"), "{none}");
    second["fold_curve"]["second"] = "melt_rate_m_per_day".into();
    let (_, refusal) = run(&second.to_string());
    assert_eq!(refusal["field"], "fold_curve.second");

    let drawn = melange(&["branch", &example("collapse-threshold.toml")], "");
    let drawn = String::from_utf8(drawn.stdout).expect("UTF-8");
    for expected in ["0.60361599", "width_m reaches its bound 7000", "maximum"] {
        assert!(drawn.contains(expected), "{expected} is missing:\n{drawn}");
    }

    // In a sweep: one that has the fold, one that has not.
    let folder = folder();
    let server = Server::start("serve", folder.path(), &[]);
    second["fold_curve"]["second"] = "width_m".into();
    second["fold_curve"]["fold"] = 0.into();
    second["parameters"].as_object_mut().expect("members").remove("n_cells");
    second["axes"] = json!([{"parameter": "n_cells", "values": [20, 24]}]);
    let id = server.submit(&second);
    assert_eq!(server.wait(&id)["counts"]["converged"], 2);
    let runs = server.json(&format!("/api/v1/sweeps/{id}/runs"));
    let run_id = runs["items"][0]["run_id"].as_str().expect("an id");
    assert_eq!(&server.json(&format!("/api/v1/runs/{run_id}"))["fold_curve"], curve);
    second["fold_curve"]["fold"] = 3.into();
    let id = server.submit(&second);
    assert_eq!(server.wait(&id)["counts"]["no_fold"], 2);
}

#[test]
fn what_cannot_be_followed_is_refused() {
    let with = |path: &str, value: Value| {
        let mut scenario = collapse(20);
        let (object, member) = path.rsplit_once('/').expect("a path");
        scenario.pointer_mut(object).expect("a member")[member] = value;
        scenario
    };
    let law = |law: Value| with("/calving_law", law);
    for (scenario, field, word) in [
        (json!({"regime": "branch"}), "branch", "missing"),
        (with("/branch/control", json!("melt")), "branch.control", "per_force_m2_per_a_n"),
        (with("/branch/control", json!("n_cells")), "branch.control", "one of"),
        (with("/branch/from", json!(-1)), "branch.from", "from 0 to 100 m d-1"),
        (with("/branch/to", json!(0.1)), "branch.to", "above branch.from = 0.1"),
        (
            with("/parameters/melt_rate_m_per_day", json!(0.6)),
            "parameters.melt_rate_m_per_day",
            "from 0.1 to 0.5",
        ),
        (with("/branch/roots_at", json!([0.2, 0.6])), "branch.roots_at[1]", "from 0.1 to 0.5"),
        (with("/branch/longest_step", json!(0)), "branch.longest_step", "0.001"),
        (with("/branch/most_points", json!(20_000)), "branch.most_points", "10000"),
        (with("/branch/most", json!(1)), "branch.most", "unknown field"),
        (with("/branch/control", json!("rate_m_per_a")), "branch.control", "calving law"),
        (with("/start", json!("steady")), "start", "does not depend"),
        (with("/time", json!({"duration_a": 1})), "time", "transient"),
        (law(json!("steady_feedback")), "calving_law", "Eq. 31"),
        (
            law(json!({"rate_m_per_a": 6000, "per_advance_per_a": 0.1})),
            "calving_law.per_advance_per_a",
            "X0 = 0",
        ),
        (
            json!({"regime": "branch", "branch": {"control": "d_m", "from": 10, "to": 700}}),
            "branch.to",
            "smaller than the terminus",
        ),
        (
            json!({"regime": "branch", "parameters": {"width_gradient": 0.01},
                "branch": {"control": "calving_rate_m_per_a", "from": 5000, "to": 7000}}),
            "branch.control",
            "along the bedrock",
        ),
        (
            json!({"regime": "steady", "branch": {"control": "b", "from": 1e3, "to": 1e5}}),
            "branch",
            "not for `steady`",
        ),
    ] {
        let (code, refusal) = run(&scenario.to_string());
        assert_eq!((code, refusal["field"].as_str()), (2, Some(field)), "{scenario}: {refusal}");
        assert!(refusal["detail"].as_str().expect("why").contains(word), "{word}: {refusal}");
    }
}

#[test]
fn a_sweep_of_branches_is_stored_shared_and_put_together() {
    let folder = folder();
    let server = Server::start("serve", folder.path(), &[]);
    let mut sweep = collapse(20);
    sweep["parameters"].as_object_mut().expect("members").remove("width_m");
    sweep["axes"] = json!([{"parameter": "width_m", "values": [5400, 5600, 5800]}]);
    let dry = server.post("/api/v1/sweeps?dry_run=true", &sweep.to_string()).json();
    assert_eq!((&dry["count"], &dry["reused"]), (&json!(3), &json!(0)), "{dry}");
    assert!(number(&dry["estimated_bytes"]) > 5_000.0, "{dry}");
    let id = server.submit(&sweep);
    assert_eq!(server.wait(&id)["counts"]["converged"], 3);
    let table = |id: &str| read(server.get(&format!("/api/v1/sweeps/{id}/branches.parquet")).body);
    let before = table(&id);

    // What is stored is what is printed.
    let runs = server.json(&format!("/api/v1/sweeps/{id}/runs"));
    let run_id = runs["items"][1]["run_id"].as_str().expect("an id").to_owned();
    let stored = server.json(&format!("/api/v1/runs/{run_id}"));
    let (_, printed) = run(&collapse(20).to_string());
    assert_eq!(stored["branch"], printed["branch"]);
    assert_eq!(stored["detail"], printed["detail"]);

    // Long, with units and meanings; nothing that is no number.
    let schema = before[0].schema();
    assert!(schema.fields().iter().all(|f| f.metadata().contains_key("meaning")), "{schema}");
    let field = schema.field_with_name("growth_rate_re_per_a").expect("the column");
    assert_eq!(field.metadata()["unit"], "a-1");
    let (mut folds, mut points) = (Vec::new(), 0);
    for batch in &before {
        let column = |name: &str| batch.column_by_name(name).expect("a column");
        let kinds = column("kind").as_string::<i32>();
        let values = column("control_value").as_primitive::<Float64Type>();
        assert!(values.iter().flatten().all(f64::is_finite));
        for (row, kind) in kinds.iter().enumerate() {
            match kind {
                Some("fold") => folds.push(values.value(row)),
                Some("point") => points += 1,
                _ => {}
            }
        }
    }
    assert_eq!(folds.len(), 3, "{folds:?}");
    assert!((folds[1] - 0.425_457_37).abs() < 1e-6 && points > 30, "{folds:?}, {points}");
    let csv = server.get(&format!("/api/v1/sweeps/{id}/branches.csv"));
    let csv = String::from_utf8(csv.body).expect("UTF-8");
    let lines: usize = before.iter().map(|batch| batch.num_rows()).sum();
    assert_eq!(csv.lines().count(), 1 + lines);
    assert!(!csv.contains("NaN") && !csv.contains("inf"));

    // Known runs are taken over; another bound makes another run, a default that is written out does not.
    let mut again = sweep.clone();
    again["branch"]["longest_step"] = 0.3.into();
    let shared = server.submit(&again);
    assert_eq!(server.wait(&shared)["reused"], 3);
    assert_eq!(table(&shared).iter().map(|batch| batch.num_rows()).sum::<usize>(), lines);
    again["branch"]["to"] = 0.6.into();
    let other = server.submit(&again);
    assert_eq!(server.wait(&other)["reused"], 0);

    // Put together, the table is the same.
    sleep(Duration::from_secs(2));
    let put_together = table(&id);
    let column = |batches: &[arrow_array::RecordBatch]| -> Vec<Option<f64>> {
        let of = |b: &arrow_array::RecordBatch| {
            let column = b.column_by_name("length_m").expect("a column").clone();
            column.as_primitive::<Float64Type>().iter().collect::<Vec<_>>()
        };
        batches.iter().flat_map(of).collect()
    };
    assert_eq!(column(&put_together), column(&before));
    assert!(server.terminate());
    let data = folder.path().to_str().expect("UTF-8");
    let verify = |more: &[&str]| melange(&[&["verify", "--data", data], more].concat(), "");
    assert!(verify(&[]).status.success());

    // A damaged table is solved again, for both sweeps that live in it.
    let files =
        std::fs::read_dir(folder.path().join("archive").join(&id)).expect("the sweep's folder");
    let paths = files.map(|file| file.expect("a file").path());
    let path = paths.into_iter().find(|path| path.to_string_lossy().ends_with("-branches.parquet"));
    let path = path.expect("a table of branches");
    let mut bytes = std::fs::read(&path).expect("readable");
    let middle = bytes.len() / 2;
    bytes[middle] ^= 16;
    std::fs::write(&path, bytes).expect("writable");
    assert_eq!(verify(&[]).status.code(), Some(1));
    assert!(verify(&["--repair"]).status.success());
    let server = Server::start("serve", folder.path(), &[]);
    for id in [&id, &shared] {
        assert_eq!(server.wait(id)["counts"]["converged"], 3);
        let rows = read(server.get(&format!("/api/v1/sweeps/{id}/branches.parquet")).body);
        assert_eq!(column(&rows), column(&before));
    }
}
