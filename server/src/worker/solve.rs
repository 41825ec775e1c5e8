//! One run through the solver: a checked run in, an outcome out. Knows no queue and no archive.

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
use melange_solver::trail::Trail;
use melange_solver::transient::{Ending, Plan, TransientEnd};
use melange_solver::{Solution, Solver, force};
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Evidence given with a steady state.
const SMOOTHING_LIMIT: &str = "smoothing limit";

/// Solves runs one after the other, each from its neighbour's answer. The answers do not depend on
/// the neighbour, only the time does.
#[derive(Debug, Default)]
pub struct Walker {
    solver: Option<Solver>,
    near: Option<Trail>,
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
        let solved = catch_unwind(AssertUnwindSafe(|| self.ended(run, start, stop)));
        let ended = solved.unwrap_or_else(|_| {
            *self = Self::default();
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
        let prepared = match self.prepared(run, start) {
            Ok(prepared) => prepared,
            Err(ended) => return Some(*ended),
        };
        if let Some(steps) = &run.shared.steps {
            return self.transient(run, steps, prepared, stop);
        }
        let detail = match run.shared.regime {
            Regime::Steady => "steady state, picked by the limit of the smoothed rheology",
            _ => "velocity, fluidity and friction solved at the given geometry",
        };
        let mut ended = solved(prepared.solution, detail);
        ended.terminus_x_m = prepared.terminus_x_m;
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

    /// The steady or diagnostic solution that is the run's result or its start; its end if there is none.
    fn prepared(
        &mut self,
        run: &RunSpec,
        start: Result<&StoredStart, &str>,
    ) -> Result<Prepared, Box<Ended>> {
        let failed = |detail: String| Box::new(Ended::verdict(Status::Failed, detail));
        let gave_up = |e: SolveError| Box::new(failure(&e));
        let steady = if run.needs_steady_state() {
            let near = self.near.take();
            match self.solver().steady(near.as_ref()).map_err(gave_up)? {
                SteadyVerdict::Converged { solution, trail } => {
                    self.near = Some(trail);
                    Some(solution)
                }
                other => {
                    self.near = near;
                    return Err(Box::new(verdict(other)));
                }
            }
        } else {
            None
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
                return Ok(Prepared { solution, terminus_x_m: 0.0, steady_force_n_per_m });
            }
            (_, None) => return Err(failed("the run has neither regime nor start".into())),
        };
        let geometry = Geometry { thickness_m: &thickness_m, length_m, terminus_x_m };
        self.solver().retarget(at_the_start);
        let solution = self.solver().diagnostic_in(geometry);
        self.solver().retarget(run.model.clone());
        let solution = solution.map_err(gave_up)?;
        Ok(Prepared { solution, terminus_x_m, steady_force_n_per_m })
    }

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
        let plan = Plan {
            stepping: steps.stepping.clone(),
            forcing: run.shared.forcing.clone(),
            calving_law,
            is_lagged: run.shared.is_lagged,
            terminus_x_m: start.terminus_x_m,
        };
        let mut recorder = Recorder::new(steps, &run.model, stop);
        let spent = start.solution.iterations;
        let ended = self.solver().transient(start.solution.state, &plan, &mut recorder);
        let end = match ended {
            Ok(end) => end,
            Err(SolveError::Stopped { .. }) => return None,
            Err(e) => {
                let reached_a = recorder.record.series.time_a.last().copied().unwrap_or(0.0);
                let failed = failure(&e);
                return Some(Ended {
                    detail: format!("{} (last stored time {reached_a} a)", failed.detail),
                    transient: Some((reached_a, recorder.record)),
                    ..failed
                });
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
        Some(Ended {
            status,
            detail: format!("{what} at t = {} a{}", end.time_a, remarks(&end)),
            iterations: spent + end.iterations,
            residual_norm: end.residual_norm,
            state: Some(end.state),
            parameters: Some(end.parameters),
            terminus_x_m: end.terminus_x_m,
            transient: Some((end.time_a, recorder.record)),
            ..Ended::verdict(status, String::new())
        })
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
    if let SolveError::NotConverged { iterations: spent, history, .. } = e {
        iterations = *spent;
        let last = history.iter().skip(history.len().saturating_sub(TOLD));
        let told: Vec<String> = last.map(|r| format!("{r:.2e}")).collect();
        detail += &format!("; last residual norms {}", told.join(", "));
    }
    Ended { iterations, ..Ended::verdict(Status::Failed, detail) }
}

fn verdict(verdict: SteadyVerdict) -> Ended {
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
