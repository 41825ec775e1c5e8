//! The root rule: one answer, whatever the start.

use crate::{assert_all_close, assert_close, converged, model, steady};
use melange_solver::Solver;
use melange_solver::control::Setting;
use melange_solver::diagnostic::wedge;
use melange_solver::error::SolveError;
use melange_solver::force::yielding_fraction;
use melange_solver::params::Parameters;
use melange_solver::roots::DiscreteRoot;
use melange_solver::sensitivity::Linearised;
use melange_solver::steady::SteadyVerdict;

#[test]
fn the_base_case_ends_on_the_right_root() {
    let m = model(|_| ());
    let solution = steady(&m);
    assert_close("H0", solution.state.thickness_0_m(), 149.415357782, 1e-10);
    assert_close("L", solution.state.length_m, 12_048.003906789, 1e-10);
    assert_eq!(yielding_fraction(&m, &solution.state), 1.0);
    assert!(solution.residual_norm < 1e-9, "{}", solution.residual_norm);
}

#[test]
fn walking_through_neighbours_up_or_down_does_not_change_the_answer() {
    let melts: Vec<f64> = (0..=20).map(|i| 0.5 + 0.5 * i as f64 / 20.0).collect();
    let cold: Vec<_> =
        melts.iter().map(|melt| steady(&model(|p| p.melt_rate_m_per_day = *melt)).state).collect();
    for down in [false, true] {
        let mut solver = Solver::new(model(|_| ()));
        let mut near = None;
        let mut order: Vec<usize> = (0..melts.len()).collect();
        if down {
            order.reverse();
        }
        for i in order {
            solver.retarget(model(|p| p.melt_rate_m_per_day = melts[i]));
            let verdict = solver.steady(near.as_ref()).expect("a verdict");
            let SteadyVerdict::Converged { solution, trail } = verdict else {
                panic!("melt {} has a steady state", melts[i]);
            };
            assert_close("L", solution.state.length_m, cold[i].length_m, 1e-9);
            let fluidity = &solution.state.fluidity_per_a;
            assert_all_close("g", fluidity, &cold[i].fluidity_per_a, 1e-9);
            near = Some(trail);
        }
    }
}

/// Points at which a smoothed root ends on a kink of the last interior cell's fluidity, so that
/// Newton's method alone stalls; found by a grid over melt, width and gradient.
#[test]
fn roots_that_end_on_a_kink_are_passed() {
    for (melt, width, gradient) in [
        (0.8526315789473684, 2500.0, 0.04),
        (1.0105263157894737, 3684.2105263157896, 0.0),
        (1.7210526315789474, 3210.5263157894738, 0.0),
    ] {
        let m = model(|p| {
            (p.melt_rate_m_per_day, p.width_m, p.width_gradient) = (melt, width, gradient);
        });
        let cold = steady(&m);
        assert!(cold.residual_norm < 1e-9);
        let near = model(|p| {
            (p.melt_rate_m_per_day, p.width_m, p.width_gradient) = (melt * 0.99, width, gradient);
        });
        let mut solver = Solver::new(near);
        let verdict = solver.steady(None).expect("a verdict");
        let SteadyVerdict::Converged { trail, .. } = verdict else {
            panic!("the neighbour has a steady state");
        };
        solver.retarget(m.clone());
        let warm = converged(solver.steady(Some(&trail)).expect("a verdict"));
        assert_close("H0", warm.state.thickness_0_m(), cold.state.thickness_0_m(), 1e-9);
    }
}

/// Verdicts and roots do not depend on the neighbour a solve starts from, over a grid that reaches
/// thick, collapsing and retreating mélanges.
#[test]
fn a_neighbour_changes_neither_verdict_nor_root() {
    let mut seen = [0; 3];
    for (d, calving) in [(25.0, 6000.0), (100.0, 6000.0), (25.0, 7000.0)] {
        let mut near = None;
        for width in [2500.0, 4000.0, 7000.0] {
            for melt in [0.4, 0.8, 1.2, 1.6] {
                let m = model(|p| {
                    (p.d_m, p.calving_rate_m_per_a, p.n_cells) = (d, calving, 20);
                    (p.width_m, p.melt_rate_m_per_day) = (width, melt);
                });
                let cold = Solver::new(m.clone()).steady(None).expect("a verdict");
                let warm = Solver::new(m.clone()).steady(near.as_ref()).expect("a verdict");
                match (cold, warm) {
                    (
                        SteadyVerdict::Converged { solution: cold, .. },
                        SteadyVerdict::Converged { solution: warm, trail },
                    ) => {
                        let (cold, warm) = (cold.state, warm.state);
                        assert_close("L", warm.length_m, cold.length_m, 1e-9);
                        assert_close("H0", warm.thickness_0_m(), cold.thickness_0_m(), 1e-9);
                        near = Some(trail);
                        seen[0] += 1;
                    }
                    (SteadyVerdict::NoSteadyState(_), SteadyVerdict::NoSteadyState(_)) => {
                        seen[1] += 1
                    }
                    (SteadyVerdict::Overthick(_), SteadyVerdict::Overthick(_)) => seen[2] += 1,
                    (cold, warm) => panic!("{:?}: {cold:?} but {warm:?}", m.parameters()),
                }
            }
        }
    }
    assert!(seen.iter().all(|count| *count > 1), "the grid is to reach every verdict: {seen:?}");
}

/// The answer from starts of 2…40 km and 1.5d…15d is the one from the regular start, for Fig. 3's and
/// Fig. 6's variants.
#[test]
fn no_start_changes_the_root() {
    type Change = fn(&mut Parameters);
    let variants: [Change; 9] = [
        |_| (),
        |p| p.mu_s = 0.2,
        |p| p.d_m = 10.0,
        |p| p.b = 5e4,
        |p| p.A = 5.0,
        |p| p.width_m = 3000.0,
        |p| p.width_m = 7000.0,
        |p| p.width_gradient = -0.04,
        |p| p.width_gradient = 0.04,
    ];
    for change in variants {
        let m = model(|p| {
            change(p);
            p.n_cells = 20;
        });
        let d = m.parameters().d_m;
        let expected = steady(&m).state;
        let mut solver = Solver::new(m.clone());
        for length_m in [2e3, 5e3, 12e3, 40e3] {
            for thickness in [1.5, 3.0, 7.0, 15.0] {
                let start = wedge(&m, thickness * d);
                let found = converged(solver.steady_from(&start, length_m).expect("a verdict"));
                let what = format!("{length_m} m, {thickness} d, {:?}", m.parameters());
                assert_close(&what, found.state.length_m, expected.length_m, 1e-9);
                assert_close(&what, found.state.thickness_0_m(), expected.thickness_0_m(), 1e-9);
            }
        }
    }
}

#[test]
fn a_start_that_is_no_geometry_is_refused() {
    let mut solver = Solver::new(model(|_| ()));
    for (thickness, length_m) in
        [(vec![100.0; 3], 1e4), (vec![100.0; 50], -1.0), (vec![f64::NAN; 50], 1e4)]
    {
        let error = solver.steady_from(&thickness, length_m).expect_err("no geometry");
        assert!(matches!(error, SolveError::UnusableState { .. }), "{error}");
    }
}

/// The four roots of the base case that are known, and what tells them apart. All are stable.
#[test]
fn the_other_discrete_roots_of_the_base_case_are_found() {
    let m = model(|_| ());
    let roots =
        Solver::new(m.clone()).discrete_roots().expect("a verdict").expect("a steady state");
    assert!(roots[0].is_picked && roots[1..].iter().all(|root| !root.is_picked));
    assert!(roots.iter().all(|root| root.residual_norm < 1e-9));
    let near = |thickness_m: f64| {
        let error = |root: &&DiscreteRoot| (root.state.thickness_0_m() - thickness_m).abs();
        let root = roots.iter().min_by(|a, b| error(a).total_cmp(&error(b))).expect("roots");
        assert!(error(&root) < 1e-4, "{thickness_m} m: {}", root.state.thickness_0_m());
        root
    };
    assert!(near(149.415358).is_picked && near(149.415358).cells_at_rest.is_empty());
    assert_eq!(near(149.415183).cells_at_rest, [48]);
    assert_close("L", near(149.415183).state.length_m, 12_047.967_6, 1e-8);
    assert!(near(149.415217).cells_at_rest.is_empty());
    assert_eq!(near(148.0598).cells_at_rest, [1]);
    let setting = Setting { model: m, law: None };
    for root in &roots {
        let linearised = Linearised::at(&setting, &root.state).expect("regular");
        assert!(linearised.spectrum().expect("growth rates").is_stable());
    }
}
