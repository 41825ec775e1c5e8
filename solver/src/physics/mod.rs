//! The five coupled equations, assembled: the only file that knows them all, and the only one that
//! scales rows and unknowns. Each equation's residual and Jacobian stand in a file of its own.

pub mod closure;
pub mod continuity;
pub mod fluidity;
pub mod given;
pub mod jacobian;
pub mod momentum;
pub mod quasi_static;
pub(crate) mod rows;
pub mod sidewall;
pub mod terminus;

use crate::fjord::Fjord;
use crate::melt::{MeltShape, Place};
use crate::newton::{OutsideDomain, System};
use crate::params::{
    DAYS_PER_YEAR, GRAVITY, ICE_DENSITY, Parameters, SECONDS_PER_YEAR, WATER_DENSITY,
};
use crate::state::{State, Var, core_unknowns, scale, unknowns};
use closure::UpstreamClosure;
use continuity::MassBalance;
use fluidity::Relaxation;
use given::{Given, Rates};
use jacobian::Jacobian;
use rows::{ResidualOnly, RowScales, Weighted, WithColumn, WithJacobian};
use sidewall::{MeanSpeed, Section};
use terminus::{Advance, Terminus};

/// What a term reports: residuals in the unit its documentation names, and their slopes.
pub trait Sink {
    /// Sets a row's residual.
    fn residual(&mut self, row: Var, value: f64);
    /// Adds ∂(row)/∂(unknown).
    fn slope(&mut self, row: Var, by: Var, value: f64);
    /// Adds ∂(row)/∂(what is given), for who asks how the equations change with it.
    #[inline(always)]
    fn given(&mut self, _row: Var, _by: Given, _value: f64) {}
    /// Says that a cell's melt rate in m a⁻¹ is added to a row.
    #[inline(always)]
    fn melt(&mut self, _row: Var, _cell: usize) {}
}

/// Everything but the state that an equation may read.
#[derive(Debug, Clone, Copy)]
pub struct Medium<'a> {
    /// The parameters.
    pub parameters: &'a Parameters,
    /// The closure at the terminus.
    pub closure: UpstreamClosure,
    /// The terminus: calving, thickness, position.
    pub terminus: Terminus,
    /// ε of the smoothed kinks in the longitudinal fluidity; 0 is the model.
    pub smoothing: f64,
    /// Pseudo-time of the fluidity; none in the model.
    pub relaxation: Option<Relaxation<'a>>,
    cells: &'a [Cell],
    melt_shape: &'a MeltShape,
}

/// What the place of a cell decides, and its slope along the fjord.
#[derive(Debug, Clone, Copy, Default)]
struct Cell {
    /// Along the bedrock.
    x_m: f64,
    width: f64,
    width_by_x: f64,
    melt_factor: f64,
    melt: f64,
    melt_by_x: f64,
}

impl Medium<'_> {
    /// W of a cell, m.
    #[inline(always)]
    pub fn cell_width(&self, cell: usize) -> f64 {
        self.cells[cell].width
    }

    /// Melt rate of a cell, positive, m a⁻¹.
    #[inline(always)]
    pub fn melt_m_per_a(&self, cell: usize) -> f64 {
        self.cells[cell].melt
    }

    /// Slopes of a mass row, to which a cell's melt rate is added.
    #[inline(always)]
    pub fn slope_by_melt<S: Sink>(&self, row: Var, cell: usize, out: &mut S) {
        out.melt(row, cell);
        out.given(row, Given::MeltRate, DAYS_PER_YEAR * self.cells[cell].melt_factor);
        let by_x = self.cells[cell].melt_by_x;
        if self.melt_shape.depends_on_bedrock() {
            self.slope_by_place(row, cell, by_x, out);
        } else {
            out.slope(row, Var::L, by_x * self.chi(cell));
        }
    }

    /// W at a node: mean of the two neighbours, the nearest cell's at the ends; m.
    #[inline(always)]
    pub fn node_width(&self, node: usize) -> f64 {
        let [left, right] = self.beside(node);
        0.5 * (self.cells[left].width + self.cells[right].width)
    }

    /// Slopes of a row that depends on the place of a cell, X₀ + χL, by ∂(row)/∂x.
    #[inline(always)]
    pub fn slope_by_place<S: Sink>(&self, row: Var, cell: usize, by_x: f64, out: &mut S) {
        out.slope(row, Var::L, by_x * self.chi(cell));
        if self.terminus.is_coupled {
            out.slope(row, Var::Calving, by_x * self.terminus.x_by_calving_a());
        }
    }

    /// Slopes of a row that depends on a node's width, by ∂(row)/∂W.
    #[inline(always)]
    pub fn slope_by_node_width<S: Sink>(&self, row: Var, node: usize, by_w: f64, out: &mut S) {
        for cell in self.beside(node) {
            self.slope_by_width(row, cell, 0.5 * by_w, out);
        }
    }

    /// Slopes of a row that depends on a cell's width, by ∂(row)/∂W.
    #[inline(always)]
    pub fn slope_by_width<S: Sink>(&self, row: Var, cell: usize, by_w: f64, out: &mut S) {
        out.given(row, Given::Width, by_w);
        out.given(row, Given::WidthGradient, by_w * self.cells[cell].x_m);
        self.slope_by_place(row, cell, by_w * self.cells[cell].width_by_x, out);
    }

    /// χ of a cell's centre.
    #[inline(always)]
    fn chi(&self, cell: usize) -> f64 {
        (cell as f64 + 0.5) / self.cells.len() as f64
    }

    /// The cells to the left and right of a node; the nearest cell twice at the ends.
    #[inline(always)]
    fn beside(&self, node: usize) -> [usize; 2] {
        [node.saturating_sub(1), node.min(self.cells.len() - 1)]
    }
}

/// √(P̃/ρ)/(d b) in a⁻¹: the unit of g_loc (Eq. 17), with P̃ of Eq. 5 (sign as in the text).
#[inline(always)]
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
    /// How the melt rate is spread.
    pub melt_shape: &'a MeltShape,
    /// The closure at the terminus.
    pub closure: UpstreamClosure,
    /// Mass balance: steady, one time step, or given geometry.
    pub balance: MassBalance<'a>,
    /// Where the terminus stands and how it moves.
    pub advance: Advance,
    /// ε of the smoothed kinks; 0 is the model.
    pub smoothing: f64,
    /// Pseudo-time of the fluidity; none in the model.
    pub relaxation: Option<Relaxation<'a>>,
}

/// Scratch space of an evaluation.
#[derive(Debug, Clone)]
pub struct Scratch {
    state: State,
    cells: Vec<Cell>,
    sections: Vec<Section>,
    speeds: Vec<MeanSpeed>,
}

impl Scratch {
    /// For N cells.
    pub fn new(n_cells: usize) -> Self {
        let section = Section { mu_w: 0.0, thickness_m: 0.0, width_m: 0.0 };
        Self {
            state: State::zeros(n_cells),
            cells: vec![Cell::default(); n_cells],
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
        let Scratch { state, cells, sections, speeds } = &mut *self.scratch;
        let problem = &self.problem;
        let p = problem.parameters;
        state.unpack(packed);
        if !inside_domain(state) {
            return Err(OutsideDomain);
        }
        let terminus = Terminus::at(&problem.advance, p, state, out).ok_or(OutsideDomain)?;
        let fjord = problem.fjord;
        if [0.0, state.length_m].iter().any(|x| fjord.width(terminus.x_m + x) <= 0.0) {
            return Err(OutsideDomain);
        }
        for (c, cell) in cells.iter_mut().enumerate() {
            let chi = (c as f64 + 0.5) / state.n_cells() as f64;
            let place = Place { chi, x_m: chi * state.length_m, terminus_x_m: terminus.x_m };
            let x_m = terminus.x_m + place.x_m;
            let melt_factor = problem.melt_shape.factor(place);
            *cell = Cell {
                x_m,
                width: fjord.width(x_m),
                width_by_x: fjord.slope(x_m),
                melt_factor,
                melt: p.melt_rate_m_per_a() * melt_factor,
                melt_by_x: p.melt_rate_m_per_a() * problem.melt_shape.slope_by_x(place),
            };
        }
        let medium = Medium {
            parameters: p,
            closure: problem.closure,
            terminus,
            smoothing: problem.smoothing,
            relaxation: problem.relaxation,
            cells,
            melt_shape: problem.melt_shape,
        };
        sidewall::sections(&medium, state, sections);
        sidewall::mean_speeds(p, problem.smoothing, sections, speeds);
        momentum::residual(&medium, state, out);
        sidewall::residual(&medium, state, speeds, out);
        fluidity::residual(&medium, state, out);
        match problem.balance {
            MassBalance::Steady => continuity::residual(&medium, None, state, out),
            MassBalance::Step(before) => continuity::residual(&medium, Some(before), state, out),
            MassBalance::Given { thickness_m, length_m } => {
                continuity::given(thickness_m, length_m, state, out);
            }
            MassBalance::AtRest(size) => quasi_static::residual(&medium, size, state, out),
        }
        Ok(())
    }

    /// Residual and Jacobian at x, and ∂F/∂p along a control at whose speed what is given changes.
    pub fn linearise_along(
        &mut self,
        x: &[f64],
        residual: &mut [f64],
        jacobian: &mut Jacobian,
        rates: &Rates,
        column: &mut [f64],
    ) -> Result<(), OutsideDomain> {
        let rows = self.rows();
        jacobian.clear();
        column.fill(0.0);
        let inner = WithJacobian { rows, residual, jacobian };
        self.assemble(x, &mut WithColumn { inner, rates, column })
    }

    /// λᵀ ∂F/∂(what is given) at x: by the scalars, and by the melt rate of each cell in m a⁻¹.
    pub fn weighted_slopes(
        &mut self,
        x: &[f64],
        weights: &[f64],
        melt: &mut [f64],
    ) -> Result<Rates, OutsideDomain> {
        let rows = self.rows();
        let mut scalars = [0.0; Given::ALL.len()];
        melt.fill(0.0);
        self.assemble(x, &mut Weighted { rows, weights, scalars: &mut scalars, melt })?;
        Ok(scalars)
    }

    fn rows(&self) -> RowScales {
        let [first_mass, mass, length] = match self.problem.balance {
            MassBalance::Steady | MassBalance::Step(_) => {
                [self.problem.closure.scale(), scale::MASS_BALANCE, scale::THICKNESS]
            }
            MassBalance::Given { .. } => [scale::THICKNESS, scale::THICKNESS, scale::LENGTH],
            MassBalance::AtRest(size) => [size.scale(), scale::VELOCITY, scale::THICKNESS],
        };
        RowScales {
            n: self.scratch.state.n_cells(),
            first_mass: 1.0 / first_mass,
            mass: 1.0 / mass,
            length: 1.0 / length,
        }
    }
}

/// L, H, g, g + ε̇ are positive, and so is the extrapolated thickness at both ends.
fn inside_domain(s: &State) -> bool {
    s.length_m > 0.0
        && s.thickness_m.iter().all(|h| *h > 0.0)
        && s.thickness_0_m() > 0.0
        && s.thickness_end_m() > 0.0
        && s.fluidity_per_a
            .iter()
            .enumerate()
            .all(|(c, g)| *g > 0.0 && g + s.strain_rate_per_a(c) > 0.0)
}

impl System for Equations<'_> {
    type Jacobian = Jacobian;

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
        longest_step(&self.problem, x, step)
    }
}

/// The longest share of a step of a problem's packed unknowns that keeps clear of the domain's bounds.
pub(crate) fn longest_step(problem: &Problem<'_>, x: &[f64], step: &[f64]) -> f64 {
    /// Share of the way to a bound that one step may go.
    const TOWARDS_BOUND: f64 = 0.9;
    let n = problem.parameters.n_cells;
    let threshold = sidewall::threshold(problem.parameters, problem.smoothing);
    let mut longest = 1.0_f64;
    let mut bound = |room: f64, shrink: f64| {
        if shrink > TOWARDS_BOUND * room && room > 0.0 {
            longest = longest.min(TOWARDS_BOUND * room / shrink);
        }
    };
    let mut keep_positive = |var: Var| {
        if let Some(place) = var.index(n) {
            bound(x[place], -step[place]);
        }
    };
    for c in 0..n {
        keep_positive(Var::H(c));
        keep_positive(Var::G(c));
    }
    keep_positive(Var::L);
    // A mélange may stick to the walls and come loose again, but one at rest, which moves with the
    // terminus. Friction at the ends acts on nothing: only its own row keeps it from where no speed
    // depends on it.
    let nodes = if matches!(problem.balance, MassBalance::AtRest(_)) { 1 } else { n };
    let mu_w = core_unknowns(n);
    for node in (mu_w..=mu_w + n).step_by(nodes) {
        bound(x[node].abs() - threshold, -step[node] * x[node].signum());
    }
    longest
}
