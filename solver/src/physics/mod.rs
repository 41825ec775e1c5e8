//! The five coupled equations, assembled: the only file that knows them all, and the only one that
//! scales rows and unknowns. Each equation's residual and Jacobian stand in a file of its own.

pub mod closure;
pub mod continuity;
pub mod fluidity;
pub mod momentum;
pub mod sidewall;

use crate::fjord::Fjord;
use crate::linalg::bordered::Bordered;
use crate::newton::{OutsideDomain, System};
use crate::params::{GRAVITY, ICE_DENSITY, Parameters, SECONDS_PER_YEAR, WATER_DENSITY};
use crate::state::{State, Var, scale, unknowns};
use closure::UpstreamClosure;
use continuity::MassBalance;
use fluidity::Relaxation;
use sidewall::{MeanSpeed, Section};

/// The Jacobian: a row reaches eight places to either side, and L's column is dense.
pub type Jacobian = Bordered<8, 8>;

/// What a term reports: residuals in the unit its documentation names, and their slopes.
pub trait Sink {
    /// Sets a row's residual.
    fn residual(&mut self, row: Var, value: f64);
    /// Adds ∂(row)/∂(unknown).
    fn slope(&mut self, row: Var, by: Var, value: f64);
}

/// Everything but the state that an equation may read.
#[derive(Debug, Clone, Copy)]
pub struct Medium<'a> {
    /// The parameters.
    pub parameters: &'a Parameters,
    /// The closure at the terminus.
    pub closure: UpstreamClosure,
    /// ε of the smoothed kinks in the longitudinal fluidity; 0 is the model.
    pub smoothing: f64,
    /// Pseudo-time of the fluidity; none in the model.
    pub relaxation: Option<Relaxation<'a>>,
    widths: &'a [f64],
    widths_by_length: &'a [f64],
}

impl Medium<'_> {
    /// W of a cell, m.
    #[inline]
    pub fn cell_width(&self, cell: usize) -> f64 {
        self.widths[cell]
    }

    /// ∂W/∂L of a cell at fixed χ.
    #[inline]
    pub fn cell_width_by_length(&self, cell: usize) -> f64 {
        self.widths_by_length[cell]
    }

    /// W at a node: mean of the two neighbours, the nearest cell's at the ends; m.
    #[inline]
    pub fn node_width(&self, node: usize) -> f64 {
        node_mean(self.widths, node)
    }

    /// ∂W/∂L at a node at fixed χ.
    #[inline]
    pub fn node_width_by_length(&self, node: usize) -> f64 {
        node_mean(self.widths_by_length, node)
    }
}

#[inline]
fn node_mean(cells: &[f64], node: usize) -> f64 {
    let n = cells.len();
    0.5 * (cells[node.saturating_sub(1)] + cells[node.min(n - 1)])
}

/// √(P̃/ρ)/(d b) in a⁻¹: the unit of g_loc (Eq. 17), with P̃ of Eq. 5 (sign as in the text).
#[inline]
pub fn local_fluidity_rate(p: &Parameters, thickness_m: f64) -> f64 {
    let pressure_by_density = 0.5 * GRAVITY * (1.0 - ICE_DENSITY / WATER_DENSITY) * thickness_m;
    pressure_by_density.sqrt() / (p.d_m * p.b) * SECONDS_PER_YEAR
}

/// What is solved: parameters, geometry, closure, and how mass is balanced.
#[derive(Debug, Clone, Copy)]
pub struct Problem<'a> {
    /// The parameters.
    pub parameters: &'a Parameters,
    /// The fjord.
    pub fjord: &'a Fjord,
    /// The closure at the terminus.
    pub closure: UpstreamClosure,
    /// Mass balance: steady, one time step, or given geometry.
    pub balance: MassBalance<'a>,
    /// X₀, the terminus' position along the bedrock, m.
    pub terminus_x_m: f64,
    /// ε of the smoothed kinks; 0 is the model.
    pub smoothing: f64,
    /// Pseudo-time of the fluidity; none in the model.
    pub relaxation: Option<Relaxation<'a>>,
}

/// Scratch space of an evaluation.
#[derive(Debug, Clone)]
pub struct Scratch {
    state: State,
    widths: Vec<f64>,
    widths_by_length: Vec<f64>,
    sections: Vec<Section>,
    speeds: Vec<MeanSpeed>,
}

impl Scratch {
    /// For N cells.
    pub fn new(n_cells: usize) -> Self {
        let section = Section { mu_w: 0.0, thickness_m: 0.0, width_m: 0.0 };
        Self {
            state: State::zeros(n_cells),
            widths: vec![0.0; n_cells],
            widths_by_length: vec![0.0; n_cells],
            sections: vec![section; n_cells + 1],
            speeds: vec![MeanSpeed::default(); n_cells + 1],
        }
    }
}

/// A [`Problem`] as Newton's method sees it: packed, nondimensional.
#[derive(Debug)]
pub struct Equations<'a> {
    problem: Problem<'a>,
    scratch: &'a mut Scratch,
}

impl<'a> Equations<'a> {
    /// The equations of a problem, evaluated in the given scratch space.
    pub fn new(problem: Problem<'a>, scratch: &'a mut Scratch) -> Self {
        Self { problem, scratch }
    }

    fn assemble<S: Sink>(&mut self, packed: &[f64], out: &mut S) -> Result<(), OutsideDomain> {
        let Scratch { state, widths, widths_by_length, sections, speeds } = &mut *self.scratch;
        let problem = &self.problem;
        state.unpack(packed);
        let n = state.n_cells();
        for c in 0..n {
            let chi = (c as f64 + 0.5) / n as f64;
            let x = problem.terminus_x_m + chi * state.length_m;
            widths[c] = problem.fjord.width(x);
            widths_by_length[c] = problem.fjord.slope(x) * chi;
        }
        let medium = Medium {
            parameters: problem.parameters,
            closure: problem.closure,
            smoothing: problem.smoothing,
            relaxation: problem.relaxation,
            widths,
            widths_by_length,
        };
        let ends = [0.0, state.length_m].map(|x| problem.fjord.width(problem.terminus_x_m + x));
        if !inside_domain(state, &ends) {
            return Err(OutsideDomain);
        }
        sidewall::sections(&medium, state, sections);
        sidewall::mean_speeds(problem.parameters, sections, speeds);
        momentum::residual(&medium, state, out);
        sidewall::residual(&medium, state, speeds, out);
        fluidity::residual(&medium, state, out);
        if let MassBalance::Given { thickness_m, length_m } = problem.balance {
            continuity::given(thickness_m, length_m, state, out);
        } else {
            let before = problem.balance.before();
            closure::first_row(&medium, before, state, out);
            continuity::residual(&medium, before, state, out);
        }
        Ok(())
    }

    fn rows(&self) -> RowScales {
        let given = matches!(self.problem.balance, MassBalance::Given { .. });
        RowScales {
            n: self.scratch.state.n_cells(),
            first_mass: 1.0 / if given { scale::THICKNESS } else { self.problem.closure.scale() },
            mass: 1.0 / if given { scale::THICKNESS } else { scale::MASS_BALANCE },
            length: 1.0 / if given { scale::LENGTH } else { scale::THICKNESS },
        }
    }
}

/// L, H, g, g + ε̇ are positive, and so are width and extrapolated thickness at both ends.
fn inside_domain(s: &State, widths_at_ends: &[f64]) -> bool {
    s.length_m > 0.0
        && widths_at_ends.iter().all(|w| *w > 0.0)
        && s.thickness_m.iter().all(|h| *h > 0.0)
        && s.thickness_0_m() > 0.0
        && s.thickness_end_m() > 0.0
        && s.fluidity_per_a
            .iter()
            .enumerate()
            .all(|(c, g)| *g > 0.0 && g + s.strain_rate_per_a(c) > 0.0)
}

/// Inverse units of the rows (Appendix B); those of the mass rows depend on what stands in them.
#[derive(Debug, Clone, Copy)]
struct RowScales {
    n: usize,
    first_mass: f64,
    mass: f64,
    length: f64,
}

impl RowScales {
    #[inline]
    fn inverse_of(&self, row: Var) -> f64 {
        match row {
            Var::U(0) | Var::Mu(_) => 1.0 / scale::VELOCITY,
            Var::U(j) if j == self.n => 1.0 / scale::VELOCITY,
            Var::U(_) => 1.0 / scale::MOMENTUM,
            Var::G(c) if c == 0 || c + 1 == self.n => 1.0 / scale::FLUIDITY,
            Var::G(_) => 1.0 / scale::FLUIDITY_CURVATURE,
            Var::H(0) => self.first_mass,
            Var::H(_) => self.mass,
            Var::L(_) => self.length,
        }
    }
}

struct ResidualOnly<'a> {
    rows: RowScales,
    residual: &'a mut [f64],
}

impl Sink for ResidualOnly<'_> {
    #[inline]
    fn residual(&mut self, row: Var, value: f64) {
        self.residual[row.index()] = value * self.rows.inverse_of(row);
    }

    #[inline]
    fn slope(&mut self, _: Var, _: Var, _: f64) {}
}

struct WithJacobian<'a> {
    rows: RowScales,
    residual: &'a mut [f64],
    jacobian: &'a mut Jacobian,
}

impl Sink for WithJacobian<'_> {
    #[inline]
    fn residual(&mut self, row: Var, value: f64) {
        self.residual[row.index()] = value * self.rows.inverse_of(row);
    }

    #[inline]
    fn slope(&mut self, row: Var, by: Var, value: f64) {
        let scaled = value * (by.scale() * self.rows.inverse_of(row));
        self.jacobian.add(row.index(), by.index(), scaled);
    }
}

impl System for Equations<'_> {
    fn unknowns(&self) -> usize {
        unknowns(self.scratch.state.n_cells())
    }

    fn residual(&mut self, x: &[f64], residual: &mut [f64]) -> Result<(), OutsideDomain> {
        let rows = self.rows();
        self.assemble(x, &mut ResidualOnly { rows, residual })
    }

    fn linearise(
        &mut self,
        x: &[f64],
        residual: &mut [f64],
        jacobian: &mut Jacobian,
    ) -> Result<(), OutsideDomain> {
        let rows = self.rows();
        jacobian.clear();
        self.assemble(x, &mut WithJacobian { rows, residual, jacobian })
    }

    fn longest_step(&self, x: &[f64], step: &[f64]) -> f64 {
        /// Share of the way to a bound that one step may go.
        const TOWARDS_BOUND: f64 = 0.9;
        let n = self.scratch.state.n_cells();
        let threshold = sidewall::threshold(self.problem.parameters);
        let mut longest = 1.0_f64;
        let mut bound = |room: f64, shrink: f64| {
            if shrink > TOWARDS_BOUND * room && room > 0.0 {
                longest = longest.min(TOWARDS_BOUND * room / shrink);
            }
        };
        for c in 0..n {
            for var in [Var::H(c), Var::G(c)] {
                bound(x[var.index()], -step[var.index()]);
            }
        }
        bound(x[Var::L(n).index()], -step[Var::L(n).index()]);
        for j in 0..=n {
            let mu = x[Var::Mu(j).index()];
            bound(mu.abs() - threshold, -step[Var::Mu(j).index()] * mu.signum());
        }
        longest
    }
}
