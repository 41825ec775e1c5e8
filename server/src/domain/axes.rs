//! The axes of a sweep: what moves along each, and its points. Points come from their number, never by
//! accumulation.

use super::document::Axis;
use super::refusal::Refusal;
use super::run::{FLUX, closure_of_name};
use melange_solver::params::{self, ParameterError};
use melange_solver::physics::closure::UpstreamClosure;
use std::sync::Arc;

/// A parameter or an option, with its value at each point of an axis.
#[derive(Debug, Clone, PartialEq)]
pub enum Column {
    /// A parameter's name and its values.
    Parameter(&'static str, Arc<Vec<f64>>),
    /// The option `upstream_closure`.
    Closure(Arc<Vec<UpstreamClosure>>),
}

impl Column {
    /// Number of points.
    pub fn len(&self) -> usize {
        match self {
            Self::Parameter(_, values) => values.len(),
            Self::Closure(closures) => closures.len(),
        }
    }
}

/// An axis of a sweep: columns of the same length that move together.
pub type Columns = Vec<Column>;

/// The name of a parameter of the table, or of the flux that sets two; `field` is where it is written.
pub fn known_name(field: &str, name: &str) -> Result<&'static str, Refusal> {
    if name == FLUX {
        return Ok(FLUX);
    }
    params::info(name).map(|info| info.name).ok_or_else(|| {
        let error = ParameterError::Unknown { name: name.to_owned() };
        Refusal {
            field: Some(field.to_owned()),
            value: Some(name.into()),
            ..Refusal::parameter(field, &error)
        }
    })
}

/// The axes laid out, of at most `most` runs together; counted before anything is laid out, since a
/// short document can ask for very many points.
pub fn lay_out(axes: &[Axis], most: usize) -> Result<Vec<Columns>, Refusal> {
    let mut named: Vec<&str> = Vec::new();
    let mut count = 1_usize;
    for (i, axis) in axes.iter().enumerate() {
        let field = format!("axes[{i}]");
        let zipped = axis.zip.iter().flatten().enumerate();
        let members = std::iter::once((field.clone(), axis))
            .chain(zipped.map(|(j, axis)| (format!("{field}.zip[{j}]"), axis)));
        let mut points = 1;
        for (field, axis) in members {
            if let Some(name) = axis.parameter.as_deref().or(axis.option.as_deref()) {
                if named.contains(&name) {
                    return Err(Refusal::value(field, name, "each name on one axis only"));
                }
                named.push(name);
            }
            points = points.max(axis.points_asked_for());
        }
        count = count.saturating_mul(points);
        if count > most {
            let permitted = format!("a grid of at most {most} runs");
            return Err(Refusal::value("axes", count, permitted));
        }
    }
    axes.iter().enumerate().map(|(i, axis)| axis.columns(&format!("axes[{i}]"))).collect()
}

impl Axis {
    /// Points the axis itself would have, for a first count.
    fn points_asked_for(&self) -> usize {
        let spaced = self.linspace.or(self.logspace).map(|(_, _, n)| n as usize);
        spaced.or(self.values.as_ref().map(Vec::len)).unwrap_or(1).max(1)
    }

    fn columns(&self, field: &str) -> Result<Columns, Refusal> {
        let Some(zipped) = &self.zip else { return Ok(vec![self.column(field, false)?]) };
        let has_name = self.parameter.is_some() || self.option.is_some();
        if has_name || self.linspace.is_some() || self.logspace.is_some() || self.values.is_some() {
            let why = "a zip has its names and points in the axes that it zips";
            return Err(Refusal::out_of_place(field, why));
        }
        let field = format!("{field}.zip");
        if zipped.is_empty() {
            return Err(Refusal::value(field, Vec::<f64>::new(), "at least one axis"));
        }
        let mut columns = Columns::with_capacity(zipped.len());
        for (i, axis) in zipped.iter().enumerate() {
            let place = format!("{field}[{i}]");
            if axis.zip.is_some() {
                let why = "a zip holds axes of one parameter or option each";
                return Err(Refusal::out_of_place(&format!("{place}.zip"), why));
            }
            let column = axis.column(&place, true)?;
            if let Some(first) = columns.first()
                && first.len() != column.len()
            {
                let permitted = format!("as many points as {field}[0] has, {}", first.len());
                return Err(Refusal::value(place, column.len(), permitted));
            }
            columns.push(column);
        }
        Ok(columns)
    }

    /// The axis' one column. In a zip a value may come again.
    fn column(&self, field: &str, may_repeat: bool) -> Result<Column, Refusal> {
        match (&self.parameter, &self.option) {
            (Some(name), None) => {
                let name = known_name(&format!("{field}.parameter"), name)?;
                Ok(Column::Parameter(name, Arc::new(self.numbers(field, may_repeat)?)))
            }
            (None, Some(option)) if option == "upstream_closure" => {
                Ok(Column::Closure(Arc::new(self.closures(field, may_repeat)?)))
            }
            (None, Some(option)) => {
                Err(Refusal::value(format!("{field}.option"), option.as_str(), "upstream_closure"))
            }
            _ => Err(Refusal {
                field: Some(field.to_owned()),
                permitted: Some("one of `parameter`, `option` and `zip`".into()),
                ..Refusal::sentence(format!("`{field}` needs either `parameter` or `option`"))
            }),
        }
    }

    fn closures(&self, field: &str, may_repeat: bool) -> Result<Vec<UpstreamClosure>, Refusal> {
        let names = match (&self.values, self.linspace, self.logspace) {
            (Some(values), None, None) => values,
            _ => {
                return Err(Refusal {
                    field: Some(field.to_owned()),
                    permitted: Some("`values`".into()),
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
            if !may_repeat && closures.contains(&closure) {
                return Err(Refusal::value(&field, text, "each value once"));
            }
            closures.push(closure);
        }
        if closures.is_empty() {
            return Err(Refusal::value(field, names.clone(), "at least one value"));
        }
        Ok(closures)
    }

    fn numbers(&self, field: &str, may_repeat: bool) -> Result<Vec<f64>, Refusal> {
        let spaced = |kind: &str, (first, last, n): (f64, f64, u64), log: bool| {
            let field = format!("{field}.{kind}");
            for end in [first, last] {
                if !end.is_finite() || (log && end <= 0.0) {
                    let permitted = if log { "positive finite ends" } else { "finite ends" };
                    return Err(Refusal::number(&field, end, permitted));
                }
            }
            if n == 0 {
                return Err(Refusal::value(&field, n, "at least one point"));
            }
            let is_one = n == 1;
            if is_one != (first == last) && (is_one || !may_repeat) {
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
                    permitted: Some("one of `linspace`, `logspace` and `values`".into()),
                    ..Refusal::sentence(format!(
                        "`{field}` needs exactly one of `linspace`, `logspace` and `values`"
                    ))
                });
            }
        };
        if values.is_empty() {
            return Err(Refusal::value(format!("{field}.values"), 0, "at least one point"));
        }
        let mut sorted = values.clone();
        sorted.sort_by(f64::total_cmp);
        if let Some(twice) = sorted.windows(2).find(|w| w[0] == w[1] && !may_repeat) {
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
