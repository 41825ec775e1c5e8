//! The interface against its own description: requests that a program makes up from the OpenAPI document, good
//! and bad ones, are answered as the document says, and never by a failure.

use super::melt_sweep;
use melange_tests::{Server, folder, root};
use std::fs;
use std::path::Path;
use std::process::Command;

/// What must hold of every answer. That valid requests are taken is not asked: a document cannot say what a
/// filter's grammar is, nor that a name was not taken before.
const CHECKS: &str = "not_a_server_error,status_code_conformance,content_type_conformance,\
                      response_schema_conformance,negative_data_rejection";

/// Has requests made up, with what there is in place of ids; all but streams of events, which do not end.
fn made_up(server: &Server, token: &str, config: &Path, more: &[&str]) {
    let output = Command::new(root().join("target/python/bin/python"))
        .args(["-m", "schemathesis.cli", "--config-file"])
        .arg(config)
        .arg("run")
        .arg(format!("{}/api/v1/openapi.json", server.address))
        .args(["--header", &format!("Authorization: Bearer {token}"), "--checks", CHECKS])
        .args(["--phases", "coverage,fuzzing", "--seed", "1", "--generation-database", "none"])
        .args(["--exclude-path-regex", "events$", "--warnings", "off", "--no-color"])
        .args(more)
        .current_dir(config.parent().expect("a folder"))
        .output()
        .expect("Python starts");
    let told = String::from_utf8_lossy(&output.stdout);
    let about = told.find("FAILURES").map_or(told.as_ref(), |at| &told[at..]);
    assert!(output.status.success(), "{about}\n{}", String::from_utf8_lossy(&output.stderr));
    let tested = told.lines().filter_map(|line| line.trim().strip_prefix("Tested: ")).next();
    let tested: usize = tested.expect("a summary").parse().expect("a number");
    assert!(tested > 0, "{told}");
}

#[test]
fn made_up_requests_are_answered_as_documented() {
    let folder = folder();
    let server = Server::start("serve", folder.path(), &["--max-runs", "1000"]);
    let id = server.submit(&melt_sweep(3));
    server.wait(&id);
    let run = server.json(&format!("/api/v1/sweeps/{id}/runs"))["items"][0]["run_id"].clone();
    let run = run.as_str().expect("an id");
    // Made-up people come and go; this token stays, and closes the service for whoever has none.
    let token = fs::read_to_string(folder.path().join("operator-token")).expect("a token");
    super::people::add(folder.path(), "ada", "admin");
    let config = folder.path().join("schemathesis.toml");
    let known = format!(
        "[[operations]]\ninclude-path-regex = '/sweeps/\\{{id\\}}'\nparameters = {{ \"path.id\" = \"{id}\" }}\n\
         [[operations]]\ninclude-path-regex = '/runs/\\{{id\\}}'\nparameters = {{ \"path.id\" = \"{run}\" }}\n"
    );
    fs::write(&config, known).expect("a file");
    made_up(&server, &token, &config, &["--max-examples", "8", "--exclude-method", "DELETE"]);
    made_up(&server, &token, &config, &["--max-examples", "4", "--include-method", "DELETE"]);
    assert_eq!(server.get("/health").status, 200);
    assert!(server.terminate());
}
