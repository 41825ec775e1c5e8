//! How the melt rate is spread along the mélange, as a factor. Knows neither the rate nor the ice.

use crate::interpolate::{Axis, Beyond, Linear, TableError};
use std::sync::Arc;

/// Factor of the melt rate along the mélange, dimensionless. Shapes over χ are scaled so that their
/// continuous mean over the mélange is 1; a table over x in metres is taken as it is.
///
/// | name | shape | mean |
/// |---|---|---|
/// | `uniform` | 1 | 1 |
/// | `linear` | 0.6 − 0.4χ | 2/5 |
/// | `less_linear` | 0.5 − 0.2χ | 2/5 |
/// | `u_shaped` | 0.5 + 50(χ − ½)⁶ | 1/2 + 50/448 = 137/224 |
#[derive(Debug, Clone, Default, PartialEq)]
pub struct MeltShape(Shape);

#[derive(Debug, Clone, Default, PartialEq)]
enum Shape {
    #[default]
    Uniform,
    Linear,
    LessLinear,
    UShaped,
    Chi {
        table: Arc<Linear>,
        mean: f64,
    },
    X {
        table: Arc<Linear>,
        frame: Frame,
        beyond: Beyond,
    },
}

/// Shapes by their names.
const NAMED: [(&str, Shape); 4] = [
    ("uniform", Shape::Uniform),
    ("linear", Shape::Linear),
    ("less_linear", Shape::LessLinear),
    ("u_shaped", Shape::UShaped),
];

/// What a table's x is counted from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Frame {
    /// The terminus, wherever it is.
    Terminus,
    /// The terminus' position at t = 0.
    Bedrock,
}

/// A place in the mélange.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// Share of the mélange's length up-fjord of it.
    pub chi: f64,
    /// Distance from the terminus, m.
    pub x_m: f64,
    /// The terminus' position X₀ in the bedrock frame, m.
    pub terminus_x_m: f64,
}

impl MeltShape {
    /// The shape of a name.
    pub fn named(name: &str) -> Option<Self> {
        NAMED.into_iter().find_map(|(n, shape)| (n == name).then_some(Self(shape)))
    }

    /// All names.
    pub fn names() -> [&'static str; 4] {
        NAMED.map(|(name, _)| name)
    }

    /// Its name; none for a table.
    pub fn name(&self) -> Option<&'static str> {
        NAMED.into_iter().find_map(|(name, shape)| (shape == self.0).then_some(name))
    }

    /// Factors, none negative and not all 0, over χ from 0 to 1; divided by their mean.
    pub fn over_chi(table: impl Into<Arc<Linear>>) -> Result<Self, TableError> {
        let table = table.into();
        check_factors(&table)?;
        let unfit = |axis, index, value, permitted| {
            Err(TableError::Unfit { axis, index, value, permitted })
        };
        let (first, last) = table.range();
        if first != 0.0 {
            return unfit(Axis::X, Some(0), first, "from 0");
        }
        if last != 1.0 {
            return unfit(Axis::X, Some(table.x().len() - 1), last, "up to 1");
        }
        let mean = table.mean();
        if !(mean > 0.0 && mean.is_finite()) {
            return unfit(Axis::Y, None, mean, "factors whose mean is a finite number above 0");
        }
        Ok(Self(Shape::Chi { table, mean }))
    }

    /// Factors, none negative, over x in m; `beyond` says what lies beyond them.
    pub fn over_x(
        table: impl Into<Arc<Linear>>,
        frame: Frame,
        beyond: Beyond,
    ) -> Result<Self, TableError> {
        let table = table.into();
        check_factors(&table)?;
        Ok(Self(Shape::X { table, frame, beyond }))
    }

    /// Factor of the melt rate; beyond a table what it is at its end, whether [`Self::reach`] ends
    /// there or not.
    pub fn factor(&self, at: Place) -> f64 {
        match &self.0 {
            Shape::Uniform => 1.0,
            Shape::Linear => (0.6 - 0.4 * at.chi) / 0.4,
            Shape::LessLinear => (0.5 - 0.2 * at.chi) / 0.4,
            Shape::UShaped => (0.5 + 50.0 * (at.chi - 0.5).powi(6)) / (137.0 / 224.0),
            Shape::Chi { table, mean } => table.value(at.chi) / mean,
            Shape::X { table, frame, .. } => table.value(frame.x_m(at)),
        }
    }

    /// ∂factor/∂x at fixed χ, m⁻¹: 0 for shapes over χ. ∂/∂L at fixed χ is χ times this; ∂/∂X₀ is
    /// this itself if the shape [depends on the bedrock](Self::depends_on_bedrock), else 0.
    pub fn slope_by_x(&self, at: Place) -> f64 {
        match &self.0 {
            Shape::X { table, frame, .. } => table.slope(frame.x_m(at)),
            _ => 0.0,
        }
    }

    /// Whether the factor at a place in the mélange changes as the terminus moves.
    pub fn depends_on_bedrock(&self) -> bool {
        matches!(&self.0, Shape::X { table, frame: Frame::Bedrock, .. }
            if table.minimum() != table.maximum())
    }

    /// First and last distance from a terminus at X₀, in m, that the factor is known at; none if it is
    /// known everywhere.
    pub fn reach(&self, terminus_x_m: f64) -> Option<(f64, f64)> {
        match &self.0 {
            Shape::X { table, frame, beyond: Beyond::Refused } => {
                let (first, last) = table.range();
                let origin = frame.x_m(Place { chi: 0.0, x_m: 0.0, terminus_x_m });
                Some((first - origin, last - origin))
            }
            _ => None,
        }
    }
}

impl Frame {
    /// A place's x in this frame, m.
    fn x_m(self, at: Place) -> f64 {
        match self {
            Self::Terminus => at.x_m,
            Self::Bedrock => at.terminus_x_m + at.x_m,
        }
    }
}

fn check_factors(table: &Linear) -> Result<(), TableError> {
    match table.y().iter().position(|factor| *factor < 0.0) {
        Some(index) => Err(TableError::Unfit {
            axis: Axis::Y,
            index: Some(index),
            value: table.y()[index],
            permitted: "factors of 0 or more",
        }),
        None => Ok(()),
    }
}
