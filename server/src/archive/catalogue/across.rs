//! Lists of runs of many sweeps: the sweeps that can have runs of a list are known beforehand, and each of them
//! is asked like a single one.

use super::filter::{ids, served};
use super::list::{FEW, LOOKED_AT, Listing, Order, Total, count_filtered, keys};
use super::{RunRow, run_row};
use crate::domain::filter::Filter;
use crate::domain::found::SweepFacts;
use crate::store::Connection;
use serde_json::Value;
use sqlx::{QueryBuilder, Row, Sqlite};
use std::cmp::Ordering;
use std::collections::{HashMap, HashSet};

/// A sweep that may have runs of a list.
#[derive(Debug, Clone)]
pub struct Candidate<'a> {
    /// What is known of it.
    pub facts: &'a SweepFacts,
    /// Which of its runs; all if there is none.
    pub filter: Option<Filter>,
}

/// A page of the runs of many sweeps.
#[derive(Debug, Clone)]
pub struct Across<'a> {
    /// The sweeps, the newest first.
    pub candidates: &'a [Candidate<'a>],
    /// In which order; if there is none, sweep by sweep, the newest first, and by index in each.
    pub order: Option<Order<'a>>,
    /// Most runs of the page.
    pub limit: i64,
    /// Where the page before ended.
    pub after: Option<Spot>,
}

/// Where a page ends.
#[derive(Debug, Clone, PartialEq)]
pub struct Spot {
    /// Value sorted by of the last run; null where sweeps follow each other.
    pub value: Value,
    /// The sweep's number.
    pub sweep: i64,
    /// The run's index; none if nothing is left of the sweep.
    pub index: Option<i64>,
}

/// Runs that are looked at for a page; one that is not full then ends, and the next one goes on.
const LOOKED_AT_FOR_A_PAGE: i64 = 1_000_000;
/// What asking a sweep costs, in runs looked at.
const COST_OF_ASKING: i64 = 250;

impl Candidate<'_> {
    fn axes(&self) -> Vec<&str> {
        self.facts.axes.iter().map(String::as_str).collect()
    }

    /// Runs that have to be looked at, about, to know which ones the filter lets through.
    fn cost(&self) -> i64 {
        let Some(filter) = &self.filter else { return COST_OF_ASKING };
        let served = served(filter, &self.axes());
        let stored = self.facts.stored();
        let looked_at = match () {
            () if served.iter().any(|s| s.is_whole) => 0,
            () if !served.is_empty() => stored.min(FEW),
            () => stored,
        };
        looked_at + COST_OF_ASKING
    }

    fn listing<'a>(
        &'a self,
        order: Order<'a>,
        limit: i64,
        after: Option<(Value, i64)>,
    ) -> Listing<'a> {
        let (sweep, axes) = (self.facts.number, self.axes());
        Listing { sweep, axes, filter: self.filter.as_ref(), order, limit, after }
    }
}

const BY_INDEX: Order<'static> = Order { column: "run_index", descending: false };

/// A page of the runs of many sweeps, each with its sweep's number, and where it ends; nowhere if nothing follows.
pub async fn runs_across(
    connection: &mut Connection,
    across: &Across<'_>,
) -> sqlx::Result<(Vec<(i64, RunRow)>, Option<Spot>)> {
    let (found, end) = match across.order {
        None => sweep_by_sweep(connection, across).await?,
        Some(order) => sorted(connection, across, order).await?,
    };
    let rows = rows(connection, &found).await?;
    Ok((rows, end))
}

/// Sweep and index of runs.
type Found = Vec<(i64, i64)>;

async fn sweep_by_sweep(
    connection: &mut Connection,
    across: &Across<'_>,
) -> sqlx::Result<(Found, Option<Spot>)> {
    let mut found = Vec::new();
    let mut looked_at = 0;
    for candidate in across.candidates {
        let sweep = candidate.facts.number;
        let after = match &across.after {
            Some(spot) if sweep > spot.sweep || (sweep == spot.sweep && spot.index.is_none()) => {
                continue;
            }
            Some(Spot { sweep: last, index: Some(index), .. }) if sweep == *last => {
                Some((Value::Null, *index))
            }
            _ => None,
        };
        if looked_at > LOOKED_AT_FOR_A_PAGE {
            // Nothing of this one was looked at: it is the first one of the next page.
            return Ok((found, Some(Spot { value: Value::Null, sweep: sweep + 1, index: None })));
        }
        let missing = across.limit - found.len() as i64;
        let listing = candidate.listing(BY_INDEX, missing, after);
        let keys = keys(connection, &listing).await?;
        found.extend(keys.into_iter().map(|(_, index)| (sweep, index)));
        if found.len() as i64 == across.limit {
            let index = found.last().map(|(_, index)| *index);
            return Ok((found, Some(Spot { value: Value::Null, sweep, index })));
        }
        looked_at += candidate.cost();
    }
    Ok((found, None))
}

/// Runs in the order of a column: each sweep tells its first ones. Where the ranges of a parameter tell that a
/// sweep's runs all come later, it is not asked.
async fn sorted(
    connection: &mut Connection,
    across: &Across<'_>,
    order: Order<'_>,
) -> sqlx::Result<(Found, Option<Spot>)> {
    let limit = across.limit as usize;
    let directed =
        |ordering: Ordering| if order.descending { ordering.reverse() } else { ordering };
    let ranges = |candidate: &Candidate<'_>| candidate.facts.range(order.column);
    // The value that its first run has at the earliest.
    let bound = |candidate: &Candidate<'_>| {
        ranges(candidate).map(|(low, high)| if order.descending { high } else { low })
    };
    let mut candidates: Vec<&Candidate<'_>> = across.candidates.iter().collect();
    candidates.sort_by(|a, b| match (bound(a), bound(b)) {
        (Some(a), Some(b)) => directed(a.total_cmp(&b)),
        (a, b) => a.is_some().cmp(&b.is_some()),
    });
    let mut found: Vec<(Value, i64, i64)> = Vec::new();
    let first = |a: &(Value, i64, i64), b: &(Value, i64, i64)| {
        directed(by_value(&a.0, &b.0))
            .then_with(|| b.1.cmp(&a.1))
            .then_with(|| directed(a.2.cmp(&b.2)))
    };
    for candidate in candidates {
        let sweep = candidate.facts.number;
        if found.len() == limit
            && let (Some(bound), Some(last)) = (bound(candidate), found.last())
            && directed(by_value(&bound.into(), &last.0)).is_gt()
        {
            break;
        }
        let same = ranges(candidate).filter(|(low, high)| low == high).map(|(low, _)| low);
        // Of runs with the value where the page before ended, those of newer sweeps were on it.
        let (before_all, after_all) = match across.after.as_ref().map(|spot| spot.value.as_i64()) {
            Some(Some(index)) if order.column == "run_index" => {
                (index.saturating_add(if order.descending { 1 } else { -1 }), index)
            }
            _ if order.descending => (i64::MAX, -1),
            _ => (-1, i64::MAX),
        };
        let place = |spot: &Spot| match sweep.cmp(&spot.sweep) {
            Ordering::Greater => after_all,
            Ordering::Less => before_all,
            Ordering::Equal => spot.index.unwrap_or(after_all),
        };
        let keys = match (same, &across.after) {
            // All runs of the sweep have the same value, and are in the order of their indices.
            (Some(value), spot) => {
                let value = Value::from(value);
                let after = match spot.as_ref().map(|s| (directed(by_value(&value, &s.value)), s)) {
                    Some((Ordering::Less, _)) => continue,
                    Some((Ordering::Equal, spot)) => Some((Value::Null, place(spot))),
                    Some((Ordering::Greater, _)) | None => None,
                };
                let order = Order { column: "run_index", ..order };
                let listing = candidate.listing(order, across.limit, after);
                let keys = keys(connection, &listing).await?;
                keys.into_iter().map(|(_, index)| (value.clone(), index)).collect()
            }
            (None, spot) => {
                let after = spot.as_ref().map(|spot| (spot.value.clone(), place(spot)));
                keys(connection, &candidate.listing(order, across.limit, after)).await?
            }
        };
        found.extend(keys.into_iter().map(|(value, index)| (value, sweep, index)));
        found.sort_by(first);
        found.truncate(limit);
    }
    let last = found.last().filter(|_| found.len() == limit);
    let end = last.map(|(value, sweep, index)| Spot {
        value: value.clone(),
        sweep: *sweep,
        index: Some(*index),
    });
    Ok((found.into_iter().map(|(_, sweep, index)| (sweep, index)).collect(), end))
}

/// Null first, then numbers or texts.
fn by_value(a: &Value, b: &Value) -> Ordering {
    match (a, b) {
        (Value::String(a), Value::String(b)) => a.cmp(b),
        (a, b) => match (a.as_f64(), b.as_f64()) {
            (Some(a), Some(b)) => a.partial_cmp(&b).unwrap_or(Ordering::Equal),
            (a, b) => a.is_some().cmp(&b.is_some()),
        },
    }
}

/// The rows of runs, in the same order; a run that is gone meanwhile is left out.
pub(super) async fn rows(
    connection: &mut Connection,
    found: &[(i64, i64)],
) -> sqlx::Result<Vec<(i64, RunRow)>> {
    /// Runs per statement.
    const RUNS: usize = 1_000;
    let mut of_sweep: HashMap<i64, Vec<i64>> = HashMap::new();
    for (sweep, index) in found {
        of_sweep.entry(*sweep).or_default().push(*index);
    }
    let mut rows = HashMap::new();
    for (sweep, indices) in &of_sweep {
        for indices in indices.chunks(RUNS) {
            let mut query = QueryBuilder::<Sqlite>::new("SELECT * FROM runs WHERE sweep = ");
            query.push_bind(*sweep).push(" AND run_index IN (");
            let mut list = query.separated(", ");
            indices.iter().for_each(|index| {
                list.push_bind(*index);
            });
            query.push(")");
            for row in query.build().fetch_all(&mut *connection).await? {
                rows.insert((*sweep, row.get::<i64, _>("run_index")), run_row(&row));
            }
        }
    }
    Ok(found.iter().filter_map(|key| Some((key.0, rows.remove(key)?))).collect())
}

/// How many runs of these sweeps there are: exact unless too many of them would have to be looked at, then as many
/// as were found until then.
pub async fn count_across(
    connection: &mut Connection,
    candidates: &[Candidate<'_>],
) -> sqlx::Result<Total> {
    let mut counted = Total { total: 0, is_exact: true };
    let mut looked_at = 0;
    for candidate in candidates {
        let Some(filter) = &candidate.filter else {
            counted.total += candidate.facts.stored();
            continue;
        };
        if looked_at > LOOKED_AT {
            counted.is_exact = false;
            continue;
        }
        let listing = candidate.listing(BY_INDEX, 1, None);
        let of_sweep = count_filtered(connection, &listing, filter).await?;
        counted.total += of_sweep.total;
        counted.is_exact &= of_sweep.is_exact;
        looked_at += candidate.cost();
    }
    Ok(counted)
}

/// The sweeps that hold the runs whose ids a filter names; none if it names none.
pub async fn holding(
    connection: &mut Connection,
    filter: &Filter,
) -> sqlx::Result<Option<HashSet<i64>>> {
    let Some(ids) = ids(filter) else { return Ok(None) };
    let mut query =
        QueryBuilder::<Sqlite>::new("SELECT DISTINCT sweep FROM runs WHERE run_id IN (");
    let mut list = query.separated(", ");
    ids.iter().for_each(|id| {
        list.push_bind((*id).to_owned());
    });
    query.push(")");
    let sweeps: Vec<i64> = query.build_query_scalar().fetch_all(connection).await?;
    Ok(Some(sweeps.into_iter().collect()))
}

#[cfg(test)]
mod tests;
