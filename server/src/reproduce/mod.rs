//! The paper's experiments, run again with its settings: each of its claims beside what comes out, its figures
//! and their data, and what this solver's own choices do to the numbers. Knows the solver and the fits; knows no
//! queue, archive or transport: figures are drawn of runs that are handed over. Writes no file but where it is
//! told to.
//!
//! The paper is Amundson, Robel, Burton and Nissanka (The Cryosphere 19, 19–35, 2025).

mod case;
mod choices;
mod closures;
mod document;
pub mod experiments;
mod geometry;
pub mod pictures;
mod rest;
mod rheology;
mod season;
mod seasons;
mod table;

use melange_solver::error::SolveError;
use melange_solver::params::{ParameterError, Parameters};
pub use melange_solver::state::State;
use pictures::Picture;
use serde::{Serialize, Serializer};
use std::fmt::Write;
use std::path::Path;
pub use table::Table;
use table::short;

/// A claim of the paper beside what comes out.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Claim {
    /// Name that stays.
    pub id: &'static str,
    /// Section or figure.
    pub place: &'static str,
    /// What the paper says.
    pub paper: &'static str,
    /// What comes out, by name with unit.
    #[serde(serialize_with = "as_map")]
    pub numbers: Vec<(&'static str, f64)>,
    /// Whether the claim holds by these numbers.
    #[serde(rename = "verdict", serialize_with = "as_verdict")]
    pub holds: bool,
    /// Why it does not hold; nothing to say where it holds.
    #[serde(rename = "why")]
    pub if_not: &'static str,
}

fn as_map<S: Serializer>(numbers: &[(&str, f64)], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_map(numbers.iter().copied())
}

fn as_verdict<S: Serializer>(holds: &bool, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(verdict(*holds))
}

fn verdict(holds: bool) -> &'static str {
    if holds { "holds" } else { "differs" }
}

impl Claim {
    /// The numbers in one line.
    fn found(&self) -> String {
        let told: Vec<_> =
            self.numbers.iter().map(|(n, v)| format!("`{n}` {}", short(*v))).collect();
        told.join(", ")
    }
}

/// An experiment that did not come to its end.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Broken {
    /// Parameters that are none.
    #[error(transparent)]
    Parameters(#[from] ParameterError),
    /// The solver gave up.
    #[error("{case}: {error}")]
    Failed {
        /// Which experiment.
        case: String,
        /// Why.
        error: SolveError,
    },
    /// Another ending than the paper's.
    #[error("{case}: {ending}")]
    Ended {
        /// Which experiment.
        case: String,
        /// How it ended.
        ending: String,
    },
}

/// All that comes out.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Report {
    /// Cells of the runs that the claims are judged by.
    pub n_cells: usize,
    /// The paper's claims.
    pub claims: Vec<Claim>,
    /// What the solver's own choices do.
    pub tables: Vec<Table>,
    /// The figures' data.
    #[serde(skip)]
    pub figures: Vec<Table>,
}

/// What one group of experiments adds to the report.
#[derive(Debug, Default)]
struct Part {
    claims: Vec<Claim>,
    tables: Vec<Table>,
    figures: Vec<Table>,
}

/// Runs every experiment, on the threads of the pool it is called in.
pub fn reproduce() -> Result<Report, Broken> {
    let mut report = Report {
        n_cells: Parameters::default().n_cells,
        claims: Vec::new(),
        tables: Vec::new(),
        figures: Vec::new(),
    };
    for experiments in
        [rest::part, rheology::part, geometry::part, seasons::part, closures::part, choices::part]
    {
        let part = experiments()?;
        report.claims.extend(part.claims);
        report.tables.extend(part.tables);
        report.figures.extend(part.figures);
    }
    for claim in report.claims.iter_mut().filter(|claim| claim.holds) {
        claim.if_not = "";
    }
    Ok(report)
}

impl Report {
    /// Writes the document, its pictures, the figures' data and the tables into a folder, which is made if need be.
    pub fn write(&self, folder: &Path, pictures: &[Picture]) -> std::io::Result<()> {
        std::fs::create_dir_all(folder.join(pictures::FOLDER))?;
        std::fs::write(folder.join("reproduction.md"), self.as_markdown())?;
        for picture in pictures {
            let path = folder.join(pictures::FOLDER).join(picture.figure.file());
            std::fs::write(path, &picture.svg)?;
        }
        for table in self.figures.iter().chain(&self.tables) {
            table.write_csv(std::fs::File::create(folder.join(format!("{}.csv", table.name)))?)?;
        }
        Ok(())
    }

    /// In one line how many claims hold.
    fn tally(&self) -> String {
        let holding = self.claims.iter().filter(|claim| claim.holds).count();
        format!("{holding} of {} claims hold.", self.claims.len())
    }

    /// As plain text: claim by claim, then the tables.
    pub fn as_text(&self) -> String {
        let mut text = format!("{}\n", self.tally());
        for claim in &self.claims {
            let (verdict, found) = (verdict(claim.holds), claim.found().replace('`', ""));
            let Claim { place, paper, if_not, .. } = claim;
            writeln!(text, "\n{verdict}  {place}: {paper}\n         {found}").expect("memory");
            if !if_not.is_empty() {
                writeln!(text, "         {if_not}").expect("memory");
            }
        }
        for table in &self.tables {
            write!(text, "\n{}\n\n{}", table.caption, table.as_text()).expect("memory");
        }
        text
    }
}
