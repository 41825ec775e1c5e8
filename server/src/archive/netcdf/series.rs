//! The time series of a dataset's runs. Where all runs have the same times they are along `run` and the coordinate
//! `time_a`; else along `run` and `output`, and each run has its own `time_a`.

use super::dataset::{Dataset, Variable};
use super::members::{Members, common};
use super::runs::Runs;
use crate::archive::ArchiveError;
use crate::archive::catalogue::Layout;
use crate::archive::schema::Kind;
use crate::domain::outcome::SERIES;
use arrow_array::Array;
use arrow_array::cast::AsArray;
use arrow_array::types::Float64Type;
use std::path::Path;

/// How many times there are.
#[derive(Debug)]
pub struct Times {
    members: Members,
}

impl Times {
    /// Counts the rows of each run.
    pub fn look(archive: &Path, layout: &Layout, runs: &Runs) -> Result<Self, ArchiveError> {
        let members = Members::count(archive, layout, Kind::Series, runs, |_, _| {})?;
        Ok(Self { members })
    }

    /// Numbers of them all, gaps included.
    pub fn numbers(&self, runs: &Runs) -> u64 {
        (runs.count() * self.members.most()) as u64 * SERIES.len() as u64
    }

    /// Puts them into a dataset.
    pub fn put(
        &self,
        dataset: &mut Dataset,
        archive: &Path,
        layout: &Layout,
        runs: &Runs,
    ) -> Result<(), ArchiveError> {
        let along = self.members.most();
        if along == 0 {
            return Ok(());
        }
        let mut values = vec![vec![f64::NAN; runs.count() * along]; SERIES.len()];
        self.members.each(archive, layout, Kind::Series, runs, |batch, row, run, place| {
            // The first column is the run's id.
            for (values, column) in values.iter_mut().zip(&batch.columns()[1..]) {
                let column = column.as_primitive::<Float64Type>();
                if column.is_valid(row) {
                    values[run * along + place] = column.value(row);
                }
            }
        })?;
        let times = SERIES.iter().position(|s| s.name == "time_a").unwrap_or_default();
        let shared = common(&values[times], along).filter(|_| self.members.are_even());
        // CF's coordinate variables bear the name of their dimension.
        let dimension = if shared.is_some() { "time_a" } else { "output" };
        dataset.dimension(dimension, along)?;
        for (info, values) in SERIES.iter().zip(&values) {
            let is_time = info.name == "time_a";
            let name = format!("series_{}", info.name);
            let variable = Variable {
                name: if is_time { "time_a" } else { &name },
                dimensions: &["run", dimension],
                unit: info.unit,
                meaning: info.meaning,
                coordinates: match (is_time, shared) {
                    (true, _) => "",
                    (false, Some(_)) => "run_id",
                    (false, None) => "run_id time_a",
                },
            };
            match shared.filter(|_| is_time) {
                Some(times) => {
                    dataset.reals(Variable { dimensions: &[dimension], ..variable }, times)?;
                }
                None => dataset.reals(variable, values)?,
            }
        }
        Ok(())
    }
}
