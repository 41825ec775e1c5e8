//! The quasi-static regime: nothing calves, melts or leaves, and the terminus pushes a mélange of given
//! size along. Straight to the limit that time only approaches. Knows no equation.
//!
//! In the terminus frame U = 0 for any length, so that the state is fixed only with one of length,
//! thickness at the terminus or volume. The balance of stresses is then dH/dx = −μ_w H/W with the
//! friction μ_w that belongs to the speed U_t (Amundson & Burton 2018), and F/W = 485.67 H₀².

use crate::error::SolveError;
use crate::force;
use crate::newton::Root;
use crate::params::{ParameterError, Parameters};
use crate::physics::continuity::MassBalance;
use crate::physics::quasi_static::Size;
use crate::physics::sidewall::{self, Section};
use crate::smoothing::LEVELS;
use crate::{Model, Solution, Solver, Task};

/// What is given of a mélange at rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Given {
    /// L, m.
    Length(f64),
    /// H₀, m; between d and H_t.
    Thickness0(f64),
    /// ∫HW dx by the cells' values, m³.
    Volume(f64),
}

/// How a quasi-static solve ended.
#[derive(Debug, Clone, PartialEq)]
pub enum QuasiStaticVerdict {
    /// The state at rest.
    Converged(Solution),
    /// A mélange of that size would be at least as thick as the glacier; with evidence.
    Overthick(String),
}

/// Relative width of the bracket at which a volume counts as met.
const VOLUME_TOLERANCE: f64 = 1e-13;
/// Most solves in the search for a volume.
const VOLUME_SOLVES: usize = 80;

impl Model {
    /// The same without calving and melt, which is what the quasi-static regime means.
    pub fn at_rest(&self) -> Self {
        let parameters =
            Parameters { calving_rate_m_per_a: 0.0, melt_rate_m_per_day: 0.0, ..self.parameters };
        Self { parameters, ..self.clone() }
    }

    /// Refuses a terminus that does not push: friction of a mélange that stands still is undetermined.
    pub fn check_quasi_static(&self) -> Result<(), ParameterError> {
        let velocity = self.parameters.terminus_velocity_m_per_a;
        if velocity > 0.0 {
            return Ok(());
        }
        Err(ParameterError::Contradiction {
            name: "terminus_velocity_m_per_a",
            value: velocity,
            permitted: "above 0 m a-1: friction at the walls is undetermined where nothing moves"
                .into(),
        })
    }
}

impl Solver {
    /// The mélange at rest of the given size, in front of a terminus that advances at U_t. The model's
    /// calving and melt rates are taken as 0.
    pub fn quasi_static(&mut self, given: Given) -> Result<QuasiStaticVerdict, SolveError> {
        self.model.check_quasi_static()?;
        self.iterations = 0;
        let model = self.model.clone();
        self.model = model.at_rest();
        let verdict = self.at_rest(given);
        self.model = model;
        verdict
    }

    fn at_rest(&mut self, given: Given) -> Result<QuasiStaticVerdict, SolveError> {
        let terminus_thickness_m = self.model.parameters.terminus_thickness_m;
        let root = match given {
            Given::Thickness0(thickness_m) => {
                self.rest(Size::Thickness0(thickness_m), thickness_m)?
            }
            Given::Length(length_m) => {
                let guess = self.wedge_thickness_m(length_m);
                if guess >= terminus_thickness_m {
                    // No wedge that thick is worth solving for if one as thick as the glacier is shorter.
                    let (longest_m, _) = self.largest()?;
                    if length_m >= longest_m {
                        return Ok(QuasiStaticVerdict::Overthick(format!(
                            "at rest the mélange is as thick as the terminus, {terminus_thickness_m} m, \
                             when it is {longest_m:.0} m long"
                        )));
                    }
                }
                self.rest(Size::Length(length_m), guess.min(terminus_thickness_m))?
            }
            Given::Volume(volume_m3) => {
                let (_, largest_m3) = self.largest()?;
                if volume_m3 >= largest_m3 {
                    return Ok(QuasiStaticVerdict::Overthick(format!(
                        "at rest the mélange is as thick as the terminus, {terminus_thickness_m} m, \
                         when its volume is {largest_m3:.4e} m3"
                    )));
                }
                self.of_volume(volume_m3)?
            }
        };
        let mut solution = self.solution(root);
        // What is left of U is rounding.
        solution.state.velocity_m_per_a.fill(0.0);
        let h0 = solution.state.thickness_0_m();
        self.model.check_reach(0.0, solution.state.length_m)?;
        Ok(if h0 >= terminus_thickness_m {
            QuasiStaticVerdict::Overthick(format!(
                "at rest the mélange would be {h0:.1} m thick at the terminus, which is \
                 {terminus_thickness_m} m thick"
            ))
        } else {
            QuasiStaticVerdict::Converged(solution)
        })
    }

    /// Solves for a size, from a wedge of about that thickness.
    fn rest(&mut self, size: Size, thickness_0_m: f64) -> Result<Root, SolveError> {
        let stage = "solving for a mélange at rest";
        let (thickness_m, length_m) = crate::diagnostic::balanced_wedge(&self.model, thickness_0_m);
        let mut guess = self.guess(&thickness_m, length_m)?;
        if let Size::Length(length_m) = size {
            guess.length_m = length_m;
        }
        guess.pack(&mut self.newton.x);
        let task = Task::new(MassBalance::AtRest(size));
        self.solve_or_relax(task.smoothed(LEVELS[0]), stage)?;
        self.follow(task, LEVELS[0])
    }

    /// Length in m and volume in m³ of the mélange that is as thick as the glacier.
    fn largest(&mut self) -> Result<(f64, f64), SolveError> {
        let thickness_m = self.model.parameters.terminus_thickness_m;
        self.rest(Size::Thickness0(thickness_m), thickness_m)?;
        let mut state = crate::state::State::zeros(self.model.parameters.n_cells);
        state.unpack(&self.newton.x);
        Ok((state.length_m, force::volume_m3(&self.model, &state, 0.0)))
    }

    /// The volume grows with H₀, which is sought between d and H_t: false position with the weights of
    /// Anderson & Björck (1973), in the logarithm of the volume.
    fn of_volume(&mut self, volume_m3: f64) -> Result<Root, SolveError> {
        let p = self.model.parameters;
        // A mélange with H₀ = d has no length and no volume.
        let (mut low_m, mut high_m) = (p.d_m, p.terminus_thickness_m);
        let (mut below, mut above) = (None, None);
        let mut state = crate::state::State::zeros(p.n_cells);
        for _ in 0..VOLUME_SOLVES {
            let thickness_m = match (below, above) {
                (Some(below), Some(above)) => {
                    let between: f64 = (low_m * above - high_m * below) / (above - below);
                    between.clamp(low_m, high_m)
                }
                _ => 0.5 * (low_m + high_m),
            };
            let root = self.rest(Size::Thickness0(thickness_m), thickness_m)?;
            state.unpack(&self.newton.x);
            let miss = (force::volume_m3(&self.model, &state, 0.0) / volume_m3).ln();
            let is_met = miss.abs() < VOLUME_TOLERANCE
                || high_m - low_m < VOLUME_TOLERANCE * high_m
                || thickness_m <= low_m
                || thickness_m >= high_m;
            if is_met {
                return Ok(root);
            }
            let weight = |old: f64| if 1.0 - miss / old > 0.0 { 1.0 - miss / old } else { 0.5 };
            if miss > 0.0 {
                below = below.zip(above).map_or(below, |(b, a)| Some(b * weight(a)));
                (high_m, above) = (thickness_m, Some(miss));
            } else {
                above = below.zip(above).map_or(above, |(b, a)| Some(a * weight(b)));
                (low_m, below) = (thickness_m, Some(miss));
            }
        }
        Err(SolveError::UnusableState { what: format!("no H0 gives the volume {volume_m3} m3") })
    }

    /// H₀ of a wedge of that length with the friction of its thin end.
    fn wedge_thickness_m(&self, length_m: f64) -> f64 {
        let p = &self.model.parameters;
        let mut thin = [Section { mu_w: 0.0, thickness_m: p.d_m, width_m: p.width_m }];
        sidewall::friction_for(p, &[p.terminus_velocity_m_per_a], &mut thin);
        let fjord = &self.model.fjord;
        let folds: f64 = (0..p.n_cells)
            .map(|c| {
                let width = fjord.width(length_m * (c as f64 + 0.5) / p.n_cells as f64);
                thin[0].mu_w * length_m / p.n_cells as f64 / width.max(1.0)
            })
            .sum();
        p.d_m * folds.exp()
    }
}
