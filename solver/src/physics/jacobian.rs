//! The Jacobian of all equations, laid out so that a solve is short. Knows which unknowns an equation
//! touches, not why.
//!
//! μ_w of a node stands in two rows only: its own, the transverse problem, and the node's balance of
//! stresses. It is eliminated first, which leaves U, H, g and L (the core, banded but for L's column).
//! Where the mélange sticks to the walls, ū does not depend on μ_w; the balance of stresses then gives
//! μ_w, and the transverse problem takes its place in the core.
//! A calving law adds a product c·rᵀ, ∂(rows)/∂U_c times ∂U_c/∂(unknowns), which is dense; the solve
//! takes it up by the formula of Sherman and Morrison.

use super::sidewall;
use crate::linalg::bordered::{Bordered, Singular};
use crate::newton::Linear;
use crate::state::{Var, core_unknowns, unknowns};

/// Row of the transverse problem at one node.
#[derive(Debug, Clone, Copy, Default)]
struct Friction {
    by_mu: f64,
    by_u: f64,
    by_h: [f64; 2],
    by_l: f64,
}

/// The product c·rᵀ, and J⁻¹c once the rest is factorised.
#[derive(Debug, Clone)]
struct Feedback {
    is_used: bool,
    column: Vec<f64>,
    row: Vec<f64>,
    solved: Vec<f64>,
    denominator: f64,
}

/// The Jacobian, before and after [`Linear::factorise`].
#[derive(Debug, Clone)]
pub struct Jacobian {
    n_cells: usize,
    core: Bordered<6, 6>,
    friction: Vec<Friction>,
    /// ∂(balance of stresses)/∂μ_w at each node.
    stress_by_mu: Vec<f64>,
    /// How each node's μ_w was eliminated.
    eliminated: Vec<Elimination>,
    feedback: Feedback,
}

/// Which of its two rows gave μ_w, and the share of that row taken from the other.
#[derive(Debug, Clone, Copy)]
enum Elimination {
    /// The transverse problem.
    Transverse { share: f64 },
    /// The balance of stresses, whose columns 3j − 3 … 3j + 3 and L's are kept.
    Stress { share: f64, row: [f64; 8] },
}

/// ∂ū/∂μ_w, relative to ∂ū/∂U, below which a node counts as stuck: a pivot that small would cost more
/// than three digits.
const STUCK: f64 = 1e-3;

impl Jacobian {
    /// A zero matrix for N cells.
    pub fn zeros(n_cells: usize) -> Self {
        let zeros = || vec![0.0; unknowns(n_cells)];
        Self {
            n_cells,
            core: Bordered::zeros(core_unknowns(n_cells)),
            friction: vec![Friction::default(); n_cells + 1],
            stress_by_mu: vec![0.0; n_cells + 1],
            eliminated: vec![Elimination::Transverse { share: 0.0 }; n_cells + 1],
            feedback: Feedback {
                is_used: false,
                column: zeros(),
                row: zeros(),
                solved: zeros(),
                denominator: 1.0,
            },
        }
    }

    /// Sets every entry to zero.
    pub fn clear(&mut self) {
        self.core.clear();
        self.friction.fill(Friction::default());
        self.stress_by_mu.fill(0.0);
        if self.feedback.is_used {
            self.feedback.is_used = false;
            self.feedback.column.fill(0.0);
            self.feedback.row.fill(0.0);
        }
    }

    /// Adds to ∂(row)/∂(unknown).
    #[inline(always)]
    pub fn add(&mut self, row: Var, by: Var, value: f64) {
        match (row, by) {
            (Var::Calving, _) => {
                let place = by.index(self.n_cells).expect("a calving law does not feed itself");
                self.feedback.row[place] += value;
            }
            (_, Var::Calving) => {
                self.feedback.is_used = true;
                let place = row.index(self.n_cells).expect("a calving law does not feed itself");
                self.feedback.column[place] += value;
            }
            (Var::Mu(j), Var::Mu(_)) => self.friction[j].by_mu += value,
            (Var::Mu(j), Var::U(_)) => self.friction[j].by_u += value,
            (Var::Mu(j), Var::H(c)) => {
                let slot = usize::from(sidewall::cells_beside(j, self.n_cells)[1] == c);
                self.friction[j].by_h[slot] += value;
            }
            (Var::Mu(j), _) => self.friction[j].by_l += value,
            (Var::U(j), Var::Mu(_)) => self.stress_by_mu[j] += value,
            _ => {
                if let (Some(i), Some(j)) = (row.index(self.n_cells), by.index(self.n_cells)) {
                    self.core.add(i, j, value);
                }
            }
        }
    }

    /// Places and values of a node's transverse row but for μ_w itself.
    #[inline(always)]
    fn friction_row(&self, node: usize) -> [(usize, f64); 4] {
        let Friction { by_u, by_h, by_l, .. } = self.friction[node];
        let [near, far] = sidewall::cells_beside(node, self.n_cells);
        [
            (3 * node, by_u),
            (3 * near + 1, by_h[0]),
            (3 * far + 1, by_h[1]),
            (3 * self.n_cells + 1, by_l),
        ]
    }

    /// The whole matrix before factorisation, row by row; for tests.
    pub fn to_dense(&self) -> Vec<Vec<f64>> {
        let (n, core) = (self.n_cells, core_unknowns(self.n_cells));
        let mut dense = vec![vec![0.0; unknowns(n)]; unknowns(n)];
        for (i, row) in dense.iter_mut().enumerate().take(core) {
            for (j, value) in row.iter_mut().enumerate().take(core) {
                *value = self.core.get(i, j);
            }
        }
        for node in 0..=n {
            dense[3 * node][core + node] += self.stress_by_mu[node];
            dense[core + node][core + node] += self.friction[node].by_mu;
            for (place, value) in self.friction_row(node) {
                dense[core + node][place] += value;
            }
        }
        if self.feedback.is_used {
            for (row, c) in dense.iter_mut().zip(&self.feedback.column) {
                row.iter_mut().zip(&self.feedback.row).for_each(|(entry, r)| *entry += c * r);
            }
        }
        dense
    }

    /// ∂(rows)/∂L, before factorisation.
    pub fn length_column(&self, out: &mut [f64]) {
        let place = 3 * self.n_cells + 1;
        let (core, mu_w) = out.split_at_mut(core_unknowns(self.n_cells));
        for (i, entry) in core.iter_mut().enumerate() {
            *entry = self.core.get(i, place);
        }
        for (entry, friction) in mu_w.iter_mut().zip(&self.friction) {
            *entry = friction.by_l;
        }
        if self.feedback.is_used {
            let by_length = self.feedback.row[place];
            out.iter_mut()
                .zip(&self.feedback.column)
                .for_each(|(entry, c)| *entry += c * by_length);
        }
    }

    /// Puts another unknown in L's place, with this column; before factorisation.
    pub fn replace_length(&mut self, column: &[f64]) {
        let (core, mu_w) = column.split_at(core_unknowns(self.n_cells));
        self.core.set_border(core);
        for (friction, entry) in self.friction.iter_mut().zip(mu_w) {
            friction.by_l = *entry;
        }
        self.feedback.row[3 * self.n_cells + 1] = 0.0;
    }

    /// Solves with the transposed matrix, in place, with the factors.
    pub fn solve_transposed(&self, rhs: &mut [f64]) {
        let Feedback { is_used, row, solved, denominator, .. } = &self.feedback;
        if *is_used {
            let share = dot(solved, rhs) / denominator;
            rhs.iter_mut().zip(row).for_each(|(x, r)| *x -= share * r);
        }
        let (core, mu_w) = rhs.split_at_mut(core_unknowns(self.n_cells));
        for (j, (elimination, mu_w)) in self.eliminated.iter().zip(&mut *mu_w).enumerate() {
            match elimination {
                Elimination::Transverse { .. } => {
                    *mu_w /= self.friction[j].by_mu;
                    for (place, value) in self.friction_row(j) {
                        core[place] -= value * *mu_w;
                    }
                }
                Elimination::Stress { row, .. } => {
                    *mu_w /= self.stress_by_mu[j];
                    for (value, place) in row.iter().zip(self.stress_places(j)) {
                        core[place] -= value * *mu_w;
                    }
                }
            }
        }
        self.core.solve_transposed(core);
        for (j, (elimination, mu_w)) in self.eliminated.iter().zip(mu_w).enumerate() {
            match elimination {
                Elimination::Transverse { share } => *mu_w -= share * core[3 * j],
                Elimination::Stress { share, .. } => {
                    let stress = *mu_w;
                    *mu_w = core[3 * j];
                    core[3 * j] = stress - share * *mu_w;
                }
            }
        }
    }

    /// Columns of a node's balance of stresses in the core.
    fn stress_places(&self, node: usize) -> [usize; 8] {
        std::array::from_fn(|k| if k < 7 { 3 * node + k - 3 } else { 3 * self.n_cells + 1 })
    }

    /// Takes μ_w of a node out of the core's equations.
    fn eliminate_friction(&mut self, j: usize) -> Result<(), Singular> {
        let (by_mu, stress_by_mu) = (self.friction[j].by_mu, self.stress_by_mu[j]);
        let is_stuck = by_mu.abs() < STUCK * self.friction[j].by_u.abs() && stress_by_mu != 0.0;
        if !by_mu.is_finite() || (by_mu == 0.0 && !is_stuck) {
            return Err(Singular { column: core_unknowns(self.n_cells) + j });
        }
        if is_stuck {
            let share = by_mu / stress_by_mu;
            let places = self.stress_places(j);
            let row = places.map(|place| self.core.get(3 * j, place));
            for (place, value) in places.into_iter().zip(row) {
                self.core.add(3 * j, place, -(1.0 + share) * value);
            }
            for (place, value) in self.friction_row(j) {
                self.core.add(3 * j, place, value);
            }
            self.eliminated[j] = Elimination::Stress { share, row };
        } else {
            let share = stress_by_mu / by_mu;
            if share != 0.0 {
                for (place, value) in self.friction_row(j) {
                    self.core.add(3 * j, place, -share * value);
                }
            }
            self.eliminated[j] = Elimination::Transverse { share };
        }
        Ok(())
    }

    /// Solves without the calving law's product.
    fn solve_without_feedback(&self, rhs: &mut [f64]) {
        let (core, mu_w) = rhs.split_at_mut(core_unknowns(self.n_cells));
        for (j, (elimination, mu_w)) in self.eliminated.iter().zip(&mut *mu_w).enumerate() {
            match elimination {
                Elimination::Transverse { share } => core[3 * j] -= share * *mu_w,
                Elimination::Stress { share, .. } => {
                    let stress = core[3 * j];
                    core[3 * j] = *mu_w - share * stress;
                    *mu_w = stress;
                }
            }
        }
        self.core.solve(core);
        for (j, (elimination, mu_w)) in self.eliminated.iter().zip(mu_w).enumerate() {
            match elimination {
                Elimination::Transverse { .. } => {
                    let row = self.friction_row(j);
                    let known: f64 = row.iter().map(|(place, value)| value * core[*place]).sum();
                    *mu_w = (*mu_w - known) / self.friction[j].by_mu;
                }
                Elimination::Stress { row, .. } => {
                    let places = self.stress_places(j);
                    let known: f64 = row.iter().zip(places).map(|(v, place)| v * core[place]).sum();
                    *mu_w = (*mu_w - known) / self.stress_by_mu[j];
                }
            }
        }
    }
}

impl Linear for Jacobian {
    fn factorise(&mut self) -> Result<(), Singular> {
        for j in 0..=self.n_cells {
            self.eliminate_friction(j)?;
        }
        self.core.factorise()?;
        if self.feedback.is_used {
            let mut solved = std::mem::take(&mut self.feedback.solved);
            solved.copy_from_slice(&self.feedback.column);
            self.solve_without_feedback(&mut solved);
            self.feedback.denominator = 1.0 + dot(&self.feedback.row, &solved);
            self.feedback.solved = solved;
            if self.feedback.denominator == 0.0 || !self.feedback.denominator.is_finite() {
                return Err(Singular { column: 0 });
            }
        }
        Ok(())
    }

    fn is_positive(&self) -> bool {
        let mut is_positive = self.core.is_positive();
        for (j, elimination) in self.eliminated.iter().enumerate() {
            is_positive ^= match elimination {
                Elimination::Transverse { .. } => self.friction[j].by_mu < 0.0,
                // The two rows have changed places.
                Elimination::Stress { .. } => self.stress_by_mu[j] >= 0.0,
            };
        }
        is_positive ^ (self.feedback.is_used && self.feedback.denominator < 0.0)
    }

    fn solve(&self, rhs: &mut [f64]) {
        self.solve_without_feedback(rhs);
        let Feedback { is_used, row, solved, denominator, .. } = &self.feedback;
        if *is_used {
            let share = dot(row, rhs) / denominator;
            rhs.iter_mut().zip(solved).for_each(|(x, z)| *x -= share * z);
        }
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
