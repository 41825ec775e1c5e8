//! The REST interface and the dashboard's files. Knows the queue and the archive, not the solver and
//! not the workers.

pub mod access;
pub mod columns;
pub mod dashboard;
pub mod dictionary;
pub mod download;
pub mod edit;
pub mod ensembles;
pub mod error;
pub mod events;
pub mod extract;
pub mod failures;
pub mod find;
pub mod foreign;
pub mod indices;
pub mod laws;
pub mod metrics;
pub mod openapi;
pub mod patience;
pub mod people;
pub mod request;
pub mod runs;
pub mod season;
pub mod states;
pub mod submit;
pub mod sweeps;
pub mod tables;
pub mod travel;
pub mod verbs;

use crate::archive::gathered::Shelf;
use crate::domain::status::Verb;
use crate::domain::sweep::Limits;
use crate::store::Store;
use axum::Router;
use axum::extract::DefaultBodyLimit;
use axum::middleware::{from_fn_with_state, map_response};
use axum::routing::get;
use error::Problem;
use extract::NothingAsked;
use patience::Patience;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use tokio::sync::{Notify, watch};
use tokio_util::sync::CancellationToken;
use tower_http::CompressionLevel;
use tower_http::catch_panic::CatchPanicLayer;
use tower_http::compression::CompressionLayer;
use tower_http::compression::predicate::{DefaultPredicate, NotForContentType, Predicate};
use utoipa::OpenApi;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;
use utoipa_swagger_ui::SwaggerUi;

/// What the handlers share.
#[derive(Debug, Clone)]
pub struct Service {
    /// The data directory.
    pub store: Store,
    /// Wakes the workers when a sweep comes in.
    pub wake: Arc<Notify>,
    /// Number of worker threads, for cutting sweeps into chunks.
    pub workers: usize,
    /// Limits of a sweep, set by the operator.
    pub limits: Limits,
    /// Largest body of a submission, bytes, set by the operator.
    pub most_bytes: usize,
    /// Files made for downloads lately.
    pub shelf: Shelf,
    /// Largest archive taken by an import, bytes, set by the operator.
    pub most_archive_bytes: u64,
    /// Cancelled when the process is to end: streams of events end then.
    pub stop: CancellationToken,
    /// Whether there are people, once that was seen.
    pub peopled: Arc<AtomicBool>,
    /// Hash of the token of commands on this machine.
    pub operator: Option<Arc<str>>,
    /// Counts changes of who may what: streams end then, and who comes back is looked at anew.
    pub people_changed: Arc<watch::Sender<u64>>,
    /// With those who show tokens that nobody has.
    pub patience: Arc<Patience>,
    /// Names of this host, beside localhost, that a service without people answers to.
    pub hosts: Arc<[String]>,
    /// Whether browsers reach the service by https, through a proxy: their cookies are for that alone then.
    pub is_https: bool,
}

impl Service {
    /// With nobody known yet, and nothing permitted that need not be.
    pub fn new(store: Store, workers: usize) -> Self {
        Self {
            store,
            wake: Arc::default(),
            workers,
            limits: Limits::MOST,
            most_bytes: MOST_BYTES,
            most_archive_bytes: MOST_ARCHIVE_BYTES,
            stop: CancellationToken::new(),
            peopled: Arc::default(),
            operator: None,
            people_changed: Arc::new(watch::Sender::new(0)),
            patience: Arc::default(),
            hosts: Arc::default(),
            is_https: false,
            shelf: Shelf::default(),
        }
    }
}

/// Largest body of a submission if the operator says nothing: a table of a million rows fits.
pub const MOST_BYTES: usize = 64 << 20;
/// Largest archive of an import if the operator says nothing.
pub const MOST_ARCHIVE_BYTES: u64 = 16 << 30;
/// How much of a body that is too large is read, in units of the largest one permitted: so the refusal
/// reaches a client that is still sending. Beyond, the connection is closed.
const READ_ON: usize = 2;

#[derive(OpenApi)]
#[openapi(
    info(
        title = "melange",
        description = "Parameter sweeps and ensembles of the quasi-one-dimensional ice mélange model of \
                       Amundson et al. (2025). Errors are application/problem+json."
    ),
    components(schemas(Verb))
)]
struct Api;

/// All routes.
pub fn router(service: Service) -> Router {
    let (router, api) = documented().split_for_parts();
    let api = openapi::complete(api, access::is_guarded);
    let most_read = service.most_bytes.saturating_mul(READ_ON);
    // Parquet, NetCDF and archives are compressed already.
    let compressed = DefaultPredicate::new()
        .and(NotForContentType::const_new(tables::PARQUET_TYPE))
        .and(NotForContentType::const_new(tables::NETCDF_TYPE))
        .and(NotForContentType::const_new(travel::ARCHIVE_TYPE));
    router
        .route("/api/v1/openapi.json", get(description))
        .fallback(dashboard::file)
        .method_not_allowed_fallback(async || Problem::method_not_allowed())
        .layer(from_fn_with_state(service.clone(), access::know))
        .with_state(service)
        .merge(SwaggerUi::new("/api/v1/docs").url("/api/v1/docs/openapi.json", api))
        .layer(DefaultBodyLimit::max(most_read))
        // Fast: columns of a hundred thousand runs are packed while somebody waits for their picture.
        .layer(CompressionLayer::new().quality(CompressionLevel::Fastest).compress_when(compressed))
        .layer(map_response(download::weaken))
        .layer(map_response(dashboard::fence))
        .layer(CatchPanicLayer::custom(|_: Box<dyn std::any::Any + Send>| Problem::broken()))
        .layer(axum::middleware::from_fn(request::around))
}

fn documented() -> OpenApiRouter<Service> {
    let root = OpenApiRouter::with_openapi(Api::openapi()).routes(routes!(metrics::metrics));
    root.routes(routes!(health)).nest(
        "/api/v1",
        OpenApiRouter::new()
            .routes(routes!(dictionary::dictionary))
            .routes(routes!(people::me))
            .routes(routes!(people::login, people::logout))
            .routes(routes!(people::list, people::add))
            .routes(routes!(people::change, people::revoke))
            .routes(routes!(people::renew))
            .routes(routes!(people::audit))
            .routes(routes!(submit::submit, sweeps::list))
            .routes(routes!(sweeps::one, verbs::delete, edit::change))
            .routes(routes!(indices::of_sweep))
            .routes(routes!(laws::fit))
            .routes(routes!(laws::laws))
            .routes(routes!(columns::columns))
            .routes(routes!(failures::failures))
            .routes(routes!(verbs::verb))
            .routes(routes!(ensembles::seal))
            .routes(routes!(ensembles::citation))
            .routes(routes!(ensembles::ro_crate))
            .routes(routes!(ensembles::manifest))
            .routes(routes!(ensembles::resolve))
            .routes(routes!(travel::export))
            .routes(routes!(travel::import))
            .routes(routes!(foreign::bring, foreign::list))
            .routes(routes!(foreign::one, foreign::delete))
            .routes(routes!(foreign::rows))
            .routes(routes!(foreign::compare))
            .routes(routes!(events::events))
            .routes(routes!(runs::of_sweep))
            .routes(routes!(find::runs))
            .routes(routes!(find::nearest))
            .routes(routes!(tables::runs_parquet))
            .routes(routes!(tables::runs_csv))
            .routes(routes!(tables::profiles_parquet))
            .routes(routes!(tables::series_parquet))
            .routes(routes!(tables::branches_parquet))
            .routes(routes!(tables::branches_csv))
            .routes(routes!(tables::sensitivities_parquet))
            .routes(routes!(tables::sensitivities_csv))
            .routes(routes!(tables::calibrations_parquet))
            .routes(routes!(tables::calibrations_csv))
            .routes(routes!(tables::roots_parquet))
            .routes(routes!(tables::roots_csv))
            .routes(routes!(tables::ensemble))
            .routes(routes!(runs::one))
            .routes(routes!(states::transects))
            .routes(routes!(states::profiles))
            .routes(routes!(season::season)),
    )
}

async fn description(_: NothingAsked) -> axum::Json<utoipa::openapi::OpenApi> {
    axum::Json(openapi::complete(documented().into_openapi(), access::is_guarded))
}

/// Whether the service is up and its database answers.
#[utoipa::path(get, path = "/health", responses((status = 200, description = "Up", body = Object)))]
async fn health(
    axum::extract::State(service): axum::extract::State<Service>,
    _: NothingAsked,
) -> Result<axum::Json<serde_json::Value>, Problem> {
    let mut tx = service.store.read().await?;
    let sweeps = crate::queue::health(&mut tx).await?;
    Ok(axum::Json(serde_json::json!({
        "status": "ok",
        "version": env!("CARGO_PKG_VERSION"),
        "sweeps": sweeps,
    })))
}
