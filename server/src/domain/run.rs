//! One run, checked and complete: everything its result depends on.

use super::document::{Document, Regime, Start, Time};
use super::outcome::SERIES;
use super::refusal::Refusal;
use melange_solver::Model;
use melange_solver::params::{self, ParameterError, Parameters};
use melange_solver::physics::closure::UpstreamClosure;

/// A run whose every value has been checked.
#[derive(Debug, Clone, PartialEq)]
pub struct RunSpec {
    /// What is solved for.
    pub regime: Regime,
    /// Effective parameters.
    pub parameters: Parameters,
    /// Closure at the terminus.
    pub closure: UpstreamClosure,
    /// Where it starts; none for a steady state.
    pub start: Option<Start>,
    /// Steps and outputs; only for a transient.
    pub steps: Option<Steps>,
}

/// Fixed steps and what is kept of them, in whole steps.
#[derive(Debug, Clone, PartialEq)]
pub struct Steps {
    /// Δt, a.
    pub dt_a: f64,
    /// Number of steps.
    pub count: usize,
    /// A row of the series every so many steps.
    pub series_every: usize,
    /// Steps after which the profile is kept, ascending.
    pub profiles_at: Vec<usize>,
}

/// Most steps of a run.
const MAX_STEPS: f64 = 1e7;
/// Most numbers that a run stores: 80 MB.
pub const MAX_STORED_NUMBERS: usize = 10_000_000;

/// `calving_flux_m2_per_a` = U_c H_t sets U_c = U_t = flux/H_t instead of the velocities.
pub const FLUX: &str = "calving_flux_m2_per_a";
const VELOCITIES: [&str; 2] = ["calving_rate_m_per_a", "terminus_velocity_m_per_a"];

impl Document {
    /// The document as a single run.
    pub fn into_run(self) -> Result<RunSpec, Refusal> {
        if self.name.is_some() || !self.axes.is_empty() {
            let field = if self.name.is_some() { "name" } else { "axes" };
            return Err(Refusal {
                field: Some(field.into()),
                ..Refusal::sentence(format!(
                    "`{field}` belongs to a sweep, and this is a single run"
                ))
            });
        }
        self.run_with(&[], None)
    }

    /// The run with parameters and closure of a point put in; checks everything.
    pub(super) fn run_with(
        &self,
        point: &[(String, f64)],
        closure: Option<UpstreamClosure>,
    ) -> Result<RunSpec, Refusal> {
        self.refuse_what_is_not_there_yet()?;
        let regime = self.regime.ok_or_else(|| Refusal {
            field: Some("regime".into()),
            permitted: Some("steady, diagnostic or transient".into()),
            ..Refusal::sentence("`regime` is missing: steady, diagnostic or transient")
        })?;
        let parameters = effective_parameters(&self.parameters.0, point)?;
        let closure = match closure {
            Some(closure) => closure,
            None => self
                .options
                .upstream_closure
                .as_deref()
                .map_or(Ok(UpstreamClosure::default()), |name| {
                    closure_of_name("options.upstream_closure", name)
                })?,
        };
        let model =
            Model::new(parameters, closure).map_err(|e| Refusal::parameter("parameters", &e))?;
        let run = RunSpec {
            regime,
            parameters,
            closure,
            start: self.start_for(regime, &parameters)?,
            steps: self.steps_for(regime)?,
        };
        if run.stored_numbers() > MAX_STORED_NUMBERS {
            return Err(Refusal::value(
                "time",
                run.stored_numbers(),
                format!(
                    "at most {MAX_STORED_NUMBERS} stored numbers per run: a larger output_every_a, or \
                     fewer profiles_at_a"
                ),
            ));
        }
        if run.needs_steady_state() {
            model.check_steady().map_err(|e| Refusal::parameter("parameters", &e))?;
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

    fn refuse_what_is_not_there_yet(&self) -> Result<(), Refusal> {
        let later = [
            ("fjord", self.fjord.is_some()),
            ("forcing", self.forcing.is_some()),
            ("calving_law", self.calving_law.is_some()),
            ("sample", self.sample.is_some()),
            ("table", self.table.is_some()),
            ("length_m", self.length_m.is_some()),
            ("thickness_0_m", self.thickness_0_m.is_some()),
            ("volume_m3", self.volume_m3.is_some()),
            ("options.lagged", self.options.lagged.is_some()),
            ("options.transects_at_chi", self.options.transects_at_chi.is_some()),
            ("time.tolerance", self.time.as_ref().is_some_and(|t| t.tolerance.is_some())),
        ];
        if let Some((field, _)) = later.into_iter().find(|(_, given)| *given) {
            return Err(Refusal::not_yet(field));
        }
        if let Some(shape) = self.melt_shape.as_ref().filter(|s| **s != "uniform") {
            return Err(Refusal::value(
                "melt_shape",
                shape.clone(),
                "other shapes than \"uniform\" are not there yet",
            ));
        }
        if let Some(
            Regime::QuasiStatic | Regime::Branch | Regime::FoldCurve | Regime::Calibration,
        ) = self.regime
        {
            return Err(Refusal::value(
                "regime",
                self.regime.map(Regime::name).unwrap_or_default(),
                "not there yet; steady, diagnostic and transient are",
            ));
        }
        Ok(())
    }

    fn start_for(&self, regime: Regime, p: &Parameters) -> Result<Option<Start>, Refusal> {
        let start = match (regime, &self.start) {
            (Regime::Steady, None) => return Ok(None),
            (Regime::Steady, Some(_)) => {
                return Err(Refusal {
                    field: Some("start".into()),
                    ..Refusal::sentence(
                        "`start` is refused: a steady state does not depend on a start",
                    )
                });
            }
            (Regime::Diagnostic, None) => {
                return Err(Refusal {
                    field: Some("start".into()),
                    ..Refusal::sentence("`start` is missing: a diagnostic run needs a geometry")
                });
            }
            (_, None) => Start::Steady,
            (_, Some(start)) => start.clone(),
        };
        if let Start::Wedge(w) = &start {
            let length = "a finite number from 10 to 1000000 m";
            if !(10.0..=1e6).contains(&w.length_m) {
                return Err(Refusal::number("start.length_m", w.length_m, length));
            }
            if !(w.thickness_0_m > p.d_m && w.thickness_0_m < p.terminus_thickness_m) {
                let permitted = format!(
                    "between d_m = {} and terminus_thickness_m = {}, both excluded",
                    p.d_m, p.terminus_thickness_m
                );
                return Err(Refusal::number("start.thickness_0_m", w.thickness_0_m, permitted));
            }
            if p.width_m + p.width_gradient * w.length_m <= 0.0 {
                let permitted = "short enough that the fjord is open at its end";
                return Err(Refusal::number("start.length_m", w.length_m, permitted));
            }
        }
        Ok(Some(start))
    }

    fn steps_for(&self, regime: Regime) -> Result<Option<Steps>, Refusal> {
        match (regime, &self.time) {
            (Regime::Transient, Some(time)) => time.steps().map(Some),
            (Regime::Transient, None) => Err(Refusal {
                field: Some("time".into()),
                ..Refusal::sentence(
                    "`time` is missing: a transient run needs duration_a and fixed_dt_a",
                )
            }),
            (_, None) => Ok(None),
            (_, Some(_)) => Err(Refusal {
                field: Some("time".into()),
                ..Refusal::sentence("`time` is refused: only a transient run has a time")
            }),
        }
    }
}

impl Time {
    fn steps(&self) -> Result<Steps, Refusal> {
        let Some(dt_a) = self.fixed_dt_a else {
            return Err(Refusal {
                field: Some("time.fixed_dt_a".into()),
                ..Refusal::sentence(
                    "`time.fixed_dt_a` is missing: error-controlled steps are not there yet",
                )
            });
        };
        if !(1e-6..=10.0).contains(&dt_a) {
            return Err(Refusal::number(
                "time.fixed_dt_a",
                dt_a,
                "a finite number from 1e-6 to 10 a",
            ));
        }
        let whole = |field: &str, time_a: f64, least: f64| {
            let steps = time_a / dt_a;
            let off = (steps - steps.round()).abs() > 1e-6;
            if !steps.is_finite() || steps.round() < least || steps.round() > MAX_STEPS || off {
                let permitted = format!(
                    "a whole number of steps of fixed_dt_a = {dt_a} a, from {least} to {MAX_STEPS:e} of them"
                );
                return Err(Refusal::number(field, time_a, permitted));
            }
            Ok(steps.round() as usize)
        };
        let count = whole("time.duration_a", self.duration_a, 1.0)?;
        let series_every =
            self.output_every_a.map_or(Ok(1), |every| whole("time.output_every_a", every, 1.0))?;
        let mut profiles_at = Vec::new();
        for (i, time_a) in self.profiles_at_a.iter().enumerate() {
            let field = format!("time.profiles_at_a[{i}]");
            let step = whole(&field, *time_a, 0.0)?;
            if step > count {
                let permitted = format!("not after duration_a = {}", self.duration_a);
                return Err(Refusal::number(field, *time_a, permitted));
            }
            profiles_at.push(step);
        }
        profiles_at.sort_unstable();
        profiles_at.dedup();
        Ok(Steps { dt_a, count, series_every, profiles_at })
    }
}

impl RunSpec {
    /// Whether a steady state is solved for, as the result or as the start.
    pub fn needs_steady_state(&self) -> bool {
        self.regime == Regime::Steady || self.start == Some(Start::Steady)
    }

    /// Numbers stored with the run's profiles and series.
    pub fn stored_numbers(&self) -> usize {
        let profile = 6 * self.parameters.n_cells;
        let rows = self.steps.as_ref().map_or(0, |s| s.count / s.series_every + 1);
        let profiles = 1 + self.steps.as_ref().map_or(0, |s| s.profiles_at.len());
        rows * SERIES.len() + profiles * profile
    }

    /// Size of the run in units of measured work: cells, times steps for a transient.
    pub fn work(&self) -> f64 {
        let steps = self.steps.as_ref().map_or(1, |s| s.count);
        self.parameters.n_cells as f64 * steps as f64
    }
}

/// The closure of a name.
pub fn closure_of_name(field: &str, name: &str) -> Result<UpstreamClosure, Refusal> {
    UpstreamClosure::ALL
        .into_iter()
        .find(|c| c.name() == name)
        .ok_or_else(|| Refusal::value(field, name, "published, printed or no_stretching"))
}

/// Defaults, overlaid with what the document and then the point give; no name twice.
fn effective_parameters(
    written: &[(String, f64)],
    point: &[(String, f64)],
) -> Result<Parameters, Refusal> {
    let mut parameters = Parameters::default();
    let mut seen: Vec<&str> = Vec::new();
    let mut flux = None;
    for (name, value) in written.iter().chain(point) {
        let field = format!("parameters.{name}");
        if seen.contains(&name.as_str()) {
            return Err(Refusal::number(field, *value, "this parameter is given more than once"));
        }
        seen.push(name);
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
    let Some(flux) = flux else { return Ok(parameters) };
    if let Some(name) = VELOCITIES.iter().find(|name| seen.contains(name)) {
        return Err(Refusal::number(
            format!("parameters.{FLUX}"),
            flux,
            format!("not together with {name}: the flux sets both velocities"),
        ));
    }
    let speed = flux / parameters.terminus_thickness_m;
    for name in VELOCITIES {
        let info = params::info(name).expect("velocities are in the table");
        if info.check(speed).is_err() {
            return Err(Refusal::number(
                format!("parameters.{FLUX}"),
                flux,
                format!(
                    "a finite number whose quotient by terminus_thickness_m = {} is {}",
                    parameters.terminus_thickness_m,
                    params::permitted(name)
                ),
            ));
        }
        parameters.set(name, speed).map_err(|e| Refusal::parameter("parameters", &e))?;
    }
    Ok(parameters)
}
