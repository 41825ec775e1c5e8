//! Mélange at rest: reference lengths, an independent integrator of the profile, the three ways to give
//! its size, and what cannot be.

use crate::{assert_close, model};
use melange_solver::force;
use melange_solver::params::Parameters;
use melange_solver::physics::sidewall::{Section, friction_for};
use melange_solver::quasi_static::{Given, QuasiStaticVerdict};
use melange_solver::{Solution, Solver};

fn at_rest(change: impl FnOnce(&mut Parameters), given: Given) -> Solution {
    let verdict = Solver::new(model(change)).quasi_static(given).expect("a verdict");
    match verdict {
        QuasiStaticVerdict::Converged(solution) => solution,
        other => panic!("expected a state at rest, got {other:?}"),
    }
}

/// Length of the profile with thickness H₀ by ∫ W/(μ_w(H)H) dH from d to H₀: the balance of stresses,
/// dH/dx = −μ_w(H)H/W, by Gauss–Legendre quadrature with three points on each of 2,000 pieces of ln H.
fn integrated_length_m(p: &Parameters, thickness_0_m: f64) -> f64 {
    const PIECES: usize = 2_000;
    let nodes = [(-(0.6_f64.sqrt()), 5.0 / 18.0), (0.0, 4.0 / 9.0), (0.6_f64.sqrt(), 5.0 / 18.0)];
    let piece = (thickness_0_m / p.d_m).ln() / PIECES as f64;
    let mut length = 0.0;
    for i in 0..PIECES {
        for (node, weight) in nodes {
            let thickness_m = p.d_m * (piece * (i as f64 + 0.5 + 0.5 * node)).exp();
            let mut section = [Section { mu_w: 0.0, thickness_m, width_m: p.width_m }];
            friction_for(p, &[p.terminus_velocity_m_per_a], &mut section, 1e-10);
            length += weight * piece * p.width_m / section[0].mu_w;
        }
    }
    length
}

/// The lengths of the settled model, to the two digits behind the point that are given.
#[test]
fn the_integrated_profile_has_the_reference_lengths() {
    for (thickness_0_m, length_m) in [(75.0, 12_936.25), (100.0, 16_392.72), (150.0, 21_304.59)] {
        let integrated = integrated_length_m(&Parameters::default(), thickness_0_m);
        assert!((integrated - length_m).abs() < 0.006, "{thickness_0_m}: {integrated}");
    }
}

/// The scheme is of second order in the length, on N = 25 … 800.
#[test]
fn the_length_converges_to_the_integrated_profile() {
    for thickness_0_m in [75.0, 100.0, 150.0] {
        let exact = integrated_length_m(&Parameters::default(), thickness_0_m);
        let errors = [25, 50, 100, 200, 400, 800].map(|n| {
            let s = at_rest(|p| p.n_cells = n, Given::Thickness0(thickness_0_m)).state;
            (s.length_m - exact).abs() / exact
        });
        for pair in errors.windows(2) {
            let order = (pair[0] / pair[1]).log2();
            assert!((1.95..2.2).contains(&order), "H0 = {thickness_0_m}: {errors:?}");
        }
        assert!(errors[5] < 1e-6, "{errors:?}");
    }
}

#[test]
fn length_thickness_and_volume_give_the_same_state() {
    for gradient in [0.0, 0.03, -0.03] {
        let change = |p: &mut Parameters| p.width_gradient = gradient;
        let by_thickness = at_rest(change, Given::Thickness0(100.0)).state;
        let volume_m3 = force::volume_m3(&model(change), &by_thickness, 0.0);
        let others = [Given::Length(by_thickness.length_m), Given::Volume(volume_m3)];
        for given in others {
            let s = at_rest(change, given).state;
            assert_close("L", s.length_m, by_thickness.length_m, 1e-11);
            assert_close("H0", s.thickness_0_m(), 100.0, 1e-11);
        }
        assert!(by_thickness.velocity_m_per_a.iter().all(|u| u.abs() < 1e-6));
        let force = force::force_n_per_m(&by_thickness);
        assert_close("F", force, force::static_force_n_per_m(100.0), 1e-12);
        assert!(by_thickness.fluidity_per_a.iter().all(|g| *g > 0.0));
    }
}

#[test]
fn a_mélange_thicker_than_the_glacier_is_overthick() {
    for given in [Given::Length(60_000.0), Given::Length(1e6), Given::Volume(1e12)] {
        let verdict = Solver::new(model(|_| ())).quasi_static(given).expect("a verdict");
        assert!(matches!(verdict, QuasiStaticVerdict::Overthick(_)), "{given:?}: {verdict:?}");
    }
}

#[test]
fn a_terminus_that_does_not_push_is_refused() {
    let m = model(|p| p.terminus_velocity_m_per_a = 0.0);
    let error = Solver::new(m).quasi_static(Given::Length(1e4)).expect_err("nothing moves");
    assert!(error.to_string().contains("terminus_velocity_m_per_a"), "{error}");
}

/// Drag of the water on the mélange's underside is borne by the terminus: with walls too far apart to
/// matter, the force grows by D.
#[test]
fn water_drag_adds_to_the_force() {
    let drag = 5e3;
    let wide = |d: f64| {
        move |p: &mut Parameters| {
            (p.width_m, p.water_drag_n_per_m, p.n_cells) = (1e6, d, 400);
        }
    };
    let length = Given::Length(1e4);
    let force = |d: f64| force::force_n_per_m(&at_rest(wide(d), length).state);
    assert_close("gain", force(drag) - force(0.0), drag, 0.01);
}
