//! A fold as a second parameter varies: the threshold of collapse in a plane of two parameters. Knows no
//! equation.
//!
//! At a fold p stands still and L does not, so that at a given second parameter q the branch nearby is a
//! function p(L), found point by point on lines of fixed L, and the fold its extremum, dp/ds = 0. Along q it
//! is predicted from the last two and corrected by the secant method in L.

use super::chain::{Chain, Shift};
use super::continued::Plane;
use super::trace::{Stand, Tracer, no_melange};
use super::{Branch, BranchPlan, BranchPoint, End, Traced};
use crate::control::Control;
use crate::error::SolveError;
use crate::params::ParameterError;
use crate::state::scale;
use crate::steady::SteadyVerdict;
use std::ops::ControlFlow;

/// First and longest step of the second parameter, as shares of its bounds' distance.
const STEPS: (f64, f64) = (1.0 / 60.0, 1.0 / 20.0);
/// A curve whose step falls below this share ends.
const SHORTEST_STEP: f64 = 1e-5;
/// Growth of the step after a fold that was found.
const GROWTH: f64 = 1.5;
/// |dp/ds| at a fold, in units of arclength.
const TURNED: f64 = 1e-8;
/// Most corrections of a fold.
const CORRECTIONS: usize = 12;
/// First change of L from which the secant is drawn, as a share of L.
const PROBE: f64 = 1e-3;
/// Largest change of L by one correction, as a share of L.
const STRIDE: f64 = 0.2;

/// Which fold is followed, and how far.
#[derive(Debug, Clone, PartialEq)]
pub struct FoldCurvePlan {
    /// The branch whose fold it is.
    pub branch: BranchPlan,
    /// Which of its folds, along the curve from 0.
    pub fold: usize,
    /// The second parameter; its value in the setting is where the curve begins.
    pub second: Control,
    /// The curve ends where the second parameter leaves these bounds.
    pub second_bounds: (f64, f64),
}

/// A fold on the curve.
#[derive(Debug, Clone, PartialEq)]
pub struct FoldPoint {
    /// The second parameter.
    pub second: f64,
    /// The steady state at the fold; its `control` is the threshold.
    pub point: BranchPoint,
    /// Whether the control parameter is largest at the fold, on the branch nearby.
    pub is_maximum: bool,
}

/// The curve.
#[derive(Debug, Clone, PartialEq)]
pub struct FoldCurve {
    /// Folds from small to large values of the second parameter.
    pub points: Vec<FoldPoint>,
    /// Why it ends at its first and last point.
    pub ends: (End, End),
}

/// What a search for a fold curve led to.
#[derive(Debug, Clone, PartialEq)]
pub enum FoldCurveTraced {
    /// The curve.
    Curve(FoldCurve),
    /// The branch has no such fold; here it is.
    NoFold(Box<Branch>),
    /// There is no steady state to begin with.
    NoStart(SteadyVerdict),
}

/// A fold with all that the next one needs.
struct Turning {
    second: f64,
    stand: Stand,
    is_maximum: bool,
}

impl FoldCurvePlan {
    /// Refuses bounds that do not hold the start and parameters that cannot be varied together.
    pub fn check(&self) -> Result<(), ParameterError> {
        self.branch.check()?;
        let other = BranchPlan {
            control: self.second,
            bounds: self.second_bounds,
            roots_at: Vec::new(),
            ..self.branch.clone()
        };
        other.check()?;
        if !self.second.is_independent_of(self.branch.control) {
            return Err(ParameterError::Contradiction {
                name: self.second.name(),
                value: self.second.value(&self.branch.setting),
                permitted: format!(
                    "a second parameter that does not go with the first, {}",
                    self.branch.control.name()
                ),
            });
        }
        Ok(())
    }

    /// Follows the fold both ways; the observer sees every point.
    pub fn trace(
        &self,
        mut observer: impl FnMut(&FoldPoint) -> ControlFlow<()>,
    ) -> Result<FoldCurveTraced, SolveError> {
        self.check()?;
        let plan =
            BranchPlan { with_stability: false, roots_at: Vec::new(), ..self.branch.clone() };
        let branch = match plan.trace(|_: &BranchPoint| ControlFlow::Continue(()))? {
            Traced::Branch(branch) => branch,
            Traced::NoStart(verdict) => return Ok(FoldCurveTraced::NoStart(verdict)),
        };
        let Some(fold) = branch.folds.get(self.fold) else {
            return Ok(FoldCurveTraced::NoFold(branch));
        };
        let mut tracer = Tracer::new(&self.branch);
        let x = tracer.packed(&fold.point.state);
        let at = Plane {
            length: fold.point.state.length_m / scale::LENGTH,
            control: fold.point.control / self.branch.unit(),
        };
        let second = self.second.value(&self.branch.setting);
        let chain = Chain::alone(x, at);
        let start = tracer.turning(
            self,
            chain,
            Plane { length: 0.0, control: 0.0 },
            second,
            fold.is_maximum,
        )?;
        let mut is_stopped = observer(&start.report()).is_break();
        let mut reports = vec![start.report()];
        let mut ends = [End::Bound, End::Bound];
        for (sense, end) in [-1.0, 1.0].into_iter().zip(&mut ends) {
            let mut found = Vec::new();
            *end = if is_stopped {
                End::Stopped
            } else {
                tracer.follow_fold(self, &start, sense, &mut found, &mut observer)
            };
            is_stopped |= *end == End::Stopped;
            if sense < 0.0 {
                found.reverse();
                found.append(&mut reports);
                reports = found;
            } else {
                reports.append(&mut found);
            }
        }
        Ok(FoldCurveTraced::Curve(FoldCurve { points: reports, ends: ends.into() }))
    }
}

impl Turning {
    fn report(&self) -> FoldPoint {
        FoldPoint {
            second: self.second,
            point: self.stand.point.clone(),
            is_maximum: self.is_maximum,
        }
    }
}

impl Tracer {
    fn follow_fold(
        &mut self,
        plan: &FoldCurvePlan,
        start: &Turning,
        sense: f64,
        found: &mut Vec<FoldPoint>,
        observer: &mut impl FnMut(&FoldPoint) -> ControlFlow<()>,
    ) -> End {
        let (low, high) = plan.second_bounds;
        let width = high - low;
        let bound = if sense < 0.0 { low } else { high };
        let mut step = STEPS.0;
        let mut before: Option<(f64, Plane)> = None;
        let mut last = Turning {
            second: start.second,
            stand: start.stand.clone(),
            is_maximum: start.is_maximum,
        };
        while found.len() < plan.branch.most_points {
            let room = (bound - last.second).abs() / width;
            if room <= 0.0 {
                return End::Bound;
            }
            let is_last = step >= room;
            let second = if is_last { bound } else { last.second + sense * step * width };
            let at = last.stand.chain.root.at;
            let ahead = before.map_or(Plane { length: 0.0, control: 0.0 }, |(q, place)| {
                at.minus(place).scaled((second - last.second) / (last.second - q))
            });
            let near = last.stand.chain.clone();
            match self.turning(plan, near, ahead, second, last.is_maximum) {
                Ok(next) => {
                    let setting = &self.course.setting;
                    let (state, control) = (&next.stand.point.state, next.stand.point.control);
                    if let Some(end) = no_melange(setting, plan.branch.control, state, control) {
                        return end;
                    }
                    let (from, to) = plan.branch.bounds;
                    if !(from..=to).contains(&control) {
                        return End::Bound;
                    }
                    before = Some((last.second, at));
                    found.push(next.report());
                    if observer(&next.report()).is_break() {
                        return End::Stopped;
                    }
                    last = next;
                    step = (step * GROWTH).min(STEPS.1);
                }
                Err(error) => {
                    step *= 0.5;
                    if step < SHORTEST_STEP {
                        return End::Stuck(error.to_string());
                    }
                }
            }
        }
        End::MostPoints
    }

    /// The fold at a value of the second parameter, beside a root that is `ahead` of it.
    fn turning(
        &mut self,
        plan: &FoldCurvePlan,
        near: Chain,
        ahead: Plane,
        second: f64,
        was_maximum: bool,
    ) -> Result<Turning, SolveError> {
        plan.second.set(&mut self.course.setting, second);
        let zeros = vec![0.0; near.root.x.len()];
        let mut length = near.root.at.length + ahead.length;
        let mut near = near;
        let mut shift = Shift { x: &zeros, at: ahead, share: 1.0 };
        let mut last: Option<(f64, f64)> = None;
        for _ in 0..CORRECTIONS {
            let through = Plane { length, control: near.root.at.control + shift.at.control };
            let fixed_length = Plane { length: 0.0, control: 1.0 };
            let chain = self.beside(&near, shift, through, fixed_length)?;
            let stand = self.stand(chain, Plane { length: 1.0, control: 0.0 })?;
            let slope = stand.tangent.at.control / stand.tangent.at.length;
            if slope.abs() < TURNED {
                // The sign of d²p/dL², by the secant that led here.
                let is_maximum =
                    last.map_or(was_maximum, |(l, s)| (s - slope) * (l - length) < 0.0);
                return Ok(Turning { second, stand, is_maximum });
            }
            let next = match last {
                None => length * (1.0 + PROBE),
                Some((l, s)) => {
                    let change = -slope * (length - l) / (slope - s);
                    length + change.clamp(-STRIDE * length, STRIDE * length)
                }
            };
            if !(next.is_finite() && next > 0.0) {
                break;
            }
            last = Some((length, slope));
            length = next;
            near = stand.chain;
            shift = Shift { x: &zeros, at: Plane { length: 0.0, control: 0.0 }, share: 0.0 };
        }
        Err(SolveError::UnusableState {
            what: format!(
                "no fold is found beside the last one at {} = {second}, as where two folds meet in a cusp",
                plan.second.name()
            ),
        })
    }
}
