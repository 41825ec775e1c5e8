//! Sweeps as they are written, shared and found: points, dry runs, reuse, keys, filters; and results that do
//! not depend on chunks or order.

use crate::tables::read;
use crate::{assert_all_close, melt_sweep, number};
use arrow_array::cast::AsArray;
use arrow_array::types::{Float64Type, Int64Type};
use melange_tests::{Server, folder, melange};
use serde_json::{Value, json};
use std::time::Instant;

fn runs_of(server: &Server, id: &str, query: &str) -> Vec<Value> {
    let page = server.json(&format!("/api/v1/sweeps/{id}/runs?limit=1000{query}"));
    page["items"].as_array().expect("items").clone()
}

fn column(runs: &[Value], name: &str) -> Value {
    runs.iter().map(|run| run[name].clone()).collect()
}

/// A filter as it stands in an address.
fn escaped(text: &str) -> String {
    text.bytes().map(|b| format!("%{b:02X}")).collect()
}

#[test]
fn points_are_zipped_sampled_and_listed() {
    let folder = folder();
    let server = Server::start("serve", folder.path(), &[]);
    let small = json!({"n_cells": 20});
    let zipped = server.submit(&json!({
        "regime": "steady", "parameters": small, "tags": ["zip", "test"],
        "axes": [{"zip": [
            {"parameter": "width_m", "values": [3800, 4000]},
            {"parameter": "terminus_thickness_m", "values": [580, 600]},
        ]}, {"parameter": "melt_rate_m_per_day", "values": [0.6, 0.7]}],
    }));
    server.wait(&zipped);
    let runs = runs_of(&server, &zipped, "");
    assert_eq!(column(&runs, "width_m"), json!([3800.0, 3800.0, 4000.0, 4000.0]));
    assert_eq!(column(&runs, "terminus_thickness_m"), json!([580.0, 580.0, 600.0, 600.0]));
    assert_eq!(column(&runs, "melt_rate_m_per_day"), json!([0.6, 0.7, 0.6, 0.7]));

    let sample = json!({
        "regime": "steady", "parameters": small,
        "sample": {"method": "sobol", "n": 16, "seed": 1, "ranges": {
            "b": {"log": [5e3, 5e4]}, "melt_rate_m_per_day": [0.5, 0.8]}},
    });
    let sampled = server.submit(&sample);
    server.wait(&sampled);
    let runs = runs_of(&server, &sampled, "");
    assert!(runs.iter().all(|r| (5e3..=5e4).contains(&number(&r["b"]))));
    // The same document makes the same runs in the same order, on any machine.
    let again = server.post("/api/v1/sweeps", &sample.to_string()).json();
    assert_eq!((&again["count"], &again["reused"]), (&json!(16), &json!(16)));
    let again = again["id"].as_str().expect("an id");
    server.wait(again);
    assert_eq!(column(&runs_of(&server, again, ""), "run_id"), column(&runs, "run_id"));

    // A table beside the document: as CSV, and the same as JSON. A point that stands there twice is one run.
    let csv = "melt_rate_m_per_day,upstream_closure\n0.61,published\n0.62,no_stretching\n0.61,published\n";
    let spec = json!({"regime": "steady", "parameters": small}).to_string();
    let form = format!(
        "--x\r\nContent-Disposition: form-data; name=\"spec\"\r\n\r\n{spec}\r\n\
         --x\r\nContent-Disposition: form-data; name=\"table\"; filename=\"p.csv\"\r\n\r\n{csv}\r\n--x--\r\n"
    );
    let headers = [("Content-Type", "multipart/form-data; boundary=x")];
    let taken = server.post_with("/api/v1/sweeps", &headers, form.as_bytes());
    assert_eq!(taken.status, 202, "{}", String::from_utf8_lossy(&taken.body));
    let listed = taken.json()["id"].as_str().expect("an id").to_owned();
    assert_eq!(server.wait(&listed)["counts"]["converged"], 3);
    let runs = runs_of(&server, &listed, "");
    assert_eq!(column(&runs, "melt_rate_m_per_day"), json!([0.61, 0.62, 0.61]));
    assert_eq!(runs[0]["run_id"], runs[2]["run_id"]);
    assert_eq!(runs[1]["upstream_closure"], "no_stretching");
    let batches = read(server.get(&format!("/api/v1/sweeps/{listed}/runs.parquet")).body);
    let indices: Vec<i64> = batches
        .iter()
        .flat_map(|b| {
            b.column_by_name("run_index").expect("it").as_primitive::<Int64Type>().values().to_vec()
        })
        .collect();
    assert_eq!(indices, [0, 1, 2]);
    let as_json = server.post(
        "/api/v1/sweeps",
        &json!({
            "regime": "steady", "parameters": small,
            "table": {"columns": ["melt_rate_m_per_day", "upstream_closure"],
                      "rows": [[0.61, "published"], [0.62, "no_stretching"], [0.61, "published"]]},
        })
        .to_string(),
    );
    assert_eq!(as_json.json()["reused"], 3);

    let tagged = server.json("/api/v1/sweeps?tag=zip");
    assert_eq!((&tagged["total"], &tagged["items"][0]["id"]), (&json!(1), &json!(zipped)));
    assert_eq!(tagged["items"][0]["tags"], json!(["test", "zip"]));
}

#[test]
fn what_is_known_is_not_solved_again_unless_forced() {
    let folder = folder();
    let server = Server::start("serve", folder.path(), &[]);
    let spec = |from: usize, to: usize| {
        let melts: Vec<f64> = (from..to).map(|i| 0.5 + 0.005 * i as f64).collect();
        json!({"regime": "steady", "parameters": {"n_cells": 20},
               "axes": [{"parameter": "melt_rate_m_per_day", "values": melts}]})
    };
    let first = server.submit(&spec(0, 40));
    server.wait(&first);

    // A dry run queues nothing and tells what would be.
    let told = server.post("/api/v1/sweeps?dry_run=true", &spec(20, 60).to_string());
    assert_eq!(told.status, 200);
    let told = told.json();
    assert_eq!((&told["count"], &told["reused"]), (&json!(40), &json!(20)));
    assert_eq!(told["first"]["melt_rate_m_per_day"], json!(0.5 + 0.005 * 20.0));
    assert_eq!(told["last"]["melt_rate_m_per_day"], json!(0.5 + 0.005 * 59.0));
    assert!(number(&told["estimated_seconds"]) > 0.0 && number(&told["estimated_bytes"]) > 1e4);
    assert_eq!(server.json("/api/v1/sweeps")["total"], 1);

    let taken = server.post("/api/v1/sweeps", &spec(20, 60).to_string()).json();
    assert_eq!(taken["reused"], 20);
    let second = taken["id"].as_str().expect("an id").to_owned();
    assert_eq!(server.wait(&second)["reused"], 20);
    let runs = runs_of(&server, &second, "");
    assert_eq!(
        column(&runs[..20], "run_id"),
        column(&runs_of(&server, &first, "")[20..], "run_id")
    );
    let bulk = |id: &str, file: &str| read(server.get(&format!("/api/v1/sweeps/{id}/{file}")).body);
    let check_bulk = || {
        let batches = bulk(&second, "runs.parquet");
        let mut row = 0;
        for batch in &batches {
            let indices =
                batch.column_by_name("run_index").expect("it").as_primitive::<Int64Type>();
            let forces =
                batch.column_by_name("force_n_per_m").expect("it").as_primitive::<Float64Type>();
            let ids = batch.column_by_name("run_id").expect("it").as_string::<i32>();
            for i in 0..batch.num_rows() {
                assert_eq!(indices.value(i), row);
                assert_eq!(json!(forces.value(i)), runs[row as usize]["force_n_per_m"]);
                assert_eq!(ids.value(i), runs[row as usize]["run_id"]);
                row += 1;
            }
        }
        assert_eq!(row, 40);
        let profiles = bulk(&second, "profiles.parquet");
        assert_eq!(profiles.iter().map(|b| b.num_rows()).sum::<usize>(), 40);
    };
    check_bulk();

    // Deleting the first keeps what the second uses.
    let gone = server.delete(&format!("/api/v1/sweeps/{first}?for_good=true"));
    assert_eq!(gone.status, 204);
    std::thread::sleep(std::time::Duration::from_millis(1500));
    check_bulk();
    let id = runs[0]["run_id"].as_str().expect("an id");
    assert!(server.json(&format!("/api/v1/runs/{id}"))["profile"].is_object());

    // Forced, everything is solved again, to the same numbers.
    let mut forced = spec(20, 60);
    forced["force"] = json!(true);
    let taken = server.post("/api/v1/sweeps", &forced.to_string()).json();
    assert_eq!(taken["reused"], 0);
    let third = taken["id"].as_str().expect("an id").to_owned();
    assert_eq!(server.wait(&third)["reused"], 0);
    let again = runs_of(&server, &third, "");
    assert_all_close("F", &column(&again, "force_n_per_m"), &column(&runs, "force_n_per_m"), 1e-9);

    // Two that come at once solve each run once between them.
    let (a, b) = (server.submit(&spec(60, 200)), server.submit(&spec(60, 200)));
    let (a, b) = (server.wait(&a), server.wait(&b));
    assert_eq!(number(&a["reused"]) + number(&b["reused"]), 140.0, "{a} {b}");
    assert!(server.terminate());
    let data = folder.path().to_str().expect("UTF-8");
    let verified = melange(&["verify", "--data", data, "--format", "json"], "");
    assert!(verified.status.success(), "{}", String::from_utf8_lossy(&verified.stdout));
}

#[test]
fn a_repeated_submission_with_its_key_is_the_same_sweep() {
    let folder = folder();
    let server = Server::start("serve", folder.path(), &[]);
    let send = |key: &str, n: usize| {
        let body = melt_sweep(n).to_string();
        let answer =
            server.post_with("/api/v1/sweeps", &[("Idempotency-Key", key)], body.as_bytes());
        (answer.status, answer.json())
    };
    let first = send("monday", 5);
    assert_eq!(first.0, 202);
    assert_eq!(send("monday", 5), first);
    let other = send("monday", 6);
    assert_eq!((other.0, &other.1["field"]), (422, &json!("Idempotency-Key")));
    assert_ne!(send("tuesday", 5).1["id"], first.1["id"]);
    assert_eq!(server.json("/api/v1/sweeps")["total"], 2);
    assert_eq!(send("", 5).0, 422);
    server.wait(first.1["id"].as_str().expect("an id"));
    assert_eq!(send("monday", 5), first, "also when it has ended");
    assert_eq!(
        server.delete(&format!("/api/v1/sweeps/{}", first.1["id"].as_str().expect("it"))).status,
        204
    );
    assert_ne!(send("monday", 5).1["id"], first.1["id"], "a deleted one is forgotten");
}

#[test]
fn runs_are_filtered_sorted_and_paged() {
    let folder = folder();
    let server = Server::start("serve", folder.path(), &[]);
    let id = server.submit(&json!({
        "regime": "steady", "parameters": {"n_cells": 20},
        "axes": [{"parameter": "melt_rate_m_per_day", "values": [0.5, 0.6, 0.7, 0.8, 3]},
                 {"parameter": "width_m", "linspace": [3600, 4400, 9]}],
    }));
    server.wait(&id);
    let all = runs_of(&server, &id, "");
    assert_eq!(all.len(), 45);
    let filtered = |filter: &str| {
        let page =
            server.json(&format!("/api/v1/sweeps/{id}/runs?limit=1000&filter={}", escaped(filter)));
        let indices: Vec<i64> = page["items"]
            .as_array()
            .expect("items")
            .iter()
            .map(|r| r["run_index"].as_i64().expect("it"))
            .collect();
        assert_eq!(page["total"].as_u64(), Some(indices.len() as u64), "{filter}");
        assert_eq!(page["is_exact"], true, "{filter}");
        indices
    };
    let expected = |keep: &dyn Fn(&Value) -> bool| -> Vec<i64> {
        all.iter().filter(|r| keep(r)).map(|r| r["run_index"].as_i64().expect("it")).collect()
    };
    let melt = |r: &Value| number(&r["melt_rate_m_per_day"]);
    assert_eq!(
        filtered("0.55 < melt_rate_m_per_day <= 0.7"),
        expected(&|r| (0.55..=0.7).contains(&melt(r)))
    );
    assert_eq!(
        filtered(
            "status = 'converged' and not (width_m < 4000 or melt_rate_m_per_day in (0.5, 0.8))"
        ),
        expected(&|r| r["status"] == "converged"
            && number(&r["width_m"]) >= 4000.0
            && melt(r) != 0.5
            && melt(r) != 0.8)
    );
    assert_eq!(filtered("force_n_per_m is null"), expected(&|r| r["force_n_per_m"].is_null()));
    assert_eq!(filtered("not force_n_per_m < 1e99"), expected(&|r| r["force_n_per_m"].is_null()));
    assert_eq!(filtered("d_m != 25"), Vec::<i64>::new());

    // Pages in any order, also where numbers do not exist, hold every run once and in that order.
    for sort in
        ["force_n_per_m", "-force_n_per_m", "width_m", "-status", "-run_index", "run_index", "d_m"]
    {
        let mut seen = Vec::new();
        let mut cursor = String::new();
        loop {
            let page =
                server.json(&format!("/api/v1/sweeps/{id}/runs?limit=7&sort={sort}{cursor}"));
            seen.extend(page["items"].as_array().expect("items").clone());
            match page["next"].as_str() {
                Some(next) => cursor = format!("&cursor={}", escaped(next)),
                None => break,
            }
        }
        let mut indices: Vec<i64> =
            seen.iter().map(|r| r["run_index"].as_i64().expect("it")).collect();
        if let Some(name) = ["force_n_per_m", "width_m"].iter().find(|n| sort.ends_with(**n)) {
            let values: Vec<f64> =
                seen.iter().map(|r| r[*name].as_f64().unwrap_or(f64::NEG_INFINITY)).collect();
            let is_sorted = if sort.starts_with('-') {
                values.windows(2).all(|w| w[0] >= w[1])
            } else {
                values.windows(2).all(|w| w[0] <= w[1])
            };
            assert!(is_sorted, "{sort}: {values:?}");
        }
        indices.sort_unstable();
        assert_eq!(indices, (0..45).collect::<Vec<i64>>(), "{sort}");
    }
    let refused = server
        .get(&format!("/api/v1/sweeps/{id}/runs?filter={}", escaped("d_m > 3 and width = 4")));
    assert_eq!(refused.status, 422);
    let detail = refused.json()["detail"].as_str().expect("a sentence").to_owned();
    assert!(detail.contains("character 13"), "{detail}");
}

#[test]
fn results_do_not_depend_on_chunks_or_order() {
    let melts: Vec<f64> = (0..12).map(|i| 0.5 + 0.04 * f64::from(i)).collect();
    let widths: Vec<f64> = (0..10).map(|i| 3500.0 + 100.0 * f64::from(i)).collect();
    let grid = json!({
        "regime": "steady",
        "axes": [{"parameter": "melt_rate_m_per_day", "values": melts},
                 {"parameter": "width_m", "values": widths}],
    });
    // The same points, shuffled: neighbours in the table lie far apart.
    let points: Vec<Value> =
        (0..120).map(|i| (i * 77) % 120).map(|i| json!([melts[i / 10], widths[i % 10]])).collect();
    let table = json!({
        "regime": "steady",
        "table": {"columns": ["melt_rate_m_per_day", "width_m"], "rows": points},
    });
    let solved = |spec: &Value, workers: &str| {
        let folder = folder();
        let server = Server::start("serve", folder.path(), &["--workers", workers]);
        let id = server.submit(spec);
        assert_eq!(server.wait(&id)["counts"]["converged"], 120);
        let mut runs = runs_of(&server, &id, "");
        runs.sort_by(|a, b| a["run_id"].as_str().cmp(&b["run_id"].as_str()));
        runs
    };
    let reference = solved(&grid, "1");
    for (spec, workers) in [(&grid, "7"), (&table, "1"), (&table, "3")] {
        let runs = solved(spec, workers);
        assert_eq!(column(&runs, "run_id"), column(&reference, "run_id"));
        for name in ["force_n_per_m", "length_m", "thickness_0_m", "velocity_end_m_per_a"] {
            assert_all_close(name, &column(&runs, name), &column(&reference, name), 1e-9);
        }
    }
}

#[test]
fn the_operator_sets_limits() {
    let folder = folder();
    let server = Server::start("serve", folder.path(), &["--max-runs", "10"]);
    let begin = Instant::now();
    let refused = server.post("/api/v1/sweeps", &melt_sweep(11).to_string());
    assert_eq!(refused.status, 422);
    let problem = refused.json();
    assert!(problem["permitted"].as_str().expect("it").contains("10 runs"), "{problem}");
    assert!(begin.elapsed().as_secs() < 5);
    server.wait(&server.submit(&melt_sweep(10)));
}
