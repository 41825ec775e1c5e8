//! One run of Fig. 7: melt or calving swings through the year from a steady state, and the force follows.

use super::Broken;
use super::case::{self, Case, failed, largest, least};
use crate::analysis::season::{Sense, Track, correlation};
use melange_solver::forcing::{Course, Forcing};
use melange_solver::observe::Moment;
use melange_solver::params::Parameters;
use melange_solver::physics::terminus::CalvingLaw;
use melange_solver::state::State;
use melange_solver::transient::{Ending, Plan, Stepping};
use melange_solver::{Solver, force};
use std::f64::consts::TAU;
use std::ops::ControlFlow;

/// Swing of the melt rate, m d⁻¹.
const MELT_SWING_M_PER_DAY: f64 = 0.2;
/// Swing of the calving rate, as a share of it.
const CALVING_SWING: f64 = 0.1;
/// Duration, a.
pub const DURATION_A: f64 = 3.0;
/// Period, a.
pub const PERIOD_A: f64 = 1.0;
/// The scripts' step, a.
pub const STEP_A: f64 = 0.01;
/// Tolerance of the controlled steps.
const TOLERANCE: f64 = 1e-4;
/// Times at which controlled runs are kept, by the year.
const KEPT_PER_A: usize = 50;
/// The last swing upward peaks at this time, a; the swing downward before it half a year earlier.
const HIGH_A: f64 = 2.25;
/// See [`HIGH_A`].
const LOW_A: f64 = 1.75;

/// What swings.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Swing {
    /// Melt.
    Melt,
    /// Calving.
    Calving,
    /// Melt swings, and calving follows the force by Eq. 31.
    Coupled,
}

/// How time is stepped.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Steps {
    /// Δt = 0.01 a, forcing and law at the start of each step.
    Published,
    /// Controlled error, forcing and law at the end of each step, solved for with it.
    Controlled,
}

/// What is kept of a moment.
#[derive(Debug, Clone, Copy)]
pub struct Sample {
    /// t, a.
    pub time_a: f64,
    /// Melt rate in force.
    pub melt_m_per_day: f64,
    /// Calving rate in force.
    pub calving_m_per_a: f64,
    /// L.
    pub length_m: f64,
    /// H₀.
    pub thickness_0_m: f64,
    /// F/W.
    pub force_n_per_m: f64,
    /// F/W without the stretching.
    pub force_quasi_static_n_per_m: f64,
    /// Strain rate of the first cell.
    pub strain_rate_0_per_a: f64,
    /// The least of all cells.
    pub strain_rate_least_per_a: f64,
}

/// A run of Fig. 7.
#[derive(Debug, Clone)]
pub struct Season {
    /// Its name.
    pub name: String,
    /// What swings.
    pub swing: Swing,
    /// How time is stepped.
    pub steps: Steps,
    /// The steady state it starts from.
    pub start: Sample,
    /// What was kept, in order.
    pub samples: Vec<Sample>,
}

/// Runs from a steady state.
pub fn run(start: &Case, swing: Swing, steps: Steps) -> Result<Season, Broken> {
    let p = *start.model.parameters();
    let what = match swing {
        Swing::Melt => "melt",
        Swing::Calving => "calving",
        Swing::Coupled => "melt, calving coupled",
    };
    let how = match steps {
        Steps::Published => "as published",
        Steps::Controlled => "controlled",
    };
    let name = format!("{what}, {} m/d, {how}", p.melt_rate_m_per_day);
    let (parameter, mean, amplitude) = swung(swing, p.melt_rate_m_per_day, p.calving_rate_m_per_a);
    let course = Course::Sinusoid { mean, amplitude, period_a: PERIOD_A, phase_a: 0.0 };
    let forcing = Forcing::new(vec![(parameter.to_owned(), course)]).expect("a course in range");
    let law = CalvingLaw::steady_feedback(p.calving_rate_m_per_a, start.force_n_per_m());
    let kept = (0..=(DURATION_A as usize * KEPT_PER_A)).map(|k| k as f64 / KEPT_PER_A as f64);
    let stepping = match steps {
        Steps::Published => {
            Stepping::Fixed { dt_a: STEP_A, count: (DURATION_A / STEP_A).round() as usize }
        }
        Steps::Controlled => {
            Stepping::Controlled { tolerance: TOLERANCE, land_on_a: kept.collect() }
        }
    };
    let plan = Plan {
        stepping,
        forcing,
        calving_law: (swing == Swing::Coupled).then_some(law),
        is_lagged: steps == Steps::Published,
        terminus_x_m: 0.0,
    };
    let mut samples = Vec::new();
    let mut keep = |m: Moment<'_>| {
        if m.landing.is_some() {
            samples.push(Sample::new(m.time_a, m.parameters, m.state));
        }
        ControlFlow::Continue(())
    };
    let end = Solver::new(start.model.clone())
        .transient(start.state.clone(), &plan, &mut keep)
        .map_err(failed(&name))?;
    if end.ending != Ending::Completed {
        return Err(Broken::Ended { case: name, ending: format!("{:?}", end.ending) });
    }
    let start = Sample::new(0.0, &p, &start.state);
    Ok(Season { name, swing, steps, start, samples })
}

/// The parameter that swings, its mean and its amplitude.
pub fn swung(swing: Swing, melt_m_per_day: f64, calving_m_per_a: f64) -> (&'static str, f64, f64) {
    match swing {
        Swing::Calving => {
            ("calving_rate_m_per_a", calving_m_per_a, CALVING_SWING * calving_m_per_a)
        }
        _ => ("melt_rate_m_per_day", melt_m_per_day, MELT_SWING_M_PER_DAY),
    }
}

impl Sample {
    fn new(time_a: f64, p: &Parameters, s: &State) -> Self {
        Self {
            time_a,
            melt_m_per_day: p.melt_rate_m_per_day,
            calving_m_per_a: p.calving_rate_m_per_a,
            length_m: s.length_m,
            thickness_0_m: s.thickness_0_m(),
            force_n_per_m: force::force_n_per_m(s),
            force_quasi_static_n_per_m: force::force_quasi_static_n_per_m(s),
            strain_rate_0_per_a: s.strain_rate_per_a(0),
            strain_rate_least_per_a: least(case::strain_rates_per_a(s)),
        }
    }
}

impl Season {
    /// Samples of the last year.
    pub fn last_year(&self) -> impl Iterator<Item = &Sample> + Clone {
        self.samples.iter().filter(|s| s.time_a >= DURATION_A - 1.0 - 1e-9)
    }

    /// Lags of the force behind the swing upward and behind the swing downward, a. More melt makes the
    /// force less, more calving makes it more.
    pub fn lags_a(&self) -> [f64; 2] {
        let sense = if self.swing == Swing::Calving { Sense::With } else { Sense::Against };
        let force = Track {
            time: self.samples.iter().map(|s| s.time_a).collect(),
            value: self.samples.iter().map(|s| s.force_n_per_m).collect(),
        };
        let lag = |forced_a: f64, sign: f64| {
            let extreme_a = force.extreme(forced_a, PERIOD_A, sign);
            extreme_a.expect("a swing has its extremes") - forced_a
        };
        [lag(HIGH_A, sense.sign()), lag(LOW_A, -sense.sign())]
    }

    /// Their mean, a.
    pub fn lag_a(&self) -> f64 {
        case::mean(&self.lags_a())
    }

    /// Largest less smallest force of the last year, N m⁻¹.
    pub fn variation_n_per_m(&self) -> f64 {
        largest(self.last_year().map(|s| s.force_n_per_m))
            - least(self.last_year().map(|s| s.force_n_per_m))
    }

    /// The same by the force at the start.
    pub fn relative_variation(&self) -> f64 {
        self.variation_n_per_m() / self.start.force_n_per_m
    }

    /// Correlation of two numbers over the last year.
    pub fn correlation(&self, x: fn(&Sample) -> f64, y: fn(&Sample) -> f64) -> f64 {
        let (x, y): (Vec<f64>, Vec<f64>) = self.last_year().map(|s| (x(s), y(s))).unzip();
        // The samples are evenly spaced.
        correlation(&vec![1.0; x.len()], &x, &y).expect("both swing")
    }

    /// How often the force goes round its start in the plane of ln H₀ and ln F in the last year.
    pub fn turns(&self) -> f64 {
        let angle = |s: &Sample| {
            let x = (s.thickness_0_m / self.start.thickness_0_m).ln();
            // The loops are thin: seen along the steady states, on which F goes with H₀².
            let y = (s.force_n_per_m / self.start.force_n_per_m).ln() - 2.0 * x;
            y.atan2(x)
        };
        let angles: Vec<f64> = self.last_year().map(angle).collect();
        let turn = |pair: &[f64]| {
            let turn = pair[1] - pair[0];
            turn - TAU * (turn / TAU).round()
        };
        angles.windows(2).map(turn).sum::<f64>() / TAU
    }
}
