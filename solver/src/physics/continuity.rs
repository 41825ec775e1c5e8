//! Conservation of mass and the condition that fixes the length: residual and Jacobian rows.
//! What replaces the first row stands in `closure`; knows no other equation.

use super::given::Given;
use super::quasi_static::Size;
use super::{Medium, Sink, closure};
use crate::state::{State, Var};

/// How mass is balanced.
#[derive(Debug, Clone, Copy)]
pub enum MassBalance<'a> {
    /// ∂H/∂t = 0 and dL/dt = 0.
    Steady,
    /// One implicit step of C7.
    Step(Before<'a>),
    /// H and L are given; only U, g^x and μ_w are solved for.
    Given {
        /// H: \[N\] m.
        thickness_m: &'a [f64],
        /// L, m.
        length_m: f64,
    },
    /// Nothing comes in, melts or leaves: U = 0, and the mélange's size is given.
    AtRest(Size),
}

/// What a step knows of the time before: ∂H/∂τ = (H − Ĥ)·r and dL/dτ = (L − L̂)·r. For backward Euler
/// Ĥ, L̂ are the step before and r = 1/Δt; two-step formulas take weighted means.
#[derive(Debug, Clone, Copy)]
pub struct Before<'a> {
    /// r, a⁻¹.
    pub per_step: f64,
    /// Ĥ: \[N\] m.
    pub thickness_m: &'a [f64],
    /// L̂, m.
    pub length_m: f64,
}

impl Before<'_> {
    /// dL/dτ, m a⁻¹.
    pub fn length_rate(&self, s: &State) -> f64 {
        (s.length_m - self.length_m) * self.per_step
    }
}

/// Mass continuity, Eq. 27 as C7 and C9, of all cells but the first, and H_L = d (C1); rows of the
/// cells in m a⁻¹, of L in m. The first row is the upstream closure's.
///
/// U: \[N+1\] m a⁻¹ at nodes; H: \[N\] m in cells.
pub fn residual<S: Sink>(m: &Medium, before: Option<Before<'_>>, s: &State, out: &mut S) {
    let n = s.n_cells();
    let inverse_dt = before.map_or(0.0, |b| b.per_step);
    let length_rate = before.map_or(0.0, |b| b.length_rate(s));
    closure::first_row(m, before, s, out);
    for c in 1..n {
        let row = Var::H(c);
        let h = s.thickness_m[c];
        let (right, span) = downstream(n, c);
        let chi = (c as f64 + 0.5) / n as f64;
        let gradient = gradient(s, c);
        let grid_motion = chi * length_rate * gradient;
        let divergence = flux_difference(m, s, [c - 1, c], c, row, out);
        let storage = before.map_or(0.0, |b| (h - b.thickness_m[c]) * inverse_dt);
        out.residual(row, storage - grid_motion + divergence + m.melt_m_per_a(c));

        out.slope(row, Var::H(c), inverse_dt);
        let by_neighbour = chi * length_rate / (span * s.dx_m());
        out.slope(row, Var::H(right), -by_neighbour);
        out.slope(row, Var::H(c - 1), by_neighbour);
        out.slope(row, Var::L, -chi * inverse_dt * gradient + grid_motion / s.length_m);
        m.slope_by_melt(row, c, out);
    }
    end(m, s, out);
}

/// H_L = d with H_L extrapolated, C1; in m.
pub(super) fn end<S: Sink>(m: &Medium, s: &State, out: &mut S) {
    let n = s.n_cells();
    out.residual(Var::L, s.thickness_end_m() - m.parameters.d_m);
    out.slope(Var::L, Var::H(n - 1), 1.5);
    out.slope(Var::L, Var::H(n - 2), -0.5);
    out.given(Var::L, Given::IcebergSize, -1.0);
}

/// The cell on whose thickness ∂H/∂x of a cell depends besides the one up-fjord, and how many Δx lie between
/// them (C9): one-sided at the last cell, centred elsewhere.
fn downstream(n_cells: usize, cell: usize) -> (usize, f64) {
    if cell + 1 < n_cells { (cell + 1, 2.0) } else { (cell, 1.0) }
}

/// ∂H/∂x of a cell but the first (C9).
fn gradient(s: &State, cell: usize) -> f64 {
    let (right, span) = downstream(s.n_cells(), cell);
    (s.thickness_m[right] - s.thickness_m[cell - 1]) / (span * s.dx_m())
}

/// −χ ∂H/∂x, by which dL/dτ stands beside ∂H/∂τ in the row of a cell but the first.
pub fn storage_by_length(s: &State, cell: usize) -> f64 {
    let chi = (cell as f64 + 0.5) / s.n_cells() as f64;
    -chi * gradient(s, cell)
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
    let u = &s.velocity_m_per_a;
    let per_area = 1.0 / (m.cell_width(cell) * s.dx_m());
    let mut total = 0.0;
    for (sign, k) in [(-1.0, from[0]), (1.0, from[1])] {
        let (h, w, speed) = (s.thickness_m[k], m.cell_width(k), 0.5 * (u[k] + u[k + 1]));
        total += sign * speed * h * w * per_area;
        out.slope(row, Var::H(k), sign * speed * w * per_area);
        let by_node = sign * 0.5 * h * w * per_area;
        out.slope(row, Var::U(k), by_node);
        out.slope(row, Var::U(k + 1), by_node);
        m.slope_by_width(row, k, sign * speed * h * per_area, out);
    }
    out.slope(row, Var::L, -total / s.length_m);
    m.slope_by_width(row, cell, -total / m.cell_width(cell), out);
    total
}

/// H and L as given; rows in m.
pub fn given<S: Sink>(thickness_m: &[f64], length_m: f64, s: &State, out: &mut S) {
    for (c, given) in thickness_m.iter().enumerate() {
        out.residual(Var::H(c), s.thickness_m[c] - given);
        out.slope(Var::H(c), Var::H(c), 1.0);
    }
    out.residual(Var::L, s.length_m - length_m);
    out.slope(Var::L, Var::L, 1.0);
}
