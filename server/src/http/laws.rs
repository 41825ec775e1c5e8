//! Laws of a sweep over REST: one fit of all its runs, and fits of groups of them with what they leave unexplained.

use super::Service;
use super::columns::{filter, json, most};
use super::error::Problem;
use super::extract::{Asked, Place};
use crate::analysis::{self, Fit, Law, Laws, NoFit, Table};
use crate::archive::catalogue::{self, Column, Extract, Sheet};
use crate::domain::filter::Filter;
use crate::domain::parameters::PARAMETERS;
use crate::domain::refusal::Refusal;
use crate::queue;
use axum::Json;
use axum::extract::State;
use axum::response::Response;
use serde::{Deserialize, Serialize};
use utoipa::{IntoParams, ToSchema};

/// What is fitted.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct FitQuery {
    /// Parameter or scalar on the abscissa.
    x: String,
    /// Parameter or scalar on the ordinate.
    y: String,
    /// The law; a power law if not given.
    #[serde(default)]
    model: Law,
    /// Which runs, at most two million; all that have ended if not given.
    filter: Option<String>,
}

/// Fit a law to a sweep's runs.
#[utoipa::path(
    get, path = "/sweeps/{id}/fit", params(("id" = String, Path,), FitQuery),
    responses(
        (status = 200, body = Fit), (status = 400, body = Problem), (status = 404, body = Problem),
        (status = 409, body = Problem), (status = 422, body = Problem),
    )
)]
pub async fn fit(
    State(service): State<Service>,
    Place(id): Place<String>,
    Asked(query): Asked<FitQuery>,
) -> Result<Json<Fit>, Problem> {
    let names = Names { x: &query.x, y: &query.y, group_by: None };
    names.check()?;
    let filter = filter(query.filter.as_deref())?;
    let turn = service.store.long_read().await?;
    let numbers = numbers(&service, &id, names, filter.as_ref(), None).await?;
    let fitted = tokio::task::spawn_blocking(move || {
        let _turn = turn;
        let (x, y) = (&numbers.columns[numbers.x], &numbers.columns[numbers.y]);
        let runs = numbers.status.iter().zip(x).zip(y);
        let runs: Vec<_> = runs.map(|((status, x), y)| (*status, *x, *y)).collect();
        analysis::fit(query.model, &runs)
    });
    fitted.await?.map(Json).map_err(|e: NoFit| Problem::conflict(e.to_string()))
}

/// What is fitted, group by group.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct LawsQuery {
    /// Parameter or scalar on the abscissa.
    x: String,
    /// Parameter or scalar on the ordinate.
    y: String,
    /// The law; a power law if not given.
    #[serde(default)]
    model: Law,
    /// Parameter or scalar by which the runs are put into groups; all together if not given.
    group_by: Option<String>,
    /// Which runs, at most two million; all that have ended if not given.
    filter: Option<String>,
    /// At most so many points in all groups together, from 1 to 200000; 20000 if not given. All runs count for the
    /// fits.
    most: Option<i64>,
}

/// Laws of a sweep.
#[derive(Debug, Serialize, ToSchema)]
pub struct SweepLaws {
    /// Abscissa.
    x: String,
    /// Ordinate.
    y: String,
    /// The law.
    model: Law,
    /// By what the runs are put into groups.
    group_by: Option<String>,
    #[serde(flatten)]
    laws: Laws,
}

/// Fit a law to each group of a sweep's runs, with the runs, what the law leaves unexplained of each, and its slope
/// from place to place. Each run is in one group and there either used or left out. If the runs used are more than
/// `most`, the points are those of least id: a choice by chance that is always the same.
#[utoipa::path(
    get, path = "/sweeps/{id}/laws", params(("id" = String, Path,), LawsQuery),
    responses(
        (status = 200, body = SweepLaws), (status = 400, body = Problem), (status = 404, body = Problem),
        (status = 422, body = Problem),
    )
)]
pub async fn laws(
    State(service): State<Service>,
    Place(id): Place<String>,
    Asked(query): Asked<LawsQuery>,
) -> Result<Response, Problem> {
    let LawsQuery { x, y, model, group_by, filter: text, most: asked } = query;
    let names = Names { x: &x, y: &y, group_by: group_by.as_deref() };
    names.check()?;
    let (filter, most) = (filter(text.as_deref())?, most(asked)?);
    let turn = service.store.long_read().await?;
    let numbers = numbers(&service, &id, names, filter.as_ref(), Some(most)).await?;
    let answer = tokio::task::spawn_blocking(move || {
        let _turn = turn;
        let laws = numbers.laws(model, most);
        json(&SweepLaws { x, y, model, group_by, laws })
    });
    answer.await?
}

/// Most runs that a law is made of. A run takes about 0.3 kB (measured, with four columns and ids), so that this is
/// 0.6 GB for each of the requests that read at the same time.
const MOST_RUNS: i64 = 2_000_000;
/// Whether an equation counts upstream is a choice by name, and no number.
const CLOSURE: &str = "upstream_closure";

/// Refuses more runs than a law is made of.
fn check_rows(rows: i64) -> Result<(), Refusal> {
    if rows <= MOST_RUNS {
        return Ok(());
    }
    let permitted = format!("one that lets at most {MOST_RUNS} runs through");
    let sentence = format!(
        "these are {rows} runs, and a law is made of at most {MOST_RUNS}: give a narrower `filter`"
    );
    let field = Some("filter".to_owned());
    Err(Refusal { field, permitted: Some(permitted), ..Refusal::sentence(sentence) })
}

/// Columns that are asked about.
#[derive(Debug, Clone, Copy)]
struct Names<'a> {
    x: &'a str,
    y: &'a str,
    group_by: Option<&'a str>,
}

impl<'a> Names<'a> {
    fn check(self) -> Result<(), Refusal> {
        let asked = [("x", Some(self.x)), ("y", Some(self.y)), ("group_by", self.group_by)];
        for (field, name) in asked {
            if let Some(name) = name.filter(|name| !catalogue::is_number(name)) {
                let permitted = "a parameter or a number of the result";
                return Err(Refusal::value(field, name, permitted));
            }
        }
        Ok(())
    }
}

/// What laws are made of.
#[derive(Debug)]
struct Numbers {
    run_index: Vec<i64>,
    status: Vec<&'static str>,
    /// Each column once; the others say which is which.
    columns: Vec<Vec<Option<f64>>>,
    x: usize,
    y: usize,
    group_by: Option<usize>,
    others: Vec<(&'static str, usize)>,
    ids: Option<Vec<String>>,
}

impl Numbers {
    fn laws(&self, model: Law, most: i64) -> Laws {
        let column = |at: usize| self.columns[at].as_slice();
        let others: Vec<_> = self.others.iter().map(|(name, at)| (*name, column(*at))).collect();
        let table = Table {
            run_index: &self.run_index,
            status: &self.status,
            x: column(self.x),
            y: column(self.y),
            group_by: self.group_by.map(column),
            others: &others,
            ids: self.ids.as_deref(),
        };
        analysis::laws(model, &table, most as usize)
    }
}

/// The numbers of a sweep's runs; with the other parameters that vary, and with ids if there may be more runs than
/// are told one by one, if that matters.
async fn numbers(
    service: &Service,
    id: &str,
    names: Names<'_>,
    filter: Option<&Filter>,
    most: Option<i64>,
) -> Result<Numbers, Problem> {
    let mut tx = service.store.read().await?;
    let row = queue::sweep_in_brief(&mut tx, id).await?;
    let row = row.ok_or_else(|| Problem::not_found("sweep", id))?;
    let mut columns: Vec<&str> = Vec::new();
    let mut place = |name| {
        columns.iter().position(|known| *known == name).unwrap_or_else(|| {
            columns.push(name);
            columns.len() - 1
        })
    };
    let (x, y) = (place(names.x), place(names.y));
    let group_by = names.group_by.map(&mut place);
    let axes = row.axes();
    let mut others: Vec<&'static str> = PARAMETERS.iter().map(|p| p.name).collect();
    others.retain(|p| axes.contains(p) && ![names.x, names.y].contains(p));
    // No axis of the catalogue; what a cut document says of it is not known.
    if row.is_cut || row.document.contains(CLOSURE) {
        others.push(CLOSURE);
    }
    others.retain(|_| most.is_some());
    others.sort_unstable();
    let others = others.into_iter().map(|name| (name, place(name))).collect();
    let stored = catalogue::count_stored(&mut tx, row.number).await?;
    let has_ids = most.is_some_and(|most| most < stored);
    if has_ids {
        columns.push("run_id");
    }
    let extract = Extract { sweep: row.number, axes, filter, names: columns, most: None };
    if stored > MOST_RUNS {
        let rows = catalogue::sheet_rows(&mut tx, &extract).await?;
        check_rows(rows)?;
    }
    let Sheet { run_index, status, mut columns, .. } = catalogue::sheet(&mut tx, &extract).await?;
    let ids = match columns.pop_if(|_| has_ids) {
        Some(Column::Texts(ids)) => Some(ids.into_iter().map(Option::unwrap_or_default).collect()),
        _ => None,
    };
    let columns = columns.into_iter().map(Column::into_numbers).collect();
    Ok(Numbers { run_index, status, columns, x, y, group_by, others, ids })
}

#[cfg(test)]
mod tests;
