//! Sensitivity indices: a design solved by the real model, against indices computed without us, and what has none.

use crate::{assert_close, melt_sweep, number};
use melange_tests::{Server, folder, melange, python};
use serde_json::{Value, json};
use std::thread::sleep;
use std::time::{Duration, Instant};

/// A design of n base points whose runs all converge.
fn design(n: usize) -> Value {
    json!({
        "name": "rheology", "regime": "steady", "parameters": {"n_cells": 20},
        "sample": {"method": "saltelli", "n": n, "seed": 3,
                   "ranges": {"mu_s": [0.28, 0.32], "b": {"log": [2.5e4, 3.5e4]}, "d_m": [22, 28]}},
    })
}

fn path(id: &str, query: &str) -> String {
    format!("/api/v1/sweeps/{id}/indices?{query}")
}

/// The sentence with which indices are refused.
fn refused(server: &Server, id: &str, query: &str, status: u16) -> String {
    let answer = server.get(&path(id, query));
    let problem = answer.json();
    assert_eq!((answer.status, &problem["status"]), (status, &json!(status)), "{problem}");
    assert_eq!(answer.content_type, "application/problem+json");
    problem["detail"].as_str().expect("a sentence").to_owned()
}

#[test]
fn indices_of_a_sweep_are_those_of_its_table() {
    const N: usize = 32;
    let folder = folder();
    let server = Server::start("serve", folder.path(), &[]);
    let counted = server.post("/api/v1/sweeps?dry_run=true", &design(N).to_string()).json();
    assert_eq!(counted["count"], 5 * N, "{counted}");
    let id = server.submit(&design(N));
    let sweep = server.wait(&id);
    assert_eq!(sweep["counts"]["converged"], 5 * N, "{sweep}");
    for (y, scale) in
        [("force_n_per_m", "linear"), ("force_n_per_m", "log"), ("length_m", "linear")]
    {
        let told = server.json(&path(&id, &format!("y={y}&scale={scale}&resamples=2000&seed=7")));
        let script = include_str!("../../python/indices.py");
        let printed = python(script, &[&server.address, &id, y, scale], folder.path());
        let anew: Value = serde_json::from_str(&printed).expect("JSON");
        assert_eq!(told["y"], y);
        assert_eq!(told["scale"], scale);
        assert_eq!((&told["n"], &told["seed"]), (&json!(N), &json!(7)));
        assert_eq!(told["resamples"], 2000);
        for name in ["mean", "variance", "sum_of_first"] {
            assert_close(name, &told[name], &anew[name], 1e-10);
        }
        let told = told["indices"].as_array().expect("indices");
        let anew = anew["indices"].as_array().expect("indices");
        assert_eq!(told.len(), 3);
        for (told, anew) in told.iter().zip(anew) {
            assert_eq!(told["parameter"], anew["parameter"]);
            for order in ["first", "total"] {
                let (told, anew) = (&told[order], &anew[order]);
                assert_close(order, &told["estimate"], &anew["estimate"], 1e-9);
                // Other resamples: the ends agree as far as their own errors let them.
                let ends = |of: &Value| [0, 1].map(|i| number(&of["ci95"][i]));
                let ([low, high], [low_anew, high_anew]) = (ends(told), ends(anew));
                let width = high_anew - low_anew;
                assert!((low - low_anew).abs() < 0.15 * width, "{told} and {anew}");
                assert!((high - high_anew).abs() < 0.15 * width, "{told} and {anew}");
            }
        }
    }

    // The command tells the same as the service, and people what it means.
    let data = folder.path().to_str().expect("UTF-8");
    let command = |more: &[&str]| {
        let mut arguments = vec!["indices", &id, "--data", data, "--y", "force_n_per_m"];
        arguments.extend(more);
        let output = melange(&arguments, "");
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).expect("UTF-8")
    };
    let told: Value =
        serde_json::from_str(&command(&["--scale", "log", "--format", "json"])).expect("JSON");
    assert_eq!(told, server.json(&path(&id, "y=force_n_per_m&scale=log")));
    let text = command(&[]);
    assert!(text.contains("\nmu_s ") && text.contains("10.1016/j.cpc.2009.09.018"), "{text}");

    // A run tells the seed of its design, and a longer design takes over what a shorter one has.
    let runs = server.json(&format!("/api/v1/sweeps/{id}/runs?limit=1"));
    let run = runs["items"][0]["run_id"].as_str().expect("an id");
    assert_eq!(server.json(&format!("/api/v1/runs/{run}"))["provenance"]["seed"], 3);
    let longer = server.submit(&design(2 * N));
    assert_eq!(server.wait(&longer)["reused"], 5 * N);
    assert_eq!(server.json(&path(&longer, "y=force_n_per_m"))["n"], 2 * N);
}

#[test]
fn what_is_no_whole_design_has_no_indices() {
    let folder = folder();
    let server = Server::start("serve", folder.path(), &[]);
    let of = |sample: Value| json!({"regime": "steady", "parameters": {"n_cells": 20}, "sample": sample});

    let grid = server.submit(&melt_sweep(3));
    server.wait(&grid);
    let told = refused(&server, &grid, "y=force_n_per_m", 409);
    assert!(told.contains("saltelli"), "{told}");
    refused(&server, "none", "y=force_n_per_m", 404);

    // Slopes of both signs have no logarithm; by themselves they make all of their variance.
    let slopes = server.submit(&of(json!({
        "method": "saltelli", "n": 16, "ranges": {"width_gradient": [-0.001, 0.001], "d_m": [24, 26]},
    })));
    assert_eq!(server.wait(&slopes)["counts"]["converged"], 64);
    for (query, words) in [
        ("y=force", "`y`"),
        ("y=status", "`y`"),
        ("y=force_n_per_m&resamples=99", "`resamples`"),
        ("y=force_n_per_m&resamples=10001", "`resamples`"),
    ] {
        let told = refused(&server, &slopes, query, 422);
        assert!(told.contains(words), "{told}");
    }
    for query in ["", "y=force_n_per_m&scale=cubic", "y=force_n_per_m&order=2", "y=b&seed=-1"] {
        refused(&server, &slopes, query, 400);
    }
    let told = refused(&server, &slopes, "y=width_gradient&scale=log", 409);
    assert!(told.contains("of 64 runs") && told.contains("not positive"), "{told}");
    let told = refused(&server, &slopes, "y=width_m", 409);
    assert!(told.contains("the same in all runs"), "{told}");
    let indices = server.json(&path(&slopes, "y=width_gradient"));
    assert_eq!(indices["indices"][0]["parameter"], "d_m");
    assert_eq!(indices["indices"][0]["first"]["estimate"], 0.0);
    assert_eq!(indices["indices"][0]["total"]["ci95"], json!([0.0, 0.0]));
    assert!((number(&indices["indices"][1]["total"]["estimate"]) - 1.0).abs() < 0.3);

    // Some of its runs have no steady state, and so no force.
    let wide = server.submit(&of(json!({
        "method": "saltelli", "n": 4, "ranges": {"melt_rate_m_per_day": [0.5, 90], "d_m": [24, 26]},
    })));
    let counts = server.wait(&wide)["counts"].clone();
    let without = 16 - counts["converged"].as_i64().expect("a count");
    assert!(without > 0, "{counts}");
    let told = refused(&server, &wide, "y=force_n_per_m", 409);
    assert!(told.starts_with(&format!("{without} of 16 runs have no `force_n_per_m`")), "{told}");
    assert!(told.contains(&format!("{} no_steady_state", counts["no_steady_state"])), "{told}");

    // Paused before it could end.
    let mut long = of(json!({
        "method": "saltelli", "n": 2048, "ranges": {"b": [2.5e4, 3.5e4], "d_m": [22, 28]},
    }));
    long["options"] = json!({"grid_error": true});
    let long = server.submit(&long);
    server.ask(&long, "pause");
    let begin = Instant::now();
    let sweep = loop {
        let sweep = server.json(&format!("/api/v1/sweeps/{long}"));
        if sweep["counts"]["running"] == 0 {
            break sweep;
        }
        assert!(begin.elapsed() < Duration::from_secs(60), "{sweep}");
        sleep(Duration::from_millis(30));
    };
    let told = refused(&server, &long, "y=force_n_per_m", 409);
    let queued = &sweep["counts"]["queued"];
    assert!(told.starts_with(&format!("{queued} of 8192 runs have no result yet")), "{told}");
    assert!(told.contains(&format!("({queued} queued)")), "{told}");

    // Designs that tell nothing are not taken.
    for (sample, field) in [
        (json!({"method": "saltelli", "n": 64, "ranges": {"b": [1e4, 2e4]}}), "sample.ranges"),
        (
            json!({"method": "saltelli", "n": 1, "ranges": {"b": [1e4, 2e4], "d_m": [20, 30]}}),
            "sample.n",
        ),
        (
            json!({"method": "saltelli", "n": 250_001, "ranges": {"b": [1e4, 2e4], "d_m": [20, 30]}}),
            "sample.n",
        ),
    ] {
        let answer = server.post("/api/v1/sweeps", &of(sample).to_string());
        assert_eq!((answer.status, &answer.json()["field"]), (422, &json!(field)));
    }
}
