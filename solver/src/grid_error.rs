//! How far a steady state's numbers are from those of a fine grid: three grids, each with twice the cells
//! of the one before, and what their differences allow to be said. Knows no equation.

use crate::error::SolveError;
use crate::force::force_n_per_m;
use crate::params::Parameters;
use crate::state::State;
use crate::steady::SteadyVerdict;
use crate::{Model, Solver};

/// The finest grid has at least this many cells.
pub const FINEST_CELLS: usize = 400;
/// An observed order below this is not that of a scheme that has begun to converge.
pub const LEAST_ORDER: f64 = 0.5;

/// A number on three grids.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Convergence {
    /// The numbers, from the coarsest grid to the finest.
    pub values: [f64; 3],
    /// log₂ of the quotient of the two differences; none if they have different signs or one is 0.
    pub observed_order: Option<f64>,
    /// Value at infinitely many cells, extrapolated with the observed order (Richardson); none where the
    /// grids are not in the asymptotic range.
    pub extrapolated: Option<f64>,
    /// Distance of the run's own number from the extrapolated one; where there is none, the spread of
    /// all four numbers.
    pub error: f64,
}

/// L, H₀ and F/W on three grids.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GridError {
    /// Cells of the three grids.
    pub n_cells: [usize; 3],
    /// L, m.
    pub length: Convergence,
    /// H₀, m.
    pub thickness_0: Convergence,
    /// F/W, N m⁻¹.
    pub force: Convergence,
}

impl Convergence {
    /// Of a run's own value and those of three grids.
    pub fn of(own: f64, values: [f64; 3]) -> Self {
        let [coarse, middle, fine] = values;
        let (first, second) = (middle - coarse, fine - middle);
        let observed_order =
            (first * second > 0.0).then(|| (first / second).log2()).filter(|o| o.is_finite());
        let extrapolated = observed_order
            .filter(|order| *order >= LEAST_ORDER)
            .map(|order| fine + second / (order.exp2() - 1.0));
        let error = match extrapolated {
            Some(limit) => (own - limit).abs(),
            None => {
                let all = [own, coarse, middle, fine];
                let largest = all.into_iter().fold(f64::NEG_INFINITY, f64::max);
                largest - all.into_iter().fold(f64::INFINITY, f64::min)
            }
        };
        Self { values, observed_order, extrapolated, error }
    }

    /// Whether the grids are in the asymptotic range, so that `error` estimates an error.
    pub fn is_asymptotic(&self) -> bool {
        self.extrapolated.is_some()
    }
}

/// Solves a steady state's model on three grids, the finest of at least [`FINEST_CELLS`] cells and
/// twice the state's own. None where one of them has no steady state.
pub fn grid_error(model: &Model, own: &State) -> Result<Option<GridError>, SolveError> {
    let finest = FINEST_CELLS.max(2 * own.n_cells()).next_multiple_of(4);
    let n_cells = [finest / 4, finest / 2, finest];
    let mut states = Vec::with_capacity(3);
    for n_cells in n_cells {
        let parameters = Parameters { n_cells, ..*model.parameters() };
        let mut solver = Solver::new(Model { parameters, ..model.clone() });
        match solver.steady(None)? {
            SteadyVerdict::Converged { solution, .. } => states.push(solution.state),
            _ => return Ok(None),
        }
    }
    let of = |number: fn(&State) -> f64| {
        Convergence::of(number(own), [0, 1, 2].map(|i| number(&states[i])))
    };
    Ok(Some(GridError {
        n_cells,
        length: of(|s| s.length_m),
        thickness_0: of(State::thickness_0_m),
        force: of(force_n_per_m),
    }))
}
