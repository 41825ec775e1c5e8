//! Reading without melange: ranges and tags of downloads, the NetCDF dataset, the README's examples, the
//! dictionary of columns.

use crate::{melt_sweep, tables};
use melange_tests::{Server, folder, melange, python, root};
use serde_json::{Value, json};
use std::collections::HashMap;
use std::fs;
use std::path::Path;
use std::thread::sleep;
use std::time::{Duration, Instant};

fn download(id: &str, name: &str) -> String {
    format!("/api/v1/sweeps/{id}/{name}")
}

/// Waits until a complete sweep's files are put together, which happens a little after its end.
fn put_together(data: &Path, id: &str) {
    let folder = data.join("archive").join(id);
    let begin = Instant::now();
    loop {
        let files = fs::read_dir(&folder).expect("the sweep's files").flatten();
        let names = files.map(|file| file.file_name().to_string_lossy().into_owned());
        // The old files go last, table by table.
        let left: Vec<String> = names.filter(|name| !name.starts_with("all-")).collect();
        let runs = left.iter().filter(|name| name.ends_with("-runs.parquet")).count();
        if left.is_empty() || (runs == 1 && left.iter().all(|name| name.ends_with(".parquet"))) {
            return;
        }
        assert!(begin.elapsed() < Duration::from_secs(60), "{left:?}");
        sleep(Duration::from_millis(20));
    }
}

#[test]
fn downloads_have_tags_and_ranges() {
    let folder = folder();
    let server = Server::start("serve", folder.path(), &[]);
    let id = server.submit(&melt_sweep(11));
    server.wait(&id);
    put_together(folder.path(), &id);
    for name in ["runs.parquet", "runs.csv", "profiles.parquet", "ensemble.nc"] {
        let path = download(&id, name);
        let whole = server.get(&path);
        assert_eq!(whole.status, 200, "{name}: {}", String::from_utf8_lossy(&whole.body));
        let (tag, bytes) = (whole.header("etag"), whole.body.len());
        assert!(tag.starts_with('"') && tag.len() > 30, "{name}: {tag}");
        assert_eq!(whole.header("accept-ranges"), "bytes");
        let head = server.head(&path);
        assert_eq!((head.status, head.header("etag")), (200, tag), "{name}");
        assert_eq!(head.header("content-length"), bytes.to_string(), "{name}");

        let part = |range: &str, more: &[(&str, &str)]| {
            let headers: Vec<_> = [("range", range)].iter().chain(more).copied().collect();
            server.get_with(&path, &headers)
        };
        for (range, from, end) in [
            ("bytes=0-3".to_owned(), 0, 4),
            ("bytes=-5".to_owned(), bytes - 5, bytes),
            (format!("bytes={}-", bytes - 7), bytes - 7, bytes),
            (format!("bytes=10-{}", bytes * 2), 10, bytes),
        ] {
            let answer = part(&range, &[]);
            assert_eq!(answer.status, 206, "{name}, {range}");
            assert_eq!(answer.body, whole.body[from..end], "{name}, {range}");
            let told = format!("bytes {from}-{}/{bytes}", end - 1);
            assert_eq!(answer.header("content-range"), told, "{name}, {range}");
            assert_eq!(answer.header("etag"), tag);
        }
        let beyond = part(&format!("bytes={bytes}-"), &[]);
        assert_eq!(beyond.status, 416, "{name}");
        assert_eq!(beyond.header("content-range"), format!("bytes */{bytes}"));
        assert_eq!(beyond.json()["status"], 416);
        for ignored in ["bytes=3-0", "bytes=a-", "lines=0-3", "bytes=0-1,3-4"] {
            let answer = part(ignored, &[]);
            assert_eq!((answer.status, answer.body.len()), (200, bytes), "{name}, {ignored}");
        }
        for (condition, status) in [
            (("if-range", tag), 206),
            (("if-range", "\"another\""), 200),
            (("if-range", "Sat, 01 Jan 2028 00:00:00 GMT"), 200),
            (("if-match", tag), 206),
            (("if-match", "\"another\""), 412),
            (("if-none-match", "\"another\""), 206),
            (("if-none-match", tag), 304),
            (("if-none-match", "*"), 304),
        ] {
            let answer = part("bytes=0-3", &[condition]);
            assert_eq!(answer.status, status, "{name}, {condition:?}");
            if status == 304 {
                assert_eq!((answer.header("etag"), answer.body.len()), (tag, 0), "{name}");
            }
        }
    }
    let refused = server.get(&download(&id, "ensemble.nc?format=classic"));
    assert_eq!(refused.status, 400);
    assert_eq!(server.get(&download("nobody", "ensemble.nc")).status, 404);
}

#[test]
fn compressed_text_has_a_weak_tag_and_ranges_are_not_compressed() {
    let folder = folder();
    let server = Server::start("serve", folder.path(), &[]);
    let id = server.submit(&melt_sweep(5));
    server.wait(&id);
    put_together(folder.path(), &id);
    let path = download(&id, "runs.csv");
    let plain = server.get(&path);
    let gzip = ("accept-encoding", "gzip");
    let packed = server.get_with(&path, &[gzip]);
    assert_eq!(packed.header("content-encoding"), "gzip");
    assert!(packed.body.len() < plain.body.len());
    assert_eq!(packed.header("etag"), format!("W/{}", plain.header("etag")));
    assert_eq!(packed.header("accept-ranges"), "");
    let weak = packed.header("etag");
    assert_eq!(server.get_with(&path, &[gzip, ("if-none-match", weak)]).status, 304);
    let part = server.get_with(&path, &[gzip, ("range", "bytes=0-99")]);
    assert_eq!((part.status, part.header("content-encoding")), (206, ""));
    assert_eq!(
        (part.body.as_slice(), part.header("etag")),
        (&plain.body[..100], plain.header("etag"))
    );
    let whole = server.get_with(&path, &[("range", "bytes=0-99"), ("if-range", weak)]);
    assert_eq!(whole.status, 200, "a weak tag holds for no range");
}

#[test]
fn one_tag_is_one_file_while_a_sweep_grows_and_after_a_restart() {
    let folder = folder();
    let server = Server::start("serve", folder.path(), &[]);
    let first = server.submit(&melt_sweep(201));
    let mut seen: HashMap<String, Vec<u8>> = HashMap::new();
    loop {
        let is_complete = server.json(&format!("/api/v1/sweeps/{first}"))["state"] == "complete";
        let answer = server.get(&download(&first, "runs.parquet"));
        assert_eq!(answer.status, 200, "{}", String::from_utf8_lossy(&answer.body));
        let tag = answer.header("etag").to_owned();
        let known = seen.entry(tag).or_insert_with(|| answer.body.clone());
        assert!(*known == answer.body, "one tag for two files");
        if is_complete {
            break;
        }
    }
    assert!(seen.len() > 1, "the sweep was never seen growing");
    // Half of it lives in the other sweep's files.
    let shared = server.submit(&melt_sweep(401));
    server.wait(&shared);
    let names = ["runs.parquet", "runs.csv", "profiles.parquet", "ensemble.nc"];
    let all = |server: &Server| -> Vec<(String, Vec<u8>)> {
        let paths = [&first, &shared].into_iter().flat_map(|id| names.map(|n| download(id, n)));
        let answers = paths.map(|path| server.get(&path));
        answers.map(|answer| (answer.header("etag").to_owned(), answer.body)).collect()
    };
    put_together(folder.path(), &first);
    put_together(folder.path(), &shared);
    let before = all(&server);
    let mut tags: Vec<&str> = before.iter().map(|(tag, _)| tag.as_str()).collect();
    tags.sort_unstable();
    tags.dedup();
    assert_eq!(tags.len(), 2 * names.len(), "each file has its own");
    assert!(all(&server) == before, "asked twice, the files are others");
    assert!(server.terminate());
    let server = Server::start("serve", folder.path(), &[]);
    assert!(all(&server) == before, "made anew by another process, the files are others");
}

/// Steady runs on two grids, one of them twice and one without a steady state; seasons with common times; and
/// transients of which one ends early.
fn sweeps(server: &Server) -> Vec<String> {
    let steady = json!({
        "name": "grids", "regime": "steady",
        "table": {"columns": ["n_cells", "melt_rate_m_per_day"],
                  "rows": [[30, 0.7], [50, 0.7], [30, 0.7], [40, 90.0]]},
    });
    let season = json!({
        "name": "season", "regime": "transient", "start": "steady", "parameters": {"n_cells": 30},
        "forcing": {"melt_rate_m_per_day": {"sinusoid": {"mean": 0.7, "amplitude": 0.2, "period_a": 1.0}}},
        "time": {"duration_a": 0.3, "output_every_a": 0.05, "profiles_at_a": [0.1, 0.3], "fixed_dt_a": 0.05},
        "axes": [{"parameter": "width_m", "values": [3800, 4000]}],
    });
    let collapse = json!({
        "name": "collapse", "regime": "transient", "parameters": {"n_cells": 30},
        "start": {"length_m": 10000, "thickness_0_m": 75},
        "time": {"duration_a": 0.4, "output_every_a": 0.05, "profiles_at_a": [0.05], "fixed_dt_a": 0.05},
        "axes": [{"parameter": "melt_rate_m_per_day", "values": [0.7, 60.0]}],
    });
    let ids: Vec<String> =
        [steady, season, collapse].iter().map(|sweep| server.submit(sweep)).collect();
    ids.iter().for_each(|id| drop(server.wait(id)));
    ids
}

#[test]
fn datasets_are_the_tables_bit_by_bit_and_follow_cf() {
    let folder = folder();
    let server = Server::start("serve", folder.path(), &[]);
    let ids = sweeps(&server);
    let mut arguments = vec![server.address.as_str()];
    arguments.extend(ids.iter().map(String::as_str));
    let told = python(include_str!("../../python/dataset.py"), &arguments, folder.path());
    let lines: Vec<&str> = told.lines().collect();
    assert_eq!(lines.len(), 3, "{told}");
    assert!(lines[0].contains("cell=50 node=51 run=4"), "{told}");
    assert!(lines[1].contains("cell=30 node=31 run=2 snapshot=2 time_a=7"), "{told}");
    // One ends early, so that the times are each run's own.
    assert!(lines[2].contains(" output=") && !lines[2].contains("time_a="), "{told}");
}

/// The Python blocks of a section of the README.
fn blocks(section: &str) -> Vec<String> {
    let readme = fs::read_to_string(root().join("README.md")).expect("a README");
    let text = readme.split(&format!("\n## {section}\n")).nth(1).expect("the section");
    let text = text.split("\n## ").next().expect("its text");
    let blocks = text.split("```python\n").skip(1);
    blocks.map(|block| block.split("```").next().expect("its end").to_owned()).collect()
}

#[test]
fn the_readmes_examples_run() {
    let folder = folder();
    let server = Server::start("serve", folder.path(), &[]);
    let id = server.submit(&melt_sweep(11));
    server.wait(&id);
    let list = server.json(&format!("/api/v1/sweeps/{id}/runs?sort=-force_n_per_m&limit=1"));
    let most = list["items"][0]["force_n_per_m"].as_f64().expect("a force");
    let blocks = blocks("Reading a sweep");
    for library in ["pandas", "polars", "duckdb", "xarray"] {
        assert!(blocks.iter().any(|block| block.contains(library)), "no example with {library}");
    }
    for block in blocks {
        assert!(block.contains("http://127.0.0.1:8080") && block.contains("<id>"), "{block}");
        let block = block.replace("http://127.0.0.1:8080", &server.address).replace("<id>", &id);
        let printed = python(&block, &[], folder.path());
        // Each shows forces of the runs, or the dataset.
        let digits = format!("{most:e}");
        let shown = [&most.to_string()[..6], &digits[..4], "force_n_per_m"];
        assert!(shown.iter().any(|text| printed.contains(text)), "{block}\n{printed}");
    }
}

#[test]
fn the_dictionary_of_columns_is_that_of_the_files() {
    let told = |format: &str| {
        let output = melange(&["columns", "--format", format], "");
        assert!(output.status.success());
        String::from_utf8(output.stdout).expect("UTF-8")
    };
    let document = fs::read_to_string(root().join("docs/columns.md")).expect("docs/columns.md");
    assert!(
        document == told("markdown"),
        "docs/columns.md is stale: target/debug/melange columns > docs/columns.md"
    );
    let listed: Value = serde_json::from_str(&told("json")).expect("JSON");
    let folder = folder();
    let server = Server::start("serve", folder.path(), &[]);
    assert_eq!(server.json("/api/v1/dictionary")["tables"], listed);
    let id = server.submit(&melt_sweep(3));
    server.wait(&id);
    for table in listed.as_array().expect("tables") {
        let name = table["name"].as_str().expect("a name");
        let answer = server.get(&download(&id, &format!("{name}.parquet")));
        let schema = tables::schema(answer.body);
        let columns = table["columns"].as_array().expect("columns");
        assert_eq!(schema.fields().len(), columns.len(), "{name}");
        for (field, column) in schema.fields().iter().zip(columns) {
            assert_eq!(column["name"], field.name().as_str(), "{name}");
            assert_eq!(column["nullable"], field.is_nullable(), "{name}: {field}");
            for key in ["unit", "meaning"] {
                let value = field.metadata().get(key).expect("metadata").as_str();
                assert_eq!(column[key], value, "{name}: {field}");
                assert!(!value.is_empty(), "{name}: {field}");
            }
        }
    }
}
