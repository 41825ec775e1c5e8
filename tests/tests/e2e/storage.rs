//! What the disk does to the service: full, read-only, files damaged or gone, directories of other versions.

use crate::assert_close;
use crate::tables::read;
use melange_tests::{Answer, Disk, Server, assert_counts_add_up, folder, melange, root};
use serde_json::{Value, json};
use std::fs;
use std::path::{Path, PathBuf};
use std::thread::sleep;
use std::time::{Duration, Instant};

/// A grid of small mélanges: melt rates by two widths.
fn grid(first_melt: f64, melts: usize) -> Value {
    let melts: Vec<f64> =
        (0..melts).map(|i| ((first_melt + 0.01 * i as f64) * 1e6).round() / 1e6).collect();
    json!({
        "name": "grid", "regime": "steady", "parameters": {"n_cells": 12},
        "axes": [
            {"parameter": "melt_rate_m_per_day", "values": melts},
            {"parameter": "width_m", "values": [3800, 4200]},
        ],
    })
}

fn table(server: &Server, id: &str, name: &str) -> Answer {
    server.get(&format!("/api/v1/sweeps/{id}/{name}.parquet"))
}

fn rows(server: &Server, id: &str, name: &str) -> usize {
    let answer = table(server, id, name);
    assert_eq!(answer.status, 200, "{}", String::from_utf8_lossy(&answer.body));
    read(answer.body).iter().map(|batch| batch.num_rows()).sum()
}

/// `melange verify`: exit code and findings.
fn verify(data: &Path, more: &[&str]) -> (Option<i32>, Value) {
    let data = data.to_str().expect("UTF-8");
    let output = melange(&[&["verify", "--format", "json", "--data", data], more].concat(), "");
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    (
        output.status.code(),
        serde_json::from_str(&text).unwrap_or_else(|e| panic!("{e}: {text}{told}")),
    )
}

fn assert_clean(data: &Path) {
    let (code, findings) = verify(data, &[]);
    for kind in ["damaged", "orphans", "contradictions"] {
        assert_eq!(findings[kind], json!([]), "{findings:#}");
    }
    assert_eq!(code, Some(0));
}

/// `melange serve`, which is to refuse; its sentence.
fn refusal(data: &Path) -> String {
    let data = data.to_str().expect("UTF-8");
    let output = melange(&["serve", "--listen", "127.0.0.1:0", "--data", data], "");
    assert_eq!(output.status.code(), Some(2));
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// A sweep's files of a table.
fn files_of(data: &Path, id: &str, name: &str) -> Vec<PathBuf> {
    let ending = format!("-{name}.parquet");
    let files = fs::read_dir(data.join("archive").join(id)).expect("the sweep's folder");
    let paths = files.map(|file| file.expect("a file").path());
    paths.filter(|path| path.to_string_lossy().ends_with(&ending)).collect()
}

/// A sweep's file of a table, when they have been put together.
fn file_of(data: &Path, id: &str, name: &str) -> PathBuf {
    let begin = Instant::now();
    loop {
        if let [file] = files_of(data, id, name).as_slice() {
            return file.clone();
        }
        assert!(begin.elapsed() < Duration::from_secs(60), "the files are not put together");
        sleep(Duration::from_millis(50));
    }
}

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).expect("a folder");
    for entry in fs::read_dir(from).expect("a folder") {
        let entry = entry.expect("an entry");
        let target = to.join(entry.file_name());
        if entry.path().is_dir() {
            copy(&entry.path(), &target);
        } else {
            fs::copy(entry.path(), target).expect("a copy");
        }
    }
}

#[test]
fn a_full_disk_holds_a_sweep_up_until_it_is_cleared() {
    const RUNS: usize = 20 * 300;
    let disk = Disk::mount(40);
    let logs = folder();
    let log = logs.path().join("log");
    let data = disk.path().join("data");
    fs::write(disk.path().join("ballast"), vec![0; 32 << 20]).expect("a file");
    let server = Server::start_logged(&data, &log, &[]);
    let id = server.submit(&json!({
        "name": "larger than the disk", "regime": "steady", "parameters": {"n_cells": 30},
        "axes": [
            {"parameter": "melt_rate_m_per_day", "linspace": [0.5, 1.0, 20]},
            {"parameter": "width_m", "linspace": [3500, 4500, 300]},
        ],
    }));
    let said = |word: &str| fs::read_to_string(&log).expect("a log").contains(word);
    let begin = Instant::now();
    while !said("full") && !said("No space left") {
        assert_counts_add_up(&server.json(&format!("/api/v1/sweeps/{id}")));
        assert!(begin.elapsed() < Duration::from_secs(60), "the disk does not fill");
        sleep(Duration::from_millis(20));
    }
    disk.fill("more ballast");
    // A document that does not fit into what the database has reserved for itself.
    let values: Vec<f64> = (0..250_000).map(|i| 0.5 + f64::from(i) * 1.234_567_89e-6).collect();
    let large = json!({
        "regime": "steady", "axes": [{"parameter": "melt_rate_m_per_day", "values": values}],
    });
    let refused = server.post("/api/v1/sweeps", &large.to_string());
    let body = String::from_utf8_lossy(&refused.body).into_owned();
    assert_eq!(refused.status, 507, "{body}; {}", fs::read_to_string(&log).expect("a log"));
    assert!(body.contains("full"), "{body}");
    // It stays up and answers, and tries again, in vain.
    sleep(Duration::from_secs(2));
    assert_eq!(server.json("/health")["status"], "ok");
    let sweep = server.json(&format!("/api/v1/sweeps/{id}"));
    assert_counts_add_up(&sweep);
    assert_ne!(sweep["state"], "complete");
    assert_eq!(server.json("/api/v1/sweeps")["total"], 1);

    for name in ["ballast", "more ballast"] {
        fs::remove_file(disk.path().join(name)).expect("it is there");
    }
    let sweep = server.wait(&id);
    assert_eq!(sweep["counts"]["converged"], RUNS, "{sweep}");
    assert_eq!(rows(&server, &id, "runs"), RUNS);
    assert_eq!(rows(&server, &id, "profiles"), RUNS);
    assert!(server.terminate());
    assert_clean(&data);
}

#[test]
fn a_read_only_directory_is_refused_at_the_start() {
    let disk = Disk::mount(16);
    let data = disk.path().join("data");
    let server = Server::start("serve", &data, &[]);
    let id = server.submit(&grid(0.6, 3));
    server.wait(&id);
    assert!(server.terminate());
    disk.remount("ro");
    let sentence = refusal(&data);
    assert!(sentence.contains("cannot write in the data directory"), "{sentence}");
    assert!(sentence.contains(data.to_str().expect("UTF-8")), "{sentence}");
    disk.remount("rw");
    let server = Server::start("serve", &data, &[]);
    assert_eq!(rows(&server, &id, "runs"), 6);
    assert!(server.terminate());
    assert_clean(&data);
}

#[test]
fn a_directory_serves_one_process() {
    let folder = folder();
    let server = Server::start("serve", folder.path(), &[]);
    let sentence = refusal(folder.path());
    assert!(sentence.contains("in use") && sentence.contains(&server.address), "{sentence}");
    let data = folder.path().to_str().expect("UTF-8");
    let output = melange(&["verify", "--data", data], "");
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&output.stderr).contains("in use"));
    assert_eq!(server.json("/health")["status"], "ok");
}

/// Damages one file of each of three sweeps, which other sweeps use as well, and has it repaired.
#[test]
fn damaged_and_missing_files_are_told_and_their_runs_solved_again() {
    let folder = folder();
    let data = folder.path();
    let server = Server::start("serve", data, &[]);
    let submit = |document: &Value| {
        let id = server.submit(document);
        (id.clone(), server.wait(&id))
    };
    let (truncated, _) = submit(&grid(0.5, 6));
    let (flipped, _) = submit(&grid(0.7, 6));
    let (missing, _) = submit(&grid(0.9, 6));
    // Half of its runs are those of the first one.
    let (guest, was) = submit(&grid(0.53, 6));
    assert_eq!(was["reused"], 6);
    let (sound, _) = submit(&grid(1.1, 6));
    let runs = server.json(&format!("/api/v1/sweeps/{truncated}/runs?limit=1"));
    let run = runs["items"][0]["run_id"].as_str().expect("an id").to_owned();
    let before = server.json(&format!("/api/v1/runs/{run}"));
    let of_truncated = file_of(data, &truncated, "profiles");
    let of_flipped = file_of(data, &flipped, "runs");
    let of_missing = file_of(data, &missing, "profiles");
    assert!(server.terminate());
    assert_clean(data);

    let bytes = fs::read(&of_truncated).expect("readable");
    fs::write(&of_truncated, &bytes[..bytes.len() - 7]).expect("writable");
    let mut bytes = fs::read(&of_flipped).expect("readable");
    let middle = bytes.len() / 2;
    bytes[middle] ^= 16;
    fs::write(&of_flipped, &bytes).expect("writable");
    fs::remove_file(&of_missing).expect("it is there");

    let server = Server::start("serve", data, &[]);
    let name = |path: &Path| path.file_name().expect("a name").to_string_lossy().into_owned();
    for (answer, file) in [
        (table(&server, &truncated, "profiles"), &of_truncated),
        (table(&server, &guest, "profiles"), &of_truncated),
        (server.get(&format!("/api/v1/runs/{run}")), &of_truncated),
        (table(&server, &flipped, "runs"), &of_flipped),
        (table(&server, &missing, "profiles"), &of_missing),
    ] {
        let body = String::from_utf8_lossy(&answer.body).into_owned();
        assert_eq!(answer.status, 500, "{body}");
        assert!(body.contains(&name(file)) && body.contains("melange verify --repair"), "{body}");
    }
    assert_eq!((rows(&server, &sound, "runs"), rows(&server, &sound, "profiles")), (12, 12));
    assert_eq!(rows(&server, &truncated, "runs"), 12);
    assert!(server.terminate());

    let damaged = |findings: &Value| {
        let list = findings["damaged"].as_array().expect("findings").clone();
        let mut named: Vec<String> = list.iter().map(|d| d[0].to_string()).collect();
        named.sort();
        named
    };
    let (code, findings) = verify(data, &[]);
    assert_eq!((code, damaged(&findings).len()), (Some(1), 3), "{findings:#}");
    for file in [&of_truncated, &of_flipped, &of_missing] {
        assert!(findings["damaged"].to_string().contains(&name(file)), "{findings:#}");
    }
    let (code, repaired) = verify(data, &["--repair"]);
    assert_eq!((code, damaged(&repaired)), (Some(0), damaged(&findings)));

    let server = Server::start("serve", data, &[]);
    for id in [&truncated, &flipped, &missing, &guest, &sound] {
        let sweep = server.wait(id);
        assert_eq!(sweep["counts"]["converged"], 12, "{sweep}");
        assert_eq!((rows(&server, id, "runs"), rows(&server, id, "profiles")), (12, 12));
    }
    // Whichever solved them again, the other one took them over.
    let reused = |id: &str| server.json(&format!("/api/v1/sweeps/{id}"))["reused"].as_i64();
    assert_eq!(reused(&truncated).zip(reused(&guest)).map(|(a, b)| a + b), Some(6));
    assert_eq!(server.json(&format!("/api/v1/runs/{run}"))["profile"], before["profile"]);
    assert!(server.terminate());
    assert_clean(data);
}

#[test]
fn directories_of_older_versions_are_brought_up_to_date() {
    for fixture in ["data-schema-2", "data-schema-3", "data-schema-4"] {
        is_brought_up_to_date(fixture);
    }
}

fn is_brought_up_to_date(fixture: &str) {
    let folder = folder();
    copy(&root().join("tests/fixtures").join(fixture), folder.path());
    let server = Server::start("serve", folder.path(), &[]);
    let sweeps = server.json("/api/v1/sweeps");
    let sweep = |name: &str| {
        let items = sweeps["items"].as_array().expect("sweeps");
        items.iter().find(|s| s["name"] == name).expect("the sweep").clone()
    };
    for (name, runs, profiles, series) in [("melt", 2, 2, 0), ("seasons", 1, 2, 6)] {
        let sweep = sweep(name);
        assert_eq!(sweep["state"], "complete", "{sweep}");
        let id = sweep["id"].as_str().expect("an id");
        let page = server.json(&format!("/api/v1/sweeps/{id}/runs"));
        assert_eq!(page["total"], runs);
        let first = &page["items"][0];
        if name == "melt" {
            let melts: Vec<&Value> =
                (0..2).map(|i| &page["items"][i]["melt_rate_m_per_day"]).collect();
            assert_eq!(melts, [&json!(0.5), &json!(0.6)]);
            assert_close("F", &first["force_n_per_m"], &json!(15_593_407.815_390_6), 1e-12);
        } else {
            let run_id = first["run_id"].as_str().expect("an id");
            let one = server.json(&format!("/api/v1/runs/{run_id}"));
            assert_eq!(one["states"][0]["time_a"], 0.02);
        }
        for run in page["items"].as_array().expect("items") {
            let run_id = run["run_id"].as_str().expect("an id");
            let one = server.json(&format!("/api/v1/runs/{run_id}"));
            assert_eq!(one["length_m"], run["length_m"]);
            assert_eq!(one["profile"]["thickness_m"].as_array().map(Vec::len), Some(12));
        }
        assert_eq!(rows(&server, id, "runs"), runs);
        assert_eq!(rows(&server, id, "profiles"), profiles);
        assert_eq!(rows(&server, id, "series"), series);
        assert_eq!(rows(&server, id, "branches"), 0);
        // What it holds need not be solved again.
        let again = server.submit(&sweep["spec"]);
        assert_eq!(server.wait(&again)["reused"], runs);
        assert_eq!(rows(&server, &again, "profiles"), profiles);
        assert_eq!(rows(&server, &again, "series"), series);
    }
    assert!(server.terminate());
    assert_clean(folder.path());
}

/// The fixture is a database with nothing but one applied migration, of a number far from any there is.
#[test]
fn a_directory_of_a_newer_version_is_refused() {
    let folder = folder();
    copy(&root().join("tests/fixtures/data-newer"), folder.path());
    let sentence = refusal(folder.path());
    assert!(sentence.contains("newer melange") && sentence.contains("999999"), "{sentence}");
}

#[test]
fn an_archive_without_its_database_is_not_cleared_away() {
    let folder = folder();
    let data = folder.path().join("data");
    let server = Server::start("serve", &data, &[]);
    let id = server.submit(&grid(0.6, 3));
    server.wait(&id);
    assert!(server.terminate());
    let files = || fs::read_dir(data.join("archive").join(&id)).expect("a folder").count();
    let before = files();
    assert!(before > 0);
    let kept = folder.path().join("kept");
    fs::rename(data.join("melange.sqlite"), &kept).expect("it is there");
    assert!(refusal(&data).contains("database"), "{}", refusal(&data));
    fs::write(data.join("melange.sqlite"), "").expect("writable");
    assert!(refusal(&data).contains("database"));
    assert_eq!(files(), before);
    fs::rename(&kept, data.join("melange.sqlite")).expect("writable");
    let server = Server::start("serve", &data, &[]);
    assert_eq!(rows(&server, &id, "runs"), rows(&server, &id, "profiles"));
}

#[test]
fn sweeps_that_share_runs_are_repaired_when_all_files_are_gone() {
    let folder = folder();
    let data = folder.path().join("data");
    let server = Server::start("serve", &data, &[]);
    let sweep = |step: usize| {
        let melts: Vec<f64> = (0..16).step_by(step).map(|i| 0.5 + 0.01 * i as f64).collect();
        json!({
            "regime": "steady", "parameters": {"n_cells": 20},
            "axes": [{"parameter": "melt_rate_m_per_day", "values": melts}],
        })
    };
    let ids = [server.submit(&sweep(2)), server.submit(&sweep(1)), server.submit(&sweep(3))];
    ids.iter().for_each(|id| drop(server.wait(id)));
    assert!(server.terminate());
    for id in &ids {
        fs::remove_dir_all(data.join("archive").join(id)).ok();
    }
    let path = data.to_str().expect("UTF-8");
    assert_eq!(melange(&["verify", "--data", path], "").status.code(), Some(1));
    assert!(melange(&["verify", "--repair", "--data", path], "").status.success());
    let server = Server::start("serve", &data, &[]);
    for (id, runs) in ids.iter().zip([8, 16, 6]) {
        assert_eq!(server.wait(id)["counts"]["converged"], runs);
        assert_eq!(rows(&server, id, "profiles"), runs);
    }
    assert!(server.terminate());
    assert_clean(&data);
}
