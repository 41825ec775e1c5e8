//! Sealed sweeps: they never change again, need no other sweep's files, and can be cited.

use crate::melt_sweep;
use melange_tests::{Server, folder, melange};
use serde_json::{Value, json};

/// What the tests seal with.
pub fn form() -> Value {
    json!({
        "title": "Melt & force, 100 % of {it}",
        "authors": [
            {"name": "Ada van der Berg", "orcid": "https://orcid.org/0000-0002-1825-0097", "affiliation": "ETH Zürich"},
            {"name": "Núñez, Óscar"},
        ],
        "licence": "CC-BY-4.0",
        "description": "A test.",
    })
}

/// Seals a sweep, which must be allowed; returns it.
pub fn seal(server: &Server, id: &str) -> Value {
    let answer = server.post(&format!("/api/v1/sweeps/{id}/seal"), &form().to_string());
    assert_eq!(answer.status, 200, "{}", String::from_utf8_lossy(&answer.body));
    answer.json()
}

#[test]
fn a_sealed_sweep_is_whole_and_refuses_every_change() {
    let data = folder();
    let server = Server::start("serve", data.path(), &[]);
    let before = server.submit(&melt_sweep(6));
    server.wait(&before);
    // Overlaps with the first one, and has a point twice.
    let table =
        json!({"columns": ["melt_rate_m_per_day"], "rows": [[0.5], [0.63], [0.5], [0.7], [0.63]]});
    let id = server
        .submit(&json!({"name": "sealed", "tags": ["t"], "regime": "steady", "table": table}));
    server.wait(&id);
    let guest = server.submit(&json!({"regime": "steady", "axes": [{"parameter": "melt_rate_m_per_day", "values": [0.63, 0.9]}]}));
    server.wait(&guest);
    let path = format!("/api/v1/sweeps/{id}");
    let tables = |id: &str| {
        ["runs.csv", "profiles.parquet"]
            .map(|t| server.get(&format!("/api/v1/sweeps/{id}/{t}")).body)
    };
    let (runs, guests) = (tables(&id)[0].clone(), tables(&guest));
    for what in ["manifest", "citation", "ro-crate-metadata.json"] {
        assert_eq!(server.get(&format!("{path}/{what}")).status, 409, "{what}");
    }
    let wrong = json!({"title": "", "authors": [{"name": "A B"}], "licence": "CC-BY-4.0"});
    let refused = server.post(&format!("{path}/seal"), &wrong.to_string());
    assert_eq!((refused.status, refused.json()["field"].clone()), (422, "title".into()));
    let unknown = server.post(&format!("{path}/seal"), r#"{"title": "t", "author": []}"#);
    assert!([400, 422].contains(&unknown.status), "{unknown:?}");

    let sealed = seal(&server, &id);
    let hash = sealed["sealed"]["content_hash"].as_str().expect("a hash").to_owned();
    assert_eq!(sealed["sealed"]["authors"][0]["orcid"], "0000-0002-1825-0097");
    assert_eq!(server.json(&path)["sealed"], sealed["sealed"]);
    assert_eq!(server.json(&format!("/api/v1/ensembles/{hash}"))["id"], id.as_str());
    assert_eq!(server.get("/api/v1/ensembles/0123").status, 404);
    assert_eq!(tables(&id)[0], runs, "sealing has changed the runs");
    assert_eq!(tables(&guest)[0], guests[0], "sealing has changed who lives there");
    let run = |id: &str| {
        let page = server.json(&format!("/api/v1/sweeps/{id}/runs?limit=1"));
        let run = page["items"][0]["run_id"].as_str().expect("an id").to_owned();
        server.json(&format!("/api/v1/runs/{run}"))
    };
    assert_eq!(run(&id)["profile"]["cell_x_m"].as_array().map(Vec::len), Some(50));
    assert_eq!(run(&guest)["profile"]["cell_x_m"].as_array().map(Vec::len), Some(50));

    for verb in ["pause", "resume", "stop", "cancel", "retry"] {
        assert_eq!(server.post(&format!("{path}/{verb}"), "").status, 409, "{verb}");
    }
    assert_eq!(server.delete(&path).status, 409);
    let again = server.post(&format!("{path}/seal"), &form().to_string());
    assert_eq!(again.status, 409);
    assert_eq!(server.json(&path), sealed_again(&sealed, &server.json(&path)));

    // The sweep it took its runs from goes, and it stays as it is.
    assert_eq!(server.delete(&format!("/api/v1/sweeps/{before}")).status, 204);
    let manifest = server.json(&format!("{path}/manifest"));
    let mut files = manifest["files"].as_array().expect("files").iter();
    let profiles = files.find(|f| f["path"] == "profiles.parquet").expect("profiles");
    assert_eq!(profiles["rows"], 3, "the rows of a run stand once");
    let downloaded = &tables(&id)[1];
    assert_eq!(profiles["blake3"], blake3::hash(downloaded).to_hex().as_str());
    let crated = server.json(&format!("{path}/ro-crate-metadata.json"));
    let graph = crated["@graph"].as_array().expect("a graph");
    assert!(graph.iter().any(|e| e["@id"] == "https://orcid.org/0000-0002-1825-0097"));
    let bibtex = String::from_utf8(server.get(&format!("{path}/citation")).body).expect("UTF-8");
    assert!(bibtex.contains("{van der Berg, Ada and Núñez, Óscar}"), "{bibtex}");
    assert!(
        bibtex.contains(r"{{Melt \& force, 100 \% of \textbraceleft{}it\textbraceright{}}}"),
        "{bibtex}"
    );
    let csl = server.json(&format!("{path}/citation?format=csl"));
    assert_eq!(csl[0]["author"][0]["non-dropping-particle"], "van der");
    assert!(server.terminate());

    let verified = melange(&["verify", "--data", data.path().to_str().expect("UTF-8")], "");
    assert!(verified.status.success(), "{}", String::from_utf8_lossy(&verified.stdout));
}

/// A sweep after refused changes: what it was.
fn sealed_again(sealed: &Value, now: &Value) -> Value {
    let mut expected = now.clone();
    for member in ["state", "counts", "sealed", "owner", "priority", "tags"] {
        expected[member] = sealed[member].clone();
    }
    expected
}

#[test]
fn the_command_line_seals_with_and_without_a_service() {
    let data = folder();
    let path = data.path().to_str().expect("UTF-8");
    let server = Server::start("serve", data.path(), &[]);
    let ids = [3, 4].map(|n| {
        let id = server.submit(&melt_sweep(n));
        server.wait(&id);
        id
    });
    let seal = |id: &str, licence: &str| {
        let author = "Ada Lovelace <0000-0002-1825-0097> (ETH)";
        melange(
            &["seal", id, "--title", "T", "--author", author, "--licence", licence, "--data", path],
            "",
        )
    };
    let told = seal(&ids[0], "mine");
    assert_eq!(told.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&told.stderr).contains("CC-BY-4.0"));
    assert!(seal(&ids[0], "CC0-1.0").status.success());
    assert_eq!(server.json(&format!("/api/v1/sweeps/{}", ids[0]))["sealed"]["title"], "T");
    assert!(server.terminate());
    assert!(seal(&ids[1], "CC0-1.0").status.success());
    assert_eq!(seal(&ids[1], "CC0-1.0").status.code(), Some(2));
    assert_eq!(melange(&["delete", &ids[1], "--data", path], "").status.code(), Some(2));
}

#[test]
fn a_damaged_sealed_file_is_told_and_not_solved_again() {
    let data = folder();
    let path = data.path().to_str().expect("UTF-8");
    let server = Server::start("serve", data.path(), &[]);
    let id = server.submit(&melt_sweep(3));
    server.wait(&id);
    seal(&server, &id);
    let guest = server.submit(&melt_sweep(3));
    assert_eq!(server.wait(&guest)["reused"], 3);
    assert!(server.terminate());
    let files = std::fs::read_dir(data.path().join("archive").join(&id)).expect("a folder");
    let file =
        files.map(|f| f.expect("a file").path()).find(|f| f.display().to_string().contains("runs"));
    let file = file.expect("a table of runs");
    let whole = std::fs::read(&file).expect("its bytes");
    std::fs::write(&file, &whole[1..]).expect("damage");
    let told = melange(&["verify", "--repair", "--data", path], "");
    let text = String::from_utf8_lossy(&told.stdout).into_owned();
    assert_eq!(told.status.code(), Some(1), "{text}");
    assert!(text.contains("it is sealed and is not solved again"), "{text}");
    // Who took its runs over gets them solved again, and so does whoever asks for them now.
    let server = Server::start("serve", data.path(), &[]);
    assert_eq!(server.wait(&guest)["reused"], 0);
    let csv = |id: &str| server.get(&format!("/api/v1/sweeps/{id}/runs.csv"));
    assert_eq!((csv(&guest).status, csv(&id).status), (200, 500));
    assert!(server.terminate());
    std::fs::write(&file, &whole).expect("a backup");
    assert!(melange(&["verify", "--repair", "--data", path], "").status.success());
    let server = Server::start("serve", data.path(), &[]);
    assert_eq!(server.get(&format!("/api/v1/sweeps/{id}/runs.csv")).status, 200);
    assert!(server.terminate());
    let listed =
        String::from_utf8_lossy(&melange(&["sweeps", "--data", path], "").stdout).into_owned();
    assert!(listed.contains("3 converged"), "{listed}");
}

#[test]
fn a_sweep_with_cancelled_runs_is_not_sealed() {
    let data = folder();
    let server = Server::start("serve", data.path(), &["--workers", "1"]);
    let mut sweep = melt_sweep(2_000);
    sweep["parameters"] = json!({"n_cells": 200});
    let id = server.submit(&sweep);
    let path = format!("/api/v1/sweeps/{id}/seal");
    assert_eq!(server.post(&path, &form().to_string()).status, 409, "it is running");
    server.ask(&id, "cancel");
    let refused = server.post(&path, &form().to_string());
    assert_eq!(refused.status, 409);
    assert!(refused.json()["detail"].as_str().is_some_and(|d| d.contains("cancelled")));
}
