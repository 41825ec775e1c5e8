//! What a caller sees of a transient while it runs, and how it stops one.

use crate::params::Parameters;
use crate::state::State;
use std::ops::ControlFlow;

/// The mélange at one time.
#[derive(Debug, Clone, Copy)]
pub struct Moment<'a> {
    /// Number of the accepted step that ended here; 0 is the start.
    pub step: usize,
    /// Time since the start, a.
    pub time_a: f64,
    /// Length of the step that ended here, a; 0 at the start.
    pub dt_a: f64,
    /// Which of the times asked for this is: the number of the fixed step, or the place among those to
    /// land on.
    pub landing: Option<usize>,
    /// Position X₀ of the terminus along the bedrock, m.
    pub terminus_x_m: f64,
    /// The parameters in force, with the calving rate and the thickness that a calving law sets.
    pub parameters: &'a Parameters,
    /// The state.
    pub state: &'a State,
}

/// Receives every accepted step.
pub trait Observer {
    /// Called at the start and after each accepted step; `Break` ends the run.
    fn moment(&mut self, moment: Moment<'_>) -> ControlFlow<()>;
}

impl<F: FnMut(Moment<'_>) -> ControlFlow<()>> Observer for F {
    fn moment(&mut self, moment: Moment<'_>) -> ControlFlow<()> {
        self(moment)
    }
}
