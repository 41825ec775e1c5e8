//! The glacier terminus as the mélange meets it: how fast it calves, how thick it is and where it
//! stands, given or by a calving law within the time step. Knows the force, no other equation.

use super::Sink;
use crate::force::static_force_n_per_m;
use crate::params::Parameters;
use crate::state::{State, Var};

/// U_c = α₀ − αF − βX₀ and H_t = H_t0 − β_H X₀, with F the buttressing force per width (Eq. 30) and X₀
/// the terminus' position. Eq. 31 of the paper is α₀ = 2U_c,ss, α = U_c,ss/F_ss.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CalvingLaw {
    /// α₀, m a⁻¹.
    pub rate_m_per_a: f64,
    /// α, m² a⁻¹ N⁻¹.
    pub per_force_m2_per_a_n: f64,
    /// β, a⁻¹.
    pub per_advance_per_a: f64,
    /// β_H.
    pub thickness_per_advance: f64,
}

impl CalvingLaw {
    /// Eq. 31: U_c = 2U_c,ss − U_c,ss F/F_ss.
    pub fn steady_feedback(steady_rate_m_per_a: f64, steady_force_n_per_m: f64) -> Self {
        Self {
            rate_m_per_a: 2.0 * steady_rate_m_per_a,
            per_force_m2_per_a_n: steady_rate_m_per_a / steady_force_n_per_m,
            per_advance_per_a: 0.0,
            thickness_per_advance: 0.0,
        }
    }

    /// H_t in m, for H_t0 in m and X₀ in m.
    pub fn thickness_m(&self, thickness_m: f64, terminus_x_m: f64) -> f64 {
        thickness_m - self.thickness_per_advance * terminus_x_m
    }

    /// U_c in m a⁻¹ at a force in N m⁻¹ and a position in m. A law that asks for a negative rate gets 0:
    /// calving stops, ice does not grow out of the mélange.
    pub fn rate_m_per_a(&self, force_n_per_m: f64, terminus_x_m: f64) -> f64 {
        let rate = self.rate_m_per_a
            - self.per_force_m2_per_a_n * force_n_per_m
            - self.per_advance_per_a * terminus_x_m;
        rate.max(0.0)
    }
}

/// How the terminus moves and calves during a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Advance {
    /// X₀ but for the advance within the step, m.
    pub from_x_m: f64,
    /// Length of the step, a; 0 where nothing moves.
    pub step_a: f64,
    /// The law that sets the calving rate; none where the parameters give it.
    pub law: Option<CalvingLaw>,
}

impl Advance {
    /// A terminus that stands at X₀ and calves as the parameters say.
    pub fn fixed(terminus_x_m: f64) -> Self {
        Self { from_x_m: terminus_x_m, step_a: 0.0, law: None }
    }

    /// The terminus at a state that solves the step.
    pub fn terminus(&self, p: &Parameters, s: &State) -> Option<Terminus> {
        Terminus::at(self, p, s, &mut Nowhere)
    }
}

/// Takes no slopes.
struct Nowhere;

impl Sink for Nowhere {
    fn residual(&mut self, _: Var, _: f64) {}
    fn slope(&mut self, _: Var, _: Var, _: f64) {}
}

/// The terminus at the state in hand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Terminus {
    /// U_c, m a⁻¹.
    pub calving_rate_m_per_a: f64,
    /// U_t − U_c, m a⁻¹: how fast the terminus moves, and the walls past it.
    pub advance_m_per_a: f64,
    /// H_t, m.
    pub thickness_m: f64,
    /// X₀, m.
    pub x_m: f64,
    /// Whether a law sets U_c at this state, so that its slopes matter.
    pub is_coupled: bool,
    x_by_calving: f64,
    thickness_by_x: f64,
}

impl Terminus {
    /// Solves the law for U_c at the state's force, with X₀ = `from_x_m` + step·(U_t − U_c); reports
    /// ∂U_c/∂(state). None where the law, linear in U_c, has no solution that a longer step connects
    /// with (1 − β·step ≤ 0), or leaves no ice at the terminus.
    pub(super) fn at<S: Sink>(
        advance: &Advance,
        p: &Parameters,
        s: &State,
        out: &mut S,
    ) -> Option<Self> {
        let mut terminus = Self {
            calving_rate_m_per_a: p.calving_rate_m_per_a,
            advance_m_per_a: 0.0,
            thickness_m: p.terminus_thickness_m,
            x_m: 0.0,
            is_coupled: false,
            x_by_calving: 0.0,
            thickness_by_x: 0.0,
        };
        if let Some(law) = &advance.law {
            let per_calving = 1.0 - law.per_advance_per_a * advance.step_a;
            if per_calving <= 0.0 {
                return None;
            }
            let unmoved_x_m = advance.from_x_m + advance.step_a * p.terminus_velocity_m_per_a;
            let force = Force::at(s);
            let asked_for = law.rate_m_per_a
                - law.per_force_m2_per_a_n * force.value
                - law.per_advance_per_a * unmoved_x_m;
            terminus.is_coupled = asked_for > 0.0;
            terminus.calving_rate_m_per_a = asked_for.max(0.0) / per_calving;
            terminus.thickness_by_x = -law.thickness_per_advance;
            if terminus.is_coupled {
                terminus.x_by_calving = -advance.step_a;
                force.slopes(s, -law.per_force_m2_per_a_n / per_calving, out);
            }
        }
        terminus.advance_m_per_a = p.terminus_velocity_m_per_a - terminus.calving_rate_m_per_a;
        terminus.x_m = advance.from_x_m + advance.step_a * terminus.advance_m_per_a;
        terminus.thickness_m += terminus.thickness_by_x * terminus.x_m;
        (terminus.thickness_m > 0.0).then_some(terminus)
    }

    /// U_c H_t in m² a⁻¹ (numerator of Eq. 22) and its slope by U_c in m.
    pub fn flux_m2_per_a(&self) -> (f64, f64) {
        let flux = self.calving_rate_m_per_a * self.thickness_m;
        let by_calving =
            self.thickness_m + self.calving_rate_m_per_a * self.thickness_by_x * self.x_by_calving;
        (flux, by_calving)
    }

    /// ∂X₀/∂U_c, a; 0 where no law sets U_c.
    pub fn x_by_calving_a(&self) -> f64 {
        self.x_by_calving
    }
}

/// F/W of Eq. 30 and its slopes.
pub(crate) struct Force {
    value: f64,
    by_h0: f64,
    by_strain: f64,
    by_g: f64,
}

impl Force {
    pub(crate) fn at(s: &State) -> Self {
        let (h0, g, strain) = (s.thickness_0_m(), s.fluidity_per_a[0], s.strain_rate_per_a(0));
        let at_rest = static_force_n_per_m(h0);
        let q = 1.0 / (g + strain);
        let value = at_rest * (1.0 - 2.0 * strain * q);
        Self {
            value,
            by_h0: 2.0 * value / h0,
            by_strain: -2.0 * at_rest * g * q * q,
            by_g: 2.0 * at_rest * strain * q * q,
        }
    }

    /// Slopes of a calving rate by F, as those of the law's row.
    pub(crate) fn slopes<S: Sink>(&self, s: &State, calving_by_force: f64, out: &mut S) {
        let row = Var::Calving;
        let by_velocity = calving_by_force * self.by_strain / s.dx_m();
        out.slope(row, Var::H(0), 1.5 * calving_by_force * self.by_h0);
        out.slope(row, Var::H(1), -0.5 * calving_by_force * self.by_h0);
        out.slope(row, Var::G(0), calving_by_force * self.by_g);
        out.slope(row, Var::U(0), -by_velocity);
        out.slope(row, Var::U(1), by_velocity);
        let by_length = -self.by_strain * s.strain_rate_per_a(0) / s.length_m;
        out.slope(row, Var::L, calving_by_force * by_length);
    }
}
