//! Where the equations' reports go: rows are made nondimensional here, and residuals, slopes and changes
//! by what is given end in the places that belong to them. Knows no equation.

use super::Sink;
use super::given::{Given, Rates};
use super::jacobian::Jacobian;
use crate::state::{Var, scale};

/// Inverse units of the rows (Appendix B); those of the mass rows depend on what stands in them.
#[derive(Debug, Clone, Copy)]
pub(super) struct RowScales {
    pub(super) n: usize,
    pub(super) first_mass: f64,
    pub(super) mass: f64,
    pub(super) length: f64,
}

impl RowScales {
    #[inline(always)]
    fn inverse_of(&self, row: Var) -> f64 {
        match row {
            Var::U(0) | Var::Mu(_) | Var::Calving => 1.0 / scale::VELOCITY,
            Var::U(j) if j == self.n => 1.0 / scale::VELOCITY,
            Var::U(_) => 1.0 / scale::MOMENTUM,
            Var::G(c) if c == 0 || c + 1 == self.n => 1.0 / scale::FLUIDITY,
            Var::G(_) => 1.0 / scale::FLUIDITY_CURVATURE,
            Var::H(0) => self.first_mass,
            Var::H(_) => self.mass,
            Var::L => self.length,
        }
    }
}

/// Takes residuals.
pub(super) struct ResidualOnly<'a> {
    pub(super) rows: RowScales,
    pub(super) residual: &'a mut [f64],
}

impl Sink for ResidualOnly<'_> {
    #[inline(always)]
    fn residual(&mut self, row: Var, value: f64) {
        write(self.rows, self.residual, row, value);
    }

    #[inline(always)]
    fn slope(&mut self, _: Var, _: Var, _: f64) {}
}

/// Takes residuals and slopes.
pub(super) struct WithJacobian<'a> {
    pub(super) rows: RowScales,
    pub(super) residual: &'a mut [f64],
    pub(super) jacobian: &'a mut Jacobian,
}

impl Sink for WithJacobian<'_> {
    #[inline(always)]
    fn residual(&mut self, row: Var, value: f64) {
        write(self.rows, self.residual, row, value);
    }

    #[inline(always)]
    fn slope(&mut self, row: Var, by: Var, value: f64) {
        let scaled = value * (by.scale() * self.rows.inverse_of(row));
        self.jacobian.add(row, by, scaled);
    }
}

#[inline(always)]
fn write(rows: RowScales, residual: &mut [f64], row: Var, value: f64) {
    if let Some(place) = row.index(rows.n) {
        residual[place] = value * rows.inverse_of(row);
    }
}

/// Takes residuals, slopes, and the change of the rows along a control: ∂F/∂p.
pub(super) struct WithColumn<'a> {
    pub(super) inner: WithJacobian<'a>,
    pub(super) rates: &'a Rates,
    pub(super) column: &'a mut [f64],
}

impl Sink for WithColumn<'_> {
    #[inline(always)]
    fn residual(&mut self, row: Var, value: f64) {
        self.inner.residual(row, value);
    }

    #[inline(always)]
    fn slope(&mut self, row: Var, by: Var, value: f64) {
        self.inner.slope(row, by, value);
    }

    #[inline(always)]
    fn given(&mut self, row: Var, by: Given, value: f64) {
        let rate = self.rates[by as usize];
        if let Some(place) = row.index(self.inner.rows.n) {
            self.column[place] += value * rate * self.inner.rows.inverse_of(row);
        }
    }
}

/// Sums λᵀ ∂F/∂(what is given).
pub(super) struct Weighted<'a> {
    pub(super) rows: RowScales,
    pub(super) weights: &'a [f64],
    pub(super) scalars: &'a mut Rates,
    /// By the melt rate of each cell, m a⁻¹.
    pub(super) melt: &'a mut [f64],
}

impl Weighted<'_> {
    #[inline(always)]
    fn weight(&self, row: Var) -> f64 {
        row.index(self.rows.n).map_or(0.0, |place| self.weights[place] * self.rows.inverse_of(row))
    }
}

impl Sink for Weighted<'_> {
    fn residual(&mut self, _: Var, _: f64) {}
    fn slope(&mut self, _: Var, _: Var, _: f64) {}

    #[inline(always)]
    fn given(&mut self, row: Var, by: Given, value: f64) {
        self.scalars[by as usize] += value * self.weight(row);
    }

    #[inline(always)]
    fn melt(&mut self, row: Var, cell: usize) {
        self.melt[cell] += self.weight(row);
    }
}
