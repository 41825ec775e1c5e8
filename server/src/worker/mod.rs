//! Solves what the queue holds.

pub mod solve;
