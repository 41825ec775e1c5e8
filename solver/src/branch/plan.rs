//! Which branch is followed, and how far; what cannot be followed is refused here. Solves nothing.

use crate::control::{Control, Setting};
use crate::params::ParameterError;

/// Least length of the longest step: shorter ones are those of kinks.
const SHORTEST_LONGEST_STEP: f64 = 1e-3;

/// Which branch is followed, and how far.
#[derive(Debug, Clone, PartialEq)]
pub struct BranchPlan {
    /// The problem; its control parameter's value is where the branch begins.
    pub setting: Setting,
    /// What varies.
    pub control: Control,
    /// The branch ends where the control parameter leaves these bounds.
    pub bounds: (f64, f64),
    /// Longest step, in units of arclength.
    pub longest_step: f64,
    /// Most points, both ways together.
    pub most_points: usize,
    /// Whether growth rates are wanted: most of the time of a fine grid.
    pub with_stability: bool,
    /// Values of the control parameter at which every root of the branch is wanted.
    pub roots_at: Vec<f64>,
}

impl BranchPlan {
    /// With steps that draw a smooth curve of some 40 points.
    pub fn new(setting: Setting, control: Control, bounds: (f64, f64)) -> Self {
        Self {
            setting,
            control,
            bounds,
            longest_step: 0.3,
            most_points: 1000,
            with_stability: true,
            roots_at: Vec::new(),
        }
    }

    /// The problem at a value of the control parameter.
    pub fn setting_at(&self, control: f64) -> Setting {
        let mut setting = self.setting.clone();
        self.control.set(&mut setting, control);
        setting
    }

    /// Unit of the control parameter in arclength: a quarter of the way between the bounds, or where it begins
    /// if that is less and not 0, lest wide bounds make arclength blind to it.
    pub fn unit(&self) -> f64 {
        let quarter = 0.25 * (self.bounds.1 - self.bounds.0);
        let start = self.control.value(&self.setting).abs();
        if start > 0.0 { quarter.min(start) } else { quarter }
    }

    /// Refuses bounds that do not hold the start, steps that lead nowhere, and controls that the setting does
    /// not have.
    pub fn check(&self) -> Result<(), ParameterError> {
        self.control.check(&self.setting)?;
        let (low, high) = self.control.range();
        let (from, to) = self.bounds;
        let refuse = |value: f64, permitted: String| {
            Err(ParameterError::Contradiction { name: self.control.name(), value, permitted })
        };
        let is_range = from.is_finite() && to.is_finite() && from < to;
        if !is_range || from < low || to > high {
            let wrong = if from.is_finite() && from >= low { to } else { from };
            return refuse(wrong, format!("bounds from low to high within {low} to {high}"));
        }
        let start = self.control.value(&self.setting);
        if !(from..=to).contains(&start) {
            return refuse(start, format!("a start within the bounds, {from} to {to}"));
        }
        if let Some(value) = self.roots_at.iter().find(|value| !(from..=to).contains(*value)) {
            return refuse(*value, format!("values within the bounds, {from} to {to}"));
        }
        if !(self.longest_step >= SHORTEST_LONGEST_STEP && self.longest_step.is_finite()) {
            return Err(ParameterError::Contradiction {
                name: "longest_step",
                value: self.longest_step,
                permitted: format!("a number from {SHORTEST_LONGEST_STEP}"),
            });
        }
        Ok(())
    }
}
