//! How well parameters are known to first order, and which combinations of them: from the information
//! matrix A = JᵀJ of residuals that are in units of their standard errors. Knows no ice.
//!
//! With Gaussian errors of known size the covariance of ln p is A⁻¹. A's eigenvectors v are combinations
//! Σ v_k ln p_k = ln Π p_k^{v_k} that are known independently of one another, each to 1/√eigenvalue.

use crate::control::Control;
use faer::{Mat, Side};

/// What the data tell of the parameters that lie at no bound; those that do are taken as known.
#[derive(Debug, Clone, PartialEq)]
pub struct Uncertainty {
    /// The parameters, in the order of everything below.
    pub free: Vec<Control>,
    /// Covariance of ln p; none where some combination is not determined at all.
    pub covariance_ln: Option<Vec<Vec<f64>>>,
    /// Correlation of ln p.
    pub correlation: Option<Vec<Vec<f64>>>,
    /// Combinations that are known independently, the least known first.
    pub directions: Vec<Direction>,
}

/// A combination Π p_k^{v_k} of parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct Direction {
    /// v, of length 1; its largest component is positive.
    pub exponents: Vec<f64>,
    /// Standard error of its logarithm; infinite where the data do not depend on it.
    pub standard_error_ln: f64,
}

/// Eigenvalues below this share of the largest are rounding.
const ROUNDING: f64 = 1e-13;
/// A combination that is known to a factor of e only is poorly known.
pub const POORLY_KNOWN_LN: f64 = 1.0;

impl Uncertainty {
    /// From the information matrix of some of the parameters, in their order.
    pub fn new(information: &Mat<f64>, free: Vec<Control>) -> Self {
        let n = free.len();
        let directions = directions(information);
        let is_determined = directions.iter().all(|d| d.standard_error_ln.is_finite());
        let covariance = |i: usize, j: usize| {
            let share =
                |d: &Direction| d.exponents[i] * d.exponents[j] * d.standard_error_ln.powi(2);
            directions.iter().map(share).sum::<f64>()
        };
        let square = |number: &dyn Fn(usize, usize) -> f64| -> Option<Vec<Vec<f64>>> {
            let row = |i| (0..n).map(|j| number(i, j)).collect();
            is_determined.then(|| (0..n).map(row).collect())
        };
        let covariance_ln = square(&covariance);
        let correlation =
            square(&|i, j| covariance(i, j) / (covariance(i, i) * covariance(j, j)).sqrt());
        Self { free, covariance_ln, correlation, directions }
    }

    /// Standard error of ln p of a parameter that is free and determined.
    pub fn standard_error_ln(&self, control: Control) -> Option<f64> {
        let k = self.free.iter().position(|free| *free == control)?;
        Some(self.covariance_ln.as_ref()?[k][k].sqrt())
    }

    /// Ratio of the largest to the smallest eigenvalue of the information matrix; infinite where some
    /// combination is not determined, 1 where nothing is free.
    pub fn condition_number(&self) -> f64 {
        match &self.directions[..] {
            [worst, ..] if worst.standard_error_ln.is_infinite() => f64::INFINITY,
            [worst, .., best] => (worst.standard_error_ln / best.standard_error_ln).powi(2),
            _ => 1.0,
        }
    }

    /// Whether some combination of parameters is known to a factor of e only, or less.
    pub fn is_poor(&self) -> bool {
        self.directions.first().is_some_and(|d| d.standard_error_ln > POORLY_KNOWN_LN)
    }

    /// In words, what is known least.
    pub fn weakest(&self) -> String {
        let Some(direction) = self.directions.first() else {
            return "every parameter lies at a bound".into();
        };
        let product = direction.product(&self.free);
        let error = direction.standard_error_ln;
        match (error.is_finite(), self.is_poor()) {
            (false, _) => format!("the data say nothing about {product}"),
            (true, is_poor) => format!(
                "{} known is {product}: the standard error of its logarithm is {error:.2}",
                if is_poor { "poorly" } else { "least" },
            ),
        }
    }
}

impl Direction {
    /// `b^0.95 · mu_s^-0.31`; factors that hardly count are left out.
    pub fn product(&self, controls: &[Control]) -> String {
        /// Exponents below this do not count.
        const HARDLY: f64 = 0.05;
        let mut factors: Vec<_> = self.exponents.iter().zip(controls).collect();
        factors.retain(|(exponent, _)| exponent.abs() >= HARDLY);
        factors.sort_by(|a, b| b.0.abs().total_cmp(&a.0.abs()));
        let factor = |(exponent, control): &(&f64, &Control)| match **exponent > 0.995 {
            true => control.name().to_owned(),
            false => format!("{}^{exponent:.2}", control.name()),
        };
        factors.iter().map(factor).collect::<Vec<_>>().join(" · ")
    }
}

/// The information matrix's eigenvectors, the smallest eigenvalue first.
fn directions(information: &Mat<f64>) -> Vec<Direction> {
    let n = information.nrows();
    let eigen = information
        .self_adjoint_eigen(Side::Lower)
        .expect("the eigenvalues of a small matrix of finite numbers converge");
    let (values, vectors) = (eigen.S().column_vector(), eigen.U());
    let largest = (0..n).map(|k| values[k]).fold(0.0, f64::max);
    let direction = |k: usize| {
        let column: Vec<f64> = (0..n).map(|i| vectors[(i, k)]).collect();
        let leading = column.iter().copied().max_by(|a, b| a.abs().total_cmp(&b.abs()));
        let sign = leading.map_or(1.0, f64::signum);
        let is_determined = values[k] > ROUNDING * largest;
        Direction {
            exponents: column.iter().map(|v| sign * v).collect(),
            standard_error_ln: if is_determined { values[k].sqrt().recip() } else { f64::INFINITY },
        }
    };
    (0..n).map(direction).collect()
}
