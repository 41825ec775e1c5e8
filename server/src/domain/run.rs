//! One run, checked and complete: everything its result depends on. A [`Scenario`] holds what the runs
//! of a document share, checked once; a point of a sweep's axes makes a [`RunSpec`] of it.

use super::branch::Following;
use super::calibration::Calibrating;
use super::curve::CurveRow;
use super::discrete_root::RootRow;
use super::document::{Document, Regime};
use super::effective::Effective;
use super::forcing::{self, CalvingForm};
use super::identity;
use super::outcome::SERIES;
use super::refusal::Refusal;
use super::rows::Row;
use super::sensitivity::SensitivityRow;
use super::start::Start;
use super::time::Steps;
use melange_solver::Model;
use melange_solver::fjord::Fjord;
use melange_solver::forcing::Forcing;
use melange_solver::melt::MeltShape;
use melange_solver::params::Parameters;
use melange_solver::physics::closure::UpstreamClosure;
use melange_solver::quasi_static::Given;
use std::sync::Arc;

/// What the runs of a document have in common, checked.
#[derive(Debug, Clone, PartialEq)]
pub struct Scenario {
    effective: Effective,
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
    /// What sets the calving rate; only for a transient and a branch.
    pub calving: Option<CalvingForm>,
    /// Whether forcing and law are taken at the start of a step.
    pub is_lagged: bool,
    /// Size of a quasi-static mélange.
    pub given: Option<Given>,
    /// What is followed; only for a branch and a curve of folds.
    pub following: Option<Following>,
    /// What is found from observations; only for a calibration.
    pub calibrating: Option<Calibrating>,
    /// Whether the error of the grid is estimated.
    pub grid_error: bool,
    /// Whether derivatives are stored.
    pub sensitivities: bool,
    /// Whether the other discrete roots are stored.
    pub discrete_roots: bool,
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
/// What fixes a quasi-static state.
const ONE_SIZE: &str =
    "a quasi_static run needs exactly one of length_m, thickness_0_m and volume_m3";

impl Document {
    /// The document as a single run.
    pub fn into_run(self) -> Result<RunSpec, Refusal> {
        for (field, is_given) in [
            ("name", self.name.is_some()),
            ("tags", !self.tags.is_empty()),
            ("priority", self.priority.is_some()),
            ("force", self.force.is_some()),
            ("axes", !self.axes.is_empty()),
            ("sample", self.sample.is_some()),
            ("table", self.table.is_some()),
        ] {
            if is_given {
                let why = "it belongs to a sweep, and this is a single run";
                return Err(Refusal::out_of_place(field, why));
            }
        }
        self.scenario()?.run(std::iter::empty(), None)
    }

    /// What all runs of the document share.
    pub(super) fn scenario(&self) -> Result<Scenario, Refusal> {
        let regimes =
            "steady, diagnostic, transient, quasi_static, branch, fold_curve or calibration";
        let regime = self.regime.ok_or_else(|| Refusal::missing("regime", regimes))?;
        let closure = self.options.upstream_closure.as_deref();
        let closure =
            closure.map(|name| closure_of_name("options.upstream_closure", name)).transpose()?;
        let fjord = self.fjord.as_ref().map(|table| table.fjord()).transpose()?;
        let melt_shape =
            self.melt_shape.as_ref().map_or(Ok(MeltShape::default()), |m| m.shape())?;
        let shared = Arc::new(Shared {
            regime,
            start: self.start_for(regime)?,
            steps: self.steps_for(regime)?,
            forcing: forcing::forcing(&self.forcing)?,
            calving: self.calving_law,
            is_lagged: self.options.lagged.unwrap_or_default(),
            given: self.given_for(regime)?,
            following: self.following_for(regime)?,
            calibrating: self.calibrating_for(regime)?,
            grid_error: self.options.grid_error.unwrap_or_default(),
            sensitivities: self.options.sensitivities.unwrap_or_default(),
            discrete_roots: self.options.discrete_roots.unwrap_or_default(),
            transects_at_chi: self.transects()?,
            digest: identity::digest(self),
        });
        self.check_regime(regime)?;
        let is_at_rest = regime == Regime::QuasiStatic;
        let effective = Effective::new(&self.parameters, is_at_rest, fjord.is_some())?;
        Ok(Scenario { effective, closure, fjord, melt_shape, shared })
    }

    /// Refuses what another regime is for.
    fn check_regime(&self, regime: Regime) -> Result<(), Refusal> {
        let is_transient = regime == Regime::Transient;
        let is_at_rest = regime == Regime::QuasiStatic;
        let is_branch = regime == Regime::Branch;
        let is_fold_curve = regime == Regime::FoldCurve;
        let has_law = is_transient || is_branch || is_fold_curve;
        for (field, is_given, is_meant, whose) in [
            ("forcing", !self.forcing.is_empty(), is_transient, "transient"),
            (
                "calving_law",
                self.calving_law.is_some(),
                has_law,
                "transient`, `branch` or `fold_curve",
            ),
            ("branch", self.branch.is_some(), is_branch, "branch"),
            ("fold_curve", self.fold_curve.is_some(), is_fold_curve, "fold_curve"),
            (
                "calibration",
                self.calibration.is_some(),
                regime == Regime::Calibration,
                "calibration",
            ),
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
            (
                "options.sensitivities",
                self.options.sensitivities == Some(true),
                regime == Regime::Steady,
                "steady",
            ),
            (
                "options.discrete_roots",
                self.options.discrete_roots == Some(true),
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
            if self.forcing.0.iter().any(|(name, _)| name == "calving_rate_m_per_a") {
                let why = "a calving law sets this rate, so that it has no course of its own";
                return Err(Refusal::out_of_place("forcing.calving_rate_m_per_a", why));
            }
        }
        Ok(())
    }

    fn start_for(&self, regime: Regime) -> Result<Option<Start>, Refusal> {
        match (regime, &self.start) {
            (Regime::Diagnostic, None) => {
                Err(Refusal::missing("start", "a diagnostic run needs a geometry"))
            }
            (Regime::Diagnostic, start) => Ok(start.clone()),
            (Regime::Transient, start) => Ok(Some(start.clone().unwrap_or(Start::Steady))),
            (_, None) => Ok(None),
            (_, Some(_)) => {
                let state = if regime == Regime::QuasiStatic { "quasi-static" } else { "steady" };
                Err(Refusal::out_of_place(
                    "start",
                    &format!("a {state} state does not depend on a start"),
                ))
            }
        }
    }

    fn calibrating_for(&self, regime: Regime) -> Result<Option<Calibrating>, Refusal> {
        match (regime, &self.calibration) {
            (Regime::Calibration, Some(calibration)) => calibration.calibrating().map(Some),
            (Regime::Calibration, None) => {
                let why = "a calibration needs parameters and observations";
                Err(Refusal::missing("calibration", why))
            }
            _ => Ok(None),
        }
    }

    fn following_for(&self, regime: Regime) -> Result<Option<Following>, Refusal> {
        let following = match (regime, &self.branch, &self.fold_curve) {
            (Regime::Branch, Some(branch), _) => branch.following()?,
            (Regime::FoldCurve, _, Some(curve)) => curve.following()?,
            (Regime::Branch, None, _) => {
                return Err(Refusal::missing("branch", "a branch needs control, from and to"));
            }
            (Regime::FoldCurve, _, None) => {
                let why =
                    "a curve of folds needs control, from, to, second, second_from and second_to";
                return Err(Refusal::missing("fold_curve", why));
            }
            _ => return Ok(None),
        };
        following.check_law(self.calving_law.as_ref())?;
        Ok(Some(following))
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

    /// The same for runs that set these parameters, each given with its first value.
    pub fn varied(
        self,
        columns: impl Iterator<Item = (&'static str, f64)>,
    ) -> Result<Self, Refusal> {
        Ok(Self { effective: self.effective.varied(columns)?, ..self })
    }

    /// The run with parameters and closure of a point put in; checks what depends on them.
    pub fn run(
        &self,
        point: impl Iterator<Item = (&'static str, f64)>,
        closure: Option<UpstreamClosure>,
    ) -> Result<RunSpec, Refusal> {
        let shared = &self.shared;
        let parameters = self.effective.at(point)?;
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
        run.check_following()?;
        run.check_calibration()?;
        Ok(run)
    }
}

impl Shared {
    /// Numbers that a run of so many cells stores with its profiles and series.
    pub fn stored_numbers(&self, n_cells: usize) -> usize {
        let steps = self.steps.as_ref();
        let rows = steps.map_or(0, Steps::rows);
        let profiles = 1 + steps.map_or(0, |s| s.profiles_at.len());
        let on_curves = self.following.as_ref().map_or(0, Following::usual_rows);
        let derivatives = if self.sensitivities { SensitivityRow::numbers(n_cells) } else { 0 };
        let roots = if self.discrete_roots { RootRow::usual_numbers() } else { 0 };
        rows.saturating_mul(SERIES.len())
            .saturating_add(derivatives)
            .saturating_add(roots)
            .saturating_add(self.calibrating.as_ref().map_or(0, Calibrating::stored_numbers))
            .saturating_add(on_curves * CurveRow::columns().len())
            .saturating_add(profiles.saturating_mul(6 * n_cells))
    }

    /// Size of a run of so many cells in units of measured work: cells, times steps for a transient.
    pub fn work(&self, n_cells: usize) -> f64 {
        let steps = self.steps.as_ref().map_or(1, Steps::count);
        let grids = if self.grid_error { 16.0 } else { 1.0 };
        let states = self.following.as_ref().map_or(1.0, |following| following.work(n_cells));
        let solves = self.calibrating.as_ref().map_or(1.0, Calibrating::solves);
        let roots = if self.discrete_roots { RootRow::work(n_cells) } else { 1.0 };
        n_cells as f64 * steps as f64 * grids * states * solves * roots
    }
}

impl RunSpec {
    /// Effective parameters.
    pub fn parameters(&self) -> &Parameters {
        self.model.parameters()
    }

    /// Whether a steady state is solved for, as the result, as the start or for its calving law.
    pub fn needs_steady_state(&self) -> bool {
        self.shared.regime == Regime::Steady
            || self.shared.following.is_some()
            || self.shared.calibrating.is_some()
            || self.shared.start == Some(Start::Steady)
            || self.shared.calving == Some(CalvingForm::SteadyFeedback)
    }

    /// Numbers stored with the run's profiles and series.
    pub fn stored_numbers(&self) -> usize {
        self.shared.stored_numbers(self.parameters().n_cells)
    }

    /// Size of the run, see [`Shared::work`].
    pub fn work(&self) -> f64 {
        self.shared.work(self.parameters().n_cells)
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
