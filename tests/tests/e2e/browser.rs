//! The demo in a real browser: `web/e2e/dashboard.mjs` walks through the page.

use crate::number;
use melange_tests::{Server, folder, root};
use std::process::Command;

#[test]
fn the_demo_shows_its_fit_in_a_browser() {
    let folder = folder();
    let server = Server::start("demo", folder.path(), &[]);
    let sweeps = server.json("/api/v1/sweeps");
    assert_eq!(sweeps["total"], 1);
    let id = sweeps["items"][0]["id"].as_str().expect("an id").to_owned();
    assert_eq!(server.wait(&id)["counts"]["converged"], 51);
    let path = format!("/api/v1/sweeps/{id}/fit?x=melt_rate_m_per_day&y=force_n_per_m");
    let exponent = number(&server.json(&path)["exponent"]["estimate"]);
    assert!((-3.2..-3.1).contains(&exponent), "{exponent}");

    // A note and a tag to be seen.
    let note = "The melt sweep of **Fig. 4**, [here](https://example.org/).\n\n<script>alert(1)</script> \
                <img src=x onerror=alert(1)> ![x](https://example.org/x.png)";
    let edit = serde_json::json!({"tags": ["noted"], "note": note});
    let edited = server.patch(&format!("/api/v1/sweeps/{id}"), &edit.to_string());
    assert_eq!(edited.status, 200);

    let output = Command::new("node")
        .arg(root().join("web/e2e/dashboard.mjs"))
        .arg(&server.address)
        .output()
        .expect("node can be run");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let seen: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let shown = seen["exponent"].as_str().expect("an exponent").replace('−', "-");
    assert_eq!(shown, format!("{exponent:.3}"));
}

#[test]
fn a_second_demo_on_the_same_data_queues_nothing() {
    let folder = folder();
    for _ in 0..2 {
        let server = Server::start("demo", folder.path(), &[]);
        assert_eq!(server.json("/api/v1/sweeps")["total"], 1);
        assert!(server.terminate());
    }
}
