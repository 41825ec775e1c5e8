//! The quasi-one-dimensional ice mélange model of Amundson, Robel, Burton and Nissanka
//! (The Cryosphere 19, 19–35, 2025), as a pure solver in f64: parameters in, states and forces out.
//! It knows no server, no files, no clock and starts no threads.
//!
//! Five coupled equations for velocity U, fluidity g^x, friction at the walls μ_w, thickness H and
//! length L, on a grid that stretches from the glacier terminus to where the mélange has thinned to
//! the size d of its icebergs.
//!
//! | paper | here |
//! |---|---|
//! | Eq. 21, C2, C3: balance of stresses; Eqs. 22, 23: its ends | [`physics::momentum::residual`] |
//! | Eqs. 16–18, C4: longitudinal fluidity | [`physics::fluidity::residual`] |
//! | Eqs. 24–26, C5, C6: transverse problem | [`physics::sidewall`]; its profiles: [`transect`] |
//! | Eq. 27, C7, C9: mass; C1: H_L = d | [`physics::continuity::residual`] |
//! | C8 and what replaces it | [`physics::closure`] |
//! | Eq. 31 and other calving laws | [`physics::terminus`] |
//! | Eqs. 29, 30: force on the terminus | [`force`] |
//! | Eq. 28, budget, caveats | [`diagnose`] |
//! | Appendix B: scales | [`state::scale`] |
//! | §3.1: steady states; quasi-static states | [`steady`]; [`quasi_static`] |
//! | §3.2: transients, seasons | [`transient`], [`forcing`] |
//!
//! What the paper has not, from the same equations:
//!
//! | question | here |
//! |---|---|
//! | branches of steady states along a parameter, folds, thresholds of collapse | [`branch`], [`control`] |
//! | growth rates of small perturbations | [`branch::stability`] |
//! | derivatives of a steady state by what it is given | [`sensitivity`], [`physics::given`] |
//! | the other roots of the discrete problem | [`roots`] |
//! | parameters from observations, and how well they are known | [`calibration`] |
//!
//! A [`Model`] is what is solved for; a [`Solver`] keeps the buffers:
//!
//! ```
//! use melange_solver::params::Parameters;
//! use melange_solver::physics::closure::UpstreamClosure;
//! use melange_solver::steady::SteadyVerdict;
//! use melange_solver::{Model, Solver, force};
//!
//! let parameters = Parameters { melt_rate_m_per_day: 0.7, ..Parameters::default() };
//! let model = Model::new(parameters, UpstreamClosure::Published)?;
//! if let SteadyVerdict::Converged { solution, .. } = Solver::new(model).steady(None)? {
//!     let force = force::force_n_per_m(&solution.state);
//!     assert!((force - 5.021e6).abs() < 1e3);
//! }
//! # Ok::<(), melange_solver::error::SolveError>(())
//! ```
//!
//! # The closure at the terminus decides the force
//!
//! U₀H₀ = U_cH_t serves the momentum equation; the mass equation is left without a condition where its
//! characteristics enter, and what is put there ([`physics::closure`]) moves the force by a quarter. Base
//! case; the order is that observed on the last three grids, and F/W is in 10⁶ N/m. What the other
//! cases of the paper's figures say: `docs/reproduction.md`.
//!
//! | closure | N | H₀ m | L m | F/W | order of H₀, L, F |
//! |---|---|---|---|---|---|
//! | `published`, ∂²H/∂x² = 0 | 50 | 149.415 | 12048.0 | 8.1563 | |
//! | | 100 | 149.555 | 12013.5 | 8.1286 | |
//! | | 200 | 149.234 | 11996.4 | 8.1006 | |
//! | | 400 | 148.458 | 11987.6 | 8.0642 | not asymptotic, 0.97, not asymptotic |
//! | `no_stretching`, ∂U/∂x = 0 | 50 | 112.115 | 11932.1 | 6.1047 | |
//! | | 100 | 112.211 | 11907.2 | 6.1152 | |
//! | | 200 | 112.258 | 11894.4 | 6.1203 | |
//! | | 400 | 112.282 | 11887.9 | 6.1229 | 1.01, 0.98, 1.01 |
//! | `printed`, C8 | 50 | 83…149 | | 3.95…8.2 | none: a family, the start picks the member |
//!
//! # Deviations from the printed paper
//!
//! Effects are those on the base case at N = 50: H₀ = 149.4 m, L = 12,048 m, F/W = 8.156·10⁶ N/m.
//!
//! 1. Eqs. 3 and 5 print (1 − ρ_w/ρ), which is negative; (1 − ρ/ρ_w) is used. As printed there is no
//!    pressure and no solution.
//! 2. C1 lacks a division by two; H_L is the linear extrapolation (3H_{N−½} − H_{N−3/2})/2. As printed the
//!    mélange would end at H = d/2: H₀ = 126.0 m, L = 13,264 m, F/W = 5.50·10⁶ N/m.
//! 3. Eq. 22 takes H₀ extrapolated in the same way, not the first cell's thickness, with which H₀ = 153.3 m,
//!    L = 12,248 m, F/W = 8.59·10⁶ N/m.
//! 4. C6 lacks Eq. 26's factor two, which stays. Without it H₀ = 182.4 m, L = 12,539 m,
//!    F/W = 12.4·10⁶ N/m.
//! 5. C8 leaves the steady state undetermined (members with H₀ from 83 to 149 m and F/W from 3.95 to
//!    8.2·10⁶ N/m have been found, depending on the start); by default the first mass row is H½ − 2H₃⸝₂ + H₅⸝₂ = 0, which gives the paper's figures.
//! 6. δε̇, for which the paper prints no value, is 1 a⁻¹ and enters μ = (|ε̇_xx| + δε̇)/g^x alone. It is no
//!    numerical detail: 0.1 a⁻¹ gives H₀ = 269.0 m and F/W = 20.4·10⁶ N/m, 10 a⁻¹ gives 85.1 m and
//!    3.22·10⁶ N/m.
//! 7. The pressure in Eq. 17 along the fjord is the isometric P = P̃ g^x/(g^x + ε̇_xx) of the text, plain P̃
//!    across. With P̃ in both F/W = 8.149·10⁶ N/m.
//! 8. sgn(U) of Eq. 21 is the sign of the velocity relative to the walls, U + U_t − U_c; the same
//!    number wherever the paper's figures have U > 0, and the only one at rest, where U = 0.
//! 9. W is read at the bedrock position X₀ + χL, so that the walls stay where they are when the
//!    terminus moves; the same for a fixed terminus. With dW/dx = 0.02 a terminus that has advanced
//!    500 m meets walls 10 m wider, which moves the steady force by 1.0 %.
//! 10. Steps of controlled error are of second order; the paper's, backward Euler with Δt = 0.01 a, are in
//!     error by up to 0.4 % in H₀ and 0.8 % in F over the seasons of Fig. 7, and 1.1 % where the forcing is
//!     taken at the start of the step, as its scripts do (`Plan::is_lagged`).
//! 11. A calving law that asks for a negative rate gets 0, and the result says so.

pub mod branch;
pub mod calibration;
pub mod control;
pub mod diagnose;
pub mod diagnostic;
pub mod error;
pub mod fjord;
pub mod force;
pub mod forcing;
pub mod grid_error;
pub mod interpolate;
pub mod linalg;
pub mod melt;
pub mod newton;
pub mod observe;
pub mod params;
pub mod physics;
pub mod quasi_static;
pub mod roots;
pub mod sensitivity;
mod smoothing;
pub mod state;
pub mod steady;
mod timestep;
pub mod trail;
pub mod transect;
pub mod transient;

use error::SolveError;
use fjord::Fjord;
use melt::MeltShape;
use newton::{Limits, Root, Workspace};
use params::{ParameterError, Parameters};
use physics::closure::UpstreamClosure;
use physics::continuity::MassBalance;
use physics::fluidity::Relaxation;
use physics::jacobian::Jacobian;
use physics::terminus::Advance;
use physics::{Equations, Problem, Scratch};
use state::{State, unknowns};

/// A mélange to be solved for: checked parameters, fjord, shape of the melt rate and the closure at the
/// terminus.
#[derive(Debug, Clone, PartialEq)]
pub struct Model {
    parameters: Parameters,
    fjord: Fjord,
    melt_shape: MeltShape,
    closure: UpstreamClosure,
}

impl Model {
    /// A straight fjord of the parameters' width and gradient, with the same melt rate everywhere;
    /// refuses parameters that describe no mélange.
    pub fn new(parameters: Parameters, closure: UpstreamClosure) -> Result<Self, ParameterError> {
        parameters.check()?;
        let fjord = Fjord::straight(parameters.width_m, parameters.width_gradient);
        Ok(Self { parameters, fjord, melt_shape: MeltShape::default(), closure })
    }

    /// The same in another fjord, of which the parameters tell the width at x = 0 and the mean gradient.
    pub fn in_fjord(mut self, fjord: Fjord) -> Self {
        self.parameters.width_m = fjord.width(0.0);
        self.parameters.width_gradient = fjord.mean_gradient();
        Self { fjord, ..self }
    }

    /// The same with the melt rate spread otherwise.
    pub fn with_melt_shape(self, melt_shape: MeltShape) -> Self {
        Self { melt_shape, ..self }
    }

    /// The parameters.
    pub fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    /// The fjord.
    pub fn fjord(&self) -> &Fjord {
        &self.fjord
    }

    /// How the melt rate is spread along the mélange.
    pub fn melt_shape(&self) -> &MeltShape {
        &self.melt_shape
    }

    /// The same with parameters that a forcing or a calving law has set; they are not checked again.
    pub fn with_parameters(&self, parameters: Parameters) -> Self {
        Self { parameters, ..self.clone() }
    }

    /// Whether the tables of fjord and melt reach as far as a mélange of length L at X₀, in m.
    pub fn check_reach(&self, terminus_x_m: f64, length_m: f64) -> Result<(), SolveError> {
        let from_terminus =
            self.fjord.reach().map(|(first, last)| (first - terminus_x_m, last - terminus_x_m));
        for (table, reach) in
            [("fjord", from_terminus), ("melt_shape", self.melt_shape.reach(terminus_x_m))]
        {
            if let Some((first_m, last_m)) = reach
                && (first_m > 0.0 || last_m < length_m)
            {
                let to_x_m = |x: f64| x + terminus_x_m;
                return Err(SolveError::BeyondTable {
                    table,
                    first_x_m: to_x_m(first_m),
                    last_x_m: to_x_m(last_m),
                    from_x_m: terminus_x_m,
                    to_x_m: to_x_m(length_m),
                });
            }
        }
        Ok(())
    }

    /// The closure at the terminus.
    pub fn closure(&self) -> UpstreamClosure {
        self.closure
    }
}

/// A state that solves the equations, and what it took.
#[derive(Debug, Clone, PartialEq)]
pub struct Solution {
    /// The state.
    pub state: State,
    /// Newton iterations of the whole solve, all attempts together.
    pub iterations: usize,
    /// 2-norm of the nondimensional residual.
    pub residual_norm: f64,
}

/// What the solver asks of Newton's method.
#[derive(Debug, Clone, Copy)]
struct Task<'a> {
    balance: MassBalance<'a>,
    advance: Advance,
    smoothing: f64,
    relaxation: Option<Relaxation<'a>>,
}

impl<'a> Task<'a> {
    /// With a terminus at X₀ = 0, no smoothing and no pseudo-time.
    fn new(balance: MassBalance<'a>) -> Self {
        Self { balance, advance: Advance::fixed(0.0), smoothing: 0.0, relaxation: None }
    }

    fn smoothed(self, smoothing: f64) -> Self {
        Self { smoothing, ..self }
    }
}

/// Solves one model; keeps its buffers from solve to solve.
#[derive(Debug, Clone)]
pub struct Solver {
    model: Model,
    scratch: Scratch,
    newton: Workspace<Jacobian>,
    iterations: usize,
}

impl Solver {
    /// A solver for a model.
    pub fn new(model: Model) -> Self {
        let n = model.parameters.n_cells;
        let newton = Workspace::new(unknowns(n), Jacobian::zeros(n));
        Self { model, scratch: Scratch::new(n), newton, iterations: 0 }
    }

    /// The model.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// Turns to another model with the same number of cells, keeping the buffers.
    pub fn retarget(&mut self, model: Model) {
        if model.parameters.n_cells == self.model.parameters.n_cells {
            self.model = model;
        } else {
            *self = Self::new(model);
        }
    }

    /// Newton from the iterate in the workspace, which holds the root afterwards.
    fn solve_from_iterate(
        &mut self,
        task: Task<'_>,
        limits: Limits,
        stage: &'static str,
    ) -> Result<Root, SolveError> {
        let problem = Problem {
            parameters: &self.model.parameters,
            fjord: &self.model.fjord,
            melt_shape: &self.model.melt_shape,
            closure: self.model.closure,
            balance: task.balance,
            advance: task.advance,
            smoothing: task.smoothing,
            relaxation: task.relaxation,
        };
        let mut equations = Equations::new(problem, &mut self.scratch);
        let outcome = newton::solve(&mut equations, &mut self.newton, limits, stage);
        self.iterations += match &outcome {
            Ok(root) => root.iterations,
            Err(SolveError::NotConverged { iterations, .. }) => *iterations,
            Err(_) => 0,
        };
        outcome
    }

    /// The iterate as a solution.
    fn solution(&mut self, root: Root) -> Solution {
        let mut state = State::zeros(self.model.parameters.n_cells);
        state.unpack(&self.newton.x);
        Solution {
            state,
            iterations: std::mem::take(&mut self.iterations),
            residual_norm: root.residual_norm,
        }
    }
}
