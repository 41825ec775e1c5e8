//! Transients: controlled error, landing, forcing, calving laws, and the way to rest.

use crate::{assert_close, model, steady};
use melange_solver::force::{force_n_per_m, volume_m3};
use melange_solver::forcing::{Course, Forcing};
use melange_solver::observe::Moment;
use melange_solver::params::Parameters;
use melange_solver::physics::terminus::CalvingLaw;
use melange_solver::quasi_static::{Given, QuasiStaticVerdict};
use melange_solver::state::State;
use melange_solver::transient::{Ending, Plan, Stepping, TransientEnd};
use melange_solver::{Model, Solver};
use std::ops::ControlFlow;

/// What a test keeps of a moment.
#[derive(Debug, Clone)]
struct Kept {
    time_a: f64,
    landing: Option<usize>,
    parameters: Parameters,
    state: State,
}

fn run(m: &Model, start: &State, plan: &Plan) -> (TransientEnd, Vec<Kept>) {
    let mut kept = Vec::new();
    let mut keep = |m: Moment<'_>| {
        kept.push(Kept {
            time_a: m.time_a,
            landing: m.landing,
            parameters: *m.parameters,
            state: m.state.clone(),
        });
        ControlFlow::Continue(())
    };
    let end = Solver::new(m.clone()).transient(start.clone(), plan, &mut keep);
    (end.expect("a verdict"), kept)
}

fn forcing(courses: &[(&str, Course)]) -> Forcing {
    let courses = courses.iter().map(|(name, course)| ((*name).to_owned(), course.clone()));
    Forcing::new(courses.collect()).expect("courses within the ranges")
}

/// The forcing of Fig. 7.
fn seasons() -> Forcing {
    let course = Course::Sinusoid { mean: 0.7, amplitude: 0.2, period_a: 1.0, phase_a: 0.0 };
    forcing(&[("melt_rate_m_per_day", course)])
}

fn small_melange() -> Model {
    model(|p| (p.n_cells, p.melt_rate_m_per_day) = (20, 0.7))
}

/// L and H₀ after a year and a half of seasons, for tolerances down to 1e-5, against 1e-7; and the
/// paper's step, whose error is that of the first order.
#[test]
fn controlled_steps_keep_their_tolerance() {
    let m = small_melange();
    let start = steady(&m).state;
    let end = |stepping: Stepping| {
        let plan = Plan { stepping, forcing: seasons(), ..Plan::fixed(0.01, 1) };
        run(&m, &start, &plan).0
    };
    let controlled =
        |tolerance: f64| end(Stepping::Controlled { tolerance, land_on_a: vec![0.5, 1.0, 1.5] });
    let truth = controlled(1e-7);
    let miss = |end: &TransientEnd| {
        let by_length = end.state.length_m / truth.state.length_m - 1.0;
        let by_thickness = end.state.thickness_0_m() / truth.state.thickness_0_m() - 1.0;
        by_length.abs().max(by_thickness.abs())
    };
    let mut steps = Vec::new();
    for tolerance in [1e-2, 1e-3, 1e-4, 1e-5] {
        let end = controlled(tolerance);
        assert!(miss(&end) < 2.0 * tolerance, "{tolerance}: off by {:e}", miss(&end));
        assert!(miss(&end) > 0.01 * tolerance, "{tolerance} is met by far: {:e}", miss(&end));
        steps.push(end.steps);
    }
    assert!(steps.windows(2).all(|pair| pair[1] > pair[0] && pair[1] < 5 * pair[0]), "{steps:?}");
    let coarse = miss(&end(Stepping::Fixed { dt_a: 0.01, count: 150 }));
    let fine = miss(&end(Stepping::Fixed { dt_a: 0.005, count: 300 }));
    assert!((1.8..2.2).contains(&(coarse / fine)), "{coarse:e} {fine:e}");
}

#[test]
fn requested_times_and_kinks_of_the_forcing_are_landed_on() {
    let m = small_melange();
    let start = steady(&m).state;
    let ramp = Course::Ramp { from: 0.7, to: 0.6, start_a: 0.123, end_a: 0.377 };
    let land_on_a = vec![0.0, 0.1, 0.25, 0.3, 0.5];
    let plan = Plan {
        forcing: forcing(&[("melt_rate_m_per_day", ramp)]),
        ..Plan::controlled(1e-3, land_on_a.clone())
    };
    let (end, kept) = run(&m, &start, &plan);
    assert_eq!((end.ending, end.time_a), (Ending::Completed, 0.5));
    let landed: Vec<(usize, f64)> =
        kept.iter().filter_map(|k| Some((k.landing?, k.time_a))).collect();
    assert_eq!(landed, land_on_a.into_iter().enumerate().collect::<Vec<_>>());
    for kink_a in [0.123, 0.377] {
        assert!(kept.iter().any(|k| k.time_a == kink_a), "{kink_a}");
    }
    assert!(kept.windows(2).all(|pair| pair[1].time_a > pair[0].time_a));
    let melt = kept.last().expect("moments").parameters.melt_rate_m_per_day;
    assert_close("melt", melt, 0.6, 1e-12);
}

/// Eq. 31 holds at the end of every step, with fixed and with controlled steps; lagged it holds with
/// the force of the step before.
#[test]
fn the_calving_law_is_solved_within_the_step() {
    let m = small_melange();
    let start = steady(&m).state;
    let law = CalvingLaw::steady_feedback(6_000.0, force_n_per_m(&start));
    let coupled = |plan: Plan| Plan { forcing: seasons(), calving_law: Some(law), ..plan };
    for plan in [Plan::fixed(0.01, 60), Plan::controlled(1e-3, vec![0.6])] {
        let (end, kept) = run(&m, &start, &coupled(plan));
        assert_eq!(end.calving_stopped_steps, 0);
        for k in kept {
            let expected = 12_000.0 - 6_000.0 * force_n_per_m(&k.state) / force_n_per_m(&start);
            assert_close("U_c", k.parameters.calving_rate_m_per_a, expected, 1e-9);
        }
    }
    let lagged = Plan { is_lagged: true, ..coupled(Plan::fixed(0.01, 60)) };
    let (_, kept) = run(&m, &start, &lagged);
    for pair in kept.windows(2) {
        let expected = 12_000.0 - 6_000.0 * force_n_per_m(&pair[0].state) / force_n_per_m(&start);
        assert_close("U_c", pair[1].parameters.calving_rate_m_per_a, expected, 1e-9);
        let inflow = pair[1].state.velocity_m_per_a[0] * pair[1].state.thickness_0_m();
        assert_close("U_0 H_0", inflow, expected * 600.0, 1e-9);
    }
}

/// U_c = α₀ − βX₀ without force: dX₀/dt = U_t − α₀ + βX₀ has the solution (U_t − α₀)(e^{βt} − 1)/β.
#[test]
fn a_law_of_the_position_moves_the_terminus() {
    let m = model(|p| (p.n_cells, p.width_gradient) = (20, 0.02));
    let start = steady(&m).state;
    let (rate, beta) = (6_200.0, -0.5);
    let law = CalvingLaw {
        rate_m_per_a: rate,
        per_force_m2_per_a_n: 0.0,
        per_advance_per_a: beta,
        thickness_per_advance: 0.1,
    };
    let plan = Plan { calving_law: Some(law), ..Plan::controlled(1e-4, vec![1.0]) };
    let (end, _) = run(&m, &start, &plan);
    let exact = (6_000.0 - rate) * ((beta * 1.0_f64).exp() - 1.0) / beta;
    assert_close("X_0", end.terminus_x_m, exact, 1e-3);
    assert_close("H_t", end.parameters.terminus_thickness_m, 600.0 - 0.1 * end.terminus_x_m, 1e-12);
}

/// A law that asks for a negative rate gets none, and the result says in how many steps.
#[test]
fn calving_stops_and_does_not_turn_round() {
    let m = small_melange();
    let start = steady(&m).state;
    let law = CalvingLaw {
        rate_m_per_a: 500.0,
        per_force_m2_per_a_n: 1.0,
        per_advance_per_a: 0.0,
        thickness_per_advance: 0.0,
    };
    for plan in [Plan::fixed(0.01, 5), Plan::controlled(1e-3, vec![0.05])] {
        let plan = Plan { calving_law: Some(law), ..plan };
        let (end, kept) = run(&m, &start, &plan);
        assert_eq!(end.calving_stopped_steps, kept.len() - 1);
        assert!(kept.iter().skip(1).all(|k| k.parameters.calving_rate_m_per_a == 0.0));
    }
}

#[test]
fn fixed_and_controlled_steps_collapse_at_the_same_time() {
    let m = model(|p| (p.melt_rate_m_per_day, p.width_m, p.n_cells) = (1.8, 7_000.0, 20));
    let thickness_m = melange_solver::diagnostic::wedge(&m, 75.0);
    let start = Solver::new(m.clone()).diagnostic(&thickness_m, 1e4).expect("a start").state;
    let (fixed, _) = run(&m, &start, &Plan::fixed(1e-3, 10_000));
    let (controlled, kept) = run(&m, &start, &Plan::controlled(1e-4, vec![10.0]));
    assert_eq!((fixed.ending, controlled.ending), (Ending::Collapsed, Ending::Collapsed));
    assert!(
        (fixed.time_a - controlled.time_a).abs() < 2e-3,
        "{} {}",
        fixed.time_a,
        controlled.time_a
    );
    assert_eq!(kept.last().expect("moments").landing, None);
}

/// Fig. 2: with calving and melt turned off the mélange comes to rest, at the quasi-static state of the
/// volume it has then; the published scheme loses some on the way, since its first cell conserves nothing.
#[test]
fn a_steady_state_left_alone_comes_to_the_quasi_static_limit() {
    let m = model(|p| p.n_cells = 20);
    let start = steady(&m).state;
    let off = |name| (name, Course::Ramp { from: 0.0, to: 0.0, start_a: 0.0, end_a: 1.0 });
    let plan = Plan {
        forcing: forcing(&[off("melt_rate_m_per_day"), off("calving_rate_m_per_a")]),
        ..Plan::controlled(1e-4, vec![20.0])
    };
    let (end, _) = run(&m, &start, &plan);
    assert_eq!(end.ending, Ending::Completed);
    let volume = volume_m3(&m, &end.state, 0.0);
    let lost = 1.0 - volume / volume_m3(&m, &start, 0.0);
    assert!((0.0..0.1).contains(&lost), "{lost}");
    let verdict = Solver::new(m).quasi_static(Given::Volume(volume)).expect("a verdict");
    let QuasiStaticVerdict::Converged(rest) = verdict else { panic!("{verdict:?}") };
    assert_close("L", end.state.length_m, rest.state.length_m, 1e-2);
    assert_close("H0", end.state.thickness_0_m(), rest.state.thickness_0_m(), 1e-2);
}
