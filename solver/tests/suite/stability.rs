//! Growth rates against what perturbed states do in time.

use crate::branches::{collapse, traced};
use crate::{assert_close, model};
use melange_solver::branch::{BranchPlan, BranchPoint};
use melange_solver::control::{Control, Setting};
use melange_solver::observe::Moment;
use melange_solver::sensitivity::Linearised;
use melange_solver::state::State;
use melange_solver::transient::{Ending, Plan, TransientEnd};
use melange_solver::{Model, Solver};
use std::ops::ControlFlow;

/// A state with H − d stretched by a share: H_L = d still holds.
fn perturbed(s: &State, d_m: f64, share: f64) -> State {
    let mut changed = s.clone();
    changed.thickness_m.iter_mut().for_each(|h| *h = d_m + (*h - d_m) * (1.0 + share));
    changed
}

fn run(model: &Model, start: State, plan: &Plan) -> TransientEnd {
    let mut quiet = |_: Moment<'_>| ControlFlow::Continue(());
    Solver::new(model.clone()).transient(start, plan, &mut quiet).expect("a verdict")
}

/// ln of how much the difference of two runs begun on both sides of a state, a share of H − d away, grows
/// between two times, per year.
fn observed_growth(model: &Model, s: &State, share: f64, times_a: (f64, f64)) -> f64 {
    let d_m = model.parameters().d_m;
    let apart = |time_a: f64| {
        let plan = Plan::controlled(1e-9, vec![time_a]);
        let [up, down] = [share, -share].map(|share| run(model, perturbed(s, d_m, share), &plan));
        assert_eq!((up.ending, down.ending), (Ending::Completed, Ending::Completed));
        up.state.length_m - down.state.length_m
    };
    (apart(times_a.1) / apart(times_a.0)).abs().ln() / (times_a.1 - times_a.0)
}

#[test]
fn leading_growth_rates_are_those_of_small_perturbations() {
    let plan = BranchPlan { roots_at: vec![0.37, 0.41, 0.42], ..collapse(20, (0.35, 0.5)) };
    let roots = traced(&plan).roots;
    assert_eq!(roots.len(), 6);
    for root in roots {
        let model = plan.setting_at(root.control).model;
        let rates = &root.spectrum.as_ref().expect("growth rates").rates;
        assert_eq!(rates.len(), 19);
        let leading = rates[0];
        assert_eq!(leading.im_per_a, 0.0);
        // Long enough for the others to die away; the perturbation stays small, and large beside the
        // tolerance of the steps.
        let decays = leading.re_per_a < 0.0;
        let (share, times_a) = if decays { (1e-3, (1.2, 2.0)) } else { (1e-5, (0.3, 0.5)) };
        let growth = observed_growth(&model, &root.state, share, times_a);
        let what = format!("growth at melt {} on segment {}", root.control, root.segment);
        assert_close(&what, growth, leading.re_per_a, 1e-3);
    }
}

/// A splitmix64 fraction.
fn fraction(seed: &mut u64) -> f64 {
    *seed = seed.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut z = *seed;
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
}

/// At 50 random points of both branches: what is told stable comes back after a perturbation, what is told
/// unstable goes away, to collapse on one side and to the other branch on the other.
#[test]
fn verdicts_agree_with_transients_at_fifty_random_points() {
    let mut seed = 20;
    let melts: Vec<f64> = (0..25).map(|_| 0.36 + 0.06 * fraction(&mut seed)).collect();
    let plan = BranchPlan { roots_at: melts, ..collapse(20, (0.35, 0.5)) };
    let roots: Vec<BranchPoint> = traced(&plan).roots;
    assert_eq!(roots.len(), 50);
    let mut counts = [0, 0];
    for root in &roots {
        let model = plan.setting_at(root.control).model;
        let is_stable = root.spectrum.as_ref().expect("growth rates").is_stable();
        assert_eq!(is_stable, root.segment == 0);
        let d_m = model.parameters().d_m;
        let ends = [0.01, -0.01].map(|share| {
            let start = perturbed(&root.state, d_m, share);
            run(&model, start, &Plan::controlled(1e-5, vec![15.0]))
        });
        if is_stable {
            for end in &ends {
                assert_eq!(end.ending, Ending::Completed);
                assert_close("L", end.state.length_m, root.state.length_m, 2e-3);
            }
        } else {
            let above = ends[0].state.length_m > 1.2 * root.state.length_m;
            assert!(ends[0].ending == Ending::Completed && above, "melt {}", root.control);
            assert_eq!(ends[1].ending, Ending::Collapsed, "melt {}", root.control);
        }
        counts[usize::from(is_stable)] += 1;
    }
    assert_eq!(counts, [25, 25]);
}

/// The spectrum of a state alone is that of its point on a branch.
#[test]
fn a_steady_state_tells_its_growth_rates_without_a_branch() {
    let setting = Setting { model: model(|p| p.n_cells = 20), law: None };
    let melt = Control::named("melt_rate_m_per_day").expect("a control");
    let plan = BranchPlan::new(setting.clone(), melt, (0.55, 0.65));
    let branch = traced(&plan);
    let start = branch.points.iter().find(|p| p.arclength == 0.0).expect("the start");
    let alone = Linearised::at(&setting, &start.state).expect("regular").spectrum();
    let on_branch = start.spectrum.as_ref().expect("growth rates");
    for (a, b) in alone.expect("growth rates").rates.iter().zip(&on_branch.rates).take(5) {
        assert_close("growth", a.re_per_a, b.re_per_a, 1e-8);
    }
}
