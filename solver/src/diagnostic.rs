//! Velocity, fluidity and wall friction of a mélange whose geometry is given. Knows no time.

use crate::error::SolveError;
use crate::physics::continuity::MassBalance;
use crate::physics::local_fluidity_rate;
use crate::physics::sidewall::{self, Section};
use crate::smoothing::LEVELS;
use crate::state::State;
use crate::{Model, Solution, Solver, Task};

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
    sidewall::friction_for(p, &[speed], &mut section);
    // ∫ μ_w/W dx = folds, in a fjord whose width varies linearly.
    let mu = section[0].mu_w.abs();
    let gradient = model.fjord().slope(0.0);
    let length_m = if gradient == 0.0 {
        p.width_m / mu * folds
    } else {
        p.width_m / gradient * (folds * gradient / mu).exp_m1()
    };
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
        self.iterations = 0;
        self.model.check_reach(0.0, length_m)?;
        self.diagnostic_at(thickness_m, length_m, &LEVELS[..1])?;
        let root =
            self.follow(Task::new(MassBalance::Given { thickness_m, length_m }), LEVELS[0])?;
        Ok(self.solution(root))
    }

    /// The same at the given levels of smoothing only, the last of which the state belongs to.
    pub(crate) fn diagnostic_at(
        &mut self,
        thickness_m: &[f64],
        length_m: f64,
        levels: &[f64],
    ) -> Result<State, SolveError> {
        let stage = "solving for velocity, fluidity and friction at given geometry";
        let mut state = self.guess(thickness_m, length_m)?;
        state.pack(&mut self.newton.x);
        let task = Task::new(MassBalance::Given { thickness_m, length_m });
        for smoothing in levels {
            self.solve_or_relax(task.smoothed(*smoothing), stage)?;
        }
        state.unpack(&self.newton.x);
        Ok(state)
    }

    /// Plug flow at the inflow's speed, with the friction and the local fluidity that belong to it.
    pub(crate) fn guess(&self, thickness_m: &[f64], length_m: f64) -> Result<State, SolveError> {
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
                width_m: self.model.fjord().width(length_m * j as f64 / n as f64),
            })
            .collect();
        sidewall::friction_for(p, &vec![relative; n + 1], &mut sections);
        for (mu, section) in s.mu_w.iter_mut().zip(&sections) {
            *mu = section.mu_w;
        }
        Ok(s)
    }
}
