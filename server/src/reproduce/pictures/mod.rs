//! The paper's Figs. 2–8, drawn from runs that were solved and stored: what each shows, and its panels. Knows
//! no archive: whoever has the runs hands them over.

mod colours;
mod forces;
mod page;
mod profiles;
mod seasons;
mod ticks;
mod words;

use super::case::Case;
use super::experiments::{Experiment, Solved};
use super::seasons::MELT_M_PER_DAY;
use super::{rest, rheology};
use melange_solver::Model;
use melange_solver::params::ParameterError;
use melange_solver::physics::closure::UpstreamClosure;
use std::collections::BTreeMap;

/// The folder of the pictures, beside the document that shows them.
pub const FOLDER: &str = "reproduction";

/// What a figure is and shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Figure {
    /// Its number in the paper.
    pub number: usize,
    /// Its subject.
    pub title: &'static str,
    /// What is drawn how.
    pub caption: &'static str,
}

impl Figure {
    /// Its file, in [`FOLDER`].
    pub fn file(&self) -> String {
        format!("fig{}.svg", self.number)
    }
}

/// The figures that are drawn.
pub const FIGURES: [Figure; 7] = [
    Figure {
        number: 2,
        title: "the steady state, and what becomes of it without calving and melt",
        caption: "The base case. (a–d) Along the fjord, from the glacier's terminus on: speed relative to the walls, thickness \
                  about sea level, granular fluidity, friction at the walls; the steady state, the mélange at times after \
                  calving and melt were turned off, and the quasi-static limit that it comes to (dashed). (e) Across the fjord, \
                  from the wall to the middle, at fractions χ of the length: the steady state (solid) and the limit (dashed). \
                  (f) The same at mid-length, by time; colours as in (a–d).",
    },
    Figure {
        number: 3,
        title: "the rheology",
        caption: "Steady states with one parameter of the rheology changed at a time; colours in all panels are those of the legend. \
                  (a–d) As in Fig. 2. (e) Across the fjord at mid-length, from the wall to the middle.",
    },
    Figure {
        number: 4,
        title: "the size of the glacier",
        caption: "Steady states in front of a small (solid), a medium (dashed) and a large glacier (dotted), with a melt rate of \
                  0.8 m d⁻¹. (a–d) As in Fig. 2. (e) Across the fjord at mid-length, from the wall to the middle.",
    },
    Figure {
        number: 5,
        title: "melt",
        caption: "(a) Steady thickness profiles by melt rate. (b) The force per unit width: with stretching (dashed), without (dotted), and \
                  the power law fitted to the first (grey).",
    },
    Figure {
        number: 6,
        title: "the fjord's walls",
        caption: "Steady thickness profiles and force per unit width, (a, b) by the width of a fjord with parallel walls, (c, d) by the gradient \
                  of the width, which is 4 km at the terminus. Force with stretching (dashed), without (dotted), and the \
                  exponential fitted to the first (grey).",
    },
    Figure {
        number: 7,
        title: "seasons",
        caption: "(a) The force per unit width (solid, left) through three years of a melt rate (dashed, right) that swings by 0.2 m d⁻¹ about \
                  0.6, 0.7 and 0.8 m d⁻¹; black: calving follows the force by Eq. 31, at 0.7 m d⁻¹. (b) The same, force over melt \
                  rate; dots are the starts. (c, d) The same with a calving rate that swings by a tenth. Steps as published.",
    },
    Figure {
        number: 8,
        title: "force over thickness",
        caption: "(a) The force per unit width over the thickness at the terminus: quasi-static (solid black), steady states of Fig. 5 with \
                  the power law fitted to them (dashed black), and the transients of Fig. 7 (colours by melt rate; solid: melt swings, dashed: calving does, grey: coupled). \
                  (b) The same by that power law, which shows how the transients circle.",
    },
];

/// A drawn figure.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Picture {
    /// Which.
    pub figure: Figure,
    /// The drawing.
    pub svg: String,
}

/// Why there is no picture.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Undrawn {
    /// Runs are missing.
    #[error("the figures need {wanted} runs of {experiment:?}, and there are {found}")]
    Runs {
        /// Which.
        experiment: Experiment,
        /// So many there should be.
        wanted: usize,
        /// So many there are.
        found: usize,
    },
    /// Parameters that are none.
    #[error(transparent)]
    Parameters(#[from] ParameterError),
}

/// Draws all figures.
pub fn draw(runs: &BTreeMap<Experiment, Vec<Solved>>) -> Result<Vec<Picture>, Undrawn> {
    let of = |experiment: Experiment, wanted: usize| {
        let found = runs.get(&experiment).map(Vec::as_slice).unwrap_or_default();
        match found.len() == wanted {
            true => Ok(found),
            false => Err(Undrawn::Runs { experiment, wanted, found: found.len() }),
        }
    };
    let steady = |experiment, wanted| -> Result<Vec<Case>, Undrawn> {
        of(experiment, wanted)?.iter().map(as_case).collect()
    };
    let melts = steady(Experiment::Melts, super::geometry::melt_rates().len())?;
    let widths = steady(Experiment::Widths, super::geometry::widths().len())?;
    let gradients = steady(Experiment::Gradients, super::geometry::gradients().len())?;
    let by_melt: Vec<&Solved> = (0..MELT_M_PER_DAY.len())
        .map(|i| Ok(&of(Experiment::MeltSeason(i), 1)?[0]))
        .collect::<Result<_, Undrawn>>()?;
    let seasons = seasons::Seasons {
        by_melt,
        by_calving: of(Experiment::CalvingSeasons, MELT_M_PER_DAY.len())?.iter().collect(),
        coupled: &of(Experiment::CoupledSeason, 1)?[0],
    };
    let relaxed = &of(Experiment::Relaxation, 1)?[0];
    let [start, limit] = [Experiment::Steady, Experiment::Limit].map(|e| steady(e, 1));
    let base = profiles::Relaxing::new(&start?[0], relaxed, &limit?[0], &rest::FRACTIONS);
    let rheology = steady(Experiment::Rheology, 1 + rheology::one_at_a_time().len())?;
    let glaciers = steady(Experiment::Glaciers, super::geometry::glaciers().len())?;
    let draw = |figure: Figure| {
        let svg = match figure.number {
            2 => base.draw(&figure),
            3 => profiles::rheology(&figure, &rheology),
            4 => profiles::glaciers(&figure, &glaciers),
            5 => forces::melts(&figure, &melts),
            6 => forces::walls(&figure, &widths, &gradients),
            7 => seasons.draw(&figure),
            _ => forces::over_thickness(&figure, &melts, &seasons),
        };
        Picture { figure, svg: svg.into_svg() }
    };
    Ok(FIGURES.map(draw).to_vec())
}

fn as_case(solved: &Solved) -> Result<Case, Undrawn> {
    let model = Model::new(solved.parameters, UpstreamClosure::Published)?;
    Ok(Case { name: String::new(), model, state: solved.state.clone() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_is_drawn_of_runs_that_are_missing() {
        let error = draw(&BTreeMap::new()).expect_err("there are no runs");
        let Undrawn::Runs { wanted, found, .. } = error else { panic!("{error}") };
        assert_eq!((wanted, found), (6, 0));
    }

    #[test]
    fn figures_have_names_of_their_own() {
        let numbers: Vec<usize> = FIGURES.iter().map(|figure| figure.number).collect();
        assert_eq!(numbers, [2, 3, 4, 5, 6, 7, 8]);
        assert_eq!(FIGURES[0].file(), "fig2.svg");
    }
}
