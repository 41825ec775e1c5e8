//! Continuation: folds where they are known, the rule's roots along the way, kinks that do not stop it.

use crate::{assert_all_close, assert_close, converged, model};
use melange_solver::branch::fold_curve::{FoldCurve, FoldCurvePlan, FoldCurveTraced};
use melange_solver::branch::{Branch, BranchPlan, BranchPoint, End, Traced};
use melange_solver::control::{Control, Setting};
use melange_solver::force::force_n_per_m;
use melange_solver::melt::MeltShape;
use melange_solver::params::{ParameterError, Parameters};
use melange_solver::physics::terminus::CalvingLaw;
use melange_solver::steady::SteadyVerdict;
use melange_solver::{Model, Solver};
use std::ops::ControlFlow;

pub fn control(name: &str) -> Control {
    Control::named(name).expect("a control's name")
}

pub fn with_linear_melt(change: impl FnOnce(&mut Parameters)) -> Model {
    model(change).with_melt_shape(MeltShape::named("linear").expect("a shape's name"))
}

/// The collapse of linear-shaped melt in a fjord 5,600 m wide, over the mean melt rate.
pub fn collapse(n_cells: usize, bounds: (f64, f64)) -> BranchPlan {
    let model = with_linear_melt(|p| {
        (p.n_cells, p.melt_rate_m_per_day, p.width_m) = (n_cells, 0.35, 5600.0);
    });
    BranchPlan::new(Setting { model, law: None }, control("melt_rate_m_per_day"), bounds)
}

pub fn traced(plan: &BranchPlan) -> Branch {
    let outcome = plan.trace(|_: &BranchPoint| ControlFlow::Continue(())).expect("a branch");
    let Traced::Branch(branch) = outcome else { panic!("there is a start: {outcome:?}") };
    *branch
}

/// Computed here first, and nowhere else: the digits agree between bounds, steps and starts, and N = 20 to
/// 200 converge to one another. Others found the fold of N = 20 near 0.428 m/d by hundreds of transients.
#[test]
fn the_collapse_has_its_fold_and_both_branches() {
    let folds = [(20, 0.425457369, 10_323.767, 39.6423), (50, 0.425173579, 10_077.881, 39.5372)];
    for (n_cells, melt, length_m, thickness_m) in folds {
        let plan = BranchPlan { roots_at: vec![0.4], ..collapse(n_cells, (0.35, 0.5)) };
        let branch = traced(&plan);
        assert_eq!(branch.ends, (End::Bound, End::Bound));
        let [fold] = &branch.folds[..] else { panic!("one fold: {:?}", branch.folds) };
        assert!(fold.is_maximum && !fold.is_on_kink);
        assert_close("melt", fold.point.control, melt, 2e-9);
        assert_close("L", fold.point.state.length_m, length_m, 1e-6);
        assert_close("H0", fold.point.state.thickness_0_m(), thickness_m, 2e-6);
        let growth = fold.point.spectrum.as_ref().expect("growth rates").rates[0];
        assert!(growth.re_per_a.abs() < 1e-6 && growth.im_per_a == 0.0, "{growth:?}");

        let upper = branch.points.iter().filter(|p| p.segment == 0);
        let lower = branch.points.iter().filter(|p| p.segment == 1);
        assert!(upper.clone().count() > 8 && lower.clone().count() > 5);
        let unstable = |p: &BranchPoint| p.spectrum.as_ref().expect("growth rates").unstable();
        assert!(upper.clone().all(|p| unstable(p) == 0));
        assert!(lower.clone().all(|p| unstable(p) == 1));
        assert!(branch.points.iter().all(|p| p.residual_norm < 1e-9));
        // Arclength only grows, by the steps told.
        for pair in branch.points.windows(2) {
            let run = pair[1].arclength - pair[0].arclength;
            let step = if pair[1].arclength > 0.0 { pair[1].step } else { pair[0].step };
            assert!(run > 0.0 && (run - step).abs() < 1e-9, "{run} {step}");
        }

        let [stable, other] = &branch.roots[..] else { panic!("two roots: {:?}", branch.roots) };
        let steady = Solver::new(plan.setting_at(0.4).model).steady(None).expect("a verdict");
        let steady = converged(steady).state;
        assert_all_close("H", &stable.state.thickness_m, &steady.thickness_m, 1e-9);
        assert_all_close("g", &stable.state.fluidity_per_a, &steady.fluidity_per_a, 1e-8);
        assert!(other.state.length_m < 0.6 * stable.state.length_m && unstable(other) == 1);
    }
}

/// Every point of the upper branch is the steady state that the rule picks.
#[test]
fn points_of_a_branch_are_the_steady_states_there() {
    let plan = BranchPlan { with_stability: false, ..collapse(50, (0.3, 0.5)) };
    let branch = traced(&plan);
    for point in branch.points.iter().filter(|p| p.segment == 0 && p.control < 0.42) {
        let mut solver = Solver::new(plan.setting_at(point.control).model);
        let state = converged(solver.steady(None).expect("a verdict")).state;
        assert_close("L", point.state.length_m, state.length_m, 1e-9);
        assert_all_close("H", &point.state.thickness_m, &state.thickness_m, 1e-9);
    }
}

/// At N = 50 a cell's fluidity has a fold of its own at a melt rate of 0.2174 m/d, beyond which the cell
/// rests below yield; the branch goes on to where nothing is left of the mélange.
#[test]
fn kinks_of_the_rheology_do_not_stop_a_branch() {
    for n_cells in [20, 50, 100] {
        let plan = BranchPlan { with_stability: false, ..collapse(n_cells, (0.1, 0.5)) };
        let branch = traced(&plan);
        let (End::Verdict(thick), End::Verdict(thin)) = &branch.ends else {
            panic!("{:?}", branch.ends)
        };
        assert!(
            thick.contains("thicker than the terminus") && thin.contains("no longer a mélange")
        );
        let last = branch.points.last().expect("points");
        assert!(last.control < 0.2 && last.state.thickness_0_m() < 26.5, "{}", last.control);
        assert_eq!(branch.folds.len(), 1);
    }
}

/// With uniform melt a widening fjord has two separate steady states, thick and thin, between two folds, and
/// a third fold where the thin one collapses.
#[test]
fn a_branch_turns_three_times_as_the_fjord_widens() {
    let model = model(|_| ());
    let gradient = control("width_gradient");
    let plan = BranchPlan::new(Setting { model, law: None }, gradient, (-0.05, 0.2));
    let branch = traced(&plan);
    let folds: Vec<f64> = branch.folds.iter().map(|fold| fold.point.control).collect();
    assert_all_close("dW/dx", &folds, &[0.0790006755, 0.0701293581, 0.0937683062], 1e-8);
    let unstable = |segment: usize| {
        let mut points = branch.points.iter().filter(|p| p.segment == segment);
        points.all(|p| p.spectrum.as_ref().expect("growth rates").unstable() == segment % 2)
    };
    assert!((0..4).all(unstable));
    assert_eq!(branch.points.last().map(|p| p.segment), Some(3));
}

#[test]
fn every_control_can_be_followed() {
    let linear = |melt: f64| {
        with_linear_melt(|p| {
            (p.n_cells, p.melt_rate_m_per_day, p.width_m) = (20, melt, 5600.0);
        })
    };
    for (name, bounds) in [
        ("width_m", (3000.0, 8000.0)),
        ("calving_rate_m_per_a", (4500.0, 8000.0)),
        ("calving_flux_m2_per_a", (3e6, 5e6)),
        ("terminus_thickness_m", (500.0, 700.0)),
        ("d_m", (10.0, 50.0)),
        ("b", (5e3, 5e4)),
        ("A", (0.2, 3.0)),
        ("mu_s", (0.2, 0.4)),
        ("strain_rate_regularisation_per_a", (0.5, 2.0)),
        ("water_drag_n_per_m", (0.0, 1e5)),
    ] {
        let setting = Setting { model: linear(0.38), law: None };
        let plan = BranchPlan::new(setting, control(name), bounds);
        let branch = traced(&BranchPlan { with_stability: false, ..plan.clone() });
        assert!(branch.points.len() > 4, "{name}: {:?}", branch.ends);
        for end in [&branch.ends.0, &branch.ends.1] {
            assert!(matches!(end, End::Bound | End::Verdict(_)), "{name}: {end:?}");
        }
        // A point far from the start solves the problem that it says it solves.
        let start = branch.points.iter().find(|p| p.arclength == 0.0).expect("the start");
        let stable = branch.points.iter().filter(|p| p.segment == start.segment);
        let far = stable.max_by(|a, b| a.arclength.abs().total_cmp(&b.arclength.abs()));
        let far = far.expect("at least the start");
        let mut solver = Solver::new(plan.setting_at(far.control).model);
        let state = converged(solver.steady(None).expect("a verdict")).state;
        assert_close(name, far.state.length_m, state.length_m, 1e-8);
        assert_ne!(far.control, start.control);
    }
}

/// Eq. 31 with another α: the calving rate is the law's at the state's own force.
#[test]
fn a_calving_law_is_followed_in_its_strength() {
    let model = model(|p| p.n_cells = 20);
    let start = converged(Solver::new(model.clone()).steady(None).expect("a verdict")).state;
    let rate = model.parameters().calving_rate_m_per_a;
    let law = CalvingLaw::steady_feedback(rate, force_n_per_m(&start));
    let alpha = law.per_force_m2_per_a_n;
    let setting = Setting { model, law: Some(law) };
    let plan =
        BranchPlan::new(setting, control("per_force_m2_per_a_n"), (0.9 * alpha, 1.1 * alpha));
    let branch = traced(&plan);
    assert_eq!(branch.ends, (End::Bound, End::Bound));
    let at_start = branch.points.iter().find(|p| p.arclength == 0.0).expect("the start");
    assert_close("L", at_start.state.length_m, start.length_m, 1e-9);
    for point in &branch.points {
        let force = force_n_per_m(&point.state);
        let asked_for = law.rate_m_per_a - point.control * force;
        let mut given = *plan.setting.model.parameters();
        given.calving_rate_m_per_a = asked_for;
        let given = Model::new(given, plan.setting.model.closure()).expect("in range");
        let state = converged(Solver::new(given).steady(None).expect("a verdict")).state;
        assert_close("L", point.state.length_m, state.length_m, 1e-8);
    }
}

fn curve(plan: &FoldCurvePlan) -> FoldCurve {
    let outcome = plan.trace(|_| ControlFlow::Continue(())).expect("a curve");
    let FoldCurveTraced::Curve(curve) = outcome else { panic!("there is a fold: {outcome:?}") };
    curve
}

#[test]
fn folds_are_followed_in_a_second_parameter() {
    let branch = BranchPlan { with_stability: false, ..collapse(20, (0.1, 1.0)) };
    let plan = FoldCurvePlan {
        branch,
        fold: 0,
        second: control("width_m"),
        second_bounds: (4000.0, 7000.0),
    };
    let curve = curve(&plan);
    assert_eq!(curve.ends, (End::Bound, End::Bound));
    assert!(curve.points.windows(2).all(|pair| pair[0].second < pair[1].second));
    assert!(curve.points.windows(2).all(|pair| pair[0].point.control > pair[1].point.control));
    assert!(curve.points.iter().all(|p| p.is_maximum));
    for (place, width_m) in [(0, 4000.0), (curve.points.len() - 1, 7000.0)] {
        let point = &curve.points[place];
        assert_eq!(point.second, width_m);
        let model = with_linear_melt(|p| {
            (p.n_cells, p.melt_rate_m_per_day, p.width_m) = (20, 0.3, width_m);
        });
        let setting = Setting { model, law: None };
        let alone = BranchPlan::new(setting, control("melt_rate_m_per_day"), (0.25, 1.0));
        let fold = &traced(&BranchPlan { with_stability: false, ..alone }).folds[0];
        assert_close("melt", point.point.control, fold.point.control, 1e-9);
        assert_close("L", point.point.state.length_m, fold.point.state.length_m, 1e-6);
    }
}

#[test]
fn what_cannot_be_followed_is_refused() {
    let plan = collapse(20, (0.1, 0.5));
    let refusal = |plan: &BranchPlan| match plan.check() {
        Err(ParameterError::Contradiction { name, value, permitted }) => (name, value, permitted),
        other => panic!("expected a refusal, got {other:?}"),
    };
    let low = BranchPlan { bounds: (0.4, 0.5), ..plan.clone() };
    assert_eq!(refusal(&low).0, "melt_rate_m_per_day");
    assert_eq!(refusal(&low).1, 0.35);
    let reversed = BranchPlan { bounds: (0.5, 0.1), ..plan.clone() };
    assert!(refusal(&reversed).2.contains("from low to high"));
    let outside = BranchPlan { bounds: (-1.0, 0.5), ..plan.clone() };
    assert_eq!(refusal(&outside).1, -1.0);
    let asked = BranchPlan { roots_at: vec![0.7], ..plan.clone() };
    assert_eq!(refusal(&asked).1, 0.7);
    let lawless =
        BranchPlan { control: control("rate_m_per_a"), bounds: (-1.0, 1.0), ..plan.clone() };
    assert!(refusal(&lawless).2.contains("calving law"));
    assert!(Control::named("n_cells").is_none());

    let none = BranchPlan { bounds: (0.1, 5.0), ..plan };
    let none = BranchPlan { setting: none.setting_at(4.0), ..none };
    let outcome = none.trace(|_: &BranchPoint| ControlFlow::Continue(()));
    assert!(matches!(outcome, Ok(Traced::NoStart(SteadyVerdict::NoSteadyState(_)))), "{outcome:?}");
}

#[test]
fn a_branch_stops_when_asked_to() {
    let mut seen = 0;
    let plan = BranchPlan { with_stability: false, ..collapse(20, (0.1, 0.5)) };
    let outcome = plan.trace(|_: &BranchPoint| {
        seen += 1;
        if seen < 3 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
    });
    let Ok(Traced::Branch(branch)) = outcome else { panic!("{outcome:?}") };
    assert_eq!((seen, branch.ends), (3, (End::Stopped, End::Stopped)));
}

/// Along a curve the number of growing perturbations is odd after an odd number of folds, but where a cell's
/// own kink intervenes, which is told; and no state comes twice. Parameters with folds close to one another.
#[test]
fn a_branch_stays_on_its_curve() {
    type Change = fn(&mut Parameters);
    let cases: [(Change, &str, &str, (f64, f64)); 6] = [
        (|p| p.melt_rate_m_per_day = 0.3, "uniform", "width_gradient", (-0.2, 0.3)),
        (
            |p| (p.melt_rate_m_per_day, p.n_cells) = (0.3, 20),
            "uniform",
            "width_gradient",
            (-0.2, 0.3),
        ),
        (|p| p.melt_rate_m_per_day = 0.3, "uniform", "mu_s", (0.1, 0.6)),
        (|p| (p.melt_rate_m_per_day, p.n_cells) = (0.6, 20), "linear", "mu_s", (0.1, 0.6)),
        (
            |p| (p.melt_rate_m_per_day, p.n_cells) = (0.8, 20),
            "uniform",
            "width_gradient",
            (-0.1, 0.2),
        ),
        (|p| p.n_cells = 50, "uniform", "width_gradient", (-0.5, 0.5)),
    ];
    for (change, shape, name, bounds) in cases {
        let model = model(change).with_melt_shape(MeltShape::named(shape).expect("a shape"));
        let plan = BranchPlan::new(Setting { model, law: None }, control(name), bounds);
        let branch = traced(&plan);
        assert!(!matches!(branch.ends, (End::Stuck(_), _) | (_, End::Stuck(_))));
        let start = branch.points.iter().find(|p| p.arclength == 0.0).expect("the start").segment;
        let mut jumps = 0;
        for point in &branch.points {
            jumps += usize::from(point.has_jumped);
            let odd = (point.segment + start) % 2 == 1;
            let unstable = point.spectrum.as_ref().expect("growth rates").unstable();
            assert!(
                (unstable % 2 == 1) == odd || jumps > 0,
                "{name} {bounds:?} at {}",
                point.control
            );
        }
        for (k, a) in branch.points.iter().enumerate() {
            for b in &branch.points[k + 1..] {
                let apart = (a.state.length_m / b.state.length_m - 1.0).abs()
                    + (a.state.thickness_0_m() / b.state.thickness_0_m() - 1.0).abs();
                assert!(
                    apart > 1e-9,
                    "{name} {bounds:?}: twice at {} and {}",
                    a.control,
                    b.control
                );
            }
        }
        for fold in &branch.folds {
            let (low, high) = fold.bracket;
            assert!(low <= high && (fold.is_on_kink || low == high));
            assert!(plan.bounds.0 <= low && high <= plan.bounds.1);
        }
    }
}

/// Close to a fold both of its roots are found, whatever lies between the points of the curve; a bound just
/// short of a fold ends the branch before it.
#[test]
fn roots_and_bounds_close_to_a_fold_are_seen() {
    const FOLD: f64 = 0.425457369;
    for below in [1e-4, 1e-5, 1e-7] {
        let plan = BranchPlan { roots_at: vec![FOLD - below], ..collapse(20, (0.35, 0.5)) };
        let roots = traced(&plan).roots;
        let [upper, lower] = &roots[..] else { panic!("two roots, not {}", roots.len()) };
        assert!(upper.state.length_m > 10_323.7 && lower.state.length_m < 10_323.8);
        assert_eq!((upper.segment, lower.segment), (0, 1));
        assert!(upper.control_by_arclength > 0.0 && lower.control_by_arclength < 0.0);

        let branch = traced(&collapse(20, (0.3, FOLD - below)));
        assert!(branch.folds.is_empty() && branch.ends.1 == End::Bound, "{:?}", branch.ends);
        let last = branch.points.last().expect("points");
        assert!(last.control == FOLD - below && last.control_by_arclength > 0.0);
    }
}

/// Wherever the bounds lie, the fold is the same to 1e-8.
#[test]
fn folds_do_not_depend_on_bounds() {
    let fold = |bounds: (f64, f64)| {
        let model = with_linear_melt(|p| {
            (p.n_cells, p.melt_rate_m_per_day, p.width_m) = (20, 0.38, 5600.0);
        });
        let plan = BranchPlan::new(Setting { model, law: None }, control("b"), bounds);
        let branch = traced(&BranchPlan { with_stability: false, ..plan });
        assert_eq!(branch.folds.len(), 1, "{bounds:?}");
        branch.folds[0].point.control
    };
    let expected = fold((4e3, 2e4));
    for bounds in [(1e3, 1e5), (1e3, 1e8), (1.0, 1e10)] {
        assert_close("b", fold(bounds), expected, 1e-8);
    }
}

#[test]
fn a_branch_has_no_more_points_than_asked_for() {
    for most_points in [3, 4, 10, 21] {
        let plan = BranchPlan { with_stability: false, most_points, ..collapse(20, (0.1, 0.5)) };
        assert_eq!(traced(&plan).points.len(), most_points);
    }
}

#[test]
fn steady_states_that_are_none_are_not_followed() {
    let widening = model(|p| (p.n_cells, p.width_gradient) = (20, 0.02));
    let moving = model(|p| (p.n_cells, p.terminus_velocity_m_per_a) = (20, 7_500.0));
    let law = CalvingLaw::steady_feedback(6000.0, 8e6);
    let advancing = CalvingLaw { per_advance_per_a: 1.0, ..law };
    let still = model(|p| p.n_cells = 20);
    for (model, law, name, bounds) in [
        (&widening, None, "calving_rate_m_per_a", (5000.0, 7000.0)),
        (&widening, None, "terminus_velocity_m_per_a", (5000.0, 7000.0)),
        (&moving, None, "width_gradient", (-0.02, 0.02)),
        (&moving, None, "calving_flux_m2_per_a", (3e6, 4e6)),
        (&widening, Some(law), "per_force_m2_per_a_n", (0.0, 1.0)),
        (&still, Some(advancing), "per_force_m2_per_a_n", (0.0, 1.0)),
    ] {
        let setting = Setting { model: model.clone(), law };
        let plan = BranchPlan::new(setting, control(name), bounds);
        assert!(matches!(plan.check(), Err(ParameterError::Contradiction { .. })), "{name}");
    }
    for (first, second) in [
        ("calving_flux_m2_per_a", "calving_rate_m_per_a"),
        ("terminus_thickness_m", "calving_flux_m2_per_a"),
        ("width_gradient", "calving_rate_m_per_a"),
        ("b", "b"),
    ] {
        assert!(!control(first).is_independent_of(control(second)), "{first} {second}");
    }
}
