//! One error for the whole interface: a problem document (RFC 9457). Bad input is 400 when it cannot
//! be read and 422 when it says what is not permitted; causes of inner errors are logged, not leaked.

use crate::archive::ArchiveError;
use crate::domain::refusal::Refusal;
use crate::queue::EnqueueError;
use axum::extract::rejection::BytesRejection;
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Serialize;
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

    /// A part of the interface that is not there yet.
    pub fn not_yet(what: &str) -> Self {
        Self::new(StatusCode::NOT_IMPLEMENTED, Refusal::not_yet(what))
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
        Self::inner(&error)
    }
}

impl From<ArchiveError> for Problem {
    fn from(error: ArchiveError) -> Self {
        Self::inner(&error)
    }
}

impl From<EnqueueError> for Problem {
    fn from(error: EnqueueError) -> Self {
        Self::inner(&error)
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
