//! Speed and fluidity across the fjord at a place in a state: what the transverse problem of
//! [`crate::physics::sidewall`] leaves behind when it is solved for its mean. Changes no state.

use crate::Model;
use crate::params::Parameters;
use crate::physics::local_fluidity_rate;
use crate::physics::sidewall::{INTERVALS, Section};
use crate::state::State;

/// A transect from the wall (y = 0) to the centre of the fjord, on M + 1 = 101 points.
#[derive(Debug, Clone, PartialEq)]
pub struct Transect {
    /// χ, share of the mélange's length.
    pub chi: f64,
    /// x from the terminus, m.
    pub x_m: f64,
    /// W, m.
    pub width_m: f64,
    /// μ_w.
    pub mu_w: f64,
    /// y: \[M+1\] m.
    pub y_m: Vec<f64>,
    /// u relative to the walls: \[M+1\] m a⁻¹, signed like μ_w.
    pub velocity_m_per_a: Vec<f64>,
    /// g^y: \[M+1\] a⁻¹.
    pub fluidity_per_a: Vec<f64>,
}

/// g^y (C5) and u (C6) of a section. At χ between two nodes μ_w, H and W are those of the nodes,
/// interpolated; `terminus_x_m` is X₀. χ is from 0 to 1.
pub fn transect(model: &Model, s: &State, terminus_x_m: f64, chi: f64) -> Transect {
    let section = section_at(model, s, terminus_x_m, chi);
    let fluidity_per_a = fluidity(model.parameters(), section);
    let (y_m, velocity_m_per_a) = velocity(section, &fluidity_per_a);
    Transect {
        chi,
        x_m: chi * s.length_m,
        width_m: section.width_m,
        mu_w: section.mu_w,
        y_m,
        velocity_m_per_a,
        fluidity_per_a: fluidity_per_a.to_vec(),
    }
}

/// ε̇_e = |μ_w| g^y at the wall, a⁻¹; arguments as for [`transect()`].
pub fn wall_strain_rate_per_a(model: &Model, s: &State, terminus_x_m: f64, chi: f64) -> f64 {
    let section = section_at(model, s, terminus_x_m, chi);
    section.mu_w.abs() * fluidity(model.parameters(), section)[0]
}

/// The section at χ, between those of the nodes beside it.
fn section_at(model: &Model, s: &State, terminus_x_m: f64, chi: f64) -> Section {
    let n = s.n_cells();
    let place = chi * n as f64;
    let left = (place.floor() as usize).min(n - 1);
    let share = place - left as f64;
    let between = |a: f64, b: f64| a + share * (b - a);
    let [a, b] = [left, left + 1].map(|node| section(model, s, terminus_x_m, node));
    Section {
        mu_w: between(a.mu_w, b.mu_w),
        thickness_m: between(a.thickness_m, b.thickness_m),
        width_m: between(a.width_m, b.width_m),
    }
}

/// The section of a node: H and W of the nearest cells, H extrapolated at the ends.
fn section(model: &Model, s: &State, terminus_x_m: f64, node: usize) -> Section {
    let n = s.n_cells();
    let beside = [node.saturating_sub(1), node.min(n - 1)];
    let width =
        |c: usize| model.fjord().width(terminus_x_m + s.length_m * (c as f64 + 0.5) / n as f64);
    let thickness_m = match node {
        0 => s.thickness_0_m(),
        _ if node == n => s.thickness_end_m(),
        _ => 0.5 * (s.thickness_m[beside[0]] + s.thickness_m[beside[1]]),
    };
    let width_m = 0.5 * (width(beside[0]) + width(beside[1]));
    Section { mu_w: s.mu_w[node], thickness_m, width_m }
}

/// |μ| of a section, from the wall to the centre.
fn stress_ratios(section: Section) -> [f64; INTERVALS + 1] {
    std::array::from_fn(|m| section.mu_w.abs() * (1.0 - m as f64 / INTERVALS as f64))
}

/// Δy of a section, m.
fn dy_m(section: Section) -> f64 {
    section.width_m / (2.0 * INTERVALS as f64)
}

/// g^y of a section: tridiagonal elimination of C5.
fn fluidity(p: &Parameters, section: Section) -> [f64; INTERVALS + 1] {
    const M: usize = INTERVALS;
    let kappa = (dy_m(section) / (p.A * p.d_m)).powi(2);
    let mu = stress_ratios(section);
    let unit = local_fluidity_rate(p, section.thickness_m);
    let mut g = [0.0; M + 1];
    let mut inverse = [0.0; M + 1];
    for m in 1..M {
        let excess = mu[m] - p.mu_s;
        let source = kappa * excess.abs() * unit * excess.max(0.0) / mu[m];
        let diagonal = if m == 1 || m == M - 1 { 1.0 } else { 2.0 };
        inverse[m] = 1.0 / (diagonal + kappa * excess.abs() - inverse[m - 1]);
        g[m] = (source + g[m - 1]) * inverse[m];
    }
    g[M] = 0.0;
    for m in (1..M).rev() {
        let next = if m == M - 1 { 0.0 } else { g[m + 1] };
        g[m] += inverse[m] * next;
    }
    (g[0], g[M]) = (g[1], g[M - 1]);
    g
}

/// y and u of a section: the differences of C6, upwards from the wall over the even points and back over the odd
/// ones from u_{M−1} = u_M.
fn velocity(section: Section, g: &[f64; INTERVALS + 1]) -> (Vec<f64>, Vec<f64>) {
    const M: usize = INTERVALS;
    let (dy, mu) = (dy_m(section), stress_ratios(section));
    let rise = |m: usize| 4.0 * dy * mu[m] * g[m] * section.mu_w.signum();
    let mut u = [0.0; M + 1];
    for m in (1..M).step_by(2) {
        u[m + 1] = u[m - 1] + rise(m);
    }
    u[M - 1] = u[M];
    for m in (2..M - 1).rev().step_by(2) {
        u[m - 1] = u[m + 1] - rise(m);
    }
    ((0..=M).map(|m| m as f64 * dy).collect(), u.to_vec())
}
