//! What a user waits for, at N = 50: `cargo bench -p melange-solver`.

use criterion::{Criterion, criterion_group, criterion_main};
use melange_solver::diagnostic::wedge;
use melange_solver::params::Parameters;
use melange_solver::physics::closure::UpstreamClosure;
use melange_solver::steady::SteadyVerdict;
use melange_solver::transient::Plan;
use melange_solver::{Model, Solver};
use std::hint::black_box;
use std::ops::ControlFlow;

fn model(melt_rate_m_per_day: f64) -> Model {
    let p = Parameters { melt_rate_m_per_day, ..Parameters::default() };
    Model::new(p, UpstreamClosure::Published).expect("parameters are in range")
}

fn benches(c: &mut Criterion) {
    let mut solver = Solver::new(model(0.6));
    let Ok(SteadyVerdict::Converged { solution, first_level }) = solver.steady(None) else {
        panic!("the base case has a steady state");
    };
    c.bench_function("steady, cold", |b| b.iter(|| black_box(solver.steady(None))));
    solver.retarget(model(0.61));
    c.bench_function("steady, from a neighbour", |b| {
        b.iter(|| black_box(solver.steady(Some(&first_level))));
    });
    let thickness = wedge(&model(0.6), 75.0);
    c.bench_function("diagnostic", |b| b.iter(|| black_box(solver.diagnostic(&thickness, 1e4))));
    c.bench_function("ten implicit steps", |b| {
        b.iter(|| {
            let plan = Plan::fixed(0.01, 10);
            let mut go_on = |_: melange_solver::observe::Moment<'_>| ControlFlow::Continue(());
            black_box(solver.transient(solution.state.clone(), &plan, &mut go_on))
        });
    });
}

criterion_group!(all, benches);
criterion_main!(all);
