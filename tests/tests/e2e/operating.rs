//! What an operator does: backups and their restoration, metrics, logs, the end of the service, its container.

use crate::tables::read;
use melange_tests::{Disk, Server, assert_counts_add_up, folder, melange, root};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::thread::sleep;
use std::time::{Duration, Instant};

/// Transients of many small steps: half a minute of work in all.
fn long_sweep(runs: usize) -> Value {
    json!({
        "name": "long", "regime": "transient", "parameters": {"n_cells": 20},
        "start": {"length_m": 10000, "thickness_0_m": 75},
        "time": {"duration_a": 2, "fixed_dt_a": 0.002, "output_every_a": 1},
        "axes": [{"parameter": "melt_rate_m_per_day", "linspace": [0.5, 0.7, runs]}],
    })
}

fn steady_sweep(runs: usize, n_cells: usize) -> Value {
    json!({
        "name": "steady", "regime": "steady", "parameters": {"n_cells": n_cells},
        "axes": [{"parameter": "melt_rate_m_per_day", "linspace": [0.5, 1.0, runs]}],
    })
}

fn wait_until(what: &str, is_so: impl Fn() -> bool) {
    let begin = Instant::now();
    while !is_so() {
        assert!(begin.elapsed() < Duration::from_secs(120), "still not so: {what}");
        sleep(Duration::from_millis(10));
    }
}

fn count(server: &Server, id: &str, name: &str) -> i64 {
    let sweep = server.json(&format!("/api/v1/sweeps/{id}"));
    assert_counts_add_up(&sweep);
    sweep["counts"][name].as_i64().expect("a count")
}

fn text(path: &Path) -> &str {
    path.to_str().expect("UTF-8")
}

/// A command that ends well; what it prints.
fn done(arguments: &[&str]) -> String {
    let output = melange(arguments, "");
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{arguments:?}: {told}");
    String::from_utf8(output.stdout).expect("UTF-8")
}

/// A command that refuses; its sentence.
fn refused(arguments: &[&str]) -> String {
    let output = melange(arguments, "");
    assert_eq!(output.status.code(), Some(2), "{arguments:?}");
    String::from_utf8(output.stderr).expect("UTF-8")
}

fn rows(server: &Server, id: &str, name: &str) -> usize {
    let answer = server.get(&format!("/api/v1/sweeps/{id}/{name}.parquet"));
    assert_eq!(answer.status, 200, "{}", String::from_utf8_lossy(&answer.body));
    read(answer.body).iter().map(|batch| batch.num_rows()).sum()
}

/// All files below a folder, by path, with their bytes.
fn contents(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut found = BTreeMap::new();
    for entry in fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            found.extend(contents(&path));
        } else {
            let bytes = fs::read(&path).expect("readable");
            found.insert(path, bytes);
        }
    }
    found
}

#[test]
fn a_backup_of_a_running_sweep_is_restored_and_completes() {
    const RUNS: usize = 100;
    let place = folder();
    let (data, backup) = (place.path().join("data"), place.path().join("backup"));
    let server = Server::start("serve", &data, &["--workers", "2"]);
    let known = server.submit(&steady_sweep(30, 20));
    server.wait(&known);
    let id = server.submit(&long_sweep(RUNS));
    wait_until("some runs are stored", || count(&server, &id, "completed") > 0);
    done(&["backup", "--data", text(&data), "--to", text(&backup)]);
    assert!(count(&server, &id, "completed") < RUNS as i64, "the sweep was to be under way");
    let original = server.json(&format!("/api/v1/sweeps/{known}/runs"));
    drop(server);

    // As on a medium that is read-only.
    let database = backup.join("melange.sqlite");
    let mut mode = fs::metadata(&database).expect("it is there").permissions();
    mode.set_readonly(true);
    fs::set_permissions(&database, mode).expect("it is ours");
    let before = contents(&backup);
    let new = place.path().join("restored");
    let told = done(&["restore", "--from", text(&backup), "--data", text(&new)]);
    assert!(told.contains("restored to"), "{told}");
    // A second one would overwrite.
    let sentence = refused(&["restore", "--from", text(&backup), "--data", text(&new)]);
    assert!(sentence.contains("not empty"), "{sentence}");
    // A folder that is there already and cannot be replaced, as the root of a disk or a container's volume.
    let disk = Disk::mount(60);
    let empty = disk.path().to_owned();
    done(&["restore", "--from", text(&backup), "--data", text(&empty)]);
    assert_eq!(contents(&backup), before, "a backup is only read");
    let left: Vec<String> = fs::read_dir(place.path())
        .expect("a folder")
        .chain(fs::read_dir(&empty).expect("a folder"))
        .map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned())
        .filter(|name| name.starts_with('.'))
        .collect();
    assert!(left.is_empty(), "{left:?}");

    for data in [new, empty] {
        let database = fs::metadata(data.join("melange.sqlite")).expect("it is there");
        assert!(!database.permissions().readonly());
        done(&["verify", "--data", text(&data)]);
        let server = Server::start("serve", &data, &[]);
        assert_eq!(server.json(&format!("/api/v1/sweeps/{known}/runs")), original);
        let sweep = server.wait(&id);
        assert_eq!(sweep["counts"]["completed"], RUNS, "{sweep}");
        assert_eq!(rows(&server, &id, "runs"), RUNS);
        assert!(server.terminate());
        done(&["verify", "--data", text(&data)]);
    }
}

#[test]
fn a_damaged_or_incomplete_backup_is_refused_and_leaves_nothing() {
    let place = folder();
    let (data, backup) = (place.path().join("data"), place.path().join("backup"));
    let server = Server::start("serve", &data, &[]);
    let id = server.submit(&steady_sweep(12, 12));
    server.wait(&id);
    assert!(server.terminate());
    done(&["backup", "--data", text(&data), "--to", text(&backup)]);
    let (work, new) = (place.path().join("work"), place.path().join("new"));
    fs::create_dir(&work).expect("a folder");
    let restore = |from: &Path| {
        let sentence = refused(&["restore", "--from", text(from), "--data", text(&new)]);
        assert!(!new.exists() && fs::read_dir(&work).expect("a folder").next().is_none());
        sentence
    };
    let flip = |path: &Path| {
        let sound = fs::read(path).expect("readable");
        let mut bytes = sound.clone();
        let middle = bytes.len() / 2;
        bytes[middle] ^= 4;
        fs::write(path, &bytes).expect("writable");
        sound
    };

    let files: Vec<PathBuf> = contents(&backup.join("archive")).into_keys().collect();
    assert!(files.len() >= 2, "{files:?}");
    let name = |path: &Path| path.file_name().expect("a name").to_string_lossy().into_owned();
    let sound = flip(&files[0]);
    let missing = fs::read(&files[1]).expect("readable");
    fs::remove_file(&files[1]).expect("it is there");
    let sentence = restore(&backup);
    // Both are named, each with what is wrong.
    assert!(sentence.contains(&name(&files[0])) && sentence.contains("bytes differ"), "{sentence}");
    assert!(sentence.contains(&name(&files[1])), "{sentence}");
    assert!(!sentence.contains("--repair"), "a backup is not repaired: {sentence}");
    fs::write(&files[0], sound).expect("writable");
    fs::write(&files[1], missing).expect("writable");

    // Any bit of the database counts, also one that contradicts nothing.
    let database = backup.join("melange.sqlite");
    let sound = flip(&database);
    assert!(restore(&backup).contains("melange.sqlite"));
    fs::write(&database, sound).expect("writable");

    let manifest = backup.join("backup.json");
    let sound = fs::read(&manifest).expect("readable");
    fs::remove_file(&manifest).expect("it is there");
    assert!(restore(&backup).contains("no whole backup"));
    assert!(restore(&data).contains("make a backup of it"));
    assert!(restore(&place.path().join("nothing")).contains("there is no folder"));
    fs::write(&manifest, &sound).expect("writable");

    // In use, it changes.
    let server = Server::start("serve", &backup, &[]);
    assert!(restore(&backup).contains("in use"));
    assert!(server.terminate());
}

/// The fixture's database has an applied migration of a number far from any there is.
#[test]
fn a_backup_of_a_newer_version_is_refused() {
    let place = folder();
    let new = place.path().join("new");
    let newer = root().join("tests/fixtures/data-newer");
    let sentence = refused(&["restore", "--from", text(&newer), "--data", text(&new)]);
    assert!(sentence.contains("newer melange") && !new.exists(), "{sentence}");
}

/// Series of the metrics: name with labels, value.
fn metrics(server: &Server) -> BTreeMap<String, f64> {
    let answer = server.get("/metrics");
    assert_eq!((answer.status, answer.content_type.as_str()), (200, "text/plain; version=0.0.4"));
    let text = String::from_utf8(answer.body).expect("UTF-8");
    let mut series = BTreeMap::new();
    for line in text.lines().filter(|line| !line.starts_with('#')) {
        let (name, value) = line.rsplit_once(' ').expect("a name and a value");
        series.insert(name.to_owned(), value.parse().expect("a number"));
        let family = name.split('{').next().expect("a name");
        let stem = ["_bucket", "_sum", "_count"].iter().find_map(|end| family.strip_suffix(end));
        let told = [Some(family), stem].into_iter().flatten().any(|name| {
            text.contains(&format!("# HELP {name} ")) && text.contains(&format!("# TYPE {name} "))
        });
        assert!(told, "{family} has no help or type");
    }
    series
}

#[test]
fn metrics_tell_requests_runs_chunks_queue_archive_and_process() {
    const RUNS: usize = 40;
    let place = folder();
    let server = Server::start("serve", place.path(), &["--workers", "2"]);
    let before = metrics(&server);
    assert_eq!(before[r#"melange_sweeps{state="complete"}"#], 0.0);
    let id = server.submit(&steady_sweep(RUNS, 12));
    server.wait(&id);
    // The same again, in another order: nothing is solved.
    let again = server.submit(&steady_sweep(RUNS, 12));
    server.wait(&again);
    let paused = server.submit(&long_sweep(200));
    wait_until("it runs", || count(&server, &paused, "running") > 0);
    let held = metrics(&server)[r#"melange_queue_runs{state="running"}"#];
    assert!(held > 0.0);
    server.ask(&paused, "pause");
    wait_until("nothing runs", || count(&server, &paused, "running") == 0);
    let queued = count(&server, &paused, "queued") as f64;
    server.get("/api/v1/sweeps/nothing?not=known");
    server.get("/api/v1/nothing/at/all");
    let now = metrics(&server);
    let of = |name: &str| *now.get(name).unwrap_or_else(|| panic!("{name} is not in {now:#?}"));
    assert_eq!(of(r#"melange_runs_ended_total{status="converged"}"#), 2.0 * RUNS as f64);
    assert_eq!(of("melange_runs_reused_total"), RUNS as f64);
    let completed = count(&server, &paused, "completed") as f64;
    assert!(of("melange_run_solve_seconds_count") >= RUNS as f64 + completed);
    assert!(of("melange_run_solve_seconds_sum") > 0.0);
    let (leased, finished) =
        (of("melange_chunks_leased_total"), of("melange_chunks_finished_total"));
    assert!(leased > 2.0, "{leased} chunks");
    assert_eq!(leased, finished + of("melange_chunks_returned_total"));
    assert_eq!(finished, of("melange_chunk_commit_seconds_count"));
    assert_eq!(of("melange_chunk_store_failures_total"), 0.0);
    assert_eq!(of(r#"melange_sweeps{state="complete"}"#), 2.0);
    assert_eq!(of(r#"melange_sweeps{state="paused"}"#), 1.0);
    assert_eq!(of(r#"melange_queue_runs{state="paused"}"#), queued);
    assert_eq!(of(r#"melange_queue_runs{state="queued"}"#), 0.0);
    assert_eq!(of("melange_worker_threads"), 2.0);
    assert!(of("melange_archive_files") >= 2.0 && of("melange_archive_bytes") > 1e4);
    assert!(of("melange_database_bytes") > 1e5);
    let free = of("melange_data_disk_free_bytes");
    assert!(free > 0.0 && free <= of("melange_data_disk_size_bytes"));
    assert!(of("process_resident_memory_bytes") > 1e6 && of("process_open_fds") > 3.0);
    assert!(of("process_start_time_seconds") > 1.6e9);
    // Routes are templates: a thousand sweeps are one series.
    let post = r#"melange_http_requests_total{method="POST",route="/api/v1/sweeps",status="202"}"#;
    assert_eq!(of(post), 3.0);
    let refused =
        r#"melange_http_requests_total{method="GET",route="/api/v1/sweeps/{id}",status="400"}"#;
    assert_eq!(of(refused), 1.0);
    assert_eq!(of(r#"melange_http_requests_total{method="GET",route="other",status="404"}"#), 1.0);
    assert!(now.keys().all(|name| !name.contains(&id)));
}

#[test]
fn a_request_has_an_id_which_the_log_and_a_failure_name() {
    let place = folder();
    let (data, log) = (place.path().join("data"), place.path().join("log"));
    let server = Server::start_logged(&data, &log, &["--log-format", "json"]);
    let id = server.submit(&steady_sweep(6, 12));
    server.wait(&id);
    let with = |name: &str| {
        let path = format!("/api/v1/sweeps/{id}");
        server.get_with(&path, &[("x-request-id", name)]).request_id
    };
    assert_eq!(with("lab-42_a"), "lab-42_a");
    for insane in ["two words", r#"a"quoted""#, &"long".repeat(40)] {
        let given = with(insane);
        assert!(given.len() == 32 && given != insane, "{given}");
    }
    assert_ne!(with(""), with(""));
    let bad = server.get_with("/api/v1/sweeps?limit=x&token=geheim", &[("x-request-id", "bad")]);
    assert_eq!((bad.status, bad.request_id.as_str()), (400, "bad"));
    assert!(bad.json().get("request_id").is_none(), "who asked wrongly needs no log");
    // A file that is gone is the service's own failure.
    for file in contents(&data.join("archive")).into_keys() {
        fs::remove_file(file).expect("it is there");
    }
    let table = format!("/api/v1/sweeps/{id}/profiles.parquet");
    let failed = server.get_with(&table, &[("x-request-id", "the-failure")]);
    assert_eq!((failed.status, failed.request_id.as_str()), (500, "the-failure"));
    assert_eq!(failed.json()["request_id"], "the-failure");
    assert!(server.terminate());

    let log = fs::read_to_string(&log).expect("a log");
    assert!(!log.contains("geheim"), "{log}");
    let lines: Vec<Value> = log
        .lines()
        .map(|l| serde_json::from_str(l).unwrap_or_else(|e| panic!("{e}: {l}")))
        .collect();
    let of = |name: &str| -> Vec<&Value> {
        lines.iter().filter(|line| line["span"]["request_id"] == name).collect()
    };
    let [line] = of("lab-42_a")[..] else { panic!("{log}") };
    assert_eq!((&line["level"], &line["status"]), (&json!("INFO"), &json!(200)), "{line}");
    let span = &line["span"];
    assert_eq!((&span["method"], &span["route"]), (&json!("GET"), &json!("/api/v1/sweeps/{id}")));
    assert!(line["duration_ms"].as_f64().is_some_and(|ms| ms > 0.0), "{line}");
    assert_eq!(of("bad")[0]["status"], 400);
    // The cause, and the line of the request.
    let lines = of("the-failure");
    assert_eq!(lines.len(), 2, "{log}");
    assert!(lines.iter().all(|line| line["level"] == "ERROR"));
    assert!(lines.iter().any(|line| line["message"].to_string().contains("cannot be read")));
}

/// Sends the beginning of a request; its connection.
fn begin(server: &Server, head: &str) -> TcpStream {
    let address = server.address.trim_start_matches("http://");
    let mut connection = TcpStream::connect(address).expect("it listens");
    connection.set_read_timeout(Some(Duration::from_secs(60))).expect("a time");
    connection.write_all(head.as_bytes()).expect("it takes it");
    connection
}

/// Reads the head of an answer.
fn head(answer: &mut impl BufRead) -> String {
    let mut head = String::new();
    while !head.ends_with("\r\n\r\n") {
        assert!(answer.read_line(&mut head).expect("an answer") > 0, "it broke off: {head}");
    }
    head.to_lowercase()
}

#[test]
fn a_service_that_is_told_to_end_finishes_what_it_can_and_loses_nothing() {
    const RUNS: usize = 60;
    let place = folder();
    let (data, log) = (place.path().join("data"), place.path().join("log"));
    let server = Server::start_logged(&data, &log, &["--workers", "2"]);
    // Larger than what fits between the ends of a connection, some 6 MB: most is sent after the signal.
    let table = server.submit(&steady_sweep(1_200, 200));
    server.wait(&table);
    let id = server.submit(&long_sweep(RUNS));
    wait_until("it runs", || count(&server, &id, "completed") > 0);
    let get =
        |path: &str| begin(&server, &format!("GET {path} HTTP/1.1\r\nhost: localhost\r\n\r\n"));
    let mut download = BufReader::new(get(&format!("/api/v1/sweeps/{table}/profiles.parquet")));
    let told = head(&mut download);
    let length = told.lines().find_map(|line| line.strip_prefix("content-length: "));
    let length: usize = length.expect("a length").parse().expect("a number");
    assert!(length > 8 << 20, "{length} bytes would not wait for their reader");
    let mut events = BufReader::new(get(&format!("/api/v1/sweeps/{id}/events")));
    head(&mut events);
    let mut asking = begin(&server, "GET /health HTTP/1.1\r\n");
    // What was sent before it has arrived: requests of one machine come in order of their connection.
    assert_eq!(server.get("/health").status, 200);
    let idle = TcpStream::connect(server.address.trim_start_matches("http://"));

    let begin = Instant::now();
    server.ask_to_end();
    wait_until("it listens no more", || {
        TcpStream::connect(server.address.trim_start_matches("http://")).is_err()
    });
    // Connections hear of it one after another, a little after nobody is let in: when one has ended, all have heard.
    let mut rest = Vec::new();
    events.read_to_end(&mut rest).expect("the stream ends");
    // Whoever was asking gets the answer, and hears that it is the last one.
    asking.write_all(b"host: localhost\r\n\r\n").expect("it still reads");
    let told = head(&mut BufReader::new(asking));
    assert!(told.starts_with("http/1.1 200") && told.contains("connection: close"), "{told}");
    let mut body = Vec::new();
    download.read_to_end(&mut body).expect("the whole table");
    assert_eq!(body.len(), length);
    assert_eq!(read(body).iter().map(|batch| batch.num_rows()).sum::<usize>(), 1_200);
    assert!(server.ended(), "it ends well");
    assert!(begin.elapsed() < Duration::from_secs(9), "{:?}", begin.elapsed());
    drop(idle);

    // Nothing is left under way, before anyone takes it back.
    let (_, log) = (done(&["verify", "--data", text(&data)]), fs::read_to_string(&log));
    assert!(!log.expect("a log").contains("cuts off"));
    let listed = done(&["sweeps", "--data", text(&data)]);
    assert!(listed.contains(&id), "{listed}");
    let server = Server::start_logged(&data, &place.path().join("second"), &[]);
    let sweep = server.wait(&id);
    assert_eq!(sweep["counts"]["completed"], RUNS, "{sweep}");
    assert_eq!(rows(&server, &id, "runs"), RUNS);
    assert!(server.terminate());
    let second = fs::read_to_string(place.path().join("second")).expect("a log");
    assert!(!second.contains("took back"), "leases were left: {second}");
    done(&["verify", "--data", text(&data)]);
}

#[test]
fn who_does_not_read_does_not_hold_the_end_up() {
    let place = folder();
    let (data, log) = (place.path().join("data"), place.path().join("log"));
    let server = Server::start_logged(&data, &log, &["--grace-s", "1"]);
    let mut half = begin(
        &server,
        "POST /api/v1/sweeps HTTP/1.1\r\nhost: localhost\r\nexpect: 100-continue\r\ncontent-length: 9\r\n\r\n",
    );
    // It asks for the body, so that it is waiting when it is told to end.
    let told = head(&mut BufReader::new(half.try_clone().expect("a second end")));
    assert!(told.starts_with("http/1.1 100"), "{told}");
    half.write_all(b"{").expect("it reads");
    let begin = Instant::now();
    assert!(server.terminate(), "it ends well");
    let took = begin.elapsed();
    assert!((1..6).contains(&took.as_secs()), "{took:?}");
    assert!(fs::read_to_string(&log).expect("a log").contains("cuts off"));
}

#[test]
fn health_is_told_by_exit_code() {
    let place = folder();
    let server = Server::start("serve", place.path(), &[]);
    let told = done(&["health", "--url", &server.address]);
    assert!(told.starts_with("up: version"), "{told}");
    let free = TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = format!("http://{}", free.local_addr().expect("its address"));
    // It listens, and says nothing.
    let output = melange(&["health", "--url", &address, "--timeout-s", "1"], "");
    assert_eq!(output.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&output.stderr).starts_with("down: "));
    assert!(server.terminate());
}
