//! The bordered banded solve against a dense one.

use melange_solver::linalg::bordered::{Bordered, Singular};
use proptest::prelude::*;

const KL: usize = 3;
const KU: usize = 2;

/// Gaussian elimination with full row pivoting of a dense matrix.
pub fn dense_solve(mut a: Vec<Vec<f64>>, mut b: Vec<f64>) -> Vec<f64> {
    let n = b.len();
    for k in 0..n {
        let pivot = (k..n).max_by(|i, j| a[*i][k].abs().total_cmp(&a[*j][k].abs())).expect("rows");
        a.swap(k, pivot);
        b.swap(k, pivot);
        for i in k + 1..n {
            let factor = a[i][k] / a[k][k];
            let (upper, lower) = a.split_at_mut(i);
            for (l, u) in lower[0].iter_mut().zip(&upper[k]).skip(k) {
                *l -= factor * u;
            }
            b[i] -= factor * b[k];
        }
    }
    for k in (0..n).rev() {
        let tail: f64 = (k + 1..n).map(|j| a[k][j] * b[j]).sum();
        b[k] = (b[k] - tail) / a[k][k];
    }
    b
}

proptest! {
    #[test]
    fn bordered_solve_equals_dense_solve(
        n in 5_usize..40,
        entries in prop::collection::vec(-1.0_f64..1.0, 40 * 8),
        rhs in prop::collection::vec(-1.0_f64..1.0, 40),
    ) {
        let mut bordered = Bordered::<KL, KU>::zeros(n);
        let mut dense = vec![vec![0.0; n]; n];
        for i in 0..n {
            for j in i.saturating_sub(KL)..=(i + KU).min(n - 2) {
                // Small diagonals make pivoting matter.
                let value = entries[8 * i + (j + KL - i)] * if i == j { 1e-3 } else { 1.0 };
                bordered.add(i, j, value);
                dense[i][j] += value;
            }
            let value = entries[8 * i + 7];
            bordered.add(i, n - 1, value);
            dense[i][n - 1] += value;
        }
        let mut x = rhs[..n].to_vec();
        prop_assume!(bordered.factorise().is_ok());
        bordered.solve(&mut x);
        let expected = dense_solve(dense.clone(), rhs[..n].to_vec());
        let size = expected.iter().fold(1.0_f64, |a, v| a.max(v.abs()));
        for (got, expected) in x.iter().zip(&expected) {
            prop_assert!((got - expected).abs() <= 1e-9 * size, "{got} is not {expected}");
        }
    }
}

#[test]
fn a_column_of_zeros_is_singular() {
    let mut matrix = Bordered::<1, 1>::zeros(4);
    for i in [0, 2] {
        matrix.add(i, i, 1.0);
    }
    matrix.add(3, 3, 1.0);
    assert_eq!(matrix.factorise(), Err(Singular { column: 1 }));
}
