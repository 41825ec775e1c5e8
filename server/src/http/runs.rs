//! Runs over REST: lists, single results, bulk tables.

use super::Service;
use super::error::Problem;
use super::extract::{Asked, NothingAsked, Place};
use super::sweeps::{Page, Paging};
use crate::archive::bulk::{Format, gather};
use crate::archive::catalogue::{self, Order, RunRow};
use crate::archive::read;
use crate::archive::schema::Kind;
use crate::domain::outcome::Outcome;
use crate::domain::refusal::Refusal;
use crate::queue;
use axum::Json;
use axum::body::Body;
use axum::extract::State;
use axum::http::header;
use axum::response::{IntoResponse, Response};
use serde::Deserialize;
use tokio_util::io::ReaderStream;
use utoipa::IntoParams;

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
    /// Not there yet.
    filter: Option<String>,
}

/// A sweep's ended runs, scalars only.
#[utoipa::path(
    get, path = "/sweeps/{id}/runs", params(("id" = String, Path,), Listing),
    responses(
        (status = 200, body = Page<RunRow>), (status = 400, body = Problem),
        (status = 404, body = Problem), (status = 422, body = Problem), (status = 501, body = Problem),
    )
)]
pub async fn of_sweep(
    State(service): State<Service>,
    Place(id): Place<String>,
    Asked(listing): Asked<Listing>,
) -> Result<Json<Page<RunRow>>, Problem> {
    if listing.filter.is_some() {
        return Err(Problem::not_yet("filter"));
    }
    let sort = listing.sort.as_deref().unwrap_or("run_index");
    let (column, descending) = match sort.strip_prefix('-') {
        Some(column) => (column, true),
        None => (sort, false),
    };
    if !catalogue::is_column(column) {
        return Err(
            Refusal::value("sort", sort, "a column of the runs, with `-` for high to low").into()
        );
    }
    let (limit, from) = Paging::window(listing.limit, listing.cursor.as_deref())?;
    let mut tx = service.store.read().await?;
    if queue::sweep(&mut tx, &id).await?.is_none() {
        return Err(Problem::not_found("sweep", &id));
    }
    let order = Order { column, descending };
    let (rows, total) = catalogue::runs(&mut tx, &id, order, limit, from).await?;
    let is_full = rows.len() as i64 == limit;
    let next = match rows.last() {
        Some(last) if order.is_by_index() && is_full => Some(last.run_index() + 1),
        Some(_) if !order.is_by_index() && from + limit < total => Some(from + limit),
        _ => None,
    };
    Ok(Json(Page::new(rows, next, total)))
}

/// One run with its profile and, of a transient, its series and states.
#[utoipa::path(
    get, path = "/runs/{id}", params(("id" = String, Path,)),
    responses((status = 200, body = Outcome), (status = 404, body = Problem))
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

/// All runs of a sweep that have ended, as Parquet.
#[utoipa::path(
    get, path = "/sweeps/{id}/runs.parquet", params(("id" = String, Path,)),
    responses((status = 200, content_type = "application/vnd.apache.parquet"), (status = 404, body = Problem))
)]
pub async fn runs_parquet(
    State(service): State<Service>,
    Place(id): Place<String>,
    _: NothingAsked,
) -> Result<Response, Problem> {
    bulk(&service, &id, Kind::Runs, Format::Parquet).await
}

/// All runs of a sweep that have ended, as CSV.
#[utoipa::path(
    get, path = "/sweeps/{id}/runs.csv", params(("id" = String, Path,)),
    responses((status = 200, content_type = "text/csv"), (status = 404, body = Problem))
)]
pub async fn runs_csv(
    State(service): State<Service>,
    Place(id): Place<String>,
    _: NothingAsked,
) -> Result<Response, Problem> {
    bulk(&service, &id, Kind::Runs, Format::Csv).await
}

/// All stored profiles of a sweep, as Parquet.
#[utoipa::path(
    get, path = "/sweeps/{id}/profiles.parquet", params(("id" = String, Path,)),
    responses((status = 200, content_type = "application/vnd.apache.parquet"), (status = 404, body = Problem))
)]
pub async fn profiles_parquet(
    State(service): State<Service>,
    Place(id): Place<String>,
    _: NothingAsked,
) -> Result<Response, Problem> {
    bulk(&service, &id, Kind::Profiles, Format::Parquet).await
}

/// All time series of a sweep, as Parquet.
#[utoipa::path(
    get, path = "/sweeps/{id}/series.parquet", params(("id" = String, Path,)),
    responses((status = 200, content_type = "application/vnd.apache.parquet"), (status = 404, body = Problem))
)]
pub async fn series_parquet(
    State(service): State<Service>,
    Place(id): Place<String>,
    _: NothingAsked,
) -> Result<Response, Problem> {
    bulk(&service, &id, Kind::Series, Format::Parquet).await
}

async fn bulk(
    service: &Service,
    id: &str,
    kind: Kind,
    format: Format,
) -> Result<Response, Problem> {
    let mut tx = service.store.read().await?;
    if queue::sweep(&mut tx, id).await?.is_none() {
        return Err(Problem::not_found("sweep", id));
    }
    let paths = catalogue::files_of_sweep(&mut tx, id, kind).await?;
    drop(tx);
    let archive = service.store.archive();
    let (file, length) =
        tokio::task::spawn_blocking(move || gather(&archive, &paths, kind, format)).await??;
    let (content_type, ending) = match format {
        Format::Parquet => ("application/vnd.apache.parquet", "parquet"),
        Format::Csv => ("text/csv; charset=utf-8", "csv"),
    };
    let body = Body::from_stream(ReaderStream::new(tokio::fs::File::from_std(file)));
    let disposition = format!("attachment; filename=\"{id}-{}.{ending}\"", kind.name());
    let headers = [
        (header::CONTENT_TYPE, content_type.to_owned()),
        (header::CONTENT_DISPOSITION, disposition),
        (header::CONTENT_LENGTH, length.to_string()),
    ];
    Ok((headers, body).into_response())
}
