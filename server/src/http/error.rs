//! One error for the whole interface: a problem document (RFC 9457). Bad input is 400 when it cannot
//! be read and 422 when it says what is not permitted; causes of inner errors are logged, not leaked.

use super::request;
use crate::archive::ensemble::ImportError;
use crate::archive::{ArchiveError, REPAIR};
use crate::domain::person::Forbidden;
use crate::domain::refusal::Refusal;
use crate::people::Unfit;
use crate::queue::{EnqueueError, VerbError};
use axum::extract::multipart::{MultipartError, MultipartRejection};
use axum::extract::rejection::BytesRejection;
use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Serialize;
use std::io;
use std::time::Duration;
use utoipa::ToSchema;

/// Media type of problem documents.
pub const PROBLEM_TYPE: &str = "application/problem+json";

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
    /// When to try again, s.
    #[serde(skip)]
    wait_s: Option<u64>,
    /// Of an answer that the service could not give: what the log knows the request by.
    #[serde(skip_serializing_if = "Option::is_none")]
    request_id: Option<String>,
}

impl Problem {
    fn new(status: StatusCode, refusal: Refusal) -> Self {
        let title = status.canonical_reason().unwrap_or("error");
        let request_id = status.is_server_error().then(request::id).flatten();
        let (status, refusal) = (status.as_u16(), Box::new(refusal));
        Self { kind: "about:blank", title, status, refusal, wait_s: None, request_id }
    }

    /// An archive is larger than is taken.
    pub fn archive_too_large(most: u64) -> Self {
        let sentence = format!("the archive has more than {most} bytes, and no more are taken");
        Self::new(StatusCode::PAYLOAD_TOO_LARGE, Refusal::sentence(sentence))
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

    /// A document is longer than is taken; how long it is was not looked.
    pub fn longer_than(most: usize) -> Self {
        let sentence =
            format!("the document has more than {most} bytes, which is the most taken here");
        Self::new(StatusCode::PAYLOAD_TOO_LARGE, Refusal::sentence(sentence))
    }

    /// Nobody knows who asks.
    pub fn unauthorized(why: &str) -> Self {
        let sentence = format!(
            "{why}: send `Authorization: Bearer <token>`, or log in on the page; an admin gives out tokens"
        );
        Self::new(StatusCode::UNAUTHORIZED, Refusal::sentence(sentence))
    }

    /// Too many wrong tokens came from an address.
    pub fn too_many_failures(wait: Duration) -> Self {
        let wait_s = wait.as_secs() + 1;
        let sentence =
            format!("too many wrong tokens came from your address: try again in {wait_s} s");
        Self::new(StatusCode::TOO_MANY_REQUESTS, Refusal::sentence(sentence)).after(wait_s)
    }

    fn after(mut self, wait_s: u64) -> Self {
        self.wait_s = Some(wait_s);
        self
    }

    /// Who asks may not.
    pub fn forbidden(sentence: impl Into<String>) -> Self {
        Self::new(StatusCode::FORBIDDEN, Refusal::sentence(sentence))
    }

    /// A handler wants to know who asks, and nobody has found out.
    pub fn unknown_actor() -> Self {
        let sentence = "the service does not know who asks: a defect to report";
        Self::new(StatusCode::INTERNAL_SERVER_ERROR, Refusal::sentence(sentence))
    }

    /// The file is not the one that the request is about.
    pub fn changed() -> Self {
        let sentence = "the file has another tag than those of `If-Match`";
        Self::new(StatusCode::PRECONDITION_FAILED, Refusal::sentence(sentence))
    }

    /// A range has none of a file's bytes.
    pub fn unsatisfiable(bytes: u64) -> Self {
        let sentence = format!("the file has {bytes} bytes, and `Range` asks for none of them");
        Self::new(StatusCode::RANGE_NOT_SATISFIABLE, Refusal::sentence(sentence))
    }

    /// A header that cannot be written: a defect.
    pub fn untold() -> Self {
        Self::inner(&io::Error::other("a header of a download cannot be written"))
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

    /// The sentence, with a mark under the character that it is about, if it is about one.
    pub fn pointed(&self) -> String {
        self.refusal.pointed()
    }

    /// The service failed; why is for its log.
    pub fn inner(cause: &dyn std::error::Error) -> Self {
        tracing::error!("{cause}");
        let sentence = "the service could not answer; its log says why";
        Self::new(StatusCode::INTERNAL_SERVER_ERROR, Refusal::sentence(sentence))
    }
}

impl IntoResponse for Problem {
    fn into_response(self) -> Response {
        let status = StatusCode::from_u16(self.status).unwrap_or(StatusCode::INTERNAL_SERVER_ERROR);
        let wait_s = self.wait_s;
        let mut response = (
            status,
            [(header::CONTENT_TYPE, PROBLEM_TYPE)],
            axum::Json(self).into_response().into_body(),
        )
            .into_response();
        if let Some(wait_s) = wait_s {
            response.headers_mut().insert(header::RETRY_AFTER, wait_s.into());
        }
        if status == StatusCode::UNAUTHORIZED {
            let scheme = HeaderValue::from_static("Bearer");
            response.headers_mut().insert(header::WWW_AUTHENTICATE, scheme);
        }
        response
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

impl From<Forbidden> for Problem {
    fn from(Forbidden(sentence): Forbidden) -> Self {
        Self::forbidden(sentence)
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
                        let sentence = format!("the archive's file {path} is missing{REPAIR}");
                        Self::new(StatusCode::INTERNAL_SERVER_ERROR, Refusal::sentence(sentence))
                    }
                    _ => Self::inner(&error),
                }
            }
            ArchiveError::TooLarge { .. } => {
                Self::new(StatusCode::UNPROCESSABLE_ENTITY, Refusal::sentence(error.to_string()))
            }
            ArchiveError::NoRuns => Self::conflict(error.to_string()),
            error => Self::inner(&error),
        }
    }
}

impl From<Unfit> for Problem {
    fn from(error: Unfit) -> Self {
        match error {
            Unfit::Database(error) => error.into(),
            Unfit::Refused(refusal) => refusal.into(),
            Unfit::Nobody(name) => Self::not_found("person", &name),
            Unfit::State(sentence) => Self::conflict(sentence),
        }
    }
}

impl From<ImportError> for Problem {
    fn from(error: ImportError) -> Self {
        match error {
            ImportError::Refused(sentence) => {
                let refusal = Refusal {
                    field: Some("archive".into()),
                    ..Refusal::sentence(format!("nothing was taken: {sentence}"))
                };
                refusal.into()
            }
            ImportError::Conflict(sentence) => Self::conflict(sentence),
            ImportError::Archive(error) => error.into(),
        }
    }
}

impl From<EnqueueError> for Problem {
    fn from(error: EnqueueError) -> Self {
        match error {
            EnqueueError::Database(error) => error.into(),
            error @ EnqueueError::Quota { .. } => Self::forbidden(error.to_string()),
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
