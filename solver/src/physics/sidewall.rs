//! The transverse problem: what friction at the walls a mean speed needs. Residual and Jacobian rows
//! of μ_w. Knows no other equation.
//!
//! Per node (Eqs. 16, 24–26, C5, C6): M = 100 intervals over the half width, y from the wall,
//! μ = μ_w(1 − 2y/W). In s = 2y/W the fluidity is g^y = R·φ with R = √(P̃/ρ)/(d b), and φ solves
//!
//! ```text
//!   φ_{m−1} − 2φ_m + φ_{m+1} = κ|μ_m − μ_s| (φ_m − (μ_m − μ_s)₊/μ_m),   κ = (W/(2M·A·d))²
//!   φ₀ = φ₁, φ_M = φ_{M−1};   u_{m+1} − u_{m−1} = 4Δy μ_m g_m, u₀ = 0, u_M = u_{M−1}
//! ```
//!
//! so that the mean by composite Simpson is ū = (2W/M) R Ψ(μ_w, κ), Ψ = Σ c_m μ_m φ_m with constant
//! weights c. Its slopes cost one adjoint solve. The sections are independent: eight go side by
//! side through each loop, which the compiler turns into vector instructions.

use super::given::Given;
use super::{Medium, Sink, local_fluidity_rate};
use crate::params::Parameters;
use crate::state::{State, Var};

/// Intervals over the half width.
pub const INTERVALS: usize = 100;
const LANES: usize = 8;
const INNER: usize = INTERVALS - 1;
type Lane = [f64; LANES];

/// Weights c_m of Ψ for m = 1…M − 1: composite Simpson of the two interleaved sums of C6.
///
/// An odd m lifts the even points beyond it and, through u_{M−1} = u_M, all odd points; an even m
/// lowers the odd points before it.
const WEIGHTS: [f64; INNER] = {
    let mut weights = [0.0; INNER];
    let mut i = 0;
    while i < INNER {
        let m = (i + 1) as f64;
        let simpson = if i % 2 == 0 { 3.0 * INTERVALS as f64 - m } else { -2.0 * m };
        weights[i] = simpson / (3.0 * INTERVALS as f64);
        i += 1;
    }
    weights
};

/// Mean speed of a transect relative to the walls, and its slopes.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct MeanSpeed {
    /// ū, m a⁻¹, signed like μ_w.
    pub speed: f64,
    /// ∂ū/∂μ_w, m a⁻¹.
    pub by_mu: f64,
    /// ∂ū/∂H, a⁻¹.
    pub by_h: f64,
    /// ∂ū/∂W, a⁻¹.
    pub by_w: f64,
    /// κ ∂ū/∂κ, m a⁻¹, through which A and d act.
    pub by_log_kappa: f64,
}

impl MeanSpeed {
    /// Slopes of a row that ū is added to and U + U_t − U_c subtracted from, by what is given. Ψ is
    /// homogeneous, Ψ(λμ_w, λμ_s, κ/λ) = λΨ, so that μ_w Ψ_μ + μ_s ∂Ψ/∂μ_s − κΨ_κ = Ψ.
    #[inline(always)]
    fn slopes_by_given<S: Sink>(&self, p: &Parameters, mu_w: f64, row: Var, out: &mut S) {
        out.given(row, Given::TerminusVelocity, -1.0);
        out.given(row, Given::CalvingRate, 1.0);
        out.given(row, Given::B, -self.speed / p.b);
        out.given(row, Given::A, -2.0 * self.by_log_kappa / p.A);
        out.given(row, Given::IcebergSize, -(self.speed + 2.0 * self.by_log_kappa) / p.d_m);
        let by_mu_s = (self.speed + self.by_log_kappa - mu_w * self.by_mu) / p.mu_s;
        out.given(row, Given::MuS, by_mu_s);
    }
}

/// One transect: signed μ_w, thickness and width in m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Section {
    /// μ_w, signed.
    pub mu_w: f64,
    /// H, m.
    pub thickness_m: f64,
    /// W, m.
    pub width_m: f64,
}

/// κμ_s up to which ū(μ_w) increases everywhere, whatever μ_s (found by a scan: it falls by 0.2 % in
/// places at 600, by 6 % at 3e4). Beyond, a transect's layer between flow and rest is thinner than
/// Δy, and φ of the point that crosses it peaks, so that a speed has several μ_w.
const RESOLVED: f64 = 300.0;

/// κ = (W/(2M·A·d))².
fn kappa(p: &Parameters, width_m: f64) -> f64 {
    (width_m / (2.0 * INTERVALS as f64 * p.A * p.d_m)).powi(2)
}

/// The ε that applies to the transects.
fn applied(p: &Parameters, smoothing: f64) -> f64 {
    let is_resolved = kappa(p, p.width_m) * p.mu_s <= RESOLVED;
    if is_resolved { 0.0 } else { smoothing }
}

/// Below this |μ_w| no interior point yields and ū is zero; where the kink is rounded, there is no such
/// bound but 0.
pub fn threshold(p: &Parameters, smoothing: f64) -> f64 {
    if applied(p, smoothing) > 0.0 { 0.0 } else { p.mu_s / (1.0 - 1.0 / INTERVALS as f64) }
}

/// Mean speeds of all sections, Eq. 26 as C6. `out` has the sections' length.
///
/// Where ū(μ_w) may decrease, `smoothing` = ε rounds its kinks as those of the longitudinal fluidity,
/// |1 − μ_s/μ| → √((1 − μ_s/μ)² + ε²); the model itself has ε = 0.
pub fn mean_speeds(p: &Parameters, smoothing: f64, sections: &[Section], out: &mut [MeanSpeed]) {
    let smoothing = applied(p, smoothing);
    let arch = pulp::Arch::new();
    let mut sweep = [Swept::default(); INNER];
    for (sections, out) in sections.chunks(LANES).zip(out.chunks_mut(LANES)) {
        let mut mu = [1.0; LANES];
        let mut kappa = [1.0; LANES];
        for (l, s) in sections.iter().enumerate() {
            mu[l] = s.mu_w.abs();
            kappa[l] = self::kappa(p, s.width_m);
        }
        let [psi, by_mu, by_kappa] =
            arch.dispatch(Flow { mu_s: p.mu_s, smoothing, mu_w: mu, kappa, sweep: &mut sweep });
        for (l, (s, out)) in sections.iter().zip(out).enumerate() {
            let unit = 2.0 * s.width_m / INTERVALS as f64 * local_fluidity_rate(p, s.thickness_m);
            let unit_signed = unit * s.mu_w.signum();
            let speed = unit_signed * psi[l];
            let by_log_kappa = unit_signed * by_kappa[l] * kappa[l];
            *out = MeanSpeed {
                speed,
                by_mu: unit * by_mu[l],
                by_h: 0.5 * speed / s.thickness_m,
                by_w: (speed + 2.0 * by_log_kappa) / s.width_m,
                by_log_kappa,
            };
        }
    }
}

/// Shares 1 − m/M of μ_w at the interior points, and their inverses.
const SHARES: [[f64; 2]; INNER] = {
    let mut shares = [[0.0; 2]; INNER];
    let mut i = 0;
    while i < INNER {
        let share = 1.0 - (i + 1) as f64 / INTERVALS as f64;
        shares[i] = [share, 1.0 / share];
        i += 1;
    }
    shares
};

/// What the forward sweep leaves for the backward one, at one point of eight sections.
#[derive(Debug, Clone, Copy, Default)]
struct Swept {
    inverse: Lane,
    phi: Lane,
    lambda: Lane,
}

/// Eight sections, for which Ψ, ∂Ψ/∂μ_w and ∂Ψ/∂κ are wanted; compiled for each instruction set.
struct Flow<'a> {
    mu_s: f64,
    smoothing: f64,
    mu_w: Lane,
    kappa: Lane,
    sweep: &'a mut [Swept; INNER],
}

impl pulp::WithSimd for Flow<'_> {
    type Output = [Lane; 3];

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) -> [Lane; 3] {
        let Self { mu_s, smoothing, mu_w, kappa, sweep } = self;
        if smoothing == 0.0 {
            flow(|mu, inverse| kink(mu, inverse, mu_s), &mu_w, &kappa, sweep)
        } else {
            flow(|mu, inverse| rounded_kink(mu, inverse, mu_s, smoothing), &mu_w, &kappa, sweep)
        }
    }
}

/// What one point's μ makes of the kinks: |μ − μ_s|, (μ − μ_s)₊/μ, and the slopes by μ of the first and
/// of their product, as they are or rounded.
struct Kink {
    distance: f64,
    ratio: f64,
    distance_by_mu: f64,
    product_by_mu: f64,
}

#[inline(always)]
fn kink(mu: f64, inverse_mu: f64, mu_s: f64) -> Kink {
    let excess = mu - mu_s;
    let ratio = positive_part(excess) * inverse_mu;
    Kink {
        distance: excess.abs(),
        ratio,
        distance_by_mu: if excess > 0.0 { 1.0 } else { -1.0 },
        product_by_mu: ratio * (2.0 - ratio),
    }
}

#[inline(always)]
fn rounded_kink(mu: f64, inverse_mu: f64, mu_s: f64, smoothing: f64) -> Kink {
    let q = 1.0 - mu_s * inverse_mu;
    let distance = (q * q + smoothing * smoothing).sqrt();
    let ratio = 0.5 * (q + distance);
    let side = q / distance;
    Kink {
        distance: mu * distance,
        ratio,
        distance_by_mu: distance + side * (1.0 - q),
        product_by_mu: ratio * (distance + (1.0 + side) * (1.0 - q)),
    }
}

#[inline(always)]
fn flow(
    kink: impl Fn(f64, f64) -> Kink,
    mu_w: &Lane,
    kappa: &Lane,
    sweep: &mut [Swept; INNER],
) -> [Lane; 3] {
    // 1/μ by one division per section; the pivots are the only divisions of the loops.
    let inverse_mu_w = mu_w.map(|mu| 1.0 / mu);
    // Forward sweep of φ and of the adjoint λ, whose right-hand side is c·μ.
    let (mut last_inverse, mut last_phi, mut last_lambda) =
        ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
    for m in 0..INNER {
        let [share, inverse_share] = SHARES[m];
        let diagonal = if m == 0 || m == INNER - 1 { 1.0 } else { 2.0 };
        for l in 0..LANES {
            let mu = mu_w[l] * share;
            let Kink { distance, ratio, .. } = kink(mu, inverse_mu_w[l] * inverse_share);
            let coupling = kappa[l] * distance;
            let pivot = 1.0 / (diagonal + coupling - last_inverse[l]);
            last_phi[l] = (coupling * ratio + last_phi[l]) * pivot;
            last_lambda[l] = (WEIGHTS[m] * mu + last_lambda[l]) * pivot;
            last_inverse[l] = pivot;
        }
        sweep[m] = Swept { inverse: last_inverse, phi: last_phi, lambda: last_lambda };
    }
    // Backward sweep; Ψ and its slopes are summed on the way.
    let mut sums = [[0.0; LANES]; 3];
    let (mut next_phi, mut next_lambda) = ([0.0; LANES], [0.0; LANES]);
    for m in (0..INNER).rev() {
        let [share, inverse_share] = SHARES[m];
        let Swept { inverse, phi, lambda } = sweep[m];
        for l in 0..LANES {
            let mu = mu_w[l] * share;
            let point = kink(mu, inverse_mu_w[l] * inverse_share);
            next_phi[l] = phi[l] + inverse[l] * next_phi[l];
            next_lambda[l] = lambda[l] + inverse[l] * next_lambda[l];
            let by_mu = point.product_by_mu - point.distance_by_mu * next_phi[l];
            sums[0][l] += WEIGHTS[m] * mu * next_phi[l];
            sums[1][l] += share * (WEIGHTS[m] * next_phi[l] + next_lambda[l] * kappa[l] * by_mu);
            sums[2][l] += next_lambda[l] * point.distance * (point.ratio - next_phi[l]);
        }
    }
    sums
}

/// Unlike `f64::max`, one instruction.
#[inline(always)]
fn positive_part(x: f64) -> f64 {
    if x > 0.0 { x } else { 0.0 }
}

/// The μ_w that gives each section its speed (signed, m a⁻¹): Newton on the increasing ū(μ_w),
/// kept between bounds, to a relative `tolerance` of μ_w. `sections` gives H and W, and receives μ_w.
pub fn friction_for(p: &Parameters, speeds: &[f64], sections: &mut [Section], tolerance: f64) {
    const ITERATIONS: usize = 80;
    let floor = threshold(p, 0.0);
    let mut bounds = vec![(floor, f64::INFINITY); sections.len()];
    let mut found = vec![MeanSpeed::default(); sections.len()];
    for (section, speed) in sections.iter_mut().zip(speeds) {
        section.mu_w = (2.0 * floor).copysign(*speed);
    }
    for _ in 0..ITERATIONS {
        mean_speeds(p, 0.0, sections, &mut found);
        let mut largest_change = 0.0_f64;
        for (((section, speed), found), (low, high)) in
            sections.iter_mut().zip(speeds).zip(&found).zip(&mut bounds)
        {
            let mu = section.mu_w.abs();
            let miss = found.speed.abs() - speed.abs();
            if miss > 0.0 {
                *high = mu
            } else {
                *low = mu
            }
            let mut next = mu - miss / found.by_mu;
            if !(next > *low && next < *high) {
                next = if high.is_finite() { 0.5 * (*low + *high) } else { 4.0 * mu };
            }
            largest_change = largest_change.max((next - mu).abs() / mu);
            section.mu_w = next.copysign(*speed);
        }
        if largest_change < tolerance {
            break;
        }
    }
}

/// The sections of a state: W of the nearest cells and H extrapolated at the ends, means elsewhere.
pub fn sections(m: &Medium, s: &State, out: &mut [Section]) {
    let n = s.n_cells();
    for (j, section) in out.iter_mut().enumerate() {
        let thickness_m = match j {
            0 => s.thickness_0_m(),
            _ if j == n => s.thickness_end_m(),
            _ => 0.5 * (s.thickness_m[j - 1] + s.thickness_m[j]),
        };
        *section = Section { mu_w: s.mu_w[j], thickness_m, width_m: m.node_width(j) };
    }
}

/// The cells whose thickness a node's transect has: its neighbours, the last two of an end.
#[inline]
pub(super) fn cells_beside(node: usize, n_cells: usize) -> [usize; 2] {
    match node {
        0 => [0, 1],
        _ if node == n_cells => [n_cells - 1, n_cells - 2],
        _ => [node - 1, node],
    }
}

/// ū(μ_w) − (U + U_t − U_c) = 0, Eq. 26 as C6; rows of the nodes, in m a⁻¹.
///
/// `speeds`: \[N+1\], of the state's [`sections`].
pub fn residual<S: Sink>(m: &Medium, s: &State, speeds: &[MeanSpeed], out: &mut S) {
    let n = s.n_cells();
    for (j, mean) in speeds.iter().enumerate() {
        let row = Var::Mu(j);
        let (lag, rate) =
            m.relaxation.map_or((0.0, 0.0), |r| (s.mu_w[j] - r.mu_w[j], r.speed_per_mu));
        let sought = s.velocity_m_per_a[j] + m.terminus.advance_m_per_a;
        out.residual(row, mean.speed - sought + rate * lag);
        out.slope(row, Var::U(j), -1.0);
        out.slope(row, Var::Mu(j), mean.by_mu + rate);
        let shares = if j == 0 || j == n { [1.5, -0.5] } else { [0.5, 0.5] };
        for (cell, share) in cells_beside(j, n).into_iter().zip(shares) {
            out.slope(row, Var::H(cell), mean.by_h * share);
        }
        m.slope_by_node_width(row, j, mean.by_w, out);
        mean.slopes_by_given(m.parameters, s.mu_w[j], row, out);
        if m.terminus.is_coupled {
            out.slope(row, Var::Calving, 1.0);
        }
    }
}
