//! Velocity, fluidity and wall friction of a mélange whose geometry is given. Knows no time.

use crate::error::SolveError;
use crate::physics::continuity::MassBalance;
use crate::physics::local_fluidity_rate;
use crate::physics::sidewall::{self, Section};
use crate::physics::terminus::Advance;
use crate::smoothing::LEVELS;
use crate::state::State;
use crate::{Model, Solution, Solver, Task};

/// Relative accuracy of the friction that starts are made with.
const GUESS: f64 = 1e-3;

/// Steps along a fjord in search of a balanced wedge's end.
const WEDGE_STEPS: usize = 200;

/// A wedge: H falls linearly from `thickness_0_m` at x = 0 to d at x = L. \[N\] m.
pub fn wedge(model: &Model, thickness_0_m: f64) -> Vec<f64> {
    let p = model.parameters();
    let n = p.n_cells;
    (0..n).map(|c| thickness_0_m + (p.d_m - thickness_0_m) * (c as f64 + 0.5) / n as f64).collect()
}

/// A mélange in which friction at the walls alone bears the load: H = d·exp(∫μ_w/W dx), the
/// quasi-static profile (dH/dx = −μ_wH/W), with the friction that belongs to the inflow's speed.
/// Returns H: \[N\] m and L in m. It needs no stretching to stand, so it is a good start.
pub fn balanced_wedge(model: &Model, thickness_0_m: f64) -> (Vec<f64>, f64) {
    let p = model.parameters();
    let n = p.n_cells;
    let folds = (thickness_0_m / p.d_m).ln();
    let walls = p.terminus_velocity_m_per_a - p.calving_rate_m_per_a;
    let speed = p.calving_flux_m2_per_a() / thickness_0_m + walls;
    let mut section =
        [Section { mu_w: 0.0, thickness_m: 0.5 * (thickness_0_m + p.d_m), width_m: p.width_m }];
    sidewall::friction_for(p, &[speed], &mut section, GUESS);
    // ∫ μ_w/W dx = folds: in s = ∫ dx/W the fjord is dx/ds = W, stepped by the midpoint rule.
    let ds = folds / section[0].mu_w.abs() / WEDGE_STEPS as f64;
    let fjord = model.fjord();
    let length_m = (0..WEDGE_STEPS)
        .fold(0.0, |x_m, _| x_m + ds * fjord.width(x_m + 0.5 * ds * fjord.width(x_m)));
    // ln(H/d) = ∫ μ_w/W dx from x to L, by the cells' widths.
    let x_m = |c: usize| length_m * (c as f64 + 0.5) / n as f64;
    let nearness: Vec<f64> = (0..n).map(|c| model.fjord().width(x_m(c)).recip()).collect();
    let total: f64 = nearness.iter().sum();
    let mut passed = 0.0;
    let thickness = nearness
        .iter()
        .map(|near| {
            passed += near;
            p.d_m * (folds * (1.0 - (passed - 0.5 * near) / total)).exp()
        })
        .collect();
    (thickness, length_m)
}

/// What a diagnostic solve is given.
#[derive(Debug, Clone, Copy)]
pub struct Geometry<'a> {
    /// H: \[N\] m.
    pub thickness_m: &'a [f64],
    /// L, m.
    pub length_m: f64,
    /// X₀, m.
    pub terminus_x_m: f64,
}

impl<'a> Geometry<'a> {
    fn task(self) -> Task<'a> {
        let Self { thickness_m, length_m, terminus_x_m } = self;
        let advance = Advance::fixed(terminus_x_m);
        Task { advance, ..Task::new(MassBalance::Given { thickness_m, length_m }) }
    }
}

impl Solver {
    /// Solves for U, g^x and μ_w with H (\[N\] m) and L (m) given.
    ///
    /// The kinks of the rheology are smoothed away first and brought back in steps, so that the
    /// answer does not hang on the starting guess.
    pub fn diagnostic(
        &mut self,
        thickness_m: &[f64],
        length_m: f64,
    ) -> Result<Solution, SolveError> {
        self.diagnostic_in(Geometry { thickness_m, length_m, terminus_x_m: 0.0 })
    }

    /// The same with the terminus anywhere along the fjord.
    pub fn diagnostic_in(&mut self, geometry: Geometry<'_>) -> Result<Solution, SolveError> {
        self.iterations = 0;
        self.model.check_reach(geometry.terminus_x_m, geometry.length_m)?;
        self.smoothed_diagnostic(geometry, &LEVELS[..1])?;
        let root = self.follow(geometry.task(), LEVELS[0])?;
        Ok(self.solution(root))
    }

    /// The same, sought first from the velocity, fluidity and friction of a state of another geometry.
    pub fn diagnostic_near(
        &mut self,
        geometry: Geometry<'_>,
        near: &State,
    ) -> Result<Solution, SolveError> {
        let stage = "solving for velocity, fluidity and friction from those of another geometry";
        self.iterations = 0;
        self.model.check_reach(geometry.terminus_x_m, geometry.length_m)?;
        let thickness_m = geometry.thickness_m.to_vec();
        let start = State { thickness_m, length_m: geometry.length_m, ..near.clone() };
        start.check(self.model.parameters.n_cells)?;
        start.pack(&mut self.newton.x);
        self.solve_or_relax(geometry.task().smoothed(LEVELS[0]), stage)?;
        let root = self.follow(geometry.task(), LEVELS[0])?;
        Ok(self.solution(root))
    }

    /// At the given levels of smoothing only, the last of which the state belongs to.
    pub(crate) fn smoothed_diagnostic(
        &mut self,
        geometry: Geometry<'_>,
        levels: &[f64],
    ) -> Result<State, SolveError> {
        let stage = "solving for velocity, fluidity and friction at given geometry";
        let mut state = self.guess(geometry)?;
        state.pack(&mut self.newton.x);
        for smoothing in levels {
            self.solve_or_relax(geometry.task().smoothed(*smoothing), stage)?;
        }
        state.unpack(&self.newton.x);
        Ok(state)
    }

    /// Plug flow at the inflow's speed, with the friction and the local fluidity that belong to it.
    pub(crate) fn guess(&self, geometry: Geometry<'_>) -> Result<State, SolveError> {
        let Geometry { thickness_m, length_m, terminus_x_m } = geometry;
        let p = self.model.parameters();
        let n = p.n_cells;
        if thickness_m.len() != n {
            let what = format!("it has {} cells where n_cells = {n}", thickness_m.len());
            return Err(SolveError::UnusableState { what });
        }
        let mut s = State::zeros(n);
        s.length_m = length_m;
        s.thickness_m.copy_from_slice(thickness_m);
        let speed = p.calving_flux_m2_per_a() / s.thickness_0_m();
        s.velocity_m_per_a.fill(speed);
        for (c, g) in s.fluidity_per_a.iter_mut().enumerate() {
            // g = g_loc at ε̇ = 0, where μ = δε̇/g.
            let rate = local_fluidity_rate(p, s.thickness_m[c]);
            *g = rate / (1.0 + rate * p.mu_s / p.strain_rate_regularisation_per_a);
        }
        s.check(n)?;
        let relative = speed + p.terminus_velocity_m_per_a - p.calving_rate_m_per_a;
        let mut sections: Vec<Section> = (0..=n)
            .map(|j| Section {
                mu_w: 0.0,
                thickness_m: 0.5
                    * (s.thickness_m[j.saturating_sub(1)] + s.thickness_m[j.min(n - 1)]),
                width_m: self.model.fjord().width(terminus_x_m + length_m * j as f64 / n as f64),
            })
            .collect();
        sidewall::friction_for(p, &vec![relative; n + 1], &mut sections, GUESS);
        for (mu, section) in s.mu_w.iter_mut().zip(&sections) {
            *mu = section.mu_w;
        }
        Ok(s)
    }
}
