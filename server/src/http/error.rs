//! One error for the whole interface: a problem document (RFC 9457). Bad input is 400 when it cannot
//! be read and 422 when it says what is not permitted; causes of inner errors are logged, not leaked.

use crate::archive::ArchiveError;
use crate::domain::refusal::Refusal;
use crate::queue::{EnqueueError, VerbError};
use axum::extract::multipart::{MultipartError, MultipartRejection};
use axum::extract::rejection::BytesRejection;
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Serialize;
use std::io;
use utoipa::ToSchema;

/// A problem document.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Problem {
    /// `about:blank`: the status says what kind of problem it is.
    #[serde(rename = "type")]
    kind: &'static str,
    /// The status' phrase.
    title: &'static str,
    /// The status.
    status: u16,
    #[serde(flatten)]
    refusal: Box<Refusal>,
}

impl Problem {
    fn new(status: StatusCode, refusal: Refusal) -> Self {
        let title = status.canonical_reason().unwrap_or("error");
        Self { kind: "about:blank", title, status: status.as_u16(), refusal: Box::new(refusal) }
    }

    /// A document is larger than is taken.
    pub fn too_large(bytes: usize, most: usize) -> Self {
        let sentence = format!("the document has {bytes} bytes, and at most {most} are taken");
        Self::new(StatusCode::PAYLOAD_TOO_LARGE, Refusal::sentence(sentence))
    }

    /// The resource does not know this method.
    pub fn method_not_allowed() -> Self {
        let sentence = "this method is not known here; /api/v1/docs lists those that are";
        Self::new(StatusCode::METHOD_NOT_ALLOWED, Refusal::sentence(sentence))
    }

    /// Something with this id does not exist.
    pub fn not_found(what: &str, id: &str) -> Self {
        Self::new(StatusCode::NOT_FOUND, Refusal::sentence(format!("there is no {what} `{id}`")))
    }

    /// The request asks for what the present state does not allow.
    pub fn conflict(sentence: impl Into<String>) -> Self {
        Self::new(StatusCode::CONFLICT, Refusal::sentence(sentence))
    }

    /// A handler broke off.
    pub fn broken() -> Response {
        Self::new(
            StatusCode::INTERNAL_SERVER_ERROR,
            Refusal::sentence("the service broke off while answering: a defect to report"),
        )
        .into_response()
    }

    /// The disk does not do what it should; nothing was lost, and nothing was taken.
    fn storage(what: &str) -> Self {
        let sentence = format!("{what}: nothing was changed; try again when that is mended");
        Self::new(StatusCode::INSUFFICIENT_STORAGE, Refusal::sentence(sentence))
    }

    /// One sentence on what is wrong.
    pub fn sentence(&self) -> &str {
        &self.refusal.detail
    }

    fn inner(cause: &dyn std::error::Error) -> Self {
        tracing::error!("{cause}");
        let sentence = "the service could not answer; its log says why";
        Self::new(StatusCode::INTERNAL_SERVER_ERROR, Refusal::sentence(sentence))
    }
}

impl IntoResponse for Problem {
    fn into_response(self) -> Response {
        let status = StatusCode::from_u16(self.status).unwrap_or(StatusCode::INTERNAL_SERVER_ERROR);
        (
            status,
            [(header::CONTENT_TYPE, "application/problem+json")],
            axum::Json(self).into_response().into_body(),
        )
            .into_response()
    }
}

impl From<Refusal> for Problem {
    fn from(refusal: Refusal) -> Self {
        let status = if refusal.field.is_some() {
            StatusCode::UNPROCESSABLE_ENTITY
        } else {
            StatusCode::BAD_REQUEST
        };
        Self::new(status, refusal)
    }
}

impl From<sqlx::Error> for Problem {
    fn from(error: sqlx::Error) -> Self {
        /// SQLite's codes for what the disk under the database is to blame for: full, read-only, broken.
        const FULL: &str = "13";
        const READ_ONLY: &str = "8";
        const IO: &str = "10";
        const CORRUPT: &str = "11";
        const NO_DATABASE: &str = "26";
        let code = error.as_database_error().and_then(|e| e.code()).unwrap_or_default();
        // The lowest byte is the code, the rest says more of it.
        let code = code.parse::<u32>().map_or(String::new(), |c| (c & 0xff).to_string());
        tracing::error!("{error}");
        match code.as_str() {
            FULL => Self::storage("the disk of the data directory is full"),
            READ_ONLY => Self::storage("the data directory cannot be written"),
            IO => Self::storage("the disk of the data directory does not take or give data"),
            CORRUPT | NO_DATABASE => {
                let sentence =
                    "the database of the data directory is damaged; see `melange verify`";
                Self::new(StatusCode::INTERNAL_SERVER_ERROR, Refusal::sentence(sentence))
            }
            _ if matches!(error, sqlx::Error::PoolTimedOut) => {
                let sentence = "the database is busy: nothing was changed; try again";
                Self::new(StatusCode::SERVICE_UNAVAILABLE, Refusal::sentence(sentence))
            }
            _ => Self::inner(&error),
        }
    }
}

impl From<ArchiveError> for Problem {
    fn from(error: ArchiveError) -> Self {
        match error {
            ArchiveError::Catalogue(error) => error.into(),
            // Which file it is and what to do about it helps whoever asks.
            ArchiveError::Damaged { .. }
            | ArchiveError::Newer { .. }
            | ArchiveError::Parquet { .. } => {
                tracing::error!("{error}");
                Self::new(StatusCode::INTERNAL_SERVER_ERROR, Refusal::sentence(error.to_string()))
            }
            ArchiveError::File { ref path, ref source, .. } => {
                tracing::error!("{error}");
                match source.kind() {
                    io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => {
                        Self::storage("the disk of the data directory is full")
                    }
                    io::ErrorKind::ReadOnlyFilesystem | io::ErrorKind::PermissionDenied => {
                        Self::storage("the data directory cannot be read or written")
                    }
                    io::ErrorKind::NotFound => {
                        let sentence = format!(
                            "the archive's file {path} is missing; `melange verify --repair` solves its runs again"
                        );
                        Self::new(StatusCode::INTERNAL_SERVER_ERROR, Refusal::sentence(sentence))
                    }
                    _ => Self::inner(&error),
                }
            }
            error => Self::inner(&error),
        }
    }
}

impl From<EnqueueError> for Problem {
    fn from(error: EnqueueError) -> Self {
        match error {
            EnqueueError::Database(error) => error.into(),
            error => Self::inner(&error),
        }
    }
}

impl From<VerbError> for Problem {
    fn from(error: VerbError) -> Self {
        match error {
            VerbError::Database(error) => error.into(),
            VerbError::State(sentence) => Self::conflict(sentence),
        }
    }
}

impl From<MultipartRejection> for Problem {
    fn from(rejection: MultipartRejection) -> Self {
        Self::new(rejection.status(), Refusal::sentence(rejection.body_text()))
    }
}

impl From<MultipartError> for Problem {
    fn from(error: MultipartError) -> Self {
        Self::new(error.status(), Refusal::sentence(error.body_text()))
    }
}

impl From<tokio::task::JoinError> for Problem {
    fn from(error: tokio::task::JoinError) -> Self {
        Self::inner(&error)
    }
}

impl From<BytesRejection> for Problem {
    fn from(rejection: BytesRejection) -> Self {
        Self::new(rejection.status(), Refusal::sentence(rejection.body_text()))
    }
}
