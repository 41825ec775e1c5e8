//! A mélange's state: velocity, friction at the walls, thickness, fluidity and length, on the
//! staggered grid of Appendix C, in SI metres and years. Also the order in which the unknowns are
//! packed for Newton's method, and their scales. Knows no equation.

use crate::error::SolveError;

/// The unknowns of the model. N + 1 nodes at χ = j/N carry U and μ_w, N cells carry H and g^x.
#[derive(Debug, Clone, PartialEq)]
pub struct State {
    /// U: \[N+1\] m a⁻¹, in the frame that moves with the terminus.
    pub velocity_m_per_a: Vec<f64>,
    /// μ_w: \[N+1\], signed like the velocity relative to the walls.
    pub mu_w: Vec<f64>,
    /// H: \[N\] m.
    pub thickness_m: Vec<f64>,
    /// g^x: \[N\] a⁻¹.
    pub fluidity_per_a: Vec<f64>,
    /// L: m.
    pub length_m: f64,
}

impl State {
    /// A state of N cells, all zero.
    pub fn zeros(n_cells: usize) -> Self {
        Self {
            velocity_m_per_a: vec![0.0; n_cells + 1],
            mu_w: vec![0.0; n_cells + 1],
            thickness_m: vec![0.0; n_cells],
            fluidity_per_a: vec![0.0; n_cells],
            length_m: 0.0,
        }
    }

    /// The state whose every number is a function of the same numbers of states with as many cells.
    pub fn combined<const K: usize>(states: [&State; K], number: impl Fn([f64; K]) -> f64) -> Self {
        let all = |get: fn(&State) -> &[f64]| {
            let arrays = states.map(get);
            (0..arrays[0].len()).map(|i| number(arrays.map(|a| a[i]))).collect()
        };
        Self {
            velocity_m_per_a: all(|s| &s.velocity_m_per_a),
            mu_w: all(|s| &s.mu_w),
            thickness_m: all(|s| &s.thickness_m),
            fluidity_per_a: all(|s| &s.fluidity_per_a),
            length_m: number(states.map(|s| s.length_m)),
        }
    }

    /// Number of cells N.
    pub fn n_cells(&self) -> usize {
        self.thickness_m.len()
    }

    /// Cell length Δx = L/N in m.
    pub fn dx_m(&self) -> f64 {
        self.length_m / self.n_cells() as f64
    }

    /// Thickness at the terminus, extrapolated: H₀ = (3H½ − H₃⸝₂)/2 (Eq. 22 as the published code has it), m.
    pub fn thickness_0_m(&self) -> f64 {
        (3.0 * self.thickness_m[0] - self.thickness_m[1]) / 2.0
    }

    /// Thickness at x = L, extrapolated as in C1, m.
    pub fn thickness_end_m(&self) -> f64 {
        let n = self.n_cells();
        (3.0 * self.thickness_m[n - 1] - self.thickness_m[n - 2]) / 2.0
    }

    /// Longitudinal strain rate of a cell, a⁻¹: ε̇_xx = (U_j − U_{j−1})/Δx.
    pub fn strain_rate_per_a(&self, cell: usize) -> f64 {
        (self.velocity_m_per_a[cell + 1] - self.velocity_m_per_a[cell]) / self.dx_m()
    }

    /// Positions of the nodes, m from the terminus.
    pub fn node_x_m(&self) -> Vec<f64> {
        (0..=self.n_cells()).map(|j| self.length_m * (j as f64 / self.n_cells() as f64)).collect()
    }

    /// Positions of the cells' centres, m from the terminus.
    pub fn cell_x_m(&self) -> Vec<f64> {
        let n = self.n_cells() as f64;
        (0..self.n_cells()).map(|c| self.length_m * ((c as f64 + 0.5) / n)).collect()
    }

    /// Whether every value is finite and thickness, fluidity and length are positive.
    pub fn check(&self, n_cells: usize) -> Result<(), SolveError> {
        let bad = |what: String| Err(SolveError::UnusableState { what });
        if self.n_cells() != n_cells
            || self.fluidity_per_a.len() != n_cells
            || self.velocity_m_per_a.len() != n_cells + 1
            || self.mu_w.len() != n_cells + 1
        {
            return bad(format!("it has {} cells where n_cells = {n_cells}", self.n_cells()));
        }
        let finite = |v: &[f64]| v.iter().all(|x| x.is_finite());
        let positive = |v: &[f64]| v.iter().all(|x| x.is_finite() && *x > 0.0);
        if !finite(&self.velocity_m_per_a) || !finite(&self.mu_w) {
            return bad("a velocity or mu_w is not finite".into());
        }
        if !positive(&self.thickness_m) || !positive(&self.fluidity_per_a) {
            return bad("a thickness or fluidity is not positive".into());
        }
        if !(self.length_m.is_finite() && self.length_m > 0.0) {
            return bad(format!("its length is {} m", self.length_m));
        }
        Ok(())
    }
}

/// The paper's scales (Appendix B), applied to rows and unknowns in one place.
pub mod scale {
    /// \[U\], m a⁻¹.
    pub const VELOCITY: f64 = 5e4;
    /// \[L\], m.
    pub const LENGTH: f64 = 1e4;
    /// \[Ḃ\], m a⁻¹.
    pub const MASS_BALANCE: f64 = 100.0;
    /// \[H\] = \[L\]\[Ḃ\]/\[U\], m.
    pub const THICKNESS: f64 = LENGTH * MASS_BALANCE / VELOCITY;
    /// \[g\] = \[U\]/\[L\], a⁻¹.
    pub const FLUIDITY: f64 = VELOCITY / LENGTH;
    /// Of the momentum rows: \[H\]²/\[L\], m.
    pub const MOMENTUM: f64 = THICKNESS * THICKNESS / LENGTH;
    /// Of the fluidity rows: \[g\]/\[H\]², a⁻¹ m⁻².
    pub const FLUIDITY_CURVATURE: f64 = FLUIDITY / (THICKNESS * THICKNESS);
}

/// An unknown of the packed vector, or the row that belongs to it.
///
/// Packed cell by cell, U_j, H_{j+½}, g_{j+½}, then L, and all μ_w at the end: μ_w of a node touches
/// that node's equations alone and is eliminated before the rest is solved, which then stays within
/// six places of the diagonal but for L's column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Var {
    /// U at a node; row: momentum.
    U(usize),
    /// H in a cell; row: mass.
    H(usize),
    /// g^x in a cell; row: fluidity.
    G(usize),
    /// L; row: H_L = d.
    L,
    /// μ_w at a node; row: transverse problem.
    Mu(usize),
    /// U_c where a calving law sets it; row: the law. Not packed, since the law gives it outright.
    Calving,
}

impl Var {
    /// Place in the packed vector of N cells; none for [`Var::Calving`].
    #[inline(always)]
    pub fn index(self, n_cells: usize) -> Option<usize> {
        match self {
            Var::U(j) => Some(3 * j),
            Var::H(c) => Some(3 * c + 1),
            Var::G(c) => Some(3 * c + 2),
            Var::L => Some(3 * n_cells + 1),
            Var::Mu(j) => Some(core_unknowns(n_cells) + j),
            Var::Calving => None,
        }
    }

    /// Unit of the packed unknown in SI metres and years.
    #[inline(always)]
    pub fn scale(self) -> f64 {
        match self {
            Var::U(_) | Var::Calving => scale::VELOCITY,
            Var::Mu(_) => 1.0,
            Var::H(_) => scale::THICKNESS,
            Var::G(_) => scale::FLUIDITY,
            Var::L => scale::LENGTH,
        }
    }
}

/// Number of unknowns for N cells: 4N + 3.
pub fn unknowns(n_cells: usize) -> usize {
    4 * n_cells + 3
}

/// Number of unknowns but μ_w, which come first: 3N + 2.
pub fn core_unknowns(n_cells: usize) -> usize {
    3 * n_cells + 2
}

impl State {
    /// Writes the nondimensional packed vector.
    pub fn pack(&self, out: &mut [f64]) {
        let n = self.n_cells();
        let (core, mu_w) = out.split_at_mut(core_unknowns(n));
        mu_w.copy_from_slice(&self.mu_w);
        for j in 0..=n {
            core[3 * j] = self.velocity_m_per_a[j] / scale::VELOCITY;
        }
        for c in 0..n {
            core[3 * c + 1] = self.thickness_m[c] / scale::THICKNESS;
            core[3 * c + 2] = self.fluidity_per_a[c] / scale::FLUIDITY;
        }
        core[3 * n + 1] = self.length_m / scale::LENGTH;
    }

    /// Reads the nondimensional packed vector.
    pub fn unpack(&mut self, packed: &[f64]) {
        let n = self.n_cells();
        let (core, mu_w) = packed.split_at(core_unknowns(n));
        self.mu_w.copy_from_slice(mu_w);
        for j in 0..=n {
            self.velocity_m_per_a[j] = core[3 * j] * scale::VELOCITY;
        }
        for c in 0..n {
            self.thickness_m[c] = core[3 * c + 1] * scale::THICKNESS;
            self.fluidity_per_a[c] = core[3 * c + 2] * scale::FLUIDITY;
        }
        self.length_m = core[3 * n + 1] * scale::LENGTH;
    }
}
