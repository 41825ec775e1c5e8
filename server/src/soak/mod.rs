//! What strains the program for long: solver and branches with parameters drawn at random, the service with kills;
//! and what the service takes beside the bare solver. Everything random depends on a seed alone.

pub mod branches;
pub mod engine;
mod process;
mod shapes;
pub mod solver;
mod tables;
pub mod throughput;

/// Numbers in [0, 1) that depend on seed and index alone: BLAKE3's output, 53 bits at a time.
#[derive(Debug)]
struct Numbers(blake3::OutputReader);

impl Numbers {
    fn new(seed: u64, index: u64) -> Self {
        let mut hasher = blake3::Hasher::new();
        hasher.update(&seed.to_le_bytes()).update(&index.to_le_bytes());
        Self(hasher.finalize_xof())
    }

    fn next(&mut self) -> f64 {
        let mut bytes = [0; 8];
        self.0.fill(&mut bytes);
        (u64::from_le_bytes(bytes) >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// A whole number from 1.
    fn up_to(&mut self, most: u32) -> u32 {
        1 + (self.next() * f64::from(most)) as u32
    }
}

/// The middle one of some numbers, the upper of two; 0 if there is none.
fn median(mut numbers: Vec<f64>) -> f64 {
    numbers.sort_unstable_by(f64::total_cmp);
    numbers.get(numbers.len() / 2).copied().unwrap_or_default()
}
