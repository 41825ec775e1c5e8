//! What the observations say about the parameters without taking the model for linear: samples of the
//! posterior density, uniform in ln p between the bounds before the observations. Knows the sampler by
//! its name only.

use super::chain::Chain;
use super::fit::Fit;
use super::forward::Forward;
use super::random::{Purpose, Random};
use super::sampler::{self, Plan, Progress, Proposal, SamplerError};
use super::uncertainty::Uncertainty;
use super::{Calibration, CalibrationError};
use crate::control::Control;
use faer::Mat;
use std::ops::ControlFlow;

/// Why there are no samples.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PosteriorError {
    /// The plan, or a start, makes no sense.
    #[error(transparent)]
    Sampler(#[from] SamplerError),
    /// The caller asked to stop before there were two samples of each walker to tell anything from.
    #[error(transparent)]
    Calibration(#[from] CalibrationError),
}

/// What was sampled.
#[derive(Debug, Clone, PartialEq)]
pub struct Posterior {
    /// Of each parameter, in the order asked for.
    pub marginals: Vec<Marginal>,
    /// Correlation of ln p.
    pub correlation: Vec<Vec<f64>>,
    /// The samples, of ln p, with −χ²/2 as the logarithm of the density.
    pub chain: Chain,
    /// Steady solves.
    pub solves: usize,
    /// Those that found no steady state, which count as impossible.
    pub without_state: usize,
}

/// A parameter's distribution.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Marginal {
    /// Which one.
    pub control: Control,
    /// Mean of ln p.
    pub mean_ln: f64,
    /// Standard deviation of ln p.
    pub standard_deviation_ln: f64,
    /// Quantiles at 2.5, 50 and 97.5 %, in the control's unit.
    pub quantiles: [f64; 3],
    /// Steps after which a walker has forgotten where it was.
    pub autocorrelation_steps: f64,
    /// Number of independent samples that say as much.
    pub effective_samples: f64,
}

/// Shares at which quantiles are reported.
const SHARES: [f64; 3] = [0.025, 0.5, 0.975];
/// A start without a steady state is drawn again so often, each time nearer to the estimates.
const DRAWS: usize = 40;
/// By this factor.
const NEARER: f64 = 0.8;
/// No walker starts further from the estimates than so many times the range between the bounds, in
/// standard deviations; and none in a direction that is known better than 1e-6.
const WIDEST: f64 = 0.1;
const NARROWEST_LN: f64 = 1e-6;

/// Samples the posterior, the walkers starting about a fit. Each has its own [`Forward`], so who evaluates
/// the proposals in parallel, by way of [`ensemble`] and [`sampler::sample`], gets the same answer.
pub fn sample(
    calibration: &Calibration,
    fit: &Fit,
    plan: &Plan,
    observe: &mut dyn FnMut(Progress<'_>) -> ControlFlow<()>,
) -> Result<Posterior, PosteriorError> {
    plan.check(calibration.unknowns().len())?;
    let (start, mut walkers) = ensemble(calibration, fit, plan);
    let mut evaluate = |proposals: &[Proposal]| {
        let found = proposals.iter().map(|p| walkers[p.walker].log_likelihood(&p.place));
        found.collect()
    };
    let chain = sampler::sample(plan, start, &mut evaluate, observe)?;
    Posterior::new(calibration, chain, &walkers)
}

/// A start about a fit for each walker, and what evaluates it: drawn from the fit's linear estimate, folded
/// back between the bounds, and with a steady state wherever one was found in a few draws.
pub fn ensemble<'a>(
    calibration: &'a Calibration,
    fit: &Fit,
    plan: &Plan,
) -> (Vec<Vec<f64>>, Vec<Forward<'a>>) {
    let bounds = calibration.bounds_ln();
    let n = bounds.smallest.len();
    let range = |k: usize| bounds.largest[k] - bounds.smallest[k];
    let widest = WIDEST * (0..n).map(range).fold(f64::INFINITY, f64::min);
    let information = Mat::from_fn(n, n, |i, j| fit.information[i][j]);
    let controls = calibration.unknowns().iter().map(|unknown| unknown.control).collect();
    let directions = Uncertainty::new(&information, controls).directions;
    let mut random = Random::new(plan.seed, Purpose::Ensemble);
    let mut last = Forward::new(calibration);
    let mut draw = |share: f64| -> Vec<f64> {
        let mut ln_p: Vec<f64> = fit.estimates.iter().map(|e| e.value.ln()).collect();
        for direction in &directions {
            let widest = widest.max(NARROWEST_LN);
            let error = direction.standard_error_ln.clamp(NARROWEST_LN, widest);
            let length = share * error * random.normal();
            ln_p.iter_mut().zip(&direction.exponents).for_each(|(x, v)| *x += length * v);
        }
        let ends = bounds.smallest.iter().zip(&bounds.largest);
        ln_p.iter().zip(ends).map(|(x, (from, to))| folded(*x, *from, *to)).collect()
    };
    let mut walker = || {
        let shares = (0..DRAWS).map(|i| NEARER.powi(i as i32));
        let mut forward = last.uncounted();
        let mut ln_p = Vec::new();
        for share in shares {
            ln_p = draw(share);
            if forward.log_likelihood(&ln_p).is_finite() {
                break;
            }
        }
        last = forward.clone();
        (ln_p, forward)
    };
    (0..plan.walkers).map(|_| walker()).unzip()
}

/// The place within an interval that a line folded at its ends leads to.
fn folded(x: f64, from: f64, to: f64) -> f64 {
    let place = (x - from).rem_euclid(2.0 * (to - from));
    (from + place.min(2.0 * (to - from) - place)).clamp(from, to)
}

impl Posterior {
    /// What a chain of ln p says, and what its walkers spent.
    pub fn new(
        calibration: &Calibration,
        chain: Chain,
        walkers: &[Forward<'_>],
    ) -> Result<Self, PosteriorError> {
        let solves = walkers.iter().map(|w| w.solves).sum();
        if chain.kept() < 2 {
            return Err(CalibrationError::Stopped { solves }.into());
        }
        let marginal = |(k, unknown): (usize, &super::Unknown)| Marginal {
            control: unknown.control,
            mean_ln: chain.mean(k),
            standard_deviation_ln: chain.standard_deviation(k),
            quantiles: chain.quantiles(k, SHARES).map(|ln| unknown.value(ln)),
            autocorrelation_steps: chain.autocorrelation_steps(k),
            effective_samples: chain.effective_samples(k),
        };
        Ok(Self {
            marginals: calibration.unknowns().iter().enumerate().map(marginal).collect(),
            correlation: chain.correlation(),
            solves,
            without_state: walkers.iter().map(|w| w.without_state).sum(),
            chain,
        })
    }
}
