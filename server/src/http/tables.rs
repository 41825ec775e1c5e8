//! Bulk tables over REST: a sweep's runs, and what belongs to them, as one file.

use super::Service;
use super::download::{self, Conditions, Offer};
use super::error::Problem;
use super::extract::{NothingAsked, Place};
use crate::archive::bulk::{self, Format};
use crate::archive::catalogue;
use crate::archive::gathered::Gathered;
use crate::archive::netcdf::{self, About};
use crate::archive::schema::Kind;
use crate::queue::{self, SweepRow};
use crate::store::Connection;
use axum::extract::State;
use axum::http::{HeaderMap, Method};
use axum::response::Response;
use tokio::sync::Semaphore;

/// Media type of Parquet.
pub const PARQUET_TYPE: &str = "application/vnd.apache.parquet";
/// Media type of NetCDF.
pub const NETCDF_TYPE: &str = "application/netcdf";

macro_rules! table {
    ($(#[doc = $what:literal])* $name:ident: $path:literal, $content_type:literal, $kind:ident, $format:ident) => {
        $(#[doc = $what])*
        #[utoipa::path(
            get, path = $path, params(("id" = String, Path,), Conditions),
            responses(
                (status = 200, description = "The file, with `ETag` and `Accept-Ranges`", content_type = $content_type),
                (status = 206, description = "The range asked for", content_type = $content_type),
                (status = 304, description = "The client has it"),
                (status = 400, body = Problem), (status = 404, body = Problem),
                (status = 409, body = Problem, description = "The table keeps changing while it is read"),
                (status = 412, body = Problem, description = "It is another file than that of `If-Match`"),
                (status = 416, body = Problem, description = "The range has none of its bytes"),
            )
        )]
        pub async fn $name(
            State(service): State<Service>,
            Place(id): Place<String>,
            method: Method,
            headers: HeaderMap,
            _: NothingAsked,
        ) -> Result<Response, Problem> {
            download(&service, &id, What::Table(Kind::$kind, Format::$format), &method, &headers).await
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

/// The runs of a sweep with their profiles and series as one NetCDF-4 dataset with CF metadata, for xarray and others: run,
/// x, χ and time are coordinates. At most 16,777,216 numbers; Parquet has no such bound.
#[utoipa::path(
    get, path = "/sweeps/{id}/ensemble.nc", params(("id" = String, Path,), Conditions),
    responses(
        (status = 200, description = "The file, with `ETag` and `Accept-Ranges`", content_type = "application/netcdf"),
        (status = 206, description = "The range asked for", content_type = "application/netcdf"),
        (status = 304, description = "The client has it"),
        (status = 400, body = Problem), (status = 404, body = Problem),
        (status = 409, body = Problem, description = "No run has ended yet, or the tables keep changing while they are read"),
        (status = 412, body = Problem, description = "It is another file than that of `If-Match`"),
        (status = 416, body = Problem, description = "The range has none of its bytes"),
        (status = 422, body = Problem, description = "The sweep is too large for one such file"),
    )
)]
pub async fn ensemble(
    State(service): State<Service>,
    Place(id): Place<String>,
    method: Method,
    headers: HeaderMap,
    _: NothingAsked,
) -> Result<Response, Problem> {
    download(&service, &id, What::Ensemble, &method, &headers).await
}

/// What is downloaded of a sweep.
#[derive(Debug, Clone, Copy)]
enum What {
    Table(Kind, Format),
    Ensemble,
}

impl What {
    fn kinds(self) -> Vec<Kind> {
        match self {
            Self::Table(kind, _) => vec![kind],
            Self::Ensemble => netcdf::KINDS.to_vec(),
        }
    }

    fn name(self) -> String {
        match self {
            Self::Table(kind, Format::Parquet) => format!("{}.parquet", kind.name()),
            Self::Table(kind, Format::Csv) => format!("{}.csv", kind.name()),
            Self::Ensemble => "ensemble.nc".to_owned(),
        }
    }

    fn content_type(self) -> &'static str {
        match self {
            Self::Table(_, Format::Parquet) => PARQUET_TYPE,
            Self::Table(_, Format::Csv) => "text/csv; charset=utf-8",
            Self::Ensemble => NETCDF_TYPE,
        }
    }
}

/// Why a file was not made.
enum Unmade {
    /// The sweep's tables are others by now.
    Moved,
    /// It cannot be.
    Told(Problem),
}

impl From<Problem> for Unmade {
    fn from(problem: Problem) -> Self {
        Self::Told(problem)
    }
}

async fn download(
    service: &Service,
    id: &str,
    what: What,
    method: &Method,
    headers: &HeaderMap,
) -> Result<Response, Problem> {
    /// Looks at a sweep whose tables change before a file is made of them.
    const LOOKS: usize = 20;
    for _ in 0..LOOKS {
        // Whoever waits for a file that another request makes holds no connection.
        let mut tx = service.store.read().await?;
        let (_, mark) = look(&mut tx, id, what).await?;
        drop(tx);
        let offer = Offer {
            mark,
            content_type: what.content_type(),
            name: format!("{id}-{}", what.name()),
        };
        let made = async {
            let made = make(service, id, what, &offer.mark).await.map_err(Unmade::Told)?;
            made.ok_or(Unmade::Moved)
        };
        let file = service.shelf.get(&offer.mark, made);
        match download::answer(method, headers, &offer, file).await {
            Ok(response) => return Ok(response),
            Err(Unmade::Told(problem)) => return Err(problem),
            Err(Unmade::Moved) => {}
        }
    }
    Err(Problem::conflict("the sweep's tables keep changing: ask again when it is complete"))
}

/// The sweep, and what stands for the bytes of its file.
async fn look(tx: &mut Connection, id: &str, what: What) -> Result<(SweepRow, String), Problem> {
    let sweep = queue::sweep_in_brief(tx, id).await?;
    let sweep = sweep.ok_or_else(|| Problem::not_found("sweep", id))?;
    let mut marks = Vec::new();
    for kind in what.kinds() {
        marks.push(catalogue::mark(tx, sweep.number, kind).await?);
    }
    if let What::Ensemble = what {
        // The dataset tells them.
        for text in [&sweep.name, &sweep.created_at] {
            marks.push(blake3::hash(text.as_bytes()));
        }
    }
    Ok((sweep, bulk::mark(id, &what.name(), &marks)))
}

/// Makes the file of a mark; none if the sweep has another one by now.
async fn make(
    service: &Service,
    id: &str,
    what: What,
    mark: &str,
) -> Result<Option<Gathered>, Problem> {
    /// Made one at a time: the writer has the whole dataset in memory.
    static ENSEMBLES: Semaphore = Semaphore::const_new(1);
    let _one = match what {
        What::Ensemble => ENSEMBLES.acquire().await.ok(),
        What::Table(..) => None,
    };
    let in_use = service.store.files_in_use().await;
    let mut tx = service.store.read().await?;
    let (sweep, now) = look(&mut tx, id, what).await?;
    if now != mark {
        return Ok(None);
    }
    let mut layouts = Vec::new();
    for kind in what.kinds() {
        layouts.push((kind, catalogue::layout(&mut tx, sweep.number, kind).await?));
    }
    drop(tx);
    let archive = service.store.archive();
    let about = About { sweep_id: sweep.id, name: sweep.name, submitted_at: sweep.created_at };
    let made = tokio::task::spawn_blocking(move || {
        let _in_use = in_use;
        match (what, layouts.as_slice()) {
            (What::Table(kind, format), [(_, layout)]) => {
                bulk::gather(&archive, layout, kind, format)
            }
            _ => netcdf::gather(&archive, &layouts, &about),
        }
    });
    Ok(Some(Gathered::new(made.await??)))
}
