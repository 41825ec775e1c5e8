//! Samples of a probability density, by an ensemble of walkers: the stretch move of Goodman and Weare
//! (2010, Comm. Appl. Math. Comp. Sci. 5, 65–80), which does the same whatever the density's scales and
//! correlations. Knows nothing of ice, nor what the density is of.
//!
//! The walkers are two halves, moved in turn. A walker at X is offered a place on the line through it and a
//! walker X′ of the other half, drawn at random,
//!
//! ```text
//!   Y = X′ + z(X − X′),   density of z ∝ 1/√z on [1/a, a],
//! ```
//!
//! and goes there with probability min(1, zⁿ⁻¹ p(Y)/p(X)), n being the number of dimensions. All places
//! offered to one half are evaluated together, so that a caller may do that in parallel.

use super::chain::Chain;
use super::random::{Purpose, Random};
use std::ops::ControlFlow;

/// How a density is sampled.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Plan {
    /// Number of walkers: even, and at least four more than twice the number of dimensions.
    pub walkers: usize,
    /// Steps of each walker, the discarded ones included.
    pub steps: usize,
    /// Steps discarded at the beginning.
    pub burn_in: usize,
    /// Of the others every so many-th is kept.
    pub thinning: usize,
    /// Another seed gives other samples.
    pub seed: u64,
}

impl Default for Plan {
    fn default() -> Self {
        Self { walkers: 32, steps: 2000, burn_in: 500, thinning: 1, seed: 0 }
    }
}

/// A place to be evaluated.
#[derive(Debug, Clone, PartialEq)]
pub struct Proposal {
    /// For which walker.
    pub walker: usize,
    /// Where.
    pub place: Vec<f64>,
}

/// The ensemble after a step.
#[derive(Debug, Clone, Copy)]
pub struct Progress<'a> {
    /// Number of the step, from 1 on.
    pub step: usize,
    /// Share of the proposals that were taken so far.
    pub acceptance: f64,
    /// Logarithm of the density at each walker.
    pub log_densities: &'a [f64],
}

/// Why a density cannot be sampled so.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SamplerError {
    /// A number of the plan that makes no sense.
    #[error("`{field}` = {value} is out of range: {permitted}")]
    OutOfRange {
        /// The field.
        field: &'static str,
        /// Value given.
        value: usize,
        /// What is permitted.
        permitted: String,
    },
    /// A start of no probability.
    #[error(
        "walker {walker} starts where the density is {log_density:e} in logarithm: every walker must start where the density is finite and above 0"
    )]
    NoDensity {
        /// The walker.
        walker: usize,
        /// Logarithm of the density there.
        log_density: f64,
    },
}

/// Most that a move stretches by: a of Goodman and Weare.
const STRETCH: f64 = 2.0;
/// Fewest walkers beyond two for each dimension; with fewer the ensemble may stay in a plane.
const SPARE_WALKERS: usize = 4;

impl Plan {
    /// Refuses what makes no sense for a density of so many dimensions.
    pub fn check(&self, dimensions: usize) -> Result<(), SamplerError> {
        let ensure = |ok: bool, field: &'static str, value: usize, permitted: String| {
            if ok { Ok(()) } else { Err(SamplerError::OutOfRange { field, value, permitted }) }
        };
        let fewest = 2 * dimensions + SPARE_WALKERS;
        let is_fine = self.walkers.is_multiple_of(2) && self.walkers >= fewest;
        ensure(is_fine, "walkers", self.walkers, format!("an even number from {fewest} on"))?;
        ensure(self.thinning > 0, "thinning", self.thinning, "from 1 on".into())?;
        let fewest = self.burn_in.saturating_add(self.thinning.saturating_mul(2));
        let permitted = format!("from {fewest} on, so that two are kept of each walker");
        ensure(self.steps >= fewest, "steps", self.steps, permitted)
    }
}

/// Samples a density from a place for each walker; `evaluate` gives its logarithm, up to a constant, at
/// each of the places, −∞ where it is 0. `observe` is told of every step, and ends the chain early by `Break`.
pub fn sample(
    plan: &Plan,
    start: Vec<Vec<f64>>,
    evaluate: &mut dyn FnMut(&[Proposal]) -> Vec<f64>,
    observe: &mut dyn FnMut(Progress<'_>) -> ControlFlow<()>,
) -> Result<Chain, SamplerError> {
    let dimensions = start.first().map_or(0, Vec::len);
    plan.check(dimensions)?;
    assert_eq!(start.len(), plan.walkers, "there is a start for each walker");
    let mut random = Random::new(plan.seed, Purpose::Moves);
    let proposals = start.iter().cloned().enumerate();
    let proposals: Vec<_> = proposals.map(|(walker, place)| Proposal { walker, place }).collect();
    let mut log_densities = evaluate(&proposals);
    if let Some(walker) = log_densities.iter().position(|log| !log.is_finite()) {
        return Err(SamplerError::NoDensity { walker, log_density: log_densities[walker] });
    }
    let mut places = start;
    let mut chain = Chain::new(dimensions, plan);
    for step in 1..=plan.steps {
        for half in 0..2 {
            let (stretches, proposals) = proposals_for(half, &places, &mut random);
            let found = evaluate(&proposals);
            for ((stretch, proposal), log_density) in stretches.iter().zip(proposals).zip(found) {
                let walker = proposal.walker;
                let gain = log_density - log_densities[walker];
                let log_odds = (dimensions as f64 - 1.0) * stretch.ln() + gain;
                // 1 − u is above 0, and a density that is no number is never gone to.
                let is_taken = (1.0 - random.fraction()).ln() < log_odds;
                chain.count(is_taken);
                if is_taken {
                    places[walker] = proposal.place;
                    log_densities[walker] = log_density;
                }
            }
        }
        chain.step(step, plan, &places, &log_densities);
        let acceptance = chain.acceptance();
        if observe(Progress { step, acceptance, log_densities: &log_densities }).is_break() {
            break;
        }
    }
    Ok(chain)
}

/// A stretch and the place it leads to for each walker of a half.
fn proposals_for(
    half: usize,
    places: &[Vec<f64>],
    random: &mut Random,
) -> (Vec<f64>, Vec<Proposal>) {
    let size = places.len() / 2;
    let mut moved = |walker: usize| {
        let other = &places[(1 - half) * size + random.below(size)];
        // Inverse of the distribution function of z.
        let stretch = (1.0 + (STRETCH - 1.0) * random.fraction()).powi(2) / STRETCH;
        let along = other.iter().zip(&places[walker]).map(|(b, a)| b + stretch * (a - b));
        (stretch, Proposal { walker, place: along.collect() })
    };
    (half * size..(half + 1) * size).map(&mut moved).unzip()
}
