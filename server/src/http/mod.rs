//! The REST interface and the dashboard's files. Knows the queue and the archive, not the solver and
//! not the workers.

pub mod dashboard;
pub mod error;
pub mod events;
pub mod extract;
pub mod runs;
pub mod submit;
pub mod sweeps;
pub mod tables;
pub mod verbs;

use crate::domain::dictionary::Dictionary;
use crate::domain::status::Verb;
use crate::domain::sweep::Limits;
use crate::store::Store;
use axum::Router;
use axum::extract::DefaultBodyLimit;
use axum::routing::get;
use error::Problem;
use extract::NothingAsked;
use std::sync::Arc;
use tokio::sync::Notify;
use tokio_util::sync::CancellationToken;
use tower_http::catch_panic::CatchPanicLayer;
use tower_http::compression::CompressionLayer;
use tower_http::compression::predicate::{DefaultPredicate, NotForContentType, Predicate};
use tower_http::trace::TraceLayer;
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
    /// Cancelled when the process is to end: streams of events end then.
    pub stop: CancellationToken,
}

/// Largest body of a submission if the operator says nothing: a table of a million rows fits.
pub const MOST_BYTES: usize = 64 << 20;
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
    let most_read = service.most_bytes.saturating_mul(READ_ON);
    // Parquet is compressed already.
    let compressed =
        DefaultPredicate::new().and(NotForContentType::const_new(tables::PARQUET_TYPE));
    router
        .route("/api/v1/openapi.json", get(openapi))
        .fallback(dashboard::file)
        .method_not_allowed_fallback(async || Problem::method_not_allowed())
        .with_state(service)
        .merge(SwaggerUi::new("/api/v1/docs").url("/api/v1/docs/openapi.json", api))
        .layer(DefaultBodyLimit::max(most_read))
        .layer(CompressionLayer::new().compress_when(compressed))
        .layer(CatchPanicLayer::custom(|_: Box<dyn std::any::Any + Send>| Problem::broken()))
        // Failures are logged with their cause where they happen.
        .layer(TraceLayer::new_for_http().on_failure(()))
}

fn documented() -> OpenApiRouter<Service> {
    OpenApiRouter::with_openapi(Api::openapi()).routes(routes!(health)).nest(
        "/api/v1",
        OpenApiRouter::new()
            .routes(routes!(dictionary))
            .routes(routes!(submit::submit, sweeps::list))
            .routes(routes!(sweeps::one, verbs::delete))
            .routes(routes!(sweeps::fit))
            .routes(routes!(verbs::verb))
            .routes(routes!(events::events))
            .routes(routes!(runs::of_sweep))
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
            .routes(routes!(runs::one)),
    )
}

async fn openapi(_: NothingAsked) -> axum::Json<utoipa::openapi::OpenApi> {
    axum::Json(documented().into_openapi())
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

/// Names, units, meanings and ranges of parameters and results.
#[utoipa::path(get, path = "/dictionary", responses((status = 200, body = Dictionary)))]
async fn dictionary(_: NothingAsked) -> axum::Json<Dictionary> {
    axum::Json(Dictionary::new())
}
