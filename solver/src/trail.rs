//! From a smoothed steady root down to the model itself, and the way remembered for neighbours. Knows no
//! equation.

use crate::error::SolveError;
use crate::newton::{Limits, Linear, Root};
use crate::physics::continuity::MassBalance;
use crate::smoothing::{DIVISIONS, LEVELS, Ladder, STAGE};
use crate::state::State;
use crate::steady::{FIRST_STEP_A, March, SteadyVerdict, collapsed, has_trough};
use crate::{Solver, Task};

/// The way to a steady state: its roots at the levels of smoothing that were passed.
#[derive(Debug, Clone, PartialEq)]
pub struct Trail {
    n_cells: usize,
    /// Sign of the Jacobian's determinant at the first root, which a fold changes.
    is_positive: bool,
    roots: Vec<Passed>,
}

/// A root on the way.
#[derive(Debug, Clone, PartialEq)]
struct Passed {
    level: f64,
    /// The packed root.
    x: Vec<f64>,
    /// 1 − μ_s/μ of its interior cells.
    excess: Vec<f64>,
}

/// Beside a neighbour's way: a root that takes more iterations is no neighbour's; a last step of 1e-3
/// leaves about 1e-6, which is little beside what tells a jump.
const BESIDE: Limits =
    Limits { iterations: 6, step_tolerance: 1e-3, shortest_share: 1e-5, checks_root: false };
/// Levels at which a neighbour's way is followed; between them lie the others of [`LEVELS`].
pub(crate) const STEPPING_STONES: [f64; 3] = [LEVELS[0], LEVELS[2], LEVELS[4]];
/// From level to level a root's cells move by about ε in 1 − μ_s/μ. Where one moves by more than this
/// many ε, the root has ended and another was taken.
const JUMP: f64 = 1.5;

impl Trail {
    /// Number of cells.
    pub(crate) fn n_cells(&self) -> usize {
        self.n_cells
    }

    /// Levels, packed roots and the excess of their interior cells, the most smoothed first, the model's last.
    pub(crate) fn roots(&self) -> impl Iterator<Item = (f64, &[f64], &[f64])> {
        self.roots.iter().map(|root| (root.level, &root.x[..], &root.excess[..]))
    }

    fn at(&self, level: f64) -> Option<&Passed> {
        self.roots.iter().find(|root| root.level == level)
    }

    fn last(&self) -> &Passed {
        self.roots.last().expect("a trail begins with a root")
    }
}

impl Passed {
    /// Whether the root moved on to another without a jump.
    fn leads_to(&self, next: &Passed) -> bool {
        let moved = self.excess.iter().zip(&next.excess).map(|(a, b)| (a - b).abs());
        moved.fold(0.0, f64::max) < JUMP * self.level
    }
}

impl Solver {
    /// The steady state beside a neighbour's: its root at the first level by Newton's method alone, then
    /// along the neighbour's way. None if that is not near enough, or leads across a fold; the way down
    /// is then its own.
    pub(crate) fn steady_beside(&mut self, near: &Trail) -> Option<SteadyVerdict> {
        let first = &near.roots[0];
        self.newton.x.copy_from_slice(&first.x);
        let task = Task::new(MassBalance::Steady);
        self.solve_from_iterate(task.smoothed(first.level), BESIDE, STAGE).ok()?;
        let mut trail = self.trail_from(first.level);
        if trail.is_positive != near.is_positive {
            return None;
        }
        let verdict = match self.follow_beside(&mut trail, near) {
            Some(root) => self.at_the_end(root, trail),
            None => {
                trail.roots.truncate(1);
                self.newton.x.copy_from_slice(&trail.roots[0].x);
                self.descend(trail)
            }
        };
        verdict.ok().filter(|verdict| matches!(verdict, SteadyVerdict::Converged { .. }))
    }

    /// Down the neighbour's way, from its roots moved by as much as the last one had to be. None where
    /// either way jumps, since the right root is then the one that this mélange's own way leads to.
    fn follow_beside(&mut self, trail: &mut Trail, near: &Trail) -> Option<Root> {
        let task = Task::new(MassBalance::Steady);
        let mut before = &near.roots[0];
        for level in &STEPPING_STONES[1..] {
            let there = near.at(*level)?;
            self.newton.x.copy_from_slice(&moved(&there.x, &trail.last().x, &before.x));
            self.solve_from_iterate(task.smoothed(*level), BESIDE, STAGE).ok()?;
            self.pass(trail, *level);
            let [.., last, now] = &trail.roots[..] else { return None };
            if !before.leads_to(there) || !last.leads_to(now) {
                return None;
            }
            before = there;
            let end = near.at(0.0).filter(|end| there.leads_to(end))?;
            let guess = moved(&end.x, &now.x, &there.x);
            if let Some(root) = self.at(task).leap(*level, Some(&guess)) {
                self.pass(trail, 0.0);
                return Some(root);
            }
        }
        None
    }

    /// A trail that begins with the root in the iterate.
    fn trail_from(&mut self, level: f64) -> Trail {
        let mut trail = Trail {
            n_cells: self.model.parameters.n_cells,
            is_positive: self.newton.jacobian().is_positive(),
            roots: Vec::with_capacity(LEVELS.len()),
        };
        self.pass(&mut trail, level);
        trail
    }

    /// Remembers the root in the iterate.
    fn pass(&mut self, trail: &mut Trail, level: f64) {
        let x = self.newton.x.clone();
        let excess = self.at(Task::new(MassBalance::Steady)).yield_excesses();
        trail.roots.push(Passed { level, x, excess });
    }

    /// Follows the root in the iterate, at level `reached`, to the model itself.
    pub(crate) fn descend_from(&mut self, reached: f64) -> Result<SteadyVerdict, SolveError> {
        let trail = self.trail_from(reached);
        self.descend(trail)
    }

    /// Takes the steady root in the iterate, the trail's only one, to the model itself. Where the root
    /// ends, the mélange marches on to the state that takes over, or to a verdict.
    fn descend(&mut self, mut trail: Trail) -> Result<SteadyVerdict, SolveError> {
        let mut state = State::zeros(trail.n_cells);
        let reached = trail.last().level;
        let task = Task::new(MassBalance::Steady);
        let mut root = None;
        for level in LEVELS.into_iter().filter(|level| *level < reached) {
            let last = trail.last().level;
            root = match self.at(task).lower(last, level, DIVISIONS) {
                Ok(found) => Some(found),
                Err(_) => {
                    state.unpack(&self.newton.x);
                    match self.march(state.clone(), FIRST_STEP_A, level)? {
                        March::Settled(found) => Some(found),
                        March::Ended(verdict) => return Ok(*verdict),
                    }
                }
            };
            self.pass(&mut trail, level);
            if let Some(found) = self.at(task).leap(level, None) {
                self.pass(&mut trail, 0.0);
                root = Some(found);
                break;
            }
        }
        self.at_the_end(root.expect("the last level, 0, is below any other"), trail)
    }

    /// What the model's root is worth.
    fn at_the_end(&mut self, root: Root, trail: Trail) -> Result<SteadyVerdict, SolveError> {
        let terminus_thickness_m = self.model.parameters.terminus_thickness_m;
        let solution = self.solution(root);
        let (length_m, h0) = (solution.state.length_m, solution.state.thickness_0_m());
        self.model.check_reach(0.0, length_m)?;
        if h0 >= terminus_thickness_m {
            return Ok(SteadyVerdict::Overthick(format!(
                "the steady state would be {h0:.1} m thick at the terminus, which is \
                 {terminus_thickness_m} m thick"
            )));
        }
        if has_trough(&self.model, &solution.state) {
            return Ok(SteadyVerdict::NoSteadyState(format!(
                "the only steady solution found, {length_m:.0} m long, is thinner than its icebergs between \
                 its ends, where a mélange breaks up"
            )));
        }
        if collapsed(&self.model, &solution.state) {
            return Ok(SteadyVerdict::NoSteadyState(format!(
                "the only steady state found is {length_m:.0} m long and {h0:.2} m thick, no longer a \
                 mélange"
            )));
        }
        Ok(SteadyVerdict::Converged { solution, trail })
    }
}

/// A packed root, as far away as another root is from its neighbour.
pub(crate) fn moved(there: &[f64], here: &[f64], neighbour: &[f64]) -> Vec<f64> {
    there.iter().zip(here).zip(neighbour).map(|((x, a), b)| x + (a - b)).collect()
}
