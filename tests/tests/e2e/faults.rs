//! What is killed starts again and completes: every run once, every table whole, nothing left over.

use melange_tests::melange;
use serde_json::Value;

#[test]
fn sweeps_survive_kills_at_every_step_of_a_commit() {
    const KILLS: u64 = 20;
    let kills = KILLS.to_string();
    let output =
        melange(&["soak", "engine", "--kills", &kills, "--seed", "5", "--format", "json"], "");
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let report: Value = serde_json::from_str(&text).unwrap_or_else(|e| panic!("{e}: {text}"));
    assert_eq!(report["wrong"], serde_json::json!([]), "{report:#}");
    assert_eq!(output.status.code(), Some(0));
    let kills = |kind: &str| report[kind].as_object().expect("kills").clone();
    let total = |kind: &str| kills(kind).values().filter_map(Value::as_u64).sum::<u64>();
    for step in [
        "before_write",
        "after_write",
        "after_fsync",
        "after_rename",
        "in_transaction",
        "after_commit",
    ] {
        assert!(kills("at_step")[step].as_u64() >= Some(2), "{step}: {report:#}");
    }
    assert_eq!(total("at_step") + total("at_random"), KILLS, "{report:#}");
    for kind in ["temporary", "of_chunks"] {
        assert!(report["orphans"][kind].as_u64() > Some(0), "{kind}: {report:#}");
    }
    assert!(report["reused"].as_u64() > Some(0), "no run was taken over: {report:#}");
}
