//! How a steady state changes with what it is given: to first order, from its Jacobian. Knows no equation.
//!
//! With F(x, p) = 0 and J = ∂F/∂x a quantity Q(x, p) of the steady state changes by
//!
//! ```text
//!   dQ/dp = ∂Q/∂p − λᵀ ∂F/∂p,   Jᵀλ = ∂Q/∂x   (adjoint: one solve for all p), or
//!   dx/dp = −J⁻¹ ∂F/∂p                         (tangent: one solve for all Q).
//! ```
//!
//! Both are exact but where a cell or a point of a transect lies on a kink of the rheology; a
//! derivative is then that of its own side.

use crate::branch::stability::Spectrum;
use crate::control::{Control, Setting};
use crate::error::{NewtonFailure, SolveError};
use crate::force::{force_n_per_m, force_quasi_static_n_per_m, volume_m3};
use crate::newton::Linear;
use crate::physics::continuity::MassBalance;
use crate::physics::given::{Given, Rates};
use crate::physics::jacobian::Jacobian;
use crate::physics::terminus::Force;
use crate::physics::{Equations, Problem, Scratch, Sink};
use crate::state::{State, Var, unknowns};

/// A number of a steady state that is differentiated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// L, m.
    Length,
    /// H₀, m.
    Thickness0,
    /// F/W of Eq. 30, N m⁻¹.
    Force,
    /// Its quasi-static estimate, N m⁻¹.
    ForceQuasiStatic,
    /// U_L, m a⁻¹.
    VelocityEnd,
    /// V, m³.
    Volume,
}

/// A quantity and its derivatives.
#[derive(Debug, Clone, PartialEq)]
pub struct Sensitivity {
    /// Which one.
    pub quantity: Quantity,
    /// Its value.
    pub value: f64,
    /// dQ/dp for each parameter, per the parameter's unit.
    pub by: Rates,
    /// By α₀ of the calving law, per m a⁻¹; 0 without one.
    pub by_law_rate: f64,
    /// By the melt rate of each cell, per m a⁻¹: \[N\]. N times this is the functional derivative by melt(χ).
    pub by_melt: Vec<f64>,
}

impl Quantity {
    /// All of them.
    pub const ALL: [Quantity; 6] = [
        Self::Length,
        Self::Thickness0,
        Self::Force,
        Self::ForceQuasiStatic,
        Self::VelocityEnd,
        Self::Volume,
    ];

    /// Name at every boundary.
    pub fn name(self) -> &'static str {
        match self {
            Self::Length => "length_m",
            Self::Thickness0 => "thickness_0_m",
            Self::Force => "force_n_per_m",
            Self::ForceQuasiStatic => "force_quasi_static_n_per_m",
            Self::VelocityEnd => "velocity_end_m_per_a",
            Self::Volume => "volume_m3",
        }
    }

    /// Its value at a state.
    pub fn value(self, setting: &Setting, s: &State) -> f64 {
        match self {
            Self::Length => s.length_m,
            Self::Thickness0 => s.thickness_0_m(),
            Self::Force => force_n_per_m(s),
            Self::ForceQuasiStatic => force_quasi_static_n_per_m(s),
            Self::VelocityEnd => s.velocity_m_per_a[s.n_cells()],
            Self::Volume => volume_m3(&setting.model, s, 0.0),
        }
    }

    /// ∂Q/∂(packed unknowns) into `out`; ∂Q/∂p by what Q reads besides the state.
    fn slopes(self, setting: &Setting, s: &State, out: &mut Slopes) -> Rates {
        out.by.fill(0.0);
        let mut explicit = [0.0; Given::ALL.len()];
        let mut add = |var: Var, value: f64| out.slope(Var::Calving, var, value);
        match self {
            Self::Length => add(Var::L, 1.0),
            Self::Thickness0 | Self::ForceQuasiStatic => {
                let h0 = s.thickness_0_m();
                let is_force = self == Self::ForceQuasiStatic;
                let by_h0 = if is_force { 2.0 * force_quasi_static_n_per_m(s) / h0 } else { 1.0 };
                add(Var::H(0), 1.5 * by_h0);
                add(Var::H(1), -0.5 * by_h0);
            }
            Self::Force => Force::at(s).slopes(s, 1.0, out),
            Self::VelocityEnd => add(Var::U(s.n_cells()), 1.0),
            Self::Volume => {
                let (n, dx_m) = (s.n_cells() as f64, s.dx_m());
                for (c, (h, x_m)) in s.thickness_m.iter().zip(s.cell_x_m()).enumerate() {
                    let width_m = setting.model.fjord.width(x_m);
                    add(Var::H(c), width_m * dx_m);
                    let by_length =
                        width_m / n + setting.model.fjord.slope(x_m) * dx_m * (x_m / s.length_m);
                    add(Var::L, h * by_length);
                    explicit[Given::Width as usize] += h * dx_m;
                    explicit[Given::WidthGradient as usize] += h * dx_m * x_m;
                }
            }
        }
        explicit
    }
}

/// Slopes of one quantity by the packed unknowns.
struct Slopes {
    n_cells: usize,
    by: Vec<f64>,
}

impl Sink for Slopes {
    fn residual(&mut self, _: Var, _: f64) {}

    fn slope(&mut self, _: Var, by: Var, value: f64) {
        if let Some(place) = by.index(self.n_cells) {
            self.by[place] += value * by.scale();
        }
    }
}

impl Sensitivity {
    /// dQ/dp along a control.
    pub fn by_control(&self, control: Control, setting: &Setting, s: &State) -> f64 {
        let rates = control.rates(setting, s);
        let by_law = rates[Given::CalvingRate as usize] * self.by_law_rate;
        by_law + rates.iter().zip(&self.by).map(|(rate, by)| rate * by).sum::<f64>()
    }
}

/// A steady state with its equations linearised there.
#[derive(Debug)]
pub struct Linearised<'a> {
    setting: &'a Setting,
    state: &'a State,
    x: Vec<f64>,
    scratch: Scratch,
    /// Before and after factorisation.
    assembled: Jacobian,
    jacobian: Jacobian,
}

impl<'a> Linearised<'a> {
    /// Linearises at a state that solves the setting.
    pub fn at(setting: &'a Setting, state: &'a State) -> Result<Self, SolveError> {
        let n = setting.model.parameters().n_cells;
        state.check(n)?;
        let mut this = Self {
            setting,
            state,
            x: vec![0.0; unknowns(n)],
            scratch: Scratch::new(n),
            assembled: Jacobian::zeros(n),
            jacobian: Jacobian::zeros(n),
        };
        state.pack(&mut this.x);
        let mut residual = vec![0.0; unknowns(n)];
        let mut equations = Equations::new(steady_problem(setting, 0.0), &mut this.scratch);
        let linearised = crate::newton::System::linearise(
            &mut equations,
            &this.x,
            &mut residual,
            &mut this.assembled,
        );
        linearised.map_err(|_| outside())?;
        this.jacobian.clone_from(&this.assembled);
        this.jacobian.factorise().map_err(|_| SolveError::NotConverged {
            stage: "differentiating a steady state",
            iterations: 0,
            residual_norm: residual.iter().map(|r| r * r).sum::<f64>().sqrt(),
            reason: NewtonFailure::Singular,
            history: Vec::new(),
        })?;
        Ok(this)
    }

    /// Growth rates of small perturbations.
    pub fn spectrum(&self) -> Option<Spectrum> {
        Spectrum::of(self.assembled.clone(), self.state)
    }

    /// A quantity's derivatives by everything, by one adjoint solve.
    pub fn sensitivity(&mut self, quantity: Quantity) -> Result<Sensitivity, SolveError> {
        let n = self.state.n_cells();
        let mut slopes = Slopes { n_cells: n, by: vec![0.0; self.x.len()] };
        let explicit = quantity.slopes(self.setting, self.state, &mut slopes);
        let mut weights = slopes.by;
        self.jacobian.solve_transposed(&mut weights);
        let mut by_melt = vec![0.0; n];
        let mut equations = Equations::new(steady_problem(self.setting, 0.0), &mut self.scratch);
        let weighted = equations.weighted_slopes(&self.x, &weights, &mut by_melt);
        let mut by = explicit;
        for (by, weighted) in by.iter_mut().zip(weighted.map_err(|_| outside())?) {
            *by -= weighted;
        }
        by_melt.iter_mut().for_each(|by| *by = -*by);
        // A law sets the calving rate, whatever the parameter is.
        let of_rate = &mut by[Given::CalvingRate as usize];
        let by_law_rate = if self.setting.law.is_some() { std::mem::take(of_rate) } else { 0.0 };
        let value = quantity.value(self.setting, self.state);
        Ok(Sensitivity { quantity, value, by, by_law_rate, by_melt })
    }

    /// d(state)/dp along a control, every number per the control's unit, by one solve.
    pub fn tangent(&mut self, control: Control) -> Result<State, SolveError> {
        let n = self.state.n_cells();
        let rates = control.rates(self.setting, self.state);
        let (mut residual, mut column) = (vec![0.0; self.x.len()], vec![0.0; self.x.len()]);
        let mut unused = Jacobian::zeros(n);
        let mut equations = Equations::new(steady_problem(self.setting, 0.0), &mut self.scratch);
        equations
            .linearise_along(&self.x, &mut residual, &mut unused, &rates, &mut column)
            .map_err(|_| outside())?;
        column.iter_mut().for_each(|entry| *entry = -*entry);
        self.jacobian.solve(&mut column);
        let mut tangent = State::zeros(n);
        tangent.unpack(&column);
        Ok(tangent)
    }
}

/// The steady equations of a setting, smoothed by ε.
pub(crate) fn steady_problem(setting: &Setting, smoothing: f64) -> Problem<'_> {
    let model = &setting.model;
    Problem {
        parameters: &model.parameters,
        fjord: &model.fjord,
        melt_shape: &model.melt_shape,
        closure: model.closure,
        balance: MassBalance::Steady,
        advance: setting.advance(),
        smoothing,
        relaxation: None,
    }
}

fn outside() -> SolveError {
    SolveError::UnusableState { what: "it lies outside the model's domain".into() }
}
