//! Every slope of every equation against central differences.

use crate::linear_algebra::dense_solve;
use crate::model;
use melange_solver::Model;
use melange_solver::fjord::Fjord;
use melange_solver::interpolate::{Beyond, Linear, Monotone};
use melange_solver::melt::{Frame, MeltShape};
use melange_solver::newton::{Linear as _, System};
use melange_solver::params::Parameters;
use melange_solver::physics::closure::UpstreamClosure;
use melange_solver::physics::continuity::{Before, MassBalance};
use melange_solver::physics::fluidity::Relaxation;
use melange_solver::physics::jacobian::Jacobian;
use melange_solver::physics::quasi_static::Size;
use melange_solver::physics::sidewall;
use melange_solver::physics::terminus::{Advance, CalvingLaw};
use melange_solver::physics::{Equations, Problem, Scratch};
use melange_solver::state::{State, unknowns};

const N: usize = 12;

/// A state with no symmetry and no cell on a kink: stretching and compressing, yielding and not.
fn uneven_state() -> State {
    let mut s = State::zeros(N);
    s.length_m = 9_300.0;
    for j in 0..=N {
        let x = j as f64;
        s.velocity_m_per_a[j] = 20_000.0 + 900.0 * x + 700.0 * (1.3 * x).sin();
        s.mu_w[j] = 0.37 + 0.01 * x + 0.02 * (2.1 * x).cos();
    }
    for c in 0..N {
        let x = c as f64;
        s.thickness_m[c] = 150.0 - 9.0 * x + 4.0 * (1.7 * x).sin();
        s.fluidity_per_a[c] = 5.0 + 1.5 * (0.9 * x).sin();
    }
    s
}

/// Largest relative error of the Jacobian's entries, row by row, with the row and column it stands at.
fn worst_entry(problem: Problem<'_>) -> (f64, usize, usize) {
    let size = unknowns(N);
    let mut scratch = Scratch::new(N);
    let mut equations = Equations::new(problem, &mut scratch);
    let mut x = vec![0.0; size];
    uneven_state().pack(&mut x);
    let mut residual = vec![0.0; size];
    let mut jacobian = Jacobian::zeros(N);
    equations.linearise(&x, &mut residual, &mut jacobian).expect("the state is in the domain");

    let mut differences = vec![vec![0.0; size]; size];
    for j in 0..size {
        let step = 1e-6 * x[j].abs().max(1e-2);
        let mut sides = [vec![0.0; size], vec![0.0; size]];
        for (side, sign) in sides.iter_mut().zip([1.0, -1.0]) {
            let mut moved = x.clone();
            moved[j] += sign * step;
            equations.residual(&moved, side).expect("a small step stays in the domain");
        }
        for i in 0..size {
            differences[i][j] = (sides[0][i] - sides[1][i]) / (2.0 * step);
        }
    }
    let analytic = jacobian.to_dense();
    let mut worst = (0.0, 0, 0);
    for (i, row) in differences.iter().enumerate() {
        let scale = row.iter().fold(0.0_f64, |a, v| a.max(v.abs()));
        for (j, difference) in row.iter().enumerate() {
            let error = (analytic[i][j] - difference).abs() / scale;
            if error > worst.0 {
                worst = (error, i, j);
            }
        }
    }
    worst
}

fn check(parameters: &Parameters, model: &Model, smoothing: f64) {
    let old: Vec<f64> = (0..N).map(|c| 140.0 - 8.0 * c as f64).collect();
    let fluidity = vec![4.0; N];
    let mu_w = vec![0.4; N + 1];
    let relaxation =
        Relaxation { fluidity_per_a: &fluidity, rate_per_m2: 1e-6, mu_w: &mu_w, speed_per_mu: 3e4 };
    let balances = [
        MassBalance::Steady,
        MassBalance::Step(Before { per_step: 100.0, thickness_m: &old, length_m: 9_000.0 }),
        MassBalance::Given { thickness_m: &old, length_m: 9_000.0 },
        MassBalance::AtRest(Size::Length(9_000.0)),
        MassBalance::AtRest(Size::Thickness0(120.0)),
    ];
    let law = CalvingLaw {
        rate_m_per_a: 8_000.0,
        per_force_m2_per_a_n: 2e-4,
        per_advance_per_a: 0.3,
        thickness_per_advance: 0.02,
    };
    let moving = Advance { from_x_m: 300.0, step_a: 0.3, law: None };
    for balance in balances {
        for closure in UpstreamClosure::ALL {
            for (relaxation, law) in [(None, None), (Some(relaxation), None), (None, Some(law))] {
                let (error, row, column) = worst_entry(Problem {
                    parameters,
                    fjord: model.fjord(),
                    melt_shape: model.melt_shape(),
                    closure,
                    balance,
                    advance: Advance { law, ..moving },
                    smoothing,
                    relaxation,
                });
                assert!(
                    error < 2e-7,
                    "{balance:?} {closure:?} {law:?}: entry ({row}, {column}) is off by {error:.1e} of its row"
                );
            }
        }
    }
}

#[test]
fn analytic_jacobian_matches_differences() {
    let m = model(|p| p.n_cells = N);
    check(m.parameters(), &m, 0.0);
}

#[test]
fn analytic_jacobian_matches_differences_where_tables_give_width_and_melt() {
    let widths = Monotone::new(vec![0.0, 2e3, 7e3, 2e4], vec![4e3, 4.6e3, 4.2e3, 6e3]);
    let factors = Linear::new(vec![0.0, 3.1e3, 2e4], vec![1.5, 0.4, 0.9]).expect("a table");
    let widths = widths.expect("a table");
    for frame in [Frame::Terminus, Frame::Bedrock] {
        let melt = MeltShape::over_x(factors.clone(), frame, Beyond::Refused).expect("factors");
        let fjord = Fjord::table(widths.clone(), Beyond::Constant).expect("widths");
        let m = model(|p| (p.n_cells, p.water_drag_n_per_m) = (N, 5e3));
        let m = m.in_fjord(fjord).with_melt_shape(melt);
        check(m.parameters(), &m, 1e-3);
    }
}

/// The elimination of friction, also at a node that sticks to the walls, and the calving law's product.
#[test]
fn a_solve_equals_a_dense_solve() {
    let old = vec![100.0; N];
    let m = model(|p| (p.n_cells, p.width_gradient) = (N, -0.03));
    let law = CalvingLaw::steady_feedback(6_000.0, 8e6);
    let stuck = sidewall::threshold(m.parameters(), 0.0);
    for (law, mu_w) in [(None, 0.4), (Some(law), 0.4), (None, stuck), (Some(law), stuck)] {
        let problem = Problem {
            parameters: m.parameters(),
            fjord: m.fjord(),
            melt_shape: m.melt_shape(),
            closure: UpstreamClosure::Published,
            balance: MassBalance::Step(Before {
                per_step: 100.0,
                thickness_m: &old,
                length_m: 9_000.0,
            }),
            advance: Advance { from_x_m: 0.0, step_a: 0.01, law },
            smoothing: 1e-2,
            relaxation: None,
        };
        let size = unknowns(N);
        let mut state = uneven_state();
        state.mu_w[5] = mu_w;
        let (mut x, mut residual) = (vec![0.0; size], vec![0.0; size]);
        state.pack(&mut x);
        let mut jacobian = Jacobian::zeros(N);
        let mut scratch = Scratch::new(N);
        let mut equations = Equations::new(problem, &mut scratch);
        equations.linearise(&x, &mut residual, &mut jacobian).expect("in the domain");
        let expected = dense_solve(jacobian.to_dense(), residual.clone());
        jacobian.factorise().expect("regular");
        jacobian.solve(&mut residual);
        let largest = expected.iter().fold(0.0_f64, |a, v| a.max(v.abs()));
        for (i, (got, expected)) in residual.iter().zip(&expected).enumerate() {
            assert!(
                (got - expected).abs() < 1e-9 * largest,
                "{law:?} {mu_w}, unknown {i}: {got} is not {expected}"
            );
        }
    }
}

#[test]
fn analytic_jacobian_matches_differences_in_a_widening_fjord_with_smoothed_kinks() {
    let m = model(|p| {
        p.n_cells = N;
        p.width_gradient = 0.05;
        p.terminus_velocity_m_per_a = 7_500.0;
        p.A = 3.0;
    });
    check(m.parameters(), &m, 1e-2);
}

/// A so small that the transverse problem is rounded too.
#[test]
fn analytic_jacobian_matches_differences_where_transects_are_not_resolved() {
    let m = model(|p| (p.n_cells, p.A) = (N, 0.015));
    check(m.parameters(), &m, 3e-2);
}
