//! Every form of a scenario through `melange run`, and through a sweep where the two could differ.

use crate::assert_close;
use melange_tests::{Server, folder, melange, root, run};
use serde_json::{Value, json};

fn solved(scenario: &Value, status: &str) -> Value {
    let (code, result) = run(&scenario.to_string());
    assert_eq!((code, result["status"].as_str()), (0, Some(status)), "{result}");
    result
}

fn number(result: &Value, name: &str) -> f64 {
    result[name].as_f64().unwrap_or_else(|| panic!("{name}: {}", result[name]))
}

/// Reference lengths of the continuum; N = 50 is within 2e-4 of them.
#[test]
fn quasi_static_states_by_thickness_length_and_volume() {
    for (h0, length) in [(75.0, 12_936.25), (100.0, 16_392.72), (150.0, 21_304.59)] {
        let result = solved(&json!({"regime": "quasi_static", "thickness_0_m": h0}), "converged");
        assert_close("L", &result["length_m"], &json!(length), 2e-4);
        assert_close("F", &result["force_n_per_m"], &json!(485.6665710 * h0 * h0), 1e-8);
        assert_eq!(result["parameters"]["melt_rate_m_per_day"], 0.0);
        assert_eq!(result["profile"]["velocity_m_per_a"][17], 0.0);
        for name in ["length_m", "volume_m3"] {
            let again = solved(&json!({"regime": "quasi_static", name: result[name]}), "converged");
            assert_close("H0", &again["thickness_0_m"], &json!(h0), 1e-9);
        }
    }
    solved(&json!({"regime": "quasi_static", "length_m": 1e5}), "overthick");
}

#[test]
fn a_table_that_is_a_straight_fjord_gives_the_same_mélange() {
    let straight = json!({"regime": "steady", "parameters": {"width_gradient": 0.01}});
    let table = json!({"regime": "steady",
        "fjord": {"x_m": [0, 1e4, 3e4, 5e4], "width_m": [4000, 4100, 4300, 4500]}});
    let (straight, table) = (solved(&straight, "converged"), solved(&table, "converged"));
    for name in ["length_m", "thickness_0_m", "force_n_per_m"] {
        assert_close(name, &table[name], &straight[name], 1e-9);
    }
    assert_eq!(table["parameters"]["width_m"], 4000.0);
    assert_close("dW/dx", &table["parameters"]["width_gradient"], &json!(0.01), 1e-12);

    let short = json!({"regime": "steady", "fjord": {"x_m": [0, 5000], "width_m": [4000, 4000]}});
    let (code, result) = run(&short.to_string());
    assert_eq!((code, result["status"].as_str()), (1, Some("failed")));
    assert!(result["detail"].as_str().expect("why").contains("`fjord`"), "{result}");
    let mut held = short;
    held["fjord"]["beyond"] = "constant".into();
    let base = solved(&json!({"regime": "steady"}), "converged");
    assert_close("L", &solved(&held, "converged")["length_m"], &base["length_m"], 1e-9);
}

/// A shape by points over χ is the named one, and a table over x is not scaled.
#[test]
fn melt_shapes_by_name_and_by_points() {
    let with = |shape: Value| {
        let parameters = json!({"melt_rate_m_per_day": 0.4, "width_m": 5000});
        solved(
            &json!({"regime": "steady", "parameters": parameters, "melt_shape": shape}),
            "converged",
        )
    };
    let named = with(json!("less_linear"));
    let points = with(json!({"chi": [0, 1], "factor": [5.0, 3.0]}));
    assert_close("L", &points["length_m"], &named["length_m"], 1e-10);
    let uniform = with(json!("uniform"));
    let over_x = with(json!({"x_m": [0, 1e5], "factor": [1, 1], "frame": "terminus"}));
    assert_close("L", &over_x["length_m"], &uniform["length_m"], 1e-10);
    let ratio = number(&named, "length_m") / number(&uniform, "length_m");
    assert!((ratio - 1.0).abs() > 1e-2, "{ratio}");
}

#[test]
fn a_season_with_a_calving_law_in_controlled_and_lagged_steps() {
    let season = json!({"melt_rate_m_per_day":
        {"sinusoid": {"mean": 0.7, "amplitude": 0.2, "period_a": 1}}});
    let scenario = |time: Value, lagged: bool| {
        solved(
            &json!({"regime": "transient", "parameters": {"melt_rate_m_per_day": 0.7, "n_cells": 20},
                "forcing": season, "calving_law": "steady_feedback", "time": time,
                "options": {"lagged": lagged}}),
            "completed",
        )
    };
    let time = json!({"duration_a": 1, "output_every_a": 0.125, "profiles_at_a": [0.3, 1]});
    let controlled = scenario(time, false);
    let series = &controlled["series"];
    let times: Vec<f64> = serde_json::from_value(series["time_a"].clone()).expect("times");
    assert_eq!(times, (0..=8).map(|k| f64::from(k) * 0.125).collect::<Vec<_>>());
    assert_close("melt", &series["melt_rate_m_per_day"][2], &json!(0.9), 1e-12);
    assert_eq!(controlled["states"][0]["time_a"], 0.3);
    for k in 0..times.len() {
        let force = series["force_n_per_m"][k].as_f64().expect("a force");
        let steady = series["force_n_per_m"][0].as_f64().expect("a force");
        let expected = json!(12_000.0 - 6_000.0 * force / steady);
        assert_close("U_c", &series["calving_rate_m_per_a"][k], &expected, 1e-9);
    }
    assert!(number(&controlled, "cfl_number") > 0.0);
    let fixed = json!({"duration_a": 1, "fixed_dt_a": 0.0025, "output_every_a": 0.125});
    let implicit = scenario(fixed.clone(), false);
    let lagged = scenario(fixed, true);
    for (run, relative) in [(&implicit, 2e-3), (&lagged, 1e-2)] {
        assert_close("L", &run["length_m"], &controlled["length_m"], relative);
    }
    assert_ne!(implicit["length_m"], lagged["length_m"]);
}

/// Rheology and glacier vary the same way; a pulse and a table of times.
#[test]
fn any_parameter_varies_in_time() {
    for (name, course) in [
        ("mu_s", json!({"ramp": {"from": 0.3, "to": 0.28, "start_a": 0.1, "end_a": 0.2}})),
        ("d_m", json!({"table": {"time_a": [0, 0.1], "value": [25, 24]}})),
        ("b", json!({"pulse": {"base": 1e4, "peak": 2e4, "period_a": 1, "width_a": 0.3}})),
        ("A", json!({"sinusoid": {"mean": 0.5, "amplitude": 0.1, "period_a": 0.5}})),
        (
            "terminus_thickness_m",
            json!({"ramp": {"from": 600, "to": 620, "start_a": 0, "end_a": 0.3}}),
        ),
        ("water_drag_n_per_m", json!({"ramp": {"from": 0, "to": 5e3, "start_a": 0, "end_a": 0.3}})),
    ] {
        let result = solved(
            &json!({"regime": "transient", "parameters": {"n_cells": 20}, "forcing": {name: course},
                "time": {"duration_a": 0.4, "tolerance": 1e-3}}),
            "completed",
        );
        let series = &result["series"]["length_m"];
        let last = series.as_array().expect("lengths").last().expect("one");
        let moved = last.as_f64().expect("a length") / series[0].as_f64().expect("a length") - 1.0;
        assert!(moved.abs() > 1e-5, "{name}: {moved}");
    }
}

/// A parameter that is forced to stay at a value is that value, from the first row to the last number.
#[test]
fn a_constant_forcing_is_the_parameter() {
    let start = json!({"length_m": 10_000, "thickness_0_m": 100});
    let time = json!({"duration_a": 0.05, "fixed_dt_a": 0.01});
    for (name, base, forced) in [
        ("mu_s", 0.25, 0.3),
        ("b", 3e4, 1e4),
        ("A", 1.5, 0.5),
        ("d_m", 30.0, 25.0),
        ("melt_rate_m_per_day", 0.2, 0.6),
        ("calving_rate_m_per_a", 5_000.0, 6_000.0),
        ("terminus_velocity_m_per_a", 5_000.0, 6_000.0),
        ("terminus_thickness_m", 700.0, 600.0),
        ("strain_rate_regularisation_per_a", 2.0, 1.0),
        ("water_drag_n_per_m", 5e3, 0.0),
    ] {
        let solved = |parameters: Value, forcing: Value| {
            solved(
                &json!({"regime": "transient", "start": start, "time": time, "forcing": forcing,
                    "parameters": parameters, "options": {"transects_at_chi": [0.5]}}),
                "completed",
            )
        };
        let plain = solved(json!({name: forced, "n_cells": 20}), json!({}));
        let table = json!({name: {"table": {"time_a": [0, 1], "value": [forced, forced]}}});
        let constant = solved(json!({name: base, "n_cells": 20}), table);
        for (key, value) in plain.as_object().expect("members") {
            if !["parameters", "iterations", "residual_norm", "provenance"].contains(&key.as_str())
            {
                assert_eq!(&constant[key], value, "{name} forced to {forced}: {key}");
            }
        }
    }
}

/// A kink of the forcing and a requested time that differ by rounding are one time: 14 · 0.1 is not 1.4.
#[test]
fn kinks_beside_requested_times_are_no_trouble() {
    for (course, every_a) in [
        (json!({"pulse": {"base": 0.5, "peak": 0.8, "period_a": 1, "width_a": 0.4}}), 0.1),
        (json!({"pulse": {"base": 0.0, "peak": 1.5, "period_a": 1, "width_a": 0.4}}), 0.1),
        (json!({"pulse": {"base": 0.5, "peak": 0.8, "period_a": 1, "width_a": 0.7}}), 0.05),
        (json!({"ramp": {"from": 0.6, "to": 0.5, "start_a": 0.7, "end_a": 1.0}}), 0.1),
    ] {
        let result = solved(
            &json!({"regime": "transient", "parameters": {"n_cells": 20},
                "forcing": {"melt_rate_m_per_day": course},
                "time": {"duration_a": 3, "output_every_a": every_a, "profiles_at_a": [1e-9, 1.4]}}),
            "completed",
        );
        let rows = result["series"]["time_a"].as_array().map(Vec::len);
        assert_eq!(rows, Some((3.0_f64 / every_a).round() as usize + 1), "{course}");
        assert_eq!(result["states"].as_array().map(Vec::len), Some(2));
    }
}

/// Packs so long and thin that they stick to the walls all over, and one that breaks up on the way.
#[test]
fn jammed_and_breaking_mélanges_have_their_verdicts() {
    for (width, length) in [(2_000, 12_000), (4_000, 20_000)] {
        let start = json!({"length_m": length, "thickness_0_m": 50});
        solved(
            &json!({"regime": "diagnostic", "parameters": {"width_m": width}, "start": start}),
            "converged",
        );
    }
    for time in [json!({"duration_a": 2}), json!({"duration_a": 2, "fixed_dt_a": 0.001})] {
        solved(
            &json!({"regime": "transient", "time": time,
                "parameters": {"melt_rate_m_per_day": 0.24, "mu_s": 0.35},
                "fjord": {"x_m": [-3e4, 0, 3e3, 8e3, 2e4, 1e5],
                    "width_m": [11_000, 10_000, 9_000, 11_000, 12_000, 14_000]},
                "start": {"length_m": 8_000, "thickness_0_m": 50}}),
            "collapsed",
        );
    }
}

#[test]
fn a_result_says_how_good_it_is() {
    let result = solved(
        &json!({"regime": "steady",
            "options": {"grid_error": true, "transects_at_chi": [0, 0.5, 1]}}),
        "converged",
    );
    assert_eq!(result["grid_error"]["n_cells"], json!([100, 200, 400]));
    let verdict = result["grid_convergence"].as_str().expect("a phrase");
    assert!(
        verdict.starts_with("not asymptotic") && verdict.contains("thickness_0_m"),
        "{verdict}"
    );
    assert!(number(&result, "grid_error_thickness_0_m") > 1.0);
    let transects = result["transects"].as_array().expect("transects");
    assert_eq!(transects.len(), 3);
    assert_eq!(transects[1]["velocity_m_per_a"].as_array().map(Vec::len), Some(101));
    let lost = number(&result, "inflow_m3_per_a")
        - number(&result, "melt_m3_per_a")
        - number(&result, "outflow_m3_per_a");
    let defect = lost / number(&result, "inflow_m3_per_a");
    assert_close("defect", &result["mass_budget_defect"], &json!(defect), 1e-6);
    assert!(result["validity"].is_null());

    let shaped = json!({"regime": "steady", "melt_shape": "linear", "parameters": {"n_cells": 20}});
    let validity = solved(&shaped, "converged")["validity"].clone();
    assert!(validity.as_str().expect("a caveat").contains("compression"), "{validity}");
}

/// A terminus that advances through a widening fjord: half a year, and another half from where the first
/// ended, are a year.
#[test]
fn a_run_goes_on_where_another_one_left_its_terminus() {
    let folder = folder();
    let server = Server::start("serve", folder.path(), &[]);
    let solved = |spec: Value| {
        let id = server.submit(&spec);
        assert_eq!(server.wait(&id)["counts"]["completed"], 1);
        server.json(&format!("/api/v1/sweeps/{id}/runs"))["items"][0].clone()
    };
    let scenario = |start: Value, duration_a: f64| {
        json!({"regime": "transient", "start": start,
            "parameters": {"width_gradient": 0.02, "calving_rate_m_per_a": 5000, "n_cells": 20},
            "time": {"duration_a": duration_a, "fixed_dt_a": 0.05}})
    };
    let wedge = json!({"length_m": 10_000, "thickness_0_m": 120});
    let whole = solved(scenario(wedge.clone(), 1.0));
    let first = solved(scenario(wedge, 0.5));
    let second = solved(scenario(json!({"run": first["run_id"]}), 0.5));
    assert_close("X_0", &first["terminus_x_m"], &json!(500.0), 1e-12);
    for name in ["terminus_x_m", "length_m", "thickness_0_m", "force_n_per_m"] {
        assert_close(name, &second[name], &whole[name], 1e-7);
    }
}

/// What the README points at works.
#[test]
fn every_example_is_solved() {
    let folder = folder();
    let examples = std::fs::read_dir(root().join("examples")).expect("examples");
    for (i, entry) in examples.enumerate() {
        let path = entry.expect("an example").path();
        let file = path.to_str().expect("UTF-8");
        let is_sweep = std::fs::read_to_string(&path).expect("text").contains("\nname = ");
        let data = folder.path().join(i.to_string());
        let data = data.to_str().expect("UTF-8");
        let output = if is_sweep {
            melange(&["sweep", file, "--data", data], "")
        } else {
            melange(&["run", file], "")
        };
        let text = String::from_utf8(output.stdout).expect("UTF-8");
        assert!(output.status.success(), "{file}: {text}");
        let result: Value = serde_json::from_str(text.trim()).expect("JSON");
        let failed = &result["counts"]["failed"];
        assert!(result["status"].is_string() || *failed == 0, "{file}: {text}");
    }
}

/// The same scenarios in a sweep: numbers, columns and the run's whole result are those of `run`.
#[test]
fn sweeps_of_every_regime_store_what_a_single_run_prints() {
    let folder = folder();
    let server = Server::start("serve", folder.path(), &[]);
    for spec in [
        json!({"regime": "quasi_static", "thickness_0_m": 100,
            "axes": [{"parameter": "width_m", "values": [3000, 4000]}]}),
        json!({"regime": "steady", "melt_shape": "u_shaped", "options": {"grid_error": true},
            "fjord": {"x_m": [0, 5e4], "width_m": [4000, 4400]},
            "parameters": {"n_cells": 20},
            "axes": [{"parameter": "melt_rate_m_per_day", "values": [0.4, 0.5]}]}),
        json!({"regime": "transient", "parameters": {"n_cells": 20},
            "forcing": {"melt_rate_m_per_day": {"sinusoid": {"mean": 0.6, "amplitude": 0.1, "period_a": 1}}},
            "calving_law": {"rate_m_per_a": 6000, "per_advance_per_a": -0.2},
            "time": {"duration_a": 0.5, "output_every_a": 0.1, "profiles_at_a": [0.25]},
            "axes": [{"parameter": "mu_s", "values": [0.3, 0.31]}]}),
    ] {
        let id = server.submit(&spec);
        server.wait(&id);
        let runs = server.json(&format!("/api/v1/sweeps/{id}/runs"));
        for (i, row) in runs["items"].as_array().expect("runs").iter().enumerate() {
            let run_id = row["run_id"].as_str().expect("an id");
            let stored = server.json(&format!("/api/v1/runs/{run_id}"));
            let mut scenario = spec.clone();
            let axis = scenario.as_object_mut().expect("members").remove("axes").expect("axes");
            let name = axis[0]["parameter"].as_str().expect("a name");
            scenario["parameters"][name] = axis[0]["values"][i].clone();
            let (_, printed) = run(&scenario.to_string());
            for name in ["status", "validity", "grid_convergence", "regime"] {
                assert_eq!(stored[name], printed[name], "{name}: {stored}");
            }
            for (name, value) in printed.as_object().expect("members") {
                if value.is_number() && name != "iterations" && name != "residual_norm" {
                    let small = value.as_f64().is_some_and(|v| v.abs() < 1e-6);
                    let scale = if small { &json!(1.0) } else { value };
                    let off = stored[name].as_f64().expect(name) - value.as_f64().expect(name);
                    let relative = off.abs() / scale.as_f64().expect("a number").abs();
                    assert!(relative < 1e-6, "{name}: {} and {value}", stored[name]);
                }
            }
            if let Some(series) = printed["series"].as_object() {
                for name in series.keys() {
                    let (a, b) = (&stored["series"][name], &series[name]);
                    assert_eq!(a.as_array().map(Vec::len), b.as_array().map(Vec::len), "{name}");
                }
                assert_eq!(stored["states"][0]["time_a"], 0.25);
            }
        }
    }
}
