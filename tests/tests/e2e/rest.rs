//! The REST interface: submit, watch, list, fit, single results, problems.

use crate::{assert_all_close, assert_close, melt_sweep, number};
use melange_tests::{Server, folder, root, run};
use serde_json::{Value, json};

fn items(page: &Value) -> Vec<Value> {
    page["items"].as_array().expect("items").clone()
}

#[test]
fn a_melt_sweep_from_submission_to_fit() {
    let folder = folder();
    let server = Server::start("serve", folder.path(), &[]);
    assert_eq!(server.json("/health")["status"], "ok");
    let id = server.submit(&melt_sweep(26));
    let sweep = server.wait(&id);
    assert_eq!(sweep["counts"]["converged"], 26);
    assert_eq!(sweep["spec"]["axes"][0]["linspace"], json!([0.5, 1.0, 26]));

    let runs = items(&server.json(&format!("/api/v1/sweeps/{id}/runs")));
    let melts: Vec<f64> = runs.iter().map(|r| number(&r["melt_rate_m_per_day"])).collect();
    let expected: Vec<f64> = (0..26).map(|i| 0.5 + 0.5 * f64::from(i) / 25.0).collect();
    assert_eq!(melts, expected);

    // The fit equals a least-squares line through ln F and ln melt, computed here.
    let (n, mut sx, mut sy, mut sxx, mut sxy) = (26.0, 0.0, 0.0, 0.0, 0.0);
    for run in &runs {
        let x = number(&run["melt_rate_m_per_day"]).ln();
        let y = number(&run["force_n_per_m"]).ln();
        (sx, sy, sxx, sxy) = (sx + x, sy + y, sxx + x * x, sxy + x * y);
    }
    let slope = (n * sxy - sx * sy) / (n * sxx - sx * sx);
    let path =
        format!("/api/v1/sweeps/{id}/fit?x=melt_rate_m_per_day&y=force_n_per_m&model=power_law");
    let fit = server.json(&path);
    assert_close("exponent", &fit["exponent"]["estimate"], &json!(slope), 1e-10);
    assert!((-3.2..-3.1).contains(&slope), "{slope}");
    assert_eq!((fit["n_used"].as_i64(), &fit["left_out"]), (Some(26), &json!([])));
    let ci = &fit["exponent"]["ci95"];
    assert!(number(&ci[0]) < slope && slope < number(&ci[1]));
}

#[test]
fn results_do_not_depend_on_order_threads_or_neighbours() {
    let folder = folder();
    let server = Server::start("serve", folder.path(), &["--workers", "1"]);
    let values: Vec<f64> = (0..=12).map(|i| 0.54 + 0.03 * f64::from(i)).collect();
    let down: Vec<f64> = values.iter().rev().copied().collect();
    let mut forces = Vec::new();
    for values in [&values, &down] {
        let id = server.submit(&json!({
            "regime": "steady",
            "axes": [{"parameter": "melt_rate_m_per_day", "values": values}],
        }));
        server.wait(&id);
        let path = format!("/api/v1/sweeps/{id}/runs?sort=melt_rate_m_per_day");
        let runs = items(&server.json(&path));
        forces.push(runs.iter().map(|r| r["force_n_per_m"].clone()).collect::<Value>());
    }
    assert_all_close("F walked up and down", &forces[0], &forces[1], 1e-9);
    drop(server);

    let other = melange_tests::folder();
    let server = Server::start("serve", other.path(), &["--workers", "2"]);
    let id = server.submit(&json!({
        "regime": "steady",
        "axes": [{"parameter": "melt_rate_m_per_day", "values": values}],
    }));
    server.wait(&id);
    let runs = items(&server.json(&format!("/api/v1/sweeps/{id}/runs")));
    let threaded: Value = runs.iter().map(|r| r["force_n_per_m"].clone()).collect();
    assert_all_close("F on two threads", &threaded, &forces[0], 1e-9);

    // Alone: the base case among them is the right root.
    let base = runs
        .iter()
        .find(|r| (number(&r["melt_rate_m_per_day"]) - 0.6).abs() < 1e-12)
        .expect("0.6 m/d is swept");
    assert_close("H0", &base["thickness_0_m"], &json!(149.415_357_782), 1e-9);
    let stored = server.json(&format!("/api/v1/runs/{}", base["run_id"].as_str().expect("an id")));
    let melt = base["melt_rate_m_per_day"].clone();
    let scenario = json!({"regime": "steady", "parameters": {"melt_rate_m_per_day": melt}});
    let (_, alone) = run(&scenario.to_string());
    for name in
        ["node_x_m", "velocity_m_per_a", "mu_w", "cell_x_m", "thickness_m", "fluidity_per_a"]
    {
        assert_all_close(name, &stored["profile"][name], &alone["profile"][name], 1e-9);
    }
    assert_eq!(stored["parameters"], alone["parameters"]);
}

#[test]
fn pages_and_sorting_cover_every_run_once() {
    let folder = folder();
    let server = Server::start("serve", folder.path(), &[]);
    let id = server.submit(&json!({
        "regime": "steady", "parameters": {"n_cells": 20},
        "axes": [
            {"parameter": "melt_rate_m_per_day", "linspace": [0.6, 0.9, 4]},
            {"parameter": "b", "logspace": [1e4, 1e5, 3]},
        ],
    }));
    server.wait(&id);
    let mut forces = Vec::new();
    let mut cursor = String::new();
    loop {
        let path = format!("/api/v1/sweeps/{id}/runs?limit=5&sort=-force_n_per_m{cursor}");
        let page = server.json(&path);
        assert_eq!(page["total"], 12);
        forces.extend(items(&page).iter().map(|r| number(&r["force_n_per_m"])));
        match page["next"].as_str() {
            Some(next) => cursor = format!("&cursor={next}"),
            None => break,
        }
    }
    assert_eq!(forces.len(), 12);
    assert!(forces.windows(2).all(|w| w[0] >= w[1]), "{forces:?}");
    // The last axis is the fastest.
    let runs = items(&server.json(&format!("/api/v1/sweeps/{id}/runs?limit=3")));
    let b: Vec<f64> = runs.iter().map(|r| number(&r["b"])).collect();
    assert_eq!((b[0], b[2]), (1e4, 1e5));
    assert!((b[1] / 10f64.powf(4.5) - 1.0).abs() < 1e-12);
}

#[test]
fn transients_store_series_and_states_and_start_from_stored_runs() {
    let folder = folder();
    let server = Server::start("serve", folder.path(), &[]);
    let first = server.submit(&json!({
        "regime": "transient", "parameters": {"n_cells": 20},
        "start": {"length_m": 10_000, "thickness_0_m": 75},
        "time": {"duration_a": 0.2, "fixed_dt_a": 0.01, "output_every_a": 0.1, "profiles_at_a": [0.05]},
        "axes": [{"option": "upstream_closure", "values": ["published", "printed", "no_stretching"]}],
    }));
    let sweep = server.wait(&first);
    assert_eq!(sweep["counts"]["completed"], 3);
    let runs = items(&server.json(&format!("/api/v1/sweeps/{first}/runs")));
    let closures: Vec<_> = runs.iter().map(|r| r["upstream_closure"].clone()).collect();
    assert_eq!(closures, ["published", "printed", "no_stretching"]);
    let run_id = runs[0]["run_id"].as_str().expect("an id");
    let result = server.json(&format!("/api/v1/runs/{run_id}"));
    assert_eq!(result["series"]["time_a"], json!([0.0, 0.1, 0.2]));
    assert_eq!(result["states"].as_array().map(Vec::len), Some(1));
    assert_eq!(result["states"][0]["time_a"], 0.05);
    assert_eq!(result["series"]["length_m"][2], result["length_m"]);

    // Going on from the stored state for nothing but its geometry gives the next step's numbers.
    let second = server.submit(&json!({
        "regime": "transient", "parameters": {"n_cells": 20}, "start": {"run": run_id},
        "time": {"duration_a": 0.01, "fixed_dt_a": 0.01},
    }));
    server.wait(&second);
    let runs = items(&server.json(&format!("/api/v1/sweeps/{second}/runs")));
    let going_on =
        server.json(&format!("/api/v1/runs/{}", runs[0]["run_id"].as_str().expect("an id")));
    let (_, through) = run(&json!({
        "regime": "transient", "parameters": {"n_cells": 20},
        "start": {"length_m": 10_000, "thickness_0_m": 75},
        "time": {"duration_a": 0.21, "fixed_dt_a": 0.01},
    })
    .to_string());
    assert_close("L", &going_on["length_m"], &through["length_m"], 1e-9);
    assert_close("F", &going_on["force_n_per_m"], &through["force_n_per_m"], 1e-7);

    for (start, word) in
        [(json!({"run": "none"}), "stored run"), (json!({"run": run_id}), "n_cells")]
    {
        let answer = server.post(
            "/api/v1/sweeps",
            &json!({
                "regime": "transient", "parameters": {"n_cells": 30}, "start": start,
                "time": {"duration_a": 0.01, "fixed_dt_a": 0.01},
            })
            .to_string(),
        );
        assert_eq!(answer.status, 422);
        let problem = answer.json();
        assert_eq!(problem["field"], "start.run");
        assert!(problem["detail"].as_str().expect("a sentence").contains(word), "{problem}");
    }
}

#[test]
fn a_run_without_a_steady_state_is_stored_with_nulls_and_left_out_of_the_fit() {
    let folder = folder();
    let server = Server::start("serve", folder.path(), &[]);
    let id = server.submit(&json!({
        "regime": "steady", "parameters": {"n_cells": 20, "width_m": 6000},
        "axes": [{"parameter": "melt_rate_m_per_day", "values": [0.5, 0.55, 0.6, 2.5]}],
    }));
    let sweep = server.wait(&id);
    assert_eq!(sweep["counts"]["converged"], 3);
    assert_eq!(sweep["counts"]["no_steady_state"], 1);
    let last = &items(&server.json(&format!("/api/v1/sweeps/{id}/runs?sort=-run_index")))[0];
    assert!(last["force_n_per_m"].is_null());
    let fit =
        server.json(&format!("/api/v1/sweeps/{id}/fit?x=melt_rate_m_per_day&y=force_n_per_m"));
    assert_eq!(fit["left_out"], json!([{"reason": "no_steady_state", "count": 1}]));
    let result = server.json(&format!("/api/v1/runs/{}", last["run_id"].as_str().expect("an id")));
    assert!(result["profile"].is_null());
}

#[test]
fn problems_are_problem_documents() {
    let folder = folder();
    let server = Server::start("serve", folder.path(), &["--max-body-mib", "4"]);
    let id = server.submit(&melt_sweep(2));
    server.wait(&id);
    let fit = format!("/api/v1/sweeps/{id}/fit");
    for (path, status) in [
        ("/api/v1/sweeps/none".to_owned(), 404),
        ("/api/v1/runs/none".to_owned(), 404),
        ("/api/v1/sweeps/none/runs".to_owned(), 404),
        ("/api/v1/sweeps/none/runs.parquet".to_owned(), 404),
        ("/api/v1/nothing".to_owned(), 404),
        ("/api/v1/sweeps/none/events".to_owned(), 404),
        (format!("/api/v1/sweeps/{id}/runs?filter=b%3E"), 422),
        (format!("/api/v1/sweeps/{id}/runs?filter=bee%3E1"), 422),
        (format!("/api/v1/sweeps/{id}/runs?filter=b%3E1;DROP%20TABLE%20runs"), 422),
        (format!("/api/v1/sweeps/{id}/runs?cursor=3"), 422),
        (format!("/api/v1/sweeps/{id}/runs?sort=nothing"), 422),
        (format!("/api/v1/sweeps/{id}/runs?sort=b%22;DROP%20TABLE%20runs"), 422),
        (format!("/api/v1/sweeps/{id}/runs?limit=0"), 422),
        (format!("/api/v1/sweeps/{id}/runs?limit=x"), 400),
        (format!("/api/v1/sweeps/{id}/runs?unknown=1"), 400),
        ("/api/v1/sweeps?cursor=-3".to_owned(), 422),
        ("/api/v1/sweeps/%FF".to_owned(), 400),
        (format!("/api/v1/sweeps/{id}/runs.parquet?filter=b%3E1"), 400),
        (format!("/api/v1/sweeps/{id}?verbose=1"), 400),
        (format!("/api/v1/sweeps/{id}/pause"), 405),
        (fit.clone(), 400),
        (format!("{fit}?x=status&y=force_n_per_m"), 422),
        (format!("{fit}?x=melt_rate_m_per_day&y=force_n_per_m&model=cubic"), 400),
        (format!("{fit}?x=melt_rate_m_per_day&y=force_n_per_m"), 409),
    ] {
        let answer = server.get(&path);
        assert_eq!(answer.status, status, "{path}");
        assert_eq!(answer.content_type, "application/problem+json", "{path}");
        let problem = answer.json();
        assert_eq!(problem["status"], status, "{path}");
        assert!(!problem["detail"].as_str().expect("a sentence").is_empty(), "{path}");
    }
    let axis = |axis: Value| json!({"regime": "steady", "axes": [axis]}).to_string();
    let melt = "melt_rate_m_per_day";
    for (path, body, status, field) in [
        ("/api/v1/sweeps", "{".to_owned(), 400, Value::Null),
        ("/api/v1/sweeps", "{}".to_owned(), 422, json!("regime")),
        ("/api/v1/sweeps?dry_run=perhaps", melt_sweep(2).to_string(), 400, Value::Null),
        ("/api/v1/sweeps/none/pause", String::new(), 404, Value::Null),
        (
            "/api/v1/sweeps",
            axis(json!({"parameter": "melt", "values": [1]})),
            422,
            json!("axes[0].parameter"),
        ),
        (
            "/api/v1/sweeps",
            axis(json!({"parameter": melt, "values": [1, 1]})),
            422,
            json!("axes[0]"),
        ),
        (
            "/api/v1/sweeps",
            axis(json!({"parameter": melt, "values": [1, -1]})),
            422,
            json!("parameters.melt_rate_m_per_day"),
        ),
        (
            "/api/v1/sweeps",
            axis(json!({"parameter": melt, "logspace": [0, 1, 5]})),
            422,
            json!("axes[0].logspace"),
        ),
        (
            "/api/v1/sweeps",
            axis(json!({"parameter": melt, "linspace": [0.5, 1, 2_000_000]})),
            422,
            json!("axes"),
        ),
        ("/api/v1/sweeps", axis(json!({"parameter": melt})), 422, json!("axes[0]")),
        ("/api/v1/sweeps", axis(json!({"zip": []})), 422, json!("axes[0].zip")),
        (
            "/api/v1/sweeps",
            axis(json!({"option": "upstream_closure", "values": ["x"]})),
            422,
            json!("axes[0].values"),
        ),
        ("/api/v1/sweeps", "x".repeat(5 << 20), 413, Value::Null),
    ] {
        let answer = server.post(path, &body);
        let problem = answer.json();
        assert_eq!(answer.status, status, "{problem}");
        assert_eq!(problem["field"], field, "{problem}");
    }
    for path in ["/api/v1/sweeps", "/health", "/"] {
        let answer = server.delete(path);
        assert_eq!(answer.status, 405, "{path}");
        assert_eq!(answer.content_type, "application/problem+json", "{path}");
    }
    // A short document that asks for very many points is refused before they are laid out.
    let names = ["b", "A", "mu_s", "d_m", "width_m", "melt_rate_m_per_day"];
    let axes: Vec<Value> =
        names.map(|name| json!({"parameter": name, "linspace": [10, 20, 1_000_000]})).to_vec();
    let answer =
        server.post("/api/v1/sweeps", &json!({"regime": "steady", "axes": axes}).to_string());
    assert_eq!((answer.status, &answer.json()["field"]), (422, &json!("axes")));
    let doubled = json!({"parameter": "b", "values": [1e4]});
    let body = json!({"regime": "steady", "axes": [doubled, doubled]}).to_string();
    let answer = server.post("/api/v1/sweeps", &body);
    assert_eq!((answer.status, &answer.json()["field"]), (422, &json!("axes[1]")));
    let body = json!({
        "regime": "transient", "time": {"duration_a": 100_000, "fixed_dt_a": 0.01},
    });
    let answer = server.post("/api/v1/sweeps", &body.to_string());
    assert_eq!((answer.status, &answer.json()["field"]), (422, &json!("time")));
    let twice = json!({
        "regime": "steady", "parameters": {melt: 0.6},
        "axes": [{"parameter": melt, "values": [0.7]}],
    });
    let answer = server.post("/api/v1/sweeps", &twice.to_string());
    assert_eq!(answer.status, 422);
    assert!(answer.json()["detail"].as_str().expect("a sentence").contains("more than once"));
    assert_eq!(server.json("/api/v1/sweeps")["total"], 1, "nothing refused was queued");
}

/// A long run neither holds up the end of the process nor is it lost.
#[test]
fn a_long_run_is_given_back_when_the_service_ends() {
    let folder = folder();
    let server = Server::start("serve", folder.path(), &[]);
    let id = server.submit(&json!({
        "regime": "transient", "start": {"length_m": 10_000, "thickness_0_m": 75},
        "time": {"duration_a": 900, "fixed_dt_a": 0.001, "output_every_a": 1},
    }));
    let under_way =
        |server: &Server| server.json(&format!("/api/v1/sweeps/{id}"))["state"] == "running";
    while !under_way(&server) {
        std::thread::sleep(std::time::Duration::from_millis(10));
    }
    let begin = std::time::Instant::now();
    assert!(server.terminate());
    assert!(begin.elapsed() < std::time::Duration::from_secs(5), "it took {:?}", begin.elapsed());
    let server = Server::start("serve", folder.path(), &[]);
    let counts = server.json(&format!("/api/v1/sweeps/{id}"))["counts"].clone();
    assert_eq!(counts["queued"].as_i64().unwrap_or(0) + counts["running"].as_i64().unwrap_or(0), 1);
}

/// A start that cannot be read is its runs' failure, with the reason, and holds nobody up.
#[test]
fn a_start_whose_file_is_gone_fails_its_runs_only() {
    let folder = folder();
    let server = Server::start("serve", folder.path(), &[]);
    let first = server.submit(&json!({"regime": "steady", "parameters": {"n_cells": 20}}));
    server.wait(&first);
    let runs = items(&server.json(&format!("/api/v1/sweeps/{first}/runs")));
    let run_id = runs[0]["run_id"].clone();
    for file in std::fs::read_dir(folder.path().join("archive").join(&first)).expect("a folder") {
        let path = file.expect("a file").path();
        if path.to_string_lossy().ends_with("-profiles.parquet") {
            std::fs::remove_file(path).expect("it can be removed");
        }
    }
    let second = server.submit(&json!({
        "regime": "transient", "parameters": {"n_cells": 20}, "start": {"run": run_id},
        "time": {"duration_a": 0.1, "fixed_dt_a": 0.01},
    }));
    assert_eq!(server.wait(&second)["counts"]["failed"], 1);
    let runs = items(&server.json(&format!("/api/v1/sweeps/{second}/runs")));
    let detail = runs[0]["detail"].as_str().expect("a reason");
    assert!(
        detail.contains("could not be read") && detail.contains("profiles.parquet"),
        "{detail}"
    );
}

/// The interface's description is in the repository; a change of the interface changes it there.
#[test]
fn the_openapi_document_is_the_one_in_the_repository() {
    let folder = folder();
    let server = Server::start("serve", folder.path(), &[]);
    let served = server.json("/api/v1/openapi.json");
    let path = root().join("docs/openapi.json");
    let text = std::fs::read_to_string(path).expect("docs/openapi.json is there");
    let kept: Value = serde_json::from_str(&text).expect("it is JSON");
    assert!(
        served == kept,
        "docs/openapi.json is not what is served; renew it: curl -s localhost:8080/api/v1/openapi.json \
         | python3 -m json.tool > docs/openapi.json"
    );
    assert_eq!(server.get("/api/v1/docs/").status, 200);
}
