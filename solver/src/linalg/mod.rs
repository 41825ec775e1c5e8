//! Linear algebra this crate exists for: a banded matrix with one dense border column.
//! Knows no physics.

pub mod banded;
pub mod bordered;
