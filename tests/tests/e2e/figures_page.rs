//! The files of the page's figures: SVG and PNG are opened, and the Python draws what the CSV holds.

use melange_tests::{Server, folder, python, root};
use serde_json::{Value, json};
use std::fs;
use std::process::Command;

/// Submits a sweep and waits for its end.
fn solved(server: &Server, sweep: &Value) -> String {
    let id = server.submit(sweep);
    server.wait(&id);
    id
}

#[test]
fn every_figure_of_the_page_can_be_taken_along() {
    let (data, place) = (folder(), folder());
    let server = Server::start("serve", data.path(), &[]);
    let melt = json!({"parameter": "melt_rate_m_per_day", "linspace": [0.6, 1.0, 5]});
    let width = json!({"parameter": "width_m", "values": [3500, 4000, 4500]});
    let grid = solved(&server, &json!({"name": "grid", "regime": "steady", "axes": [melt, width]}));
    let season = json!({
        "name": "season", "regime": "transient", "start": "steady",
        "axes": [{"parameter": "melt_rate_m_per_day", "values": [0.8, 0.9]}],
        "parameters": {"n_cells": 20},
        "forcing": {"calving_rate_m_per_a": {"sinusoid": {"mean": 6000, "amplitude": 600, "period_a": 0.5}}},
        "time": {"duration_a": 1, "output_every_a": 0.02, "profiles_at_a": [0.25, 0.5, 1]},
    });
    let season = solved(&server, &season);
    let branch = json!({
        "name": "branch", "regime": "branch", "melt_shape": "linear",
        "axes": [{"parameter": "width_m", "values": [5600]}],
        "parameters": {"melt_rate_m_per_day": 0.35, "n_cells": 20},
        "branch": {"control": "melt_rate_m_per_day", "from": 0.3, "to": 0.45},
    });
    let branch = solved(&server, &branch);
    let saltelli = json!({
        "name": "design", "regime": "steady", "parameters": {"n_cells": 20},
        "sample": {"method": "saltelli", "n": 8, "ranges": {"mu_s": [0.28, 0.32], "d_m": [22, 28]}},
    });
    let saltelli = solved(&server, &saltelli);
    let places = [
        format!("#/sweep/{grid}/laws"),
        format!("#/sweep/{grid}/laws?by=width_m&speed=m_per_a"),
        format!("#/sweep/{grid}/profiles"),
        format!("#/sweep/{grid}/sensitivity"),
        format!("#/sweep/{saltelli}/sensitivity"),
        format!("#/sweep/{season}/seasons"),
        format!("#/sweep/{branch}/stability"),
    ];
    let output = Command::new("node")
        .arg(root().join("web/e2e/figures.mjs"))
        .arg(&server.address)
        .arg(place.path())
        .args(&places)
        .output()
        .expect("node can be run");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let list = place.path().join("figures.json");
    fs::write(&list, &output.stdout).expect("the list can be written");
    let figures: Vec<Value> = serde_json::from_slice(&output.stdout).expect("JSON");
    for place in &places {
        assert!(figures.iter().any(|f| f["place"] == place.as_str()), "{place} has no figure");
    }

    let read =
        |name: &str| fs::read_to_string(root().join("tests/python").join(name)).expect("a script");
    let told = python(&read("check_figures.py"), &[list.to_str().expect("UTF-8")], place.path());
    assert_eq!(told.lines().count(), figures.len());
    let redraw = read("redraw.py");
    for figure in &figures {
        let [script, table] =
            ["Python", "CSV"].map(|kind| figure["files"][kind].as_str().expect("a file"));
        let told = python(&redraw, &[script, table], place.path());
        assert!(told.contains("numbers"), "{}: {told}", figure["title"]);
    }
}
