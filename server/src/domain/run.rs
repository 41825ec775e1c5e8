//! One run, checked and complete: everything its result depends on. A [`Scenario`] holds what the runs
//! of a document share, checked once; a point of a sweep's axes makes a [`RunSpec`] of it.

use super::document::{Document, Regime};
use super::forcing::{self, CalvingForm};
use super::identity;
use super::outcome::SERIES;
use super::refusal::Refusal;
use super::start::Start;
use super::time::Steps;
use melange_solver::Model;
use melange_solver::fjord::Fjord;
use melange_solver::forcing::Forcing;
use melange_solver::melt::MeltShape;
use melange_solver::params::{self, ParameterError, Parameters};
use melange_solver::physics::closure::UpstreamClosure;
use melange_solver::quasi_static::Given;
use std::sync::Arc;

/// What the runs of a document have in common, checked.
#[derive(Debug, Clone, PartialEq)]
pub struct Scenario {
    written: Vec<(String, f64)>,
    closure: Option<UpstreamClosure>,
    fjord: Option<Fjord>,
    melt_shape: MeltShape,
    shared: Arc<Shared>,
}

/// The part of a run that no axis changes.
#[derive(Debug, Clone, PartialEq)]
pub struct Shared {
    /// What is solved for.
    pub regime: Regime,
    /// Where it starts; none for a state that depends on no start.
    pub start: Option<Start>,
    /// Steps and outputs; only for a transient.
    pub steps: Option<Steps>,
    /// Parameters that vary in time; only for a transient.
    pub forcing: Forcing,
    /// What sets the calving rate; only for a transient.
    pub calving: Option<CalvingForm>,
    /// Whether forcing and law are taken at the start of a step.
    pub is_lagged: bool,
    /// Size of a quasi-static mélange.
    pub given: Option<Given>,
    /// Whether the error of the grid is estimated.
    pub grid_error: bool,
    /// Places of transects.
    pub transects_at_chi: Vec<f64>,
    /// Hash of the tables and courses, if there are any.
    pub digest: Option<String>,
}

/// A run whose every value has been checked.
#[derive(Debug, Clone, PartialEq)]
pub struct RunSpec {
    /// Effective parameters, closure, fjord and shape of the melt.
    pub model: Model,
    /// The rest.
    pub shared: Arc<Shared>,
}

/// Most numbers that a run stores: 80 MB.
pub const MAX_STORED_NUMBERS: usize = 10_000_000;
/// Most transects of a run.
const MAX_TRANSECTS: usize = 1_000;

/// `calving_flux_m2_per_a` = U_c H_t sets U_c = U_t = flux/H_t instead of the velocities.
pub const FLUX: &str = "calving_flux_m2_per_a";
const VELOCITIES: [&str; 2] = ["calving_rate_m_per_a", "terminus_velocity_m_per_a"];
const WIDTHS: [&str; 2] = ["width_m", "width_gradient"];
/// What fixes a quasi-static state.
const ONE_SIZE: &str =
    "a quasi_static run needs exactly one of length_m, thickness_0_m and volume_m3";
/// Parameters that are 0 where nothing calves or melts.
const NOT_AT_REST: [&str; 2] = ["calving_rate_m_per_a", "melt_rate_m_per_day"];

impl Document {
    /// The document as a single run.
    pub fn into_run(self) -> Result<RunSpec, Refusal> {
        if self.name.is_some() || !self.axes.is_empty() {
            let field = if self.name.is_some() { "name" } else { "axes" };
            return Err(Refusal::out_of_place(
                field,
                "it belongs to a sweep, and this is a single run",
            ));
        }
        self.scenario()?.run(&[], None)
    }

    /// What all runs of the document share.
    pub(super) fn scenario(&self) -> Result<Scenario, Refusal> {
        self.refuse_what_is_not_there_yet()?;
        let regimes = "steady, diagnostic, transient or quasi_static";
        let regime = self.regime.ok_or_else(|| Refusal::missing("regime", regimes))?;
        let closure = self.options.upstream_closure.as_deref();
        let scenario = Scenario {
            written: self.parameters.0.clone(),
            closure: closure
                .map(|name| closure_of_name("options.upstream_closure", name))
                .transpose()?,
            fjord: self.fjord.as_ref().map(|table| table.fjord()).transpose()?,
            melt_shape: self.melt_shape.as_ref().map_or(Ok(MeltShape::default()), |m| m.shape())?,
            shared: Arc::new(Shared {
                regime,
                start: self.start_for(regime)?,
                steps: self.steps_for(regime)?,
                forcing: forcing::forcing(&self.forcing)?,
                calving: self.calving_law,
                is_lagged: self.options.lagged.unwrap_or_default(),
                given: self.given_for(regime)?,
                grid_error: self.options.grid_error.unwrap_or_default(),
                transects_at_chi: self.transects()?,
                digest: identity::digest(self),
            }),
        };
        self.check_regime(regime)?;
        Ok(scenario)
    }

    fn refuse_what_is_not_there_yet(&self) -> Result<(), Refusal> {
        for (field, given) in [("sample", self.sample.is_some()), ("table", self.table.is_some())] {
            if given {
                return Err(Refusal::not_yet(field));
            }
        }
        if let Some(Regime::Branch | Regime::FoldCurve | Regime::Calibration) = self.regime {
            return Err(Refusal::value(
                "regime",
                self.regime.map(Regime::name).unwrap_or_default(),
                "not there yet; steady, diagnostic, transient and quasi_static are",
            ));
        }
        Ok(())
    }

    /// Refuses what another regime is for.
    fn check_regime(&self, regime: Regime) -> Result<(), Refusal> {
        let is_transient = regime == Regime::Transient;
        let is_at_rest = regime == Regime::QuasiStatic;
        for (field, is_given, is_meant, whose) in [
            ("forcing", !self.forcing.is_empty(), is_transient, "transient"),
            ("calving_law", self.calving_law.is_some(), is_transient, "transient"),
            ("options.lagged", self.options.lagged == Some(true), is_transient, "transient"),
            ("length_m", self.length_m.is_some(), is_at_rest, "quasi_static"),
            ("thickness_0_m", self.thickness_0_m.is_some(), is_at_rest, "quasi_static"),
            ("volume_m3", self.volume_m3.is_some(), is_at_rest, "quasi_static"),
            (
                "options.grid_error",
                self.options.grid_error == Some(true),
                regime == Regime::Steady,
                "steady",
            ),
        ] {
            if is_given && !is_meant {
                let why = format!("it is for the regime `{whose}`, not for `{}`", regime.name());
                return Err(Refusal::out_of_place(field, &why));
            }
        }
        let fixed = self.time.as_ref().is_some_and(|t| t.fixed_dt_a.is_some());
        if self.options.lagged == Some(true) && !fixed {
            let permitted = "false, unless time.fixed_dt_a is given: a lag is an error of the step";
            return Err(Refusal::value("options.lagged", true, permitted));
        }
        if let Some(law) = &self.calving_law {
            law.check()?;
            if self.forcing.0.iter().any(|(name, _)| name == VELOCITIES[0]) {
                let why = "a calving law sets this rate, so that it has no course of its own";
                return Err(Refusal::out_of_place("forcing.calving_rate_m_per_a", why));
            }
        }
        Ok(())
    }

    fn start_for(&self, regime: Regime) -> Result<Option<Start>, Refusal> {
        match (regime, &self.start) {
            (Regime::Steady | Regime::QuasiStatic, None) => Ok(None),
            (Regime::Steady | Regime::QuasiStatic, Some(_)) => {
                let state = if regime == Regime::Steady { "steady" } else { "quasi-static" };
                Err(Refusal::out_of_place(
                    "start",
                    &format!("a {state} state does not depend on a start"),
                ))
            }
            (Regime::Diagnostic, None) => {
                Err(Refusal::missing("start", "a diagnostic run needs a geometry"))
            }
            (_, None) => Ok(Some(Start::Steady)),
            (_, start) => Ok(start.clone()),
        }
    }

    fn steps_for(&self, regime: Regime) -> Result<Option<Steps>, Refusal> {
        match (regime, &self.time) {
            (Regime::Transient, Some(time)) => time.steps().map(Some),
            (Regime::Transient, None) => {
                Err(Refusal::missing("time", "a transient run needs duration_a"))
            }
            (_, None) => Ok(None),
            (_, Some(_)) => Err(Refusal::out_of_place("time", "only a transient run has a time")),
        }
    }

    fn given_for(&self, regime: Regime) -> Result<Option<Given>, Refusal> {
        let number = |field: &str, value: f64, min: f64, max: f64, unit: &str| {
            let permitted = format!("a finite number from {min} to {max:e} {unit}");
            if (min..=max).contains(&value) {
                Ok(value)
            } else {
                Err(Refusal::number(field, value, permitted))
            }
        };
        match (self.length_m, self.thickness_0_m, self.volume_m3) {
            (Some(m), None, None) => Ok(Some(Given::Length(number("length_m", m, 1.0, 1e7, "m")?))),
            (None, Some(m), None) => {
                let thickness = number("thickness_0_m", m, 0.01, 5e3, "m")?;
                Ok(Some(Given::Thickness0(thickness)))
            }
            (None, None, Some(m3)) => {
                Ok(Some(Given::Volume(number("volume_m3", m3, 1e3, 1e15, "m3")?)))
            }
            (None, None, None) if regime != Regime::QuasiStatic => Ok(None),
            (None, None, None) => Err(Refusal::missing("length_m", ONE_SIZE)),
            (Some(_), Some(_), _) => Err(Refusal::out_of_place("thickness_0_m", ONE_SIZE)),
            _ => Err(Refusal::out_of_place("volume_m3", ONE_SIZE)),
        }
    }

    fn transects(&self) -> Result<Vec<f64>, Refusal> {
        let places = self.options.transects_at_chi.clone().unwrap_or_default();
        let field = "options.transects_at_chi";
        if places.len() > MAX_TRANSECTS {
            let permitted = format!("at most {MAX_TRANSECTS} places");
            return Err(Refusal::value(field, places.len(), permitted));
        }
        match places.iter().position(|chi| !(0.0..=1.0).contains(chi)) {
            Some(i) => {
                Err(Refusal::number(format!("{field}[{i}]"), places[i], "a number from 0 to 1"))
            }
            None => Ok(places),
        }
    }
}

impl Scenario {
    /// The closure that is written, if any is.
    pub fn closure(&self) -> Option<UpstreamClosure> {
        self.closure
    }

    /// What no axis changes.
    pub fn shared(&self) -> &Shared {
        &self.shared
    }

    /// The run with parameters and closure of a point put in; checks what depends on them.
    pub fn run(
        &self,
        point: &[(String, f64)],
        closure: Option<UpstreamClosure>,
    ) -> Result<RunSpec, Refusal> {
        let shared = &self.shared;
        let parameters = self.effective_parameters(point)?;
        let closure = closure.or(self.closure).unwrap_or_default();
        let refused = |e| Refusal::parameter("parameters", &e);
        let mut model = Model::new(parameters, closure)
            .map_err(refused)?
            .with_melt_shape(self.melt_shape.clone());
        if let Some(fjord) = &self.fjord {
            model = model.in_fjord(fjord.clone());
        }
        shared.forcing.check_against(model.parameters()).map_err(|e| forcing::refusal(&e))?;
        let run = RunSpec { model, shared: shared.clone() };
        run.check_start()?;
        run.check_size()?;
        if run.needs_steady_state() {
            run.model.check_steady().map_err(refused)?;
            if closure == UpstreamClosure::Printed {
                return Err(Refusal::value(
                    "options.upstream_closure",
                    closure.name(),
                    "published or no_stretching for a steady state, of which the printed closure leaves a family",
                ));
            }
        }
        Ok(run)
    }

    /// Defaults, overlaid with what the document and then the point give; no name twice.
    fn effective_parameters(&self, point: &[(String, f64)]) -> Result<Parameters, Refusal> {
        let mut parameters = Parameters::default();
        let is_at_rest = self.shared.regime == Regime::QuasiStatic;
        if is_at_rest {
            for name in NOT_AT_REST {
                parameters.set(name, 0.0).map_err(|e| Refusal::parameter("parameters", &e))?;
            }
        }
        let mut seen: Vec<&str> = Vec::new();
        let mut flux = None;
        for (name, value) in self.written.iter().chain(point) {
            let field = format!("parameters.{name}");
            if seen.contains(&name.as_str()) {
                let permitted = "this parameter is given more than once";
                return Err(Refusal::number(field, *value, permitted));
            }
            seen.push(name);
            if self.fjord.is_some() && WIDTHS.contains(&name.as_str()) {
                let permitted = "not together with `fjord`, which gives the width";
                return Err(Refusal::number(field, *value, permitted));
            }
            if is_at_rest && *value != 0.0 && (name == FLUX || NOT_AT_REST.contains(&name.as_str()))
            {
                let permitted = "0: in the quasi_static regime nothing calves and nothing melts";
                return Err(Refusal::number(field, *value, permitted));
            }
            if name == FLUX {
                flux = Some(*value);
            } else {
                parameters.set(name, *value).map_err(|e| match e {
                    ParameterError::Unknown { .. } => {
                        Refusal::unknown_parameter("parameters", name, *value)
                    }
                    e => Refusal::parameter("parameters", &e),
                })?;
            }
        }
        if let Some(flux) = flux.filter(|_| !is_at_rest) {
            set_velocities(&mut parameters, flux, &seen)?;
        }
        Ok(parameters)
    }
}

fn set_velocities(parameters: &mut Parameters, flux: f64, seen: &[&str]) -> Result<(), Refusal> {
    let field = format!("parameters.{FLUX}");
    if let Some(name) = VELOCITIES.iter().find(|name| seen.contains(name)) {
        let permitted = format!("not together with {name}: the flux sets both velocities");
        return Err(Refusal::number(field, flux, permitted));
    }
    let speed = flux / parameters.terminus_thickness_m;
    for name in VELOCITIES {
        let info = params::info(name).expect("velocities are in the table");
        if info.check(speed).is_err() {
            let permitted = format!(
                "a finite number whose quotient by terminus_thickness_m = {} is {}",
                parameters.terminus_thickness_m,
                params::permitted(name)
            );
            return Err(Refusal::number(field, flux, permitted));
        }
        parameters.set(name, speed).map_err(|e| Refusal::parameter("parameters", &e))?;
    }
    Ok(())
}

impl RunSpec {
    /// Effective parameters.
    pub fn parameters(&self) -> &Parameters {
        self.model.parameters()
    }

    /// Whether a steady state is solved for, as the result, as the start or for its calving law.
    pub fn needs_steady_state(&self) -> bool {
        self.shared.regime == Regime::Steady
            || self.shared.start == Some(Start::Steady)
            || self.shared.calving == Some(CalvingForm::SteadyFeedback)
    }

    /// Numbers stored with the run's profiles and series.
    pub fn stored_numbers(&self) -> usize {
        let profile = 6 * self.parameters().n_cells;
        let steps = self.shared.steps.as_ref();
        let rows = steps.map_or(0, Steps::rows);
        let profiles = 1 + steps.map_or(0, |s| s.profiles_at.len());
        rows.saturating_mul(SERIES.len()).saturating_add(profiles.saturating_mul(profile))
    }

    /// Size of the run in units of measured work: cells, times steps for a transient.
    pub fn work(&self) -> f64 {
        let steps = self.shared.steps.as_ref().map_or(1, Steps::count);
        let grids = if self.shared.grid_error { 16.0 } else { 1.0 };
        self.parameters().n_cells as f64 * steps as f64 * grids
    }

    fn check_start(&self) -> Result<(), Refusal> {
        let p = self.parameters();
        if self.shared.regime == Regime::Diagnostic
            && p.calving_flux_m2_per_a() == 0.0
            && p.terminus_velocity_m_per_a == 0.0
        {
            let permitted = "above 0 here or for the calving rate: friction at the walls is \
                             undetermined where nothing moves";
            return Err(Refusal::number("parameters.terminus_velocity_m_per_a", 0.0, permitted));
        }
        let Some(Start::Wedge(w)) = &self.shared.start else { return Ok(()) };
        if !(10.0..=1e6).contains(&w.length_m) {
            let length = "a finite number from 10 to 1000000 m";
            return Err(Refusal::number("start.length_m", w.length_m, length));
        }
        if !(w.thickness_0_m > p.d_m && w.thickness_0_m < p.terminus_thickness_m) {
            return Err(Refusal::number(
                "start.thickness_0_m",
                w.thickness_0_m,
                self.thicknesses(),
            ));
        }
        if self.model.fjord().width(w.length_m) <= 0.0 {
            let permitted = "short enough that the fjord is open at its end";
            return Err(Refusal::number("start.length_m", w.length_m, permitted));
        }
        self.model
            .check_reach(0.0, w.length_m)
            .map_err(|e| Refusal::number("start.length_m", w.length_m, e.to_string()))
    }

    fn check_size(&self) -> Result<(), Refusal> {
        if self.stored_numbers() > MAX_STORED_NUMBERS {
            return Err(Refusal::value(
                "time",
                self.stored_numbers(),
                format!(
                    "at most {MAX_STORED_NUMBERS} stored numbers per run: a larger output_every_a, or \
                     fewer profiles_at_a"
                ),
            ));
        }
        let Some(given) = self.shared.given else { return Ok(()) };
        self.model.check_quasi_static().map_err(|e| Refusal::parameter("parameters", &e))?;
        let p = self.parameters();
        match given {
            Given::Thickness0(m) if !(m > p.d_m && m < p.terminus_thickness_m) => {
                Err(Refusal::number("thickness_0_m", m, self.thicknesses()))
            }
            Given::Length(m) if self.model.fjord().width(m) <= 0.0 => {
                let permitted = "short enough that the fjord is open at its end";
                Err(Refusal::number("length_m", m, permitted))
            }
            Given::Length(m) => self
                .model
                .check_reach(0.0, m)
                .map_err(|e| Refusal::number("length_m", m, e.to_string())),
            _ => Ok(()),
        }
    }

    fn thicknesses(&self) -> String {
        let p = self.parameters();
        format!(
            "between d_m = {} and terminus_thickness_m = {}, both excluded",
            p.d_m, p.terminus_thickness_m
        )
    }
}

/// The closure of a name.
pub fn closure_of_name(field: &str, name: &str) -> Result<UpstreamClosure, Refusal> {
    UpstreamClosure::ALL
        .into_iter()
        .find(|c| c.name() == name)
        .ok_or_else(|| Refusal::value(field, name, "published, printed or no_stretching"))
}
