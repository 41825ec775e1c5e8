//! Bulk tables over REST: a sweep's runs, and what belongs to them, as one file.

use super::Service;
use super::error::Problem;
use super::extract::{NothingAsked, Place};
use crate::archive::bulk::{Format, gather};
use crate::archive::catalogue;
use crate::archive::schema::Kind;
use crate::queue;
use axum::body::Body;
use axum::extract::State;
use axum::http::header;
use axum::response::{IntoResponse, Response};
use tokio_util::io::ReaderStream;

/// Media type of Parquet.
pub const PARQUET_TYPE: &str = "application/vnd.apache.parquet";

macro_rules! table {
    ($(#[doc = $what:literal])* $name:ident: $path:literal, $content_type:literal, $kind:ident, $format:ident) => {
        $(#[doc = $what])*
        #[utoipa::path(
            get, path = $path, params(("id" = String, Path,)),
            responses((status = 200, content_type = $content_type), (status = 400, body = Problem), (status = 404, body = Problem))
        )]
        pub async fn $name(
            State(service): State<Service>,
            Place(id): Place<String>,
            _: NothingAsked,
        ) -> Result<Response, Problem> {
            bulk(&service, &id, Kind::$kind, Format::$format).await
        }
    };
}

table! {
    /// All runs of a sweep that have ended, as Parquet.
    runs_parquet: "/sweeps/{id}/runs.parquet", "application/vnd.apache.parquet", Runs, Parquet
}
table! {
    /// All runs of a sweep that have ended, as CSV.
    runs_csv: "/sweeps/{id}/runs.csv", "text/csv", Runs, Csv
}
table! {
    /// All stored profiles of a sweep, as Parquet.
    profiles_parquet: "/sweeps/{id}/profiles.parquet", "application/vnd.apache.parquet", Profiles, Parquet
}
table! {
    /// All time series of a sweep, as Parquet.
    series_parquet: "/sweeps/{id}/series.parquet", "application/vnd.apache.parquet", Series, Parquet
}
table! {
    /// All branches and curves of folds of a sweep, a row for each point, fold, root, crossing and end, as Parquet.
    branches_parquet: "/sweeps/{id}/branches.parquet", "application/vnd.apache.parquet", Branches, Parquet
}
table! {
    /// The same as CSV.
    branches_csv: "/sweeps/{id}/branches.csv", "text/csv", Branches, Csv
}
table! {
    /// All derivatives of a sweep's steady states, a row for each quantity, as Parquet.
    sensitivities_parquet: "/sweeps/{id}/sensitivities.parquet", "application/vnd.apache.parquet", Sensitivities, Parquet
}
table! {
    /// The same as CSV.
    sensitivities_csv: "/sweeps/{id}/sensitivities.csv", "text/csv", Sensitivities, Csv
}
table! {
    /// All calibrations of a sweep, a row for each estimate, observation, start and sample, as Parquet.
    calibrations_parquet: "/sweeps/{id}/calibrations.parquet", "application/vnd.apache.parquet", Calibrations, Parquet
}
table! {
    /// The same as CSV.
    calibrations_csv: "/sweeps/{id}/calibrations.csv", "text/csv", Calibrations, Csv
}
table! {
    /// All discrete steady states of a sweep's steady runs that ask for them, as Parquet.
    roots_parquet: "/sweeps/{id}/roots.parquet", "application/vnd.apache.parquet", Roots, Parquet
}
table! {
    /// The same as CSV.
    roots_csv: "/sweeps/{id}/roots.csv", "text/csv", Roots, Csv
}

async fn bulk(
    service: &Service,
    id: &str,
    kind: Kind,
    format: Format,
) -> Result<Response, Problem> {
    let in_use = service.store.files_in_use().await;
    let mut tx = service.store.read().await?;
    let sweep = queue::sweep_in_brief(&mut tx, id).await?;
    let sweep = sweep.ok_or_else(|| Problem::not_found("sweep", id))?;
    let layout = catalogue::layout(&mut tx, sweep.number, kind).await?;
    drop(tx);
    let archive = service.store.archive();
    let (file, length) = tokio::task::spawn_blocking(move || {
        let _in_use = in_use;
        gather(&archive, &layout, kind, format)
    })
    .await??;
    let (content_type, ending) = match format {
        Format::Parquet => (PARQUET_TYPE, "parquet"),
        Format::Csv => ("text/csv; charset=utf-8", "csv"),
    };
    /// Bytes read at once: each reading is a turn of another thread.
    const AT_ONCE: usize = 1 << 18;
    let file = tokio::fs::File::from_std(file);
    let body = Body::from_stream(ReaderStream::with_capacity(file, AT_ONCE));
    let disposition = format!("attachment; filename=\"{id}-{}.{ending}\"", kind.name());
    let headers = [
        (header::CONTENT_TYPE, content_type.to_owned()),
        (header::CONTENT_DISPOSITION, disposition),
        (header::CONTENT_LENGTH, length.to_string()),
    ];
    Ok((headers, body).into_response())
}
