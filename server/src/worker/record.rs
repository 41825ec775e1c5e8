//! What is kept of a transient while it runs: rows of the series, stored states, extremes of all steps.

use crate::domain::outcome::{Profile, Series, StoredState};
use crate::domain::time::{SeriesAt, Steps};
use melange_solver::Model;
use melange_solver::diagnose::{cfl_time_step_a, strain_rates_per_a};
use melange_solver::force;
use melange_solver::observe::{Moment, Observer};
use melange_solver::state::State;
use std::ops::ControlFlow;

/// What a transient leaves behind.
#[derive(Debug, Default)]
pub struct Record {
    /// Rows at the landings asked for, and at the end.
    pub series: Series,
    /// States at the landings asked for.
    pub states: Vec<StoredState>,
    /// Largest Courant number of a step.
    pub cfl_number: f64,
    /// Smallest strain rate of any cell at any step, a⁻¹.
    pub strain_rate_min_per_a: f64,
}

/// Records a transient of a model.
pub struct Recorder<'a> {
    steps: &'a Steps,
    model: &'a Model,
    stop: &'a dyn Fn() -> bool,
    /// What has been recorded.
    pub record: Record,
}

impl<'a> Recorder<'a> {
    /// With nothing recorded yet; `stop` is asked after every step.
    pub fn new(steps: &'a Steps, model: &'a Model, stop: &'a dyn Fn() -> bool) -> Self {
        let record = Record { strain_rate_min_per_a: f64::INFINITY, ..Record::default() };
        Self { steps, model, stop, record }
    }

    /// Between the rows asked for lies nothing; the moment of a verdict and the end are always kept.
    fn has_row(&self, m: &Moment<'_>) -> bool {
        let Some(landing) = m.landing else {
            return self.steps.series_at == SeriesAt::EveryStep;
        };
        match &self.steps.series_at {
            SeriesAt::EveryStep => true,
            SeriesAt::Every(every) => landing.is_multiple_of(*every) || m.time_a >= self.end_a(),
            SeriesAt::These(landings) => {
                landings.binary_search(&landing).is_ok() || m.time_a >= self.end_a()
            }
        }
    }

    /// The end, but for the rounding of step · Δt.
    fn end_a(&self) -> f64 {
        self.steps.duration_a * (1.0 - 1e-9)
    }

    /// Adds a row for a moment.
    fn push(&mut self, m: &Moment<'_>) {
        let series = &mut self.record.series;
        let s = m.state;
        series.time_a.push(m.time_a);
        series.length_m.push(s.length_m);
        series.thickness_0_m.push(s.thickness_0_m());
        series.force_n_per_m.push(force::force_n_per_m(s));
        series.force_quasi_static_n_per_m.push(force::force_quasi_static_n_per_m(s));
        series.velocity_end_m_per_a.push(s.velocity_m_per_a[s.n_cells()]);
        series.volume_m3.push(force::volume_m3(self.model, s, m.terminus_x_m));
        series.melt_rate_m_per_day.push(m.parameters.melt_rate_m_per_day);
        series.calving_rate_m_per_a.push(m.parameters.calving_rate_m_per_a);
        series.terminus_x_m.push(m.terminus_x_m);
    }

    /// Adds a row for the last moment, if it has none.
    pub fn close(&mut self, m: &Moment<'_>) {
        if self.record.series.time_a.last() != Some(&m.time_a) {
            self.push(m);
        }
    }
}

impl Observer for Recorder<'_> {
    fn moment(&mut self, m: Moment<'_>) -> ControlFlow<()> {
        if self.has_row(&m) {
            self.push(&m);
        }
        if m.landing.is_some_and(|landing| self.steps.profiles_at.binary_search(&landing).is_ok()) {
            let profile = profile(m.state);
            self.record.states.push(StoredState { time_a: m.time_a, profile });
        }
        self.record.cfl_number = self.record.cfl_number.max(m.dt_a / cfl_time_step_a(m.state));
        let (smallest, _) = strain_rates_per_a(m.state);
        self.record.strain_rate_min_per_a = self.record.strain_rate_min_per_a.min(smallest);
        if (self.stop)() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

/// A state as it is stored; μ_w without its sign.
pub fn profile(s: &State) -> Profile {
    Profile {
        node_x_m: s.node_x_m(),
        velocity_m_per_a: s.velocity_m_per_a.clone(),
        mu_w: s.mu_w.iter().map(|mu| mu.abs()).collect(),
        cell_x_m: s.cell_x_m(),
        thickness_m: s.thickness_m.clone(),
        fluidity_per_a: s.fluidity_per_a.clone(),
    }
}
