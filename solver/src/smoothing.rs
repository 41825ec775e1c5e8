//! Taking the smoothing of the rheology's kinks to zero, at any mass balance. Knows no equation.
//!
//! |μ − μ_s| and the cut-off of g_loc have kinks, and the discrete problem has several roots because
//! of them. The right root is the limit of the smoothed problem: with the kinks rounded by ε (see
//! [`crate::physics::fluidity`]), ε goes from 3e-2 to 0 and each level is solved from the last.

use crate::error::SolveError;
use crate::newton::{Limits, Root};
use crate::params::Parameters;
use crate::physics::fluidity::{Relaxation, yield_excess};
use crate::state::State;
use crate::{Solver, Task};

/// ε of the smoothing, as a share of μ, from the first level to the model itself.
pub(crate) const LEVELS: [f64; 14] =
    [3e-2, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 3e-5, 1e-5, 3e-6, 1e-6, 3e-7, 1e-7, 3e-8, 0.0];

/// What is being done, for errors.
pub(crate) const STAGE: &str = "taking the smoothing of the rheology's kinks to zero";

/// A root whose every cell is this many ε away from its kink is followed to ε = 0 in one step: the
/// smoothing then changes |μ − μ_s| by less than 1/200 of itself.
const CLEAR: f64 = 10.0;

/// How often the step from one level to the next is divided in two before other means are tried.
pub(crate) const DIVISIONS: usize = 3;

/// Equations that can be solved at any level of smoothing, from an iterate that holds the root afterwards.
pub(crate) trait Ladder {
    /// Newton's method from the iterate, in a step of pseudo-time if one is given.
    fn solve_relaxing(
        &mut self,
        level: f64,
        relaxation: Option<Relaxation<'_>>,
        limits: Limits,
    ) -> Result<Root, SolveError>;
    /// The iterate.
    fn iterate(&mut self) -> &mut Vec<f64>;
    /// The iterate as a state.
    fn state(&mut self) -> State;
    /// The parameters at the iterate.
    fn parameters(&self) -> Parameters;

    /// The same without pseudo-time.
    fn solve_at(&mut self, level: f64, limits: Limits) -> Result<Root, SolveError> {
        self.solve_relaxing(level, None, limits)
    }

    /// 1 − μ_s/μ of the iterate's interior cells.
    fn yield_excesses(&mut self) -> Vec<f64> {
        let state = self.state();
        yield_excesses(&self.parameters(), &state)
    }

    /// Takes the root in the iterate from one level to another, by way of one between them where the
    /// step is too long. After an error the iterate is the last root on the way.
    fn lower(&mut self, from: f64, to: f64, divisions: usize) -> Result<Root, SolveError> {
        /// Where short steps are needed, a level between is the shorter way.
        const SHORTEST_SHARE: f64 = 0.1;
        let limits = Limits { iterations: 12, ..Limits::at_smoothing(to) };
        let is_last_resort = divisions == 0 || to == 0.0;
        let shortest_share = if is_last_resort { limits.shortest_share } else { SHORTEST_SHARE };
        let limits = Limits { shortest_share, ..limits };
        let saved = self.iterate().clone();
        match self.solve_at(to, limits) {
            Ok(root) => Ok(root),
            Err(error) => {
                self.iterate().copy_from_slice(&saved);
                if is_last_resort {
                    return Err(error);
                }
                let between = (from * to).sqrt();
                self.lower(from, between, divisions - 1)?;
                self.lower(between, to, divisions - 1)
            }
        }
    }

    /// From the root at `level` to the model itself, if every cell is clear of its kink and keeps its
    /// side of it; else the iterate stays where it was. `guess` is where the model's root should be, if
    /// there is a better one than the root at `level`.
    fn leap(&mut self, level: f64, guess: Option<&[f64]>) -> Option<Root> {
        let excess = self.yield_excesses();
        if level == 0.0 || excess.iter().any(|e| e.abs() < CLEAR * level) {
            return None;
        }
        let limits = Limits { iterations: 6, ..Limits::default() };
        let saved = self.iterate().clone();
        if let Some(guess) = guess {
            self.iterate().copy_from_slice(guess);
        }
        let root = self.solve_at(0.0, limits).ok();
        let root = root.filter(|_| {
            let same_side =
                |(a, b): (&f64, &f64)| (a > &0.0) == (b > &0.0) && b.abs() > 0.5 * a.abs();
            excess.iter().zip(&self.yield_excesses()).all(same_side)
        });
        if root.is_none() {
            self.iterate().copy_from_slice(&saved);
        }
        root
    }

    /// Pseudo-time steps of fluidity and friction alone, until Newton's method converges without them.
    fn relax(&mut self, level: f64) -> Result<Root, SolveError> {
        const STEPS: usize = 80;
        const GROWTH: f64 = 3.0;
        const SHRINK: f64 = 0.1;
        /// Pseudo-steps between this and its inverse, in units of the fluidity's and the friction's own.
        const RANGE: f64 = 1e6;

        let limits = Limits { iterations: 15, ..Limits::at_smoothing(level) };
        let mut state = self.state();
        let mut saved = self.iterate().clone();
        // The fluidity's own lengths are Δx and ξ = Ad/√|μ − μ_s|, the friction's own speed is U.
        let p = self.parameters();
        let unit_per_m2 = state.dx_m().powi(-2) + (p.A * p.d_m).powi(-2);
        let unit_speed = state.velocity_m_per_a.iter().fold(1.0, |a: f64, u| a.max(u.abs()));
        let mut step = 1.0;
        let mut failure = None;
        for _ in 0..STEPS {
            let relaxation = (step < RANGE).then(|| Relaxation {
                fluidity_per_a: &state.fluidity_per_a,
                rate_per_m2: unit_per_m2 / step,
                mu_w: &state.mu_w,
                speed_per_mu: unit_speed / step,
            });
            match self.solve_relaxing(level, relaxation, limits) {
                Ok(root) if relaxation.is_none() => return Ok(root),
                Ok(_) => {
                    state = self.state();
                    saved.copy_from_slice(self.iterate());
                    step *= GROWTH;
                }
                Err(error) => {
                    failure = Some(error);
                    self.iterate().copy_from_slice(&saved);
                    step = step.min(RANGE) * SHRINK;
                    if step < 1.0 / RANGE {
                        break;
                    }
                }
            }
        }
        Err(failure.unwrap_or(SolveError::UnusableState {
            what: "its fluidity and friction do not settle in pseudo-time".into(),
        }))
    }
}

/// A task and its solver.
pub(crate) struct Tasked<'s, 't> {
    solver: &'s mut Solver,
    task: Task<'t>,
    stage: &'static str,
}

impl Ladder for Tasked<'_, '_> {
    fn solve_relaxing(
        &mut self,
        level: f64,
        relaxation: Option<Relaxation<'_>>,
        limits: Limits,
    ) -> Result<Root, SolveError> {
        let task = Task { relaxation, ..self.task.smoothed(level) };
        self.solver.solve_from_iterate(task, limits, self.stage)
    }

    fn iterate(&mut self) -> &mut Vec<f64> {
        &mut self.solver.newton.x
    }

    fn state(&mut self) -> State {
        let mut state = State::zeros(self.solver.model.parameters.n_cells);
        state.unpack(&self.solver.newton.x);
        state
    }

    fn parameters(&self) -> Parameters {
        self.solver.model.parameters
    }
}

/// 1 − μ_s/μ of the interior cells.
pub(crate) fn yield_excesses(p: &Parameters, s: &State) -> Vec<f64> {
    (1..p.n_cells - 1).map(|c| yield_excess(p, s, c)).collect()
}

impl Solver {
    /// The levels of a task.
    pub(crate) fn at<'s, 't>(&'s mut self, task: Task<'t>) -> Tasked<'s, 't> {
        Tasked { solver: self, task, stage: STAGE }
    }

    /// Solves a task at every level below `reached`, at which the iterate is a root. Where a root ends
    /// on a kink, the fluidity relaxes in pseudo-time to the one that takes over.
    pub(crate) fn follow(&mut self, task: Task<'_>, reached: f64) -> Result<Root, SolveError> {
        let (mut root, mut last) = (None, reached);
        for level in LEVELS.into_iter().filter(|level| *level < reached) {
            let lowered = self.at(task).lower(last, level, DIVISIONS);
            root = Some(lowered.or_else(|_| self.at(task).relax(level))?);
            if let Some(root) = self.at(task).leap(level, None) {
                return Ok(root);
            }
            last = level;
        }
        Ok(root.expect("the last level, 0, is below any other"))
    }

    /// Newton's method from the iterate; from where fluidity and friction relax to, if that fails.
    pub(crate) fn solve_or_relax(
        &mut self,
        task: Task<'_>,
        stage: &'static str,
    ) -> Result<Root, SolveError> {
        let limits = Limits { iterations: 15, ..Limits::at_smoothing(task.smoothing) };
        let saved = self.newton.x.clone();
        self.solve_from_iterate(task, limits, stage).or_else(|_| {
            self.newton.x.copy_from_slice(&saved);
            Tasked { solver: self, task, stage }.relax(task.smoothing)
        })
    }
}
