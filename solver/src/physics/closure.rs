//! What closes the mass equation at the terminus. U₀H₀ = U_cH_t (Eq. 22) serves as the momentum
//! equation's condition there, and the mass equation, whose characteristics enter at x = 0, is left
//! without one; what stands in its first row decides the force. One arm per closure.

use super::continuity::{self, Before};
use super::{Medium, Sink};
use crate::state::{State, Var, scale};

/// The first row of the mass equation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum UpstreamClosure {
    /// ∂²H/∂x² = 0: H½ − 2H₃⸝₂ + H₅⸝₂ = 0. The paper's figures.
    #[default]
    Published,
    /// C8, a forward difference. Its steady states form a family, so for transients only.
    Printed,
    /// ∂U/∂x = 0, as in front of a rigid terminus.
    NoStretching,
}

impl UpstreamClosure {
    /// All closures, in the order of the documentation.
    pub const ALL: [UpstreamClosure; 3] = [Self::Published, Self::Printed, Self::NoStretching];

    /// Name at every boundary.
    pub fn name(self) -> &'static str {
        match self {
            Self::Published => "published",
            Self::Printed => "printed",
            Self::NoStretching => "no_stretching",
        }
    }
}

impl UpstreamClosure {
    /// Unit of the first row: \[H\], \[U\] or \[Ḃ\], for its nondimensional residual.
    pub(super) fn scale(self) -> f64 {
        match self {
            Self::Published => scale::THICKNESS,
            Self::Printed => scale::MASS_BALANCE,
            Self::NoStretching => scale::VELOCITY,
        }
    }
}

/// The mass equation's row of the first cell: m for `Published`, m a⁻¹ for the others.
pub(super) fn first_row<S: Sink>(m: &Medium, before: Option<Before<'_>>, s: &State, out: &mut S) {
    let row = Var::H(0);
    let n = s.n_cells();
    let h = &s.thickness_m;
    let u = &s.velocity_m_per_a;
    match m.closure {
        UpstreamClosure::Published => {
            out.residual(row, h[0] - 2.0 * h[1] + h[2]);
            out.slope(row, Var::H(0), 1.0);
            out.slope(row, Var::H(1), -2.0);
            out.slope(row, Var::H(2), 1.0);
        }
        UpstreamClosure::NoStretching => {
            out.residual(row, u[1] - u[0]);
            out.slope(row, Var::U(1), 1.0);
            out.slope(row, Var::U(0), -1.0);
        }
        UpstreamClosure::Printed => {
            let chi = 0.5 / n as f64;
            let inverse_dt = before.map_or(0.0, |b| b.per_step);
            let length_rate = before.map_or(0.0, |b| b.length_rate(s));
            let gradient = (h[1] - h[0]) / s.dx_m();
            let divergence = continuity::flux_difference(m, s, [0, 1], 0, row, out);
            let storage = before.map_or(0.0, |b| (h[0] - b.thickness_m[0]) * inverse_dt);
            let melt = m.melt_m_per_a(0);
            out.residual(row, storage - chi * length_rate * gradient + divergence + melt);
            let by_neighbour = chi * length_rate / s.dx_m();
            out.slope(row, Var::H(0), inverse_dt + by_neighbour);
            out.slope(row, Var::H(1), -by_neighbour);
            let by_length =
                -chi * inverse_dt * gradient + chi * length_rate * gradient / s.length_m;
            out.slope(row, Var::L, by_length);
            m.slope_by_melt(row, 0, out);
        }
    }
}
