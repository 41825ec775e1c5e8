//! What can go wrong in this crate, with the numbers that tell why. Verdicts of physics (collapse,
//! no steady state, …) are results, not errors; they live beside the solver that reaches them.

use crate::params::ParameterError;

/// Why a solve gave no answer.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SolveError {
    /// The parameters are not a mélange this model describes.
    #[error(transparent)]
    Parameters(#[from] ParameterError),
    /// The state handed in does not fit the model or is not a mélange.
    #[error("the given state is unusable: {what}")]
    UnusableState {
        /// What is wrong with it.
        what: String,
    },
    /// Newton's method ended without a root.
    #[error(
        "newton stopped after {iterations} iterations at residual norm {residual_norm:.3e} while {stage}: {reason}"
    )]
    NotConverged {
        /// What was being solved.
        stage: &'static str,
        /// Iterations spent.
        iterations: usize,
        /// Last nondimensional residual norm.
        residual_norm: f64,
        /// What stopped the iteration.
        reason: NewtonFailure,
        /// Residual norms of the last attempt, oldest first.
        history: Vec<f64>,
    },
    /// The mélange lies, in part, where a table says nothing.
    #[error(
        "the mélange reaches from x = {from_x_m:.0} m to {to_x_m:.0} m, and the table of `{table}` from \
         {first_x_m:.0} m to {last_x_m:.0} m: extend the table, or hold it constant beyond its ends"
    )]
    BeyondTable {
        /// Which one.
        table: &'static str,
        /// Its first x along the bedrock, m.
        first_x_m: f64,
        /// Its last x, m.
        last_x_m: f64,
        /// X₀, m.
        from_x_m: f64,
        /// The mélange's end, m.
        to_x_m: f64,
    },
    /// No time step, however short, keeps the error asked for.
    #[error("at t = {time_a} a no time step is short enough for the error asked for")]
    NoStepShortEnough {
        /// Model time reached, in years.
        time_a: f64,
    },
    /// A march towards a steady state led to a mélange that breaks up, and no further.
    #[error(
        "the mélange that marches towards a steady state breaks up after {time_a:.3} a: {length_m:.0} m long, it \
         is thinner than its icebergs between its ends"
    )]
    BreaksUp {
        /// Time of the march, in years.
        time_a: f64,
        /// Its length then, m.
        length_m: f64,
    },
    /// The closure at the terminus does not single out a steady state.
    #[error("closure `{closure}` leaves a family of steady states; it serves transients only")]
    ClosureLeavesFamily {
        /// Its name.
        closure: &'static str,
    },
    /// The caller's observer asked to stop.
    #[error("stopped by the caller at t = {time_a} a")]
    Stopped {
        /// Model time reached, in years.
        time_a: f64,
    },
}

/// What stopped a Newton iteration.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum NewtonFailure {
    /// The iteration limit was reached.
    #[error("too many iterations")]
    TooManyIterations,
    /// No step along the Newton direction lowers the residual.
    #[error("no step lowers the residual, as happens on a kink of the rheology")]
    Stalled,
    /// The Jacobian has no usable pivot.
    #[error("the jacobian is singular, as at a fold or with a closure that fixes no state")]
    Singular,
    /// The starting point lies outside the model's domain.
    #[error("the start has a thickness, fluidity or length that is not positive")]
    OutsideDomain,
}
