//! One run through the solver: a checked run in, an outcome out. Knows no queue and no archive.

mod attempts;
mod calibrated;
mod discrete_roots;
mod following;
mod repeated;
mod sensitivities;

use self::attempts::{
    Attempts, FINER, FINER_STEPS, Found, Way, another_may_help, by_way_of_a_wedge, continued,
    in_steps,
};
pub use self::repeated::{Began, Beginning};
use super::dress::{Ended, outcome};
use super::record::Recorder;
use crate::domain::document::Regime;
use crate::domain::forcing::CalvingForm;
use crate::domain::outcome::{Outcome, Profile};
use crate::domain::run::RunSpec;
use crate::domain::start::Start;
use crate::domain::status::Status;
use crate::domain::time::Steps;
use melange_solver::diagnostic::{self, Geometry};
use melange_solver::error::SolveError;
use melange_solver::grid_error::grid_error;
use melange_solver::observe::Moment;
use melange_solver::physics::terminus::CalvingLaw;
use melange_solver::quasi_static::{Given, QuasiStaticVerdict};
use melange_solver::steady::SteadyVerdict;
use melange_solver::transient::{Ending, Plan, Stepping, TransientEnd};
use melange_solver::{Solution, Solver, force};
use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Evidence given with a steady state.
const SMOOTHING_LIMIT: &str = "smoothing limit";

/// Solves runs one after the other, each from its neighbour's answer. An answer does not depend on the
/// neighbour, only the time does; but a solve that gives up by itself may find one by way of a neighbour.
#[derive(Debug, Default)]
pub struct Walker {
    solver: Option<Solver>,
    found: Found,
    /// Whether the newest of `found` is a neighbour to start from; not after a failure.
    is_near: bool,
    /// Solves so far, which number them.
    solves: usize,
    /// What the last one began from.
    began: Began,
}

/// The last state of a stored run, to start from.
#[derive(Debug, Clone, PartialEq)]
pub struct StoredStart {
    /// The state.
    pub profile: Profile,
    /// X₀, m.
    pub terminus_x_m: f64,
}

/// A state to go on from, and the force of the steady state behind it, if there is one.
struct Prepared {
    solution: Solution,
    terminus_x_m: f64,
    steady_force_n_per_m: Option<f64>,
    attempts: Attempts,
}

/// Why there is nothing to go on from.
enum Halt {
    /// The run has ended.
    Ended(Box<Ended>),
    /// The caller said so.
    Stopped,
}

impl From<Ended> for Halt {
    fn from(ended: Ended) -> Self {
        Self::Ended(Box::new(ended))
    }
}

/// What one attempt at a transient came to.
enum Marched {
    Ended(Box<Ended>),
    /// It failed in a way that another attempt may avoid.
    Failed(Box<Ended>),
    /// Broken off, having taken too many steps or being told to.
    Stopped,
}

impl Walker {
    /// Solves a run. `start` is the stored state that a run named as its start, or why there is none; a
    /// failure, even of the program, is an outcome. `None` if `stop` said so on the way.
    pub fn solve(
        &mut self,
        run: &RunSpec,
        start: Result<&StoredStart, &str>,
        stop: &dyn Fn() -> bool,
    ) -> Option<Outcome> {
        self.began = Began::Own;
        let solved = catch_unwind(AssertUnwindSafe(|| self.ended(run, start, stop)));
        self.solves += 1;
        let ended = solved.unwrap_or_else(|_| {
            *self = Self { solves: self.solves, began: self.began, ..Self::default() };
            Some(Ended::verdict(Status::Failed, "the solver broke off: a defect to report".into()))
        });
        ended.map(|ended| outcome(run, ended))
    }

    fn ended(
        &mut self,
        run: &RunSpec,
        start: Result<&StoredStart, &str>,
        stop: &dyn Fn() -> bool,
    ) -> Option<Ended> {
        match &mut self.solver {
            Some(solver) => solver.retarget(run.model.clone()),
            none => *none = Some(Solver::new(run.model.clone())),
        }
        if let Some(given) = run.shared.given {
            return Some(self.at_rest(given));
        }
        if let Some(following) = &run.shared.following {
            return following::followed(run, following, stop);
        }
        if let Some(what) = &run.shared.calibrating {
            return calibrated::calibrated(run, what, stop);
        }
        let prepared = match self.prepared(run, start, stop) {
            Ok(prepared) => prepared,
            Err(Halt::Ended(ended)) => return Some(*ended),
            Err(Halt::Stopped) => return None,
        };
        if let Some(steps) = &run.shared.steps {
            return self.transient(run, steps, prepared, stop);
        }
        let detail = match run.shared.regime {
            Regime::Steady => "steady state, picked by the limit of the smoothed rheology",
            _ => "velocity, fluidity and friction solved at the given geometry",
        };
        let (rows, phrase) = if run.shared.discrete_roots {
            discrete_roots::discrete_roots(&run.model, &prepared.solution)
        } else {
            (Vec::new(), None)
        };
        let detail = phrase.map_or(detail.to_owned(), |phrase| format!("{detail}; {phrase}"));
        let mut ended = solved(prepared.solution, &detail).after(&prepared.attempts);
        ended.discrete_roots = rows;
        ended.terminus_x_m = prepared.terminus_x_m;
        if run.shared.sensitivities {
            let own = ended.state.as_ref().expect("a solution has a state");
            match sensitivities::sensitivities(&run.model, own) {
                Ok(told) => ended.sensitivities = told,
                // They take nothing from the run's own numbers.
                Err(e) => ended.detail += &format!("; no sensitivities: {e}"),
            }
        }
        if run.shared.grid_error {
            let own = ended.state.as_ref().expect("a solution has a state");
            // A grid without an answer takes nothing from the run's own.
            let told = grid_error(&run.model, own).map_err(|e| format!("another grid: {e}"));
            let none = || "another grid has no steady state".to_owned();
            ended.grid_error = Some(told.and_then(|told| told.ok_or_else(none)));
        }
        Some(ended)
    }

    fn solver(&mut self) -> &mut Solver {
        self.solver.as_mut().expect("a run has turned the solver to its model")
    }

    fn at_rest(&mut self, given: Given) -> Ended {
        match self.solver().quasi_static(given) {
            Ok(QuasiStaticVerdict::Converged(solution)) => {
                solved(solution, "quasi-static state: nothing calves, melts or stretches")
            }
            Ok(QuasiStaticVerdict::Overthick(evidence)) => {
                Ended::verdict(Status::Overthick, evidence)
            }
            Err(e) => failure(&e),
        }
    }

    /// The run's steady state, from its neighbour's answer; where that fails, by continuation from the
    /// nearest that is remembered. (A solve that is given a neighbour ends with one that is not, so that
    /// the same without it would be no other attempt.)
    fn steady(
        &mut self,
        run: &RunSpec,
        stop: &dyn Fn() -> bool,
    ) -> Result<(Solution, Attempts), Halt> {
        let Self { solver, found, is_near, solves, began } = self;
        let solver = solver.as_mut().expect("a run has turned the solver to its model");
        let was_near = std::mem::take(is_near);
        let mut attempts = Attempts::default();
        let near = found.newest().filter(|_| was_near);
        *began = near.map_or(Began::Own, |way| Began::Beside(way.solve));
        let verdict = match solver.steady(near.map(|way| &way.trail)) {
            Ok(verdict) => verdict,
            Err(e) => {
                let nearest = found.nearest(&run.model).filter(|_| another_may_help(&e));
                *began = nearest.map_or(*began, |way| Began::From(way.solve));
                let has_a_way = nearest.is_some();
                let way = if has_a_way { continued(solver, found, &run.model, stop) } else { None };
                let how = "by continuation from a neighbour";
                match way {
                    Some((verdict, steps)) => {
                        attempts.led(format!("{how} {}", in_steps(steps)));
                        verdict
                    }
                    None if has_a_way && stop() => return Err(Halt::Stopped),
                    None => {
                        if has_a_way {
                            attempts.in_vain(how.into());
                        }
                        return Err(failure(&e).after(&attempts).into());
                    }
                }
            }
        };
        match verdict {
            SteadyVerdict::Converged { solution, trail } => {
                found.remember(Way { model: run.model.clone(), trail, solve: *solves });
                *is_near = true;
                Ok((solution, attempts))
            }
            other => {
                *is_near = was_near;
                Err(verdict_of(other).after(&attempts).into())
            }
        }
    }

    /// The steady or diagnostic solution that is the run's result or its start; its end if there is none.
    fn prepared(
        &mut self,
        run: &RunSpec,
        start: Result<&StoredStart, &str>,
        stop: &dyn Fn() -> bool,
    ) -> Result<Prepared, Halt> {
        let failed = |detail: String| Halt::from(Ended::verdict(Status::Failed, detail));
        let (steady, mut attempts) = if run.needs_steady_state() {
            let (solution, attempts) = self.steady(run, stop)?;
            (Some(solution), attempts)
        } else {
            (None, Attempts::default())
        };
        let steady_force_n_per_m = steady.as_ref().map(|s| force::force_n_per_m(&s.state));
        // A start that is no steady state is that of the parameters in force at t = 0.
        let in_force = run.shared.forcing.at(run.parameters(), 0.0);
        let at_the_start = run.model.with_parameters(in_force);
        let (thickness_m, length_m, terminus_x_m) = match (&run.shared.start, steady) {
            (Some(Start::Wedge(w)), _) => {
                (diagnostic::wedge(&at_the_start, w.thickness_0_m), w.length_m, 0.0)
            }
            (Some(Start::Run(id)), _) => {
                let unreadable = |e| failed(format!("the start's run {id} could not be read: {e}"));
                let StoredStart { profile, terminus_x_m } = start.map_err(unreadable)?;
                let length_m = profile.node_x_m.last().copied().unwrap_or(f64::NAN);
                (profile.thickness_m.clone(), length_m, *terminus_x_m)
            }
            (_, Some(steady)) if run.shared.regime == Regime::Diagnostic => {
                (steady.state.thickness_m, steady.state.length_m, 0.0)
            }
            (_, Some(solution)) => {
                return Ok(Prepared {
                    solution,
                    terminus_x_m: 0.0,
                    steady_force_n_per_m,
                    attempts,
                });
            }
            (_, None) => return Err(failed("the run has neither regime nor start".into())),
        };
        let geometry = Geometry { thickness_m: &thickness_m, length_m, terminus_x_m };
        self.solver().retarget(at_the_start);
        let solution = match self.solver().diagnostic_in(geometry) {
            Err(e) if another_may_help(&e) => {
                let how = "by way of other geometries";
                match by_way_of_a_wedge(self.solver(), geometry, stop) {
                    Some((solution, steps)) => {
                        attempts.led(format!("{how} {}", in_steps(steps)));
                        Ok(solution)
                    }
                    None if stop() => return Err(Halt::Stopped),
                    None => {
                        attempts.in_vain(how.into());
                        Err(e)
                    }
                }
            }
            solution => solution,
        };
        self.solver().retarget(run.model.clone());
        let solution = solution.map_err(|e| Halt::from(failure(&e).after(&attempts)))?;
        Ok(Prepared { solution, terminus_x_m, steady_force_n_per_m, attempts })
    }

    /// The run's transient; where steps of controlled error fail, again with more accurate ones. (Steps of
    /// one length divide themselves, and others than those asked for would be another scheme.)
    fn transient(
        &mut self,
        run: &RunSpec,
        steps: &Steps,
        start: Prepared,
        stop: &dyn Fn() -> bool,
    ) -> Option<Ended> {
        let calving_law = match (run.shared.calving, start.steady_force_n_per_m) {
            (None, _) => None,
            (Some(CalvingForm::Law(law)), _) => Some(law),
            (Some(CalvingForm::SteadyFeedback), force) => {
                let rate = run.parameters().calving_rate_m_per_a;
                let force = force.expect("a run with this law solves for its steady state");
                Some(CalvingLaw::steady_feedback(rate, force))
            }
        };
        let mut plan = Plan {
            stepping: steps.stepping.clone(),
            forcing: run.shared.forcing.clone(),
            calving_law,
            is_lagged: run.shared.is_lagged,
            terminus_x_m: start.terminus_x_m,
        };
        let Prepared { solution, mut attempts, .. } = start;
        let mut failed = match self.march(run, steps, &solution, &plan, stop) {
            Marched::Ended(ended) => return Some(ended.after(&attempts)),
            Marched::Failed(failed) => failed,
            Marched::Stopped => return None,
        };
        if let Stepping::Controlled { tolerance: asked_for, .. } = steps.stepping {
            for share in FINER {
                let finer = share * asked_for;
                if let Stepping::Controlled { tolerance, .. } = &mut plan.stepping {
                    *tolerance = finer;
                }
                let how = format!("with steps of tolerance {finer:.1e}");
                let taken = Cell::new(0);
                let is_over = || {
                    taken.set(taken.get() + 1);
                    taken.get() > FINER_STEPS || stop()
                };
                match self.march(run, steps, &solution, &plan, &is_over) {
                    Marched::Ended(ended) => {
                        attempts.led(how);
                        return Some(ended.after(&attempts));
                    }
                    Marched::Failed(again) => failed = again,
                    Marched::Stopped if stop() => return None,
                    Marched::Stopped => {}
                }
                attempts.in_vain(how);
            }
        }
        Some(failed.after(&attempts))
    }

    /// One attempt at a transient.
    fn march(
        &mut self,
        run: &RunSpec,
        steps: &Steps,
        start: &Solution,
        plan: &Plan,
        stop: &dyn Fn() -> bool,
    ) -> Marched {
        let mut recorder = Recorder::new(steps, &run.model, stop);
        let spent = start.iterations;
        let ended = self.solver().transient(start.state.clone(), plan, &mut recorder);
        let end = match ended {
            Ok(end) => end,
            Err(SolveError::Stopped { .. }) => return Marched::Stopped,
            Err(e) => {
                let reached_a = recorder.record.series.time_a.last().copied().unwrap_or(0.0);
                let failed = failure(&e);
                let ended = Box::new(Ended {
                    detail: format!("{} (last stored time {reached_a} a)", failed.detail),
                    transient: Some((reached_a, recorder.record)),
                    ..failed
                });
                let is_last = !another_may_help(&e);
                return if is_last { Marched::Ended(ended) } else { Marched::Failed(ended) };
            }
        };
        recorder.close(&Moment {
            step: end.steps,
            time_a: end.time_a,
            dt_a: 0.0,
            landing: None,
            terminus_x_m: end.terminus_x_m,
            parameters: &end.parameters,
            state: &end.state,
        });
        let (status, what) = ending(&end);
        Marched::Ended(Box::new(Ended {
            status,
            detail: format!("{what} at t = {} a{}", end.time_a, remarks(&end)),
            iterations: spent + end.iterations,
            residual_norm: end.residual_norm,
            state: Some(end.state),
            model: Some(run.model.with_parameters(end.parameters)),
            terminus_x_m: end.terminus_x_m,
            transient: Some((end.time_a, recorder.record)),
            ..Ended::verdict(status, String::new())
        }))
    }
}

impl Ended {
    /// The same, with the attempts it took.
    fn after(mut self, attempts: &Attempts) -> Self {
        self.attempts = attempts.made;
        self.detail += &attempts.told(self.status == Status::Failed);
        self
    }
}

fn solved(solution: Solution, detail: &str) -> Ended {
    Ended {
        iterations: solution.iterations,
        residual_norm: solution.residual_norm,
        state: Some(solution.state),
        root_evidence: Some(SMOOTHING_LIMIT),
        ..Ended::verdict(Status::Converged, detail.to_owned())
    }
}

/// A solver that gave up, with its last residuals.
fn failure(e: &SolveError) -> Ended {
    /// Residual norms that are told.
    const TOLD: usize = 5;
    let mut detail = e.to_string();
    let mut iterations = 0;
    let mut residual_history = None;
    if let SolveError::NotConverged { iterations: spent, history, .. } = e {
        iterations = *spent;
        residual_history = Some(history.clone());
        let last = history.iter().skip(history.len().saturating_sub(TOLD));
        let told: Vec<String> = last.map(|r| format!("{r:.2e}")).collect();
        detail += &format!("; last residual norms {}", told.join(", "));
    }
    Ended { iterations, residual_history, ..Ended::verdict(Status::Failed, detail) }
}

fn verdict_of(verdict: SteadyVerdict) -> Ended {
    let (status, evidence) = match verdict {
        SteadyVerdict::NoSteadyState(evidence) => (Status::NoSteadyState, evidence),
        SteadyVerdict::Overthick(evidence) => (Status::Overthick, evidence),
        SteadyVerdict::FjordClosed(evidence) => (Status::FjordClosed, evidence),
        SteadyVerdict::Converged { .. } => (Status::Converged, String::new()),
    };
    Ended::verdict(status, evidence)
}

fn ending(end: &TransientEnd) -> (Status, &'static str) {
    match end.ending {
        Ending::Completed => (Status::Completed, "reached its end"),
        Ending::Collapsed => {
            (Status::Collapsed, "collapsed to the size of its icebergs, or broke up,")
        }
        Ending::Overthick => (Status::Overthick, "grew as thick as the glacier"),
        Ending::FjordClosed => (Status::FjordClosed, "reached the place where the walls meet"),
    }
}

/// What a reader of the result should know of its steps.
fn remarks(end: &TransientEnd) -> String {
    let mut remarks = String::new();
    if end.divided_steps > 0 {
        let n = end.divided_steps;
        remarks += &format!("; {n} steps were divided, having no solution as a whole");
    }
    if end.calving_stopped_steps > 0 {
        let n = end.calving_stopped_steps;
        remarks += &format!("; in {n} steps the calving law asked for 0 or less and got 0");
    }
    remarks
}

#[cfg(test)]
mod tests;
