//! What is read off stored states: transects, the profiles of many runs, and how a number answers to a season.

use crate::{assert_close, melt_sweep, number};
use melange_tests::{Server, folder, run};
use serde_json::{Value, json};

/// Places of transects, as a scenario and as a query have them.
const CHI: [f64; 5] = [0.0, 0.13, 0.5, 0.77, 1.0];
const ASKED: &str = "0,0.13,0.5,0.77,1";

/// Solves one run; its row.
fn solved(server: &Server, scenario: &Value) -> (String, Value) {
    let mut sweep = scenario.clone();
    sweep["name"] = "one".into();
    let id = server.submit(&sweep);
    server.wait(&id);
    let row = server.json(&format!("/api/v1/sweeps/{id}/runs"))["items"][0].clone();
    (id, row)
}

fn id_of(row: &Value) -> &str {
    row["run_id"].as_str().expect("an id")
}

/// A fjord that is nowhere as wide as it is next to it, on both sides of where the terminus starts.
fn fjord() -> Value {
    json!({"x_m": [-3000, 0, 2000, 6000, 60000], "width_m": [3700, 4000, 4500, 4300, 6000], "beyond": "constant"})
}

fn wedge() -> Value {
    json!({"length_m": 10000, "thickness_0_m": 90})
}

/// Of every regime, in fjords with tables, with a terminus that has moved, with a rheology that varies in time.
#[test]
fn transects_of_a_stored_state_are_those_of_the_solve_bit_by_bit() {
    let small = json!({"n_cells": 20});
    let moving = |velocity: f64| json!({"n_cells": 20, "terminus_velocity_m_per_a": velocity});
    let rheology = json!({
        "mu_s": {"sinusoid": {"mean": 0.3, "amplitude": 0.02, "period_a": 0.7}},
        "b": {"pulse": {"base": 1e4, "peak": 1.3e4, "period_a": 0.5, "width_a": 0.4}},
        "d_m": {"ramp": {"from": 25, "to": 24, "start_a": 0, "end_a": 0.3}},
        "A": {"table": {"time_a": [0, 1], "value": [0.5, 0.6]}},
    });
    let fixed = json!({"duration_a": 0.29, "fixed_dt_a": 0.01});
    let observations = json!([{"quantity": "length_m", "value": 11000, "standard_error": 50},
        {"quantity": "force_n_per_m", "value": 9e6, "standard_error": 1e5}]);
    let x_m: Vec<f64> = (0..3000).map(|k| 30.0 * f64::from(k)).collect();
    let width_m: Vec<f64> = x_m.iter().map(|x| 4000.0 + 300.0 * (x / 2000.0).sin()).collect();
    let scenarios = [
        json!({"regime": "steady", "parameters": small, "fjord": fjord()}),
        json!({"regime": "steady", "parameters": {"n_cells": 20, "width_gradient": 0.02},
            "options": {"upstream_closure": "no_stretching"}}),
        json!({"regime": "quasi_static", "length_m": 9000, "fjord": fjord()}),
        json!({"regime": "diagnostic", "start": wedge(), "fjord": fjord()}),
        // It sticks to the walls, where no speed tells the sign of the friction.
        json!({"regime": "diagnostic", "parameters": {"width_m": 2000},
            "start": {"length_m": 12000, "thickness_0_m": 50}}),
        // Water that drags it back toward the glacier.
        json!({"regime": "diagnostic", "start": {"length_m": 15000, "thickness_0_m": 40}, "parameters":
            {"n_cells": 20, "terminus_velocity_m_per_a": 0, "calving_rate_m_per_a": 500, "width_m": 8000, "A": 0.1,
             "water_drag_n_per_m": 1e6}}),
        // Longer tables than a run's row has.
        json!({"regime": "steady", "parameters": small, "fjord": {"x_m": x_m, "width_m": width_m}}),
        json!({"regime": "transient", "parameters": moving(9000.0), "start": wedge(), "fjord": fjord(),
            "time": {"duration_a": 0.3, "output_every_a": 0.1}}),
        json!({"regime": "transient", "parameters": moving(0.0), "start": wedge(), "fjord": fjord(),
            "time": fixed}),
        json!({"regime": "transient", "parameters": small, "start": wedge(), "forcing": rheology,
            "time": {"duration_a": 0.3, "output_every_a": 0.1}}),
        json!({"regime": "transient", "parameters": small, "start": wedge(), "forcing": rheology,
            "time": fixed}),
        json!({"regime": "transient", "parameters": small, "start": wedge(), "forcing": rheology,
            "time": fixed, "options": {"lagged": true}}),
        json!({"regime": "transient", "parameters": small, "fjord": fjord(),
            "calving_law": {"rate_m_per_a": 8000, "per_force_m2_per_a_n": 1e-4, "thickness_per_advance": 0.01},
            "start": wedge(), "time": {"duration_a": 0.2, "tolerance": 1e-3}}),
        json!({"regime": "transient", "parameters": moving(7000.0), "start": wedge(), "fjord": fjord(),
            "forcing": {"melt_rate_m_per_day": {"ramp": {"from": 0.6, "to": 9, "start_a": 0, "end_a": 0.2}}},
            "time": {"duration_a": 2, "fixed_dt_a": 0.01}}),
        json!({"regime": "branch", "parameters": small,
            "branch": {"control": "mu_s", "from": 0.29, "to": 0.31, "stability": false}}),
        json!({"regime": "calibration", "parameters": {"n_cells": 20, "b": 2e4, "mu_s": 0.25},
            "calibration": {"parameters": {"b": [1e3, 1e5], "mu_s": [0.1, 0.6]}, "starts": 1,
                "observations": observations}}),
    ];
    let folder = folder();
    let server = Server::start("serve", folder.path(), &[]);
    for scenario in scenarios {
        let mut with_transects = scenario.clone();
        with_transects["options"]["transects_at_chi"] = json!(CHI);
        let (_, expected) = run(&with_transects.to_string());
        let (sweep, row) = solved(&server, &scenario);
        assert_eq!(row["status"], expected["status"], "{scenario}");
        let run_id = id_of(&row);
        let told = server.json(&format!("/api/v1/runs/{run_id}/transects?chi={ASKED}"));
        assert_eq!(told["items"].as_array().map(Vec::len), Some(CHI.len()));
        assert_eq!(told["items"], expected["transects"], "{scenario}");
        assert_eq!(told["time_a"], row["end_time_a"], "{scenario}");
        let item = &server.json(&format!("/api/v1/sweeps/{sweep}/profiles?runs=0&chi={ASKED}"))["items"]
            [0];
        assert_eq!(item["transects"], expected["transects"], "{scenario}");
        assert_eq!(item["profile"], expected["profile"], "{scenario}");
    }
}

/// A state on the way is the last one of a run that ends there.
#[test]
fn transects_on_the_way_are_those_of_that_time() {
    let scenario = |duration_a: f64, more: Value| {
        let mut time = json!({"duration_a": duration_a, "fixed_dt_a": 0.01});
        time.as_object_mut().expect("members").extend(more.as_object().expect("members").clone());
        json!({"regime": "transient", "parameters": {"n_cells": 20, "terminus_velocity_m_per_a": 9000},
            "start": wedge(), "fjord": fjord(), "time": time,
            "forcing": {"mu_s": {"sinusoid": {"mean": 0.3, "amplitude": 0.02, "period_a": 0.7}}}})
    };
    let folder = folder();
    let server = Server::start("serve", folder.path(), &[]);
    let ask = |row: &Value, query: &str| {
        server.get(&format!("/api/v1/runs/{}/transects?{query}", id_of(row)))
    };
    let (_, long) = solved(&server, &scenario(0.4, json!({"profiles_at_a": [0.07, 0.2]})));
    let (_, short) = solved(&server, &scenario(0.2, json!({})));
    let on_the_way = ask(&long, &format!("chi={ASKED}&time_a=0.2")).json();
    assert_eq!(on_the_way, ask(&short, &format!("chi={ASKED}")).json());
    assert_eq!(on_the_way["time_a"], 0.2);
    assert_eq!(ask(&long, "chi=0&time_a=0.4").json(), ask(&long, "chi=0").json());
    assert_ne!(ask(&long, "chi=0").json()["items"], ask(&short, "chi=0").json()["items"]);

    // Between rows of the series nothing tells where the terminus stood, which matters where the width varies.
    let coarse = json!({"output_every_a": 0.1, "profiles_at_a": [0.07, 0.2]});
    let (_, row) = solved(&server, &scenario(0.4, coarse.clone()));
    assert_eq!(ask(&row, "chi=0.5&time_a=0.2").status, 200);
    let unknown = ask(&row, "chi=0.5&time_a=0.07");
    assert_eq!(unknown.status, 409);
    assert!(unknown.json()["detail"].as_str().expect("why").contains("terminus"));
    let mut straight = scenario(0.4, coarse);
    straight.as_object_mut().expect("members").remove("fjord");
    let (_, row) = solved(&server, &straight);
    assert_eq!(ask(&row, "chi=0.5&time_a=0.07").json()["items"][0]["width_m"], 4000.0);

    for (query, status, field) in [
        ("chi=0.5&time_a=0.1", 422, "time_a"),
        ("chi=0.5&time_a=NaN", 422, "time_a"),
        ("chi=1.5", 422, "chi"),
        ("chi=", 422, "chi"),
        ("chi=0.5,x", 422, "chi"),
        ("time_a=0.2", 400, ""),
        ("chi=0.5&when=0.2", 400, ""),
        ("chi=0.5&time_a=soon", 400, ""),
    ] {
        let answer = ask(&row, query);
        assert_eq!(answer.status, status, "{query}");
        assert_eq!(answer.json()["field"].as_str().unwrap_or_default(), field, "{query}");
    }
    assert_eq!(server.get("/api/v1/runs/0/transects?chi=0.5").status, 404);
    let (_, none) =
        solved(&server, &json!({"regime": "steady", "parameters": {"melt_rate_m_per_day": 9}}));
    let answer = ask(&none, "chi=0.5");
    assert_eq!(answer.status, 409);
    let told =
        format!("the run has no state: it is {}", none["status"].as_str().expect("a status"));
    assert_eq!(answer.json()["detail"], told);
    let (_, steady) = solved(&server, &json!({"regime": "steady", "parameters": {"n_cells": 20}}));
    assert_eq!(ask(&steady, "chi=0.5&time_a=1").json()["field"], "time_a");
}

/// A diagnostic run that starts from another one stands where that one's terminus was left.
#[test]
fn a_run_from_another_one_has_its_transects_where_that_one_ended() {
    let folder = folder();
    let server = Server::start("serve", folder.path(), &[]);
    let parameters =
        json!({"n_cells": 20, "width_gradient": 0.02, "terminus_velocity_m_per_a": 9000});
    let (_, first) = solved(
        &server,
        &json!({"regime": "transient", "parameters": parameters, "start": wedge(),
            "time": {"duration_a": 0.4, "fixed_dt_a": 0.01}}),
    );
    let moved = number(&first["terminus_x_m"]);
    assert!((moved - 1200.0).abs() < 1.0, "{moved}");
    let (sweep, second) = solved(
        &server,
        &json!({"regime": "diagnostic", "parameters": parameters, "start": {"run": id_of(&first)}}),
    );
    let path = format!("/api/v1/runs/{}/transects?chi=0.5", id_of(&second));
    let told = server.json(&path)["items"][0].clone();
    let expected = 4000.0 + 0.02 * (moved + 0.5 * number(&second["length_m"]));
    assert_close("W", &told["width_m"], &json!(expected), 1e-12);
    let item =
        server.json(&format!("/api/v1/sweeps/{sweep}/profiles?runs=0&chi=0.5"))["items"][0].clone();
    assert_eq!(item["transects"][0], told);
}

#[test]
fn profiles_of_many_runs_come_in_the_order_asked_for() {
    let folder = folder();
    let server = Server::start("serve", folder.path(), &[]);
    let id = server.submit(&melt_sweep(6));
    server.wait(&id);
    // Its runs live in the other sweep's files, but for those without a steady state.
    let other = server.submit(&json!({"name": "other", "regime": "steady",
        "axes": [{"parameter": "melt_rate_m_per_day", "values": [9.0, 0.6, 0.5, 0.65]}]}));
    server.wait(&other);
    let rows = |id: &str| {
        let items = server.json(&format!("/api/v1/sweeps/{id}/runs"))["items"].clone();
        items.as_array().expect("rows").clone()
    };
    for (id, asked) in [(&id, vec![5, 0, 3, 0]), (&other, vec![3, 1, 0, 2])] {
        let rows = rows(id);
        let list: Vec<String> = asked.iter().map(usize::to_string).collect();
        let path = format!("/api/v1/sweeps/{id}/profiles?runs={}&chi=0.25,1", list.join(","));
        let told = server.json(&path);
        let items = told["items"].as_array().expect("items");
        assert_eq!(items.len(), asked.len());
        for (item, index) in items.iter().zip(asked) {
            let row = &rows[index];
            assert_eq!(item["run_index"], index);
            for name in ["run_id", "status", "regime", "length_m", "thickness_0_m", "force_n_per_m"]
            {
                assert_eq!(item[name], row[name], "{name}");
            }
            assert_eq!(item["force_quasi_static_n_per_m"], row["force_quasi_static_n_per_m"]);
            let run_id = id_of(row);
            let whole = server.json(&format!("/api/v1/runs/{run_id}"));
            assert_eq!(item["profile"], whole["profile"]);
            assert_eq!(item["parameters"], whole["parameters"]);
            if row["status"] == "converged" {
                let path = format!("/api/v1/runs/{run_id}/transects?chi=0.25,1");
                assert_eq!(item["transects"], server.json(&path)["items"]);
            } else {
                assert_eq!((&item["profile"], &item["transects"]), (&Value::Null, &json!([])));
            }
        }
    }
    let plain = server.json(&format!("/api/v1/sweeps/{id}/profiles?runs=1"));
    assert_eq!(plain["items"][0]["transects"], json!([]));

    let large = server.submit(&json!({"name": "large", "regime": "steady",
        "axes": [{"parameter": "b", "linspace": [1e4, 2e4, 100_000]}]}));
    server.ask(&large, "cancel");
    let many = vec!["0"; 101].join(",");
    for (id, query, status, field) in [
        (id.as_str(), "runs=6", 422, "runs"),
        (&id, "runs=-1", 422, "runs"),
        (&id, "runs=0,,1", 422, "runs"),
        (&id, &format!("runs={many}"), 422, "runs"),
        (&id, "runs=0&chi=2", 422, "chi"),
        (&id, "runs=0&chi=0,0,0,0,0,0,0,0,0", 422, "chi"),
        (&id, "", 400, ""),
        (&id, "runs=0&most=3", 400, ""),
        (&large, "runs=99999", 409, ""),
        ("nowhere", "runs=0", 404, ""),
    ] {
        let answer = server.get(&format!("/api/v1/sweeps/{id}/profiles?{query}"));
        assert_eq!(answer.status, status, "{query}");
        assert_eq!(answer.json()["field"].as_str().unwrap_or_default(), field, "{query}");
    }
}

/// Fig. 7 as published, and what `docs/reproduction.md` says of it; rows of controlled steps are unevenly spaced.
#[test]
fn the_papers_seasons_have_their_lags() {
    let folder = folder();
    let server = Server::start("serve", folder.path(), &[]);
    let scenario = |melt: f64, time: Value, more: Value| {
        let sinusoid = json!({"mean": melt, "amplitude": 0.2, "period_a": 1});
        let mut scenario = json!({"regime": "transient", "parameters": {"melt_rate_m_per_day": melt},
            "forcing": {"melt_rate_m_per_day": {"sinusoid": sinusoid}}, "time": time});
        scenario
            .as_object_mut()
            .expect("members")
            .extend(more.as_object().expect("members").clone());
        scenario
    };
    let published = json!({"duration_a": 3, "fixed_dt_a": 0.01});
    let lagged = json!({"options": {"lagged": true}});
    let ask = |row: &Value, query: &str| {
        server.get(&format!("/api/v1/runs/{}/season?{query}", id_of(row)))
    };
    let (mut last, mut last_row) = (Value::Null, Value::Null);
    for (melt, months, variation) in
        [(0.6, 2.6380, None), (0.7, 2.4001, Some(-0.34852)), (0.8, 2.1603, None)]
    {
        let (_, row) = solved(&server, &scenario(melt, published.clone(), lagged.clone()));
        let told = ask(&row, "").json();
        assert_close("lag", &told["lag_after_high_a"], &json!(months / 12.0), 3e-5);
        if let Some(correlation) = variation {
            // Here each row counts by its time, there all rows do the same.
            let off = number(&told["correlation"]) - correlation;
            assert!(off.abs() < 0.02, "{told}");
        }
        let mean = (number(&told["lag_after_high_a"]) + number(&told["lag_after_low_a"])) / 2.0;
        assert_close("lag", &told["lag_a"], &json!(mean), 1e-12);
        assert_eq!(
            (&told["forcing"], &told["response"]),
            (&json!("melt_rate_m_per_day"), &json!("force_n_per_m"))
        );
        assert_eq!((number(&told["from_a"]), number(&told["to_a"])), (2.0, 3.0));
        assert_eq!((number(&told["high_a"]), number(&told["low_a"])), (2.25, 1.75));
        assert_eq!(told["also_swings"], json!([]));
        assert_close("mean", &told["forcing_range"]["mean"], &json!(melt), 1e-3);
        let range = &told["response_range"];
        let half = (number(&range["max"]) - number(&range["min"])) / 2.0;
        assert_close("amplitude", &told["amplitude"], &json!(half), 1e-12);
        assert_close(
            "share",
            &told["relative_amplitude"],
            &json!(half / number(&range["mean"])),
            1e-12,
        );
        assert!(
            told["lag_meaning"]
                .as_str()
                .expect("a sentence")
                .contains("force_n_per_m at its lowest")
        );
        (last, last_row) = (told, row);
    }
    let coupled = json!({"calving_law": "steady_feedback", "options": {"lagged": true}});
    let (_, row) = solved(&server, &scenario(0.7, published, coupled));
    let told = ask(&row, "response=force_n_per_m&forcing=melt_rate_m_per_day").json();
    assert_close("coupled", &told["lag_a"], &json!(0.096277), 3e-5);
    let calving = ask(&row, "response=calving_rate_m_per_a").json();
    assert!(
        calving["lag_meaning"]
            .as_str()
            .expect("a sentence")
            .contains("calving_rate_m_per_a at its highest")
    );
    assert!(number(&calving["correlation"]) > 0.5);
    assert_close("the same lag", &calving["lag_a"], &told["lag_a"], 0.15);

    let (_, uneven) = solved(&server, &scenario(0.8, json!({"duration_a": 3}), json!({})));
    let told = ask(&uneven, "").json();
    assert_close("uneven", &told["lag_after_high_a"], &last["lag_after_high_a"], 0.05);
    assert_close("mean", &told["response_range"]["mean"], &last["response_range"]["mean"], 0.02);

    let pulse =
        |base, peak| json!({"pulse": {"base": base, "peak": peak, "period_a": 1, "width_a": 0.4}});
    let forcing =
        json!({"melt_rate_m_per_day": pulse(0.6, 0.9), "calving_rate_m_per_a": pulse(6e3, 6.2e3)});
    let (_, pulsed) = solved(
        &server,
        &json!({"regime": "transient", "forcing": forcing, "time": {"duration_a": 2, "fixed_dt_a": 0.02},
            "parameters": {"melt_rate_m_per_day": 0.6, "n_cells": 20}}),
    );
    let told = ask(&pulsed, "forcing=melt_rate_m_per_day&response=melt_rate_m_per_day").json();
    assert!(number(&told["lag_a"]).abs() < 1e-9, "{told}");
    assert_eq!(told["lag_a"], told["lag_after_high_a"]);
    assert_eq!((&told["lag_after_low_a"], &told["low_a"]), (&Value::Null, &Value::Null));
    assert_eq!(told["also_swings"], json!(["calving_rate_m_per_a"]));

    let (_, short) = solved(&server, &scenario(0.8, json!({"duration_a": 0.9}), json!({})));
    let (_, coarse) =
        solved(&server, &scenario(0.8, json!({"duration_a": 2, "output_every_a": 0.2}), json!({})));
    let (_, still) = solved(
        &server,
        &json!({"regime": "transient", "time": {"duration_a": 2, "tolerance": 1e-2}, "parameters": {"n_cells": 20}}),
    );
    let (_, steady) = solved(&server, &json!({"regime": "steady"}));
    for (row, query, status, field) in [
        (&last_row, "forcing=mu_s", 422, "forcing"),
        (&last_row, "response=time_a", 422, "response"),
        (&last_row, "response=status", 422, "response"),
        (&last_row, "lag=1", 400, ""),
        (&short, "", 409, ""),
        (&coarse, "", 409, ""),
        (&still, "", 409, ""),
        (&steady, "", 409, ""),
    ] {
        let answer = ask(row, query);
        assert_eq!(answer.status, status, "{query}: {}", answer.json());
        assert_eq!(answer.json()["field"].as_str().unwrap_or_default(), field, "{query}");
    }
    assert_eq!(server.get("/api/v1/runs/0/season").status, 404);
}

#[test]
fn the_dictionary_has_what_forces_and_profiles_are_drawn_with() {
    let folder = folder();
    let server = Server::start("serve", folder.path(), &[]);
    let names = server.json("/api/v1/dictionary");
    let constants = names["constants"].as_array().expect("constants");
    let value = |name: &str| {
        let found = constants.iter().find(|c| c["name"] == name);
        number(&found.unwrap_or_else(|| panic!("there is no {name}"))["value"])
    };
    let (_, rest) = run(r#"{"regime": "quasi_static", "thickness_0_m": 100}"#);
    let expected = value("static_force_pa") * 100.0 * 100.0;
    assert_close("F", &rest["force_n_per_m"], &json!(expected), 1e-9);
    let density = value("ice_density");
    let unit = 0.5 * density * value("gravity") * (1.0 - density / value("water_density"));
    assert_close("c", &json!(value("static_force_pa")), &json!(unit), 1e-12);
    assert_eq!(value("days_per_year"), 365.25);
    let (_, result) =
        run(r#"{"regime": "transient", "time": {"duration_a": 0.01, "tolerance": 0.01},
        "start": {"length_m": 10000, "thickness_0_m": 75}, "parameters": {"n_cells": 10}}"#);
    for table in ["series", "profile"] {
        let entries = names[table].as_array().expect("entries");
        let mut told: Vec<&str> = entries.iter().filter_map(|e| e["name"].as_str()).collect();
        told.sort_unstable();
        let members = result[table].as_object().expect("arrays");
        let mut there: Vec<&str> = members.keys().map(String::as_str).collect();
        there.sort_unstable();
        assert_eq!(told, there, "{table}");
        assert!(entries.iter().all(|e| e["unit"].is_string() && e["meaning"].is_string()));
    }
}
