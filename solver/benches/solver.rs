//! What a user waits for, at N = 50, and how an iteration of Newton's method grows with N:
//! `cargo bench -p melange-solver`.

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use melange_solver::branch::{BranchPlan, BranchPoint};
use melange_solver::control::{Control, Setting};
use melange_solver::diagnostic::{balanced_wedge, wedge};
use melange_solver::forcing::{Course, Forcing};
use melange_solver::melt::MeltShape;
use melange_solver::newton::{Linear, System};
use melange_solver::params::Parameters;
use melange_solver::physics::closure::UpstreamClosure;
use melange_solver::physics::continuity::MassBalance;
use melange_solver::physics::jacobian::Jacobian;
use melange_solver::physics::terminus::Advance;
use melange_solver::physics::{Equations, Problem, Scratch};
use melange_solver::sensitivity::{Linearised, Quantity};
use melange_solver::state::unknowns;
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
    let Ok(SteadyVerdict::Converged { solution, trail }) = solver.steady(None) else {
        panic!("the base case has a steady state");
    };
    c.bench_function("steady, cold", |b| b.iter(|| black_box(solver.steady(None))));
    solver.retarget(model(0.61));
    c.bench_function("steady, from a neighbour", |b| {
        b.iter(|| black_box(solver.steady(Some(&trail))));
    });
    let thickness = wedge(&model(0.6), 75.0);
    c.bench_function("diagnostic", |b| b.iter(|| black_box(solver.diagnostic(&thickness, 1e4))));
    // Fig. 7: from the steady state of 0.6 m d⁻¹ through the first tenth of a year.
    let melt = Course::Sinusoid { mean: 0.6, amplitude: 0.2, period_a: 1.0, phase_a: 0.0 };
    let forcing = Forcing::new(vec![("melt_rate_m_per_day".into(), melt)]).expect("in range");
    let plan = Plan { forcing, ..Plan::fixed(0.01, 10) };
    c.bench_function("ten implicit steps of a season", |b| {
        b.iter(|| {
            let mut go_on = |_: melange_solver::observe::Moment<'_>| ControlFlow::Continue(());
            black_box(solver.transient(solution.state.clone(), &plan, &mut go_on))
        });
    });
}

/// The collapse of linear-shaped melt in a fjord 5,600 m wide, from a mean of 0.35 m d⁻¹ around the fold and
/// back: both branches, growth rates of every point, the fold; and what one steady state's derivatives and
/// growth rates cost.
fn branches(c: &mut Criterion) {
    let mut group = c.benchmark_group("collapse diagram");
    for n_cells in [20, 50] {
        let p = Parameters {
            n_cells,
            melt_rate_m_per_day: 0.35,
            width_m: 5600.0,
            ..Parameters::default()
        };
        let shape = MeltShape::named("linear").expect("a shape's name");
        let model = Model::new(p, UpstreamClosure::Published).expect("parameters are in range");
        let setting = Setting { model: model.with_melt_shape(shape), law: None };
        let melt = Control::named("melt_rate_m_per_day").expect("a control's name");
        let plan = BranchPlan::new(setting, melt, (0.35, 0.5));
        group.bench_with_input(BenchmarkId::from_parameter(n_cells), &plan, |b, plan| {
            b.iter(|| black_box(plan.trace(|_: &BranchPoint| ControlFlow::Continue(()))));
        });
    }
    group.finish();
    let setting = Setting { model: model(0.6), law: None };
    let Ok(SteadyVerdict::Converged { solution, .. }) =
        Solver::new(setting.model.clone()).steady(None)
    else {
        panic!("the base case has a steady state");
    };
    c.bench_function("derivatives of F by everything", |b| {
        b.iter(|| {
            let mut linearised = Linearised::at(&setting, &solution.state).expect("regular");
            black_box(linearised.sensitivity(Quantity::Force))
        });
    });
    c.bench_function("growth rates", |b| {
        let linearised = Linearised::at(&setting, &solution.state).expect("regular");
        b.iter(|| black_box(linearised.spectrum()));
    });
}

/// One iteration: residual and Jacobian, factors, step.
fn iteration(c: &mut Criterion) {
    let mut group = c.benchmark_group("newton iteration");
    for n_cells in [50, 100, 200, 400, 800] {
        let p = Parameters { n_cells, ..Parameters::default() };
        let m = Model::new(p, UpstreamClosure::Published).expect("parameters are in range");
        let (thickness_m, length_m) = balanced_wedge(&m, 100.0);
        let state =
            Solver::new(m.clone()).diagnostic(&thickness_m, length_m).expect("a solve").state;
        let problem = Problem {
            parameters: m.parameters(),
            fjord: m.fjord(),
            melt_shape: m.melt_shape(),
            closure: m.closure(),
            balance: MassBalance::Steady,
            advance: Advance::fixed(0.0),
            smoothing: 1e-3,
            relaxation: None,
        };
        let mut scratch = Scratch::new(n_cells);
        let mut equations = Equations::new(problem, &mut scratch);
        let mut jacobian = Jacobian::zeros(n_cells);
        let (mut x, mut residual) = (vec![0.0; unknowns(n_cells)], vec![0.0; unknowns(n_cells)]);
        state.pack(&mut x);
        group.bench_function(BenchmarkId::from_parameter(n_cells), |b| {
            b.iter(|| {
                equations.linearise(&x, &mut residual, &mut jacobian).expect("in the domain");
                jacobian.factorise().expect("regular");
                jacobian.solve(&mut residual);
                black_box(&residual);
            });
        });
    }
    group.finish();
}

criterion_group!(all, benches, iteration, branches);
criterion_main!(all);
