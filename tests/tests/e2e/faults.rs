//! What is killed starts again and completes: every run once, every file readable.

use crate::tables::read;
use arrow_array::cast::AsArray;
use arrow_array::types::Int64Type;
use melange_tests::{Server, assert_counts_add_up, folder};
use serde_json::json;
use std::collections::HashSet;
use std::fs;
use std::hash::{BuildHasher, Hasher, RandomState};
use std::path::Path;
use std::thread::sleep;
use std::time::Duration;

/// Kills, over as many sweeps of melt by width as it takes.
const KILLS: usize = 20;
const MELTS: usize = 100;
const WIDTHS: usize = 50;

/// A number below `n` that nobody can foretell.
fn random(n: u64) -> u64 {
    RandomState::new().build_hasher().finish() % n
}

/// Names of the complete files and of the temporary ones.
fn files(archive: &Path) -> (HashSet<String>, usize) {
    let mut complete = HashSet::new();
    let mut temporary = 0;
    for folder in fs::read_dir(archive).expect("an archive") {
        for file in fs::read_dir(folder.expect("a folder").path()).expect("a folder") {
            let name = file.expect("a file").file_name().to_string_lossy().into_owned();
            if name.ends_with(".parquet") {
                complete.insert(name);
            } else {
                temporary += 1;
            }
        }
    }
    (complete, temporary)
}

#[test]
fn sweeps_survive_being_killed() {
    let folder = folder();
    let spec = json!({
        "name": "melt by width", "regime": "steady",
        "axes": [
            {"parameter": "melt_rate_m_per_day", "linspace": [0.5, 1.0, MELTS]},
            {"parameter": "width_m", "linspace": [3500, 4500, WIDTHS]},
        ],
    });
    let total = (MELTS * WIDTHS) as i64;
    let mut server = Server::start("serve", folder.path(), &[]);
    let mut sweeps = vec![server.submit(&spec)];
    let (mut kills, mut under_way) = (0, 0);
    while kills < KILLS {
        sleep(Duration::from_millis(20 + random(400)));
        let last = sweeps.last().expect("a sweep").clone();
        let sweep = server.json(&format!("/api/v1/sweeps/{last}"));
        assert_counts_add_up(&sweep);
        if sweep["state"] == "complete" {
            sweeps.push(server.submit(&spec));
            continue;
        }
        server.kill();
        kills += 1;
        under_way += usize::from(sweep["state"] == "running");
        server = Server::start("serve", folder.path(), &[]);
    }
    assert!(under_way > KILLS / 2, "only {under_way} kills hit a sweep under way");
    for id in &sweeps {
        let sweep = server.wait(id);
        assert_eq!(sweep["counts"]["converged"], total, "{sweep}");
        let mut seen = HashSet::new();
        for batch in read(server.get(&format!("/api/v1/sweeps/{id}/runs.parquet")).body) {
            let indices = batch.column_by_name("run_index").expect("the column");
            for index in indices.as_primitive::<Int64Type>().values() {
                assert!(seen.insert(*index), "run {index} is stored twice");
            }
        }
        assert_eq!(seen.len() as i64, total);
        let profiles = read(server.get(&format!("/api/v1/sweeps/{id}/profiles.parquet")).body);
        assert_eq!(profiles.iter().map(|b| b.num_rows() as i64).sum::<i64>(), total);
        let listed = server.json(&format!("/api/v1/sweeps/{id}/runs?limit=1"));
        assert_eq!(listed["total"], total);
    }
    assert!(server.terminate());

    // A start clears away what no commit listed; every file that stays can be read.
    let server = Server::start("serve", folder.path(), &[]);
    let archive = folder.path().join("archive");
    let (complete, temporary) = files(&archive);
    assert_eq!(temporary, 0);
    let chunks: HashSet<(String, String)> = fs::read_dir(&archive)
        .expect("an archive")
        .flat_map(|f| fs::read_dir(f.expect("a folder").path()).expect("a folder"))
        .map(|f| {
            let path = f.expect("a file").path();
            read(fs::read(&path).expect("readable"));
            let name = path.file_name().expect("a name").to_string_lossy().into_owned();
            let sweep = path.parent().and_then(Path::file_name).expect("a folder");
            (sweep.to_string_lossy().into_owned(), name[..6].to_owned())
        })
        .collect();
    // Runs and profiles of each chunk, and nothing besides.
    assert_eq!(complete.len(), 2 * chunks.len());
    drop(server);
}
