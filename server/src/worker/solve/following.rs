//! Branches of steady states and curves of their folds: followed, and put into rows.

use super::super::dress::Ended;
use super::{SMOOTHING_LIMIT, failure, verdict_of};
use crate::domain::branch::{Following, Second};
use crate::domain::curve::CurveRow;
use crate::domain::run::RunSpec;
use crate::domain::status::Status;
use melange_solver::branch::fold_curve::FoldCurveTraced;
use melange_solver::branch::stability::Spectrum;
use melange_solver::branch::{Branch, BranchPlan, BranchPoint, Crossing, End, Fold, Traced};
use melange_solver::control::{Control, Setting};
use melange_solver::state::State;
use melange_solver::steady::SteadyVerdict;
use melange_solver::{Solver, force};
use std::ops::ControlFlow;

/// Growth rates that are stored of a point.
const RATES: usize = 3;

/// Follows a branch, or one of its folds; `None` if `stop` said so on the way.
pub fn followed(run: &RunSpec, following: &Following, stop: &dyn Fn() -> bool) -> Option<Ended> {
    match following.second {
        None => branch(run, following, stop),
        Some(second) => fold_curve(run, following, second, stop),
    }
}

fn branch(run: &RunSpec, following: &Following, stop: &dyn Fn() -> bool) -> Option<Ended> {
    let plan = run.branch_plan(following);
    let traced = plan.trace(|_: &BranchPoint| go_on(stop));
    if stop() {
        return None;
    }
    let branch = match traced {
        Ok(Traced::Branch(branch)) => branch,
        Ok(Traced::NoStart(verdict)) => return Some(verdict_of(verdict)),
        Err(e) => return Some(failure(&e)),
    };
    let rows = Rows { setting: &plan.setting, control: following.control, second: None };
    let mut curve: Vec<CurveRow> = branch.points.iter().map(|p| rows.point("point", p)).collect();
    curve.extend(branch.folds.iter().map(|fold| rows.fold(fold)));
    curve.extend(branch.crossings.iter().map(|crossing| rows.crossing(crossing)));
    let picked = picked(&plan, &branch, stop)?;
    curve.extend(
        branch.roots.iter().zip(&picked).map(|(root, is_picked)| CurveRow {
            is_picked: *is_picked,
            ..rows.point("root", root)
        }),
    );
    let ends = [(branch.points.first(), &branch.ends.0), (branch.points.last(), &branch.ends.1)];
    for (point, end) in ends {
        curve.extend(point.map(|point| rows.end(point, following.bounds, end)));
    }
    let detail = format!(
        "a branch of {} with {}; it ends where {}, and where {}",
        counted(branch.points.len(), "point"),
        counted(branch.folds.len(), "fold"),
        rows.told(branch.points.first(), following.bounds, &branch.ends.0),
        rows.told(branch.points.last(), following.bounds, &branch.ends.1),
    );
    // The only point that no step led to.
    let start = branch.points.iter().find(|point| point.step == 0.0);
    Some(rows.ended(start, curve, detail, iterations(&branch)))
}

/// Of each root, whether the rule for steady states picks it at its value; not told with a calving law, or where
/// the solve fails. `None` if `stop` said so.
fn picked(
    plan: &BranchPlan,
    branch: &Branch,
    stop: &dyn Fn() -> bool,
) -> Option<Vec<Option<bool>>> {
    if plan.setting.law.is_some() {
        return Some(vec![None; branch.roots.len()]);
    }
    let mut told = Vec::with_capacity(branch.roots.len());
    for roots in branch.roots.chunk_by(|a, b| a.control == b.control) {
        if stop() {
            return None;
        }
        let verdict = Solver::new(plan.setting_at(roots[0].control).model).steady(None);
        told.extend(roots.iter().map(|root| match &verdict {
            Ok(SteadyVerdict::Converged { solution, .. }) => {
                Some(is_same(&root.state, &solution.state))
            }
            Ok(_) => Some(false),
            Err(_) => None,
        }));
    }
    Some(told)
}

/// Whether two solutions are one.
fn is_same(a: &State, b: &State) -> bool {
    /// Relative difference of solutions that are one; the discrete roots of the base case differ by ten times
    /// as much.
    const SAME: f64 = 1e-7;
    let is_near = |a: f64, b: f64| (a - b).abs() <= SAME * b.abs();
    is_near(a.length_m, b.length_m) && is_near(a.thickness_0_m(), b.thickness_0_m())
}

fn fold_curve(
    run: &RunSpec,
    following: &Following,
    second: Second,
    stop: &dyn Fn() -> bool,
) -> Option<Ended> {
    let plan = run.fold_curve_plan(following, second);
    let traced = plan.trace(|_| go_on(stop));
    if stop() {
        return None;
    }
    let curve = match traced {
        Ok(FoldCurveTraced::Curve(curve)) => curve,
        Ok(FoldCurveTraced::NoFold(branch)) => {
            return Some(without_fold(following, second, &branch));
        }
        Ok(FoldCurveTraced::NoStart(verdict)) => return Some(verdict_of(verdict)),
        Err(e) => return Some(failure(&e)),
    };
    let at = |value: f64| {
        let mut setting = plan.branch.setting.clone();
        second.control.set(&mut setting, value);
        setting
    };
    let row_of = |kind: &str, value: f64, point: &BranchPoint| {
        let setting = at(value);
        let rows = Rows { setting: &setting, control: following.control, second: Some(second) };
        CurveRow { second_value: Some(value), ..rows.point(kind, point) }
    };
    let mut table: Vec<CurveRow> = (curve.points.iter())
        .map(|fold| CurveRow {
            is_maximum: Some(fold.is_maximum),
            ..row_of("fold", fold.second, &fold.point)
        })
        .collect();
    let ends = [(curve.points.first(), &curve.ends.0), (curve.points.last(), &curve.ends.1)];
    let mut told = Vec::new();
    for (fold, end) in ends {
        let Some(fold) = fold else { continue };
        let reaches_its_own = (second.bounds.0 == fold.second) || (second.bounds.1 == fold.second);
        let (control, value, bounds) = if *end == End::Bound && !reaches_its_own {
            (following.control, fold.point.control, following.bounds)
        } else {
            (second.control, fold.second, second.bounds)
        };
        let (reason, detail) = why(end, control, value, bounds);
        told.push(detail.clone());
        table.push(CurveRow {
            second_value: Some(fold.second),
            control_value: Some(fold.point.control),
            reason: Some(reason.to_owned()),
            detail: Some(detail),
            kind: Some("end".to_owned()),
            ..named(following.control, Some(second))
        });
    }
    let detail = format!(
        "a fold followed through {}; the curve ends where {}",
        counted(curve.points.len(), "point"),
        told.join(", and where ")
    );
    let value = second.control.value(&plan.branch.setting);
    let start = curve.points.iter().find(|fold| fold.second == value);
    let rows =
        Rows { setting: &plan.branch.setting, control: following.control, second: Some(second) };
    let iterations = curve.points.iter().map(|fold| fold.point.iterations).sum();
    Some(rows.ended(start.map(|fold| &fold.point), table, detail, iterations))
}

/// A branch that has no such fold is an answer, of which there is nothing to follow.
fn without_fold(following: &Following, second: Second, branch: &Branch) -> Ended {
    let detail = format!(
        "the branch has {} between {} = {} and {}, and fold {} is to be followed",
        counted(branch.folds.len(), "fold"),
        following.control.name(),
        following.bounds.0,
        following.bounds.1,
        second.fold,
    );
    Ended { iterations: iterations(branch), ..Ended::verdict(Status::NoFold, detail) }
}

fn iterations(branch: &Branch) -> usize {
    branch.points.iter().map(|point| point.iterations).sum()
}

fn counted(n: usize, what: &str) -> String {
    if n == 1 { format!("1 {what}") } else { format!("{n} {what}s") }
}

fn go_on(stop: &dyn Fn() -> bool) -> ControlFlow<()> {
    if stop() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
}

/// A row with nothing but the names of what varies.
fn named(control: Control, second: Option<Second>) -> CurveRow {
    let second = second.map(|second| second.control);
    CurveRow {
        control: Some(control.name().to_owned()),
        control_unit: Some(control.unit().to_owned()),
        second: second.map(|second| second.name().to_owned()),
        second_unit: second.map(|second| second.unit().to_owned()),
        ..CurveRow::default()
    }
}

/// Why a curve ends: in a word, and as the end of a sentence that begins with "where".
fn why(end: &End, control: Control, value: f64, bounds: (f64, f64)) -> (&'static str, String) {
    /// A number as a reader wants it: six digits behind the first.
    fn short(value: f64) -> f64 {
        format!("{value:.6e}").parse().unwrap_or(value)
    }
    let at = format!("{} = {}", control.name(), short(value));
    match end {
        End::Bound => {
            let is_low = (value - bounds.0).abs() < (value - bounds.1).abs();
            let bound = if is_low { bounds.0 } else { bounds.1 };
            ("bound", format!("{} reaches its bound {bound}", control.name()))
        }
        End::Verdict(evidence) => {
            ("verdict", format!("the state is no mélange any more, beyond {at}: {evidence}"))
        }
        End::Closed => ("closed", format!("it comes back to where it began, at {at}")),
        End::MostPoints => {
            ("most_points", format!("it has as many points as were asked for, at {at}"))
        }
        End::Stuck(error) => {
            ("stuck", format!("no step, however short, leads on from {at}: {error}"))
        }
        End::Stopped => ("stopped", format!("it was told to stop, at {at}")),
    }
}

/// Makes rows of a setting's states.
struct Rows<'a> {
    setting: &'a Setting,
    control: Control,
    second: Option<Second>,
}

impl Rows<'_> {
    fn point(&self, kind: &str, point: &BranchPoint) -> CurveRow {
        let mut setting = self.setting.clone();
        self.control.set(&mut setting, point.control);
        let s = &point.state;
        let rates = |of: fn(&Spectrum) -> Vec<f64>| point.spectrum.as_ref().map(of);
        CurveRow {
            kind: Some(kind.to_owned()),
            control_value: Some(point.control),
            segment: Some(point.segment as i64),
            arclength: Some(point.arclength),
            step: Some(point.step),
            iterations: Some(point.iterations as i64),
            control_by_arclength: Some(point.control_by_arclength),
            // At a fold the leading growth rate is 0: its sign would be that of a rounding error.
            stable: point.spectrum.as_ref().filter(|_| kind != "fold").map(Spectrum::is_stable),
            unstable_count: point.spectrum.as_ref().map(|of| of.unstable() as i64),
            growth_rate_re_per_a: rates(|of| leading(of, true)),
            growth_rate_im_per_a: rates(|of| leading(of, false)),
            thickness_0_m: Some(s.thickness_0_m()),
            length_m: Some(s.length_m),
            force_n_per_m: Some(force::force_n_per_m(s)),
            force_quasi_static_n_per_m: Some(force::force_quasi_static_n_per_m(s)),
            velocity_end_m_per_a: Some(s.velocity_m_per_a[s.n_cells()]),
            volume_m3: Some(force::volume_m3(&setting.model, s, 0.0)),
            residual_norm: Some(point.residual_norm),
            has_jumped: Some(point.has_jumped),
            ..named(self.control, self.second)
        }
    }

    fn fold(&self, fold: &Fold) -> CurveRow {
        CurveRow {
            is_maximum: Some(fold.is_maximum),
            is_on_kink: Some(fold.is_on_kink),
            bracket: Some(vec![fold.bracket.0, fold.bracket.1]),
            ..self.point("fold", &fold.point)
        }
    }

    fn crossing(&self, crossing: &Crossing) -> CurveRow {
        let Crossing { bracket, arclengths, unstable, rates: (before, after), is_at_jump } =
            crossing;
        CurveRow {
            kind: Some("crossing".to_owned()),
            growth_rate_re_per_a: Some(vec![before.re_per_a, after.re_per_a]),
            growth_rate_im_per_a: Some(vec![before.im_per_a, after.im_per_a]),
            has_jumped: Some(*is_at_jump),
            bracket: Some(vec![bracket.0, bracket.1]),
            arclengths: Some(vec![arclengths.0, arclengths.1]),
            unstable_counts: Some(vec![unstable.0 as f64, unstable.1 as f64]),
            ..named(self.control, self.second)
        }
    }

    fn end(&self, point: &BranchPoint, bounds: (f64, f64), end: &End) -> CurveRow {
        let (reason, detail) = why(end, self.control, point.control, bounds);
        CurveRow {
            kind: Some("end".to_owned()),
            control_value: Some(point.control),
            segment: Some(point.segment as i64),
            arclength: Some(point.arclength),
            reason: Some(reason.to_owned()),
            detail: Some(detail),
            ..named(self.control, self.second)
        }
    }

    fn told(&self, point: Option<&BranchPoint>, bounds: (f64, f64), end: &End) -> String {
        let value = point.map_or(f64::NAN, |point| point.control);
        why(end, self.control, value, bounds).1
    }

    /// The result, whose numbers are those of the start.
    fn ended(
        &self,
        start: Option<&BranchPoint>,
        curve: Vec<CurveRow>,
        detail: String,
        iterations: usize,
    ) -> Ended {
        let mut there = self.setting.clone();
        if let Some(start) = start {
            self.control.set(&mut there, start.control);
        }
        let mut parameters = *there.model.parameters();
        if let (Some(law), Some(start)) = (&there.law, start) {
            let force = force::force_n_per_m(&start.state);
            parameters.calving_rate_m_per_a = law.rate_m_per_a(force, 0.0);
        }
        Ended {
            iterations,
            residual_norm: start.map_or(f64::NAN, |start| start.residual_norm),
            state: start.map(|start| start.state.clone()),
            model: Some(there.model.with_parameters(parameters)),
            root_evidence: start.map(|_| SMOOTHING_LIMIT),
            curve,
            ..Ended::verdict(Status::Converged, detail)
        }
    }
}

/// The first growth rates of a spectrum, real or imaginary parts.
fn leading(spectrum: &Spectrum, is_real: bool) -> Vec<f64> {
    let finite = spectrum.rates.iter().filter(|r| r.re_per_a.is_finite() && r.im_per_a.is_finite());
    finite.take(RATES).map(|r| if is_real { r.re_per_a } else { r.im_per_a }).collect()
}
