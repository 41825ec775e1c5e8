//! What makes two runs the same run: model version, options and parameters, as bits.

use super::document::Start;
use super::run::RunSpec;
use melange_solver::params::PARAMETERS;

/// Version of the model's numbers. Raised when a run's result changes by more than the tolerance it is
/// solved to, so that old results are not taken for new ones.
pub const MODEL_VERSION: &str = "melange-model 1";

/// Hex digits of a run's id: 128 bits of the blake3 hash.
pub const ID_DIGITS: usize = 32;

impl RunSpec {
    /// The run's id: blake3 of everything its result depends on, numbers as IEEE-754 bits with −0 as 0.
    /// Each part is preceded by a tag, and each text by its length.
    pub fn id(&self) -> String {
        let mut key = Key(blake3::Hasher::new());
        key.text("model", MODEL_VERSION);
        key.text("regime", self.regime.name());
        key.text("upstream_closure", self.closure.name());
        for info in &PARAMETERS {
            key.number(info.name, (info.get)(&self.parameters));
        }
        match &self.start {
            None => {}
            Some(Start::Steady) => key.text("start", "steady"),
            Some(Start::Wedge(wedge)) => {
                key.number("start.length_m", wedge.length_m);
                key.number("start.thickness_0_m", wedge.thickness_0_m);
            }
            Some(Start::Run(id)) => key.text("start.run", id),
        }
        if let Some(steps) = &self.steps {
            key.number("dt_a", steps.dt_a);
            key.number("steps", steps.count as f64);
            key.number("series_every", steps.series_every as f64);
            for step in &steps.profiles_at {
                key.number("profile_at", *step as f64);
            }
        }
        key.0.finalize().to_hex()[..ID_DIGITS].to_owned()
    }
}

struct Key(blake3::Hasher);

impl Key {
    fn text(&mut self, tag: &str, text: &str) {
        for part in [tag, text] {
            self.0.update(&(part.len() as u64).to_le_bytes());
            self.0.update(part.as_bytes());
        }
    }

    fn number(&mut self, tag: &str, value: f64) {
        let canonical = if value == 0.0 { 0.0_f64 } else { value };
        self.0.update(&(tag.len() as u64).to_le_bytes());
        self.0.update(tag.as_bytes());
        self.0.update(&canonical.to_bits().to_le_bytes());
    }
}
