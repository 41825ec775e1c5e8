//! Branches of steady states of parameters drawn at random: whether any of them gets stuck, and whether what
//! is told stable comes back in time, and what is told unstable goes away. Knows the solver, no file, no
//! queue and no transport.

use super::{Numbers, median};
use melange_solver::branch::{Branch, BranchPlan, BranchPoint, End, Traced};
use melange_solver::control::{Control, Setting};
use melange_solver::melt::MeltShape;
use melange_solver::observe::Moment;
use melange_solver::params::Parameters;
use melange_solver::physics::closure::UpstreamClosure;
use melange_solver::state::State;
use melange_solver::transient::{Ending, Plan};
use melange_solver::{Model, Solver};
use rayon::prelude::*;
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt;
use std::ops::ControlFlow;
use std::time::Instant;

/// What a soak is asked for.
#[derive(Debug, Clone, Copy)]
pub struct Request {
    /// Branches.
    pub count: u64,
    /// Seed of the drawing.
    pub seed: u64,
}

/// Parameters that are drawn, evenly in the logarithm.
const DRAWS: [(&str, f64, f64); 6] = [
    ("melt_rate_m_per_day", 0.25, 1.2),
    ("width_m", 3000.0, 8000.0),
    ("d_m", 10.0, 50.0),
    ("b", 3e3, 1e5),
    ("mu_s", 0.2, 0.45),
    ("A", 0.2, 4.0),
];
/// What is followed, from a third of its value to three times it but for the gradient.
const CONTROLS: [&str; 8] = [
    "melt_rate_m_per_day",
    "width_m",
    "width_gradient",
    "calving_flux_m2_per_a",
    "d_m",
    "b",
    "A",
    "mu_s",
];
/// Bounds of the width's gradient, which begins at 0.
const GRADIENTS: (f64, f64) = (-0.05, 0.05);
/// H − d is stretched by this share, up and down, where a verdict is tried by time.
const PERTURBATION: f64 = 0.01;
/// A state goes away where it ends this many times farther than it began, and comes back where it ends this
/// share nearer; in between, time was too short to tell.
const FARTHER: f64 = 3.0;
/// Time given, in units of the leading growth rate's inverse …
const LIFETIMES: f64 = 4.0;
/// … and at most, a.
const LONGEST_A: f64 = 30.0;
/// Shares of H_t and of d beyond which a perturbation may lead to a verdict.
const NEARLY_OVERTHICK: f64 = 0.9;
const NEARLY_GONE: f64 = 1.1;
/// Growth rates below this are too slow to try, a⁻¹.
const SLOW_PER_A: f64 = 0.15;

/// What a soak came to; times aside the same for the same request on any machine.
#[derive(Debug, Clone, Serialize)]
pub struct Report {
    /// Branches asked for.
    pub count: u64,
    /// Seed of the drawing.
    pub seed: u64,
    /// Those that had no steady state to begin with.
    pub without_start: u64,
    /// How many ends of branches are of which kind.
    pub ends: BTreeMap<&'static str, u64>,
    /// Folds, and those of them on a kink.
    pub folds: u64,
    /// Folds that are bracketed only.
    pub folds_on_kinks: u64,
    /// Points at which another discrete root took over.
    pub jumps: u64,
    /// Changes of stability elsewhere.
    pub crossings: u64,
    /// How many verdicts of stability were tried by time, and how those tries ended.
    pub verdicts: BTreeMap<&'static str, u64>,
    /// What failed, got stuck or contradicts.
    pub findings: Vec<String>,
    /// Median time of a branch, ms.
    pub median_ms: f64,
    /// Longest time of a branch, ms.
    pub slowest_ms: f64,
}

impl Report {
    /// Whether nothing failed, got stuck or contradicts.
    pub fn is_clean(&self) -> bool {
        self.findings.is_empty()
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{} branches, seed {}", self.count, self.seed)?;
        writeln!(f, "  without a start    {}", self.without_start)?;
        for (end, n) in &self.ends {
            writeln!(f, "  ends: {end:<12} {n}")?;
        }
        writeln!(f, "  folds              {} ({} on kinks)", self.folds, self.folds_on_kinks)?;
        writeln!(f, "  other crossings    {}", self.crossings)?;
        writeln!(f, "  jumps              {}", self.jumps)?;
        for (verdict, n) in &self.verdicts {
            writeln!(f, "  verdicts: {verdict:<22} {n}")?;
        }
        writeln!(f, "  median {:.1} ms, slowest {:.0} ms", self.median_ms, self.slowest_ms)?;
        for finding in &self.findings {
            writeln!(f, "  FOUND {finding}")?;
        }
        Ok(())
    }
}

/// What one branch came to.
struct Seen {
    outcome: Result<Option<Branch>, String>,
    verdict: Option<(&'static str, Option<String>)>,
    name: String,
    duration_ms: f64,
}

/// Draws, follows and tries.
pub fn soak(request: Request, done: impl Fn() + Sync) -> Report {
    let seen: Vec<Seen> = (0..request.count)
        .into_par_iter()
        .map(|index| {
            let seen = one(request.seed, index);
            done();
            seen
        })
        .collect();
    let mut report = Report {
        count: request.count,
        seed: request.seed,
        without_start: 0,
        ends: BTreeMap::new(),
        folds: 0,
        folds_on_kinks: 0,
        jumps: 0,
        crossings: 0,
        verdicts: BTreeMap::new(),
        findings: Vec::new(),
        median_ms: 0.0,
        slowest_ms: 0.0,
    };
    let mut times = Vec::new();
    for seen in seen {
        match seen.outcome {
            Err(error) => report.findings.push(format!("{}: {error}", seen.name)),
            Ok(None) => report.without_start += 1,
            Ok(Some(branch)) => {
                times.push(seen.duration_ms);
                report.folds += branch.folds.len() as u64;
                report.folds_on_kinks +=
                    branch.folds.iter().filter(|fold| fold.is_on_kink).count() as u64;
                report.jumps += branch.points.iter().filter(|p| p.has_jumped).count() as u64;
                report.crossings += branch.crossings.len() as u64;
                for end in [&branch.ends.0, &branch.ends.1] {
                    let kind = match end {
                        End::Bound => "bound",
                        End::Verdict(_) => "verdict",
                        End::Closed => "closed",
                        End::MostPoints => "most points",
                        End::Stuck(_) | End::Stopped => "stuck",
                    };
                    *report.ends.entry(kind).or_default() += 1;
                    if let End::Stuck(why) = end {
                        report.findings.push(format!("{}: stuck: {why}", seen.name));
                    }
                }
            }
        }
        if let Some((verdict, finding)) = seen.verdict {
            *report.verdicts.entry(verdict).or_default() += 1;
            report.findings.extend(finding.map(|finding| format!("{}: {finding}", seen.name)));
        }
    }
    report.slowest_ms = times.iter().copied().fold(0.0, f64::max);
    report.median_ms = median(times);
    report
}

fn one(seed: u64, index: u64) -> Seen {
    let mut numbers = Numbers::new(seed, index);
    let mut parameters = Parameters::default();
    for (name, low, high) in DRAWS {
        let value = low * (high / low).powf(numbers.next());
        parameters.set(name, value).expect("draws lie within the ranges");
    }
    parameters.n_cells = if numbers.next() < 0.5 { 20 } else { 50 };
    let shapes = MeltShape::names();
    let shape = shapes[numbers.up_to(shapes.len() as u32) as usize - 1];
    let control = CONTROLS[numbers.up_to(CONTROLS.len() as u32) as usize - 1];
    let is_rigid = numbers.next() < 0.2;
    let closure = if is_rigid { UpstreamClosure::NoStretching } else { UpstreamClosure::Published };
    let name = format!("set {index}, {control}, {shape}, {}, {parameters:?}", closure.name());
    let model = Model::new(parameters, closure).expect("draws lie within the ranges");
    let shape = MeltShape::named(shape).expect("a shape's own name");
    let setting = Setting { model: model.with_melt_shape(shape), law: None };
    let control = Control::named(control).expect("a control's own name");
    let value = control.value(&setting);
    let bounds = if value == 0.0 { GRADIENTS } else { (value / 3.0, value * 3.0) };
    let plan = BranchPlan::new(setting, control, bounds);
    let since = Instant::now();
    let traced = plan.trace(|_: &BranchPoint| ControlFlow::Continue(()));
    let duration_ms = since.elapsed().as_secs_f64() * 1e3;
    let outcome = match traced {
        Ok(Traced::Branch(branch)) => Ok(Some(*branch)),
        Ok(Traced::NoStart(_)) => Ok(None),
        Err(error) => Err(error.to_string()),
    };
    let verdict = match &outcome {
        Ok(Some(branch)) => {
            let place = numbers.up_to(branch.points.len() as u32) as usize - 1;
            tried(&plan, &branch.points[place])
        }
        _ => None,
    };
    Seen { outcome, verdict, name, duration_ms }
}

/// A verdict of stability against what perturbed states do; none where the growth is too slow.
fn tried(plan: &BranchPlan, point: &BranchPoint) -> Option<(&'static str, Option<String>)> {
    let leading = point.spectrum.as_ref()?.rates.first()?.re_per_a;
    let model = plan.setting_at(point.control).model;
    let p = model.parameters();
    let thickness_m = point.state.thickness_0_m();
    // Next to a verdict a perturbation leads to it.
    let is_next_to_a_verdict = thickness_m > NEARLY_OVERTHICK * p.terminus_thickness_m
        || thickness_m < NEARLY_GONE * p.d_m;
    if leading.abs() < SLOW_PER_A || is_next_to_a_verdict {
        return None;
    }
    let time_a = (LIFETIMES / leading.abs()).min(LONGEST_A);
    let state = &point.state;
    let d_m = p.d_m;
    let ends: Vec<Option<f64>> = [PERTURBATION, -PERTURBATION]
        .into_iter()
        .map(|share| {
            let mut start = state.clone();
            for thickness_m in &mut start.thickness_m {
                *thickness_m = d_m + (*thickness_m - d_m) * (1.0 + share);
            }
            let began = distance(&start, state);
            let mut quiet = |_: Moment<'_>| ControlFlow::Continue(());
            let plan = Plan::controlled(1e-5, vec![time_a]);
            let end = Solver::new(model.clone()).transient(start, &plan, &mut quiet).ok()?;
            let has_gone = end.ending != Ending::Completed;
            Some(if has_gone { f64::INFINITY } else { distance(&end.state, state) / began })
        })
        .collect();
    let Some(ends) = ends.into_iter().collect::<Option<Vec<f64>>>() else {
        return Some(("transient failed", None));
    };
    let nearer = ends.iter().all(|ratio| *ratio < 1.0 / FARTHER);
    let farther = ends.iter().any(|ratio| *ratio > FARTHER);
    let contradiction = |what: &str| {
        format!(
            "told {what} with {leading} a-1 at p = {} on segment {}, L = {} m, H0 = {thickness_m} m, and \
             ratios are {ends:?}",
            point.control, point.segment, state.length_m
        )
    };
    Some(match (leading > 0.0, nearer, farther) {
        (false, true, _) => ("stable, comes back", None),
        (true, _, true) => ("unstable, goes away", None),
        (false, _, true) => ("contradicted", Some(contradiction("stable"))),
        (true, true, _) => ("contradicted", Some(contradiction("unstable"))),
        _ => ("not told in time", None),
    })
}

/// Largest difference of thickness, and that of length, relative to the second state's.
fn distance(a: &State, b: &State) -> f64 {
    let thickness = a.thickness_m.iter().zip(&b.thickness_m).map(|(a, b)| (a / b - 1.0).abs());
    thickness.fold((a.length_m / b.length_m - 1.0).abs(), f64::max)
}
