//! Runs whose first attempt fails, as they were found among parameters drawn at random.

use super::*;
use crate::domain::document::Document;
use crate::domain::outcome::Series;
use serde_json::{Value, json};

fn run(document: &Value) -> RunSpec {
    let document = Document::parse(&document.to_string()).expect("a document");
    document.into_run().expect("a run")
}

fn solve(walker: &mut Walker, document: &Value) -> Outcome {
    let none = Err("there is no archive");
    walker.solve(&run(document), none, &|| false).expect("nobody stops it")
}

/// A mélange of small icebergs, of which no start's velocities are found.
fn hard(mu_s: f64) -> Value {
    json!({
        "regime": "steady",
        "fjord": {"x_m": [0, 40000], "width_m": [10194.70155496624, 13248.214662347938],
            "beyond": "constant"},
        "melt_shape": "linear",
        "parameters": {
            "terminus_velocity_m_per_a": 2506.572518119473, "calving_rate_m_per_a": 2506.572518119473,
            "terminus_thickness_m": 382.8248677584727, "melt_rate_m_per_day": 0.3268941880536674,
            "d_m": 5.9539711959213175, "b": 1428.1101113326897, "A": 0.11591818385015412,
            "mu_s": mu_s, "water_drag_n_per_m": 129633.35266581041, "n_cells": 34,
        },
    })
}

const HARD: f64 = 0.1846604258104894;

#[test]
fn a_failed_run_keeps_its_parameters_its_reason_and_its_residuals() {
    let outcome = solve(&mut Walker::default(), &hard(HARD));
    assert_eq!((outcome.status, outcome.attempts), (Status::Failed, 1), "{}", outcome.detail);
    assert!(outcome.detail.contains("no step lowers the residual"), "{}", outcome.detail);
    assert_eq!(outcome.parameters.0.mu_s, HARD);
    let history = outcome.residual_history.expect("a solve that gave up has residuals");
    assert!(history.len() > 1 && history.iter().all(|r| r.is_finite() && *r > 0.0), "{history:?}");
    let told = history.iter().rev().take(2).map(|r| format!("{r:.2e}"));
    assert!(told.into_iter().all(|r| outcome.detail.contains(&r)), "{}", outcome.detail);
}

#[test]
fn a_steady_state_is_found_by_continuation_from_a_neighbour() {
    let mut walker = Walker::default();
    let neighbour = solve(&mut walker, &hard(1.3 * HARD));
    assert_eq!((neighbour.status, neighbour.attempts), (Status::Converged, 1));
    assert_eq!(
        neighbour.detail, "steady state, picked by the limit of the smoothed rheology",
        "a first attempt says nothing of attempts"
    );
    let outcome = solve(&mut walker, &hard(HARD));
    assert_eq!((outcome.status, outcome.attempts), (Status::Converged, 2), "{}", outcome.detail);
    let how = "; found at the second attempt, by continuation from a neighbour in ";
    assert!(outcome.detail.contains(how), "{}", outcome.detail);
    assert_eq!((outcome.residual_history, outcome.parameters.0.mu_s), (None, HARD));
    let length_m = outcome.scalars.length_m.expect("a length");
    assert!((length_m - 6241.4166).abs() < 1e-3, "{length_m}");
    // From the other side it is the same state.
    let mut walker = Walker::default();
    solve(&mut walker, &hard(1.6 * HARD));
    let again = solve(&mut walker, &hard(HARD));
    let again_m = again.scalars.length_m.expect("a length");
    assert!((again_m / length_m - 1.0).abs() < 1e-9, "{again_m} {length_m}");
}

#[test]
fn a_stop_is_heard_between_attempts() {
    let mut walker = Walker::default();
    solve(&mut walker, &hard(1.3 * HARD));
    assert_eq!(walker.solve(&run(&hard(HARD)), Err("no archive"), &|| true), None);
}

/// A long thin pack in a narrow fjord, and one that is so thin that no way leads there.
#[test]
fn a_diagnostic_solve_is_found_by_way_of_other_geometries() {
    let outcome = solve(
        &mut Walker::default(),
        &json!({
            "regime": "diagnostic",
            "start": {"length_m": 22749.433254947875, "thickness_0_m": 63.910953731167865},
            "parameters": {
                "terminus_velocity_m_per_a": 5999.265512540525,
                "calving_rate_m_per_a": 5999.265512540525, "terminus_thickness_m": 598.2317218615266,
                "width_m": 1871.6165128967882, "d_m": 50.40431864048197, "b": 634363.5198362618,
                "A": 9.123349502500988, "mu_s": 0.3087295820802215,
                "water_drag_n_per_m": 1042.8916217347073, "n_cells": 20,
            },
        }),
    );
    assert_eq!((outcome.status, outcome.attempts), (Status::Converged, 2), "{}", outcome.detail);
    let how = "; found at the second attempt, by way of other geometries in 1 step";
    assert!(outcome.detail.ends_with(how), "{}", outcome.detail);
    assert_eq!(outcome.residual_history, None);

    let outcome = solve(
        &mut Walker::default(),
        &json!({
            "regime": "diagnostic",
            "start": {"length_m": 55301.16227182292, "thickness_0_m": 48.68474521876028},
            "parameters": {
                "terminus_velocity_m_per_a": 13586.620417005974,
                "calving_rate_m_per_a": 13586.620417005974, "terminus_thickness_m": 420.4461401049517,
                "width_m": 1657.1945344504538, "d_m": 41.61107591579405, "b": 6814.16694014361,
                "A": 9.693229340519965, "mu_s": 0.37295021235170933, "n_cells": 13,
            },
        }),
    );
    assert_eq!((outcome.status, outcome.attempts), (Status::Failed, 2), "{}", outcome.detail);
    assert!(outcome.detail.ends_with("; tried again by way of other geometries"));
    assert!(outcome.residual_history.is_some());
}

/// A transient that no accuracy takes past t = 0.009 a: its rows are those of one attempt.
#[test]
fn a_transient_that_fails_at_every_accuracy_has_the_rows_of_one_attempt() {
    let document = json!({
        "regime": "transient",
        "start": {"run": "00000000000000000000000000000000"},
        "time": {"duration_a": 5, "tolerance": 1e-4},
        "fjord": {"x_m": [0, 10000, 20000, 30000, 40000], "beyond": "constant",
            "width_m": [11516.767994855249, 16584.281855686444, 11967.491612930993,
                10410.251418969574, 17151.874303203444]},
        "melt_shape": "linear",
        "options": {"upstream_closure": "no_stretching"},
        "parameters": {
            "terminus_velocity_m_per_a": 13237.37629055673, "calving_rate_m_per_a": 13237.37629055673,
            "terminus_thickness_m": 234.48322745406466, "melt_rate_m_per_day": 1.2973181729471899,
            "d_m": 32.96217468077431, "b": 27094.607664275656, "A": 3.148458256047182,
            "mu_s": 0.13650871152524088, "n_cells": 44,
        },
    });
    let run = run(&document);
    let (thickness_m, length_m) = diagnostic::balanced_wedge(&run.model, 56.26456923405892);
    let profile = Profile { node_x_m: vec![0.0, length_m], thickness_m, ..Profile::default() };
    let start = StoredStart { profile, terminus_x_m: 0.0 };
    let outcome = Walker::default().solve(&run, Ok(&start), &|| false).expect("nobody stops it");
    assert_eq!((outcome.status, outcome.attempts), (Status::Failed, 3), "{}", outcome.detail);
    let how = "; tried again with steps of tolerance 1.0e-5 and with steps of tolerance 1.0e-6";
    assert!(outcome.detail.ends_with(how), "{}", outcome.detail);
    let Series { time_a, .. } = outcome.series.expect("rows");
    assert!(time_a.len() > 1 && time_a.windows(2).all(|t| t[0] < t[1]), "{time_a:?}");
}

#[test]
fn branches_folds_and_calibrations_stop_when_told_to() {
    let along = json!({"control": "melt_rate_m_per_day", "from": 0.1, "to": 2.0});
    let mut folds = along.clone();
    for (name, value) in [("second_from", 2e3), ("second_to", 8e3)] {
        folds[name] = value.into();
    }
    folds["second"] = "width_m".into();
    let observed = json!([{"quantity": "length_m", "value": 1e4, "standard_error": 10}]);
    let found = json!({"parameters": {"b": [1e3, 1e5]}, "observations": observed});
    for (regime, member) in [("branch", along), ("fold_curve", folds), ("calibration", found)] {
        let parameters = json!({"melt_rate_m_per_day": 0.35, "width_m": 5600, "n_cells": 20});
        let mut document =
            json!({"regime": regime, "melt_shape": "linear", "parameters": parameters});
        document[regime] = member;
        let run = run(&document);
        for after in [0, 3] {
            let asked = std::cell::Cell::new(0);
            let stop = || {
                asked.set(asked.get() + 1);
                asked.get() > after
            };
            let none = Err("there is no archive");
            assert_eq!(Walker::default().solve(&run, none, &stop), None, "{regime}, {after}");
            assert!(asked.get() < after + 5, "{regime} asks {} times", asked.get());
        }
    }
}

/// A run found by continuation comes out again from the way it continued, and so does one that is beside another.
#[test]
fn a_solve_is_repeated_from_what_it_began_from() {
    let mut walker = Walker::default();
    let chain = [hard(1.3 * HARD), hard(HARD), hard(0.98 * HARD)];
    let outcomes: Vec<(Outcome, Began)> = chain
        .iter()
        .map(|document| {
            let outcome = solve(&mut walker, document);
            (outcome, walker.began())
        })
        .collect();
    assert_eq!(outcomes[0].1, Began::Own);
    assert_eq!(outcomes[1].1, Began::From(0));
    assert!(matches!(outcomes[2].1, Began::Beside(1) | Began::From(_)), "{:?}", outcomes[2].1);

    let mut first = Walker::default();
    first.find_way(&run(&chain[0]), &|| false);
    let mut ways = vec![first.way().expect("it is found")];
    for (document, (outcome, began)) in chain.iter().zip(&outcomes).skip(1) {
        let (_, from) = began.told();
        let from = &ways[from.expect("another")];
        let mut again = Walker::beginning(from, matches!(began, Began::Beside(_)));
        assert_eq!(&solve(&mut again, document), outcome);
        assert_eq!(again.began().told().0, began.told().0);
        ways.push(again.way().expect("it is found"));
    }
    let mut alone = Walker::default();
    assert_eq!(solve(&mut alone, &chain[1]).status, Status::Failed);
    assert!(alone.way().is_none());
}
