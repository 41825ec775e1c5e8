//! The fjord's width along the bedrock: straight walls, or a table. Knows nothing of the ice in it.

use crate::interpolate::{Axis, Beyond, Monotone, TableError};
use std::sync::Arc;

/// Width as a function of the distance x down-fjord from the terminus' position at t = 0.
#[derive(Debug, Clone, PartialEq)]
pub struct Fjord(Walls);

#[derive(Debug, Clone, PartialEq)]
enum Walls {
    Straight { width_m: f64, gradient: f64 },
    Table { widths: Arc<Monotone>, beyond: Beyond },
}

impl Fjord {
    /// W = `width_m` + `gradient`·x, everywhere.
    pub fn straight(width_m: f64, gradient: f64) -> Self {
        Self(Walls::Straight { width_m, gradient })
    }

    /// Widths in m over x in m, all positive; `beyond` says what lies beyond them.
    pub fn table(widths: impl Into<Arc<Monotone>>, beyond: Beyond) -> Result<Self, TableError> {
        let widths = widths.into();
        match widths.y().iter().position(|w| *w <= 0.0) {
            Some(index) => Err(TableError::Unfit {
                axis: Axis::Y,
                index: Some(index),
                value: widths.y()[index],
                permitted: "widths above 0 m",
            }),
            None => Ok(Self(Walls::Table { widths, beyond })),
        }
    }

    /// W(x) in m; x in m in the bedrock frame. Not positive where straight walls have met; beyond a
    /// table what it is at its end, whether [`Self::reach`] ends there or not, so that a solver may
    /// stray there before it arrives.
    pub fn width(&self, x: f64) -> f64 {
        match &self.0 {
            Walls::Straight { width_m, gradient } => width_m + gradient * x,
            Walls::Table { widths, .. } => widths.value(x),
        }
    }

    /// dW/dx at x.
    pub fn slope(&self, x: f64) -> f64 {
        match &self.0 {
            Walls::Straight { gradient, .. } => *gradient,
            Walls::Table { widths, .. } => widths.slope(x),
        }
    }

    /// dW/dx of straight walls, or from end to end of a table.
    pub fn mean_gradient(&self) -> f64 {
        match &self.0 {
            Walls::Straight { gradient, .. } => *gradient,
            Walls::Table { widths, .. } => {
                let (first, last) = widths.range();
                (widths.value(last) - widths.value(first)) / (last - first)
            }
        }
    }

    /// Where the walls meet down-fjord of x = 0, m; infinite if they do not.
    pub fn closes_at_m(&self) -> f64 {
        match &self.0 {
            Walls::Straight { width_m, gradient } if *gradient < 0.0 => -width_m / gradient,
            _ => f64::INFINITY,
        }
    }

    /// Whether the walls are straight, and not a table's.
    pub fn is_straight(&self) -> bool {
        matches!(self.0, Walls::Straight { .. })
    }

    /// Whether the width is the same everywhere.
    pub fn is_constant(&self) -> bool {
        match &self.0 {
            Walls::Straight { gradient, .. } => *gradient == 0.0,
            Walls::Table { widths, .. } => widths.minimum() == widths.maximum(),
        }
    }

    /// First and last x in m that the width is known at, for who has a final state to ask; none if
    /// it is known everywhere.
    pub fn reach(&self) -> Option<(f64, f64)> {
        match &self.0 {
            Walls::Table { widths, beyond: Beyond::Refused } => Some(widths.range()),
            _ => None,
        }
    }
}
