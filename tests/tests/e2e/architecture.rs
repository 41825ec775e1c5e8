//! The rooms and their doors: ARCHITECTURE.md's table of who may import whom, and the habits that a
//! machine can check.

use melange_tests::root;
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// Files below a folder with an ending, without what is built or fetched.
fn files(folder: &Path, endings: &[&str], found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        let name = path.file_name().expect("a name").to_string_lossy().into_owned();
        if path.is_dir() {
            if !["target", "node_modules", ".git", "dist", "generated"].contains(&name.as_str()) {
                files(&path, endings, found);
            }
        } else if endings.iter().any(|e| name.ends_with(e)) {
            found.push(path);
        }
    }
}

fn sources(folder: &str, endings: &[&str]) -> Vec<(String, String)> {
    let mut found = Vec::new();
    files(&root().join(folder), endings, &mut found);
    found
        .into_iter()
        .map(|path| {
            let text = fs::read_to_string(&path).expect("UTF-8");
            let name = path.strip_prefix(root()).expect("below the root").display().to_string();
            (name, text)
        })
        .collect()
}

/// The rows `| room | … | may import |` of ARCHITECTURE.md's table.
fn table() -> Vec<(String, BTreeSet<String>)> {
    let text =
        fs::read_to_string(root().join("ARCHITECTURE.md")).expect("ARCHITECTURE.md is there");
    text.lines()
        .skip_while(|line| !line.starts_with("| room |"))
        .skip(2)
        .take_while(|line| line.starts_with('|'))
        .map(|line| {
            let cells: Vec<&str> = line.split('|').map(str::trim).collect();
            let room = cells[1].trim_matches('`').to_owned();
            let may = cells[3].split(',').map(|r| r.trim().trim_matches('`').to_owned());
            (room, may.filter(|r| !r.is_empty() && r != "nothing").collect())
        })
        .collect()
}

#[test]
fn rooms_import_only_what_the_table_allows() {
    let table = table();
    assert!(table.len() >= 8, "the table of ARCHITECTURE.md was not found: {table:?}");
    let rooms: BTreeSet<String> = table.iter().map(|(room, _)| room.clone()).collect();
    let mut checked = 0;
    for (name, text) in sources("server/src", &[".rs"]) {
        let inner = name.trim_start_matches("server/src/");
        let room = inner.split('/').next().expect("a room").trim_end_matches(".rs");
        if room == "main" {
            continue;
        }
        let (_, may) = table
            .iter()
            .find(|(r, _)| r == room)
            .unwrap_or_else(|| panic!("the room {room} is not in ARCHITECTURE.md's table"));
        assert!(
            !text.contains("crate::{"),
            "{name}: import each room by itself, so that doors can be seen"
        );
        for (used, place) in text.match_indices("crate::").map(|(at, _)| {
            let rest = &text[at + "crate::".len()..];
            let end = rest.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(rest.len());
            (rest[..end].to_owned(), at)
        }) {
            if used == room || !rooms.contains(&used) {
                continue;
            }
            let line = text[..place].lines().count();
            assert!(may.contains(&used), "{name}:{line}: {room} may not import {used}");
            checked += 1;
        }
        let uses_solver = text.contains("melange_solver");
        assert!(!uses_solver || may.contains("solver"), "{name}: {room} may not import the solver");
        let uses_sql = text.contains("sqlx::query") || text.contains("QueryBuilder");
        let may_sql =
            ["/queue/", "/archive/catalogue/", "/people/"].iter().any(|room| name.contains(room));
        assert!(
            !uses_sql || may_sql,
            "{name}: SQL stands in queue, archive/catalogue and people only"
        );
    }
    assert!(checked > 20, "only {checked} imports were seen");
}

#[test]
fn the_solver_is_pure() {
    for (name, text) in sources("solver/src", &[".rs"]) {
        for forbidden in [
            "println!",
            "eprintln!",
            "std::env",
            "std::fs",
            "std::time",
            "std::thread",
            "std::process",
        ] {
            assert!(!text.contains(forbidden), "{name} uses {forbidden}");
        }
    }
}

#[test]
fn every_file_says_what_it_is_for() {
    for folder in ["solver", "server", "tests"] {
        for (name, text) in sources(folder, &[".rs"]) {
            assert!(text.starts_with("//! "), "{name} does not start with `//! `");
        }
    }
    for (name, text) in sources("web/src", &[".ts", ".css"]) {
        assert!(
            text.starts_with("// ") || text.starts_with("/* "),
            "{name} does not say what it is for"
        );
    }
}

#[test]
fn no_room_is_crowded_and_no_test_is_ignored() {
    /// Lines at which a file wants splitting.
    const CROWDED: usize = 500;
    for folder in ["solver", "server", "tests", "web"] {
        for (name, text) in sources(folder, &[".rs", ".ts", ".svelte", ".css", ".mjs"]) {
            let lines = text.lines().count();
            assert!(lines <= CROWDED, "{name} has {lines} lines");
            assert!(!text.contains(concat!("#[", "ignore")), "{name} ignores a test");
        }
    }
}

/// One module of the dashboard knows the plotting library, and one file sends requests.
#[test]
fn the_dashboard_has_one_chart_module_and_one_client() {
    let chart = ["echarts.ts", "plane.ts", "layers.ts", "parallel.ts"];
    for (name, text) in sources("web/src", &[".ts", ".svelte"]) {
        let is_chart = chart.iter().any(|file| name.ends_with(&format!("src/chart/{file}")));
        assert!(is_chart || !text.contains("from \"echarts"), "{name} knows the plotting library");
        let is_client = name.ends_with("src/api/client.ts") || name.ends_with("src/api/index.ts");
        assert!(is_client || !text.contains("fetch("), "{name} sends requests of its own");
    }
}

/// A file of tests that nobody lists is never run.
#[test]
fn every_file_of_tests_is_listed() {
    let main = fs::read_to_string(root().join("tests/tests/e2e/main.rs")).expect("main.rs");
    for entry in fs::read_dir(root().join("tests/tests/e2e")).expect("a folder") {
        let path = entry.expect("an entry").path();
        let name = path.file_stem().expect("a name").to_string_lossy().into_owned();
        let is_listed = main.contains(&format!("mod {name};"));
        assert!(name == "main" || is_listed, "{} is not listed in main.rs", path.display());
    }
}
