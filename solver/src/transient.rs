//! Evolution in time by implicit steps, on the grid that moves with the mélange. Knows no equation.

use crate::error::SolveError;
use crate::newton::{Limits, Root};
use crate::observe::{Moment, Observer};
use crate::physics::continuity::{Before, MassBalance};
use crate::physics::terminus::Advance;
use crate::smoothing::LEVELS;
use crate::state::State;
use crate::steady::{NEARLY_CLOSED, NEARLY_OVERTHICK, collapsed};
use crate::{Solver, Task};

/// Steps of one fixed length. Times are step · Δt, never accumulated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FixedSteps {
    /// Δt, a.
    pub dt_a: f64,
    /// Number of steps.
    pub count: usize,
}

/// How a transient ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ending {
    /// At its last step.
    Completed,
    /// The mélange ran away to the size of its icebergs.
    Collapsed,
    /// H₀ reached the thickness of the glacier.
    Overthick,
    /// The walls meet within the mélange.
    FjordClosed,
}

/// What a transient came to.
#[derive(Debug, Clone, PartialEq)]
pub struct TransientEnd {
    /// How it ended.
    pub ending: Ending,
    /// When, a since the start.
    pub time_a: f64,
    /// Last state.
    pub state: State,
    /// X₀ at the end, m.
    pub terminus_x_m: f64,
    /// Newton iterations of all steps.
    pub iterations: usize,
    /// Nondimensional residual norm of the last step.
    pub residual_norm: f64,
    /// Steps that were divided because the whole one has no solution.
    pub divided_steps: usize,
}

/// Halvings of a step before it is given up.
const HALVINGS: usize = 14;

impl Solver {
    /// Runs from a state whose velocity, fluidity and friction solve the equations at its geometry.
    pub fn transient(
        &mut self,
        start: State,
        steps: FixedSteps,
        observer: &mut dyn Observer,
    ) -> Result<TransientEnd, SolveError> {
        start.check(self.model.parameters.n_cells)?;
        self.iterations = 0;
        let p = self.model.parameters;
        let terminus_speed = p.terminus_velocity_m_per_a - p.calving_rate_m_per_a;
        let mut end = TransientEnd {
            ending: Ending::Completed,
            time_a: 0.0,
            state: start,
            terminus_x_m: 0.0,
            iterations: 0,
            residual_norm: f64::NAN,
            divided_steps: 0,
        };
        for step in 0..=steps.count {
            let time_a = step as f64 * steps.dt_a;
            if step > 0 {
                let from_a = (step - 1) as f64 * steps.dt_a;
                let reached =
                    self.advance(&mut end, from_a, steps.dt_a, terminus_speed, HALVINGS)?;
                end.time_a = if end.ending == Ending::Completed { time_a } else { reached };
            }
            if end.ending == Ending::Completed {
                end.ending = self.ending(&end.state, end.terminus_x_m);
            }
            let moment = Moment {
                step,
                time_a: end.time_a,
                terminus_x_m: end.terminus_x_m,
                state: &end.state,
            };
            if observer.moment(moment).is_break() {
                return Err(SolveError::Stopped { time_a: end.time_a });
            }
            if end.ending != Ending::Completed {
                break;
            }
        }
        end.iterations = std::mem::take(&mut self.iterations);
        Ok(end)
    }

    /// One step of length `dt_a` from `from_a`; divided in two where the whole has no solution, which
    /// is how a collapse within the step is seen. Returns the time reached.
    fn advance(
        &mut self,
        end: &mut TransientEnd,
        from_a: f64,
        dt_a: f64,
        terminus_speed_m_per_a: f64,
        halvings: usize,
    ) -> Result<f64, SolveError> {
        let to_a = from_a + dt_a;
        let terminus_x_m = terminus_speed_m_per_a * to_a;
        match self.step(&end.state, dt_a, terminus_x_m) {
            Ok(root) => {
                end.state.unpack(&self.newton.x);
                end.terminus_x_m = terminus_x_m;
                end.residual_norm = root.residual_norm;
                Ok(to_a)
            }
            Err(error) if halvings == 0 => {
                end.ending = self.stopped_by_what(&end.state, end.terminus_x_m).ok_or(error)?;
                Ok(from_a)
            }
            Err(_) => {
                end.divided_steps += usize::from(halvings == HALVINGS);
                let half = 0.5 * dt_a;
                let middle =
                    self.advance(end, from_a, half, terminus_speed_m_per_a, halvings - 1)?;
                if end.ending == Ending::Completed {
                    end.ending = self.ending(&end.state, end.terminus_x_m);
                }
                if end.ending != Ending::Completed {
                    return Ok(middle);
                }
                self.advance(end, middle, half, terminus_speed_m_per_a, halvings - 1)
            }
        }
    }

    /// Backward Euler (C7) from `old`; the iterate is the new state afterwards. Newton's method starts
    /// from the old state, and through the smoothed rheology where a kink stops it.
    fn step(&mut self, old: &State, dt_a: f64, terminus_x_m: f64) -> Result<Root, SolveError> {
        let stage = "taking an implicit time step";
        let before =
            Before { per_step: 1.0 / dt_a, thickness_m: &old.thickness_m, length_m: old.length_m };
        let advance = Advance::fixed(terminus_x_m);
        let task = Task { advance, ..Task::new(MassBalance::Step(before)) };
        old.pack(&mut self.newton.x);
        let limits = Limits { iterations: 20, ..Limits::default() };
        if let Ok(root) = self.solve_from_iterate(task, limits, stage) {
            return Ok(root);
        }
        old.pack(&mut self.newton.x);
        self.solve_or_relax(task.smoothed(LEVELS[0]), stage)?;
        self.follow(task, LEVELS[0])
    }

    fn ending(&self, s: &State, terminus_x_m: f64) -> Ending {
        if self.narrowest_m(s, terminus_x_m) <= 0.0 {
            Ending::FjordClosed
        } else if s.thickness_0_m() >= self.model.parameters.terminus_thickness_m {
            Ending::Overthick
        } else if collapsed(&self.model, s) {
            Ending::Collapsed
        } else {
            Ending::Completed
        }
    }

    /// What stands in the way of a mélange whose next step has no solution, however short.
    fn stopped_by_what(&self, s: &State, terminus_x_m: f64) -> Option<Ending> {
        let p = &self.model.parameters;
        if self.narrowest_m(s, terminus_x_m) < NEARLY_CLOSED * p.width_m {
            Some(Ending::FjordClosed)
        } else {
            let is_thick = s.thickness_0_m() > NEARLY_OVERTHICK * p.terminus_thickness_m;
            is_thick.then_some(Ending::Overthick)
        }
    }

    /// The fjord's width where it is narrowest within the mélange: at one of its ends.
    fn narrowest_m(&self, s: &State, terminus_x_m: f64) -> f64 {
        let fjord = &self.model.fjord;
        fjord.width(terminus_x_m).min(fjord.width(terminus_x_m + s.length_m))
    }
}
