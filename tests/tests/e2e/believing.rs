//! What a run tells of where it comes from, and that it can be solved again from what is stored of it.

use crate::tables::read;
use crate::{melt_sweep, number};
use arrow_array::cast::AsArray;
use arrow_array::types::{Float64Type, UInt64Type};
use arrow_array::{Array, ArrayRef, Float64Array, RecordBatch};
use bytes::Bytes;
use melange_tests::{Server, folder, melange, root, run};
use parquet::arrow::ArrowWriter;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use serde_json::{Value, json};
use sqlx::{Connection, SqliteConnection};
use std::collections::HashSet;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A small sweep of every regime, by name, with the seed of what it draws.
fn regimes() -> Vec<(&'static str, Value, Option<u64>)> {
    let melts = json!([{"parameter": "melt_rate_m_per_day", "values": [0.55, 0.6, 0.65]}]);
    let small = json!({"n_cells": 10});
    let wedge = json!({"length_m": 10000, "thickness_0_m": 75});
    vec![
        (
            "steady",
            json!({
                "parameters": small, "axes": melts,
                "options": {"sensitivities": true, "discrete_roots": true, "grid_error": true},
                "fjord": {"x_m": [0, 5000, 60000], "width_m": [4000, 4300, 6000]},
            }),
            None,
        ),
        (
            "steady",
            json!({
                "parameters": small,
                "sample": {"method": "sobol", "n": 8, "seed": 11, "ranges": {"mu_s": [0.2, 0.4]}},
            }),
            Some(11),
        ),
        ("quasi_static", json!({"parameters": small, "length_m": 9000}), None),
        ("diagnostic", json!({"parameters": {"n_cells": 10, "mu_s": 0.31}, "start": wedge}), None),
        (
            "transient",
            json!({
                "parameters": small, "axes": melts, "calving_law": "steady_feedback",
                "forcing": {"mu_s": {"sinusoid": {"mean": 0.3, "amplitude": 0.01, "period_a": 1}}},
                "time": {"duration_a": 0.05, "output_every_a": 0.01, "profiles_at_a": [0.02]},
            }),
            None,
        ),
        (
            "branch",
            json!({
                "parameters": small,
                "branch": {"control": "melt_rate_m_per_day", "from": 0.55, "to": 0.65},
            }),
            None,
        ),
        (
            "fold_curve",
            json!({
                "parameters": {"melt_rate_m_per_day": 0.35, "width_m": 5600, "n_cells": 10},
                "melt_shape": "linear",
                "fold_curve": {"control": "melt_rate_m_per_day", "from": 0.1, "to": 0.7,
                    "second": "width_m", "second_from": 5500, "second_to": 5700},
            }),
            None,
        ),
        (
            "calibration",
            json!({
                "parameters": small,
                "calibration": {"parameters": {"mu_s": [0.1, 0.6]}, "starts": 2, "seed": 7,
                    "mcmc": {"walkers": 8, "steps": 20, "burn_in": 5, "thin": 5, "seed": 9},
                    "observations": [{"quantity": "length_m", "value": 11000, "standard_error": 100}]},
            }),
            Some(9),
        ),
    ]
}

/// `melange rerun --check`: exit code and what it tells.
fn check(data: &Path, id: &str, more: &[&str]) -> (Option<i32>, Value) {
    let data = data.to_str().expect("UTF-8");
    let command = ["rerun", id, "--check", "--data", data, "--format", "json", "--workers", "2"];
    let output = melange(&[&command, more].concat(), "");
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    let told = serde_json::from_str(&text).unwrap_or_else(|e| panic!("{e}: {text}{told}"));
    (output.status.code(), told)
}

fn assert_bitwise(data: &Path, id: &str, runs: usize) {
    let (code, told) = check(data, id, &[]);
    assert_eq!(
        (code, &told["bitwise"], &told["count"]),
        (Some(0), &json!(runs), &json!(runs)),
        "{told:#}"
    );
}

fn ids_of(server: &Server, sweep: &str) -> Vec<String> {
    let page = server.json(&format!("/api/v1/sweeps/{sweep}/runs?limit=1000"));
    let runs = page["items"].as_array().expect("items");
    runs.iter().map(|run| run["run_id"].as_str().expect("an id").to_owned()).collect()
}

#[test]
fn a_run_of_every_regime_tells_where_it_comes_from_and_comes_out_again_bit_by_bit() {
    let folder = folder();
    let server = Server::start("serve", folder.path(), &["--workers", "2"]);
    let health = server.json("/health");
    let mut sweeps = Vec::new();
    for (regime, mut spec, seed) in regimes() {
        spec["regime"] = json!(regime);
        let id = server.submit(&spec);
        sweeps.push((id, spec, seed));
    }
    for (id, spec, seed) in &sweeps {
        let sweep = server.wait(id);
        assert_eq!(sweep["counts"]["failed"], 0, "{sweep}");
        let runs = ids_of(&server, id);
        assert!(!runs.is_empty());
        for run_id in &runs {
            let result = server.json(&format!("/api/v1/runs/{run_id}"));
            let made = &result["provenance"];
            let text = |name: &str| made[name].as_str().unwrap_or_else(|| panic!("{name}: {made}"));
            assert_eq!(text("model_version"), "melange-model 2");
            let version = text("program_version").split_once('+').expect("a version and a build");
            assert_eq!((version.0, version.1.len()), (env!("CARGO_PKG_VERSION"), 12), "{health}");
            assert!(text("host_class").contains(std::env::consts::ARCH), "{made}");
            assert!(text("solved_at").ends_with('Z'), "{made}");
            assert!((1e-7..60.0).contains(&number(&made["solve_seconds"])), "{made}");
            assert_eq!(made["seed"].as_u64(), *seed, "{made}");
            match text("start") {
                "own" => assert!(made["started_from"].is_null(), "{made}"),
                "neighbour" => {
                    let from = made["started_from"].as_str().expect("a run");
                    assert!(runs.iter().any(|id| id == from) && from != run_id, "{made}");
                }
                start => panic!("nothing needs {start} here: {made}"),
            }
            assert!(result["residual_norm"].is_number() || spec["regime"] == "calibration");
            // What is shown as the scenario is the run itself.
            let scenario = &made["scenario"];
            assert_eq!(scenario["regime"], spec["regime"]);
            let (code, again) = run(&scenario.to_string());
            assert_eq!((code, &again["status"]), (0, &result["status"]), "{scenario}");
            assert_eq!(again["parameters"], result["parameters"]);
            assert_eq!(again["provenance"]["host_class"], made["host_class"]);
            assert_eq!(again["provenance"]["program_version"], made["program_version"]);
        }
        // Also while the service runs.
        assert_bitwise(folder.path(), id, runs.len());
    }
    assert!(server.terminate());
}

#[test]
fn a_sweep_of_two_workers_comes_out_again_bit_by_bit_from_its_stored_starts() {
    let folder = folder();
    let server = Server::start("serve", folder.path(), &["--workers", "2"]);
    // Some have no steady state; a second sweep takes half of them over.
    let sweep = |points: usize| {
        json!({
            "regime": "steady", "parameters": {"n_cells": 16},
            "axes": [
                {"parameter": "melt_rate_m_per_day", "linspace": [0.4, 2.4, points]},
                {"parameter": "width_m", "values": [3000, 4000]},
            ],
        })
    };
    let first = server.submit(&sweep(21));
    server.wait(&first);
    let second = server.submit(&sweep(41));
    let counts = server.wait(&second);
    assert_eq!(counts["reused"], 42);
    assert!(number(&counts["counts"]["converged"]) > 30.0, "{counts}");
    assert!(number(&counts["counts"]["no_steady_state"]) > 5.0, "{counts}");

    let table = read(server.get(&format!("/api/v1/sweeps/{first}/runs.parquet")).body);
    let texts = |name: &str| -> Vec<Option<String>> {
        let of = |batch: &RecordBatch| -> Vec<Option<String>> {
            let column = batch.column_by_name(name).expect("the column").as_string::<i32>().clone();
            column.iter().map(|text| text.map(str::to_owned)).collect()
        };
        table.iter().flat_map(of).collect()
    };
    let ids: HashSet<String> = texts("run_id").into_iter().flatten().collect();
    let from: Vec<String> = texts("started_from").into_iter().flatten().collect();
    assert!(from.len() > 5 && from.iter().all(|id| ids.contains(id)), "{from:?}");
    let options: HashSet<String> = texts("options").into_iter().flatten().collect();
    assert_eq!(options.into_iter().collect::<Vec<_>>(), [r#"{"regime":"steady"}"#]);
    for batch in &table {
        let seconds =
            batch.column_by_name("solve_seconds").expect("it").as_primitive::<Float64Type>();
        assert!(seconds.iter().all(|s| s.is_some_and(|s| s > 0.0)));
        let seeds = batch.column_by_name("seed").expect("it").as_primitive::<UInt64Type>();
        assert_eq!(seeds.null_count(), seeds.len());
    }
    let slow =
        format!("/api/v1/sweeps/{first}/runs?sort=-solve_seconds&filter=solve_seconds%20%3E%200");
    assert_eq!(server.json(&slow)["total"], 42);

    assert_bitwise(folder.path(), &first, 42);
    assert_bitwise(folder.path(), &second, 82);
    // One run alone, at the end of its chain.
    let far = from.last().expect("some began from others");
    assert_bitwise(folder.path(), far, 1);
    let (code, told) = check(folder.path(), &second, &["--sample", "7", "--seed", "3"]);
    assert_eq!((code, &told["bitwise"]), (Some(0), &json!(7)), "{told:#}");
    assert_eq!(told, check(folder.path(), &second, &["--sample", "7", "--seed", "3"]).1);
    assert_ne!(told, check(folder.path(), &second, &["--sample", "7", "--seed", "4"]).1);
    // The first is deleted, and what the second took over stays.
    assert_eq!(server.delete(&format!("/api/v1/sweeps/{first}")).status, 204);
    assert_bitwise(folder.path(), &second, 82);
    assert!(server.terminate());
}

#[test]
fn a_transient_that_goes_on_from_a_stored_run_comes_out_again() {
    let folder = folder();
    let server = Server::start("serve", folder.path(), &[]);
    let time = json!({"duration_a": 0.05, "fixed_dt_a": 0.01});
    let first = server.submit(&json!({
        "regime": "transient", "parameters": {"n_cells": 12, "calving_rate_m_per_a": 5900}, "time": time,
    }));
    server.wait(&first);
    let start = ids_of(&server, &first).remove(0);
    let second = server.submit(&json!({
        "regime": "transient", "parameters": {"n_cells": 12}, "start": {"run": start}, "time": time,
        "axes": [{"parameter": "melt_rate_m_per_day", "values": [0.5, 0.7]}],
    }));
    assert_eq!(server.wait(&second)["counts"]["completed"], 2);
    assert_bitwise(folder.path(), &second, 2);
    assert!(server.terminate());
}

#[test]
fn runs_of_older_versions_come_out_again_within_the_tolerance() {
    for fixture in ["data-schema-3", "data-schema-4"] {
        let folder = folder();
        let data = folder.path().join("data");
        copy(&root().join("tests/fixtures").join(fixture), &data);
        // It is not written to before somebody opens it.
        let path = data.to_str().expect("UTF-8");
        let output = melange(&["rerun", "any", "--check", "--data", path], "");
        assert_eq!(output.status.code(), Some(2));
        assert!(String::from_utf8_lossy(&output.stderr).contains("older melange"));
        let server = Server::start("serve", &data, &[]);
        let sweeps = server.json("/api/v1/sweeps");
        for sweep in sweeps["items"].as_array().expect("sweeps") {
            let id = sweep["id"].as_str().expect("an id");
            let (code, told) = check(&data, id, &[]);
            assert_eq!((code, &told["differs"]), (Some(0), &json!(0)), "{told:#}");
            let runs = told["runs"].as_array().expect("runs");
            assert!(!runs.is_empty() && runs.iter().all(|run| run["is_same_build"] == false));
            let run_id = runs[0]["run_id"].as_str().expect("an id");
            let made = &server.json(&format!("/api/v1/runs/{run_id}"))["provenance"];
            assert!(made["program_version"].is_null() && made["solve_seconds"].is_null(), "{made}");
        }
        assert!(server.terminate());
    }
}

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).expect("a folder");
    for entry in fs::read_dir(from).expect("a folder") {
        let entry = entry.expect("an entry");
        if entry.path().is_dir() {
            copy(&entry.path(), &to.join(entry.file_name()));
        } else {
            fs::copy(entry.path(), to.join(entry.file_name())).expect("a copy");
        }
    }
}

/// Rewrites a file of a sweep's table with a column changed, and tells the catalogue of it, as if it had been
/// written so.
fn alter(data: &Path, table: &str, column: &str, change: impl Fn(&ArrayRef) -> ArrayRef) {
    let mut files: Vec<PathBuf> = Vec::new();
    for sweep in fs::read_dir(data.join("archive")).expect("a folder") {
        let sweep = sweep.expect("a sweep").path();
        let entries =
            fs::read_dir(sweep).expect("its folder").map(|file| file.expect("a file").path());
        files.extend(
            entries.filter(|path| path.to_string_lossy().ends_with(&format!("-{table}.parquet"))),
        );
    }
    let [file] = files.as_slice() else { panic!("one file of {table}, not {files:?}") };
    let bytes = Bytes::from(fs::read(file).expect("readable"));
    let reader = ParquetRecordBatchReaderBuilder::try_new(bytes).and_then(|b| b.build());
    let batches: Vec<RecordBatch> =
        reader.expect("Parquet").map(|batch| batch.expect("rows")).collect();
    let [batch] = batches.as_slice() else { panic!("few rows") };
    let schema = batch.schema();
    let mut columns = batch.columns().to_vec();
    let place = schema.index_of(column).expect("the column");
    columns[place] = change(&columns[place]);
    let changed = RecordBatch::try_new(schema.clone(), columns).expect("the same columns");
    let mut writer = ArrowWriter::try_new(File::create(file).expect("writable"), schema, None)
        .expect("a writer");
    writer.write(&changed).expect("written");
    writer.close().expect("closed");
    let bytes = fs::read(file).expect("readable");
    let path = file
        .strip_prefix(data.join("archive"))
        .expect("in the archive")
        .to_string_lossy()
        .into_owned();
    let database = format!("sqlite://{}", data.join("melange.sqlite").display());
    let runtime =
        tokio::runtime::Builder::new_current_thread().enable_all().build().expect("a runtime");
    runtime.block_on(async {
        let mut connection = SqliteConnection::connect(&database).await.expect("the catalogue");
        let sql = "UPDATE files SET blake3 = $1, byte_count = $2 WHERE path = $3";
        let done = sqlx::query(sql)
            .bind(blake3::hash(&bytes).to_hex().to_string())
            .bind(bytes.len() as i64)
            .bind(path)
            .execute(&mut connection)
            .await;
        assert_eq!(done.expect("updated").rows_affected(), 1);
        connection.close().await.expect("closed");
    });
}

/// The same numbers but for one, of which the last bit is another.
fn flipped(column: &ArrayRef, at: usize) -> ArrayRef {
    let mut values = column.as_primitive::<Float64Type>().values().to_vec();
    values[at] = f64::from_bits(values[at].to_bits() ^ 1);
    Arc::new(Float64Array::from(values))
}

#[test]
fn an_altered_number_is_found() {
    let folder = folder();
    let data = folder.path().join("data");
    let path = data.to_str().expect("UTF-8");
    let mut spec = melt_sweep(5);
    spec["parameters"] = json!({"n_cells": 12});
    let output = melange(&["sweep", "-", "--data", path, "--workers", "1"], &spec.to_string());
    let told: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let id = told["id"].as_str().expect("an id");
    // The janitor puts the files together.
    let server = Server::start("serve", &data, &[]);
    while fs::read_dir(data.join("archive").join(id)).expect("a folder").count() > 2 {
        std::thread::sleep(std::time::Duration::from_millis(50));
    }
    assert!(server.terminate());
    assert_bitwise(&data, id, 5);

    // The last bit of a thickness; no hash tells of it.
    let altered = folder.path().join("altered");
    copy(&data, &altered);
    alter(&altered, "profiles", "thickness_m", |column| {
        let lists = column.as_list::<i32>();
        let values = flipped(lists.values(), 2 * 12 + 3);
        let field = match lists.data_type() {
            arrow_schema::DataType::List(field) => field.clone(),
            other => panic!("{other}"),
        };
        Arc::new(arrow_array::ListArray::new(field, lists.offsets().clone(), values, None))
    });
    let path = altered.to_str().expect("UTF-8");
    assert!(melange(&["verify", "--data", path], "").status.success());
    let (code, told) = check(&altered, id, &[]);
    assert_eq!(
        (code, &told["bitwise"], &told["differs"]),
        (Some(1), &json!(4), &json!(1)),
        "{told:#}"
    );
    let found = &told["runs"][2];
    assert_eq!(
        (&found["verdict"], &found["largest"]["name"]),
        (&json!("differs"), &json!("profiles.thickness_m"))
    );
    assert!(number(&found["largest"]["relative"]) < 1e-14, "{found}");
    let run_id = found["run_id"].as_str().expect("an id");
    let output = melange(&["rerun", run_id, "--check", "--data", path], "");
    assert_eq!(output.status.code(), Some(1));
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(
        text.contains(run_id)
            && text.contains("differs, though build, host and start are the same"),
        "{text}"
    );

    // A parameter: the run is no longer the one that its id says.
    let altered = folder.path().join("parameter");
    copy(&data, &altered);
    alter(&altered, "runs", "width_m", |column| flipped(column, 1));
    let (code, told) = check(&altered, id, &[]);
    assert_eq!((code, &told["not_compared"]), (Some(1), &json!(1)), "{told:#}");
    assert!(told["runs"][1]["detail"].to_string().contains("another identity"), "{told:#}");

    // A number of the result, in the file but not in the catalogue.
    let altered = folder.path().join("force");
    copy(&data, &altered);
    alter(&altered, "runs", "force_n_per_m", |column| {
        let values = column.as_primitive::<Float64Type>().values().iter();
        Arc::new(Float64Array::from(values.map(|force| 1.001 * force).collect::<Vec<_>>()))
    });
    let (code, told) = check(&altered, id, &[]);
    assert_eq!((code, &told["differs"]), (Some(1), &json!(5)), "{told:#}");
    assert!(told["runs"][0]["detail"].to_string().contains("in the catalogue"), "{told:#}");
}

#[test]
fn what_cannot_be_asked_of_rerun_is_refused() {
    let folder = folder();
    let path = folder.path().to_str().expect("UTF-8");
    for (arguments, word) in [
        (vec!["rerun", "x", "--data", path], "--check"),
        (vec!["rerun", "x", "--check", "--data", path], "no data directory"),
        (vec!["rerun", "x", "--check", "--data", path, "--tolerance", "2"], "below 1"),
        (vec!["rerun", "x", "--check", "--data", path, "--seed", "2"], "--sample"),
    ] {
        let output = melange(&arguments, "");
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        let told = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(told.contains(word), "{told}");
    }
    let server = Server::start("serve", folder.path(), &[]);
    let output = melange(&["rerun", "x", "--check", "--data", path], "");
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&output.stderr).contains("neither a run nor a sweep"));
    assert!(server.terminate());
}
