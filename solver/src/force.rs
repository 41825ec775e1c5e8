//! The buttressing force on the terminus and other numbers read off a state. Solves nothing.

use crate::Model;
use crate::params::{GRAVITY, ICE_DENSITY, WATER_DENSITY};
use crate::physics::fluidity;
use crate::state::State;

/// H P̃ = ½ρg(1 − ρ/ρ_w)H² (Eq. 5) in N m⁻¹, for H in m: 485.67 H².
pub fn static_force_n_per_m(thickness_m: f64) -> f64 {
    0.5 * ICE_DENSITY * GRAVITY * (1.0 - ICE_DENSITY / WATER_DENSITY) * thickness_m * thickness_m
}

/// Buttressing force per unit width F/W, Eq. 30, N m⁻¹.
///
/// ε̇ = (U₁ − U₀)/(L Δχ) and g = g^x of the first cell, H₀ extrapolated.
pub fn force_n_per_m(s: &State) -> f64 {
    let strain = s.strain_rate_per_a(0);
    let stretching = strain / (s.fluidity_per_a[0] + strain);
    static_force_n_per_m(s.thickness_0_m()) * (1.0 - 2.0 * stretching)
}

/// Estimate of F/W that leaves out stretching (limit of Eq. 30 for ∂U/∂x → 0), N m⁻¹.
pub fn force_quasi_static_n_per_m(s: &State) -> f64 {
    static_force_n_per_m(s.thickness_0_m())
}

/// Volume ∫HW dx by the cells' values, m³; the terminus stands at `terminus_x_m` along the bedrock.
pub fn volume_m3(model: &Model, s: &State, terminus_x_m: f64) -> f64 {
    let dx = s.dx_m();
    s.cell_x_m()
        .iter()
        .zip(&s.thickness_m)
        .map(|(x, h)| h * model.fjord().width(terminus_x_m + x) * dx)
        .sum()
}

/// Share of the interior cells, those that carry the fluidity equation, with μ > μ_s.
pub fn yielding_fraction(model: &Model, s: &State) -> f64 {
    let interior = 1..s.n_cells() - 1;
    let count = interior.len() as f64;
    interior.filter(|c| fluidity::yield_excess(model.parameters(), s, *c) > 0.0).count() as f64
        / count
}
