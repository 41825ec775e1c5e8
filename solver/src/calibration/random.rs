//! Random numbers that are the same for ever: ChaCha8, by seed and purpose. Knows not what they decide.

use rand::rngs::ChaCha8Rng;
use rand::{Rng, SeedableRng};
use std::f64::consts::TAU;

/// What random numbers are drawn for; each purpose has its own stream.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Purpose {
    Starts,
    Ensemble,
    Moves,
}

/// A stream of random numbers.
#[derive(Debug)]
pub(crate) struct Random(ChaCha8Rng);

impl Random {
    pub(crate) fn new(seed: u64, purpose: Purpose) -> Self {
        let mut generator = ChaCha8Rng::seed_from_u64(seed);
        generator.set_stream(purpose as u64);
        Self(generator)
    }

    /// From 0 up to but not including 1, by the 53 bits that an f64 has.
    pub(crate) fn fraction(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// A whole number below another one.
    pub(crate) fn below(&mut self, n: usize) -> usize {
        ((self.fraction() * n as f64) as usize).min(n - 1)
    }

    /// Of mean 0 and variance 1 (Box and Muller 1958).
    pub(crate) fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.fraction()).ln()).sqrt();
        radius * (TAU * self.fraction()).cos()
    }
}

/// n points in the unit cube: Kronecker's sequence with the powers of 1/φ_d, where φ_d^{d+1} = φ_d + 1 (the
/// golden ratio in one dimension), shifted at random. Any first few of them lie well apart.
pub(crate) fn quasi_random(n: usize, dimensions: usize, seed: u64) -> Vec<Vec<f64>> {
    /// The fixed-point iteration for φ_d gains a factor above 2 each time.
    const ITERATIONS: usize = 60;
    let phi =
        (0..ITERATIONS).fold(1.5_f64, |phi, _| (1.0 + phi).powf(1.0 / (dimensions as f64 + 1.0)));
    let mut random = Random::new(seed, Purpose::Starts);
    let shifts: Vec<f64> = (0..dimensions).map(|_| random.fraction()).collect();
    let place = |i: usize, k: usize| (shifts[k] + i as f64 * phi.powi(-(k as i32 + 1))).fract();
    (0..n).map(|i| (0..dimensions).map(|k| place(i, k)).collect()).collect()
}
