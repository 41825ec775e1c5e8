//! What users ask of sweeps, and how they are told how far one is: verbs, priorities, events.

use crate::{melt_sweep, number};
use melange_tests::{Server, assert_counts_add_up, folder, melange};
use serde_json::{Value, json};
use std::thread::sleep;
use std::time::{Duration, Instant};

/// A sweep that takes some seconds: each run is a transient of many small steps.
fn long_sweep(runs: usize) -> Value {
    json!({
        "name": "long", "regime": "transient", "parameters": {"n_cells": 20},
        "start": {"length_m": 10000, "thickness_0_m": 75},
        "time": {"duration_a": 2, "fixed_dt_a": 0.002, "output_every_a": 1},
        "axes": [{"parameter": "melt_rate_m_per_day", "linspace": [0.5, 0.7, runs]}],
    })
}

fn wait_for(server: &Server, id: &str, what: &dyn Fn(&Value) -> bool) -> Value {
    let begin = Instant::now();
    loop {
        let sweep = server.json(&format!("/api/v1/sweeps/{id}"));
        assert_counts_add_up(&sweep);
        if what(&sweep) {
            return sweep;
        }
        assert!(begin.elapsed() < Duration::from_secs(120), "{sweep}");
        sleep(Duration::from_millis(10));
    }
}

fn count(sweep: &Value, name: &str) -> i64 {
    sweep["counts"][name].as_i64().expect("a count")
}

#[test]
fn a_sweep_is_paused_resumed_stopped_cancelled_and_deleted() {
    let folder = folder();
    let server = Server::start("serve", folder.path(), &[]);
    let id = server.submit(&long_sweep(60));
    wait_for(&server, &id, &|s| count(s, "running") > 0);
    assert_eq!(server.ask(&id, "pause")["state"], "paused");
    let paused = wait_for(&server, &id, &|s| count(s, "running") == 0);
    sleep(Duration::from_millis(300));
    let later = server.json(&format!("/api/v1/sweeps/{id}"));
    assert_eq!(paused["counts"], later["counts"], "nothing starts while it is paused");
    assert!(count(&paused, "queued") > 0);

    assert_eq!(server.ask(&id, "resume")["state"], "running");
    wait_for(&server, &id, &|s| count(s, "running") > 0);
    // What is under way ends, the rest is cancelled.
    let stopping = server.ask(&id, "stop");
    assert_eq!((&stopping["state"], count(&stopping, "queued")), (&json!("stopping"), 0));
    let stopped = wait_for(&server, &id, &|s| s["state"] == "cancelled");
    assert_eq!(count(&stopped, "running"), 0);
    assert!(count(&stopped, "completed") > count(&paused, "completed"));
    assert!(count(&stopped, "cancelled") > 0);

    // It goes on where it was left, and what is under way can be given up.
    server.ask(&id, "resume");
    wait_for(&server, &id, &|s| count(s, "running") > 0);
    let cancelled = server.ask(&id, "cancel");
    assert_eq!(cancelled["state"], "cancelled");
    assert_eq!(count(&cancelled, "running") + count(&cancelled, "queued"), 0);
    sleep(Duration::from_millis(500));
    let later = server.json(&format!("/api/v1/sweeps/{id}"));
    assert_eq!(later["counts"], cancelled["counts"], "what was given up is not stored");
    let listed = server.json(&format!("/api/v1/sweeps/{id}/runs?limit=1"));
    assert_eq!(listed["total"], cancelled["counts"]["completed"]);

    server.ask(&id, "resume");
    let complete = server.wait(&id);
    assert_eq!(count(&complete, "completed"), 60);
    let refused = server.post(&format!("/api/v1/sweeps/{id}/pause"), "");
    assert_eq!((refused.status, refused.json()["status"].as_i64()), (409, Some(409)));
    assert_eq!(server.post(&format!("/api/v1/sweeps/{id}/resume"), "").status, 409);
    assert_eq!(server.ask(&id, "retry")["state"], "complete", "nothing has failed");
    assert_eq!(server.post(&format!("/api/v1/sweeps/{id}/explode"), "").status, 404);

    // From the trash it comes back as it was; deleted for good it is cleared away.
    assert_eq!(server.delete(&format!("/api/v1/sweeps/{id}")).status, 204);
    assert_eq!(server.get(&format!("/api/v1/sweeps/{id}")).status, 404);
    assert_eq!(server.json("/api/v1/sweeps")["total"], 0);
    let trash = server.json("/api/v1/sweeps?trash=true");
    assert_eq!((&trash["total"], &trash["items"][0]["id"]), (&json!(1), &json!(id)));
    assert!(trash["items"][0]["deleted_at"].is_string(), "{trash}");
    assert_eq!(server.post(&format!("/api/v1/sweeps/{id}/pause"), "").status, 404);
    let recovered = server.ask(&id, "recover");
    assert_eq!((&recovered["state"], &recovered["deleted_at"]), (&json!("complete"), &json!(null)));
    assert_eq!(recovered["counts"], complete["counts"]);
    assert_eq!(server.post(&format!("/api/v1/sweeps/{id}/recover"), "").status, 404);
    assert_eq!(server.delete(&format!("/api/v1/sweeps/{id}")).status, 204);
    assert_eq!(server.delete(&format!("/api/v1/sweeps/{id}")).status, 404);
    assert_eq!(server.delete(&format!("/api/v1/sweeps/{id}?for_good=true")).status, 204);
    assert_eq!(server.json("/api/v1/sweeps?trash=true")["total"], 0);
    assert_eq!(server.post(&format!("/api/v1/sweeps/{id}/recover"), "").status, 404);
    let begin = Instant::now();
    while folder.path().join("archive").join(&id).exists() {
        assert!(begin.elapsed() < Duration::from_secs(30), "its files are still there");
        sleep(Duration::from_millis(50));
    }
}

#[test]
fn failed_runs_are_tried_again() {
    let folder = folder();
    let server = Server::start("serve", folder.path(), &[]);
    // A mélange that ends beyond the table of widths: its run fails, the other one does not.
    let id = server.submit(&json!({
        "regime": "steady", "parameters": {"n_cells": 20},
        "fjord": {"x_m": [0, 14000], "width_m": [4000, 4000]},
        "axes": [{"parameter": "melt_rate_m_per_day", "values": [0.4, 0.7]}],
    }));
    let sweep = server.wait(&id);
    assert_eq!((count(&sweep, "failed"), count(&sweep, "converged")), (1, 1), "{sweep}");
    let failed = &server.json(&format!("/api/v1/sweeps/{id}/runs?filter=status%3D%22failed%22"));
    assert_eq!((failed["total"].as_i64(), failed["is_exact"].as_bool()), (Some(1), Some(true)));
    let first = failed["items"][0].clone();
    assert!(first["detail"].as_str().expect("a reason").contains("table"), "{first}");

    let asked = server.ask(&id, "retry");
    assert_eq!((count(&asked, "failed"), count(&asked, "total")), (0, 2));
    let again = server.wait(&id);
    assert_eq!(again["counts"], sweep["counts"]);
    let listed = server.json(&format!("/api/v1/sweeps/{id}/runs"));
    assert_eq!(listed["total"], 2);
    let bulk = crate::tables::read(server.get(&format!("/api/v1/sweeps/{id}/runs.parquet")).body);
    assert_eq!(bulk.iter().map(|b| b.num_rows()).sum::<usize>(), 2);
}

#[test]
fn points_that_stand_in_a_sweep_twice_keep_their_indices_through_a_retry() {
    let folder = folder();
    let server = Server::start("serve", folder.path(), &["--workers", "1"]);
    let id = server.submit(&json!({
        "regime": "steady", "parameters": {"n_cells": 20},
        "fjord": {"x_m": [0, 14000], "width_m": [4000, 4000]},
        "table": {"columns": ["melt_rate_m_per_day"],
                  "rows": [[0.7], [0.72], [0.7], [0.4], [0.4], [0.74], [0.7], [0.4]]},
    }));
    let sweep = server.wait(&id);
    assert_eq!((count(&sweep, "failed"), count(&sweep, "converged")), (3, 5), "{sweep}");
    for _ in 0..2 {
        let csv = server.get(&format!("/api/v1/sweeps/{id}/runs.csv")).body;
        let csv = String::from_utf8(csv).expect("UTF-8");
        let indices: Vec<&str> =
            csv.lines().skip(1).map(|line| line.split(',').nth(1).expect("an index")).collect();
        assert_eq!(indices, ["0", "1", "2", "3", "4", "5", "6", "7"]);
        server.ask(&id, "retry");
        let again = server.wait(&id);
        assert_eq!(again["counts"], sweep["counts"]);
        assert_eq!(again["reused"], sweep["reused"], "the same as before, however often");
    }
}

#[test]
fn a_small_sweep_overtakes_a_large_one_and_priority_goes_first() {
    let folder = folder();
    let server = Server::start("serve", folder.path(), &["--workers", "1"]);
    let large = server.submit(&long_sweep(300));
    wait_for(&server, &large, &|s| count(s, "running") > 0);
    let begin = Instant::now();
    let small = server.submit(&melt_sweep(3));
    wait_for(&server, &small, &|s| count(s, "converged") > 0);
    assert!(begin.elapsed() < Duration::from_secs(5), "{:?}", begin.elapsed());
    assert_ne!(server.json(&format!("/api/v1/sweeps/{large}"))["state"], "complete");

    // Of two that come while the first is under way, the one of higher priority ends first.
    let mut low = long_sweep(8);
    low["parameters"]["width_m"] = json!(4100);
    let mut high = low.clone();
    high["parameters"]["width_m"] = json!(4200);
    high["priority"] = json!(10);
    let (low, high) = (server.submit(&low), server.submit(&high));
    let ended = wait_for(&server, &high, &|s| s["state"] == "complete");
    assert_eq!(ended["priority"], 10);
    assert_ne!(server.json(&format!("/api/v1/sweeps/{low}"))["state"], "complete");
    for id in [&large, &low] {
        server.ask(id, "cancel");
    }
}

/// Events of a stream: name, id, data.
fn events(body: &[u8]) -> Vec<(String, String, Value)> {
    let text = String::from_utf8(body.to_vec()).expect("UTF-8");
    let event = |block: &str| {
        let member = |name: &str| {
            let line = block.lines().find_map(|l| l.strip_prefix(name)?.strip_prefix(": "));
            line.map(str::to_owned)
        };
        let data = serde_json::from_str(&member("data")?).expect("JSON");
        Some((member("event")?, member("id")?, data))
    };
    text.split("\n\n").filter_map(event).collect()
}

#[test]
fn events_tell_how_far_a_sweep_is_until_its_end() {
    let folder = folder();
    let server = Server::start("serve", folder.path(), &[]);
    let id = server.submit(&long_sweep(30));
    let path = format!("/api/v1/sweeps/{id}/events");
    let answer = server.get(&path);
    assert!(answer.content_type.starts_with("text/event-stream"), "{}", answer.content_type);
    let told = events(&answer.body);
    assert!(told.len() >= 3, "{told:?}");
    let ended: Vec<i64> = told.iter().map(|(_, _, d)| count(d, "completed")).collect();
    assert!(ended.windows(2).all(|w| w[0] <= w[1]), "{ended:?}");
    told.iter().for_each(|(_, _, data)| assert_counts_add_up(data));
    assert!(told.iter().any(|(_, _, d)| d["runs_per_s"].as_f64().is_some_and(|r| r > 0.0)));
    let (name, last, data) = told.last().expect("an end");
    assert_eq!((name.as_str(), &data["state"]), ("end", &json!("complete")));

    // Who comes back with the last event has seen everything; with another one, gets the present picture.
    assert_eq!(server.get_with(&path, &[("Last-Event-ID", last)]).status, 204);
    let again = events(&server.get_with(&path, &[("Last-Event-ID", &told[0].1)]).body);
    assert_eq!(again.len(), 1);
    assert_eq!((&again[0].0, &again[0].1), (name, last));
    assert_eq!(server.get("/api/v1/sweeps/none/events").status, 404);
}

#[test]
fn who_watches_does_not_keep_the_service_from_ending() {
    let folder = folder();
    let server = Server::start("serve", folder.path(), &[]);
    let id = server.submit(&long_sweep(300));
    server.ask(&id, "pause");
    let url = format!("{}/api/v1/sweeps/{id}/events", server.address);
    let watching =
        std::thread::spawn(move || ureq::get(url).call().map(|mut a| a.body_mut().read_to_vec()));
    sleep(Duration::from_millis(500));
    let begin = Instant::now();
    assert!(server.terminate());
    assert!(begin.elapsed() < Duration::from_secs(20), "{:?}", begin.elapsed());
    assert!(watching.join().expect("it ends").is_ok());
}

#[test]
fn the_command_line_asks_the_same_with_and_without_a_service() {
    let folder = folder();
    let data = folder.path().to_str().expect("UTF-8");
    let server = Server::start("serve", folder.path(), &[]);
    let id = server.submit(&long_sweep(200));
    let ask = |command: &str| {
        let output = melange(&[command, &id, "--data", data], "");
        (output.status.code(), String::from_utf8_lossy(&output.stdout).into_owned())
    };
    let (code, line) = ask("pause");
    assert_eq!(code, Some(0));
    assert!(line.contains("paused") && line.contains(&id), "{line}");
    wait_for(&server, &id, &|s| count(s, "running") == 0);
    assert!(server.terminate());

    let (code, line) = ask("cancel");
    assert_eq!(code, Some(0));
    assert!(line.contains("cancelled"), "{line}");
    assert_eq!(ask("pause").0, Some(2), "it has ended");
    let listed = melange(&["sweeps", "--data", data], "");
    let listed = String::from_utf8_lossy(&listed.stdout).into_owned();
    assert!(listed.contains(&id) && listed.lines().count() == 1, "{listed}");
    assert_eq!(ask("delete").0, Some(0));
    assert_eq!(ask("delete").0, Some(2), "it is gone");
    let listed = melange(&["sweeps", "--data", data], "");
    assert!(listed.stdout.is_empty());
}

#[test]
fn a_backup_is_made_while_the_service_works_and_is_whole() {
    let folder = folder();
    let server = Server::start("serve", folder.path(), &[]);
    let ended = server.submit(&melt_sweep(40));
    server.wait(&ended);
    let under_way = server.submit(&long_sweep(40));
    wait_for(&server, &under_way, &|s| count(s, "completed") > 0);
    let place = melange_tests::folder();
    let copy = place.path().join("copy");
    let (data, to) = (folder.path().to_str().expect("UTF-8"), copy.to_str().expect("UTF-8"));
    let output = melange(&["backup", "--data", data, "--to", to], "");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    // A second one into the same folder is refused.
    assert_eq!(melange(&["backup", "--data", data, "--to", to], "").status.code(), Some(2));
    let verified = melange(&["verify", "--data", to, "--format", "json"], "");
    assert!(verified.status.success(), "{}", String::from_utf8_lossy(&verified.stdout));
    // In use, the original is not verified.
    assert_eq!(melange(&["verify", "--data", data], "").status.code(), Some(2));
    let original = server.json(&format!("/api/v1/sweeps/{ended}/runs"));
    drop(server);

    let server = Server::start("serve", &copy, &[]);
    assert_eq!(server.json(&format!("/api/v1/sweeps/{ended}/runs")), original);
    let complete = server.wait(&under_way);
    assert_eq!(count(&complete, "completed"), 40);
    let force = number(&original["items"][0]["force_n_per_m"]);
    assert!(force > 0.0);
}
