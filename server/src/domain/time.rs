//! Steps and outputs of a transient run: as they are written, and what they come to.

use super::refusal::Refusal;
use melange_solver::transient::Stepping;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Steps and outputs of a transient run, as they are written.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Time {
    /// Duration, a.
    pub duration_a: f64,
    /// Fixed time step Δt, a.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fixed_dt_a: Option<f64>,
    /// Error of L and H₀, relative, that controlled steps may make in each 0.2 a; 1e-4 if no fixed step is
    /// given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tolerance: Option<f64>,
    /// Interval between rows of the series, a; every step if not given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub output_every_a: Option<f64>,
    /// Times at which profiles are stored, a.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub profiles_at_a: Vec<f64>,
}

/// How a transient steps, and what is kept of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Steps {
    /// How time is divided, and which times are landed on.
    pub stepping: Stepping,
    /// The end, a.
    pub duration_a: f64,
    /// Landings with a row of the series.
    pub series_at: SeriesAt,
    /// Landings whose profile is kept, ascending.
    pub profiles_at: Vec<usize>,
}

/// Landings with a row of the series; the last moment has one in any case.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum SeriesAt {
    /// All accepted steps.
    EveryStep,
    /// Every so many landings.
    Every(usize),
    /// These, ascending.
    These(Vec<usize>),
}

/// Most fixed steps of a run, and most times it lands on.
const MAX_STEPS: f64 = 1e7;
/// Tolerance where none is given.
const DEFAULT_TOLERANCE: f64 = 1e-4;
/// Permitted tolerances; below, rounding is in the way.
const TOLERANCES: (f64, f64) = (1e-7, 0.1);
/// Longest duration, a.
const MAX_DURATION_A: f64 = 1e5;
/// Requested times closer than this, relative to the duration, are one.
const SAME: f64 = 1e-12;

impl Time {
    /// The steps, checked.
    pub fn steps(&self) -> Result<Steps, Refusal> {
        match (self.fixed_dt_a, self.tolerance) {
            (Some(_), Some(tolerance)) => Err(Refusal::number(
                "time.tolerance",
                tolerance,
                "not together with fixed_dt_a: fixed steps control no error",
            )),
            (Some(dt_a), None) => self.fixed(dt_a),
            (None, tolerance) => self.controlled(tolerance.unwrap_or(DEFAULT_TOLERANCE)),
        }
    }

    fn fixed(&self, dt_a: f64) -> Result<Steps, Refusal> {
        if !(1e-6..=10.0).contains(&dt_a) {
            let permitted = "a finite number from 1e-6 to 10 a";
            return Err(Refusal::number("time.fixed_dt_a", dt_a, permitted));
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
        let every =
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
        Ok(Steps {
            stepping: Stepping::Fixed { dt_a, count },
            duration_a: self.duration_a,
            series_at: SeriesAt::Every(every),
            profiles_at,
        })
    }

    fn controlled(&self, tolerance: f64) -> Result<Steps, Refusal> {
        let between = |field: &str, value: f64, min: f64, max: f64, unit: &str| {
            if (min..=max).contains(&value) {
                return Ok(());
            }
            let permitted = format!("a finite number from {min:e} to {max:e}{unit}");
            Err(Refusal::number(field, value, permitted))
        };
        between("time.tolerance", tolerance, TOLERANCES.0, TOLERANCES.1, "")?;
        let end_a = self.duration_a;
        between("time.duration_a", end_a, 1e-6, MAX_DURATION_A, " a")?;
        let mut rows_a = Vec::new();
        if let Some(every_a) = self.output_every_a {
            between("time.output_every_a", every_a, end_a / MAX_STEPS, MAX_DURATION_A, " a")?;
            let count = (end_a / every_a * (1.0 + SAME)).floor() as usize;
            rows_a.extend((0..=count).map(|k| k as f64 * every_a));
        }
        for (i, time_a) in self.profiles_at_a.iter().enumerate() {
            between(&format!("time.profiles_at_a[{i}]"), *time_a, 0.0, end_a, " a")?;
        }
        let mut land_on_a = [&rows_a[..], &self.profiles_at_a, &[0.0, end_a]].concat();
        land_on_a.sort_unstable_by(f64::total_cmp);
        // What is all but the end is the end.
        land_on_a.retain(|t| (end_a - t) > SAME * end_a);
        land_on_a.push(end_a);
        land_on_a.dedup_by(|later, earlier| *later - *earlier <= SAME * end_a);
        let landing_of = |time_a: &f64| {
            let at = land_on_a.partition_point(|t| *t < time_a - SAME * end_a);
            at.min(land_on_a.len() - 1)
        };
        let mut profiles_at: Vec<usize> = self.profiles_at_a.iter().map(landing_of).collect();
        profiles_at.sort_unstable();
        profiles_at.dedup();
        let series_at = match self.output_every_a {
            None => SeriesAt::EveryStep,
            Some(_) => SeriesAt::These(rows_a.iter().map(landing_of).collect()),
        };
        Ok(Steps {
            duration_a: end_a,
            stepping: Stepping::Controlled { tolerance, land_on_a },
            series_at,
            profiles_at,
        })
    }
}

impl Steps {
    /// Steps that controlled ones may be expected to take, per year, at a tolerance of 1e-4.
    const PER_YEAR: f64 = 120.0;

    /// Number of steps; an estimate where they are controlled.
    pub fn count(&self) -> usize {
        match &self.stepping {
            Stepping::Fixed { count, .. } => *count,
            Stepping::Controlled { tolerance, land_on_a } => {
                let by_error = Self::PER_YEAR * (DEFAULT_TOLERANCE / tolerance).sqrt();
                ((self.duration_a * by_error) as usize).max(land_on_a.len())
            }
        }
    }

    /// The time whose forcing is in force in the state of a time. A step that was divided, having no solution as a
    /// whole, and is lagged is taken as a whole one.
    pub fn forced_at_a(&self, time_a: f64, is_lagged: bool) -> f64 {
        let Stepping::Fixed { dt_a, .. } = self.stepping else { return time_a };
        let step = (time_a / dt_a).round();
        if step * dt_a != time_a {
            // It ended within a step.
            return if is_lagged { (time_a / dt_a).floor() * dt_a } else { time_a };
        }
        // As the solver adds them up.
        let from_a = (step - 1.0).max(0.0) * dt_a;
        if is_lagged || step == 0.0 { from_a } else { from_a + dt_a }
    }

    /// Rows of the series; an estimate where every controlled step has one.
    pub fn rows(&self) -> usize {
        match &self.series_at {
            SeriesAt::EveryStep => self.count() + 1,
            SeriesAt::Every(every) => self.count() / every + 1,
            SeriesAt::These(landings) => landings.len() + 1,
        }
    }
}
