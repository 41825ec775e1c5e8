//! Runs over REST: lists and single results.

use super::Service;
use super::error::Problem;
use super::extract::{Asked, NothingAsked, Place};
use super::sweeps::page_limit;
use crate::archive::catalogue::{self, Order, RunRow, Total};
use crate::archive::read;
use crate::domain::filter::{ColumnKind, Filter};
use crate::domain::outcome::Outcome;
use crate::domain::refusal::Refusal;
use crate::queue;
use axum::Json;
use axum::extract::State;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use utoipa::{IntoParams, ToSchema};

/// Which runs, in which order.
#[derive(Debug, Default, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct Listing {
    /// Runs of the page, from 1 to 1000; 100 if not given.
    limit: Option<i64>,
    /// The `next` of the page before.
    cursor: Option<String>,
    /// Column to sort by, with `-` before it from high to low; `run_index` if not given.
    sort: Option<String>,
    /// Which runs, such as `0.5 <= melt_rate_m_per_day < 0.7 and status = "converged"`.
    filter: Option<String>,
}

/// A page of runs.
#[derive(Debug, Serialize, ToSchema)]
pub struct RunPage {
    items: Vec<RunRow>,
    /// Cursor of the next page; null at the end.
    next: Option<String>,
    #[serde(flatten)]
    total: Total,
}

/// A sweep's ended runs, scalars only. `total` is exact where an index tells (the status, the force, up to
/// four of the parameters that the sweep varies), also where one of these lets at most 20,000 runs through, and
/// in sweeps of up to 100,000 runs; else it counts what is found among the first 100,000 runs, and `is_exact`
/// is false.
#[utoipa::path(
    get, path = "/sweeps/{id}/runs", params(("id" = String, Path,), Listing),
    responses(
        (status = 200, body = RunPage), (status = 400, body = Problem),
        (status = 404, body = Problem), (status = 422, body = Problem),
    )
)]
pub async fn of_sweep(
    State(service): State<Service>,
    Place(id): Place<String>,
    Asked(asked): Asked<Listing>,
) -> Result<Json<RunPage>, Problem> {
    let sort = asked.sort.as_deref().unwrap_or("run_index");
    let order = order(sort)?;
    let filter = asked.filter.as_deref().map(|text| Filter::parse(text, &catalogue::kind_of));
    let filter = filter.transpose()?;
    let limit = page_limit(asked.limit)?;
    let after = asked.cursor.as_deref().map(|text| cursor(text, order.column)).transpose()?;
    let mut pair = service.store.read_two().await?;
    let sweep = queue::sweep_in_brief(&mut pair.one, &id).await?;
    let sweep = sweep.ok_or_else(|| Problem::not_found("sweep", &id))?;
    let listing = catalogue::Listing {
        sweep: sweep.number,
        axes: sweep.axes(),
        filter: filter.as_ref(),
        order,
        limit,
        after,
    };
    // Beside each other: either may have to look at every entry of an index.
    let page = catalogue::runs(&mut pair.one, &listing);
    let ((items, last), total) =
        tokio::try_join!(page, catalogue::count(&mut pair.other, &listing))?;
    let next = last.map(|(value, index)| json!([value, index]).to_string());
    Ok(Json(RunPage { items, next, total }))
}

/// Column and direction of `sort`.
pub fn order(sort: &str) -> Result<Order<'_>, Refusal> {
    let (column, descending) = match sort.strip_prefix('-') {
        Some(column) => (column, true),
        None => (sort, false),
    };
    if catalogue::is_column(column) {
        return Ok(Order { column, descending });
    }
    Err(Refusal::value("sort", sort, "a column of the runs, with `-` for high to low"))
}

/// The value sorted by and the index of the run before the page.
fn cursor(text: &str, column: &str) -> Result<(Value, i64), Problem> {
    let read: Option<(Value, i64)> = serde_json::from_str(text).ok();
    read.filter(|(value, index)| is_of(value, column) && *index >= 0)
        .ok_or_else(|| Refusal::value("cursor", text, "the `next` of the page before").into())
}

/// Whether a value can be one of a column.
pub fn is_of(value: &Value, column: &str) -> bool {
    match catalogue::kind_of(column) {
        Some(ColumnKind::Number) => value.is_number() || value.is_null(),
        _ => value.is_string() || value.is_null(),
    }
}

/// One run with its profile and, of a transient, its series and states.
#[utoipa::path(
    get, path = "/runs/{id}", params(("id" = String, Path,)),
    responses((status = 200, body = Outcome), (status = 400, body = Problem), (status = 404, body = Problem))
)]
pub async fn one(
    State(service): State<Service>,
    Place(id): Place<String>,
    _: NothingAsked,
) -> Result<Json<Outcome>, Problem> {
    let outcome = read::stored(&service.store, &id).await?;
    let outcome = outcome.ok_or_else(|| Problem::not_found("run", &id))?;
    Ok(Json(outcome))
}
