//! Conservation of mass and the condition that fixes the length: residual and Jacobian rows.
//! Knows no other equation; what replaces the first row stands in `closure`.

use super::{Medium, Sink};
use crate::state::{State, Var};

/// How mass is balanced.
#[derive(Debug, Clone, Copy)]
pub enum MassBalance<'a> {
    /// ∂H/∂t = 0 and dL/dt = 0.
    Steady,
    /// One backward Euler step of C7.
    Step {
        /// Time step Δt, a.
        dt_a: f64,
        /// H at the step before, at the same χ: \[N\] m.
        thickness_m: &'a [f64],
        /// L at the step before, m.
        length_m: f64,
    },
    /// H and L are given; only U, g^x and μ_w are solved for.
    Given {
        /// H: \[N\] m.
        thickness_m: &'a [f64],
        /// L, m.
        length_m: f64,
    },
}

/// The step before: 1/Δt in a⁻¹, H there and L there.
#[derive(Debug, Clone, Copy)]
pub struct Before<'a> {
    /// 1/Δt, a⁻¹.
    pub per_step: f64,
    /// H: \[N\] m.
    pub thickness_m: &'a [f64],
    /// L, m.
    pub length_m: f64,
}

impl<'a> MassBalance<'a> {
    /// The step before, if there is one.
    pub fn before(&self) -> Option<Before<'a>> {
        match *self {
            Self::Step { dt_a, thickness_m, length_m } => {
                Some(Before { per_step: 1.0 / dt_a, thickness_m, length_m })
            }
            Self::Steady | Self::Given { .. } => None,
        }
    }
}

impl Before<'_> {
    /// dL/dτ, m a⁻¹.
    pub fn length_rate(&self, s: &State) -> f64 {
        (s.length_m - self.length_m) * self.per_step
    }
}

/// Mass continuity, Eq. 27 as C7 and C9, of all cells but the first, and H_L = d (C1); rows of the
/// cells in m a⁻¹, of L in m.
///
/// U: \[N+1\] m a⁻¹ at nodes; H: \[N\] m in cells. The first row is the upstream closure's.
pub fn residual<S: Sink>(m: &Medium, before: Option<Before<'_>>, s: &State, out: &mut S) {
    let n = s.n_cells();
    let inverse_dt = before.map_or(0.0, |b| b.per_step);
    let length_rate = before.map_or(0.0, |b| b.length_rate(s));
    for c in 1..n {
        let row = Var::H(c);
        let upstream = s.thickness_m[c - 1];
        let h = s.thickness_m[c];
        // C9: one-sided at the last cell, centred elsewhere.
        let (right, span) = if c + 1 < n { (c + 1, 2.0) } else { (c, 1.0) };
        let chi = (c as f64 + 0.5) / n as f64;
        let gradient = (s.thickness_m[right] - upstream) / (span * s.dx_m());
        let grid_motion = chi * length_rate * gradient;
        let divergence = flux_difference(m, s, [c - 1, c], c, row, out);
        let storage = before.map_or(0.0, |b| (h - b.thickness_m[c]) * inverse_dt);
        out.residual(row, storage - grid_motion + divergence + m.parameters.melt_rate_m_per_a());

        out.slope(row, Var::H(c), inverse_dt);
        let by_neighbour = chi * length_rate / (span * s.dx_m());
        out.slope(row, Var::H(right), -by_neighbour);
        out.slope(row, Var::H(c - 1), by_neighbour);
        out.slope(row, Var::L(n), -chi * inverse_dt * gradient + grid_motion / s.length_m);
    }

    out.residual(Var::L(n), s.thickness_end_m() - m.parameters.d_m);
    out.slope(Var::L(n), Var::H(n - 1), 1.5);
    out.slope(Var::L(n), Var::H(n - 2), -0.5);
}

/// (flux out of cell `from[1]` − flux out of cell `from[0]`)/(W_c Δx) in m a⁻¹, where a cell's flux is
/// its H and W times the mean speed of its two nodes (C7, upwind). Adds its slopes to `row`.
pub(super) fn flux_difference<S: Sink>(
    m: &Medium,
    s: &State,
    from: [usize; 2],
    cell: usize,
    row: Var,
    out: &mut S,
) -> f64 {
    let n = s.n_cells();
    let u = &s.velocity_m_per_a;
    let per_area = 1.0 / (m.cell_width(cell) * s.dx_m());
    let mut total = 0.0;
    let mut by_length = 0.0;
    for (sign, k) in [(-1.0, from[0]), (1.0, from[1])] {
        let (h, w, speed) = (s.thickness_m[k], m.cell_width(k), 0.5 * (u[k] + u[k + 1]));
        total += sign * speed * h * w * per_area;
        by_length += sign * speed * h * m.cell_width_by_length(k) * per_area;
        out.slope(row, Var::H(k), sign * speed * w * per_area);
        let by_node = sign * 0.5 * h * w * per_area;
        out.slope(row, Var::U(k), by_node);
        out.slope(row, Var::U(k + 1), by_node);
    }
    by_length -= total * (1.0 / s.length_m + m.cell_width_by_length(cell) / m.cell_width(cell));
    out.slope(row, Var::L(n), by_length);
    total
}

/// H and L as given; rows in m.
pub fn given<S: Sink>(thickness_m: &[f64], length_m: f64, s: &State, out: &mut S) {
    let n = s.n_cells();
    for (c, given) in thickness_m.iter().enumerate() {
        out.residual(Var::H(c), s.thickness_m[c] - given);
        out.slope(Var::H(c), Var::H(c), 1.0);
    }
    out.residual(Var::L(n), s.length_m - length_m);
    out.slope(Var::L(n), Var::L(n), 1.0);
}
