//! From a smoothed steady root down to the model itself, and the way remembered for neighbours. Knows no
//! equation.

use crate::error::SolveError;
use crate::newton::{Linear, Limits, Root};
use crate::physics::continuity::MassBalance;
use crate::smoothing::{self, LEVELS};
use crate::state::State;
use crate::steady::{FIRST_STEP_A, March, SteadyVerdict, collapsed};
use crate::{Solver, Task};

/// The way to a steady state: its roots at the levels of smoothing that were passed, the last one being
/// the model's.
#[derive(Debug, Clone, PartialEq)]
pub struct Trail {
    n_cells: usize,
    /// Sign of the Jacobian's determinant at the first root, which a fold changes.
    is_positive: bool,
    roots: Vec<(f64, Vec<f64>)>,
}

/// Newton iterations that a neighbour's root may be away; more, and it is no neighbour.
const BESIDE: usize = 6;

impl Trail {
    /// Number of cells.
    pub(crate) fn n_cells(&self) -> usize {
        self.n_cells
    }

    /// The root at the first level.
    pub(crate) fn first(&self) -> State {
        let mut state = State::zeros(self.n_cells);
        state.unpack(&self.roots[0].1);
        state
    }

    fn at(&self, level: f64) -> Option<&Vec<f64>> {
        self.roots.iter().find_map(|(l, root)| (*l == level).then_some(root))
    }

    /// Where the root at a level should be: as far from this one as at the last level, if this way
    /// passed both, else where the last two levels point to.
    fn predict(&self, beside: Option<&Trail>, level: f64, out: &mut [f64]) -> bool {
        let Some((last_level, last)) = self.roots.last() else { return false };
        if let Some(beside) = beside
            && let (Some(there), Some(before)) = (beside.at(level), beside.at(*last_level))
        {
            for (((x, last), there), before) in out.iter_mut().zip(last).zip(there).zip(before) {
                *x = last + (there - before);
            }
            return true;
        }
        false
    }
}

impl Solver {
    /// The steady state beside a neighbour's: from its root at the first level by Newton's method alone,
    /// and down along its way. None if that is not near enough, or leads across a fold.
    pub(crate) fn steady_beside(&mut self, near: &Trail) -> Option<SteadyVerdict> {
        let (level, first) = &near.roots[0];
        self.newton.x.copy_from_slice(first);
        let limits = Limits { iterations: BESIDE, ..Limits::loose() };
        let task = Task::new(MassBalance::Steady).smoothed(*level);
        self.solve_from_iterate(task, limits, smoothing::STAGE).ok()?;
        if self.newton.jacobian().is_positive() != near.is_positive {
            return None;
        }
        let verdict = self.descend_from(*level, Some(near)).ok()?;
        matches!(verdict, SteadyVerdict::Converged { .. }).then_some(verdict)
    }

    /// Follows the root in the iterate, at level `reached`, to the model itself; `beside` is a
    /// neighbour's way, which saves iterations.
    pub(crate) fn descend_from(
        &mut self,
        reached: f64,
        beside: Option<&Trail>,
    ) -> Result<SteadyVerdict, SolveError> {
        let p = self.model.parameters;
        let mut trail = Trail {
            n_cells: p.n_cells,
            is_positive: self.newton.jacobian().is_positive(),
            roots: vec![(reached, self.newton.x.clone())],
        };
        let root = match self.follow_steady(&mut trail, beside)? {
            Ok(root) => root,
            Err(verdict) => return Ok(verdict),
        };
        let solution = self.solution(root);
        self.model.check_reach(0.0, solution.state.length_m)?;
        let h0 = solution.state.thickness_0_m();
        if h0 >= p.terminus_thickness_m {
            return Ok(SteadyVerdict::Overthick(format!(
                "the steady state would be {h0:.1} m thick at the terminus, which is {} m thick",
                p.terminus_thickness_m
            )));
        }
        if collapsed(&self.model, &solution.state) {
            return Ok(SteadyVerdict::NoSteadyState(format!(
                "the only steady state found is {:.0} m long and {h0:.2} m thick, no longer a mélange",
                solution.state.length_m
            )));
        }
        Ok(SteadyVerdict::Converged { solution, trail })
    }

    /// Takes a steady root from the level of smoothing the trail has reached to the model itself. Where
    /// the root ends, the mélange marches on to the state that takes over, or to a verdict.
    fn follow_steady(
        &mut self,
        trail: &mut Trail,
        beside: Option<&Trail>,
    ) -> Result<Result<Root, SteadyVerdict>, SolveError> {
        let reached = trail.roots[0].0;
        let task = Task::new(MassBalance::Steady);
        let mut root = None;
        for level in LEVELS.into_iter().filter(|level| *level < reached) {
            let limits = if level > 0.0 { Limits::loose() } else { Limits::default() };
            let limits = Limits { iterations: 12, ..limits };
            let (_, last) = trail.roots.last().expect("the first root");
            let last = last.clone();
            let task = task.smoothed(level);
            let mut found = None;
            if trail.predict(beside, level, &mut self.newton.x) {
                found = self.solve_from_iterate(task, limits, smoothing::STAGE).ok();
            }
            if found.is_none() {
                self.newton.x.copy_from_slice(&last);
                found = self.solve_from_iterate(task, limits, smoothing::STAGE).ok();
            }
            root = match found {
                Some(found) => Some(found),
                None => {
                    let mut state = State::zeros(self.model.parameters.n_cells);
                    state.unpack(&last);
                    match self.march(state, FIRST_STEP_A, level)? {
                        March::Settled(found) => Some(found),
                        March::Ended(verdict) => return Ok(Err(*verdict)),
                    }
                }
            };
            trail.roots.push((level, self.newton.x.clone()));
            let hint = beside.and_then(|_| {
                let mut hint = vec![0.0; last.len()];
                trail.predict(beside, 0.0, &mut hint).then_some(hint)
            });
            if let Some(root) = self.leap(task, level, hint.as_deref()) {
                trail.roots.push((0.0, self.newton.x.clone()));
                return Ok(Ok(root));
            }
        }
        Ok(Ok(root.expect("the last level, 0, is below any other")))
    }
}
