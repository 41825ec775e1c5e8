//! What can be read off a stored state beside what is stored of it: the state as the solver had it, in the model
//! that was in force, and speed and fluidity across the fjord. Solves nothing and knows no file.

use super::curve::of_kind;
use super::document::{Document, Regime};
use super::outcome::{Outcome, Profile, TransectProfile};
use super::provenance::scenario;
use super::refusal::Refusal;
use super::run::RunSpec;
use super::start::Start;
use melange_solver::Model;
use melange_solver::control::Setting;
use melange_solver::physics::momentum::friction_signs;
use melange_solver::state::State;
use melange_solver::transect::transect;

/// Why nothing can be read off a run's state.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Unread {
    /// The run has none.
    #[error("the run has no state: it is {status}")]
    NoState {
        /// How it ended.
        status: &'static str,
    },
    /// No state is stored of that time.
    #[error("{0}")]
    NoSuchTime(Refusal),
    /// The fjord's width where the mélange was is not known.
    #[error(
        "where the terminus stood at t = {time_a} a is not stored, and the fjord's width depends on it: states that \
         are stored at times of the series have transects"
    )]
    UnknownTerminus {
        /// The time, a.
        time_a: f64,
    },
    /// Where the terminus stood in the run that was started from is not known any more.
    #[error(
        "the run that this one started from is not stored any more, and the fjord's width depends on its terminus"
    )]
    UnknownStart,
    /// What is stored of the run cannot be put together.
    #[error("what is stored of the run does not tell the model of its state")]
    UnknownModel,
}

/// A run with its result.
#[derive(Debug, Clone, Copy)]
pub struct StoredRun<'a> {
    /// The run.
    pub run: &'a RunSpec,
    /// Its result, with its tables.
    pub outcome: &'a Outcome,
    /// X₀ of the stored run that it starts from, m; none for any other start, or if that run is not stored.
    pub start_x_m: Option<f64>,
}

/// Transects of a state.
#[derive(Debug, Clone, PartialEq)]
pub struct Transects {
    /// When, a; none if there is no time.
    pub time_a: Option<f64>,
    /// One for each χ.
    pub items: Vec<TransectProfile>,
}

impl Outcome {
    /// The run of which this is the result, from what identifies it beside parameters and closure.
    pub fn run(&self, options: &str) -> Option<RunSpec> {
        let document = scenario(options, &self.upstream_closure, &self.parameters.0)?;
        Document::into_run(document).ok()
    }
}

impl RunSpec {
    /// The run whose terminus tells where this one's stands, if its result does not.
    pub fn stands_where(&self) -> Option<&str> {
        match &self.shared.start {
            Some(Start::Run(id)) if self.shared.regime == Regime::Diagnostic => Some(id),
            _ => None,
        }
    }

    /// The model in force at a time of a transient.
    fn in_force(&self, time_a: f64) -> Model {
        let steps = self.shared.steps.as_ref();
        let forced_a = steps.map_or(0.0, |steps| steps.forced_at_a(time_a, self.shared.is_lagged));
        self.model.with_parameters(self.shared.forcing.at(self.parameters(), forced_a))
    }

    /// Whether the terminus of a transient stays where it starts.
    fn stands_still(&self) -> bool {
        let p = self.parameters();
        let rates = ["calving_rate_m_per_a", "terminus_velocity_m_per_a"];
        self.shared.calving.is_none()
            && rates.iter().all(|name| self.shared.forcing.course(name).is_none())
            && p.terminus_velocity_m_per_a == p.calving_rate_m_per_a
    }
}

impl StoredRun<'_> {
    /// Transects of the last state, or of the one that is stored of a time.
    pub fn transects(&self, time_a: Option<f64>, chi: &[f64]) -> Result<Transects, Unread> {
        let (time_a, profile, is_last) = self.state(time_a)?;
        let model = self.model(time_a)?;
        let x_m = self.terminus_x_m(time_a, is_last, &model)?;
        let state = state(&model, profile).ok_or(Unread::UnknownModel)?;
        let items = chi.iter().map(|chi| transect_profile(&model, &state, x_m, *chi)).collect();
        Ok(Transects { time_a, items })
    }

    /// The state of a time, when it was, and whether it is the last one.
    fn state(&self, wanted_a: Option<f64>) -> Result<(Option<f64>, &Profile, bool), Unread> {
        /// Times closer than this, relative to the last one, are one.
        const SAME: f64 = 1e-9;
        let o = self.outcome;
        let no_state = || Unread::NoState { status: o.status.name() };
        let last = o.profile.as_ref().ok_or_else(no_state)?;
        let Some(wanted_a) = wanted_a else { return Ok((o.scalars.end_time_a, last, true)) };
        let refused = |permitted: String| {
            Err(Unread::NoSuchTime(Refusal::number("time_a", wanted_a, permitted)))
        };
        let Some(end_a) = o.scalars.end_time_a else {
            return refused("not given, as the run's state has no time".into());
        };
        let is_it = |time_a: f64| (time_a - wanted_a).abs() <= SAME * end_a;
        if is_it(end_a) {
            return Ok((Some(end_a), last, true));
        }
        let stored = || o.states.iter().flatten();
        match stored().find(|stored| is_it(stored.time_a)) {
            Some(stored) => Ok((Some(stored.time_a), &stored.profile, false)),
            None => {
                let mut times: Vec<String> = stored().map(|s| s.time_a.to_string()).collect();
                if times.last() != Some(&end_a.to_string()) {
                    times.push(end_a.to_string());
                }
                refused(format!("a time of a stored state: {} a", few(&times)))
            }
        }
    }

    /// The model in force in a state.
    fn model(&self, time_a: Option<f64>) -> Result<Model, Unread> {
        let run = self.run;
        if let Some(following) = &run.shared.following {
            // The state is that of the start.
            let mut there = run.branch_plan(following).setting;
            let second = following.second.map(|second| second.control.value(&there));
            let rows = self.outcome.curve_rows();
            let start = match second {
                None => of_kind(rows, "point").into_iter().find(|row| row.step == Some(0.0)),
                at => of_kind(rows, "fold").into_iter().find(|row| row.second_value == at),
            };
            let value = start.and_then(|row| row.control_value).ok_or(Unread::UnknownModel)?;
            following.control.set(&mut there, value);
            return Ok(there.model);
        }
        if let Some(what) = &run.shared.calibrating {
            let mut there = Setting { model: run.model.clone(), law: None };
            let rows = self.outcome.calibration_rows();
            for unknown in &what.unknowns {
                let is_its = |name: Option<&str>| name == Some(unknown.control.name());
                let mut estimates =
                    rows.iter().filter(|row| row.kind.as_deref() == Some("estimate"));
                let row = estimates.find(|row| is_its(row.parameter.as_deref()));
                let value = row.and_then(|row| row.value).ok_or(Unread::UnknownModel)?;
                unknown.control.set(&mut there, value);
            }
            return Ok(there.model);
        }
        Ok(match time_a {
            Some(time_a) => run.in_force(time_a),
            None => run.model.clone(),
        })
    }

    /// X₀ in a state; where the width is the same everywhere, any place does.
    fn terminus_x_m(
        &self,
        time_a: Option<f64>,
        is_last: bool,
        model: &Model,
    ) -> Result<f64, Unread> {
        let (run, scalars) = (self.run, &self.outcome.scalars);
        if model.fjord().is_constant() {
            return Ok(0.0);
        }
        let Some(time_a) = time_a else {
            return match run.stands_where() {
                Some(_) => self.start_x_m.ok_or(Unread::UnknownStart),
                None => Ok(0.0),
            };
        };
        let in_series = || {
            let series = self.outcome.series.as_ref()?;
            let row = series.time_a.iter().position(|t| *t == time_a)?;
            series.terminus_x_m.get(row).copied().filter(|x_m| x_m.is_finite())
        };
        let last = scalars.terminus_x_m.filter(|_| is_last || run.stands_still());
        last.or_else(in_series).ok_or(Unread::UnknownTerminus { time_a })
    }
}

/// Texts behind each other, the middle of a long list left out.
fn few(texts: &[String]) -> String {
    const FEW: usize = 20;
    match texts.split_last() {
        Some((last, rest)) if rest.len() > FEW => {
            format!("{}, …, {last}", rest[..FEW].join(", "))
        }
        _ => texts.join(", "),
    }
}

/// The state of a profile, with the signs of μ_w; none if the profile is not of the model's grid.
fn state(model: &Model, profile: &Profile) -> Option<State> {
    let length_m = *profile.node_x_m.last()?;
    let mut state = State {
        velocity_m_per_a: profile.velocity_m_per_a.clone(),
        mu_w: profile.mu_w.clone(),
        thickness_m: profile.thickness_m.clone(),
        fluidity_per_a: profile.fluidity_per_a.clone(),
        length_m,
    };
    let n = model.parameters().n_cells;
    let is_of_the_grid = state.thickness_m.len() == n
        && state.fluidity_per_a.len() == n
        && state.velocity_m_per_a.len() == n + 1
        && state.mu_w.len() == n + 1;
    if !is_of_the_grid {
        return None;
    }
    let signs = friction_signs(model.parameters(), &state);
    state.mu_w.iter_mut().zip(signs).for_each(|(mu_w, sign)| *mu_w *= sign);
    Some(state)
}

/// A transect of a state whose terminus stands at X₀, as it is shown.
pub fn transect_profile(model: &Model, s: &State, terminus_x_m: f64, chi: f64) -> TransectProfile {
    let t = transect(model, s, terminus_x_m, chi);
    TransectProfile {
        chi: t.chi,
        x_m: t.x_m,
        width_m: t.width_m,
        mu_w: t.mu_w.abs(),
        y_m: t.y_m,
        velocity_m_per_a: t.velocity_m_per_a,
        fluidity_per_a: t.fluidity_per_a,
    }
}
