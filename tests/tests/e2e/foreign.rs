//! Somebody's earlier results beside runs of this model, and never among them.

use crate::melt_sweep;
use melange_tests::{Server, folder, melange};
use serde_json::{Value, json};

const MAP: &str = r#"
source = "a student, 2023, an older code"
[columns]
melt_rate_m_per_day = { column = "melt" }
width_m = { value = 4000 }
force_n_per_m = { column = "F (MN/m)", scale = 1e6 }
length_m = { column = "L (km)", scale = 1e3 }
"#;

/// The force and the length of the melt sweep's runs, as another code might have written them: forces larger by
/// a thousandth, and one row where there is no run.
fn table(server: &Server, id: &str) -> String {
    let page = server.json(&format!("/api/v1/sweeps/{id}/runs?limit=100"));
    let mut csv = "melt,F (MN/m),L (km),note\n".to_owned();
    for run in page["items"].as_array().expect("runs") {
        let number = |name: &str| run[name].as_f64().expect("a number");
        let force = number("force_n_per_m") * 1.001 / 1e6;
        csv += &format!(
            "{},{force:?},{:?},x\n",
            number("melt_rate_m_per_day"),
            number("length_m") / 1e3
        );
    }
    csv + "0.123,1,,\n"
}

#[test]
fn a_table_is_compared_with_the_runs_at_its_parameters() {
    let data = folder();
    let path = data.path().to_str().expect("UTF-8");
    let server = Server::start("serve", data.path(), &[]);
    let id = server.submit(&melt_sweep(6));
    server.wait(&id);
    // The same parameters and another model: it must not be compared with.
    let mut other = melt_sweep(6);
    other["melt_shape"] = "linear".into();
    let other = server.submit(&other);
    server.wait(&other);
    let (csv, map) = (data.path().join("t.csv"), data.path().join("m.toml"));
    std::fs::write(&csv, table(&server, &id)).expect("a table");
    std::fs::write(&map, MAP).expect("a map");
    let file = |path: &std::path::Path| path.to_str().expect("UTF-8").to_owned();
    let bring = |map: &str| {
        melange(&["import-table", &file(&csv), "--map", map, "--name", "old", "--data", path], "")
    };
    let told = bring(&file(&map));
    let said = String::from_utf8_lossy(&told.stdout).into_owned();
    assert!(told.status.success(), "{}", String::from_utf8_lossy(&told.stderr));
    let foreign = said.split_whitespace().next().expect("an id").to_owned();
    assert!(foreign.starts_with("foreign-") && said.contains("at their defaults: "), "{said}");

    let listed = server.json("/api/v1/foreign");
    assert_eq!(listed["items"][0]["source"], "a student, 2023, an older code");
    assert_eq!(listed["items"][0]["assumed"]["b"], 10_000.0);
    let rows = server.json(&format!("/api/v1/foreign/{foreign}/rows?limit=3&cursor=5"));
    assert_eq!(
        (rows["total"].clone(), rows["items"].as_array().map(Vec::len)),
        (7.into(), Some(2))
    );
    assert_eq!(rows["items"][1]["results"], json!({"force_n_per_m": 1e6}));
    let compared = server.json(&format!("/api/v1/foreign/{foreign}/compare?limit=2"));
    assert_eq!((compared["rows"].clone(), compared["matched"].clone()), (7.into(), 6.into()));
    assert_eq!(compared["next"], "2");
    let force = &compared["summary"]["force_n_per_m"];
    assert_eq!(force["n"], 6);
    for member in ["median", "largest"] {
        assert!((force[member].as_f64().expect("a number") - 1e-3).abs() < 1e-9, "{force}");
    }
    assert!(compared["summary"]["length_m"]["largest"].as_f64().expect("a number") < 1e-12);
    let first = &compared["items"][0];
    let run = server.json(&format!("/api/v1/runs/{}", first["run_id"].as_str().expect("an id")));
    assert_eq!(first["results"]["force_n_per_m"]["ours"], run["force_n_per_m"]);
    let plain =
        server.json(&format!("/api/v1/sweeps/{id}/runs?limit=1"))["items"][0]["run_id"].clone();
    assert_eq!(first["run_id"], plain, "it is compared with another melt shape");

    // It is no run and no sweep.
    assert_eq!(server.json("/api/v1/sweeps")["total"], 2);
    let told = melange(&["compare", &foreign, "--data", path], "");
    let said = String::from_utf8_lossy(&told.stdout).into_owned();
    assert!(
        said.starts_with("6 of 7 rows")
            && said.contains("force_n_per_m: median difference 1.00e-3"),
        "{said}"
    );
    assert_eq!(melange(&["compare", "foreign-0", "--data", path], "").status.code(), Some(2));

    std::fs::write(&map, MAP.replace("source = \"a student, 2023, an older code\"", ""))
        .expect("a map");
    let told = bring(&file(&map));
    assert_eq!(told.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&told.stderr).contains("source"), "{told:?}");
    assert_eq!(server.delete(&format!("/api/v1/foreign/{foreign}")).status, 204);
    assert_eq!(server.get(&format!("/api/v1/foreign/{foreign}/compare")).status, 404);
    assert_eq!(server.json("/api/v1/foreign")["total"], Value::from(0));
}
