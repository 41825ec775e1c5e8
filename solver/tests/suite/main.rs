//! Tests of the solver: each equation against differences, the linear algebra against a dense solve,
//! whole solves against published numbers.

mod allocations;
mod branches;
mod calibration;
mod diagnose;
mod fjord;
mod forcing;
mod interpolate;
mod jacobian;
mod linear_algebra;
mod melt;
mod parameters;
mod quasi_static;
mod reference;
mod roots;
mod sampling;
mod sensitivities;
mod sidewall;
mod stability;
mod transients;
mod verdicts;

use melange_solver::params::Parameters;
use melange_solver::physics::closure::UpstreamClosure;
use melange_solver::steady::SteadyVerdict;
use melange_solver::{Model, Solution, Solver};

fn model(change: impl FnOnce(&mut Parameters)) -> Model {
    let mut p = Parameters::default();
    change(&mut p);
    Model::new(p, UpstreamClosure::Published).expect("the test's parameters are in range")
}

fn converged(verdict: SteadyVerdict) -> Solution {
    match verdict {
        SteadyVerdict::Converged { solution, .. } => solution,
        other => panic!("expected a steady state, got {other:?}"),
    }
}

fn steady(model: &Model) -> Solution {
    converged(Solver::new(model.clone()).steady(None).expect("the solve ends in a verdict"))
}

fn assert_close(what: &str, got: f64, expected: f64, relative: f64) {
    let error = (got - expected).abs() / expected.abs();
    assert!(error <= relative, "{what}: {got} is not {expected} (relative error {error:.2e})");
}

fn assert_all_close(what: &str, got: &[f64], expected: &[f64], relative: f64) {
    assert_eq!(got.len(), expected.len(), "{what}");
    for (i, (g, e)) in got.iter().zip(expected).enumerate() {
        assert_close(&format!("{what}[{i}]"), *g, *e, relative);
    }
}
