//! What a sweep and a run are: names, checks, points, identity, states. Pure and deterministic: no
//! database, no files, no clock, nothing asynchronous.

pub mod along;
pub mod axes;
pub mod branch;
pub mod calibrated;
pub mod calibration;
pub mod citation;
pub mod curve;
pub mod dictionary;
pub mod discrete_root;
pub mod document;
pub mod effective;
pub mod entries;
pub mod filter;
pub mod forcing;
pub mod foreign;
pub mod found;
pub mod identity;
pub mod label;
pub mod nearness;
pub mod note;
pub mod order;
pub mod outcome;
pub mod person;
pub mod provenance;
pub mod reading;
pub mod reason;
pub mod refusal;
pub mod rows;
pub mod run;
pub mod same;
pub mod sample;
pub mod seal;
pub mod sensitivity;
pub mod start;
pub mod status;
pub mod stored_state;
pub mod sweep;
pub mod swing;
pub mod table;
pub mod taken_out;
pub mod time;

/// The solver's table of parameters: names, units, meanings, defaults, ranges.
pub use melange_solver::params as parameters;
