//! Ensembles on the page, in a real browser: `web/e2e/ensembles.mjs` reads, tags, submits, cancels, deletes, brings
//! back and compares; what it read is held against what the service tells.

use super::number;
use melange_tests::{Server, folder, root};
use serde_json::{Value, json};
use std::process::Command;

/// A melt sweep, a grid of which some runs have no steady state, and more ensembles than a page of the list.
fn prepared(server: &Server) -> (String, String) {
    let melt = json!({
        "name": "melt",
        "regime": "steady",
        "axes": [{"parameter": "melt_rate_m_per_day", "linspace": [0.5, 1.0, 11]}],
    });
    let melt = server.submit(&melt);
    let verdicts = json!({
        "name": "verdicts",
        "regime": "steady",
        "axes": [
            {"parameter": "melt_rate_m_per_day", "linspace": [0.5, 1.0, 21]},
            {"parameter": "width_m", "values": [4000, 6000]},
        ],
    });
    let verdicts = server.submit(&verdicts);
    for i in 0..101 {
        server.submit(&json!({"name": format!("one {i}"), "regime": "steady"}));
    }
    server.wait(&melt);
    server.wait(&verdicts);
    (melt, verdicts)
}

fn texts(seen: &Value) -> Vec<&str> {
    seen.as_array().expect("a list").iter().map(|t| t.as_str().expect("a text")).collect()
}

#[test]
fn ensembles_are_looked_after_in_the_browser() {
    let folder = folder();
    let server = Server::start("serve", folder.path(), &[]);
    let (melt, verdicts) = prepared(&server);
    let output = Command::new("node")
        .arg(root().join("web/e2e/ensembles.mjs"))
        .args([&server.address, &melt, &verdicts])
        .output()
        .expect("node can be run");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let seen: Value = serde_json::from_slice(&output.stdout).expect("JSON");

    // The reasons, the largest group first, with their counts.
    let failures = server.json(&format!("/api/v1/sweeps/{verdicts}/failures"));
    let groups = failures["groups"].as_array().expect("groups");
    let reasons = texts(&seen["reasons"]);
    assert!(!groups.is_empty() && reasons.len() == groups.len(), "{reasons:?}");
    for (group, shown) in groups.iter().zip(&reasons) {
        let (count, reason) = (&group["count"], group["reason"].as_str().expect("a reason"));
        assert!(shown.trim().starts_with(&count.to_string()), "{shown}: {count}");
        assert!(shown.contains(reason), "{shown}: {reason}");
    }
    let total = &failures["total"];
    let without = seen["without"].as_str().expect("a sentence");
    assert!(without.trim().starts_with(&format!("{total} runs of 42")), "{without}");
    let first = &groups[0]["examples"][0]["run_index"];
    let place = format!("#/sweep/{verdicts}/profiles?runs={first}");
    assert_eq!(seen["example"], json!(place));
    assert!(seen["facts"].as_str().is_some_and(|f| f.contains("4000 to 6000")), "{seen}");

    // Everything that is offered is there.
    for link in texts(&seen["downloads"]) {
        let path = link.strip_prefix(&server.address).expect("an address of the service");
        assert_eq!(server.get(path).status, 200, "{link}");
    }
    let sweep = server.json(&format!("/api/v1/sweeps/{verdicts}"));
    assert_eq!(sweep["tags"], json!(["seen"]));
    assert_eq!(sweep["note"], json!("Beyond the **threshold**."));
    assert_eq!(seen["listed"], json!(103));

    // What was written by hand arrived as it was written, once.
    let id = seen["submitted"].as_str().expect("an id");
    let submitted = server.json(&format!("/api/v1/sweeps/{id}"));
    assert_eq!(
        submitted["spec"]["fjord"],
        json!({"x_m": [0.0, 40000.0], "width_m": [4000.0, 4400.0]})
    );
    assert_eq!(submitted["spec"]["axes"][0]["linspace"], json!([0.6, 1.0, 6]));
    assert_eq!(submitted["tags"], json!(["form"]));
    assert_eq!(server.json("/api/v1/sweeps?filter=name%20%3D%20%22by%20hand%22")["total"], 1);
    let long = server.json("/api/v1/sweeps?filter=name%20%3D%20%22long%22");
    assert_eq!((&long["total"], &long["items"][0]["state"]), (&json!(1), &json!("cancelled")));

    // The exponents are the service's.
    let exponents = texts(&seen["exponents"]);
    assert_eq!(exponents.len(), 2);
    for (id, shown) in [&melt, &verdicts].into_iter().zip(exponents) {
        let fit =
            server.json(&format!("/api/v1/sweeps/{id}/fit?x=melt_rate_m_per_day&y=force_n_per_m"));
        let exponent = number(&fit["exponent"]["estimate"]);
        assert_eq!(shown.replace('−', "-"), format!("{exponent:.3}"));
    }
    let comparison = seen["comparison"].as_str().expect("a comparison");
    assert_eq!(comparison, "11, of which 11 are the same run");
}
