//! What the equations are given, one entry per scalar parameter: how they name what they change with.
//! Knows no equation.

use crate::params::{PARAMETERS, ParameterInfo};

/// A scalar that the equations are given, in the order of [`PARAMETERS`].
///
/// Where tables give the width, `Width` and `WidthGradient` stand for what is added to all widths, a constant
/// and a multiple of x.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[expect(missing_docs, reason = "each is a parameter, documented in the table")]
pub enum Given {
    TerminusVelocity,
    CalvingRate,
    TerminusThickness,
    MeltRate,
    Width,
    WidthGradient,
    IcebergSize,
    B,
    A,
    MuS,
    Regularisation,
    WaterDrag,
}

/// A number for each [`Given`]: how fast it changes, or what changes with it.
pub type Rates = [f64; Given::ALL.len()];

impl Given {
    /// All of them.
    pub const ALL: [Given; 12] = [
        Self::TerminusVelocity,
        Self::CalvingRate,
        Self::TerminusThickness,
        Self::MeltRate,
        Self::Width,
        Self::WidthGradient,
        Self::IcebergSize,
        Self::B,
        Self::A,
        Self::MuS,
        Self::Regularisation,
        Self::WaterDrag,
    ];

    /// The parameter's row in the table.
    pub fn info(self) -> &'static ParameterInfo {
        &PARAMETERS[self as usize]
    }
}
