//! Laws and sensitivities in a real browser: `web/e2e/laws.mjs` reads them off the page, and they are the service's.

use crate::number;
use melange_tests::{Server, folder, root};
use serde_json::{Value, json};
use std::process::Command;

/// What the page makes of a number with a minus sign of its own.
fn plain(text: &Value) -> String {
    text.as_str().expect("a text").replace('−', "-")
}

/// A number of the page and one of the service are the same to three digits behind the point.
fn assert_shown(shown: &Value, expected: &Value) {
    let expected = number(expected);
    assert_eq!(plain(shown), format!("{expected:.3}"));
}

/// The same to as many digits as the page shows.
fn assert_near(shown: &Value, expected: f64) {
    let shown: f64 = plain(shown).parse().expect("a number");
    let error = (shown - expected).abs() / expected.abs();
    assert!(error < 1e-3, "{shown} is not {expected}");
}

#[test]
fn laws_and_sensitivities_are_read_off_the_page() {
    let folder = folder();
    let server = Server::start("serve", folder.path(), &[]);
    let submit = |spec: Value| {
        let id = server.submit(&spec);
        server.wait(&id);
        id
    };
    let grid = submit(json!({
        "name": "melt by width", "regime": "steady", "parameters": {"n_cells": 20},
        "axes": [
            {"parameter": "melt_rate_m_per_day", "linspace": [0.5, 0.8, 9]},
            {"parameter": "width_m", "values": [3600, 4000, 4600]},
        ],
    }));
    let design = submit(json!({
        "name": "a design", "regime": "steady", "parameters": {"n_cells": 20},
        "sample": {"method": "saltelli", "n": 8, "seed": 1, "ranges": {
            "melt_rate_m_per_day": [0.55, 0.75], "width_m": [3800, 4600], "b": {"log": [8e3, 2e4]},
        }},
    }));
    let local = submit(json!({
        "name": "sensitivities", "regime": "steady", "parameters": {"n_cells": 20},
        "options": {"sensitivities": true},
        "axes": [{"parameter": "melt_rate_m_per_day", "values": [0.5, 0.7, 0.9]}],
    }));

    let output = Command::new("node")
        .arg(root().join("web/e2e/laws.mjs"))
        .args([&server.address, &grid, &design, &local])
        .output()
        .expect("node can be run");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let seen: Value = serde_json::from_slice(&output.stdout).expect("JSON");

    // One law for all runs.
    let laws = |more: &str| {
        let path =
            format!("/api/v1/sweeps/{grid}/laws?x=melt_rate_m_per_day&y=force_n_per_m{more}");
        server.json(&path)
    };
    let all = &laws("")["groups"][0];
    assert_shown(&seen["exponent"], &all["fit"]["exponent"]["estimate"]);
    let [low, high] = [0, 1].map(|end| number(&all["fit"]["exponent"]["ci95"][end]));
    assert_eq!(plain(&seen["interval"]), format!("{low:.3} to {high:.3}"));
    assert_eq!(plain(&seen["used"]), all["fit"]["n_used"].to_string());
    let points = all["points"]["x"].as_array().expect("points").len();
    assert_eq!(seen["csv_points"], points);
    let script = seen["python"].as_str().expect("a script");
    assert!(script.contains(&format!("read(\"sweeps/{grid}/laws?")), "{script}");

    // One law for each width.
    let by_width = laws("&group_by=width_m");
    let (rows, groups) = (&seen["groups"], &by_width["groups"]);
    for (i, width) in ["3600 m", "4000 m", "4600 m"].into_iter().enumerate() {
        assert_eq!(rows[i][0], width);
        assert_eq!(rows[i][1], groups[i]["fit"]["n_used"].to_string());
        assert_shown(&rows[i][2], &groups[i]["fit"]["exponent"]["estimate"]);
    }
    assert_eq!(seen["exponent_4000"], rows[1][2]);

    // A rate in days is one in years times the days of a year.
    let exponential = laws("&model=exponential&filter=width_m%20%3D%204000");
    let rate = number(&exponential["groups"][0]["fit"]["exponent"]["estimate"]);
    assert_near(&seen["rate_per_day"], rate);
    assert_near(&seen["rate_per_a"], rate / 365.25);

    // A point opens a run of that width: the second of every three.
    let opened: usize = seen["opened"].as_str().expect("an index").parse().expect("an index");
    assert_eq!(opened % 3, 1, "{opened}");
    assert_eq!(seen["brushed"], "18 of 27 runs that are drawn.");

    // Sobol's indices, and why there are none.
    let refusal = server.get(&format!("/api/v1/sweeps/{grid}/indices?y=force_n_per_m"));
    assert_eq!(refusal.status, 409);
    assert_eq!(seen["refusal"], refusal.json()["detail"]);
    let indices = server.json(&format!("/api/v1/sweeps/{design}/indices?y=force_n_per_m"));
    let listed = indices["indices"].as_array().expect("indices");
    assert_eq!(listed.len(), 3);
    for index in listed {
        let parameter = index["parameter"].as_str().expect("a name");
        for kind in ["first", "total"] {
            let shown: f64 =
                plain(&seen["indices"][format!("{kind}-{parameter}")]).parse().expect("a number");
            let expected = number(&index[kind]["estimate"]);
            assert!(
                (shown - expected).abs() <= 6e-3 * expected.abs().max(1e-3),
                "{parameter}, {kind}: {shown} is not {expected}"
            );
        }
    }
}
