//! A sweep: a scenario and the axes of its grid. Points come from the index, never by accumulation.

use super::document::{Axis, Document};
use super::refusal::Refusal;
use super::run::{FLUX, MAX_STORED_NUMBERS, RunSpec, Scenario, closure_of_name};
use melange_solver::params::{self, ParameterError};
use melange_solver::physics::closure::UpstreamClosure;
use std::ops::Range;

/// A sweep whose every run has been checked to be a run.
#[derive(Debug, Clone, PartialEq)]
pub struct SweepSpec {
    document: Document,
    scenario: Scenario,
    axes: Vec<Points>,
}

/// The points of an axis.
#[derive(Debug, Clone, PartialEq)]
enum Points {
    Parameter(String, Vec<f64>),
    Closure(Vec<UpstreamClosure>),
}

impl Points {
    fn len(&self) -> usize {
        match self {
            Points::Parameter(_, values) => values.len(),
            Points::Closure(values) => values.len(),
        }
    }
}

/// Most runs of a sweep.
pub const MAX_RUNS: usize = 1_000_000;
/// Longest name of a sweep, in characters.
const MAX_NAME: usize = 200;

impl Document {
    /// The document as a sweep; without axes it has one run. Every run is checked.
    pub fn into_sweep(self) -> Result<SweepSpec, Refusal> {
        let name_length = self.name.as_deref().unwrap_or_default().chars().count();
        if name_length > MAX_NAME {
            return Err(Refusal::value(
                "name",
                name_length,
                format!("at most {MAX_NAME} characters"),
            ));
        }
        // Counted before anything is laid out: a short document can ask for very many points.
        let mut count = 1_usize;
        for (i, axis) in self.axes.iter().enumerate() {
            let of = |a: &Axis| (a.parameter.clone(), a.option.clone());
            if self.axes[..i].iter().any(|earlier| of(earlier) == of(axis)) {
                let name = axis.parameter.as_deref().or(axis.option.as_deref()).unwrap_or_default();
                return Err(Refusal::value(
                    format!("axes[{i}]"),
                    name,
                    "each name on one axis only",
                ));
            }
            count = count.saturating_mul(axis.points_asked_for());
            if count > MAX_RUNS {
                let permitted = format!("a grid of at most {MAX_RUNS} runs");
                return Err(Refusal::value("axes", count, permitted));
            }
        }
        let laid_out =
            self.axes.iter().enumerate().map(|(i, a)| a.points(&format!("axes[{i}]"), MAX_RUNS));
        let axes: Vec<Points> = laid_out.collect::<Result<_, _>>()?;
        let scenario = self.scenario()?;
        if !scenario.shared().transects_at_chi.is_empty() {
            let why =
                "it is for a single run: a sweep stores profiles, from which transects follow";
            return Err(Refusal::out_of_place("options.transects_at_chi", why));
        }
        if scenario.closure().is_some() && axes.iter().any(|a| matches!(a, Points::Closure(_))) {
            return Err(Refusal {
                field: Some("options.upstream_closure".into()),
                ..Refusal::sentence("`upstream_closure` is given as an option and as an axis")
            });
        }
        let sweep = SweepSpec { document: self, scenario, axes };
        for index in 0..count {
            sweep.checked_run(index)?;
        }
        Ok(sweep)
    }
}

impl SweepSpec {
    /// The document it was made from.
    pub fn document(&self) -> &Document {
        &self.document
    }

    /// Name, for people.
    pub fn name(&self) -> &str {
        self.document.name.as_deref().unwrap_or("unnamed sweep")
    }

    /// Number of runs.
    pub fn count(&self) -> usize {
        self.axes.iter().map(Points::len).product()
    }

    /// The run of an index below [`SweepSpec::count`].
    pub fn run(&self, index: usize) -> RunSpec {
        self.checked_run(index).expect("every run was checked when the sweep was made")
    }

    /// Cuts the sweep into stretches of neighbouring runs, each of about `work` units (see
    /// [`RunSpec::work`]), at most `most` runs and so many stored numbers as one run may have.
    pub fn stretches(&self, work: f64, most: usize) -> Vec<Range<usize>> {
        let mut stretches = Vec::new();
        let (mut first, mut work_held, mut numbers_held) = (0, 0.0, 0);
        for index in 0..self.count() {
            let run = self.run(index);
            let numbers = run.stored_numbers();
            let is_full = index - first >= most
                || work_held + run.work() > work
                || numbers_held + numbers > MAX_STORED_NUMBERS;
            if index > first && is_full {
                stretches.push(first..index);
                (first, work_held, numbers_held) = (index, 0.0, 0);
            }
            work_held += run.work();
            numbers_held += numbers;
        }
        stretches.push(first..self.count());
        stretches
    }

    fn checked_run(&self, index: usize) -> Result<RunSpec, Refusal> {
        let mut rest = index;
        let mut point = Vec::with_capacity(self.axes.len());
        let mut closure = None;
        for axis in self.axes.iter().rev() {
            let i = rest % axis.len();
            rest /= axis.len();
            match axis {
                Points::Parameter(name, values) => point.push((name.clone(), values[i])),
                Points::Closure(values) => closure = Some(values[i]),
            }
        }
        point.reverse();
        self.scenario.run(&point, closure)
    }
}

impl Axis {
    /// Points the axis would have, for a first count.
    fn points_asked_for(&self) -> usize {
        let spaced = self.linspace.or(self.logspace).map(|(_, _, n)| n as usize);
        spaced.or(self.values.as_ref().map(Vec::len)).unwrap_or(1).max(1)
    }

    fn points(&self, field: &str, most: usize) -> Result<Points, Refusal> {
        if self.zip.is_some() {
            return Err(Refusal::not_yet(&format!("{field}.zip")));
        }
        match (&self.parameter, &self.option) {
            (Some(name), None) => {
                if name != FLUX && params::info(name).is_none() {
                    let error = ParameterError::Unknown { name: name.clone() };
                    return Err(Refusal {
                        field: Some(format!("{field}.parameter")),
                        ..Refusal::parameter(field, &error)
                    });
                }
                Ok(Points::Parameter(name.clone(), self.numbers(field, most)?))
            }
            (None, Some(option)) if option == "upstream_closure" => {
                Ok(Points::Closure(self.closures(field)?))
            }
            (None, Some(option)) => {
                Err(Refusal::value(format!("{field}.option"), option.as_str(), "upstream_closure"))
            }
            _ => Err(Refusal {
                field: Some(field.to_owned()),
                ..Refusal::sentence(format!("`{field}` needs either `parameter` or `option`"))
            }),
        }
    }

    fn closures(&self, field: &str) -> Result<Vec<UpstreamClosure>, Refusal> {
        let names = match (&self.values, self.linspace, self.logspace) {
            (Some(values), None, None) => values,
            _ => {
                return Err(Refusal {
                    field: Some(field.to_owned()),
                    ..Refusal::sentence(format!(
                        "`{field}` of an option needs `values` and nothing else"
                    ))
                });
            }
        };
        let field = format!("{field}.values");
        let mut closures = Vec::new();
        for name in names {
            let text = name.as_str().unwrap_or_default();
            let closure = closure_of_name(&field, text).map_err(|_| {
                Refusal::value(&field, name.clone(), "published, printed or no_stretching")
            })?;
            if closures.contains(&closure) {
                return Err(Refusal::value(&field, text, "each value once"));
            }
            closures.push(closure);
        }
        if closures.is_empty() {
            return Err(Refusal::value(field, names.clone(), "at least one value"));
        }
        Ok(closures)
    }

    fn numbers(&self, field: &str, most: usize) -> Result<Vec<f64>, Refusal> {
        let spaced = |kind: &str, (first, last, n): (f64, f64, u64), log: bool| {
            let field = format!("{field}.{kind}");
            for end in [first, last] {
                if !end.is_finite() || (log && end <= 0.0) {
                    let permitted = if log { "positive finite ends" } else { "finite ends" };
                    return Err(Refusal::number(&field, end, permitted));
                }
            }
            if n == 0 || n > most as u64 {
                return Err(Refusal::value(&field, n, format!("from 1 to {most} points")));
            }
            if (n == 1) != (first == last) {
                let permitted = "different ends for several points, the same for one";
                return Err(Refusal::number(&field, last, permitted));
            }
            Ok((0..n as usize).map(|i| spaced_point(first, last, n as usize, i, log)).collect())
        };
        let values: Vec<f64> = match (self.linspace, self.logspace, &self.values) {
            (Some(ends), None, None) => spaced("linspace", ends, false)?,
            (None, Some(ends), None) => spaced("logspace", ends, true)?,
            (None, None, Some(values)) => values
                .iter()
                .map(|v| {
                    v.as_f64().ok_or_else(|| {
                        Refusal::value(format!("{field}.values"), v.clone(), "finite numbers")
                    })
                })
                .collect::<Result<_, _>>()?,
            _ => {
                return Err(Refusal {
                    field: Some(field.to_owned()),
                    ..Refusal::sentence(format!(
                        "`{field}` needs exactly one of `linspace`, `logspace` and `values`"
                    ))
                });
            }
        };
        if values.is_empty() || values.len() > most {
            let permitted = format!("from 1 to {most} points");
            return Err(Refusal::value(format!("{field}.values"), values.len(), permitted));
        }
        let mut sorted = values.clone();
        sorted.sort_by(f64::total_cmp);
        if let Some(twice) = sorted.windows(2).find(|w| w[0] == w[1]) {
            return Err(Refusal::number(field, twice[0], "each point once"));
        }
        Ok(values)
    }
}

/// Point i of n between two ends, which are met exactly.
fn spaced_point(first: f64, last: f64, n: usize, i: usize, log: bool) -> f64 {
    if i == 0 {
        return first;
    }
    if i + 1 == n {
        return last;
    }
    let t = i as f64 / (n - 1) as f64;
    if log { (first.ln() + (last.ln() - first.ln()) * t).exp() } else { first + (last - first) * t }
}
