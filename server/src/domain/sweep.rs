//! A sweep: a scenario and its points, which are the grid of its axes, a sample or the rows of a table.

use super::axes::{self, Column, Columns};
use super::document::{Document, Regime};
use super::effective::VELOCITIES;
use super::label;
use super::order::Order;
use super::refusal::Refusal;
use super::run::{FLUX, MAX_STORED_NUMBERS, RunSpec, Scenario};
use melange_solver::params::PARAMETERS;
use std::ops::Range;
use std::sync::Arc;

/// A sweep whose every run has been checked to be a run.
#[derive(Debug, Clone, PartialEq)]
pub struct SweepSpec {
    document: Document,
    scenario: Scenario,
    /// With how far apart in the index an axis' points are.
    axes: Vec<(Columns, usize)>,
    count: usize,
    order: Order,
    options: Option<Arc<str>>,
    /// Least and greatest value of each parameter, in the order of their table.
    ranges: [(f64, f64); PARAMETERS.len()],
}

/// What the operator permits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limits {
    /// Most runs of a sweep; never more than [`MOST_RUNS`].
    pub max_runs: usize,
}

/// Most runs of a sweep, whatever the operator permits.
pub const MOST_RUNS: usize = 1 << 24;

impl Limits {
    /// Those that nobody can lift.
    pub const MOST: Self = Self { max_runs: MOST_RUNS };
}

impl Default for Limits {
    fn default() -> Self {
        Self { max_runs: 1_000_000 }
    }
}

impl Document {
    /// The document as a sweep; without points of its own it has one run. Every run is checked.
    pub fn into_sweep(self, limits: &Limits) -> Result<SweepSpec, Refusal> {
        self.check_label()?;
        let axes = self.points(limits.max_runs.min(MOST_RUNS))?;
        let scenario = self.scenario()?;
        if !scenario.shared().transects_at_chi.is_empty() {
            let why =
                "it is for a single run: a sweep stores profiles, from which transects follow";
            return Err(Refusal::out_of_place("options.transects_at_chi", why));
        }
        let mut columns = axes.iter().flatten();
        if scenario.closure().is_some() && columns.any(|c| matches!(c, Column::Closure(_))) {
            return Err(Refusal {
                field: Some("options.upstream_closure".into()),
                ..Refusal::sentence("`upstream_closure` is given as an option and as an axis")
            });
        }
        let mut sweep = SweepSpec::new(self, scenario, axes)?;
        for index in 0..sweep.count {
            let run = sweep.checked_run(index).map_err(|refusal| sweep.in_row(index, refusal))?;
            for (parameter, (low, high)) in PARAMETERS.iter().zip(&mut sweep.ranges) {
                let value = (parameter.get)(run.parameters());
                (*low, *high) = (low.min(value), high.max(value));
            }
        }
        Ok(sweep)
    }

    /// The columns of each axis; nothing is laid out before it is counted.
    fn points(&self, most: usize) -> Result<Vec<Columns>, Refusal> {
        let given = [
            ("axes", !self.axes.is_empty()),
            ("sample", self.sample.is_some()),
            ("table", self.table.is_some()),
        ];
        let given: Vec<&str> = given.into_iter().filter(|(_, is)| *is).map(|(f, _)| f).collect();
        if let [first, second, ..] = given[..] {
            let why =
                format!("`{first}` is given too, and a sweep has either axes, a sample or a table");
            return Err(Refusal::out_of_place(second, &why));
        }
        let check = |field: &str, count: usize| {
            if count > most {
                return Err(Refusal::value(field, count, format!("at most {most} runs")));
            }
            Ok(())
        };
        if let Some(sample) = &self.sample {
            if sample.count() > most {
                return Err(Refusal::value("sample.n", sample.n, sample.permitted(most)));
            }
            return Ok(vec![sample.columns()?]);
        }
        if let Some(table) = &self.table {
            check("table.rows", table.rows())?;
            return Ok(vec![table.lanes()?]);
        }
        axes::lay_out(&self.axes, most)
    }

    /// Checks what only people and the queue read.
    fn check_label(&self) -> Result<(), Refusal> {
        label::check_name(self.name.as_deref().unwrap_or_default())?;
        label::check_tags(&self.tags)?;
        label::check_priority(self.priority.unwrap_or_default())
    }
}

impl SweepSpec {
    fn new(document: Document, scenario: Scenario, axes: Vec<Columns>) -> Result<Self, Refusal> {
        let columns = axes.iter().flatten().filter_map(|column| match column {
            Column::Parameter(name, values) => Some((*name, values[0])),
            Column::Closure(_) => None,
        });
        let scenario = scenario.varied(columns)?;
        let mut count = 1;
        let mut spaced = Vec::with_capacity(axes.len());
        for columns in axes.into_iter().rev() {
            let points = columns[0].len();
            spaced.push((columns, count));
            count *= points;
        }
        spaced.reverse();
        let order = Order::new(&spaced);
        let options = document.options_of_runs();
        let ranges = [(f64::INFINITY, f64::NEG_INFINITY); PARAMETERS.len()];
        Ok(Self { document, scenario, axes: spaced, count, order, options, ranges })
    }

    /// The document it was made from.
    pub fn document(&self) -> &Document {
        &self.document
    }

    /// Name, for people.
    pub fn name(&self) -> &str {
        self.document.name.as_deref().unwrap_or("unnamed sweep")
    }

    /// Words to find it by.
    pub fn tags(&self) -> &[String] {
        &self.document.tags
    }

    /// Sweeps with a higher one are solved first.
    pub fn priority(&self) -> i64 {
        self.document.priority.unwrap_or_default()
    }

    /// Whether runs are solved even if they are stored already.
    pub fn is_forced(&self) -> bool {
        self.document.force.unwrap_or_default()
    }

    /// What identifies its runs beside parameters and closure, as JSON; none if that is long.
    pub fn options(&self) -> Option<Arc<str>> {
        self.options.clone()
    }

    /// Seed of the sample that its points are.
    pub fn seed(&self) -> Option<u64> {
        self.document.sample.as_ref().map(|sample| sample.seed)
    }

    /// Number of runs.
    pub fn count(&self) -> usize {
        self.count
    }

    /// The run of an index below [`SweepSpec::count`].
    pub fn run(&self, index: usize) -> RunSpec {
        self.checked_run(index).expect("every run was checked when the sweep was made")
    }

    /// The effective parameters that differ between runs, in the order of the axes.
    pub fn varied(&self) -> Vec<&'static str> {
        let mut varied = Vec::new();
        for column in self.axes.iter().flat_map(|(columns, _)| columns) {
            match column {
                Column::Parameter(name, _) if *name == FLUX => varied.extend(VELOCITIES),
                Column::Parameter(name, _) => varied.push(*name),
                Column::Closure(_) => {}
            }
        }
        varied
    }

    /// What its runs solve for.
    pub fn regime(&self) -> Regime {
        self.scenario.shared().regime
    }

    /// The least and the greatest value of each parameter among all runs.
    pub fn ranges(&self) -> impl Iterator<Item = (&'static str, f64, f64)> {
        PARAMETERS.iter().zip(self.ranges).map(|(p, (low, high))| (p.name, low, high))
    }

    /// Units of work (see [`RunSpec::work`]) and stored numbers of all runs.
    pub fn extent(&self) -> (f64, usize) {
        let of = |index| {
            let run = self.run(index);
            (run.work(), run.stored_numbers())
        };
        if self.varied().contains(&"n_cells") {
            let add = |(work, numbers), (w, n): (f64, usize)| (work + w, numbers + n);
            return (0..self.count).map(of).fold((0.0, 0), add);
        }
        let (work, numbers) = of(0);
        (work * self.count as f64, numbers * self.count)
    }

    /// The indices of a stretch in an order in which each run lies near the one before.
    pub fn visiting_order(&self, stretch: Range<usize>) -> Vec<usize> {
        self.order.visit(&self.axes, stretch)
    }

    /// Cuts the sweep into stretches of neighbouring runs, each of about `work` units (see
    /// [`RunSpec::work`]), at most `most` runs and so many stored numbers as one run may have.
    pub fn stretches(&self, work: f64, most: usize) -> Vec<Range<usize>> {
        let shared = self.scenario.shared();
        let written = self.run(0).parameters().n_cells;
        let varied = self.axes.iter().find_map(|(columns, stride)| {
            columns.iter().find_map(|column| match column {
                Column::Parameter("n_cells", values) => Some((values, *stride)),
                _ => None,
            })
        });
        // What a run costs depends on no other parameter.
        let cells = |index: usize| match varied {
            Some((values, stride)) => values[index / stride % values.len()] as usize,
            None => written,
        };
        let end = |first: usize| {
            let (mut work_held, mut numbers_held) = (0.0, 0);
            for index in first..self.count {
                work_held += shared.work(cells(index));
                numbers_held += shared.stored_numbers(cells(index));
                let is_over =
                    index - first >= most || work_held > work || numbers_held > MAX_STORED_NUMBERS;
                if index > first && is_over {
                    return index;
                }
            }
            self.count
        };
        let mut stretches = Vec::new();
        let mut first = 0;
        while first < self.count {
            let length = match stretches.first() {
                Some(Range { start, end }) if varied.is_none() => end - start,
                _ => end(first) - first,
            };
            let next = (first + length).min(self.count);
            stretches.push(first..next);
            first = next;
        }
        stretches
    }

    fn checked_run(&self, index: usize) -> Result<RunSpec, Refusal> {
        let places = || {
            self.axes.iter().flat_map(move |(columns, stride)| {
                let i = index / stride % columns[0].len();
                columns.iter().map(move |column| (column, i))
            })
        };
        let point = places().filter_map(|(column, i)| match column {
            Column::Parameter(name, values) => Some((*name, values[i])),
            Column::Closure(_) => None,
        });
        let closure = places().find_map(|(column, i)| match column {
            Column::Closure(closures) => Some(closures[i]),
            Column::Parameter(..) => None,
        });
        self.scenario.run(point, closure)
    }

    /// A refusal with the row of the table that it comes from.
    fn in_row(&self, index: usize, refusal: Refusal) -> Refusal {
        if self.document.table.is_none() {
            return refusal;
        }
        Refusal {
            detail: format!("{} (row {} of the table)", refusal.detail, index + 1),
            ..refusal
        }
    }
}

#[cfg(test)]
mod tests;
