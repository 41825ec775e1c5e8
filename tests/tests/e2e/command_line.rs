//! `melange run` and `melange sweep`: results, exit codes, refusals.

use crate::{assert_all_close, assert_close, melt_sweep};
use melange_tests::{folder, melange, root, run};
use serde_json::{Value, json};

fn reference(name: &str) -> Value {
    let path = root().join("solver/tests/reference").join(name);
    let text = std::fs::read_to_string(&path).expect("the reference is there");
    serde_json::from_str(&text).expect("it is JSON")
}

const PROFILE: [&str; 4] = ["velocity_m_per_a", "thickness_m", "fluidity_per_a", "mu_w"];

#[test]
fn steady_states_equal_the_reference() {
    for expected in reference("steady_melt_n50.json")["states"].as_array().expect("states") {
        let melt = &expected["melt_rate_m_per_day"];
        let scenario = json!({"regime": "steady", "parameters": {"melt_rate_m_per_day": melt}});
        let (code, result) = run(&scenario.to_string());
        assert_eq!((code, result["status"].as_str()), (0, Some("converged")));
        assert_close("L", &result["length_m"], &expected["length_m"], 1e-8);
        assert_close("H0", &result["thickness_0_m"], &expected["thickness_0_m"], 1e-8);
        assert_close("F", &result["force_n_per_m"], &expected["force_n_per_m"], 1e-7);
        for name in PROFILE {
            assert_all_close(name, &result["profile"][name], &expected[name], 1e-8);
        }
    }
}

#[test]
fn diagnostic_solve_and_steps_equal_the_published_codes() {
    for (case_name, case) in
        reference("published_code_steps.json")["cases"].as_object().expect("cases")
    {
        let mut parameters = case["parameters"].clone();
        parameters["n_cells"] = case["n_cells"].clone();
        let start = json!({"length_m": 10_000, "thickness_0_m": 75});
        let scenario = json!({"regime": "diagnostic", "parameters": parameters, "start": start});
        let (code, result) = run(&scenario.to_string());
        assert_eq!(code, 0, "{result}");
        for (name, expected) in case["diagnostic"].as_object().expect("a profile") {
            assert_all_close(name, &result["profile"][name], expected, 1e-7);
        }

        let time = json!({
            "duration_a": 0.04, "fixed_dt_a": 0.01, "output_every_a": 0.01,
            "profiles_at_a": [0.01, 0.02, 0.03, 0.04],
        });
        let scenario =
            json!({"regime": "transient", "parameters": parameters, "start": start, "time": time});
        let (code, result) = run(&scenario.to_string());
        assert_eq!((code, result["status"].as_str()), (0, Some("completed")));
        let steps = case["steps"].as_array().expect("steps");
        for (i, expected) in steps.iter().enumerate() {
            for name in ["time_a", "length_m", "thickness_0_m", "force_n_per_m"] {
                assert_close(name, &result["series"][name][i + 1], &expected[name], 1e-7);
            }
            let state = &result["states"][i];
            assert_close("t", &state["time_a"], &expected["time_a"], 1e-12);
            for name in PROFILE {
                let values = expected[name].as_array().expect("an array");
                assert_eq!(state["profile"][name].as_array().map(Vec::len), Some(values.len()));
                for (k, value) in values.iter().enumerate() {
                    // One published number does not solve its own equation (see the solver's tests).
                    let place = (case_name.as_str(), i, name, k);
                    let stopped_short = place == ("base", 0, "fluidity_per_a", 5);
                    let relative = if stopped_short { 1e-6 } else { 1e-7 };
                    assert_close(name, &state["profile"][name][k], value, relative);
                }
            }
        }
    }
}

#[test]
fn toml_and_files_are_read_and_text_is_printed() {
    let folder = folder();
    let path = folder.path().join("scenario.toml");
    std::fs::write(&path, "regime = \"steady\"\n[parameters]\nmelt_rate_m_per_day = 0.7\n")
        .expect("a file");
    let output = melange(&["run", path.to_str().expect("UTF-8"), "--format", "text"], "");
    let text = String::from_utf8(output.stdout).expect("UTF-8");
    assert!(text.starts_with("converged: "), "{text}");
    assert!(text.contains("length_m") && text.contains("9.917164"), "{text}");
    let missing = melange(&["run", "no-such-file.toml"], "");
    assert_eq!(missing.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&missing.stderr).contains("no-such-file.toml"));
}

#[test]
fn verdicts_of_physics_are_results() {
    for (parameters, verdict) in [
        (json!({"melt_rate_m_per_day": 1.8, "width_m": 7000}), "no_steady_state"),
        (json!({"melt_rate_m_per_day": 0.3, "width_m": 2500}), "overthick"),
    ] {
        let scenario = json!({"regime": "steady", "parameters": parameters});
        let (code, result) = run(&scenario.to_string());
        assert_eq!((code, result["status"].as_str()), (0, Some(verdict)), "{result}");
        assert!(result["length_m"].is_null() && result["profile"].is_null());
        assert!(!result["detail"].as_str().expect("evidence").is_empty());
    }
}

/// Each bad input with the field that must be named and a word of the sentence.
#[test]
fn bad_input_is_refused_with_field_value_and_range() {
    for (scenario, field, word) in [
        (r#"{"regime":"steady","parameters":{"melt":1}}"#, "parameters.melt", "no parameter"),
        ("regime = \"steady\"\n[parameters]\nb = nan", "parameters.b", "NaN"),
        ("regime = \"steady\"\n[parameters]\nb = inf", "parameters.b", "from 1 to"),
        (
            r#"{"regime":"steady","parameters":{"width_m":-1}}"#,
            "parameters.width_m",
            "from 10 to 1000000 m",
        ),
        (
            r#"{"regime":"steady","parameters":{"n_cells":50.5}}"#,
            "parameters.n_cells",
            "whole number",
        ),
        (r#"{"regime":"steady","parameters":{"b":1e4,"b":2e4}}"#, "parameters.b", "more than once"),
        (r#"{"regime":"steady","parameters":{"b":"x"}}"#, "parameters.b", "expected f64"),
        (r#"{"regime":"stead"}"#, "regime", "steady"),
        (r#"{"parameters":{}}"#, "regime", "missing"),
        (r#"{"regime":"steady","parametres":{}}"#, "parametres", "unknown field"),
        (r#"{"regime":"branch"}"#, "branch", "missing"),
        (r#"{"regime":"steady","sample":{}}"#, "sample", "method"),
        (r#"{"regime":"steady","tags":["a"]}"#, "tags", "belongs to a sweep"),
        (
            r#"{"regime":"steady","table":{"columns":["b"],"rows":[[1e4],["x"]]}}"#,
            "table.rows[1][0]",
            "in row 2, column `b`",
        ),
        (r#"{"regime":"steady","fjord":{"x_m":[0]}}"#, "fjord", "width_m"),
        (
            r#"{"regime":"steady","fjord":{"x_m":[0,1e4],"width_m":[4e3,5]}}"#,
            "fjord.width_m[1]",
            "from 10 to 1000000 m",
        ),
        (
            r#"{"regime":"steady","fjord":{"x_m":[0,1e4,1e4],"width_m":[4e3,4e3,4e3]}}"#,
            "fjord.x_m[2]",
            "ascending",
        ),
        (
            r#"{"regime":"steady","fjord":{"x_m":[0,1e3],"width_m":[4e3,6e3]}}"#,
            "fjord.width_m[1]",
            "no more than the distance",
        ),
        (
            r#"{"regime":"steady","fjord":{"x_m":[100,1e5],"width_m":[4e3,6e3]}}"#,
            "fjord.x_m",
            "from 0 or before",
        ),
        (
            r#"{"regime":"steady","fjord":{"x_m":[0,1e5],"width_m":[4e3,6e3]},"parameters":{"width_m":4e3}}"#,
            "parameters.width_m",
            "which gives the width",
        ),
        (r#"{"regime":"steady","melt_shape":"linaer"}"#, "melt_shape", "u_shaped"),
        (
            r#"{"regime":"steady","melt_shape":{"chi":[0,0.9],"factor":[1,1]}}"#,
            "melt_shape.chi[1]",
            "up to 1",
        ),
        (
            r#"{"regime":"steady","melt_shape":{"x_m":[0,1],"factor":[1,-1],"frame":"bedrock"}}"#,
            "melt_shape.factor[1]",
            "0 or more",
        ),
        (r#"{"regime":"quasi_static"}"#, "length_m", "exactly one"),
        (r#"{"regime":"quasi_static","length_m":1e4,"volume_m3":1e9}"#, "volume_m3", "exactly one"),
        (r#"{"regime":"steady","volume_m3":1e9}"#, "volume_m3", "quasi_static"),
        (r#"{"regime":"quasi_static","thickness_0_m":20}"#, "thickness_0_m", "d_m = 25"),
        (
            r#"{"regime":"quasi_static","length_m":1e4,"parameters":{"melt_rate_m_per_day":0.6}}"#,
            "parameters.melt_rate_m_per_day",
            "nothing melts",
        ),
        (
            r#"{"regime":"quasi_static","length_m":1e4,"parameters":{"terminus_velocity_m_per_a":0}}"#,
            "parameters.terminus_velocity_m_per_a",
            "undetermined",
        ),
        (r#"{"regime":"steady","length_m":1e4}"#, "length_m", "quasi_static"),
        (r#"{"regime":"steady","options":{"lagged":true}}"#, "options.lagged", "transient"),
        (
            r#"{"regime":"transient","time":{"duration_a":1},"options":{"lagged":true}}"#,
            "options.lagged",
            "fixed_dt_a",
        ),
        (
            r#"{"regime":"transient","time":{"duration_a":1},"options":{"grid_error":true}}"#,
            "options.grid_error",
            "steady",
        ),
        (
            r#"{"regime":"steady","options":{"transects_at_chi":[1.5]}}"#,
            "options.transects_at_chi[0]",
            "0 to 1",
        ),
        (r#"{"regime":"steady","calving_law":"steady_feedback"}"#, "calving_law", "transient"),
        (
            r#"{"regime":"transient","time":{"duration_a":1},"calving_law":{"rate_m_per_a":-1}}"#,
            "calving_law.rate_m_per_a",
            "from 0 to 100000",
        ),
        (
            r#"{"regime":"transient","time":{"duration_a":1},"forcing":{"melt":{"ramp":{"from":0,"to":1,"start_a":0,"end_a":1}}}}"#,
            "forcing.melt",
            "melt_rate_m_per_day",
        ),
        (
            r#"{"regime":"transient","time":{"duration_a":1},"forcing":{"width_m":{"ramp":{"from":4e3,"to":5e3,"start_a":0,"end_a":1}}}}"#,
            "forcing.width_m",
            "cannot vary",
        ),
        (
            r#"{"regime":"transient","time":{"duration_a":1},"forcing":{"b":{"ramp":{"from":0,"to":1e4,"start_a":0,"end_a":1}}}}"#,
            "forcing.b",
            "from 1 to",
        ),
        (
            r#"{"regime":"transient","time":{"duration_a":1},"forcing":{"b":{"sinusoid":{"mean":1e4,"amplitude":1,"period_a":0}}}}"#,
            "forcing.b.sinusoid.period_a",
            "above 0",
        ),
        (
            r#"{"regime":"transient","time":{"duration_a":1},"forcing":{"b":{"sinusoid":[1e4,1,1,0]}}}"#,
            "forcing.b.sinusoid",
            "by name",
        ),
        (
            r#"{"regime":"transient","time":{"duration_a":1},"forcing":{"b":{"table":{"time_a":[0,0],"value":[1e4,1e4]}}}}"#,
            "forcing.b.table.time_a[1]",
            "ascending",
        ),
        (
            r#"{"regime":"steady","options":{"upstream_closure":"printed"}}"#,
            "options.upstream_closure",
            "family",
        ),
        (r#"{"regime":"steady","start":"steady"}"#, "start", "does not depend"),
        (r#"{"regime":"diagnostic"}"#, "start", "missing"),
        (r#"{"regime":"diagnostic","start":{"length_m":1e4}}"#, "start", "thickness_0_m"),
        (
            r#"{"regime":"diagnostic","start":{"length_m":1e4,"thickness_0_m":10}}"#,
            "start.thickness_0_m",
            "d_m = 25",
        ),
        (r#"{"regime":"transient"}"#, "time", "missing"),
        (r#"{"regime":"transient","time":{"duration_a":0}}"#, "time.duration_a", "from 1e-6"),
        (
            r#"{"regime":"transient","time":{"duration_a":1,"tolerance":1e-9}}"#,
            "time.tolerance",
            "1e-7",
        ),
        (
            r#"{"regime":"transient","time":{"duration_a":1,"fixed_dt_a":0.3}}"#,
            "time.duration_a",
            "whole number",
        ),
        (
            r#"{"regime":"transient","time":{"duration_a":1,"fixed_dt_a":0.1,"profiles_at_a":[2]}}"#,
            "time.profiles_at_a[0]",
            "not after",
        ),
        (
            r#"{"regime":"transient","time":{"duration_a":1,"fixed_dt_a":0.1,"tolerance":1e-3}}"#,
            "time.tolerance",
            "not together with fixed_dt_a",
        ),
        (
            r#"{"regime":"steady","parameters":{"calving_flux_m2_per_a":3.6e6,"calving_rate_m_per_a":1}}"#,
            "parameters.calving_flux_m2_per_a",
            "calving_rate_m_per_a",
        ),
        (
            r#"{"regime":"steady","parameters":{"calving_rate_m_per_a":5000,"width_gradient":0.01}}"#,
            "parameters.calving_rate_m_per_a",
            "varying width",
        ),
        (
            r#"{"regime":"diagnostic","start":{"length_m":1e4,"thickness_0_m":75},"parameters":{"calving_rate_m_per_a":0,"terminus_velocity_m_per_a":0}}"#,
            "parameters.terminus_velocity_m_per_a",
            "undetermined",
        ),
        (r#"{"regime":"transient","time":[0.1,0.1,null,null,[]]}"#, "time", "by name"),
        (r#"{"regime":{"steady":null}}"#, "regime", "a name"),
        (r#"{"regime":"steady","axes":[]}"#, "", ""),
        (r#"{"regime":"steady","name":"x"}"#, "name", "sweep"),
    ] {
        let (code, result) = run(scenario);
        if field.is_empty() {
            assert_eq!(code, 0, "{scenario}: {result}");
            continue;
        }
        assert_eq!((code, result["status"].as_str()), (2, Some("refused")), "{scenario}: {result}");
        assert_eq!(result["field"].as_str(), Some(field), "{scenario}: {result}");
        let detail = result["detail"].as_str().expect("a sentence");
        assert!(detail.contains(word), "{scenario}: {detail}");
    }
    // An unknown name or a wrong type tells the value found and what would be permitted.
    for (scenario, value, permitted) in [
        (r#"{"regime":"steady","parameters":{"melt":1.5}}"#, json!(1.5), "melt_rate_m_per_day"),
        ("regime = \"steady\"\n[parameters]\nmelt = nan", json!("NaN"), "melt_rate_m_per_day"),
        (r#"{"regime":"stead"}"#, json!("stead"), "steady"),
        (r#"{"regime":"steady","parametres":{"b":1}}"#, json!({"b": 1}), "parameters"),
        (r#"{"regime":"steady","parameters":{"b":"x"}}"#, json!("x"), "f64"),
        (r#"{"regime":"steady","options":{"lagged":1}}"#, json!(1), "a boolean"),
    ] {
        let (_, result) = run(scenario);
        assert_eq!(result["value"], value, "{result}");
        assert!(
            result["permitted"].as_str().expect("what is permitted").contains(permitted),
            "{result}"
        );
        assert!(!result["permitted"].to_string().contains("at line"), "{result}");
        let shown = value.as_str().map_or_else(|| value.to_string(), str::to_owned);
        assert!(result["detail"].as_str().expect("a sentence").contains(&shown), "{result}");
    }
    let (code, result) = run("neither JSON nor TOML");
    assert_eq!((code, result["status"].as_str()), (2, Some("refused")));
}

#[test]
fn the_flux_sets_both_velocities() {
    let (code, result) = run(r#"{"regime":"steady","parameters":{"calving_flux_m2_per_a":3.6e6}}"#);
    assert_eq!(code, 0);
    assert_eq!(result["parameters"]["calving_rate_m_per_a"], 6000.0);
    assert_eq!(result["parameters"]["terminus_velocity_m_per_a"], 6000.0);
}

#[test]
fn a_sweep_is_solved_into_a_data_directory_that_one_process_holds() {
    let folder = folder();
    let data = folder.path().to_str().expect("UTF-8");
    let output = melange(&["sweep", "-", "--data", data], &melt_sweep(9).to_string());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let answer: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!(answer["counts"]["converged"], 9);

    let server = melange_tests::Server::start("serve", folder.path(), &[]);
    let id = answer["id"].as_str().expect("an id");
    assert_eq!(server.json(&format!("/api/v1/sweeps/{id}"))["state"], "complete");
    // A second service is refused; a sweep is solved by the one that is there.
    let second = melange(&["serve", "--listen", "127.0.0.1:0", "--data", data], "");
    assert_eq!(second.status.code(), Some(2));
    let message = String::from_utf8_lossy(&second.stderr).into_owned();
    assert!(message.contains("in use") && message.contains(&server.address), "{message}");
    let output = melange(&["sweep", "-", "--data", data], &melt_sweep(3).to_string());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let answer: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!((&answer["counts"]["converged"], &answer["reused"]), (&json!(3), &json!(3)));
    assert!(server.terminate(), "it ends well when asked to");
}

#[test]
fn listening_beyond_loopback_is_refused() {
    let folder = folder();
    let data = folder.path().to_str().expect("UTF-8");
    let output = melange(&["serve", "--listen", "0.0.0.0:0", "--data", data], "");
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&output.stderr).contains("tokens"));
}
