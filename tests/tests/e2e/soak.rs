//! `melange soak`: nothing fails among parameters drawn at random, and the report does not depend on
//! threads.

use melange_tests::melange;
use serde_json::Value;

fn soak(arguments: &[&str]) -> (Option<i32>, Value) {
    soak_of("solver", arguments)
}

fn soak_of(subject: &str, arguments: &[&str]) -> (Option<i32>, Value) {
    let output = melange(&[&["soak", subject, "--format", "json"], arguments].concat(), "");
    let text = String::from_utf8(output.stdout).expect("UTF-8");
    let report = serde_json::from_str(&text).unwrap_or_else(|e| panic!("{e}: {text}"));
    (output.status.code(), report)
}

#[test]
fn of_500_sets_none_fails_breaks_off_or_is_not_finite() {
    let (code, report) = soak(&["--count", "500", "--seed", "1"]);
    let endings = report["endings"].as_object().expect("endings");
    assert_eq!(endings.values().filter_map(Value::as_u64).sum::<u64>(), 500, "{endings:?}");
    for ending in ["converged", "no_steady_state", "overthick"] {
        assert!(endings[ending].as_u64() > Some(50), "{endings:?}");
    }
    for kind in ["panicked", "not_finite", "failed"] {
        let findings = report[kind].as_array().expect("findings");
        assert!(findings.is_empty(), "{kind}: {findings:#?}");
    }
    assert_eq!(code, Some(0));
}

/// The first thirty branches, of which none gets stuck (of the first six hundred five do).
#[test]
fn branches_reach_their_ends_and_their_stability_is_that_of_transients() {
    let (code, report) = soak_of("branches", &["--count", "30", "--seed", "1"]);
    assert_eq!(code, Some(0), "{report}");
    let number = |value: &Value| value.as_u64().expect("a count");
    let followed = 30 - number(&report["without_start"]);
    let ends = report["ends"].as_object().expect("ends");
    assert_eq!(ends.values().map(number).sum::<u64>(), 2 * followed, "{report}");
    let verdicts = report["verdicts"].as_object().expect("verdicts");
    assert!(number(&verdicts["stable, comes back"]) > 5, "{report}");
    assert!(verdicts.get("contradicted").is_none(), "{report}");
}

#[test]
fn the_report_does_not_depend_on_threads() {
    let known = ["endings", "failed", "panicked", "not_finite", "marches", "contradicted"];
    let reports = ["1", "3"].map(|threads| {
        let count = ["--count", "40", "--seed", "9", "--transients", "2", "--threads", threads];
        let (_, report) = soak(&count);
        known.map(|name| report[name].clone())
    });
    assert_eq!(reports[0], reports[1]);
}

#[test]
fn the_service_is_measured_beside_the_bare_solver() {
    let small = ["--pairs", "1", "--runs-per-side", "8", "--transients", "4"];
    let arguments = [&["soak", "throughput", "--format", "json"], &small[..]].concat();
    let output = melange(&arguments, "");
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let report: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!(report["runs"], 64);
    for side in report["sides"].as_array().expect("sides") {
        for times in ["service_processor", "bare_processor", "bare"] {
            assert!(side[times][0].as_f64() > Some(0.0), "{side}");
        }
        assert!(side["service"][0]["solved"].as_f64() > Some(0.0), "{side}");
    }
    assert!(report["watched"]["health"]["count"].as_u64() > Some(0), "{report}");
    assert!(report["peak_bytes"].as_u64() > Some(1 << 20), "{report}");
    assert_eq!(report["transients"]["runs"], 4);
    assert!(report["transients"]["bytes"]["series"].as_u64() > Some(0), "{report}");
}
