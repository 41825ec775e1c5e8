//! Derivatives of steady states: adjoint against tangent, and both against differences of whole solves.

use crate::linear_algebra::dense_solve;
use crate::{assert_close, converged, model};
use melange_solver::control::{Control, Setting};
use melange_solver::interpolate::Linear;
use melange_solver::melt::MeltShape;
use melange_solver::newton::{Linear as _, System};
use melange_solver::physics::continuity::MassBalance;
use melange_solver::physics::given::Given;
use melange_solver::physics::jacobian::Jacobian;
use melange_solver::physics::terminus::{Advance, CalvingLaw};
use melange_solver::physics::{Equations, Problem, Scratch};
use melange_solver::sensitivity::{Linearised, Quantity};
use melange_solver::state::{State, unknowns};
use melange_solver::{Model, Solver};

fn solved(model: &Model) -> State {
    converged(Solver::new(model.clone()).steady(None).expect("a verdict")).state
}

/// Central differences of Q over ±step, improved by those over half of it (Richardson).
fn difference(setting: &Setting, control: Control, quantity: Quantity, step: f64) -> f64 {
    let value = control.value(setting);
    let at = |change: f64| {
        let mut changed = setting.clone();
        control.set(&mut changed, value + change);
        quantity.value(&changed, &solved(&changed.model))
    };
    let slope = |h: f64| (at(h) - at(-h)) / (2.0 * h);
    (4.0 * slope(0.5 * step) - slope(step)) / 3.0
}

/// Every quantity by every parameter. Differences are good to about 1e-6 where no point of a transect
/// crosses its kink between them; the step of each parameter is one that crosses none.
#[test]
fn adjoint_derivatives_are_those_of_whole_solves() {
    let setting = Setting {
        model: model(|p| (p.n_cells, p.width_gradient, p.water_drag_n_per_m) = (30, 0.01, 2e4)),
        law: None,
    };
    let state = solved(&setting.model);
    let mut linearised = Linearised::at(&setting, &state).expect("regular");
    for quantity in Quantity::ALL {
        let sensitivity = linearised.sensitivity(quantity).expect("regular");
        assert_close("value", sensitivity.value, quantity.value(&setting, &state), 1e-15);
        for given in Given::ALL {
            let control = Control::Parameter(given);
            if matches!(given, Given::TerminusVelocity | Given::CalvingRate) {
                // Steady in a widening fjord only together.
                continue;
            }
            let value = control.value(&setting);
            let step = 1e-4 * value;
            let expected = difference(&setting, control, quantity, step);
            // Of the relative change per relative change.
            let error =
                (sensitivity.by[given as usize] - expected).abs() * value / sensitivity.value.abs();
            assert!(error < 1e-6, "{quantity:?} by {}: off by {error:.1e}", control.name());
        }
        let flux = Control::CalvingFlux;
        let expected = difference(&setting, flux, quantity, 1e-4 * flux.value(&setting));
        let by_flux = sensitivity.by_control(flux, &setting, &state);
        let error = (by_flux - expected).abs() * flux.value(&setting) / sensitivity.value.abs();
        assert!(error < 1e-6, "{quantity:?} by the flux: off by {error:.1e}");
    }
}

#[test]
fn tangents_and_adjoints_agree() {
    for n_cells in [20, 50, 200] {
        let setting = Setting { model: model(|p| p.n_cells = n_cells), law: None };
        let state = solved(&setting.model);
        let mut linearised = Linearised::at(&setting, &state).expect("regular");
        let length = linearised.sensitivity(Quantity::Length).expect("regular");
        let thickness = linearised.sensitivity(Quantity::Thickness0).expect("regular");
        for given in Given::ALL {
            let tangent = linearised.tangent(Control::Parameter(given)).expect("regular");
            assert_close("dL/dp", length.by[given as usize], tangent.length_m, 1e-6);
            let expected = tangent.thickness_0_m();
            assert_close("dH0/dp", thickness.by[given as usize], expected, 1e-6);
        }
    }
}

/// By the melt rate as a function: a tilt of it, and all of it.
#[test]
fn derivatives_by_the_melt_of_each_cell_add_up() {
    const TILT: f64 = 1e-4;
    let base = model(|p| p.n_cells = 30);
    let melt_m_per_a = base.parameters().melt_rate_m_per_a();
    let setting = Setting { model: base.clone(), law: None };
    let state = solved(&base);
    let mut linearised = Linearised::at(&setting, &state).expect("regular");
    for quantity in [Quantity::Length, Quantity::Thickness0, Quantity::Force, Quantity::Volume] {
        let sensitivity = linearised.sensitivity(quantity).expect("regular");
        let by_rate = sensitivity.by_melt.iter().sum::<f64>() * 365.25;
        assert_close("all of it", by_rate, sensitivity.by[Given::MeltRate as usize], 1e-12);

        let tilted = |tilt: f64| {
            let table = Linear::new(vec![0.0, 1.0], vec![1.0 + tilt, 1.0 - tilt]).expect("a line");
            let shape = MeltShape::over_chi(table).expect("factors of mean 1");
            quantity.value(&setting, &solved(&base.clone().with_melt_shape(shape)))
        };
        let expected = (tilted(TILT) - tilted(-TILT)) / (2.0 * TILT);
        let cells = sensitivity.by_melt.iter().enumerate();
        let by_tilt: f64 =
            cells.map(|(c, by)| by * melt_m_per_a * (1.0 - 2.0 * (c as f64 + 0.5) / 30.0)).sum();
        assert!((by_tilt - expected).abs() < 1e-6 * sensitivity.value, "{by_tilt} {expected}");
    }
}

/// ∂F/∂p of every parameter against differences of the residual, with the kinks as they are and rounded.
#[test]
fn slopes_by_what_is_given_match_differences() {
    const N: usize = 12;
    let m = model(|p| {
        (p.n_cells, p.width_gradient, p.water_drag_n_per_m) = (N, 0.02, 3e4);
        p.terminus_velocity_m_per_a = 7_500.0;
    });
    let state = solved(&model(|p| p.n_cells = N));
    let size = unknowns(N);
    let mut x = vec![0.0; size];
    state.pack(&mut x);
    for (given, smoothing) in Given::ALL.into_iter().flat_map(|g| [(g, 0.0), (g, 1e-2)]) {
        let control = Control::Parameter(given);
        let mut setting = Setting { model: m.clone(), law: None };
        let value = control.value(&setting);
        let mut scratch = Scratch::new(N);
        let step = 1e-6 * value;
        let mut residual_at = |setting: &Setting| {
            let mut residual = vec![0.0; size];
            let mut equations = Equations::new(problem(setting, smoothing), &mut scratch);
            equations.residual(&x, &mut residual).expect("in the domain");
            residual
        };
        let sides = [1.0, -1.0].map(|side| {
            control.set(&mut setting, value + side * step);
            residual_at(&setting)
        });
        control.set(&mut setting, value);
        let (mut residual, mut column) = (vec![0.0; size], vec![0.0; size]);
        let rates = control.rates(&setting, &state);
        let mut equations = Equations::new(problem(&setting, smoothing), &mut scratch);
        equations
            .linearise_along(&x, &mut residual, &mut Jacobian::zeros(N), &rates, &mut column)
            .expect("in the domain");
        let largest = column.iter().fold(0.0_f64, |a, v| a.max(v.abs()));
        assert!(largest > 0.0, "{given:?} acts on something");
        for (i, slope) in column.iter().enumerate() {
            let expected = (sides[0][i] - sides[1][i]) / (2.0 * step);
            let error = (slope - expected).abs() / largest;
            assert!(error < 3e-6, "{given:?} at ε = {smoothing}, row {i}: off by {error:.1e}");
        }
    }
}

fn problem(setting: &Setting, smoothing: f64) -> Problem<'_> {
    Problem {
        parameters: setting.model.parameters(),
        fjord: setting.model.fjord(),
        melt_shape: setting.model.melt_shape(),
        closure: setting.model.closure(),
        balance: MassBalance::Steady,
        advance: Advance { law: setting.law, ..Advance::fixed(0.0) },
        smoothing,
        relaxation: None,
    }
}

/// Aᵀy = b by the factors of A, with a node that sticks to the walls and one that flows, with and without a
/// calving law.
#[test]
fn transposed_solves_equal_dense_ones() {
    const N: usize = 12;
    let m = model(|p| p.n_cells = N);
    let law = CalvingLaw {
        rate_m_per_a: 8_000.0,
        per_force_m2_per_a_n: 2e-4,
        per_advance_per_a: 0.0,
        thickness_per_advance: 0.0,
    };
    for law in [None, Some(law)] {
        for mu_w in [0.4, 0.3031] {
            let mut state = solved(&m);
            state.mu_w[5] = mu_w;
            let size = unknowns(N);
            let (mut x, mut residual) = (vec![0.0; size], vec![0.0; size]);
            state.pack(&mut x);
            let setting = Setting { model: m.clone(), law };
            let mut scratch = Scratch::new(N);
            let mut jacobian = Jacobian::zeros(N);
            Equations::new(problem(&setting, 0.0), &mut scratch)
                .linearise(&x, &mut residual, &mut jacobian)
                .expect("in the domain");
            let dense = jacobian.to_dense();
            let transposed = (0..size).map(|i| dense.iter().map(|row| row[i]).collect()).collect();
            let mut rhs: Vec<f64> = (0..size).map(|i| (1.7 * i as f64).sin()).collect();
            let expected = dense_solve(transposed, rhs.clone());
            jacobian.factorise().expect("regular");
            jacobian.solve_transposed(&mut rhs);
            let largest = expected.iter().fold(0.0_f64, |a, v| a.max(v.abs()));
            for (i, (got, expected)) in rhs.iter().zip(&expected).enumerate() {
                let error = (got - expected).abs() / largest;
                assert!(error < 1e-9, "{law:?} {mu_w}, unknown {i}: off by {error:.1e}");
            }
        }
    }
}
