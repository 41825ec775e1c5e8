//! One run through the solver: a checked run in, an outcome out. Knows no queue and no archive.

use crate::domain::document::{Regime, Start};
use crate::domain::outcome::{EffectiveParameters, Outcome, Profile, Scalars, Series, StoredState};
use crate::domain::run::{RunSpec, Steps};
use crate::domain::status::Status;
use melange_solver::error::SolveError;
use melange_solver::observe::Moment;
use melange_solver::state::State;
use melange_solver::steady::SteadyVerdict;
use melange_solver::transient::{Ending, Plan, TransientEnd};
use melange_solver::{Model, Solution, Solver, diagnostic, force};
use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Evidence given with a steady state.
const SMOOTHING_LIMIT: &str = "smoothing limit";

/// Solves runs one after the other, each from its neighbour's answer. The answers do not depend on
/// the neighbour, only the time does.
#[derive(Debug, Default)]
pub struct Walker {
    solver: Option<Solver>,
    near: Option<State>,
}

/// What a solve came to, before it is dressed as an outcome.
struct Ended {
    status: Status,
    detail: String,
    iterations: usize,
    residual_norm: f64,
    state: Option<State>,
    terminus_x_m: f64,
    root_evidence: Option<&'static str>,
    transient: Option<(f64, Series, Vec<StoredState>)>,
}

impl Ended {
    fn verdict(status: Status, detail: String) -> Self {
        Self {
            status,
            detail,
            iterations: 0,
            residual_norm: f64::NAN,
            state: None,
            terminus_x_m: 0.0,
            root_evidence: None,
            transient: None,
        }
    }

    fn solved(solution: Solution, detail: &str) -> Self {
        Self {
            iterations: solution.iterations,
            residual_norm: solution.residual_norm,
            state: Some(solution.state),
            root_evidence: Some(SMOOTHING_LIMIT),
            ..Self::verdict(Status::Converged, detail.to_owned())
        }
    }
}

impl Walker {
    /// Solves a run. `start` is the stored state that a run named as its start, or why there is none; a
    /// failure, even of the program, is an outcome. `None` if `stop` said so on the way.
    pub fn solve(
        &mut self,
        run: &RunSpec,
        start: Result<&Profile, &str>,
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
        start: Result<&Profile, &str>,
        stop: &dyn Fn() -> bool,
    ) -> Option<Ended> {
        let (solver, solution) = match self.prepared(run, start) {
            Ok(prepared) => prepared,
            Err(ended) => return Some(*ended),
        };
        if let Some(steps) = &run.steps {
            return transient(solver, steps, solution, stop);
        }
        let detail = match run.regime {
            Regime::Steady => "steady state, picked by the limit of the smoothed rheology",
            _ => "velocity, fluidity and friction solved at the given geometry",
        };
        Some(Ended::solved(solution, detail))
    }

    /// The steady or diagnostic solution that is the run's result or its start; its end if there is none.
    fn prepared(
        &mut self,
        run: &RunSpec,
        start: Result<&Profile, &str>,
    ) -> Result<(&mut Solver, Solution), Box<Ended>> {
        let failed = |detail: String| Box::new(Ended::verdict(Status::Failed, detail));
        let gave_up = |e: SolveError| Box::new(failure(&e));
        let model = Model::new(run.parameters, run.closure).map_err(|e| failed(e.to_string()))?;
        let solver = match &mut self.solver {
            Some(solver) => {
                solver.retarget(model.clone());
                solver
            }
            none => none.insert(Solver::new(model.clone())),
        };
        let steady = if run.needs_steady_state() {
            match solver.steady(self.near.as_ref()).map_err(gave_up)? {
                SteadyVerdict::Converged { solution, first_level } => {
                    self.near = Some(first_level);
                    Some(solution)
                }
                other => return Err(Box::new(verdict(other))),
            }
        } else {
            None
        };
        let (thickness_m, length_m) = match (&run.start, steady) {
            (Some(Start::Wedge(w)), _) => (diagnostic::wedge(&model, w.thickness_0_m), w.length_m),
            (Some(Start::Run(id)), _) => {
                let unreadable = |e| failed(format!("the start's run {id} could not be read: {e}"));
                let profile = start.map_err(unreadable)?;
                let length_m = profile.node_x_m.last().copied().unwrap_or(f64::NAN);
                (profile.thickness_m.clone(), length_m)
            }
            (_, Some(steady)) if run.regime == Regime::Diagnostic => {
                (steady.state.thickness_m, steady.state.length_m)
            }
            (_, Some(steady)) => return Ok((solver, steady)),
            (_, None) => return Err(failed("the run has neither regime nor start".into())),
        };
        let solution = solver.diagnostic(&thickness_m, length_m).map_err(gave_up)?;
        Ok((solver, solution))
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

fn transient(
    solver: &mut Solver,
    steps: &Steps,
    start: Solution,
    stop: &dyn Fn() -> bool,
) -> Option<Ended> {
    let model = solver.model().clone();
    let mut series = Series::default();
    let mut states = Vec::new();
    let mut wanted = steps.profiles_at.iter().peekable();
    let mut record = |m: Moment<'_>| {
        // Between the kept steps lies nothing; the moment of a verdict is always kept.
        let on_grid = m.time_a == m.step as f64 * steps.dt_a;
        if m.step.is_multiple_of(steps.series_every) || m.step == steps.count || !on_grid {
            push(&mut series, &model, m);
        }
        if wanted.next_if(|step| **step == m.step).is_some() && on_grid {
            states.push(StoredState { time_a: m.time_a, profile: profile(m.state) });
        }
        if stop() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let plan = Plan::fixed(steps.dt_a, steps.count);
    let end: TransientEnd = match solver.transient(start.state, &plan, &mut record) {
        Ok(end) => end,
        Err(SolveError::Stopped { .. }) => return None,
        Err(e) => {
            let reached_a = series.time_a.last().copied().unwrap_or(0.0);
            let failed = failure(&e);
            return Some(Ended {
                detail: format!("{} (last stored time {reached_a} a)", failed.detail),
                transient: Some((reached_a, series, states)),
                ..failed
            });
        }
    };
    let (status, what) = match end.ending {
        Ending::Completed => (Status::Completed, "reached its end"),
        Ending::Collapsed => (Status::Collapsed, "collapsed to the size of its icebergs"),
        Ending::Overthick => (Status::Overthick, "grew as thick as the glacier"),
        Ending::FjordClosed => (Status::FjordClosed, "reached the place where the walls meet"),
    };
    let divided = match end.divided_steps {
        0 => String::new(),
        n => format!("; {n} steps were divided, having no solution as a whole"),
    };
    Some(Ended {
        status,
        detail: format!("{what} at t = {} a{divided}", end.time_a),
        iterations: start.iterations + end.iterations,
        residual_norm: end.residual_norm,
        state: Some(end.state),
        terminus_x_m: end.terminus_x_m,
        root_evidence: None,
        transient: Some((end.time_a, series, states)),
    })
}

fn push(series: &mut Series, model: &Model, m: Moment<'_>) {
    let p = model.parameters();
    series.time_a.push(m.time_a);
    series.length_m.push(m.state.length_m);
    series.thickness_0_m.push(m.state.thickness_0_m());
    series.force_n_per_m.push(force::force_n_per_m(m.state));
    series.force_quasi_static_n_per_m.push(force::force_quasi_static_n_per_m(m.state));
    series.velocity_end_m_per_a.push(m.state.velocity_m_per_a[m.state.n_cells()]);
    series.volume_m3.push(force::volume_m3(model, m.state, m.terminus_x_m));
    series.melt_rate_m_per_day.push(p.melt_rate_m_per_day);
    series.calving_rate_m_per_a.push(p.calving_rate_m_per_a);
}

fn profile(s: &State) -> Profile {
    Profile {
        node_x_m: s.node_x_m(),
        velocity_m_per_a: s.velocity_m_per_a.clone(),
        mu_w: s.mu_w.iter().map(|mu| mu.abs()).collect(),
        cell_x_m: s.cell_x_m(),
        thickness_m: s.thickness_m.clone(),
        fluidity_per_a: s.fluidity_per_a.clone(),
    }
}

fn outcome(run: &RunSpec, ended: Ended) -> Outcome {
    let mut scalars = Scalars::default();
    let is_steady = run.regime == Regime::Steady;
    if let (Some(s), Ok(model)) = (&ended.state, Model::new(run.parameters, run.closure)) {
        scalars = Scalars {
            length_m: Some(s.length_m),
            thickness_0_m: Some(s.thickness_0_m()),
            force_n_per_m: Some(force::force_n_per_m(s)),
            force_quasi_static_n_per_m: Some(force::force_quasi_static_n_per_m(s)),
            velocity_end_m_per_a: Some(s.velocity_m_per_a[s.n_cells()]),
            volume_m3: Some(force::volume_m3(&model, s, ended.terminus_x_m)),
            residual_norm: Some(ended.residual_norm),
            mass_budget_defect: is_steady.then(|| force::mass_budget_defect(&model, s)),
            yielding_fraction: Some(force::yielding_fraction(&model, s)),
            end_time_a: None,
        }
        .finite();
    }
    scalars.end_time_a = ended.transient.as_ref().map(|(time_a, _, _)| *time_a);
    let (series, states) = match ended.transient {
        Some((_, series, states)) => (Some(series), Some(states)),
        None => (None, None),
    };
    Outcome {
        status: ended.status,
        detail: ended.detail,
        parameters: EffectiveParameters(run.parameters),
        regime: run.regime.name().to_owned(),
        upstream_closure: run.closure.name().to_owned(),
        scalars,
        iterations: ended.iterations as u64,
        root_evidence: ended.root_evidence.map(str::to_owned),
        profile: ended.state.as_ref().map(profile),
        series,
        states,
    }
}
