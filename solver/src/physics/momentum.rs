//! Width-integrated balance of stresses: residual and Jacobian rows. Knows no other equation.

use super::given::Given;
use super::{Medium, Sink};
use crate::params::{GRAVITY, ICE_DENSITY, Parameters, WATER_DENSITY};
use crate::state::{State, Var};

/// Longitudinal stress H²ε̇/(g + ε̇) of a cell (C3) and its slopes.
struct Stress {
    value: f64,
    by_h: f64,
    by_g: f64,
    by_strain: f64,
}

fn stress(s: &State, c: usize) -> Stress {
    let (h, g, strain) = (s.thickness_m[c], s.fluidity_per_a[c], s.strain_rate_per_a(c));
    let q = 1.0 / (g + strain);
    Stress {
        value: h * h * strain * q,
        by_h: 2.0 * h * strain * q,
        by_g: -h * h * strain * q * q,
        by_strain: h * h * g * q * q,
    }
}

/// ρg(1 − ρ/ρ_w) = 971.34 N m⁻³, by which the stress balance is divided.
pub const STRESS_UNIT_N_PER_M3: f64 = ICE_DENSITY * GRAVITY * (1.0 - ICE_DENSITY / WATER_DENSITY);

/// Stress balance, Eq. 21 as C2, divided by ρg(1 − ρ/ρ_w); rows of the nodes, in m.
///
/// Drag of the water, D in N per metre of width over the whole length, acts against the down-fjord
/// motion as D/L per area: D/(ρg(1 − ρ/ρ_w)L) in these units.
///
/// Node 0 carries Eq. 22, U₀H₀ = U_cH_t with H₀ extrapolated; node N carries Eq. 23. The sign of
/// Eq. 21's last term is that of μ_w, which is signed like the velocity relative to the walls.
/// U: \[N+1\] m a⁻¹ and μ_w: \[N+1\] at nodes; H: \[N\] m and g: \[N\] a⁻¹ in cells.
pub fn residual<S: Sink>(m: &Medium, s: &State, out: &mut S) {
    let n = s.n_cells();
    let dx = s.dx_m();
    let h0 = s.thickness_0_m();
    let (flux, flux_by_calving) = m.terminus.flux_m2_per_a();
    let inflow = flux / h0;
    out.residual(Var::U(0), s.velocity_m_per_a[0] - inflow);
    out.slope(Var::U(0), Var::U(0), 1.0);
    out.slope(Var::U(0), Var::H(0), 1.5 * inflow / h0);
    out.slope(Var::U(0), Var::H(1), -0.5 * inflow / h0);
    out.given(Var::U(0), Given::CalvingRate, -m.terminus.thickness_m / h0);
    out.given(Var::U(0), Given::TerminusThickness, -m.terminus.calving_rate_m_per_a / h0);
    if m.terminus.is_coupled {
        out.slope(Var::U(0), Var::Calving, -flux_by_calving / h0);
    }

    let water_by_drag = 1.0 / (STRESS_UNIT_N_PER_M3 * s.length_m);
    let water = m.parameters.water_drag_n_per_m * water_by_drag;
    let mut left = stress(s, 0);
    for j in 1..n {
        let row = Var::U(j);
        let right = stress(s, j);
        let (h_left, h_right) = (s.thickness_m[j - 1], s.thickness_m[j]);
        let mean_h = 0.5 * (h_left + h_right);
        let mean_w = m.node_width(j);
        let mu = s.mu_w[j];
        let pull = (right.value - left.value) / dx;
        let slope = mean_h * (h_right - h_left) / dx;
        let drag = mean_h * mean_h * mu / mean_w;
        out.residual(row, pull - slope - drag - water);

        out.slope(row, Var::U(j - 1), left.by_strain / (dx * dx));
        out.slope(row, Var::U(j), -(left.by_strain + right.by_strain) / (dx * dx));
        out.slope(row, Var::U(j + 1), right.by_strain / (dx * dx));
        out.slope(row, Var::G(j - 1), -left.by_g / dx);
        out.slope(row, Var::G(j), right.by_g / dx);
        let drag_by_h = mean_h * mu / mean_w;
        out.slope(row, Var::H(j - 1), -left.by_h / dx + h_left / dx - drag_by_h);
        out.slope(row, Var::H(j), right.by_h / dx - h_right / dx - drag_by_h);
        out.slope(row, Var::Mu(j), -mean_h * mean_h / mean_w);
        let strain_left = s.strain_rate_per_a(j - 1);
        let strain_right = s.strain_rate_per_a(j);
        let stretch = (right.by_strain * strain_right - left.by_strain * strain_left) / dx;
        out.slope(row, Var::L, (slope - pull - stretch + water) / s.length_m);
        m.slope_by_node_width(row, j, drag / mean_w, out);
        out.given(row, Given::WaterDrag, -water_by_drag);
        left = right;
    }

    out.residual(Var::U(n), s.velocity_m_per_a[n] - s.velocity_m_per_a[n - 1]);
    out.slope(Var::U(n), Var::U(n), 1.0);
    out.slope(Var::U(n), Var::U(n - 1), -1.0);
}

/// The sign of μ_w at each node of a state of which |μ_w| is known: 1 or −1. Friction takes what Eq. 21
/// leaves of the stresses, also where the ice sticks to the walls and no speed tells its sign. At the
/// terminus it is that of ū₀ = U₀ + U_t − U_c, with U_c by Eq. 22; at the end, that of the node before, whose
/// velocity is the same by Eq. 23.
pub fn friction_signs(p: &Parameters, s: &State) -> Vec<f64> {
    let n = s.n_cells();
    let dx = s.dx_m();
    let water = p.water_drag_n_per_m / (STRESS_UNIT_N_PER_M3 * s.length_m);
    let share = 1.0 - s.thickness_0_m() / p.terminus_thickness_m;
    let speed_0 = p.terminus_velocity_m_per_a + s.velocity_m_per_a[0] * share;
    let mut signs = vec![1.0_f64.copysign(speed_0)];
    for j in 1..n {
        let (h_left, h_right) = (s.thickness_m[j - 1], s.thickness_m[j]);
        let pull = (stress(s, j).value - stress(s, j - 1).value) / dx;
        let slope = 0.5 * (h_left + h_right) * (h_right - h_left) / dx;
        signs.push(1.0_f64.copysign(pull - slope - water));
    }
    signs.push(signs[n - 1]);
    signs
}
