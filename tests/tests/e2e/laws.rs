//! What pictures of a whole sweep are drawn from: columns, laws of groups, reasons of failures, sizes, what varies.

use crate::finding::query;
use crate::melt_sweep;
use melange_tests::{Server, folder, python};
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

/// Members of a query.
type Members = &'static [(&'static str, &'static str)];

/// Three parameters, with mélanges that are no longer any and such as are too thick among them.
fn three_parameters() -> Value {
    json!({
        "name": "three", "regime": "steady", "parameters": {"n_cells": 12},
        "axes": [
            {"parameter": "melt_rate_m_per_day", "linspace": [0.4, 1.2, 9]},
            {"parameter": "width_m", "values": [3000, 6000]},
            {"parameter": "b", "logspace": [5e3, 1e5, 4]},
            {"option": "upstream_closure", "values": ["published", "no_stretching"]},
        ],
    })
}

fn bytes_below(folder: &Path) -> u64 {
    let entries =
        fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry").path());
    entries
        .map(|path| {
            if path.is_dir() {
                bytes_below(&path)
            } else {
                fs::metadata(&path).expect("a file").len()
            }
        })
        .sum()
}

#[test]
fn columns_and_laws_are_what_pandas_and_numpy_make_of_the_table() {
    let folder = folder();
    let server = Server::start("serve", folder.path(), &[]);
    let id = server.submit(&three_parameters());
    server.wait(&id);
    let script = include_str!("../../python/laws.py");
    let told = python(script, &[&format!("{}/api/v1/sweeps/{id}", server.address)], folder.path());
    assert_eq!(told.trim(), "144");
    // One run by its index, as a picture asks for it when a point is touched.
    let one = server.json(&query(&format!("/sweeps/{id}/runs"), &[("filter", "run_index = 7")]));
    assert_eq!((&one["total"], &one["is_exact"]), (&json!(1), &json!(true)));
    assert_eq!(one["items"][0]["run_index"], 7);
    assert!(server.terminate());
}

#[test]
fn failures_are_put_together_by_what_they_say() {
    let folder = folder();
    let server = Server::start("serve", folder.path(), &[]);
    let id = server.submit(&three_parameters());
    let counts = server.wait(&id)["counts"].clone();
    let told = server.json(&format!("/api/v1/sweeps/{id}/failures"));
    let failed = 144 - counts["converged"].as_i64().expect("a number");
    assert_eq!((told["total"].as_i64(), &told["others"]), (Some(failed), &json!(0)));
    let groups = told["groups"].as_array().expect("groups");
    let sizes: Vec<i64> = groups.iter().map(|g| g["count"].as_i64().expect("a number")).collect();
    assert_eq!(sizes.iter().sum::<i64>(), failed);
    // Nearly every run has numbers of its own in its sentence.
    assert!(sizes.len() <= 6 && sizes[0] > 3, "{told}");
    assert!(sizes.is_sorted_by(|a, b| a >= b), "{sizes:?}");
    for status in ["no_steady_state", "overthick"] {
        let its = groups.iter().filter(|group| group["status"] == status);
        let sum: i64 = its.clone().map(|group| group["count"].as_i64().expect("a number")).sum();
        assert_eq!(Some(sum), counts[status].as_i64(), "{told}");
        assert!(sum > 1, "{counts}");
        let reasons: BTreeSet<&str> = its.map(|g| g["reason"].as_str().expect("a text")).collect();
        assert!(reasons.iter().all(|reason| reason.contains('…')), "{reasons:?}");
    }
    for group in groups {
        let examples = group["examples"].as_array().expect("examples");
        let expected = group["count"].as_u64().expect("a number").min(3);
        assert_eq!(examples.len() as u64, expected);
        for example in examples {
            let run = server
                .json(&format!("/api/v1/runs/{}", example["run_id"].as_str().expect("an id")));
            assert_eq!((&run["status"], &run["detail"]), (&group["status"], &example["detail"]));
        }
    }
    let well = server.submit(&melt_sweep(3));
    server.wait(&well);
    let none = server.json(&format!("/api/v1/sweeps/{well}/failures"));
    assert_eq!(none, json!({"total": 0, "groups": [], "others": 0}));
    assert!(server.terminate());
}

#[test]
fn a_sweep_tells_what_varies_and_how_large_its_own_files_are() {
    let folder = folder();
    let server = Server::start("serve", folder.path(), &[]);
    let archive = folder.path().join("archive");
    let first = server.submit(&json!({
        "regime": "steady", "parameters": {"n_cells": 20},
        "axes": [
            {"parameter": "width_m", "values": [4000]},
            {"parameter": "melt_rate_m_per_day", "values": [0.6, 0.7, 0.8, 0.9]},
            {"parameter": "A", "values": [0.6, 0.4]},
        ],
    }));
    server.wait(&first);
    let sweep = |id: &str| server.json(&format!("/api/v1/sweeps/{id}"));
    // Files are put together when a sweep has ended; what was there before is gone a moment later.
    let settled = |ids: &[&str]| {
        let told =
            || ids.iter().map(|id| sweep(id)["bytes"].as_u64().expect("a number")).sum::<u64>();
        for _ in 0..200 {
            if told() == bytes_below(&archive) {
                return;
            }
            std::thread::sleep(std::time::Duration::from_millis(50));
        }
        panic!("{} bytes are told, {} there", told(), bytes_below(&archive));
    };
    settled(&[&first]);
    assert!(bytes_below(&archive) > 1000);
    let varies = json!([
        {"parameter": "A", "min": 0.4, "max": 0.6},
        {"parameter": "melt_rate_m_per_day", "min": 0.6, "max": 0.9},
    ]);
    assert_eq!(sweep(&first)["varies"], varies);
    // The same runs again have no files of their own; with one more, they have those of that one.
    let again = |values: &[f64]| {
        let id = server.submit(&json!({
            "regime": "steady", "parameters": {"n_cells": 20},
            "axes": [{"parameter": "melt_rate_m_per_day", "values": values}, {"parameter": "A", "values": [0.4]}],
        }));
        server.wait(&id);
        id
    };
    let taken_over = again(&[0.6, 0.7, 0.8, 0.9]);
    let told = sweep(&taken_over);
    assert_eq!((&told["reused"], &told["bytes"]), (&json!(4), &json!(0)));
    assert_eq!(told["varies"][0]["parameter"], "melt_rate_m_per_day");
    assert_eq!(told["varies"].as_array().map(Vec::len), Some(1));
    let one_more = again(&[0.6, 0.65]);
    settled(&[&first, &one_more]);
    assert_eq!(sweep(&one_more)["reused"], 1);
    // Lists and what changes a sweep tell the same.
    let list = server.json("/api/v1/sweeps");
    for item in list["items"].as_array().expect("items") {
        let alone = sweep(item["id"].as_str().expect("an id"));
        assert_eq!((&item["bytes"], &item["varies"]), (&alone["bytes"], &alone["varies"]));
    }
    let edited = server.patch(&format!("/api/v1/sweeps/{first}"), r#"{"name": "other"}"#).json();
    assert_eq!((&edited["bytes"], &edited["varies"]), (&sweep(&first)["bytes"], &varies));
    assert!(server.terminate());
}

#[test]
fn what_cannot_be_drawn_is_refused_with_its_field() {
    let folder = folder();
    let server = Server::start("serve", folder.path(), &[]);
    let id = server.submit(&melt_sweep(3));
    server.wait(&id);
    const MELT: (&str, &str) = ("x", "melt_rate_m_per_day");
    const FORCE: (&str, &str) = ("y", "force_n_per_m");
    let refused: [(&str, Members, &str); 13] = [
        ("columns", &[("names", "no_such")], "names"),
        ("columns", &[("names", "b,,A")], "names"),
        ("columns", &[("names", "b, A")], "names"),
        ("columns", &[("names", "b\" FROM runs --")], "names"),
        ("columns", &[("most", "0")], "most"),
        ("columns", &[("most", "200001")], "most"),
        ("columns", &[("filter", "b =")], "filter"),
        ("laws", &[("x", "status"), FORCE], "x"),
        ("laws", &[MELT, ("y", "run_index")], "y"),
        ("laws", &[MELT, FORCE, ("group_by", "regime")], "group_by"),
        ("laws", &[MELT, FORCE, ("filter", "nothing = 1")], "filter"),
        ("laws", &[MELT, FORCE, ("most", "-1")], "most"),
        ("fit", &[MELT, FORCE, ("filter", "b = 'x'")], "filter"),
    ];
    for (path, members, field) in refused {
        let answer = server.get(&query(&format!("/sweeps/{id}/{path}"), members));
        let problem = answer.json();
        assert_eq!((answer.status, &problem["field"]), (422, &json!(field)), "{path} {members:?}");
        assert!(problem["permitted"].is_string() && !problem["value"].is_null(), "{problem}");
    }
    let unread: [(&str, Members); 7] = [
        ("columns", &[("most", "many")]),
        ("columns", &[("name", "b")]),
        ("laws", &[MELT]),
        ("laws", &[MELT, FORCE, ("model", "cubic")]),
        ("laws", &[MELT, FORCE, ("group-by", "b")]),
        ("fit", &[FORCE]),
        ("failures", &[("filter", "b = 1")]),
    ];
    for (path, members) in unread {
        let answer = server.get(&query(&format!("/sweeps/{id}/{path}"), members));
        assert_eq!(answer.status, 400, "{path} {members:?}");
        assert_eq!(answer.content_type, "application/problem+json");
    }
    for path in ["columns", "failures", "laws?x=b&y=b", "fit?x=b&y=b"] {
        assert_eq!(server.get(&format!("/api/v1/sweeps/none/{path}")).status, 404, "{path}");
    }
    // Too few runs are no error where others may have enough, and one where there is nothing else.
    let members = [MELT, FORCE, ("filter", "run_index < 2")];
    let laws = server.json(&query(&format!("/sweeps/{id}/laws"), &members));
    assert_eq!((&laws["groups"][0]["fit"], &laws["shown"]), (&Value::Null, &json!(2)));
    assert_eq!(server.get(&query(&format!("/sweeps/{id}/fit"), &members)).status, 409);
    let none = server.json(&query(&format!("/sweeps/{id}/columns"), &[("filter", "b < 1")]));
    assert_eq!(none["columns"], json!({"run_index": [], "status": []}));
    // A sweep that has not begun has no runs.
    let other = server.submit(&json!({
        "regime": "transient", "start": {"length_m": 1e4, "thickness_0_m": 75},
        "time": {"duration_a": 500}, "parameters": {"n_cells": 200},
    }));
    let columns = server.json(&query(&format!("/sweeps/{other}/columns"), &[("names", "b")]));
    assert_eq!((&columns["total"], &columns["choice"]), (&json!(0), &json!("all")));
    let laws = server.json(&query(&format!("/sweeps/{other}/laws"), &[MELT, FORCE]));
    assert_eq!((&laws["total"], &laws["groups"][0]["n_runs"]), (&json!(0), &json!(0)));
    assert!(server.terminate());
}
