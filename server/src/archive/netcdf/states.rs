//! The states of a dataset's runs: along `run`, `snapshot` where they have times, and `node` or `cell`.

use super::dataset::{Dataset, Variable};
use super::members::{Members, common};
use super::runs::Runs;
use crate::archive::ArchiveError;
use crate::archive::catalogue::Layout;
use crate::archive::schema::Kind;
use crate::domain::outcome::PROFILE;
use arrow_array::Array;
use arrow_array::cast::AsArray;
use arrow_array::types::Float64Type;
use std::path::Path;

/// How many states there are, and how long.
#[derive(Debug)]
pub struct States {
    members: Members,
    /// Cells of the finest grid.
    cells: usize,
    have_times: bool,
}

/// Columns of the table before the arrays: the run's id, time, and whether it was asked for.
const BEFORE: usize = 3;

impl States {
    /// Counts the states of each run.
    pub fn look(archive: &Path, layout: &Layout, runs: &Runs) -> Result<Self, ArchiveError> {
        let (mut have_times, mut nodes) = (false, 0);
        let members = Members::count(archive, layout, Kind::Profiles, runs, |batch, row| {
            have_times |= batch.column(1).is_valid(row);
            nodes = nodes.max(batch.column(BEFORE).as_list::<i32>().value_length(row) as usize);
        })?;
        Ok(Self { members, cells: nodes.saturating_sub(1), have_times })
    }

    /// Numbers of them all, gaps included.
    pub fn numbers(&self, runs: &Runs) -> u64 {
        let states = (runs.count() * self.members.most()) as u64;
        states * (PROFILE.len() * (self.cells + 1)) as u64
    }

    /// Puts them into a dataset.
    pub fn put(
        &self,
        dataset: &mut Dataset,
        archive: &Path,
        layout: &Layout,
        runs: &Runs,
    ) -> Result<(), ArchiveError> {
        let snapshots = self.members.most();
        if snapshots == 0 || self.cells == 0 {
            return Ok(());
        }
        dataset.dimension("node", self.cells + 1)?;
        dataset.dimension("cell", self.cells)?;
        chi(dataset, runs, self.cells)?;
        let states = runs.count() * snapshots;
        let mut times = vec![f64::NAN; states];
        let mut requested = vec![-1_i8; states];
        let mut arrays = PROFILE
            .map(|info| vec![f64::NAN; states * (self.cells + usize::from(at_nodes(info.name)))]);
        self.members.each(archive, layout, Kind::Profiles, runs, |batch, row, run, place| {
            let state = run * snapshots + place;
            let time = batch.column(1).as_primitive::<Float64Type>();
            if time.is_valid(row) {
                times[state] = time.value(row);
            }
            requested[state] = i8::from(batch.column(2).as_boolean().value(row));
            for (array, column) in arrays.iter_mut().zip(&batch.columns()[BEFORE..]) {
                let along = array.len() / states;
                let values = column.as_list::<i32>().value(row);
                let values = values.as_primitive::<Float64Type>().values();
                array[state * along..][..values.len()].copy_from_slice(values);
            }
        })?;
        if self.have_times {
            dataset.dimension("snapshot", snapshots)?;
            self.put_times(dataset, &times, &requested)?;
        }
        for (info, values) in PROFILE.iter().zip(arrays) {
            let (place, chi, x) = if at_nodes(info.name) {
                ("node", "chi_node", "node_x_m")
            } else {
                ("cell", "chi_cell", "cell_x_m")
            };
            let is_x = info.name == x;
            let time = if self.have_times { " snapshot_time_a" } else { "" };
            let coordinates = if is_x { String::new() } else { format!("run_id {chi} {x}{time}") };
            let variable = Variable {
                name: info.name,
                dimensions: if self.have_times {
                    &["run", "snapshot", place]
                } else {
                    &["run", place]
                },
                unit: info.unit,
                meaning: info.meaning,
                coordinates: &coordinates,
            };
            dataset.reals(variable, &values)?;
        }
        Ok(())
    }

    fn put_times(
        &self,
        dataset: &mut Dataset,
        times: &[f64],
        requested: &[i8],
    ) -> Result<(), ArchiveError> {
        let variable = Variable {
            name: "snapshot_time_a",
            dimensions: &["run", "snapshot"],
            unit: "a",
            meaning: "time of the state since the start",
            coordinates: "",
        };
        match common(times, self.members.most()).filter(|_| self.members.are_even()) {
            Some(shared) => {
                dataset.reals(Variable { dimensions: &["snapshot"], ..variable }, shared)?;
            }
            None => dataset.reals(variable, times)?,
        }
        let variable = Variable {
            name: "snapshot_requested",
            unit: "1",
            meaning: "whether the state's time was asked for; else it is a transient's last state",
            coordinates: "run_id snapshot_time_a",
            ..variable
        };
        dataset.flags(variable, &["not_requested", "requested"], requested)
    }
}

/// Whether an array of a profile has its values at the nodes.
fn at_nodes(name: &str) -> bool {
    ["node_x_m", "velocity_m_per_a", "mu_w"].contains(&name)
}

/// χ of nodes and cells: along these alone where all runs have one grid.
fn chi(dataset: &mut Dataset, runs: &Runs, most: usize) -> Result<(), ArchiveError> {
    let is_one_grid = runs.cells().iter().all(|cells| *cells == most);
    for (name, place, half, meaning) in [
        ("chi_node", "node", 0.0, "share chi of the melange's length, at the nodes"),
        ("chi_cell", "cell", 0.5, "share chi of the melange's length, at the cells' centres"),
    ] {
        let along = most + usize::from(place == "node");
        let of_grid = |cells: usize| {
            let here = cells + usize::from(place == "node");
            (0..along).map(
                move |i| {
                    if i < here { (i as f64 + half) / cells as f64 } else { f64::NAN }
                },
            )
        };
        let variable = Variable {
            name,
            dimensions: if is_one_grid { &[place] } else { &["run", place] },
            unit: "1",
            meaning,
            coordinates: "",
        };
        let values: Vec<f64> = if is_one_grid {
            of_grid(most).collect()
        } else {
            runs.cells().iter().flat_map(|cells| of_grid(*cells)).collect()
        };
        dataset.reals(variable, &values)?;
    }
    Ok(())
}
