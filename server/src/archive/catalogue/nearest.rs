//! The runs nearest to given parameters: sweep by sweep, those first whose ranges come nearest, and in each
//! within a box about the parameters that grows until it holds enough. All others are farther away, so that what is
//! found is what looking at every run would find.

use super::across::Candidate;
use super::filter::{PRIMARY, along, condition, index_of};
use super::{RunRow, across};
use crate::domain::nearness::Nearness;
use crate::store::Connection;
use futures_util::TryStreamExt;
use sqlx::{QueryBuilder, Row, Sqlite};
use std::cmp::Ordering;
use std::collections::HashSet;

/// A run with its distance.
#[derive(Debug, Clone)]
pub struct Near {
    /// The distance.
    pub distance: f64,
    /// Its sweep's number.
    pub sweep: i64,
    /// Its row.
    pub row: RunRow,
}

/// A run that may be among the nearest.
#[derive(Debug, Clone, PartialEq)]
struct Spotted {
    distance: f64,
    sweep: i64,
    index: i64,
    id: String,
}

impl Spotted {
    /// Near before far, new sweeps before old ones, low indices before high ones.
    fn order(&self, other: &Self) -> Ordering {
        self.distance
            .total_cmp(&other.distance)
            .then_with(|| other.sweep.cmp(&self.sweep))
            .then_with(|| self.index.cmp(&other.index))
    }
}

/// The nearest runs, each id once.
#[derive(Debug)]
struct Nearest {
    most: usize,
    spotted: Vec<Spotted>,
}

impl Nearest {
    /// The distance beyond which nothing is among the nearest any more.
    fn reach(&self) -> f64 {
        match self.spotted.last() {
            Some(last) if self.spotted.len() == self.most => last.distance,
            _ => f64::INFINITY,
        }
    }

    fn add(&mut self, run: Spotted) {
        if run.distance > self.reach() {
            return;
        }
        if let Some(same) = self.spotted.iter().position(|known| known.id == run.id) {
            if self.spotted[same].order(&run).is_le() {
                return;
            }
            self.spotted.remove(same);
        }
        let place = self.spotted.partition_point(|known| known.order(&run).is_lt());
        self.spotted.insert(place, run);
        self.spotted.truncate(self.most);
    }
}

/// The `most` runs of these sweeps that are nearest, each once: in its newest sweep. Of those equally far away,
/// the ones of newer sweeps come first, then those of lower index.
pub async fn nearest(
    connection: &mut Connection,
    candidates: &[Candidate<'_>],
    near: &Nearness,
    most: usize,
) -> sqlx::Result<Vec<Near>> {
    let least = |c: &Candidate<'_>| near.least(|parameter| c.facts.range(parameter));
    let mut by_distance: Vec<(f64, &Candidate<'_>)> =
        candidates.iter().map(|candidate| (least(candidate), candidate)).collect();
    by_distance
        .sort_by(|a, b| a.0.total_cmp(&b.0).then_with(|| b.1.facts.number.cmp(&a.1.facts.number)));
    let mut nearest = Nearest { most, spotted: Vec::new() };
    for (least, candidate) in by_distance {
        if least > nearest.reach() {
            break;
        }
        in_sweep(connection, candidate, near, least, &mut nearest).await?;
    }
    let places: Vec<(i64, i64)> = nearest.spotted.iter().map(|s| (s.sweep, s.index)).collect();
    let rows = across::rows(connection, &places).await?;
    let near = |(sweep, row): (i64, RunRow)| {
        let index = row.whole("run_index").map(|index| index as i64);
        let spotted =
            nearest.spotted.iter().find(|s| s.sweep == sweep && Some(s.index) == index)?;
        Some(Near { distance: spotted.distance, sweep, row })
    };
    Ok(rows.into_iter().filter_map(near).collect())
}

/// Adds the nearest runs of a sweep.
async fn in_sweep(
    connection: &mut Connection,
    candidate: &Candidate<'_>,
    near: &Nearness,
    least: f64,
    nearest: &mut Nearest,
) -> sqlx::Result<()> {
    let facts = candidate.facts;
    // The parameters that tell the runs of the sweep apart, and how far each one reaches.
    let mut extents = Vec::new();
    let mut is_known = true;
    for wanted in near.wanted() {
        match facts.range(wanted.parameter.name) {
            Some((low, high)) if low == high => {}
            Some((low, high)) => extents.push(wanted.offset(high) - wanted.offset(low)),
            None => is_known = false,
        }
    }
    if is_known && extents.is_empty() {
        return look(connection, candidate, near, None, true, nearest).await.map(drop);
    }
    // Twice as many as are asked for would be in a box of this size, were they spread evenly.
    let wide =
        extents.iter().product::<f64>() * 2.0 * nearest.most as f64 / facts.stored().max(1) as f64;
    let mut step = 0.5 * wide.powf(1.0 / extents.len().max(1) as f64);
    let farthest = near
        .wanted()
        .iter()
        .filter_map(|wanted| facts.range(wanted.parameter.name).map(|range| (wanted, range)))
        .map(|(wanted, (low, high))| wanted.offset(low).abs().max(wanted.offset(high).abs()))
        .fold(0.0, f64::max);
    loop {
        let reach = nearest.reach();
        let radius = reach.min(least + step);
        if !is_known || step <= 0.0 || radius >= farthest {
            return look(connection, candidate, near, None, false, nearest).await.map(drop);
        }
        let mut inside = Nearest { most: nearest.most, spotted: Vec::new() };
        look(connection, candidate, near, Some(radius), false, &mut inside).await?;
        // A run outside the box is farther away than its half width.
        if radius >= reach || inside.reach() <= radius {
            inside.spotted.into_iter().for_each(|run| nearest.add(run));
            return Ok(());
        }
        step *= 2.0;
    }
}

/// Adds the runs of a sweep whose parameters differ by no more than a radius each, or all of them; of runs that
/// are all equally far away only as many as are asked for.
async fn look(
    connection: &mut Connection,
    candidate: &Candidate<'_>,
    near: &Nearness,
    radius: Option<f64>,
    are_equal: bool,
    nearest: &mut Nearest,
) -> sqlx::Result<()> {
    let facts = candidate.facts;
    let axes: Vec<&str> = facts.axes.iter().map(String::as_str).collect();
    let names: Vec<String> =
        near.wanted().iter().map(|w| format!("\"{}\"", w.parameter.name)).collect();
    // The parameter of which the box holds the smallest part of its range, among those with an index.
    let narrow = radius.and_then(|radius| {
        let share = |name: &str, offsets: (f64, f64)| {
            let range = facts.range(name)?;
            Some((offsets.1 - offsets.0) / (range.1 - range.0))
        };
        let indexed = near.wanted().iter().filter_map(|wanted| {
            let name = wanted.parameter.name;
            let index = index_of(name, &axes)?;
            Some((share(name, wanted.within(radius))?, name, index))
        });
        indexed.min_by(|a, b| a.0.total_cmp(&b.0))
    });
    let index = narrow.as_ref().map_or(PRIMARY, |(_, _, index)| index);
    let mut query = QueryBuilder::<Sqlite>::new("SELECT run_index, run_id, ");
    query.push(names.join(", ")).push(" FROM ");
    along(&mut query, index, facts.number);
    if let Some(radius) = radius {
        for wanted in near.wanted() {
            let name = wanted.parameter.name;
            let axis = super::list::axis_column(name, &axes)
                .filter(|_| narrow.as_ref().is_some_and(|(_, narrow, _)| *narrow == name));
            let (low, high) = wanted.within(radius);
            query.push(format!(" AND \"{}\" BETWEEN ", axis.as_deref().unwrap_or(name)));
            query.push_bind(low).push(" AND ").push_bind(high);
        }
    }
    if let Some(filter) = &candidate.filter {
        query.push(" AND (");
        condition(filter, &axes).push_to(&mut query);
        query.push(")");
    }
    if are_equal {
        query.push(" ORDER BY run_index");
    }
    let mut rows = query.build().fetch(&mut *connection);
    let mut ids = HashSet::new();
    while let Some(row) = rows.try_next().await? {
        let values: Vec<f64> = (0..names.len()).map(|i| row.get(2 + i)).collect();
        let distance = near.distance(&values);
        if distance > nearest.reach() {
            if are_equal {
                break;
            }
            continue;
        }
        let (sweep, index, id): (_, _, String) =
            (facts.number, row.get("run_index"), row.get("run_id"));
        if are_equal {
            ids.insert(id.clone());
        }
        nearest.add(Spotted { distance, sweep, index, id });
        if ids.len() >= nearest.most {
            break;
        }
    }
    Ok(())
}
