//! Growth rates of small perturbations of a steady state. Knows the equations by their Jacobian and by what
//! stands under a time derivative.
//!
//! The linearised problem is M δẋ = −J δx, and M is singular: of the unknowns only H and L stand under a
//! time derivative, in the mass rows of the cells but the first, δḢ_c − χ_c (∂H/∂x)_c δL̇ (Eq. 27). With those
//! N − 1 combinations z = Kδx and E the unit vectors of their rows, M = EK, and with any number s
//!
//! ```text
//!   δẋ = λδx  ⇒  (J + sM) δx = (s − λ) EKδx  ⇒  z = (s − λ) K (J + sM)⁻¹ E z,
//! ```
//!
//! so that the N − 1 finite eigenvalues λ are s minus the inverses of those of the dense matrix
//! K (J + sM)⁻¹ E. With s > 0 that matrix is regular at folds, where J is not.

use crate::newton::Linear;
use crate::physics::continuity::storage_by_length;
use crate::physics::jacobian::Jacobian;
use crate::state::{State, Var, scale, unknowns};

/// s: of the size of growth rates that matter, and none of them but by chance; a⁻¹.
const SHIFT_PER_A: f64 = 0.7;

/// A growth rate: real and imaginary part, a⁻¹.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GrowthRate {
    /// Growth, a⁻¹; decay where negative.
    pub re_per_a: f64,
    /// Angular frequency, a⁻¹; 0 where the perturbation does not swing.
    pub im_per_a: f64,
}

/// The growth rates of a steady state.
#[derive(Debug, Clone, PartialEq)]
pub struct Spectrum {
    /// All N − 1, the fastest growing first.
    pub rates: Vec<GrowthRate>,
}

impl Spectrum {
    /// Number of perturbations that grow.
    pub fn unstable(&self) -> usize {
        self.rates.iter().filter(|rate| rate.re_per_a > 0.0).count()
    }

    /// Whether every perturbation decays.
    pub fn is_stable(&self) -> bool {
        self.unstable() == 0
    }

    /// Of the steady state at which the Jacobian was assembled; none if the growth rate happens to be s.
    pub(crate) fn of(mut jacobian: Jacobian, s: &State) -> Option<Self> {
        let n = s.n_cells();
        let place = |var: Var| var.index(n).expect("only a calving rate has no place");
        let mut matrix = faer::Mat::<f64>::zeros(n - 1, n - 1);
        let mut column = vec![0.0; unknowns(n)];
        let by_length: Vec<f64> = (1..n).map(|c| storage_by_length(s, c)).collect();
        for (k, by_length) in by_length.iter().enumerate() {
            let row = Var::H(k + 1);
            for (by, value) in [(row, 1.0), (Var::L, *by_length)] {
                let scaled = SHIFT_PER_A * value * by.scale() / scale::MASS_BALANCE;
                jacobian.add(row, by, scaled);
            }
        }
        jacobian.factorise().ok()?;
        for c in 1..n {
            column.fill(0.0);
            column[place(Var::H(c))] = 1.0 / scale::MASS_BALANCE;
            jacobian.solve(&mut column);
            let length_m = column[place(Var::L)] * scale::LENGTH;
            for (k, by_length) in by_length.iter().enumerate() {
                let thickness_m = column[place(Var::H(k + 1))] * scale::THICKNESS;
                matrix[(k, c - 1)] = thickness_m + by_length * length_m;
            }
        }
        let inverse = matrix.eigenvalues().ok()?;
        let mut rates: Vec<GrowthRate> = inverse
            .into_iter()
            .map(|z| {
                let size2 = z.re * z.re + z.im * z.im;
                GrowthRate { re_per_a: SHIFT_PER_A - z.re / size2, im_per_a: z.im / size2 }
            })
            .collect();
        rates.sort_by(|a, b| {
            b.re_per_a.total_cmp(&a.re_per_a).then(b.im_per_a.total_cmp(&a.im_per_a))
        });
        Some(Self { rates })
    }
}
