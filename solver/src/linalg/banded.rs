//! Storage of a square banded matrix with room for the fill-in of row pivoting. Knows no algorithm.

/// A banded matrix, row by row: entry (i, j) with |i − j| within the band sits at offset
/// j − i + `KL` of row i. Each row keeps `KL` further places on the right for fill-in.
#[derive(Debug, Clone)]
pub struct Banded<const KL: usize, const KU: usize> {
    n: usize,
    data: Vec<f64>,
}

impl<const KL: usize, const KU: usize> Banded<KL, KU> {
    /// Places per row: the band and the fill-in.
    pub const WIDTH: usize = 2 * KL + KU + 1;

    /// A zero matrix of n rows.
    pub fn zeros(n: usize) -> Self {
        Self { n, data: vec![0.0; n * Self::WIDTH] }
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.n
    }

    /// Sets every entry to zero.
    pub fn clear(&mut self) {
        self.data.fill(0.0);
    }

    /// Adds to entry (i, j), which must lie within the band.
    #[inline]
    pub fn add(&mut self, i: usize, j: usize, value: f64) {
        debug_assert!(j + KL >= i && j <= i + KU, "({i}, {j}) lies outside the band");
        self.data[i * Self::WIDTH + j + KL - i] += value;
    }

    /// Entry (i, j), zero outside the band and its fill-in.
    #[inline(always)]
    pub fn get(&self, i: usize, j: usize) -> f64 {
        if j + KL < i || j > i + KL + KU {
            return 0.0;
        }
        self.data[i * Self::WIDTH + j + KL - i]
    }

    /// The part of row i that starts at column j, as stored.
    #[inline(always)]
    pub(super) fn row_from(&self, i: usize, j: usize) -> &[f64] {
        &self.data[i * Self::WIDTH + j + KL - i..(i + 1) * Self::WIDTH]
    }

    /// Row `upper` from column j on and row `lower` from column j on, for `upper < lower`.
    #[inline(always)]
    pub(super) fn two_rows_from(
        &mut self,
        upper: usize,
        lower: usize,
        j: usize,
    ) -> (&mut [f64], &mut [f64]) {
        let (head, tail) = self.data.split_at_mut(lower * Self::WIDTH);
        let upper_row = &mut head[upper * Self::WIDTH + j + KL - upper..(upper + 1) * Self::WIDTH];
        let lower_row = &mut tail[j + KL - lower..Self::WIDTH];
        (upper_row, lower_row)
    }
}
