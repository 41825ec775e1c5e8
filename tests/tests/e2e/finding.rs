//! Finding runs and sweeps, by filter and by nearness, and what people call sweeps by.

use crate::{melt_sweep, number};
use melange_tests::{Server, folder, melange};
use serde_json::{Value, json};
use std::path::Path;

/// A query with its members encoded.
pub(crate) fn query(path: &str, members: &[(&str, &str)]) -> String {
    let encode = |text: &str| -> String {
        text.bytes()
            .map(|b| match b {
                b if b.is_ascii_alphanumeric() => char::from(b).to_string(),
                b => format!("%{b:02X}"),
            })
            .collect()
    };
    let members: Vec<String> =
        members.iter().map(|(name, value)| format!("{name}={}", encode(value))).collect();
    format!("/api/v1{path}?{}", members.join("&"))
}

fn items(answer: &Value) -> &Vec<Value> {
    answer["items"].as_array().expect("items")
}

fn ids(answer: &Value) -> Vec<&str> {
    items(answer).iter().map(|item| item["id"].as_str().expect("an id")).collect()
}

/// Three sweeps that are complete: 11 melt rates; the middle ones of them again beside two widths; states at rest.
fn three_sweeps(server: &Server) -> [String; 3] {
    let melt = server.submit(&json!({
        "name": "Melt", "tags": ["paper", "fig:4"], "regime": "steady", "parameters": {"n_cells": 20},
        "axes": [{"parameter": "melt_rate_m_per_day", "linspace": [0.5, 1.0, 11]}],
    }));
    server.wait(&melt);
    let width = server.submit(&json!({
        "name": "Melt by width", "tags": ["draft"], "regime": "steady", "parameters": {"n_cells": 20},
        "axes": [
            {"parameter": "melt_rate_m_per_day", "linspace": [0.7, 0.8, 3]},
            {"parameter": "width_m", "values": [4000, 4500]},
        ],
    }));
    server.wait(&width);
    let rest = server.submit(&json!({
        "name": "At rest", "regime": "quasi_static", "length_m": 10000,
        "axes": [{"parameter": "width_m", "values": [3000, 5000]}],
    }));
    server.wait(&rest);
    [melt, width, rest]
}

#[test]
fn runs_of_all_sweeps_are_found_by_what_they_are_and_where_they_belong() {
    let folder = folder();
    let server = Server::start("serve", folder.path(), &[]);
    let [melt, width, rest] = three_sweeps(&server);
    let found = |filter: &str| server.json(&query("/runs", &[("filter", filter)]));
    let all = server.json("/api/v1/runs");
    assert_eq!(
        (&all["total"], &all["is_exact"], &all["next"]),
        (&json!(19), &json!(true), &Value::Null)
    );
    let sweeps: Vec<&str> =
        items(&all).iter().map(|run| run["sweep_id"].as_str().expect("an id")).collect();
    let expected = [vec![&rest[..]; 2], vec![&width[..]; 6], vec![&melt[..]; 11]].concat();
    assert_eq!(sweeps, expected, "the newest sweep first");
    assert_eq!(items(&all)[0]["sweep_name"], "At rest");
    assert_eq!(items(&all)[0]["owner"], "local");

    for (filter, total) in [
        ("tag = 'paper'", 11),
        ("tag != 'paper'", 8),
        ("tag in ('draft', 'fig:4') and not melt_rate_m_per_day > 0.7", 5 + 2),
        ("tag is null", 2),
        ("tag ~ 'FIG'", 11),
        ("regime = 'quasi_static' or width_m = 4500", 2 + 3),
        ("owner = 'local' and status = 'converged'", 19),
        ("owner is null or status = 'failed'", 0),
        ("sweep_name ~ 'MELT' and 0.7 <= melt_rate_m_per_day < 0.8 and width_m = 4000", 2 + 2),
        ("created_at >= '2020' and created_at < '2999-01-01T12:30Z'", 19),
        ("created_at < '2020-02-29'", 0),
        ("force_n_per_m > 0 and detail ~ 'STATE'", 17),
        ("note is null", 19),
        ("run_index = 1", 3),
    ] {
        let page = found(filter);
        let total = if filter.starts_with("force") { page["total"].clone() } else { json!(total) };
        assert_eq!((&page["total"], &page["is_exact"]), (&total, &json!(true)), "{filter}");
        assert_eq!(items(&page).len() as u64, total.as_u64().expect("a number"), "{filter}");
    }
    // A run that two sweeps share is listed once for each.
    let shared = items(&found("sweep_name = 'Melt' and melt_rate_m_per_day = 0.7"))[0].clone();
    let filter = format!("run_id = '{}'", shared["run_id"].as_str().expect("an id"));
    assert_eq!(found(&filter)["total"], 2);

    // Pages, in the order of sweeps and sorted.
    for sort in [None, Some("force_n_per_m"), Some("-melt_rate_m_per_day"), Some("status")] {
        let mut members = vec![("limit", "4"), ("filter", "width_m <= 4500")];
        members.extend(sort.map(|sort| ("sort", sort)));
        let mut seen: Vec<Value> = Vec::new();
        let mut cursor: Option<String> = None;
        loop {
            let mut members = members.clone();
            members.extend(cursor.as_deref().map(|cursor| ("cursor", cursor)));
            let page = server.json(&query("/runs", &members));
            assert_eq!(page["total"], 18);
            seen.extend(items(&page).iter().cloned());
            match page["next"].as_str() {
                Some(next) => cursor = Some(next.to_owned()),
                None => break,
            }
        }
        assert_eq!(seen.len(), 18, "{sort:?}");
        let key = |run: &Value| (run["sweep_id"].to_string(), run["run_index"].as_u64());
        let mut keys: Vec<_> = seen.iter().map(key).collect();
        keys.sort();
        keys.dedup();
        assert_eq!(keys.len(), 18, "{sort:?}: each once");
        if let Some(column) = sort.filter(|sort| *sort != "status") {
            let numbers = seen.iter().map(|run| number(&run[column.trim_start_matches('-')]));
            let numbers: Vec<f64> = numbers.collect();
            let is_descending = column.starts_with('-');
            assert!(numbers.is_sorted_by(|a, b| if is_descending { a >= b } else { a <= b }));
        }
    }
}

#[test]
fn a_filter_that_is_wrong_is_told_with_the_character() {
    let folder = folder();
    let server = Server::start("serve", folder.path(), &[]);
    for (path, filter, character) in [
        ("/runs", "status = 'x' and colour = 3", 18),
        ("/runs", "é = 1", 1),
        ("/runs", "tag > 'x'", 5),
        ("/runs", "width_m ~ '4'", 9),
        ("/runs", "created_at >= 'yesterday'", 15),
        ("/runs", "failed > 0", 1),
        ("/runs/nearest", "status = 3", 10),
        ("/sweeps", "failed > 0 and force_n_per_m > 1", 16),
        ("/sweeps", "created_at = '2026-02-30'", 14),
        ("/sweeps", "(name = 'x'", 12),
    ] {
        let mut members = vec![("filter", filter)];
        members.extend((path == "/runs/nearest").then_some(("melt_rate_m_per_day", "1")));
        let answer = server.get(&query(path, &members));
        let problem = answer.json();
        assert_eq!(answer.status, 422, "{filter}: {problem}");
        assert_eq!(problem["character"], character, "{filter}: {problem}");
        assert_eq!((&problem["field"], &problem["value"]), (&json!("filter"), &json!(filter)));
        assert!(problem["permitted"].is_string());
    }
    for path in [
        "/runs?colour=red",
        "/runs?limit=0",
        "/runs?cursor=5",
        "/runs?sort=owner",
        "/runs?sort=status&cursor=%5B1,2%5D",
        "/runs/nearest",
        "/runs/nearest?limit=5",
        "/runs/nearest?colour=1",
        "/runs/nearest?width_m=wide",
        "/runs/nearest?width_m=-1",
        "/runs/nearest?width_m=NaN",
        "/runs/nearest?width_m=4000&width_m=4100",
        "/runs/nearest?width_m=4000&limit=101",
    ] {
        let answer = server.get(&format!("/api/v1{path}"));
        assert!([400, 422].contains(&answer.status), "{path}: {}", answer.status);
        assert!(answer.json()["detail"].is_string(), "{path}");
    }
}

#[test]
fn sweeps_are_found_by_their_columns_and_by_what_their_runs_could_be() {
    let folder = folder();
    let server = Server::start("serve", folder.path(), &[]);
    let [melt, width, rest] = &three_sweeps(&server);
    for (filter, expected) in [
        ("melt_rate_m_per_day = 0.77", vec![width, melt]),
        ("melt_rate_m_per_day > 0.8", vec![melt]),
        ("not melt_rate_m_per_day >= 0.1", vec![rest]),
        ("width_m = 4200 or width_m = 3000", vec![rest, width]),
        ("tag = 'paper' or regime = 'quasi_static'", vec![rest, melt]),
        ("total > 5 and converged = total", vec![]),
        ("total > 5 and converged > 5 and failed = 0", vec![width, melt]),
        ("state = 'complete' and priority = 0", vec![rest, width, melt]),
        ("reused > 0", vec![width]),
        ("name ~ 'WIDTH' or id = 'none'", vec![width]),
        ("owner != 'local'", vec![]),
    ] {
        let answer = server.get(&query("/sweeps", &[("filter", filter)]));
        if filter.contains("= total") {
            assert_eq!(answer.json()["character"], 27, "columns are not compared with columns");
            continue;
        }
        let page = answer.json();
        assert_eq!(ids(&page), expected, "{filter}: {page}");
        assert_eq!((&page["total"], &page["next"]), (&json!(expected.len()), &Value::Null));
    }
    let members = [("filter", "total > 1"), ("limit", "2")];
    let first = server.json(&query("/sweeps", &members));
    assert_eq!((ids(&first), &first["total"]), (vec![&rest[..], width], &json!(3)));
    let next = first["next"].as_str().expect("a second page");
    let second = server.json(&query("/sweeps", &[members[0], members[1], ("cursor", next)]));
    assert_eq!((ids(&second), &second["next"]), (vec![&melt[..]], &Value::Null));
    assert_eq!(ids(&server.json("/api/v1/sweeps?tag=draft")), [width]);
    assert_eq!(
        ids(&server.json(&query("/sweeps", &[("tag", "draft"), ("filter", "total = 11")]))),
        Vec::<&str>::new()
    );
}

#[test]
fn the_nearest_runs_are_told_with_their_distance() {
    let folder = folder();
    let server = Server::start("serve", folder.path(), &[]);
    let [_, width, _] = three_sweeps(&server);
    let members = [("melt_rate_m_per_day", "0.71"), ("width_m", "4400"), ("limit", "3")];
    let near = server.json(&query("/runs/nearest", &members));
    assert_eq!(items(&near).len(), 3);
    let first = &items(&near)[0];
    assert_eq!((&first["sweep_id"], number(&first["width_m"])), (&json!(width), 4500.0));
    assert_eq!(number(&first["melt_rate_m_per_day"]), 0.7);
    let expected = ((0.01_f64 / 0.6).powi(2) + (4500.0_f64 / 4400.0).ln().powi(2)).sqrt();
    assert!((number(&first["distance"]) - expected).abs() < 1e-12, "{first}");
    assert!((number(&first["differences"]["melt_rate_m_per_day"]) + 0.01).abs() < 1e-12);
    assert_eq!(number(&first["differences"]["width_m"]), 100.0);
    let distances: Vec<f64> = items(&near).iter().map(|run| number(&run["distance"])).collect();
    assert!(distances.is_sorted());

    // What several sweeps share is told once, in the newest one.
    let same =
        server.json(&query("/runs/nearest", &[("melt_rate_m_per_day", "0.7"), ("n_cells", "20")]));
    let first = &items(&same)[0];
    assert_eq!((&first["sweep_id"], number(&first["distance"])), (&json!(width), 0.0));
    let mut ids: Vec<&str> =
        items(&same).iter().map(|run| run["run_id"].as_str().expect("an id")).collect();
    ids.sort_unstable();
    ids.dedup();
    assert_eq!(ids.len(), 5);
    let only = [("melt_rate_m_per_day", "0.7"), ("filter", "tag = 'paper'"), ("limit", "1")];
    assert_eq!(items(&server.json(&query("/runs/nearest", &only)))[0]["sweep_name"], "Melt");
}

#[test]
fn a_sweep_gets_another_name_tags_and_a_note_and_keeps_them() {
    let folder = folder();
    let server = Server::start("serve", folder.path(), &[]);
    let id = server.submit(&melt_sweep(2));
    server.wait(&id);
    let path = format!("/api/v1/sweeps/{id}");
    let before = server.json(&path);
    assert_eq!((&before["note"], &before["note_html"]), (&Value::Null, &Value::Null));
    let note = format!(
        "**Good** <script>alert(1)</script> [x](javascript:alert(1))\n\n{}",
        "é".repeat(300)
    );
    let edit = json!({"name": "other", "tags": ["b", "a"], "note": note, "priority": -3});
    let edited = server.patch(&path, &edit.to_string()).json();
    let html = edited["note_html"].as_str().expect("HTML");
    assert!(html.starts_with("<p><strong>Good</strong> &lt;script&gt;"), "{html}");
    assert!(!html.contains("javascript"), "{html}");
    assert_eq!((&edited["name"], &edited["tags"]), (&json!("other"), &json!(["a", "b"])));
    assert_eq!((&edited["note"], &edited["priority"]), (&json!(note), &json!(-3)));
    assert_eq!(edited["spec"], before["spec"], "it shows what was submitted");
    // What is not given stays, and nothing changes nothing.
    assert_eq!(server.patch(&path, r#"{"tags": []}"#).json()["name"], "other");
    assert_eq!(server.patch(&path, "{}").json()["note"], json!(note));
    let listed = &server.json("/api/v1/sweeps")["items"][0];
    assert_eq!(listed["note"].as_str().map(|text| text.chars().count()), Some(200));
    assert_eq!((&listed["note_is_cut"], &listed["note_html"]), (&json!(true), &Value::Null));
    let found = server
        .json(&query("/sweeps", &[("filter", "note ~ 'GOOD' and note ~ 'É' and priority < 0")]));
    assert_eq!(ids(&found), [id.as_str()]);

    for (edit, status, field) in [
        (json!({"owner": "me"}), 422, Some("owner")),
        (json!({"name": null}), 422, Some("name")),
        (json!({"name": "x".repeat(201)}), 422, Some("name")),
        (json!({"tags": ["two words"]}), 422, Some("tags[0]")),
        (json!({"priority": 1000}), 422, Some("priority")),
        (json!({"note": "x".repeat(20_001)}), 422, Some("note")),
        (json!([]), 400, None),
    ] {
        let answer = server.patch(&path, &edit.to_string());
        assert_eq!((answer.status, answer.json()["field"].as_str()), (status, field), "{edit}");
    }
    assert_eq!(server.patch(&path, "{").status, 400);
    assert_eq!(server.patch(&format!("{path}?x=1"), "{}").status, 400);
    assert_eq!(server.patch("/api/v1/sweeps/none", "{}").status, 404);
    assert!(server.terminate());
    let server = Server::start("serve", folder.path(), &[]);
    assert_eq!(server.json(&path)["note"], json!(note));
    assert_eq!(server.patch(&path, r#"{"note": null}"#).json()["note"], Value::Null);
}

/// What a command prints; it must succeed.
fn told(arguments: &[&str], data: &Path, input: &str) -> String {
    let data = data.to_str().expect("UTF-8");
    let output = melange(&[arguments, &["--data", data]].concat(), input);
    let (out, err) =
        (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{arguments:?}: {out}{err}");
    out.into_owned()
}

#[test]
fn the_command_line_finds_and_labels_with_and_without_a_service() {
    let folder = folder();
    let data = folder.path();
    let server = Server::start("serve", data, &[]);
    let [melt, width, _] = three_sweeps(&server);
    let mut server = Some(server);
    for is_served in [true, false] {
        if !is_served {
            assert!(server.take().is_some_and(Server::terminate));
        }
        let lines = told(&["sweeps", "--filter", "melt_rate_m_per_day = 0.77"], data, "");
        let found: Vec<&str> = lines.lines().filter_map(|line| line.split(' ').next()).collect();
        assert_eq!(found, [&width, &melt]);
        let text = told(
            &["runs", "--filter", "width_m = 4500", "--sort", "-melt_rate_m_per_day"],
            data,
            "",
        );
        assert_eq!(text.lines().count(), 3, "{text}");
        assert!(
            text.lines().next().is_some_and(|line| {
                line.starts_with(&width) && line.contains(" melt_rate_m_per_day=0.8 width_m=4500 ")
            }),
            "{text}"
        );
        let page: Value =
            serde_json::from_str(&told(&["runs", "--sweep", &melt, "--format", "json"], data, ""))
                .expect("JSON");
        assert_eq!((items(&page).len(), &page["total"]), (11, &json!(11)));
        let table = told(&["runs", "--format", "csv", "--limit", "5"], data, "");
        assert!(table.starts_with("sweep_id,sweep_name,owner,run_index,run_id,status,"), "{table}");
        assert_eq!(table.lines().count(), 6);
        let param = ["--param", "melt_rate_m_per_day=0.71", "--param", "width_m=4400"];
        let near = told(&[&["nearest"], &param[..], &["--limit", "2"]].concat(), data, "");
        assert_eq!(near.lines().count(), 2, "{near}");
        assert!(near.lines().next().is_some_and(|line| line.contains("width_m=4500")), "{near}");

        let tag = if is_served { "served" } else { "alone" };
        told(&["tag", &melt, "--add", tag, "--remove", "paper"], data, "");
        told(&["note", &melt, "-"], data, &format!("# By {tag}"));
        let filter = format!("tag = '{tag}' and tag != 'paper' and note ~ 'by {tag}'");
        assert!(told(&["sweeps", "--filter", &filter], data, "").starts_with(&melt));

        let folder = data.to_str().expect("UTF-8");
        let wrong =
            melange(&["runs", "--filter", "status = 'x' and colour = 3", "--data", folder], "");
        let problem = String::from_utf8_lossy(&wrong.stderr);
        assert_eq!(wrong.status.code(), Some(2), "{problem}");
        let mark = "\n  status = 'x' and colour = 3\n                   ^\n";
        assert!(problem.starts_with("refused: ") && problem.ends_with(mark), "{problem}");
        for arguments in [
            &["tag", "none", "--add", "x"][..],
            &["tag", &melt, "--add", "two words"],
            &["runs", "--sweep", "none"],
            &["nearest", "--param", "colour=3"],
            &["nearest", "--param", "width_m"],
            &["sweeps", "--filter", "melt > 3"],
        ] {
            let refused = melange(&[arguments, &["--data", folder]].concat(), "");
            assert_eq!(refused.status.code(), Some(2), "{arguments:?}");
        }
    }
}
