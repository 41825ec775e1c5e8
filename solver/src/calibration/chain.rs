//! An ensemble's samples and what they say: means, quantiles, correlations, and how much they are worth.
//! Knows not what was sampled nor how.

use super::sampler::Plan;

/// The samples that were kept.
#[derive(Debug, Clone, PartialEq)]
pub struct Chain {
    dimensions: usize,
    walkers: usize,
    thinning: usize,
    steps: usize,
    taken: usize,
    offered: usize,
    is_complete: bool,
    places: Vec<f64>,
    log_densities: Vec<f64>,
}

/// A chain this many autocorrelation times long is long enough to be believed, and so is the time itself
/// (Foreman-Mackey et al. 2013, Publ. Astron. Soc. Pac. 125, 306–312).
pub const LONG_ENOUGH: f64 = 50.0;
/// Autocorrelations are summed up to this many times their sum (Sokal 1997).
const WINDOW: f64 = 5.0;

impl Chain {
    pub(crate) fn new(dimensions: usize, plan: &Plan) -> Self {
        let kept = plan.walkers * ((plan.steps - plan.burn_in) / plan.thinning);
        Self {
            dimensions,
            walkers: plan.walkers,
            thinning: plan.thinning,
            steps: 0,
            taken: 0,
            offered: 0,
            is_complete: false,
            places: Vec::with_capacity(kept * dimensions),
            log_densities: Vec::with_capacity(kept),
        }
    }

    pub(crate) fn count(&mut self, is_taken: bool) {
        self.offered += 1;
        self.taken += usize::from(is_taken);
    }

    pub(crate) fn step(
        &mut self,
        step: usize,
        plan: &Plan,
        places: &[Vec<f64>],
        log_densities: &[f64],
    ) {
        self.steps = step;
        self.is_complete = step == plan.steps;
        let beyond = step.saturating_sub(plan.burn_in);
        if beyond > 0 && beyond.is_multiple_of(plan.thinning) {
            places.iter().for_each(|place| self.places.extend(place));
            self.log_densities.extend(log_densities);
        }
    }

    /// Number of dimensions.
    pub fn dimensions(&self) -> usize {
        self.dimensions
    }

    /// Number of walkers.
    pub fn walkers(&self) -> usize {
        self.walkers
    }

    /// Steps done, the discarded ones included.
    pub fn steps(&self) -> usize {
        self.steps
    }

    /// Whether all steps of the plan were done.
    pub fn is_complete(&self) -> bool {
        self.is_complete
    }

    /// Number of steps that were kept.
    pub fn kept(&self) -> usize {
        self.log_densities.len() / self.walkers
    }

    /// All samples, those of a step together, in the order of the walkers.
    pub fn samples(&self) -> impl ExactSizeIterator<Item = &[f64]> {
        self.places.chunks_exact(self.dimensions)
    }

    /// Logarithm of the density at each sample.
    pub fn log_densities(&self) -> &[f64] {
        &self.log_densities
    }

    /// Share of the proposals that were taken.
    pub fn acceptance(&self) -> f64 {
        self.taken as f64 / self.offered as f64
    }

    /// A dimension's samples, in the order of [`Chain::samples`].
    pub fn column(&self, dimension: usize) -> Vec<f64> {
        self.samples().map(|sample| sample[dimension]).collect()
    }

    /// Mean of a dimension.
    pub fn mean(&self, dimension: usize) -> f64 {
        mean(&self.column(dimension))
    }

    /// Standard deviation of a dimension.
    pub fn standard_deviation(&self, dimension: usize) -> f64 {
        covariance(&self.column(dimension), &self.column(dimension)).sqrt()
    }

    /// Correlation of every pair of dimensions.
    pub fn correlation(&self) -> Vec<Vec<f64>> {
        let columns: Vec<Vec<f64>> = (0..self.dimensions).map(|k| self.column(k)).collect();
        let deviations: Vec<f64> = columns.iter().map(|c| covariance(c, c).sqrt()).collect();
        let of = |i: usize, j: usize| {
            covariance(&columns[i], &columns[j]) / (deviations[i] * deviations[j])
        };
        (0..self.dimensions).map(|i| (0..self.dimensions).map(|j| of(i, j)).collect()).collect()
    }

    /// Quantiles of a dimension at shares from 0 to 1, straight between samples; NaN where nothing is kept.
    pub fn quantiles<const Q: usize>(&self, dimension: usize, shares: [f64; Q]) -> [f64; Q] {
        let mut sorted = self.column(dimension);
        sorted.sort_by(f64::total_cmp);
        if sorted.is_empty() {
            return [f64::NAN; Q];
        }
        shares.map(|share| {
            let place = share * (sorted.len() - 1) as f64;
            let (below, above) = (sorted[place.floor() as usize], sorted[place.ceil() as usize]);
            below + place.fract() * (above - below)
        })
    }

    /// Integrated autocorrelation time of a dimension in steps, from the ensemble's mean autocovariance
    /// about the mean of all samples, so that walkers that stay apart count as correlated:
    /// τ = 1 + 2 Σ ρ(t), summed to the first t ≥ 5τ, and never below the thinning, in which it is counted.
    pub fn autocorrelation_steps(&self, dimension: usize) -> f64 {
        let column = self.column(dimension);
        let mean = mean(&column);
        let deviations: Vec<f64> = column.iter().map(|x| x - mean).collect();
        let autocovariance = |lag: usize| {
            let later = &deviations[lag * self.walkers..];
            later.iter().zip(&deviations).map(|(a, b)| a * b).sum::<f64>() / later.len() as f64
        };
        let variance = autocovariance(0);
        if variance.is_nan() || variance <= 0.0 {
            return f64::INFINITY;
        }
        let mut time = 1.0;
        for lag in 1..self.kept() {
            time += 2.0 * autocovariance(lag) / variance;
            if lag as f64 >= WINDOW * time {
                break;
            }
        }
        time.max(1.0) * self.thinning as f64
    }

    /// Number of independent samples that say as much about a dimension's mean.
    pub fn effective_samples(&self, dimension: usize) -> f64 {
        let samples = self.log_densities.len() as f64;
        samples * self.thinning as f64 / self.autocorrelation_steps(dimension)
    }

    /// Whether what was kept is [`LONG_ENOUGH`] autocorrelation times long, in every dimension.
    pub fn is_long_enough(&self) -> bool {
        let length = (self.kept() * self.thinning) as f64;
        (0..self.dimensions).all(|k| length >= LONG_ENOUGH * self.autocorrelation_steps(k))
    }
}

fn mean(x: &[f64]) -> f64 {
    x.iter().sum::<f64>() / x.len() as f64
}

fn covariance(x: &[f64], y: &[f64]) -> f64 {
    let (mean_x, mean_y) = (mean(x), mean(y));
    let products = x.iter().zip(y).map(|(x, y)| (x - mean_x) * (y - mean_y));
    products.sum::<f64>() / (x.len() - 1) as f64
}
