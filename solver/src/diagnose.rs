//! How far a state can be believed, and where its ice goes: budget, strain, inertial number, CFL time
//! step, flags of validity. Solves nothing.

use crate::Model;
use crate::melt::Place;
use crate::params::Parameters;
use crate::physics::local_fluidity_rate;
use crate::state::State;
use crate::transect::wall_strain_rate_per_a;

/// Ice that enters, melts and leaves, m³ a⁻¹.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Budget {
    /// U_c H_t W₀.
    pub inflow_m3_per_a: f64,
    /// ∫ melt·W dx by the cells' values.
    pub melt_m3_per_a: f64,
    /// U_L d W_L.
    pub outflow_m3_per_a: f64,
}

impl Budget {
    /// Of a state whose terminus stands at X₀. W₀ and W_L are the widths at the ends themselves.
    pub fn of(model: &Model, s: &State, terminus_x_m: f64) -> Self {
        let parameters = model.parameters();
        let n = s.n_cells();
        let width = |x_m: f64| model.fjord().width(terminus_x_m + x_m);
        let melted: f64 = (0..n)
            .map(|c| {
                let chi = (c as f64 + 0.5) / n as f64;
                let place = Place { chi, x_m: chi * s.length_m, terminus_x_m };
                model.melt_shape().factor(place) * width(place.x_m) * s.dx_m()
            })
            .sum();
        Self {
            inflow_m3_per_a: parameters.calving_flux_m2_per_a() * width(0.0),
            melt_m3_per_a: melted * parameters.melt_rate_m_per_a(),
            outflow_m3_per_a: s.velocity_m_per_a[n] * parameters.d_m * width(s.length_m),
        }
    }

    /// What a steady state's budget lacks, relative to the inflow.
    ///
    /// The published scheme telescopes over cells 1…N − 1 only, so that the defect measures grid error;
    /// it is reported, not corrected.
    pub fn steady_defect(&self) -> f64 {
        (self.inflow_m3_per_a - self.melt_m3_per_a - self.outflow_m3_per_a) / self.inflow_m3_per_a
    }
}

/// Smallest and largest longitudinal strain rate of any cell but the last, where Eq. 23 makes it 0; a⁻¹.
pub fn strain_rates_per_a(s: &State) -> (f64, f64) {
    (0..s.n_cells() - 1)
        .map(|c| s.strain_rate_per_a(c))
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(min, max), e| (min.min(e), max.max(e)))
}

/// The time step Δx/max|U| of Courant number 1 (Eq. 28), a; infinite where nothing moves.
pub fn cfl_time_step_a(s: &State) -> f64 {
    s.dx_m() / s.velocity_m_per_a.iter().fold(0.0, |fastest: f64, u| fastest.max(u.abs()))
}

/// Largest inertial number I = ε̇_e d/√(P/ρ) of the mélange: of the cells, with |ε̇_xx|, and at the walls
/// of eleven transects, where ε̇_e = μ_w g^y. The rheology is meant for dense flow.
pub fn inertial_number(model: &Model, s: &State, terminus_x_m: f64) -> f64 {
    let p = model.parameters();
    // √(P̃/ρ)/d in a⁻¹.
    let rate = |thickness_m: f64| local_fluidity_rate(p, thickness_m) * p.b;
    let along = (0..s.n_cells()).map(|c| {
        let (g, strain) = (s.fluidity_per_a[c], s.strain_rate_per_a(c));
        strain.abs() / (rate(s.thickness_m[c]) * (g / (g + strain)).sqrt())
    });
    let across = (0..=10).map(|k| {
        let chi = f64::from(k) / 10.0;
        let cell = ((chi * s.n_cells() as f64) as usize).min(s.n_cells() - 1);
        wall_strain_rate_per_a(model, s, terminus_x_m, chi) / rate(s.thickness_m[cell])
    });
    along.chain(across).fold(0.0, f64::max)
}

/// What a state does that the model is not made for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Caveat {
    /// Somewhere the flow is compressional, which the paper's simulations never are (§3.3).
    Compression,
    /// H₀ is less than two icebergs: hardly a pack.
    Thin,
    /// The inertial number leaves the dense regime.
    Inertial,
}

/// Strain rates above this, negative ones, in units of δε̇, are rounding or no matter.
const COMPRESSION: f64 = -1e-3;
/// H₀ in units of d below which a mélange is thin.
const THIN: f64 = 2.0;
/// Inertial number above which granular flow is no longer dense (GDR MiDi 2004, Eur. Phys. J. E 14).
const INERTIAL: f64 = 0.1;

impl Caveat {
    /// Name at every boundary.
    pub fn name(self) -> &'static str {
        match self {
            Self::Compression => "compression",
            Self::Thin => "thin",
            Self::Inertial => "inertial",
        }
    }

    /// Whether a strain rate in a⁻¹ counts as compression.
    pub fn compressed(p: &Parameters, strain_rate_per_a: f64) -> bool {
        strain_rate_per_a < COMPRESSION * p.strain_rate_regularisation_per_a
    }

    /// All that hold of a state, told its [`inertial_number`].
    pub fn of(p: &Parameters, s: &State, inertial_number: f64) -> Vec<Self> {
        let (smallest, _) = strain_rates_per_a(s);
        let holds = [
            (Self::Compression, Self::compressed(p, smallest)),
            (Self::Thin, s.thickness_0_m() < THIN * p.d_m),
            (Self::Inertial, inertial_number > INERTIAL),
        ];
        holds.into_iter().filter_map(|(caveat, holds)| holds.then_some(caveat)).collect()
    }
}
