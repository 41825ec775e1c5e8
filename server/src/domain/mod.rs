//! What a sweep and a run are: names, checks, points, identity, states. Pure and deterministic: no
//! database, no files, no clock, nothing asynchronous.

pub mod dictionary;
pub mod document;
pub mod identity;
pub mod outcome;
pub mod refusal;
pub mod run;
pub mod status;
pub mod sweep;

/// The solver's table of parameters: names, units, meanings, defaults, ranges.
pub use melange_solver::params as parameters;
