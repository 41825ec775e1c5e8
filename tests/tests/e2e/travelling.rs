//! Sweeps that leave one data directory and come to another: nothing is lost, and nothing hostile is believed.

use crate::archives::{Archive, append, pack, with_column, with_number, with_text};
use crate::melt_sweep;
use crate::sealing::seal;
use arrow_array::cast::AsArray;
use melange_tests::{Server, folder, melange};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::process::Output;
use std::sync::Arc;
use tar::EntryType;
use tempfile::TempDir;

pub fn text(path: &Path) -> &str {
    path.to_str().expect("UTF-8")
}

pub fn import(archive: &Path, data: &Path, more: &[&str]) -> Output {
    let mut arguments = vec!["import", text(archive), "--data", text(data)];
    arguments.extend(more);
    melange(&arguments, "")
}

pub fn said(output: &Output) -> String {
    format!(
        "{}{}",
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr)
    )
}

/// A sealed sweep with two kinds of tables, and its export.
struct Sealed {
    data: TempDir,
    id: String,
    archive: PathBuf,
}

fn sealed() -> Sealed {
    let data = folder();
    let server = Server::start("serve", data.path(), &[]);
    let table = json!({"columns": ["melt_rate_m_per_day"], "rows": [[0.5], [0.63], [0.5], [0.7]]});
    let id = server.submit(&json!({"name": "far", "tags": ["t"], "regime": "steady",
        "parameters": {"n_cells": 20}, "options": {"sensitivities": true}, "table": table}));
    server.wait(&id);
    seal(&server, &id);
    assert!(server.terminate());
    let archive = data.path().join("e.tar.zst");
    let told = melange(&["export", &id, "--to", text(&archive), "--data", text(data.path())], "");
    assert!(told.status.success(), "{}", said(&told));
    Sealed { data, id, archive }
}

#[test]
fn a_sealed_sweep_arrives_bit_for_bit_and_stays_sealed() {
    let from = sealed();
    let there = folder();
    let told = import(&from.archive, there.path(), &["--dry-run"]);
    assert!(said(&told).contains("would be imported"), "{}", said(&told));
    let told = import(&from.archive, there.path(), &[]);
    assert!(told.status.success(), "{}", said(&told));
    let told = import(&from.archive, there.path(), &[]);
    assert!(
        said(&told).contains("already here")
            && said(&told).contains("4 of them here with the same numbers")
    );
    let (a, b) =
        (Server::start("serve", from.data.path(), &[]), Server::start("serve", there.path(), &[]));
    let path = format!("/api/v1/sweeps/{}", from.id);
    for file in [
        "runs.parquet",
        "profiles.parquet",
        "sensitivities.parquet",
        "runs.csv",
        "manifest",
        "citation",
        "export.tar.zst",
    ] {
        let path = format!("{path}/{file}");
        let (one, other) = (a.get(&path), b.get(&path));
        assert_eq!((one.status, other.status), (200, 200), "{file}");
        assert!(one.body == other.body, "{file} differs");
    }
    let (one, other) = (a.json(&path), b.json(&path));
    for member in ["sealed", "name", "tags", "counts", "spec", "state"] {
        assert_eq!(one[member], other[member], "{member}");
    }
    assert_eq!(other["owner"], "operator");
    assert_eq!(other["imported"]["owner"], "local");
    assert_eq!(b.delete(&path).status, 409);
    let run = b.json(&format!("{path}/runs?limit=1"))["items"][0]["run_id"].clone();
    let run = format!("/api/v1/runs/{}", run.as_str().expect("an id"));
    assert_eq!(a.json(&run), b.json(&run));
    // What has come is known.
    let again = b.submit(&json!({"regime": "steady", "parameters": {"n_cells": 20}, "options": {"sensitivities": true},
        "axes": [{"parameter": "melt_rate_m_per_day", "values": [0.5, 0.7]}]}));
    assert_eq!(b.wait(&again)["reused"], 2);
    assert!(b.terminate());
    let verified = melange(&["verify", "--data", text(there.path())], "");
    assert!(verified.status.success(), "{}", said(&verified));
}

#[test]
fn sweeps_that_are_not_sealed_travel_together_through_the_service() {
    let data = folder();
    let server = Server::start("serve", data.path(), &["--workers", "1"]);
    let small = server.submit(&melt_sweep(5));
    server.wait(&small);
    let mut large = melt_sweep(3_000);
    large["parameters"] = json!({"n_cells": 60});
    let large = server.submit(&large);
    loop {
        let counts = server.json(&format!("/api/v1/sweeps/{large}"))["counts"].clone();
        if counts["converged"].as_i64() > Some(0) {
            break;
        }
    }
    server.ask(&large, "stop");
    while server.json(&format!("/api/v1/sweeps/{large}"))["state"] != "cancelled" {}
    let archive = data.path().join("two.tar.zst");
    let export = ["export", &small, &large, "--to", text(&archive), "--data", text(data.path())];
    let told = melange(&export, "");
    assert!(told.status.success(), "{}", said(&told));
    assert!(!melange(&export, "").status.success(), "an export overwrites nothing");
    let there = folder();
    let other = Server::start("serve", there.path(), &[]);
    let told = import(&archive, there.path(), &[]);
    assert!(told.status.success(), "{}", said(&told));
    let counts =
        |server: &Server| server.json(&format!("/api/v1/sweeps/{large}"))["counts"].clone();
    assert_eq!(counts(&server), counts(&other));
    assert!(counts(&other)["cancelled"].as_i64() > Some(0));
    let csv = |server: &Server| server.get(&format!("/api/v1/sweeps/{large}/runs.csv")).body;
    assert!(csv(&server) == csv(&other));
    assert_eq!(other.json(&format!("/api/v1/sweeps/{small}"))["sealed"], Value::Null);
    // The same numbers have the same hash, whoever seals them where.
    let hash = |server: &Server| seal(server, &small)["sealed"]["content_hash"].clone();
    let (one, another) = (hash(&server), hash(&other));
    assert_eq!(one, another);
    // It goes on where it was stopped.
    other.ask(&large, "resume");
    assert_eq!(other.wait(&large)["counts"]["converged"], 3_000);
    let told = import(&archive, data.path(), &[]);
    assert!(said(&told).contains(&format!("{small} is already here")), "{}", said(&told));
    assert!(other.terminate());
    let verified = melange(&["verify", "--data", text(there.path())], "");
    assert!(verified.status.success(), "{}", said(&verified));
}

/// An archive with one thing wrong: what it is, its bytes, and what the refusal says.
type Hostile = (&'static str, Vec<u8>, &'static str);

fn hostile(good: &Archive) -> Vec<Hostile> {
    let folder = good.folder();
    let in_folder = |name: &str| format!("{folder}/{name}");
    // An entry of another kind behind the others.
    let with = |path: &str, entry_type: EntryType, bytes: &[u8]| {
        let mut tar = tar::Builder::new(Vec::new());
        for (path, bytes) in &good.0 {
            append(&mut tar, path, EntryType::Regular, bytes);
        }
        append(&mut tar, path, entry_type, bytes);
        pack(&tar.into_inner().expect("a tar"))
    };
    let changed = |change: &dyn Fn(&mut Archive)| {
        let mut archive = good.clone();
        change(&mut archive);
        archive.packed()
    };
    let manifest = |change: &dyn Fn(&mut Value)| changed(&|a| a.change_manifest(change));
    let runs = |change: &dyn Fn(arrow_array::RecordBatch) -> arrow_array::RecordBatch| {
        changed(&|a| a.change_table("runs.parquet", change))
    };
    let regular = EntryType::Regular;
    let packed = good.packed();
    vec![
        ("path up", with("../evil.parquet", regular, b"x"), "no name that an export has"),
        (
            "path up inside",
            with(&format!("{folder}/../../evil"), regular, b"x"),
            "no name that an export has",
        ),
        ("absolute path", with("/tmp/evil", regular, b"x"), "no name that an export has"),
        ("unknown name", with(&in_folder("evil.sh"), regular, b"x"), "no name that an export has"),
        ("other folder", with("evil/manifest.json", regular, b"x"), "no name that an export has"),
        (
            "symbolic link",
            with(&in_folder("series.parquet"), EntryType::Symlink, b"/etc/passwd"),
            "no plain file",
        ),
        (
            "hard link",
            with(&in_folder("series.parquet"), EntryType::Link, b"/etc/passwd"),
            "no plain file",
        ),
        ("device", with(&in_folder("series.parquet"), EntryType::Char, b""), "no plain file"),
        ("folder", with(&in_folder("series.parquet"), EntryType::Directory, b""), "no plain file"),
        ("long name", with("././@LongLink", EntryType::GNULongName, b"../evil"), "no plain file"),
        ("twice", with(&in_folder("runs.parquet"), regular, b"x"), "is there twice"),
        ("two manifests", with(&in_folder("manifest.json"), regular, b"{}"), "two manifests"),
        (
            "not in the manifest",
            with(&in_folder("series.parquet"), regular, b"x"),
            "is not in its manifest",
        ),
        ("before its manifest", changed(&|a| a.0.rotate_left(1)), "before its manifest"),
        ("missing", changed(&|a| a.0.retain(|(p, _)| !p.ends_with("runs.parquet"))), "is missing"),
        ("empty", pack(&Archive::default().tar()), "empty"),
        ("cut", packed[..packed.len() / 2].to_vec(), "no whole archive"),
        ("no zstd", good.tar(), "no whole archive"),
        ("something behind", pack(&[good.tar(), b"evil".to_vec()].concat()), "follows the end"),
        ("changed byte", changed(&|a| a.file("runs.parquet")[100] ^= 1), "other bytes"),
        ("shorter", changed(&|a| a.file("runs.parquet").truncate(900)), "bytes and should have"),
        ("bomb", changed(&|a| *a.file("ensemble.nc") = vec![0; 200 << 20]), "unpacks to more than"),
        ("large text", changed(&|a| *a.file("README.md") = vec![b' '; 17 << 20]), "at most"),
        ("newer format", manifest(&|m| m["format_version"] = 2.into()), "format version 2"),
        (
            "other format",
            manifest(&|m| m["format"] = "evil".into()),
            "is not of a melange ensemble",
        ),
        ("unknown member", manifest(&|m| m["evil"] = true.into()), "cannot be read"),
        ("content hash", manifest(&|m| m["content_hash"] = "0".repeat(64).into()), "content hash"),
        (
            "seal of other data",
            manifest(&|m| m["seal"]["content_hash"] = "0".repeat(64).into()),
            "seal is of other data",
        ),
        (
            "false ORCID",
            manifest(&|m| m["seal"]["authors"][0]["orcid"] = "0000-0002-1825-0098".into()),
            "ORCID",
        ),
        ("counts", manifest(&|m| m["sweep"]["counts"]["failed"] = 1.into()), "do not add up"),
        (
            "other counts",
            manifest(&|m| {
                m["sweep"]["counts"]["failed"] = 1.into();
                m["sweep"]["counts"]["converged"] = 3.into();
            }),
            "ended otherwise",
        ),
        (
            "newer schema",
            manifest(&|m| {
                for file in m["files"].as_array_mut().expect("files") {
                    if file["path"] == "runs.parquet" {
                        file["schema_version"] = 99.into();
                    }
                }
            }),
            "use a newer one",
        ),
        (
            "forged id",
            runs(&|b| with_text(&b, "run_id", 1, &"0".repeat(32))),
            "not that of what was solved",
        ),
        ("other parameter", runs(&|b| with_number(&b, "width_m", 1, 4001.0)), "another width_m"),
        ("unknown status", runs(&|b| with_text(&b, "status", 0, "splendid")), "which is none"),
        (
            "not a number",
            runs(&|b| with_number(&b, "force_n_per_m", 0, f64::NAN)),
            "values that no result has",
        ),
        (
            "dictionary bomb",
            runs(&|b| with_text(&b, "detail", 0, &"a".repeat(5 << 20))),
            "a page of",
        ),
        (
            "wrong type",
            runs(&|b| {
                let column = b.column_by_name("force_n_per_m").expect("a column");
                let numbers = column.as_primitive::<arrow_array::types::Float64Type>();
                let texts: Vec<Option<String>> =
                    numbers.iter().map(|n| n.map(|n| n.to_string())).collect();
                with_column(&b, "force_n_per_m", Arc::new(arrow_array::StringArray::from(texts)))
            }),
            "not of the type",
        ),
        (
            "lacks a column",
            runs(&|b| {
                let keep: Vec<usize> = (0..b.num_columns() - 1).collect();
                b.project(&keep).expect("columns")
            }),
            "lacks the column",
        ),
        ("lacks a run", runs(&|b| b.slice(0, b.num_rows() - 1)), "no run of its own"),
        (
            "wrong order",
            runs(&|b| {
                let indices = arrow_array::Int64Array::from(vec![0, 0, 2, 3]);
                with_column(&b, "run_index", Arc::new(indices))
            }),
            "order of their indices",
        ),
        (
            "rows of no run",
            changed(&|a| {
                a.change_table("profiles.parquet", |b| with_text(&b, "run_id", 0, &"0".repeat(32)));
            }),
            "no run of its own",
        ),
        (
            "no Parquet",
            changed(&|a| {
                *a.file("runs.parquet") = vec![b'x'; 1000];
                a.forge_hashes();
                a.change_manifest(|m| {
                    for file in m["files"].as_array_mut().expect("files") {
                        if file["path"] == "runs.parquet" {
                            file["rows"] = 4.into();
                        }
                    }
                });
            }),
            "its footer has",
        ),
        (
            "other spec",
            changed(&|a| {
                *a.file("spec.json") = br#"{"regime": "steady"}"#.to_vec();
                a.forge_hashes();
            }),
            "runs and should have",
        ),
    ]
}

#[test]
fn hostile_archives_are_refused_and_leave_nothing_behind() {
    let from = sealed();
    let good = Archive::read(&from.archive);
    let there = folder();
    let server = Server::start("serve", there.path(), &[]);
    let archive = there.path().join("archive");
    let hostile = hostile(&good);
    assert!(hostile.len() >= 40);
    for (what, bytes, sentence) in &hostile {
        let headers = [("content-type", "application/zstd")];
        let answer = server.post_with("/api/v1/import", &headers, bytes);
        let told = String::from_utf8_lossy(&answer.body).into_owned();
        assert_eq!(answer.status, 422, "{what}: {told}");
        assert!(told.contains(sentence), "{what}: {told}");
        let left: Vec<_> = std::fs::read_dir(&archive).expect("a folder").collect();
        assert!(left.is_empty(), "{what} leaves {left:?}");
    }
    assert_eq!(server.json("/api/v1/sweeps")["total"], 0);
    assert!(!there.path().join("evil.parquet").exists());
    // The command line says the same, with its own exit code; and what is good is taken after all that.
    let bad = there.path().join("bad.tar.zst");
    std::fs::write(&bad, &hostile[0].1).expect("a file");
    assert_eq!(import(&bad, there.path(), &[]).status.code(), Some(2));
    let answer = server.post_with("/api/v1/import", &[], &good.packed());
    assert_eq!(answer.status, 200, "{}", String::from_utf8_lossy(&answer.body));
    assert_eq!(answer.json()["ensembles"][0]["outcome"], "imported");
}

/// Bytes changed at random in a table whose hashes fit again: whatever comes of it, it is an answer.
#[test]
fn tables_that_are_damaged_on_purpose_are_refused_and_break_nothing() {
    let from = sealed();
    let good = Archive::read(&from.archive);
    let there = folder();
    let server = Server::start("serve", there.path(), &[]);
    let mut refused = 0;
    const TRIES: u64 = 300;
    for i in 0..TRIES {
        let mut archive = good.clone();
        let table = ["runs.parquet", "profiles.parquet", "sensitivities.parquet"][i as usize % 3];
        let bytes = archive.file(table);
        let digits = blake3::hash(&i.to_le_bytes());
        let drawn = |k: usize| {
            u64::from_le_bytes(digits.as_bytes()[8 * k..][..8].try_into().expect("8 bytes"))
        };
        // Every other time in the footer, which says where everything is.
        let length = bytes.len() as u64;
        let from = if i % 2 == 0 { 0 } else { length - (length / 3).min(6_000) };
        for k in 0..=(i as usize % 3) {
            let at = (from + drawn(k) % (length - from)) as usize;
            bytes[at] ^= digits.as_bytes()[24 + k].max(1);
        }
        archive.forge_hashes_and_rows(&good);
        let answer = server.post_with("/api/v1/import?dry_run=true", &[], &archive.packed());
        let told = String::from_utf8_lossy(&answer.body).into_owned();
        assert!([200, 422].contains(&answer.status), "{i}: {} {told}", answer.status);
        refused += u64::from(answer.status == 422);
    }
    // What is left are bytes of no meaning, such as statistics, and numbers that are as good as others.
    assert!(refused > TRIES / 2, "{refused}");
    assert_eq!(server.json("/api/v1/sweeps")["total"], 0);
    let left: Vec<_> = std::fs::read_dir(there.path().join("archive")).expect("a folder").collect();
    assert!(left.is_empty(), "{left:?}");
}

#[test]
fn archives_that_are_too_large_are_refused_before_they_are_read() {
    let there = folder();
    let server = Server::start("serve", there.path(), &["--max-import-mib", "1"]);
    let answer = server.post_with("/api/v1/import", &[], &vec![0; 2 << 20]);
    assert_eq!(answer.status, 413);
}

#[test]
fn conflicts_are_named_and_refused_unless_they_are_accepted() {
    let from = sealed();
    let mut forged = Archive::read(&from.archive);
    forged.change_table("runs.parquet", |b| with_number(&b, "force_n_per_m", 1, 1e6));
    let path = from.data.path().join("forged.tar.zst");
    std::fs::write(&path, forged.packed()).expect("a file");
    let told = import(&path, from.data.path(), &[]);
    assert_eq!(told.status.code(), Some(2), "{}", said(&told));
    assert!(
        said(&told).contains("force_n_per_m is") && said(&told).contains("1000000"),
        "{}",
        said(&told)
    );
    let told = import(&path, from.data.path(), &["--dry-run"]);
    assert!(said(&told).contains("1 with others"), "{}", said(&told));
    let told = import(&path, from.data.path(), &["--accept-conflicts"]);
    assert!(told.status.success(), "{}", said(&told));
    assert!(said(&told).contains(&format!("{} imported as", from.id)), "{}", said(&told));
    let server = Server::start("serve", from.data.path(), &[]);
    assert_eq!(server.json("/api/v1/sweeps")["total"], 2);
    let csv = server.get(&format!("/api/v1/sweeps/{}/runs.csv", from.id)).body;
    assert!(!String::from_utf8_lossy(&csv).contains(",1000000.0,"), "the sealed sweep has changed");
}

#[test]
fn what_a_killed_import_left_is_cleared_away() {
    let data = folder();
    let left = data.path().join("archive/import-dead");
    let server = Server::start("serve", data.path(), &[]);
    // It answers, so it hears that it is to end.
    assert_eq!(server.json("/api/v1/sweeps")["total"], 0);
    assert!(server.terminate());
    std::fs::create_dir_all(&left).expect("a folder");
    std::fs::write(left.join("0-runs.parquet.tmp"), b"half").expect("a file");
    let server = Server::start("serve", data.path(), &[]);
    assert!(!left.exists());
    assert_eq!(server.json("/api/v1/sweeps")["total"], 0);
}
