//! Runs of all sweeps over REST: by filter, and the nearest ones to given parameters. Which sweeps can have such
//! runs is found out first, from what the queue knows of them.

use super::Service;
use super::error::Problem;
use super::extract::Asked;
use super::runs::{is_of, order};
use super::sweeps::page_limit;
use crate::archive::catalogue::{self, Across, Candidate, RunRow, Spot, Total};
use crate::domain::filter::{ColumnKind, Filter, Resolved};
use crate::domain::found::{self, SweepFacts};
use crate::domain::nearness::{Nearness, Wanted};
use crate::domain::refusal::Refusal;
use crate::queue;
use crate::store::Connection;
use axum::Json;
use axum::extract::State;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};
use std::collections::HashSet;
use utoipa::{IntoParams, ToSchema};

/// Which runs, in which order.
#[derive(Debug, Default, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct Looking {
    /// Which runs, such as `tag = "paper" and melt_rate_m_per_day < 0.7 and status = "converged"`.
    pub filter: Option<String>,
    /// Column of the runs to sort by, with `-` before it from high to low; if not given, sweep by sweep, the newest
    /// first, and by `run_index` in each.
    pub sort: Option<String>,
    /// Most runs of the page, from 1 to 1000; 100 if not given.
    pub limit: Option<i64>,
    /// The `next` of the page before.
    pub cursor: Option<String>,
}

/// A page of runs of all sweeps.
#[derive(Debug, Serialize, ToSchema)]
pub struct FoundPage {
    /// Runs as in the list of a sweep, with `sweep_id`, `sweep_name` and `owner` of their sweep.
    pub items: Vec<RunRow>,
    /// Cursor of the next page; null at the end. A page that holds fewer runs than asked for is the last one
    /// only if this is null.
    pub next: Option<String>,
    /// How many there are.
    #[serde(flatten)]
    pub total: Total,
}

/// Runs nearest to given parameters.
#[derive(Debug, Serialize, ToSchema)]
pub struct NearestRuns {
    /// The nearest one first: runs as in the list of a sweep, with `sweep_id`, `sweep_name` and `owner` of their
    /// sweep, `distance`, and `differences` by parameter: theirs minus the one asked for.
    pub items: Vec<RunRow>,
}

/// Sweeps that may have runs of a filter.
#[derive(Debug)]
pub struct Prospects {
    facts: Vec<SweepFacts>,
    filter: Option<Filter>,
    held_by: Option<HashSet<i64>>,
}

/// The kind of a column of the runs of all sweeps.
fn kind_of(name: &str) -> Option<ColumnKind> {
    catalogue::kind_of(name).or_else(|| found::kind_of_sweeps_column(name))
}

impl Prospects {
    /// Reads a filter and looks at all sweeps; `parameters` are those that are asked for besides.
    pub async fn new(
        connection: &mut Connection,
        filter: Option<&str>,
        parameters: &[&str],
    ) -> Result<Self, Problem> {
        let filter = filter.map(|text| Filter::parse(text, &kind_of)).transpose()?;
        let held_by = match &filter {
            Some(filter) => catalogue::holding(connection, filter).await?,
            None => None,
        };
        let facts = queue::facts(connection, filter.as_ref(), parameters).await?;
        Ok(Self { facts, filter, held_by })
    }

    /// Leaves only the sweep with this id, which must be there.
    pub fn only(&mut self, id: &str) -> Result<(), Problem> {
        self.facts.retain(|facts| facts.id == id);
        if self.facts.is_empty() { Err(Problem::not_found("sweep", id)) } else { Ok(()) }
    }

    /// The parameters that a sweep varies.
    pub fn axes(&self, sweep_id: &str) -> &[String] {
        self.facts.iter().find(|facts| facts.id == sweep_id).map_or(&[], |facts| &facts.axes)
    }

    /// Those sweeps that the filter does not rule out, each with what is left of it.
    pub fn candidates(&self) -> Vec<Candidate<'_>> {
        let is_held = |facts: &&SweepFacts| {
            self.held_by.as_ref().is_none_or(|held_by| held_by.contains(&facts.number))
        };
        let some = self.facts.iter().filter(|facts| facts.stored() > 0);
        some.filter(is_held).filter_map(|facts| self.candidate(facts)).collect()
    }

    fn candidate<'a>(&self, facts: &'a SweepFacts) -> Option<Candidate<'a>> {
        let filter = match &self.filter {
            None => None,
            Some(filter) => match filter.resolve(&|column| facts.of_runs(column)) {
                Resolved::Always => None,
                Resolved::Never => return None,
                Resolved::Depends(left) => Some(left),
            },
        };
        Some(Candidate { facts, filter })
    }

    /// A run with what its sweep adds.
    fn item(&self, sweep: i64, mut row: RunRow) -> RunRow {
        if let Some(facts) = self.facts.iter().find(|facts| facts.number == sweep) {
            row.0.insert("sweep_id".into(), facts.id.as_str().into());
            row.0.insert("sweep_name".into(), facts.name.as_str().into());
            row.0.insert("owner".into(), facts.owner.clone().into());
        }
        row
    }

    /// Runs with what their sweeps add.
    pub fn items(&self, rows: Vec<(i64, RunRow)>) -> Vec<RunRow> {
        rows.into_iter().map(|(sweep, row)| self.item(sweep, row)).collect()
    }
}

/// Runs of all sweeps, the newest sweep first. A run that several sweeps share is listed once for each. `total` is
/// exact if no more than about 100,000 runs have to be looked at to know it; else it counts those found until
/// then, and `is_exact` is false. A page ends early when a million runs were looked at for it: it may then hold few
/// runs or none, and `next` goes on. Sorted lists do not end early, and take long where many runs are sorted by
/// a column without an index.
#[utoipa::path(
    get, path = "/runs", params(Looking),
    responses(
        (status = 200, body = FoundPage), (status = 400, body = Problem), (status = 422, body = Problem),
    )
)]
pub async fn runs(
    State(service): State<Service>,
    Asked(asked): Asked<Looking>,
) -> Result<Json<FoundPage>, Problem> {
    let order = asked.sort.as_deref().map(order).transpose()?;
    let limit = page_limit(asked.limit)?;
    let after = asked
        .cursor
        .as_deref()
        .map(|text| spot(text, order.as_ref().map(|o| o.column)))
        .transpose()?;
    let mut pair = service.store.read_two().await?;
    let sorted_by: Vec<&str> = order.iter().map(|order| order.column).collect();
    let prospects = Prospects::new(&mut pair.one, asked.filter.as_deref(), &sorted_by).await?;
    let candidates = prospects.candidates();
    let across = Across { candidates: &candidates, order, limit, after };
    // Beside each other: either may have to look at many runs.
    let page = catalogue::runs_across(&mut pair.one, &across);
    let count = catalogue::count_across(&mut pair.other, &candidates);
    let ((rows, end), mut total) = tokio::try_join!(page, count)?;
    if asked.cursor.is_none() && end.is_none() {
        total = Total { total: rows.len() as i64, is_exact: true };
    }
    let next = end.map(|end| match order {
        Some(_) => json!([end.value, end.sweep, end.index]).to_string(),
        None => json!([end.sweep, end.index]).to_string(),
    });
    Ok(Json(FoundPage { items: prospects.items(rows), next, total }))
}

/// Where the page before ended.
fn spot(text: &str, column: Option<&str>) -> Result<Spot, Refusal> {
    let read = if column.is_some() {
        serde_json::from_str::<(Value, i64, Option<i64>)>(text).ok()
    } else {
        let read: Option<(i64, Option<i64>)> = serde_json::from_str(text).ok();
        read.map(|(sweep, index)| (Value::Null, sweep, index))
    };
    let spot = read.filter(|(value, sweep, index)| {
        column.is_none_or(|column| is_of(value, column))
            && *sweep >= 0
            && index.is_none_or(|index| index >= -1)
    });
    spot.map(|(value, sweep, index)| Spot { value, sweep, index })
        .ok_or_else(|| Refusal::value("cursor", text, "the `next` of the page before"))
}

/// What runs are to be near to.
#[derive(Debug, Default)]
pub struct NearTo {
    /// Parameters by name.
    pub parameters: Vec<(String, f64)>,
    /// Which runs.
    pub filter: Option<String>,
    /// How many of them.
    pub limit: Option<i64>,
}

/// Most runs told by their distance.
const MOST_NEAR: i64 = 100;

impl NearTo {
    /// From the members of a query: names of parameters, `filter` and `limit`.
    fn read(members: Vec<(String, String)>) -> Result<Self, Refusal> {
        let mut near = Self::default();
        for (name, text) in members {
            match name.as_str() {
                "filter" if near.filter.is_none() => near.filter = Some(text),
                "limit" if near.limit.is_none() => {
                    let limit = text.parse().map_err(|_| {
                        Refusal::value("limit", text.as_str(), format!("from 1 to {MOST_NEAR}"))
                    })?;
                    near.limit = Some(limit);
                }
                "filter" | "limit" => return Err(Refusal::value(name, text, "once")),
                _ => {
                    let value = text.parse().map_err(|_| {
                        Refusal::value(name.as_str(), text.as_str(), "the number of a parameter")
                    })?;
                    near.parameters.push((name, value));
                }
            }
        }
        Ok(near)
    }
}

/// The nearest runs, the nearest first.
pub async fn near(connection: &mut Connection, to: &NearTo) -> Result<NearestRuns, Problem> {
    const DEFAULT: i64 = 5;
    let limit = to.limit.unwrap_or(DEFAULT);
    if !(1..=MOST_NEAR).contains(&limit) {
        return Err(Refusal::value("limit", limit, format!("from 1 to {MOST_NEAR}")).into());
    }
    let given = to.parameters.iter().map(|(name, value)| (name.as_str(), *value));
    let nearness = Nearness::new(given)?;
    let names: Vec<&str> = nearness.wanted().iter().map(|w| w.parameter.name).collect();
    let prospects = Prospects::new(connection, to.filter.as_deref(), &names).await?;
    let candidates = prospects.candidates();
    let found = catalogue::nearest(connection, &candidates, &nearness, limit as usize).await?;
    let item = |near: catalogue::Near| {
        let difference = |wanted: &Wanted| {
            let name = wanted.parameter.name;
            let value = near.row.0.get(name).and_then(Value::as_f64)?;
            Some((name.to_owned(), json!(value - wanted.value)))
        };
        let differences: Map<String, Value> =
            nearness.wanted().iter().filter_map(difference).collect();
        let mut item = prospects.item(near.sweep, near.row);
        item.0.insert("distance".into(), json!(near.distance));
        item.0.insert("differences".into(), differences.into());
        item
    };
    Ok(NearestRuns { items: found.into_iter().map(item).collect() })
}

/// The stored runs nearest to given parameters, each once, in its newest sweep. The distance is Euclidean over the
/// parameters given: in the logarithm of those that are always positive, else in units of the default (of
/// `width_gradient`: 1, of `water_drag_n_per_m`: 1e6). Of runs equally far away, those of newer sweeps come first.
#[utoipa::path(
    get, path = "/runs/nearest",
    params(
        ("melt_rate_m_per_day" = Option<f64>, Query, description = "A value to be near to; so with any parameter of \
            the dictionary. At least one is given"),
        ("limit" = Option<i64>, Query, description = "How many runs, from 1 to 100; 5 if not given"),
        ("filter" = Option<String>, Query, description = "Which runs, as in the list of runs"),
    ),
    responses(
        (status = 200, body = NearestRuns), (status = 400, body = Problem), (status = 422, body = Problem),
    )
)]
pub async fn nearest(
    State(service): State<Service>,
    Asked(members): Asked<Vec<(String, String)>>,
) -> Result<Json<NearestRuns>, Problem> {
    let to = NearTo::read(members)?;
    Ok(Json(near(&mut *service.store.read().await?, &to).await?))
}
