//! Pseudo-arclength continuation: predict, correct, control the step. Knows no equation.

use super::chain::{Chain, Climber, Patience, Shift};
use super::continued::{Course, Plane};
use super::fold::{self, Turn};
use super::stability::Spectrum;
use super::{BranchPlan, BranchPoint, End, PointObserver, Traced, join};
use crate::Solver;
use crate::control::{Control, Setting};
use crate::error::SolveError;
use crate::force::force_n_per_m;
use crate::newton::{Linear, Workspace};
use crate::physics::jacobian::Jacobian;
use crate::physics::terminus::CalvingLaw;
use crate::state::{State, unknowns};
use crate::steady::{SteadyVerdict, collapsed, has_trough};

/// First step, and the longest that is tried anew after failures, in units of arclength.
const FIRST_STEP: f64 = 0.1;
/// Shorter steps than this mean that the branch is stuck.
const SHORTEST_STEP: f64 = 1e-7;
/// The last point is less than such a step away from where there is no mélange any more.
const LAST_STEP: f64 = 0.02;
/// Steps grow where the curve turns by less than this, in radians, and shrink where it turns by more.
const TURN: f64 = 0.2;
/// A step after which the curve has turned by more than this is taken again, half as long …
const SHARPEST_TURN: f64 = 0.5;
/// … unless it is shorter than this: there is a kink.
const KINK_STEP: f64 = 1e-4;
/// A corrected point may lie this share of the step aside of the predicted one.
const ASTRAY: f64 = 0.5;
/// Longer steps than this are shortened at the first difficulty.
const HASTE_STEP: f64 = 0.05;
/// Where the way down from the smoothed root ends, shorter steps than this are tried without it, and if that
/// does not help, may jump to the root that takes over.
const JUMP_STEP: f64 = 0.01;
/// Newton iterations of the most smoothed root above which the next step is shorter.
const EFFORT: f64 = 5.0;
/// Shortest share of the way from one calving law to another.
const SHORTEST_STRIDE: f64 = 1e-3;
/// Largest and smallest change of the step.
const CHANGE: (f64, f64) = (0.5, 1.8);
/// Share of a step that is tried after one that failed.
const AFTER_FAILURE: f64 = 0.5;
/// A point this close to the first one, in units of the step, closes the curve.
const CLOSES: f64 = 0.5;

/// The direction of a branch at a point.
#[derive(Debug, Clone)]
pub(super) struct Tangent {
    /// d(packed unknowns)/ds.
    pub(super) x: Vec<f64>,
    /// d(L, p)/ds, of norm 1.
    pub(super) at: Plane,
}

/// A point with all that the next one needs.
#[derive(Debug, Clone)]
pub(super) struct Stand {
    pub(super) chain: Chain,
    pub(super) tangent: Tangent,
    /// Sign of the bordered determinant, with the tangent's direction. Along one curve it never changes; on
    /// its other side at a fold, where L and p are nearly the same, it is the other one.
    pub(super) is_positive: bool,
    pub(super) point: BranchPoint,
    /// What is known of the fold, where the point is one.
    pub(super) fold: Option<Turn>,
}

pub(super) struct Tracer {
    pub(super) course: Course,
    newton: Workspace<Jacobian>,
    jacobian: Jacobian,
    residual: Vec<f64>,
    column: Vec<f64>,
    pub(super) with_stability: bool,
}

impl Tracer {
    pub(super) fn new(plan: &BranchPlan) -> Self {
        let n = plan.setting.model.parameters().n_cells;
        let size = unknowns(n);
        Self {
            course: Course::new(plan.setting.clone(), plan.control, plan.unit()),
            newton: Workspace::new(size, Jacobian::zeros(n)),
            jacobian: Jacobian::zeros(n),
            residual: vec![0.0; size],
            column: vec![0.0; size],
            with_stability: plan.with_stability,
        }
    }

    /// A line, to look for a root on.
    pub(super) fn on_line(&mut self, through: Plane, along: Plane) -> Climber<'_> {
        Climber::new(&mut self.course, &mut self.newton, through, along)
    }

    /// A state as the packed unknowns.
    pub(super) fn packed(&self, state: &State) -> Vec<f64> {
        let mut x = vec![0.0; self.column.len()];
        state.pack(&mut x);
        x
    }

    /// What a root is: its state, the direction of the branch on the side of `ahead`, its growth rates.
    pub(super) fn stand(&mut self, chain: Chain, ahead: Plane) -> Result<Stand, SolveError> {
        let (x, at) = (&chain.root.x, chain.root.at);
        self.course.smoothing = 0.0;
        let outside =
            || SolveError::UnusableState { what: "it lies outside the model's domain".into() };
        self.course
            .linearise_at(x, at, None, &mut self.residual, &mut self.jacobian)
            .map_err(|_| outside())?;
        let state = self.course.state(x, at);
        let spectrum =
            self.with_stability.then(|| Spectrum::of(self.jacobian.clone(), &state)).flatten();
        let across = ahead.across();
        self.course.column_along(across, &mut self.column);
        self.jacobian.replace_length(&self.column);
        self.jacobian.factorise().map_err(|_| SolveError::NotConverged {
            stage: "finding a branch's direction",
            iterations: 0,
            residual_norm: chain.residual_norm,
            reason: crate::error::NewtonFailure::Singular,
            history: Vec::new(),
        })?;
        let is_positive = self.jacobian.is_positive();
        let mut tangent = vec![0.0; x.len()];
        self.course.column_along(ahead, &mut tangent);
        tangent.iter_mut().for_each(|entry| *entry = -*entry);
        self.jacobian.solve(&mut tangent);
        let direction = ahead.moved(tangent[self.course.slot()], across);
        let norm = direction.norm();
        tangent.iter_mut().for_each(|entry| *entry /= norm);
        let direction = direction.scaled(1.0 / norm);
        tangent[self.course.slot()] = direction.length;
        let point = BranchPoint {
            segment: 0,
            arclength: 0.0,
            step: 0.0,
            iterations: chain.iterations,
            control: at.control * self.course.unit,
            control_by_arclength: direction.control * self.course.unit,
            state,
            residual_norm: chain.residual_norm,
            has_jumped: chain.has_jumped,
            spectrum,
        };
        let tangent = Tangent { x: tangent, at: direction };
        Ok(Stand { chain, tangent, is_positive, point, fold: None })
    }
}

impl BranchPlan {
    /// Follows the branch both ways from the steady state of the setting.
    pub fn trace(&self, mut observer: impl PointObserver) -> Result<Traced, SolveError> {
        self.check()?;
        let mut tracer = Tracer::new(self);
        let start = match tracer.start(self)? {
            Ok(start) => start,
            Err(verdict) => return Ok(Traced::NoStart(verdict)),
        };
        let mut back = Way::from(&start, -1.0);
        let mut forth = Way::from(&start, 1.0);
        if observer(&start.point).is_break() {
            (back.end, forth.end) = (End::Stopped, End::Stopped);
        } else {
            tracer.follow(self, &mut back, self.most_points / 2 + 1, &mut observer);
            match back.end {
                End::Stopped => forth.end = End::Stopped,
                // All of it has been seen.
                End::Closed => forth.end = End::Closed,
                _ => {
                    let most = (self.most_points + 1).saturating_sub(back.points());
                    tracer.follow(self, &mut forth, most, &mut observer);
                }
            }
        }
        Ok(Traced::Branch(Box::new(join::joined(&mut tracer, self, [back, forth]))))
    }
}

/// One way along a branch from its start: points, and the folds between them.
pub(super) struct Way {
    pub(super) sense: f64,
    pub(super) stands: Vec<Stand>,
    pub(super) end: End,
}

impl Way {
    fn from(start: &Stand, sense: f64) -> Self {
        let mut start = start.clone();
        start.turn_by(sense);
        Self { sense, stands: vec![start], end: End::MostPoints }
    }

    fn last(&self) -> &Stand {
        self.stands.last().expect("a way begins with its start")
    }

    fn points(&self) -> usize {
        self.stands.iter().filter(|stand| stand.fold.is_none()).count()
    }

    /// Adds what comes next; whether the observer asked to stop.
    fn push(&mut self, mut next: Stand, observer: &mut impl PointObserver) -> bool {
        let last = self.last();
        let run = next.chain.root.at.minus(last.chain.root.at).norm();
        next.point.arclength = last.point.arclength + run;
        // A fold between two points is found afterwards, and is no step.
        let from = self.stands.iter().rev().find(|stand| stand.fold.is_none()).unwrap_or(last);
        next.point.step = next.point.arclength - from.point.arclength;
        let is_point = next.fold.is_none();
        // As the joined curve will have it.
        let seen = BranchPoint {
            arclength: self.sense * next.point.arclength,
            control_by_arclength: self.sense * next.point.control_by_arclength,
            ..next.point.clone()
        };
        self.stands.push(next);
        is_point && observer(&seen).is_break()
    }
}

impl Stand {
    /// Turns the direction round, if the sense is −1; arclength is the caller's.
    pub(super) fn turn_by(&mut self, sense: f64) {
        self.tangent.at = self.tangent.at.scaled(sense);
        self.tangent.x.iter_mut().for_each(|entry| *entry *= sense);
        self.is_positive ^= sense < 0.0;
        self.point.control_by_arclength *= sense;
    }

    /// p, in units of arclength.
    fn control(&self) -> f64 {
        self.chain.root.at.control
    }

    /// Whether the curve turns between here and there.
    fn turns_before(&self, next: &Self) -> bool {
        self.tangent.at.control * next.tangent.at.control < 0.0
    }
}

impl Tracer {
    /// The steady state that the rule picks, as the branch's first point.
    fn start(&mut self, plan: &BranchPlan) -> Result<Result<Stand, SteadyVerdict>, SolveError> {
        let model = &plan.setting.model;
        let trail = match Solver::new(model.clone()).steady(None)? {
            SteadyVerdict::Converged { trail, .. } => trail,
            verdict => return Ok(Err(verdict)),
        };
        let value = plan.control.value(&plan.setting);
        let mut chain = Chain::of(&trail, self.course.slot(), value / self.course.unit);
        let ahead = Plane { length: 0.0, control: 1.0 };
        let still = vec![0.0; self.column.len()];
        let shift = Shift { x: &still, at: Plane { length: 0.0, control: 0.0 }, share: 0.0 };
        let through = chain.root.at;
        if let Some(law) = plan.setting.law {
            // From the law that asks for the calving rate of the parameters to the one that is given.
            let force = force_n_per_m(&self.course.state(&chain.root.x, through));
            let neutral =
                model.parameters().calving_rate_m_per_a + law.per_force_m2_per_a_n * force;
            let (mut reached, mut stride) = (0.0, 1.0);
            while reached < 1.0 {
                let share = f64::min(reached + stride, 1.0);
                let rate_m_per_a = neutral + share * (law.rate_m_per_a - neutral);
                self.course.setting.law = Some(CalvingLaw { rate_m_per_a, ..law });
                match self.on_line(through, ahead.across()).chain(&chain, shift, Patience::Enough) {
                    Ok(found) => (chain, reached) = (found, share),
                    Err(error) if stride < SHORTEST_STRIDE => return Err(error),
                    Err(_) => stride *= 0.5,
                }
            }
            self.course.setting.law = Some(law);
        } else {
            let line = self.on_line(through, ahead.across());
            chain = line.chain(&chain, shift, Patience::ToJump)?;
        }
        let mut start = self.stand(chain, ahead)?;
        start.point.control = value;
        Ok(Ok(start))
    }

    fn follow(
        &mut self,
        plan: &BranchPlan,
        way: &mut Way,
        most_points: usize,
        observer: &mut impl PointObserver,
    ) {
        let mut step = FIRST_STEP.min(plan.longest_step);
        let start_at = way.stands[0].chain.root.at;
        'steps: while way.points() < most_points {
            let last = way.last();
            let tried = self.step(last, step);
            let turn = tried
                .as_ref()
                .map_or(0.0, |next| next.tangent.at.dot(last.tangent.at).clamp(-1.0, 1.0).acos());
            let next = match tried {
                Ok(next) if turn < SHARPEST_TURN || step < KINK_STEP => next,
                outcome => {
                    step *= AFTER_FAILURE;
                    if step < SHORTEST_STEP {
                        let why =
                            outcome.err().map_or("it turns on itself".into(), |e| e.to_string());
                        way.end = End::Stuck(why);
                        return;
                    }
                    continue;
                }
            };
            let (state, control) = (&next.point.state, next.point.control);
            if let Some(end) = no_melange(&plan.setting, plan.control, state, control) {
                if step < LAST_STEP {
                    way.end = end;
                    return;
                }
                step *= AFTER_FAILURE;
                continue;
            }
            let effort = next.chain.first_iterations;
            let mut pieces = vec![next];
            if way.last().turns_before(&pieces[0]) {
                pieces.insert(0, fold::between(self, way.last(), &pieces[0]));
            }
            let stands_before = way.stands.len();
            for next in pieces {
                let reaches = next.control() * plan.unit();
                if !(plan.bounds.0..=plan.bounds.1).contains(&reaches) {
                    let bound = if reaches < plan.bounds.0 { plan.bounds.0 } else { plan.bounds.1 };
                    let is_there =
                        (way.last().point.control - bound).abs() < SHORTEST_STEP * plan.unit();
                    let landed = (!is_there).then(|| self.root_between(way.last(), &next, bound));
                    way.end = match landed.transpose() {
                        Ok(landed) => {
                            let has_stopped = landed.is_some_and(|at| way.push(at, observer));
                            if has_stopped { End::Stopped } else { End::Bound }
                        }
                        // From nearer by it may be found.
                        Err(_) if step > KINK_STEP && way.stands.len() == stands_before => {
                            step *= AFTER_FAILURE;
                            continue 'steps;
                        }
                        Err(error) => {
                            End::Stuck(format!("no point is found at the bound {bound}: {error}"))
                        }
                    };
                    return;
                }
                if way.push(next, observer) {
                    way.end = End::Stopped;
                    return;
                }
            }
            let (first, last) = (&way.stands[0], way.last());
            let is_back = last.chain.root.at.minus(start_at).norm() < CLOSES * step
                && last.tangent.at.dot(first.tangent.at) > 0.0
                && last.is_positive == first.is_positive;
            if way.stands.len() > 4 && is_back {
                way.end = End::Closed;
                return;
            }
            let by_turn = TURN / turn.max(1e-3);
            let by_effort = (EFFORT / effort.max(1) as f64).powi(2);
            step *= by_turn.min(by_effort).clamp(CHANGE.0, CHANGE.1);
            step = step.min(plan.longest_step);
        }
    }

    /// Predicts along the tangent and corrects on the line across it.
    fn step(&mut self, from: &Stand, step: f64) -> Result<Stand, SolveError> {
        let tangent = &from.tangent;
        let through = from.chain.root.at.moved(step, tangent.at);
        let shift = Shift { x: &tangent.x, at: tangent.at, share: step };
        let across = tangent.at.across();
        let strays = |chain: &Chain| {
            let aside = chain.root.at.minus(through).dot(across).abs();
            step > KINK_STEP && aside > ASTRAY * step
        };
        let patience = if step > HASTE_STEP { Patience::Little } else { Patience::Enough };
        let chain = self.on_line(through, across).chain(&from.chain, shift, patience);
        let mut next = chain.and_then(|chain| self.next(from, chain, &strays));
        if next.is_err() && step < JUMP_STEP {
            let alone = self.on_line(through, across).alone(&from.chain, shift);
            next = alone.and_then(|chain| self.next(from, chain, &strays)).or_else(|_| {
                let line = self.on_line(through, across);
                let chain = line.chain(&from.chain, shift, Patience::ToJump)?;
                self.next(from, chain, &strays)
            });
        }
        next
    }

    /// A root as the next point, if it lies on the same curve.
    fn next(
        &mut self,
        from: &Stand,
        chain: Chain,
        strays: &impl Fn(&Chain) -> bool,
    ) -> Result<Stand, SolveError> {
        if !strays(&chain) {
            let next = self.stand(chain, from.tangent.at)?;
            if next.is_positive == from.is_positive {
                return Ok(next);
            }
        }
        Err(SolveError::UnusableState { what: "it lies on another branch".into() })
    }

    /// The root beside another one, not far from it: by Newton's method alone, or else by the rule.
    pub(super) fn beside(
        &mut self,
        near: &Chain,
        shift: Shift<'_>,
        through: Plane,
        along: Plane,
    ) -> Result<Chain, SolveError> {
        let alone = self.on_line(through, along).alone(near, shift);
        let patience = Patience::Enough;
        alone.or_else(|_| self.on_line(through, along).chain(near, shift, patience))
    }

    /// The root at a value of p between two points, by the rule, or else by Newton's method alone.
    pub(super) fn root_between(
        &mut self,
        from: &Stand,
        to: &Stand,
        control: f64,
    ) -> Result<Stand, SolveError> {
        let (a, b) = (from.chain.root.at, to.chain.root.at);
        let share = (control / self.course.unit - a.control) / (b.control - a.control);
        let (near, far, share) =
            if share < 0.5 { (from, to, share) } else { (to, from, 1.0 - share) };
        let (a, b) = (near.chain.root.at, far.chain.root.at);
        let way: Vec<f64> =
            far.chain.root.x.iter().zip(&near.chain.root.x).map(|(b, a)| b - a).collect();
        let shift = Shift { x: &way, at: b.minus(a), share };
        let through = Plane { control: control / self.course.unit, ..a.moved(share, b.minus(a)) };
        let fixed = Plane { length: 1.0, control: 0.0 };
        let ruled = self.on_line(through, fixed).chain(&near.chain, shift, Patience::Enough);
        let rises = to.control() > from.control();
        let ahead = Plane { length: 0.0, control: if rises { 1.0 } else { -1.0 } };
        let belongs = |stand: &Stand| stand.is_positive == from.is_positive;
        let ruled = ruled.and_then(|chain| self.stand(chain, ahead));
        let mut found = match ruled.ok().filter(belongs) {
            Some(found) => found,
            None => {
                let chain = self.on_line(through, fixed).alone(&near.chain, shift)?;
                let found = self.stand(chain, ahead)?;
                if !belongs(&found) {
                    let what = "it lies on another branch".into();
                    return Err(SolveError::UnusableState { what });
                }
                found
            }
        };
        found.point.control = control;
        Ok(found)
    }
}

/// Why a state is none that this model describes.
pub(super) fn no_melange(
    setting: &Setting,
    parameter: Control,
    s: &State,
    control: f64,
) -> Option<End> {
    let mut setting = setting.clone();
    parameter.set(&mut setting, control);
    let model = &setting.model;
    let (h0, terminus_m) = (s.thickness_0_m(), model.parameters().terminus_thickness_m);
    let (length_m, d_m) = (s.length_m, model.parameters().d_m);
    if h0 >= terminus_m {
        let text = format!("at {h0:.1} m it would be thicker than the terminus, {terminus_m} m");
        return Some(End::Verdict(text));
    }
    if collapsed(model, s) {
        let text = format!(
            "with H0 = {h0:.2} m ({:.0} % of it above d) and L = {length_m:.0} m it is no longer a mélange",
            100.0 * (h0 / d_m - 1.0)
        );
        return Some(End::Verdict(text));
    }
    if has_trough(model, s) {
        let text = format!("{length_m:.0} m long it is thinner than its icebergs between its ends");
        return Some(End::Verdict(text));
    }
    model.check_reach(0.0, length_m).err().map(|error| End::Verdict(error.to_string()))
}
