//! The parameters whose steady state is nearest to the observations, sought from several starts, and what
//! is known of them. Knows no equation and no method but by its name.

use super::descent::{self, Bound, Descent, Ending, descend};
use super::forward::{Compared, Forward};
use super::random::quasi_random;
use super::uncertainty::Uncertainty;
use super::{Calibration, CalibrationError};
use crate::control::Control;
use crate::state::State;
use faer::Mat;
use std::ops::ControlFlow;

/// How a fit is done.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Plan {
    /// Number of starts: the parameters as given, and others spread evenly between the bounds of ln p.
    pub starts: usize,
    /// Most steps from a start.
    pub iterations: usize,
    /// Another seed gives other starts.
    pub seed: u64,
}

impl Default for Plan {
    fn default() -> Self {
        Self { starts: 6, iterations: 60, seed: 0 }
    }
}

/// A fit on its way.
#[derive(Debug, Clone, Copy)]
pub struct Progress<'a> {
    /// Number of the start; 0 is the parameters as given.
    pub start: usize,
    /// Steps tried from there.
    pub iteration: usize,
    /// χ² reached.
    pub chi2: f64,
    /// ln p reached.
    pub ln_p: &'a [f64],
    /// Steady solves so far, of all starts.
    pub solves: usize,
}

/// What was found.
#[derive(Debug, Clone, PartialEq)]
pub struct Fit {
    /// The parameters, in the order asked for.
    pub estimates: Vec<Estimate>,
    /// χ² there.
    pub chi2: f64,
    /// How the best descent ended.
    pub ending: Ending,
    /// Number of observations less that of parameters that lie at no bound. χ² over this is about 1 if the
    /// model and the standard errors are right; χ² itself is then distributed as χ² with so many degrees
    /// of freedom.
    pub degrees_of_freedom: usize,
    /// How well they are known.
    pub uncertainty: Uncertainty,
    /// The model beside each observation.
    pub predictions: Vec<Prediction>,
    /// Number of observations beyond the fitted mélange's end.
    pub beyond: usize,
    /// The fitted steady state.
    pub state: State,
    /// What became of each start.
    pub starts: Vec<Start>,
    /// The start that led to the estimates.
    pub best_start: usize,
    /// Number of distinct minima that the starts led to.
    pub minima: usize,
    /// Steady solves, of all starts.
    pub solves: usize,
    /// Those that found no steady state.
    pub without_state: usize,
    /// A = JᵀJ at the estimates, of all parameters, ln p.
    pub information: Vec<Vec<f64>>,
}

/// A parameter found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// Which one.
    pub control: Control,
    /// Its value, in the control's unit.
    pub value: f64,
    /// The bound it was stopped by; nothing is then said about its error.
    pub at_bound: Option<Bound>,
    /// Standard error of its logarithm; none at a bound, or where the data do not determine it.
    pub standard_error_ln: Option<f64>,
    /// Interval of 95 %, normal in ln p, as far as it lies within the bounds.
    pub interval_95: Option<[f64; 2]>,
}

/// The fitted model beside an observation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Prediction {
    /// In the observation's unit.
    pub value: f64,
    /// (prediction − observation)/standard error.
    pub residual: f64,
    /// Whether its place lies beyond the mélange's end.
    pub is_beyond: bool,
}

/// What became of a start.
#[derive(Debug, Clone, PartialEq)]
pub struct Start {
    /// The parameters it began with.
    pub from: Vec<f64>,
    /// Where it led.
    pub outcome: Outcome,
}

/// Where a start led.
#[derive(Debug, Clone, PartialEq)]
pub enum Outcome {
    /// To the end of a descent.
    Arrived {
        /// The parameters there.
        to: Vec<f64>,
        /// χ² there.
        chi2: f64,
        /// Steps tried.
        iterations: usize,
        /// How it ended.
        ending: Ending,
        /// Distance to the minimum that a linear model would have, in standard errors.
        distance: f64,
        /// Number of the minimum, from 0, the lowest, on; none where the limit of steps was reached.
        minimum: Option<usize>,
    },
    /// Nowhere, as there is no steady state, or none that can be differentiated.
    NoSteadyState {
        /// Evidence in one sentence.
        reason: String,
    },
}

/// Ends of descents within so many standard errors of one another are the same minimum (kinks may hold them
/// that far apart), …
const SAME_MINIMUM: f64 = 0.5;
/// … and so are those within this of one another in every ln p.
const SAME_PLACE_LN: f64 = 1e-3;
/// Half the width of the normal distribution's central 95 %, in standard deviations.
const NORMAL_95: f64 = 1.959_963_984_540_054;

/// Fits a calibration; `observe` is told of each step and ends the fit by `Break`.
pub fn fit(
    calibration: &Calibration,
    plan: &Plan,
    observe: &mut dyn FnMut(Progress<'_>) -> ControlFlow<()>,
) -> Result<Fit, CalibrationError> {
    let bounds = calibration.bounds_ln();
    let mut forward = Forward::new(calibration);
    let mut descents: Vec<Option<Descent<Compared>>> = Vec::new();
    let (mut starts, mut reasons) = (starts(calibration, plan), Vec::new());
    for (start, from) in starts.iter().enumerate() {
        let mut is_stopped = false;
        let mut go_on = |forward: &Forward<'_>, at: descent::Progress<'_>| {
            let progress = Progress {
                start,
                iteration: at.iteration,
                chi2: at.sum_of_squares,
                ln_p: at.theta,
                solves: forward.solves,
            };
            is_stopped = observe(progress).is_break();
            !is_stopped
        };
        let descent = descend(&mut forward, &bounds, from, plan.iterations, &mut go_on);
        if is_stopped {
            return Err(CalibrationError::Stopped { solves: forward.solves });
        }
        descents.push(descent);
        reasons.push(forward.reason.clone());
    }
    let minima = minima(&descents);
    let chi2 =
        |d: &Option<Descent<Compared>>| d.as_ref().map_or(f64::INFINITY, |d| d.sum_of_squares);
    let best_start = (0..descents.len())
        .min_by(|a, b| chi2(&descents[*a]).total_cmp(&chi2(&descents[*b])))
        .expect("there is a start");
    let outcomes = descents.iter().zip(&minima).zip(reasons).map(|((descent, minimum), reason)| {
        let Some(d) = descent else { return Outcome::NoSteadyState { reason } };
        Outcome::Arrived {
            to: values(calibration, &d.theta),
            chi2: d.sum_of_squares,
            iterations: d.iterations,
            ending: d.ending,
            distance: d.decrement.max(0.0).sqrt(),
            minimum: *minimum,
        }
    });
    let starts: Vec<Start> = starts
        .drain(..)
        .zip(outcomes)
        .map(|(from, outcome)| Start { from: values(calibration, &from), outcome })
        .collect();
    let Some(best) = descents.swap_remove(best_start) else {
        return Err(CalibrationError::NoSteadyState {
            starts: starts.len(),
            reason: forward.reason,
        });
    };
    let n = bounds.smallest.len();
    let free: Vec<usize> = (0..n).filter(|k| best.at_bound[*k].is_none()).collect();
    let information =
        Mat::from_fn(free.len(), free.len(), |i, j| best.information[(free[i], free[j])]);
    let controls = free.iter().map(|k| calibration.unknowns()[*k].control).collect();
    let uncertainty = Uncertainty::new(&information, controls);
    let predictions = predictions(calibration, &best.point);
    Ok(Fit {
        estimates: estimates(calibration, &best, &uncertainty),
        chi2: best.sum_of_squares,
        ending: best.ending,
        degrees_of_freedom: predictions.len() - free.len(),
        uncertainty,
        beyond: predictions.iter().filter(|p| p.is_beyond).count(),
        predictions,
        state: best.point.state,
        starts,
        best_start,
        minima: minima.iter().flatten().max().map_or(0, |last| last + 1),
        solves: forward.solves,
        without_state: forward.without_state,
        information: (0..n).map(|i| (0..n).map(|j| best.information[(i, j)]).collect()).collect(),
    })
}

/// ln p of every start.
fn starts(calibration: &Calibration, plan: &Plan) -> Vec<Vec<f64>> {
    let (given, bounds) = (calibration.given_ln(), calibration.bounds_ln());
    let others = plan.starts.saturating_sub(1);
    let mut starts = quasi_random(others, given.len(), plan.seed);
    for (k, (smallest, largest)) in bounds.smallest.iter().zip(&bounds.largest).enumerate() {
        starts.iter_mut().for_each(|at| at[k] = smallest + at[k] * (largest - smallest));
    }
    starts.insert(0, given);
    starts
}

fn values(calibration: &Calibration, ln_p: &[f64]) -> Vec<f64> {
    calibration.unknowns().iter().zip(ln_p).map(|(unknown, ln)| unknown.value(*ln)).collect()
}

fn estimates(
    calibration: &Calibration,
    best: &Descent<Compared>,
    uncertainty: &Uncertainty,
) -> Vec<Estimate> {
    let unknowns = calibration.unknowns().iter().enumerate();
    unknowns
        .map(|(k, unknown)| {
            let value = unknown.value(best.theta[k]);
            let standard_error_ln = uncertainty.standard_error_ln(unknown.control);
            let end =
                |error: f64, sign: f64| unknown.value(best.theta[k] + sign * NORMAL_95 * error);
            Estimate {
                control: unknown.control,
                value,
                at_bound: best.at_bound[k],
                standard_error_ln,
                interval_95: standard_error_ln.map(|error| [end(error, -1.0), end(error, 1.0)]),
            }
        })
        .collect()
}

fn predictions(calibration: &Calibration, at: &Compared) -> Vec<Prediction> {
    let beside = at.predictions.iter().zip(&at.residuals);
    let observations = calibration.observations().iter();
    observations
        .zip(beside)
        .map(|(o, (value, residual))| Prediction {
            value: *value,
            residual: *residual,
            is_beyond: o.observed.is_beyond(&at.state),
        })
        .collect()
}

/// The number of the minimum that each descent led to, the lowest first.
fn minima(descents: &[Option<Descent<Compared>>]) -> Vec<Option<usize>> {
    let settled = |d: &&Descent<Compared>| d.ending != Ending::TooManyIterations;
    let mut order: Vec<usize> =
        (0..descents.len()).filter(|i| descents[*i].as_ref().filter(settled).is_some()).collect();
    let at = |i: usize| descents[i].as_ref().expect("it has settled");
    order.sort_by(|a, b| at(*a).sum_of_squares.total_cmp(&at(*b).sum_of_squares));
    let mut numbers = vec![None; descents.len()];
    let mut lowest: Vec<usize> = Vec::new();
    for i in order {
        let number = lowest.iter().position(|known| is_same(at(*known), at(i)));
        numbers[i] = Some(number.unwrap_or(lowest.len()));
        if number.is_none() {
            lowest.push(i);
        }
    }
    numbers
}

/// Whether two descents ended in the same place, in standard errors or outright.
fn is_same(a: &Descent<Compared>, b: &Descent<Compared>) -> bool {
    let apart: Vec<f64> = a.theta.iter().zip(&b.theta).map(|(a, b)| a - b).collect();
    let n = apart.len();
    let squared: f64 = (0..n)
        .flat_map(|i| (0..n).map(move |j| (i, j)))
        .map(|(i, j)| apart[i] * a.information[(i, j)] * apart[j])
        .sum();
    squared < SAME_MINIMUM.powi(2) || apart.iter().all(|d| d.abs() < SAME_PLACE_LN)
}
