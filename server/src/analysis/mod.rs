//! What an ensemble's numbers say: laws, as a whole and for groups of runs with what a law leaves unexplained; Sobol's
//! indices; how a number answers to a season. Numbers only: no queue, no transport.

mod alike;
mod exponent;
mod groups;
pub mod indices;
mod law;
mod laws;
pub mod season;

pub use law::{Fit, Law, NoFit, fit};
pub use laws::{Laws, Table, laws};
