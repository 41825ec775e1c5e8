//! Profiles, seasons and stability in a real browser: `web/e2e/profiles.mjs` walks through the panels, and what it
//! reads off them are the service's numbers; the scripts of all figures run.

use crate::number;
use melange_tests::{Server, folder, python, root};
use serde_json::{Value, json};
use std::fs;
use std::process::Command;

/// Which of the steady runs is singled out.
const RUN: usize = 6;

fn text<'a>(seen: &'a Value, name: &str) -> &'a str {
    seen[name].as_str().unwrap_or_else(|| panic!("no {name} in {seen}"))
}

/// The id of a run of a sweep.
fn run_id(server: &Server, sweep: &str, index: usize) -> String {
    let path = format!("/api/v1/sweeps/{sweep}/runs?filter=run_index%20%3D%20{index}");
    server.json(&path)["items"][0]["run_id"].as_str().expect("a run's id").to_owned()
}

#[test]
fn profiles_seasons_and_stability_show_the_services_numbers() {
    let (data, files) = (folder(), folder());
    let server = Server::start("serve", data.path(), &[]);
    let steady = json!({
        "name": "melt by width",
        "regime": "steady",
        "parameters": {"n_cells": 20},
        "axes": [{"parameter": "melt_rate_m_per_day", "linspace": [0.5, 0.8, 15]},
                 {"parameter": "width_m", "values": [4000, 5000]}],
    });
    let at_rest = json!({
        "name": "at rest",
        "regime": "quasi_static",
        "parameters": {"n_cells": 20},
        "length_m": 12000,
        "axes": [{"parameter": "b", "values": [1e4, 2e4]}],
    });
    let seasons = json!({
        "name": "seasons",
        "regime": "transient",
        "parameters": {"n_cells": 20},
        "start": "steady",
        "time": {"duration_a": 2, "output_every_a": 0.02, "profiles_at_a": [0, 0.5, 1, 1.5, 2]},
        "forcing": {"calving_rate_m_per_a": {"sinusoid": {"mean": 6000, "amplitude": 600, "period_a": 1, "phase_a": 0}},
                    "mu_s": {"sinusoid": {"mean": 0.3, "amplitude": 1e-4, "period_a": 1}}},
        "axes": [{"parameter": "melt_rate_m_per_day", "values": [0.6, 0.8]}],
    });
    let branch = json!({
        "name": "branch",
        "regime": "branch",
        "parameters": {"melt_rate_m_per_day": 0.35, "n_cells": 20},
        "melt_shape": "linear",
        "branch": {"control": "melt_rate_m_per_day", "from": 0.1, "to": 0.9},
        "axes": [{"parameter": "width_m", "values": [5000, 5600]}],
    });
    let folds = json!({
        "name": "folds",
        "regime": "fold_curve",
        "parameters": {"melt_rate_m_per_day": 0.35, "n_cells": 20, "width_m": 5600},
        "melt_shape": "linear",
        "fold_curve": {"control": "melt_rate_m_per_day", "from": 0.1, "to": 0.7,
                       "second": "width_m", "second_from": 5000, "second_to": 6000},
    });
    let ids = [&steady, &at_rest, &seasons, &branch, &folds].map(|spec| server.submit(spec));
    for id in &ids {
        let sweep = server.wait(id);
        assert_eq!(sweep["counts"]["failed"], 0, "{sweep}");
    }
    let [steady, at_rest, seasons, branch, folds] = &ids;

    let output = Command::new("node")
        .arg(root().join("web/e2e/profiles.mjs"))
        .arg(&server.address)
        .args([steady, &RUN.to_string(), at_rest, seasons, branch, folds])
        .arg(files.path())
        .output()
        .expect("node can be run");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let seen: Value = serde_json::from_slice(&output.stdout).expect("JSON");

    // Of a grid, one run of each melt rate is drawn.
    assert!(text(&seen, "showing").contains("Showing 15 of "), "{seen}");
    let run = server.json(&format!("/api/v1/runs/{}", run_id(&server, steady, RUN)));
    let force = number(&run["force_n_per_m"]);
    assert!((1e6..1e8).contains(&force), "{force}");
    let (mantissa, power) = if force < 1e7 { (force / 1e6, "⁶") } else { (force / 1e7, "⁷") };
    assert_eq!(text(&seen, "force"), format!("{mantissa:.3} × 10{power} N m⁻¹"));
    assert_eq!(text(&seen, "length"), format!("{:.0} m", number(&run["length_m"])));

    let season = server.json(&format!("/api/v1/runs/{}/season", run_id(&server, seasons, 0)));
    let lag = number(&season["lag_a"]);
    assert!((0.1..0.4).contains(&lag), "{lag}");
    assert_eq!(season["also_swings"], json!(["mu_s"]));
    let also = text(&seen, "alsoSwings");
    assert!(also.contains("swings too") && also.contains("not to calving rate"), "{also}");
    assert_eq!(text(&seen, "lag"), format!("{lag:.3} a ({:.0} d)", lag * 365.25));
    assert_eq!(seen["snapshots"], json!(["t = 0 a", "t = 0.5000 a"]));

    let followed = server.json(&format!("/api/v1/runs/{}", run_id(&server, branch, 0)));
    let followed = &followed["branch"];
    let threshold = number(&followed["folds"][0]["control_value"]);
    assert_eq!(text(&seen, "fold"), format!("{threshold:.6}"));
    assert_eq!(followed["points"][1]["stable"], json!(true));
    assert!(text(&seen, "verdict").starts_with("stable"), "{seen}");
    let rate = number(&followed["points"][1]["growth_rate_re_per_a"][0]);
    let shown: f64 =
        seen["rates"][0].as_str().expect("a rate").replace('−', "-").parse().expect("a number");
    assert!((shown - rate).abs() <= 1e-3 * rate.abs(), "{shown} is not {rate}");

    // Each figure's script reads the same data from the service and draws it.
    let scripts = seen["scripts"].as_array().expect("scripts");
    assert!(scripts.len() >= 18, "{scripts:?}");
    for script in scripts {
        let path = script.as_str().expect("a path");
        let script = fs::read_to_string(path).expect("the script was saved");
        python(&format!("import matplotlib\nmatplotlib.use('agg')\n{script}"), &[], files.path());
    }
}
