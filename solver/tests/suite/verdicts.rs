//! Verdicts of physics: what has no steady state says so, and a transient ends where it ends.

use crate::model;
use melange_solver::diagnostic::wedge;
use melange_solver::error::SolveError;
use melange_solver::fjord::Fjord;
use melange_solver::interpolate::{Beyond, Monotone};
use melange_solver::melt::MeltShape;
use melange_solver::params::Parameters;
use melange_solver::physics::closure::UpstreamClosure;
use melange_solver::steady::SteadyVerdict;
use melange_solver::transient::{Ending, Plan};
use melange_solver::{Model, Solver};
use std::ops::ControlFlow;

fn verdict(m: Model) -> SteadyVerdict {
    Solver::new(m.clone()).steady(None).expect("the solve ends in a verdict")
}

#[test]
fn strong_melt_in_a_wide_fjord_has_no_steady_state() {
    let m = model(|p| (p.melt_rate_m_per_day, p.width_m) = (1.8, 7000.0));
    assert!(matches!(verdict(m.clone()), SteadyVerdict::NoSteadyState(_)));
    let m = model(|p| (p.calving_rate_m_per_a, p.terminus_velocity_m_per_a) = (0.0, 0.0));
    assert!(matches!(verdict(m.clone()), SteadyVerdict::NoSteadyState(_)));
}

#[test]
fn little_melt_in_a_narrow_fjord_is_overthick() {
    let m = model(|p| (p.melt_rate_m_per_day, p.width_m) = (0.3, 2500.0));
    assert!(matches!(verdict(m.clone()), SteadyVerdict::Overthick(_)));
}

/// Short and thick is not collapsed: icebergs a third as thick as the glacier in a narrow fjord.
#[test]
fn a_short_thick_melange_is_not_taken_for_a_collapsed_one() {
    let m = model(|p| {
        (p.d_m, p.melt_rate_m_per_day, p.width_m, p.n_cells) = (200.0, 1.85, 1750.0, 20);
    });
    assert!(matches!(verdict(m.clone()), SteadyVerdict::Converged { .. }));
    for m in [model(|p| p.b = 1e8), model(|p| p.d_m = 599.0), model(|p| p.width_m = 10.0)] {
        assert!(matches!(verdict(m.clone()), SteadyVerdict::Overthick(_)), "{:?}", m.parameters());
    }
}

/// Where the glacier retreats, the velocity relative to the walls vanishes as H₀ reaches H_t.
#[test]
fn a_retreating_terminus_ends_overthick() {
    for (calving, terminus) in [(12_000.0, 0.0), (25_000.0, 6_000.0), (40_000.0, 20_000.0)] {
        let m = model(|p| {
            (p.calving_rate_m_per_a, p.terminus_velocity_m_per_a) = (calving, terminus);
        });
        assert!(matches!(verdict(m.clone()), SteadyVerdict::Overthick(_)), "{calving} {terminus}");
    }
}

#[test]
fn a_terminus_that_retreats_to_where_the_walls_meet_is_not_called_collapsed() {
    let m = model(|p| {
        (p.terminus_velocity_m_per_a, p.width_gradient, p.n_cells) = (0.0, 0.1, 20);
    });
    let mut solver = Solver::new(m.clone());
    let start = solver.diagnostic(&wedge(&m, 75.0), 1e4).expect("a start");
    let mut go_on = |_: melange_solver::observe::Moment<'_>| ControlFlow::Continue(());
    let plan = Plan::fixed(0.05, 200);
    let end = solver.transient(start.state, &plan, &mut go_on).expect("a verdict");
    assert_eq!(end.ending, Ending::FjordClosed);
    assert!((end.time_a - 4000.0 / 0.1 / 6000.0).abs() < 0.05, "{}", end.time_a);
}

#[test]
fn the_printed_closure_is_refused_for_a_steady_state() {
    let m = Model::new(Parameters::default(), UpstreamClosure::Printed).expect("parameters");
    let error = Solver::new(m.clone()).steady(None).expect_err("a family of states");
    assert!(matches!(error, SolveError::ClosureLeavesFamily { closure: "printed" }));
}

#[test]
fn a_moving_terminus_needs_a_fjord_of_constant_width_for_a_steady_state() {
    let moving = |gradient: f64| {
        model(|p| (p.terminus_velocity_m_per_a, p.width_gradient) = (7000.0, gradient))
    };
    assert!(matches!(verdict(moving(0.0)), SteadyVerdict::Converged { .. }));
    let error = Solver::new(moving(0.01)).steady(None).expect_err("not steady in any frame");
    assert!(error.to_string().contains("calving_rate_m_per_a"), "{error}");
}

#[test]
fn a_transient_past_the_critical_melt_collapses_at_a_time() {
    let m = model(|p| {
        (p.melt_rate_m_per_day, p.width_m, p.n_cells) = (1.8, 7000.0, 20);
    });
    let mut solver = Solver::new(m.clone());
    let start = solver.diagnostic(&wedge(&m, 75.0), 1e4).expect("a start");
    let mut moments = 0;
    let mut last_length = f64::INFINITY;
    let mut watch = |moment: melange_solver::observe::Moment<'_>| {
        moments += 1;
        last_length = moment.state.length_m;
        ControlFlow::Continue(())
    };
    let plan = Plan::fixed(0.01, 1000);
    let end = solver.transient(start.state, &plan, &mut watch).expect("a verdict");
    assert_eq!(end.ending, Ending::Collapsed);
    assert!(end.time_a > 0.0 && end.time_a < 10.0, "{}", end.time_a);
    assert!(moments < 1000 && last_length < 1000.0, "{moments} {last_length}");
}

#[test]
fn a_transient_stays_on_its_steady_state() {
    let m = model(|p| p.n_cells = 20);
    let mut solver = Solver::new(m.clone());
    let start = crate::steady(&m).state;
    let plan = Plan::fixed(0.1, 20);
    let mut ignore = |_: melange_solver::observe::Moment<'_>| ControlFlow::Continue(());
    let end = solver.transient(start.clone(), &plan, &mut ignore).expect("twenty steps");
    assert_eq!(end.ending, Ending::Completed);
    crate::assert_close("H0", end.state.thickness_0_m(), start.thickness_0_m(), 1e-9);
}

#[test]
fn an_observer_stops_a_transient() {
    let m = model(|p| p.n_cells = 20);
    let mut solver = Solver::new(m.clone());
    let start = crate::steady(&m).state;
    let plan = Plan::fixed(0.1, 20);
    let mut stop = |moment: melange_solver::observe::Moment<'_>| {
        if moment.step == 3 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let error = solver.transient(start, &plan, &mut stop).expect_err("stopped");
    assert!(matches!(error, SolveError::Stopped { time_a } if (time_a - 0.3).abs() < 1e-12));
}

/// Melt near the terminus cuts the mélange in two; the solution that dips below d and rises again is none.
#[test]
fn a_trough_thinner_than_its_icebergs_is_no_steady_state() {
    let widths = Monotone::new(vec![0.0, 5e3, 4e4], vec![4_000.0, 4_600.0, 6_000.0]);
    let fjord = Fjord::table(widths.expect("a table"), Beyond::Refused).expect("widths");
    for n_cells in [50, 100, 200] {
        let m = model(|p| (p.n_cells, p.melt_rate_m_per_day) = (n_cells, 0.7));
        let shape = MeltShape::named("linear").expect("a name");
        let verdict = verdict(m.in_fjord(fjord.clone()).with_melt_shape(shape));
        let SteadyVerdict::NoSteadyState(evidence) = &verdict else { panic!("{verdict:?}") };
        assert!(evidence.contains("breaks up") || evidence.contains("collapses"), "{evidence}");
    }
}

/// A wide fjord in which every march breaks up where steps no longer have a solution, well above what counts
/// as collapsed.
#[test]
fn a_mélange_whose_marches_break_up_has_no_steady_state() {
    let widths = vec![11_279.5, 16_797.6, 13_110.2, 16_063.7, 17_334.7];
    let widths = Monotone::new(vec![0.0, 1e4, 2e4, 3e4, 4e4], widths).expect("a table");
    let p = Parameters {
        calving_rate_m_per_a: 4179.1,
        terminus_velocity_m_per_a: 4179.1,
        terminus_thickness_m: 343.5,
        melt_rate_m_per_day: 0.20796,
        d_m: 36.949,
        b: 8150.8,
        A: 1.1088,
        mu_s: 0.3294,
        n_cells: 74,
        ..Parameters::default()
    };
    let m = Model::new(p, UpstreamClosure::NoStretching).expect("parameters in range");
    let m = m
        .in_fjord(Fjord::table(widths, Beyond::Constant).expect("widths"))
        .with_melt_shape(MeltShape::named("linear").expect("a name"));
    let verdict = verdict(m);
    let SteadyVerdict::NoSteadyState(evidence) = &verdict else { panic!("{verdict:?}") };
    assert!(evidence.contains("breaks up"), "{evidence}");
}

/// Base case but for one value each: g_loc without bound when rounded in μ, and friction that vanishes.
#[test]
fn extreme_rheologies_end_in_a_verdict() {
    for m in [model(|p| p.b = 1.0), model(|p| p.b = 100.0), model(|p| p.mu_s = 0.02)] {
        assert!(matches!(verdict(m.clone()), SteadyVerdict::Converged { .. }), "{m:?}");
    }
    for mu_s in [1e-3, 1e-2] {
        assert!(matches!(verdict(model(|p| p.mu_s = mu_s)), SteadyVerdict::NoSteadyState(_)));
    }
}

#[test]
fn without_inflow_a_wedge_slides_under_its_own_weight() {
    let m = model(|p| (p.calving_rate_m_per_a, p.terminus_velocity_m_per_a) = (0.0, 0.0));
    let thickness = wedge(&m, 75.0);
    let state = Solver::new(m).diagnostic(&thickness, 1e4).expect("a root").state;
    assert!(state.velocity_m_per_a[0].abs() < 1e-9, "{}", state.velocity_m_per_a[0]);
    assert!(state.velocity_m_per_a[1..].iter().all(|u| *u > 0.0));
}

/// Marches from thick starts pass below it, to where a mélange counts as collapsed.
#[test]
fn a_short_steady_state_is_not_taken_for_a_collapse() {
    let m = model(|p| {
        (p.melt_rate_m_per_day, p.width_m, p.width_gradient) = (1.729, 6611.6, -0.06825);
        (p.calving_rate_m_per_a, p.terminus_velocity_m_per_a) = (1451.5, 1451.5);
        (p.terminus_thickness_m, p.d_m, p.b) = (620.26, 4.002, 368454.6);
        (p.A, p.mu_s, p.n_cells) = (4.839, 0.1126, 41);
    });
    assert!(matches!(verdict(m), SteadyVerdict::Converged { .. }));
}

/// Parameters over all that is permitted in practice, the wide fjords with small icebergs among them
/// whose transects are not resolved: every solve ends in a verdict.
#[test]
fn parameters_drawn_at_random_end_in_a_verdict() {
    // Weyl sequences of the square roots of primes fill the box evenly.
    let share = |i: usize, prime: f64| (i as f64 * prime.sqrt()).fract();
    let between = |share: f64, low: f64, high: f64| low + share * (high - low);
    let mut seen = [0; 4];
    for i in 1..=120 {
        let m = model(|p| {
            p.melt_rate_m_per_day = between(share(i, 2.0), 0.0, 3.0);
            p.width_m = between(share(i, 3.0), 1e3, 2e4);
            p.width_gradient = between(share(i, 5.0), -0.1, 0.1);
            p.terminus_velocity_m_per_a = between(share(i, 7.0), 500.0, 2e4);
            p.calving_rate_m_per_a = p.terminus_velocity_m_per_a;
            p.terminus_thickness_m = between(share(i, 11.0), 100.0, 1200.0);
            p.d_m = between(share(i, 13.0), 2.0, 99.0);
            p.b = 10_f64.powf(between(share(i, 17.0), 3.0, 7.0));
            p.A = 10_f64.powf(between(share(i, 19.0), -1.0, 1.0));
            p.mu_s = between(share(i, 23.0), 0.1, 0.7);
            p.n_cells = between(share(i, 29.0), 10.0, 60.0) as usize;
        });
        let verdict = Solver::new(m.clone()).steady(None);
        let slot = match verdict.unwrap_or_else(|e| panic!("{:?}: {e}", m.parameters())) {
            SteadyVerdict::Converged { .. } => 0,
            SteadyVerdict::NoSteadyState(_) => 1,
            SteadyVerdict::Overthick(_) => 2,
            SteadyVerdict::FjordClosed(_) => 3,
        };
        seen[slot] += 1;
    }
    assert!(seen[..3].iter().all(|count| *count > 10), "{seen:?}");
}
