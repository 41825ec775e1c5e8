//! LU with row pivoting of a banded matrix whose last column is dense. Knows no physics.
//!
//! The mélange's length L couples to every equation, and the condition that fixes it (C1) touches
//! the last two cells only. With L as the last unknown and C1 as the last row the system is
//!
//! ```text
//!   ┌ ▓ ▓ ▓             █ ┐
//!   │ ▓ ▓ ▓ ▓           █ │     ▓ band, KL below and KU above the diagonal
//!   │   ▓ ▓ ▓ ▓         █ │     █ dense last column, ∂/∂L
//!   │       ▓ ▓ ▓ ▓     █ │
//!   └           ▓ ▓ ▓   █ ┘ ← C1
//! ```
//!
//! The dense column takes part in the elimination like a right-hand side, so this is Gaussian
//! elimination with partial pivoting of the whole matrix (Golub & Van Loan 2013, §4.3), stable
//! also where the banded part alone is singular, and linear in the number of cells.

use super::banded::Banded;

/// The matrix, before and after [`Bordered::factorise`].
#[derive(Debug, Clone)]
pub struct Bordered<const KL: usize, const KU: usize> {
    band: Banded<KL, KU>,
    border: Vec<f64>,
    multipliers: Vec<[f64; KL]>,
    pivots: Vec<usize>,
    inverse_pivots: Vec<f64>,
    is_positive: bool,
}

/// No usable pivot in this column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Singular {
    /// The column without a pivot.
    pub column: usize,
}

impl<const KL: usize, const KU: usize> Bordered<KL, KU> {
    /// A zero matrix of n rows.
    pub fn zeros(n: usize) -> Self {
        Self {
            band: Banded::zeros(n),
            border: vec![0.0; n],
            multipliers: vec![[0.0; KL]; n],
            pivots: vec![0; n],
            inverse_pivots: vec![0.0; n],
            is_positive: true,
        }
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.band.rows()
    }

    /// Sets every entry to zero.
    pub fn clear(&mut self) {
        self.band.clear();
        self.border.fill(0.0);
    }

    /// Adds to entry (i, j).
    #[inline]
    pub fn add(&mut self, i: usize, j: usize, value: f64) {
        if j + 1 == self.border.len() {
            self.border[i] += value;
        } else {
            self.band.add(i, j, value);
        }
    }

    /// Entry (i, j) of the matrix before factorisation.
    pub fn get(&self, i: usize, j: usize) -> f64 {
        if j + 1 == self.border.len() { self.border[i] } else { self.band.get(i, j) }
    }

    /// Replaces the matrix by its factors.
    pub fn factorise(&mut self) -> Result<(), Singular> {
        pulp::Arch::new().dispatch(Factorise(self))
    }

    /// Whether the determinant is positive, from the factors.
    pub fn is_positive(&self) -> bool {
        self.is_positive
    }

    /// Solves for one right-hand side, in place, with the factors.
    pub fn solve(&self, rhs: &mut [f64]) {
        pulp::Arch::new().dispatch(Solve(self, rhs));
    }

    /// Solves with the transposed matrix for one right-hand side, in place, with the factors.
    pub fn solve_transposed(&self, rhs: &mut [f64]) {
        let n = self.rows();
        for k in 0..n - 1 {
            let value = rhs[k] * self.inverse_pivots[k];
            rhs[k] = value;
            let row = &self.band.row_from(k, k)[1..KL + KU + 1];
            for (r, u) in rhs[k + 1..n - 1].iter_mut().zip(row) {
                *r -= u * value;
            }
            rhs[n - 1] -= self.border[k] * value;
        }
        rhs[n - 1] /= self.border[n - 1];
        for k in (0..n - 1).rev() {
            let below = rhs[k + 1..].iter().zip(&self.multipliers[k]);
            let known: f64 = below.map(|(r, factor)| r * factor).sum();
            rhs[k] -= known;
            rhs.swap(k, self.pivots[k]);
        }
    }

    /// Replaces the dense last column.
    pub fn set_border(&mut self, column: &[f64]) {
        self.border.copy_from_slice(column);
    }

    #[inline(always)]
    fn eliminate(&mut self) -> Result<(), Singular> {
        let n = self.rows();
        self.is_positive = true;
        for k in 0..n - 1 {
            let last = (k + KL).min(n - 1);
            let mut pivot = k;
            let mut largest = self.band.get(k, k).abs();
            for i in k + 1..=last {
                let candidate = self.band.get(i, k).abs();
                if candidate > largest {
                    (pivot, largest) = (i, candidate);
                }
            }
            if !(largest > 0.0 && largest.is_finite()) {
                return Err(Singular { column: k });
            }
            self.pivots[k] = pivot;
            if pivot != k {
                let (upper, lower) = self.band.two_rows_from(k, pivot, k);
                upper[..KL + KU + 1].swap_with_slice(&mut lower[..KL + KU + 1]);
                self.border.swap(k, pivot);
                self.is_positive = !self.is_positive;
            }
            self.is_positive ^= self.band.get(k, k) < 0.0;
            let inverse = 1.0 / self.band.get(k, k);
            self.inverse_pivots[k] = inverse;
            for i in k + 1..=last {
                let (upper, lower) = self.band.two_rows_from(k, i, k);
                let factor = lower[0] * inverse;
                self.multipliers[k][i - k - 1] = factor;
                if factor != 0.0 {
                    for (l, u) in lower[1..KL + KU + 1].iter_mut().zip(&upper[1..KL + KU + 1]) {
                        *l -= factor * u;
                    }
                    self.border[i] -= factor * self.border[k];
                }
            }
        }
        let corner = self.border[n - 1];
        self.is_positive ^= corner < 0.0;
        if corner != 0.0 && corner.is_finite() { Ok(()) } else { Err(Singular { column: n - 1 }) }
    }

    #[inline(always)]
    fn substitute(&self, rhs: &mut [f64]) {
        let n = self.rows();
        for k in 0..n - 1 {
            rhs.swap(k, self.pivots[k]);
            let value = rhs[k];
            let below = &mut rhs[k + 1..];
            // All but the last rows have KL below them, a number the compiler knows.
            if let Some(below) = below.first_chunk_mut::<KL>() {
                for (r, factor) in below.iter_mut().zip(&self.multipliers[k]) {
                    *r -= factor * value;
                }
            } else {
                for (r, factor) in below.iter_mut().zip(&self.multipliers[k]) {
                    *r -= factor * value;
                }
            }
        }
        let border_value = rhs[n - 1] / self.border[n - 1];
        rhs[n - 1] = border_value;
        for k in (0..n - 1).rev() {
            let row = &self.band.row_from(k, k)[1..KL + KU + 1];
            let beyond = &rhs[k + 1..n - 1];
            let tail = match beyond.get(..KL + KU) {
                Some(beyond) => dot(row, beyond),
                None => dot(row, beyond),
            };
            rhs[k] = (rhs[k] - self.border[k] * border_value - tail) * self.inverse_pivots[k];
        }
    }
}

/// [`Bordered::factorise`], compiled for each instruction set.
struct Factorise<'a, const KL: usize, const KU: usize>(&'a mut Bordered<KL, KU>);

impl<const KL: usize, const KU: usize> pulp::WithSimd for Factorise<'_, KL, KU> {
    type Output = Result<(), Singular>;

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) -> Self::Output {
        self.0.eliminate()
    }
}

/// [`Bordered::solve`], compiled for each instruction set.
struct Solve<'a, const KL: usize, const KU: usize>(&'a Bordered<KL, KU>, &'a mut [f64]);

impl<const KL: usize, const KU: usize> pulp::WithSimd for Solve<'_, KL, KU> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        self.0.substitute(self.1);
    }
}

/// Sum of products over the shorter of both, in four sums that do not wait for each other.
#[inline(always)]
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let shorter = a.len().min(b.len());
    let (a, b) = (&a[..shorter], &b[..shorter]);
    let mut sums = [0.0; 4];
    let (a, b) = (a.chunks_exact(4), b.chunks_exact(4));
    let rest: f64 = a.remainder().iter().zip(b.remainder()).map(|(a, b)| a * b).sum();
    for (a, b) in a.zip(b) {
        for l in 0..4 {
            sums[l] += a[l] * b[l];
        }
    }
    (sums[0] + sums[1]) + (sums[2] + sums[3]) + rest
}
