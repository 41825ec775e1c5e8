//! What this solver's other choices do to the base case: the regularisation, the grid, the drag that is
//! left out.

use super::case::{self, Case};
use super::table::{Cell, Table};
use super::{Broken, Part};
use melange_solver::physics::closure::UpstreamClosure;
use rayon::prelude::*;

/// A choice: its name, the parameters it changes, the closure.
type Choice = (&'static str, &'static [(&'static str, f64)], UpstreamClosure);

/// The table; it makes no claim of the paper's.
pub fn part() -> Result<Part, Broken> {
    Ok(Part { claims: Vec::new(), tables: vec![deviations()?], figures: Vec::new() })
}

/// The base case with one choice changed.
fn deviations() -> Result<Table, Broken> {
    const CHOICES: [Choice; 9] = [
        ("as chosen", &[], UpstreamClosure::Published),
        (
            "6: δε̇ = 0.01 a⁻¹",
            &[("strain_rate_regularisation_per_a", 0.01)],
            UpstreamClosure::Published,
        ),
        (
            "6: δε̇ = 0.1 a⁻¹",
            &[("strain_rate_regularisation_per_a", 0.1)],
            UpstreamClosure::Published,
        ),
        (
            "6: δε̇ = 10 a⁻¹",
            &[("strain_rate_regularisation_per_a", 10.0)],
            UpstreamClosure::Published,
        ),
        ("5: closure no_stretching", &[], UpstreamClosure::NoStretching),
        ("N = 25", &[("n_cells", 25.0)], UpstreamClosure::Published),
        ("N = 100", &[("n_cells", 100.0)], UpstreamClosure::Published),
        ("water drag 1 kN m⁻¹", &[("water_drag_n_per_m", 1e3)], UpstreamClosure::Published),
        ("water drag 10 kN m⁻¹", &[("water_drag_n_per_m", 1e4)], UpstreamClosure::Published),
    ];
    let solved: Vec<Case> = CHOICES
        .par_iter()
        .map(|(name, changes, closure)| case::steady_closed(name, changes, *closure))
        .collect::<Result<_, _>>()?;
    let base = &solved[0];
    let row = |case: &Case| -> Vec<Cell> {
        let numbers = |c: &Case| [c.length_m(), c.thickness_0_m(), c.force_n_per_m()];
        let ratios =
            numbers(case).iter().zip(numbers(base)).map(|(a, b)| Cell::from(a / b)).collect();
        [vec![case.name.as_str().into()], numbers(case).map(Cell::from).to_vec(), ratios].concat()
    };
    let columns = [
        "choice",
        "length_m",
        "thickness_0_m",
        "force_n_per_m",
        "length_ratio",
        "thickness_0_ratio",
        "force_ratio",
    ];
    Ok(Table {
        title: "Other choices",
        caption: "The base case with one choice changed; numbers in front are those of the deviations listed at the top of \
                  `solver/src/lib.rs`. δε̇, for which the paper prints no value, decides more than anything else: the force \
                  grows sixfold from 10 to 0.1 a⁻¹, and 1 a⁻¹ is what gives the paper's figures. The effects of the others stand there.",
        ..Table::data("choices", &columns, solved.iter().map(row).collect())
    })
}
