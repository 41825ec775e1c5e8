//! Evolution in time by implicit steps, on the grid that moves with the mélange: what a transient is
//! asked for, how it may end, and fixed steps. Steps of controlled error stand in `timestep`. Knows no
//! equation.

use crate::error::SolveError;
use crate::force;
use crate::forcing::Forcing;
use crate::newton::{Limits, Root};
use crate::observe::{Moment, Observer};
use crate::params::Parameters;
use crate::physics::continuity::{Before, MassBalance};
use crate::physics::terminus::{Advance, CalvingLaw};
use crate::smoothing::LEVELS;
use crate::state::State;
use crate::steady::{NEARLY_CLOSED, NEARLY_OVERTHICK, collapsed, has_trough};
use crate::{Solver, Task};

/// What a transient is asked for.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// How time is divided.
    pub stepping: Stepping,
    /// Parameters that vary in time.
    pub forcing: Forcing,
    /// A law that sets the calving rate.
    pub calving_law: Option<CalvingLaw>,
    /// Forcing and calving law are taken at the start of each step, as the paper's scripts do it;
    /// otherwise at its end, within the implicit step. For fixed steps only.
    pub is_lagged: bool,
    /// X₀ at the start, m.
    pub terminus_x_m: f64,
}

/// How time is divided.
#[derive(Debug, Clone, PartialEq)]
pub enum Stepping {
    /// Backward Euler (C7) with one step length. Times are step · Δt, never accumulated.
    Fixed {
        /// Δt, a.
        dt_a: f64,
        /// Number of steps.
        count: usize,
    },
    /// Second order, the step length chosen by the error.
    Controlled {
        /// Error of L and H₀, relative to them, that may be made in each 0.2 a.
        tolerance: f64,
        /// Times to land on exactly, ascending, none negative; the last one is the end.
        land_on_a: Vec<f64>,
    },
}

impl Plan {
    /// Steps of one length, nothing varying.
    pub fn fixed(dt_a: f64, count: usize) -> Self {
        Self::new(Stepping::Fixed { dt_a, count })
    }

    /// Steps of controlled error, nothing varying.
    pub fn controlled(tolerance: f64, land_on_a: Vec<f64>) -> Self {
        Self::new(Stepping::Controlled { tolerance, land_on_a })
    }

    fn new(stepping: Stepping) -> Self {
        Self {
            stepping,
            forcing: Forcing::default(),
            calving_law: None,
            is_lagged: false,
            terminus_x_m: 0.0,
        }
    }
}

/// How a transient ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ending {
    /// At its last step.
    Completed,
    /// The mélange ran away to the size of its icebergs, or became thinner than them between its ends.
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
    /// The parameters in force at the end.
    pub parameters: Parameters,
    /// Newton iterations of all steps.
    pub iterations: usize,
    /// Nondimensional residual norm of the last step.
    pub residual_norm: f64,
    /// Accepted steps.
    pub steps: usize,
    /// Fixed steps that were divided because the whole one has no solution.
    pub divided_steps: usize,
    /// Steps of controlled error that were tried again with a shorter length.
    pub repeated_steps: usize,
    /// Steps in which the calving law asked for a rate of 0 or less and got 0.
    pub calving_stopped_steps: usize,
}

/// Halvings of a fixed step before it is given up.
const HALVINGS: usize = 14;

/// A transient under way: where it stands, and how it got there.
pub(crate) struct Evolution<'a> {
    pub(crate) plan: &'a Plan,
    /// The model's parameters, to which the forcing applies.
    base: Parameters,
    observer: &'a mut dyn Observer,
    pub(crate) end: TransientEnd,
}

impl Solver {
    /// Runs from a state whose velocity, fluidity and friction solve the equations at its geometry.
    pub fn transient(
        &mut self,
        start: State,
        plan: &Plan,
        observer: &mut dyn Observer,
    ) -> Result<TransientEnd, SolveError> {
        start.check(self.model.parameters.n_cells)?;
        self.iterations = 0;
        let base = self.model.parameters;
        let end = TransientEnd {
            ending: Ending::Completed,
            time_a: 0.0,
            state: start,
            terminus_x_m: plan.terminus_x_m,
            parameters: base,
            iterations: 0,
            residual_norm: f64::NAN,
            steps: 0,
            divided_steps: 0,
            repeated_steps: 0,
            calving_stopped_steps: 0,
        };
        let mut run = Evolution { plan, base, observer, end };
        let ended = self.evolve(&mut run);
        self.model.parameters = base;
        let iterations = std::mem::take(&mut self.iterations);
        ended.map(|()| TransientEnd { iterations, ..run.end })
    }

    fn evolve(&mut self, run: &mut Evolution<'_>) -> Result<(), SolveError> {
        self.set_parameters(run, 0.0);
        run.end.parameters = self.in_force(run);
        run.end.ending = self.ending(&run.end);
        match &run.plan.stepping {
            Stepping::Fixed { dt_a, count } => self.evolve_fixed(run, *dt_a, *count),
            Stepping::Controlled { tolerance, land_on_a } => {
                self.evolve_controlled(run, *tolerance, land_on_a)
            }
        }
    }

    fn evolve_fixed(
        &mut self,
        run: &mut Evolution<'_>,
        dt_a: f64,
        count: usize,
    ) -> Result<(), SolveError> {
        run.report(0.0, Some(0))?;
        for step in 1..=count {
            if run.end.ending != Ending::Completed {
                break;
            }
            let from_a = (step - 1) as f64 * dt_a;
            let reached_a = self.advance(run, from_a, dt_a, HALVINGS)?;
            let is_whole = run.end.ending == Ending::Completed;
            run.end.time_a = if is_whole { step as f64 * dt_a } else { reached_a };
            run.end.steps = step;
            run.end.ending = if is_whole { self.ending(&run.end) } else { run.end.ending };
            run.count_stopped_calving();
            run.report(dt_a, is_whole.then_some(step))?;
        }
        Ok(())
    }

    /// One step of length `dt_a` from `from_a`; divided in two where the whole has no solution, which
    /// is how a collapse within the step is seen. Returns the time reached.
    fn advance(
        &mut self,
        run: &mut Evolution<'_>,
        from_a: f64,
        dt_a: f64,
        halvings: usize,
    ) -> Result<f64, SolveError> {
        let to_a = from_a + dt_a;
        self.set_parameters(run, if run.plan.is_lagged { from_a } else { to_a });
        if run.plan.is_lagged {
            self.model.parameters = self.in_force(run);
        }
        let old = run.end.state.clone();
        let before =
            Before { per_step: 1.0 / dt_a, thickness_m: &old.thickness_m, length_m: old.length_m };
        match self.step(&old, before, self.moving_from(run, run.end.terminus_x_m, dt_a)) {
            Ok(root) => {
                self.accept(run, root, run.end.terminus_x_m, dt_a);
                self.model.check_reach(run.end.terminus_x_m, run.end.state.length_m)?;
                Ok(to_a)
            }
            Err(error) if halvings == 0 => {
                run.end.ending = self.stopped_by_what(&run.end).ok_or(error)?;
                Ok(from_a)
            }
            Err(_) => {
                run.end.divided_steps += usize::from(halvings == HALVINGS);
                let half = 0.5 * dt_a;
                let middle_a = self.advance(run, from_a, half, halvings - 1)?;
                if run.end.ending == Ending::Completed {
                    run.end.ending = self.ending(&run.end);
                }
                if run.end.ending != Ending::Completed {
                    return Ok(middle_a);
                }
                self.advance(run, middle_a, half, halvings - 1)
            }
        }
    }

    /// Turns to the parameters at a time.
    pub(crate) fn set_parameters(&mut self, run: &Evolution<'_>, time_a: f64) {
        self.model.parameters = run.plan.forcing.at(&run.base, time_a);
    }

    /// The terminus within a step from X₀ = `from_x_m`; a lagged law is in the parameters already.
    pub(crate) fn moving_from(&self, run: &Evolution<'_>, from_x_m: f64, step_a: f64) -> Advance {
        let law = run.plan.calving_law.filter(|_| !run.plan.is_lagged);
        Advance { from_x_m, step_a, law }
    }

    /// Takes the iterate over as the state after a step of which X₀ = `from_x_m` + step·(U_t − U_c).
    pub(crate) fn accept(
        &mut self,
        run: &mut Evolution<'_>,
        root: Root,
        from_x_m: f64,
        step_a: f64,
    ) {
        run.end.state.unpack(&self.newton.x);
        run.end.residual_norm = root.residual_norm;
        let advance = self.moving_from(run, from_x_m, step_a);
        let terminus = advance
            .terminus(&self.model.parameters, &run.end.state)
            .expect("a state that solves the step has a terminus");
        run.end.terminus_x_m = terminus.x_m;
        run.end.parameters = self.model.parameters;
        run.end.parameters.calving_rate_m_per_a = terminus.calving_rate_m_per_a;
        run.end.parameters.terminus_thickness_m = terminus.thickness_m;
    }

    /// The model's parameters with what the calving law makes of the state reached.
    fn in_force(&self, run: &Evolution<'_>) -> Parameters {
        let p = self.model.parameters;
        run.plan.calving_law.map_or(p, |law| Parameters {
            calving_rate_m_per_a: law
                .rate_m_per_a(force::force_n_per_m(&run.end.state), run.end.terminus_x_m),
            terminus_thickness_m: law.thickness_m(p.terminus_thickness_m, run.end.terminus_x_m),
            ..p
        })
    }

    /// One implicit step; the iterate is the new state afterwards. Newton's method starts from
    /// `guess`, and through the smoothed rheology where a kink stops it.
    pub(crate) fn step(
        &mut self,
        guess: &State,
        before: Before<'_>,
        advance: Advance,
    ) -> Result<Root, SolveError> {
        let stage = "taking an implicit time step";
        let task = Task { advance, ..Task::new(MassBalance::Step(before)) };
        guess.pack(&mut self.newton.x);
        let limits = Limits { iterations: 20, ..Limits::default() };
        if let Ok(root) = self.solve_from_iterate(task, limits, stage) {
            return Ok(root);
        }
        guess.pack(&mut self.newton.x);
        self.solve_or_relax(task.smoothed(LEVELS[0]), stage)?;
        self.follow(task, LEVELS[0])
    }

    /// What the state reached has become.
    pub(crate) fn ending(&self, end: &TransientEnd) -> Ending {
        let h0 = end.state.thickness_0_m();
        if self.narrowest_m(end) <= 0.0 {
            Ending::FjordClosed
        } else if h0 >= end.parameters.terminus_thickness_m {
            Ending::Overthick
        } else if collapsed(&self.model, &end.state) || has_trough(&self.model, &end.state) {
            Ending::Collapsed
        } else {
            Ending::Completed
        }
    }

    /// What stands in the way of a mélange whose next step has no solution, however short. Where it has
    /// become thinner than its icebergs on the way, H_L = d holds in more than one place, and the end is
    /// about to jump to the nearest: it breaks up.
    pub(crate) fn stopped_by_what(&self, end: &TransientEnd) -> Option<Ending> {
        if end.state.thickness_m.iter().any(|h| *h < end.parameters.d_m) {
            return Some(Ending::Collapsed);
        }
        if self.narrowest_m(end) < NEARLY_CLOSED * self.model.fjord.width(0.0) {
            Some(Ending::FjordClosed)
        } else {
            let share = end.state.thickness_0_m() / end.parameters.terminus_thickness_m;
            (share > NEARLY_OVERTHICK).then_some(Ending::Overthick)
        }
    }

    /// The fjord's width at the ends of the mélange, of which one is where straight walls meet.
    fn narrowest_m(&self, end: &TransientEnd) -> f64 {
        let ends = [0.0, end.state.length_m].map(|x| end.terminus_x_m + x);
        ends.map(|x| self.model.fjord.width(x)).into_iter().fold(f64::INFINITY, f64::min)
    }
}

impl Evolution<'_> {
    /// After an accepted step: whether the calving law left no calving.
    pub(crate) fn count_stopped_calving(&mut self) {
        let is_stopped =
            self.plan.calving_law.is_some() && self.end.parameters.calving_rate_m_per_a == 0.0;
        self.end.calving_stopped_steps += usize::from(is_stopped);
    }

    /// Shows the state reached to the observer.
    pub(crate) fn report(&mut self, dt_a: f64, landing: Option<usize>) -> Result<(), SolveError> {
        let moment = Moment {
            step: self.end.steps,
            time_a: self.end.time_a,
            dt_a,
            landing,
            terminus_x_m: self.end.terminus_x_m,
            parameters: &self.end.parameters,
            state: &self.end.state,
        };
        if self.observer.moment(moment).is_break() {
            return Err(SolveError::Stopped { time_a: self.end.time_a });
        }
        Ok(())
    }
}
