//! The quasi-static limit: no calving, no melt, U = 0 in the terminus frame, a mélange of given size that
//! the terminus pushes along. Mass rows only; the stress balance is that of `momentum`.

use super::{Medium, Sink, continuity};
use crate::state::{State, Var, scale};

/// What fixes the size of a mélange at rest. (A given volume is sought from outside, since it touches
/// every cell.)
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Size {
    /// L, m.
    Length(f64),
    /// H₀, m.
    Thickness0(f64),
}

impl Size {
    /// Unit of its row, m.
    pub(super) fn scale(self) -> f64 {
        match self {
            Size::Length(_) => scale::LENGTH,
            Size::Thickness0(_) => scale::THICKNESS,
        }
    }
}

/// U_j = U_{j−1} in place of conservation of mass, in m a⁻¹, so that U = U₀ = 0; the size in the first
/// row, and H_L = d (C1), in m.
pub fn residual<S: Sink>(m: &Medium, size: Size, s: &State, out: &mut S) {
    let row = Var::H(0);
    match size {
        Size::Length(length_m) => {
            out.residual(row, s.length_m - length_m);
            out.slope(row, Var::L, 1.0);
        }
        Size::Thickness0(thickness_m) => {
            out.residual(row, s.thickness_0_m() - thickness_m);
            out.slope(row, Var::H(0), 1.5);
            out.slope(row, Var::H(1), -0.5);
        }
    }
    for c in 1..s.n_cells() {
        let row = Var::H(c);
        out.residual(row, s.velocity_m_per_a[c] - s.velocity_m_per_a[c - 1]);
        out.slope(row, Var::U(c), 1.0);
        out.slope(row, Var::U(c - 1), -1.0);
    }
    continuity::end(m, s, out);
}
