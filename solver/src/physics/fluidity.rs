//! Longitudinal granular fluidity g^x: residual and Jacobian rows. Knows no other equation.

use super::given::Given;
use super::{Medium, Sink, local_fluidity_rate};
use crate::params::Parameters;
use crate::state::{State, Var};

/// 1 − μ_s/μ of a cell, with μ = (|ε̇_xx| + δε̇)/g^x (Eq. 15 with the regularisation of §2.2).
pub fn yield_excess(p: &Parameters, s: &State, cell: usize) -> f64 {
    let shear = s.strain_rate_per_a(cell).abs() + p.strain_rate_regularisation_per_a;
    1.0 - p.mu_s * s.fluidity_per_a[cell] / shear
}

/// Pseudo-time in fluidity and friction, for states that lie across a kink from their root: neither
/// equation has a time of its own, and ∂g/∂τ = ∂²g/∂x² − (g − g_loc)/ξ², ∂μ_w/∂τ ∝ U + U_t − U_c − ū lead
/// to a stable root.
#[derive(Debug, Clone, Copy)]
pub struct Relaxation<'a> {
    /// g at the pseudo-step before: \[N\] a⁻¹.
    pub fluidity_per_a: &'a [f64],
    /// 1/Δτ, m⁻².
    pub rate_per_m2: f64,
    /// μ_w at the pseudo-step before: \[N+1\].
    pub mu_w: &'a [f64],
    /// Factor of μ_w/Δτ in the transverse problem, m a⁻¹.
    pub speed_per_mu: f64,
}

/// Nonlocal granular fluidity, Eqs. 16–18 as C4; rows of the cells, in a⁻¹ m⁻².
///
/// ∂²g/∂x² = (g − g_loc)/ξ² with ξ = Ad/√|μ − μ_s| and
/// g_loc = √(P/ρ)/d · (μ − μ_s)₊/(μ b), P = P̃ g/(g + ε̇) (text below Eq. 17). The first and the last
/// row are ∂g/∂x = 0, in a⁻¹. `m.smoothing` = ε rounds the kinks: with q = 1 − μ_s/μ,
/// |μ − μ_s| = μ|q| → μ√(q² + ε²) and (μ − μ_s)₊/μ = q₊ → (q + √(q² + ε²))/2, and with them
/// |ε̇| → √(ε̇² + (εδε̇)²); the model itself has ε = 0. q falls linearly with g, so that g_loc falls with g
/// whatever ε is; rounded in μ, it would grow, and the fluidity without bound where
/// √(P/ρ)/(d b)·ε² > 4μ_sδε̇.
/// U: \[N+1\] m a⁻¹ at nodes; H: \[N\] m and g: \[N\] a⁻¹ in cells.
pub fn residual<S: Sink>(m: &Medium, s: &State, out: &mut S) {
    let n = s.n_cells();
    let p = m.parameters;
    let dx = s.dx_m();
    let inverse_dx2 = 1.0 / (dx * dx);
    let cooperativity2 = (p.A * p.d_m).powi(2);

    for (row, inner) in [(0, 1), (n - 1, n - 2)] {
        out.residual(Var::G(row), s.fluidity_per_a[inner] - s.fluidity_per_a[row]);
        out.slope(Var::G(row), Var::G(row), -1.0);
        out.slope(Var::G(row), Var::G(inner), 1.0);
    }

    for c in 1..n - 1 {
        let row = Var::G(c);
        let (h, g, strain) = (s.thickness_m[c], s.fluidity_per_a[c], s.strain_rate_per_a(c));
        let magnitude = root_of_squares(strain, m.smoothing * p.strain_rate_regularisation_per_a);
        let sense = if magnitude > 0.0 { strain / magnitude } else { 0.0 };
        let shear = magnitude + p.strain_rate_regularisation_per_a;
        let mu = shear / g;
        let excess = 1.0 - p.mu_s / mu;
        let distance = root_of_squares(excess, m.smoothing);
        let above = 0.5 * (excess + distance);
        let side = if distance > 0.0 { excess / distance } else { 0.0 };
        let above_by_excess = 0.5 * (1.0 + side);
        let source = local_fluidity_rate(p, h) * (g / (g + strain)).sqrt();
        let local = source * above;
        let curvature = (s.fluidity_per_a[c - 1] - 2.0 * g + s.fluidity_per_a[c + 1]) * inverse_dx2;
        let coupling = mu * distance / cooperativity2;
        let (lag, rate) = m.relaxation.map_or((0.0, 0.0), |relaxation| {
            (g - relaxation.fluidity_per_a[c], relaxation.rate_per_m2)
        });
        out.residual(row, curvature - coupling * (g - local) - rate * lag);

        let by_excess =
            -mu * side / cooperativity2 * (g - local) + coupling * source * above_by_excess;
        let by_mu = -distance / cooperativity2 * (g - local) + by_excess * (1.0 - excess) / mu;
        let by_local = coupling * local;
        let by_strain = by_mu * sense / g - 0.5 * by_local / (g + strain);
        let by_g = -2.0 * inverse_dx2 - coupling - rate - by_mu * mu / g
            + 0.5 * by_local * (1.0 / g - 1.0 / (g + strain));
        out.slope(row, Var::G(c - 1), inverse_dx2);
        out.slope(row, Var::G(c), by_g);
        out.slope(row, Var::G(c + 1), inverse_dx2);
        out.slope(row, Var::H(c), 0.5 * by_local / h);
        out.slope(row, Var::U(c), -by_strain / dx);
        out.slope(row, Var::U(c + 1), by_strain / dx);
        out.slope(row, Var::L, (-2.0 * curvature - by_strain * strain) / s.length_m);
        // ε̇ is rounded by a share of δε̇, which so enters μ twice.
        let rounding = m.smoothing * m.smoothing * p.strain_rate_regularisation_per_a;
        let shear_by_regularisation = 1.0 + if rounding > 0.0 { rounding / magnitude } else { 0.0 };
        out.given(row, Given::Regularisation, by_mu * shear_by_regularisation / g);
        let by_log_cooperativity = 2.0 * coupling * (g - local);
        out.given(row, Given::A, by_log_cooperativity / p.A);
        out.given(row, Given::IcebergSize, (by_log_cooperativity - by_local) / p.d_m);
        out.given(row, Given::B, -by_local / p.b);
        out.given(row, Given::MuS, -by_excess / mu);
    }
}

/// √(a² + b²), without the care of `f64::hypot` for huge and tiny values, and a fifth of its time.
fn root_of_squares(a: f64, b: f64) -> f64 {
    (a * a + b * b).sqrt()
}
