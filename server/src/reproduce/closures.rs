//! The closure of the mass equation at the terminus, which the paper does not give: what each makes of
//! the paper's steady cases, how they converge with the grid, and what becomes of the claims.

use super::case::{self, Case, Changes, failed, fit};
use super::table::{Cell, Table};
use super::{Broken, Part, geometry, rheology};
use crate::analysis::Law;
use melange_solver::observe::Moment;
use melange_solver::params;
use melange_solver::physics::closure::UpstreamClosure;
use melange_solver::transient::{Ending, Plan};
use melange_solver::{Solver, diagnostic};
use rayon::prelude::*;
use std::ops::ControlFlow;

/// Grids: the paper's, and three of which each has twice the cells of the one before.
const GRIDS: [usize; 4] = [50, 100, 200, 400];
/// Closures that have steady states.
const CLOSURES: [UpstreamClosure; 2] = [UpstreamClosure::Published, UpstreamClosure::NoStretching];

/// The tables; they make no claim of the paper's.
pub fn part() -> Result<Part, Broken> {
    let solved = Solved::all()?;
    let tables = vec![
        solved.table(
            "closures_force_n_per_m",
            "Closures and grids: force F/W in N m⁻¹",
            Case::force_n_per_m,
        ),
        solved.table(
            "closures_thickness_0_m",
            "Closures and grids: thickness H₀ in m",
            Case::thickness_0_m,
        ),
        solved.table("closures_length_m", "Closures and grids: length L in m", Case::length_m),
        solved.claims(),
        family()?,
    ];
    Ok(Part {
        claims: Vec::new(),
        tables,
        figures: vec![case::scalars("closures", &solved.states)],
    })
}

/// Whether the changes leave the base case as it is.
fn is_base(changes: &Changes) -> bool {
    let default = |name| params::info(name).map(|info| info.default);
    changes.iter().all(|(name, value)| default(name) == Some(*value))
}

/// The paper's steady cases, the base case first and once.
fn cases() -> Vec<(String, Changes)> {
    let varied = [
        rheology::one_at_a_time(),
        geometry::glaciers(),
        geometry::melt_rates(),
        geometry::widths(),
        geometry::gradients(),
    ];
    let varied = varied.into_iter().flatten().filter(|(_, changes)| !is_base(changes));
    std::iter::once(("base case".to_owned(), Changes::new())).chain(varied).collect()
}

/// Every case with every closure on every grid, in this order.
struct Solved {
    cases: Vec<(String, Changes)>,
    states: Vec<Case>,
}

impl Solved {
    fn all() -> Result<Self, Broken> {
        let cases = cases();
        let closed = |case| CLOSURES.iter().map(move |closure| (case, *closure));
        let jobs: Vec<_> = (cases.iter().flat_map(closed))
            .flat_map(|(case, closure)| GRIDS.map(|n_cells| (case, closure, n_cells)))
            .collect();
        let states = jobs
            .into_par_iter()
            .map(|((name, changes), closure, n_cells)| {
                let changes = [&changes[..], &[("n_cells", n_cells as f64)]].concat();
                let name = format!("{name}, {}, N = {n_cells}", closure.name());
                case::steady_closed(&name, &changes, closure)
            })
            .collect::<Result<_, _>>()?;
        Ok(Self { cases, states })
    }

    fn get(&self, case: usize, closure: usize, grid: usize) -> &Case {
        &self.states[(case * CLOSURES.len() + closure) * GRIDS.len() + grid]
    }

    fn find(&self, changes: &Changes) -> usize {
        let place = self.cases.iter().position(|(_, known)| known == changes);
        if is_base(changes) { 0 } else { place.expect("the paper's cases are all there") }
    }

    /// One number by closure and grid.
    fn table(&self, name: &'static str, title: &'static str, number: fn(&Case) -> f64) -> Table {
        let mut columns = vec!["case".to_owned()];
        for closure in CLOSURES {
            columns.extend(GRIDS.map(|n| format!("{}_n{n}", closure.name())));
            columns.push(format!("{}_order", closure.name()));
        }
        columns.push("ratio_at_n50".into());
        let row = |case: usize| -> Vec<Cell> {
            let mut row: Vec<Cell> = vec![self.cases[case].0.as_str().into()];
            for closure in 0..CLOSURES.len() {
                let values = [0, 1, 2, 3].map(|grid| number(self.get(case, closure, grid)));
                row.extend(values.map(Cell::from));
                row.push(order(values[1], values[2], values[3]).into());
            }
            row.push((number(self.get(case, 1, 0)) / number(self.get(case, 0, 0))).into());
            row
        };
        Table {
            name,
            title,
            caption: "By closure at the terminus and number of cells. Order: log₂ of the change from N = 100 to 200 by that \
                      from 200 to 400; below 0 the changes still grow. Last column: `no_stretching` by `published`.",
            columns,
            rows: (0..self.cases.len()).map(row).collect(),
        }
    }

    /// The paper's headline numbers by closure.
    fn claims(&self) -> Table {
        let row = |closure: usize, grid: usize| -> Vec<Cell> {
            let get = |changes: &Changes| self.get(self.find(changes), closure, grid);
            let melts = geometry::melt_rates();
            let melts = melts.iter().map(|(_, changes)| get(changes));
            let power = fit(
                Law::Power,
                melts
                    .clone()
                    .map(|c| (c.model.parameters().melt_rate_m_per_day, c.force_n_per_m())),
            );
            let square = fit(Law::Power, melts.map(|c| (c.thickness_0_m(), c.force_n_per_m())));
            let glaciers = geometry::glaciers();
            let [small, large] = [&glaciers[0], &glaciers[2]].map(|(_, changes)| get(changes));
            let numbers = [
                GRIDS[grid] as f64,
                power.exponent.estimate,
                power.exponent.ci95[0],
                power.exponent.ci95[1],
                square.exponent.estimate,
                large.thickness_0_m() / small.thickness_0_m(),
                large.force_n_per_m() / small.force_n_per_m(),
            ];
            [vec![CLOSURES[closure].name().into()], numbers.map(Cell::from).to_vec()].concat()
        };
        let last = GRIDS.len() - 1;
        Table {
            title: "Claims by closure",
            caption: "Exponent of the force over the melt rate (Fig. 5, paper: about −3) and over H₀ (Fig. 8, paper: 2), and large by \
                      small glacier (Fig. 4, paper: thickness over 1.4, force 2).",
            ..Table::data(
                "closures_claims",
                &[
                    "closure",
                    "n_cells",
                    "melt_exponent",
                    "melt_exponent_ci95_low",
                    "melt_exponent_ci95_high",
                    "thickness_exponent",
                    "thickness_0_ratio",
                    "force_ratio",
                ],
                vec![row(0, 0), row(0, last), row(1, 0), row(1, last)],
            )
        }
    }
}

/// Observed order from three grids of which each has twice the cells of the one before.
fn order(coarse: f64, middle: f64, fine: f64) -> f64 {
    ((coarse - middle) / (middle - fine)).abs().log2()
}

/// C8 as printed: by time from three starts, which it does not forget.
fn family() -> Result<Table, Broken> {
    /// By then L and H₀ no longer change in five digits, a.
    const DURATION_A: f64 = 50.0;
    /// Tolerance of the steps.
    const TOLERANCE: f64 = 1e-4;
    /// The standard start: L in m and H₀ in m of a wedge.
    const WEDGE: (f64, f64) = (1e4, 75.0);
    /// A thicker one.
    const THICK_WEDGE: (f64, f64) = (1e4, 150.0);
    let model = case::model(&[], UpstreamClosure::Printed)?;
    let wedge = |(length_m, thickness_0_m): (f64, f64)| {
        let thickness_m = diagnostic::wedge(&model, thickness_0_m);
        let solved = Solver::new(model.clone()).diagnostic(&thickness_m, length_m);
        solved.map(|s| s.state).map_err(failed("printed closure"))
    };
    let steady = |closure| case::steady_closed("base case", &[], closure).map(|case| case.state);
    let starts = [
        ("wedge, L = 10 km, H0 = 75 m", wedge(WEDGE)?),
        ("wedge, L = 10 km, H0 = 150 m", wedge(THICK_WEDGE)?),
        ("steady, no_stretching", steady(UpstreamClosure::NoStretching)?),
        ("steady, published", steady(UpstreamClosure::Published)?),
    ];
    let rows = starts.into_par_iter().map(|(name, start)| {
        let mut keep = |_: Moment<'_>| ControlFlow::Continue(());
        let plan = Plan::controlled(TOLERANCE, vec![DURATION_A]);
        let end = Solver::new(model.clone()).transient(start, &plan, &mut keep);
        let end = end.map_err(failed(name))?;
        let case = Case { name: name.into(), model: model.clone(), state: end.state };
        let ending = if end.ending == Ending::Completed { "at rest" } else { "ended early" };
        let numbers = [case.length_m(), case.thickness_0_m(), case.force_n_per_m()];
        Ok([vec![name.into(), ending.into()], numbers.map(Cell::from).to_vec()].concat())
    });
    let rows = rows.collect::<Result<_, Broken>>()?;
    Ok(Table {
        title: "The closure as printed (C8)",
        caption: "C8 leaves a family of steady states: where the base case comes to rest depends on where it starts. \
                  So this closure serves transients only.",
        ..Table::data(
            "closure_printed",
            &["start", "ending", "length_m", "thickness_0_m", "force_n_per_m"],
            rows,
        )
    })
}
