//! A case: parameters that differ from the paper's base case, its steady state, and the tables that
//! several of them make.

use super::Broken;
use super::table::{Cell, Table};
use crate::analysis::{self, Fit, Law};
use melange_solver::error::SolveError;
use melange_solver::params::{PARAMETERS, Parameters};
use melange_solver::physics::closure::UpstreamClosure;
use melange_solver::state::State;
use melange_solver::steady::SteadyVerdict;
use melange_solver::transect::{Transect, transect};
use melange_solver::{Model, Solver, force};
use rayon::prelude::*;

/// What differs from the base case of Fig. 2.
pub type Changes = Vec<(&'static str, f64)>;

/// A mélange that was solved for.
#[derive(Debug, Clone)]
pub struct Case {
    /// Its name.
    pub name: String,
    /// Its model.
    pub model: Model,
    /// Its state.
    pub state: State,
}

/// The model of a case.
pub fn model(changes: &[(&str, f64)], closure: UpstreamClosure) -> Result<Model, Broken> {
    let mut parameters = Parameters::default();
    for (name, value) in changes {
        parameters.set(name, *value)?;
    }
    Ok(Model::new(parameters, closure)?)
}

/// Dresses the solver's error with the case's name.
pub fn failed(case: &str) -> impl Fn(SolveError) -> Broken {
    move |error| Broken::Failed { case: case.to_owned(), error }
}

/// The steady state of a case, with the closure of the paper's figures.
pub fn steady(name: &str, changes: &[(&str, f64)]) -> Result<Case, Broken> {
    steady_closed(name, changes, UpstreamClosure::Published)
}

/// The same with another closure.
pub fn steady_closed(
    name: &str,
    changes: &[(&str, f64)],
    closure: UpstreamClosure,
) -> Result<Case, Broken> {
    let model = model(changes, closure)?;
    match Solver::new(model.clone()).steady(None).map_err(failed(name))? {
        SteadyVerdict::Converged { solution, .. } => {
            Ok(Case { name: name.to_owned(), model, state: solution.state })
        }
        SteadyVerdict::NoSteadyState(evidence)
        | SteadyVerdict::Overthick(evidence)
        | SteadyVerdict::FjordClosed(evidence) => {
            Err(Broken::Ended { case: name.to_owned(), ending: evidence })
        }
    }
}

/// One case for each value of a parameter.
pub fn along(parameter: &'static str, values: &[f64]) -> Vec<(String, Changes)> {
    values.iter().map(|v| (format!("{parameter} = {v}"), vec![(parameter, *v)])).collect()
}

/// Steady states of many cases.
pub fn all_steady(cases: &[(String, Changes)]) -> Result<Vec<Case>, Broken> {
    cases.par_iter().map(|(name, changes)| steady(name, changes)).collect()
}

impl Case {
    /// L, m.
    pub fn length_m(&self) -> f64 {
        self.state.length_m
    }

    /// H₀, m.
    pub fn thickness_0_m(&self) -> f64 {
        self.state.thickness_0_m()
    }

    /// F/W, N m⁻¹.
    pub fn force_n_per_m(&self) -> f64 {
        force::force_n_per_m(&self.state)
    }

    /// F/W without the stretching, N m⁻¹.
    pub fn force_quasi_static_n_per_m(&self) -> f64 {
        force::force_quasi_static_n_per_m(&self.state)
    }

    /// ∫HW dx, m³.
    pub fn volume_m3(&self) -> f64 {
        force::volume_m3(&self.model, &self.state, 0.0)
    }

    /// Speed and fluidity across the fjord at χ.
    pub fn transect(&self, chi: f64) -> Transect {
        transect(&self.model, &self.state, 0.0, chi)
    }

    /// Mean of U, m a⁻¹.
    pub fn velocity_mean_m_per_a(&self) -> f64 {
        mean(&self.state.velocity_m_per_a)
    }

    /// Mean of g^x, a⁻¹.
    pub fn fluidity_mean_per_a(&self) -> f64 {
        mean(&self.state.fluidity_per_a)
    }
}

/// Strain rates of the cells but the last, whose is 0 by Eq. 23, a⁻¹.
pub fn strain_rates_per_a(s: &State) -> impl Iterator<Item = f64> {
    (0..s.n_cells() - 1).map(|cell| s.strain_rate_per_a(cell))
}

/// Mean of some numbers.
pub fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// The smallest of some numbers, infinite if there are none.
pub fn least(values: impl IntoIterator<Item = f64>) -> f64 {
    values.into_iter().fold(f64::INFINITY, f64::min)
}

/// The largest of some numbers, −∞ if there are none.
pub fn largest(values: impl IntoIterator<Item = f64>) -> f64 {
    values.into_iter().fold(f64::NEG_INFINITY, f64::max)
}

/// Whether each number is larger than the one before.
pub fn is_rising(values: impl IntoIterator<Item = f64>) -> bool {
    values.into_iter().is_sorted_by(|a, b| a < b)
}

/// A law through points.
pub fn fit(law: Law, points: impl IntoIterator<Item = (f64, f64)>) -> Fit {
    let runs: Vec<_> =
        points.into_iter().map(|(x, y)| ("converged".to_owned(), Some(x), Some(y))).collect();
    analysis::fit(law, &runs).expect("three and more different points have a fit")
}

/// One row for each case: parameters and numbers.
pub fn scalars(name: &'static str, cases: &[Case]) -> Table {
    let mut columns = vec!["case"];
    columns.extend(PARAMETERS.map(|p| p.name));
    columns.extend([
        "length_m",
        "thickness_0_m",
        "velocity_0_m_per_a",
        "velocity_end_m_per_a",
        "force_n_per_m",
        "force_quasi_static_n_per_m",
        "volume_m3",
    ]);
    let row = |case: &Case| -> Vec<Cell> {
        let s = &case.state;
        let mut row: Vec<Cell> = vec![case.name.as_str().into()];
        row.extend(PARAMETERS.iter().map(|p| Cell::from((p.get)(case.model.parameters()))));
        row.extend(
            [
                s.length_m,
                s.thickness_0_m(),
                s.velocity_m_per_a[0],
                s.velocity_m_per_a[s.n_cells()],
                case.force_n_per_m(),
                case.force_quasi_static_n_per_m(),
                case.volume_m3(),
            ]
            .map(Cell::from),
        );
        row
    };
    Table::data(name, &columns, cases.iter().map(row).collect())
}

/// One row for each node of each case.
pub fn nodes(name: &'static str, cases: &[Case]) -> Table {
    let columns = ["case", "node_x_m", "velocity_m_per_a", "mu_w"];
    let rows = |case: &Case| {
        let s = &case.state;
        rows(&case.name, [&s.node_x_m(), &s.velocity_m_per_a, &s.mu_w])
    };
    Table::data(name, &columns, cases.iter().flat_map(rows).collect())
}

/// One row for each cell of each case.
pub fn cells(name: &'static str, cases: &[Case]) -> Table {
    let columns = ["case", "cell_x_m", "thickness_m", "fluidity_per_a"];
    let rows = |case: &Case| {
        let s = &case.state;
        rows(&case.name, [&s.cell_x_m(), &s.thickness_m, &s.fluidity_per_a])
    };
    Table::data(name, &columns, cases.iter().flat_map(rows).collect())
}

/// One row for each point across the fjord, at some χ of each case.
pub fn transects(name: &'static str, cases: &[Case], chi: &[f64]) -> Table {
    let columns = ["case", "chi", "y_m", "velocity_m_per_a", "fluidity_per_a"];
    let across = |case: &Case, chi: f64| -> Vec<Vec<Cell>> {
        let t = case.transect(chi);
        let rows = rows(&case.name, [&t.y_m, &t.velocity_m_per_a, &t.fluidity_per_a]);
        rows.into_iter().map(|row| [&row[..1], &[chi.into()], &row[1..]].concat()).collect()
    };
    let rows = cases.iter().flat_map(|case| chi.iter().flat_map(move |chi| across(case, *chi)));
    Table::data(name, &columns, rows.collect())
}

fn rows(name: &str, columns: [&[f64]; 3]) -> Vec<Vec<Cell>> {
    let [x, y, z] = columns;
    let row = |i: usize| vec![name.into(), x[i].into(), y[i].into(), z[i].into()];
    (0..x.len()).map(row).collect()
}
