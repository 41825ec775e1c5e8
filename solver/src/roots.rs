//! The other discrete steady states beside the one that the rule picks. Knows where the rheology has its
//! kinks, no equation else.
//!
//! A cell near yield has up to three fluidities that balance its neighbours': with q = 1 − μ_s/μ its equation
//! is curvature ∝ |q|(g − g_loc), g_loc ∝ q₊, which falls, rises and falls again as q grows. So the discrete
//! problem has roots that differ in a cell or two and by little elsewhere, though not always: in the base
//! case one is 0.9 % thinner. They vanish with the grid's spacing; the rule ([`crate::steady`]) picks the one
//! that the smoothed problem leads to.

use crate::error::SolveError;
use crate::newton::Limits;
use crate::physics::continuity::MassBalance;
use crate::smoothing::{Ladder, yield_excesses};
use crate::state::{State, Var, scale};
use crate::steady::{SteadyVerdict, has_trough};
use crate::{Solution, Solver, Task};

/// Cells whose |1 − μ_s/μ| is below this are tried on the other sides of their kink.
const NEAR_YIELD: f64 = 0.05;
/// Where a cell is put, in units of its own |1 − μ_s/μ| or of [`AT_LEAST`]: below yield, just above it, and
/// well above.
const PLACES: [f64; 3] = [-1.0, 0.05, 3.0];
/// Least |1 − μ_s/μ| that the places are counted in.
const AT_LEAST: f64 = 2e-3;
/// Roots are one where their cells' 1 − μ_s/μ differ by less than this everywhere.
const SAME: f64 = 1e-6;

/// A steady state of the discrete problem.
#[derive(Debug, Clone, PartialEq)]
pub struct DiscreteRoot {
    /// The state.
    pub state: State,
    /// 2-norm of the nondimensional residual.
    pub residual_norm: f64,
    /// The interior cells that are not above yield, counted from 0 at the terminus.
    pub cells_at_rest: Vec<usize>,
    /// Whether it is the one that the rule picks.
    pub is_picked: bool,
}

impl Solver {
    /// The steady state that the rule picks, first, and the others that are found from it by putting one cell
    /// at a time on another side of its kink, thickest first. There may be more, with more cells changed.
    pub fn discrete_roots(
        &mut self,
    ) -> Result<Result<Vec<DiscreteRoot>, SteadyVerdict>, SolveError> {
        let picked = match self.steady(None)? {
            SteadyVerdict::Converged { solution, .. } => solution,
            verdict => return Ok(Err(verdict)),
        };
        Ok(Ok(self.discrete_roots_beside(&picked)))
    }

    /// The same, of the model's steady state that is known already: that one first, to the last digit.
    pub fn discrete_roots_beside(&mut self, picked: &Solution) -> Vec<DiscreteRoot> {
        let excess = yield_excesses(self.model().parameters(), &picked.state);
        let mut found =
            vec![(self.discrete_root(&picked.state, picked.residual_norm, true), excess)];
        for (k, own) in found[0].1.clone().into_iter().enumerate() {
            if own.abs() > NEAR_YIELD {
                continue;
            }
            for place in PLACES {
                let target = place * own.abs().max(AT_LEAST);
                let Some((root, excess)) = self.root_with(&picked.state, k + 1, target) else {
                    continue;
                };
                let is_known = found.iter().any(|(_, known)| {
                    let moved = known.iter().zip(&excess).map(|(a, b)| (a - b).abs());
                    moved.fold(0.0, f64::max) < SAME
                });
                if !is_known {
                    found.push((root, excess));
                }
            }
        }
        found[1..]
            .sort_by(|(a, _), (b, _)| b.state.thickness_0_m().total_cmp(&a.state.thickness_0_m()));
        found.into_iter().map(|(root, _)| root).collect()
    }

    /// The root that Newton's method finds from a state with one cell moved across its kink.
    fn root_with(&mut self, from: &State, cell: usize, q: f64) -> Option<(DiscreteRoot, Vec<f64>)> {
        let p = *self.model().parameters();
        from.pack(&mut self.newton.x);
        let shear = from.strain_rate_per_a(cell).abs() + p.strain_rate_regularisation_per_a;
        let place = Var::G(cell).index(p.n_cells).expect("a cell's fluidity is packed");
        self.newton.x[place] = shear * (1.0 - q) / p.mu_s / scale::FLUIDITY;
        let limits = Limits { iterations: 15, ..Limits::default() };
        let mut steady = self.at(Task::new(MassBalance::Steady));
        let root = steady.solve_at(0.0, limits).ok()?;
        let state = steady.state();
        let is_melange = state.check(p.n_cells).is_ok() && !has_trough(self.model(), &state);
        let excess = yield_excesses(&p, &state);
        is_melange.then(|| (self.discrete_root(&state, root.residual_norm, false), excess))
    }

    fn discrete_root(&self, state: &State, residual_norm: f64, is_picked: bool) -> DiscreteRoot {
        let excess = yield_excesses(self.model().parameters(), state);
        let cells = excess.iter().enumerate().filter(|(_, e)| **e <= 0.0).map(|(k, _)| k + 1);
        DiscreteRoot {
            state: state.clone(),
            residual_norm,
            cells_at_rest: cells.collect(),
            is_picked,
        }
    }
}
