//! Every slope of every equation against central differences.

use crate::model;
use melange_solver::Model;
use melange_solver::newton::System;
use melange_solver::params::Parameters;
use melange_solver::physics::closure::UpstreamClosure;
use melange_solver::physics::continuity::MassBalance;
use melange_solver::physics::fluidity::Relaxation;
use melange_solver::physics::{Equations, Jacobian, Problem, Scratch};
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
    let mut jacobian = Jacobian::zeros(size);
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
    let mut worst = (0.0, 0, 0);
    for (i, row) in differences.iter().enumerate() {
        let scale = row.iter().fold(0.0_f64, |a, v| a.max(v.abs()));
        for (j, difference) in row.iter().enumerate() {
            let error = (jacobian.get(i, j) - difference).abs() / scale;
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
    let relaxation = Relaxation { fluidity_per_a: &fluidity, rate_per_m2: 1e-6 };
    let balances = [
        MassBalance::Steady,
        MassBalance::Step { dt_a: 0.01, thickness_m: &old, length_m: 9_000.0 },
        MassBalance::Given { thickness_m: &old, length_m: 9_000.0 },
    ];
    for balance in balances {
        for closure in UpstreamClosure::ALL {
            for relaxation in [None, Some(relaxation)] {
                let (error, row, column) = worst_entry(Problem {
                    parameters,
                    fjord: model.fjord(),
                    closure,
                    balance,
                    terminus_x_m: 300.0,
                    smoothing,
                    relaxation,
                });
                assert!(
                    error < 2e-7,
                    "{balance:?} {closure:?}: entry ({row}, {column}) is off by {error:.1e} of its row"
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
fn analytic_jacobian_matches_differences_in_a_widening_fjord_with_smoothed_kinks() {
    let m = model(|p| {
        p.n_cells = N;
        p.width_gradient = 0.05;
        p.terminus_velocity_m_per_a = 7_500.0;
        p.A = 3.0;
    });
    check(m.parameters(), &m, 1e-2);
}
