//! What handlers take from a request, refused as a problem document where it cannot be read.

use super::error::Problem;
use crate::domain::refusal::Refusal;
use axum::extract::{FromRequest, FromRequestParts, Path, Query, Request};
use axum::http::request::Parts;
use serde::de::DeserializeOwned;

/// Members of the path.
#[derive(Debug)]
pub struct Place<T>(pub T);

impl<T: DeserializeOwned + Send, S: Send + Sync> FromRequestParts<S> for Place<T> {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, Problem> {
        let path = Path::<T>::from_request_parts(parts, state).await;
        path.map(|Path(value)| Self(value))
            .map_err(|rejection| Refusal::sentence(rejection.body_text()).into())
    }
}

/// Members of the query; an unknown one is refused by `T`.
#[derive(Debug)]
pub struct Asked<T>(pub T);

impl<T: DeserializeOwned, S: Send + Sync> FromRequestParts<S> for Asked<T> {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, Problem> {
        let query = Query::<T>::from_request_parts(parts, state).await;
        query
            .map(|Query(value)| Self(value))
            .map_err(|rejection| Refusal::sentence(rejection.body_text()).into())
    }
}

/// A small document in JSON.
#[derive(Debug)]
pub struct Body<T>(pub T);

/// Longest small document, bytes.
const SMALL: usize = 1 << 20;

impl<T: DeserializeOwned> Body<T> {
    /// The document that a request carries.
    pub async fn of(request: Request) -> Result<Self, Problem> {
        let bytes = axum::body::to_bytes(request.into_body(), SMALL).await;
        let bytes = bytes.map_err(|_| Problem::longer_than(SMALL))?;
        // A list would be read as members in their order.
        if !bytes.trim_ascii_start().starts_with(b"{") {
            return Err(Refusal::sentence("the document is refused: it is no JSON object").into());
        }
        let mut json = serde_json::Deserializer::from_slice(&bytes);
        let read = serde_path_to_error::deserialize(&mut json);
        let value = read.map_err(|e| Refusal::sentence(format!("the document is refused: {e}")))?;
        json.end().map_err(|e| Refusal::sentence(format!("the document is refused: {e}")))?;
        Ok(Self(value))
    }
}

impl<T: DeserializeOwned, S: Send + Sync> FromRequest<S> for Body<T> {
    type Rejection = Problem;

    async fn from_request(request: Request, _: &S) -> Result<Self, Problem> {
        Self::of(request).await
    }
}

/// A request without a query: what is not understood is refused, never ignored.
#[derive(Debug)]
pub struct NothingAsked;

impl<S: Send + Sync> FromRequestParts<S> for NothingAsked {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, _: &S) -> Result<Self, Problem> {
        match parts.uri.query().filter(|q| !q.is_empty()) {
            Some(query) => {
                Err(Refusal::sentence(format!("`?{query}` is not understood here")).into())
            }
            None => Ok(Self),
        }
    }
}

/// A body as JSON; what is wrong is told with its place.
pub fn json_of<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, Refusal> {
    let mut reader = serde_json::Deserializer::from_slice(bytes);
    let read = serde_path_to_error::deserialize(&mut reader);
    read.map_err(|error| {
        let path = error.path().to_string();
        let sentence = format!("the document is not what is read here: {}", error.inner());
        Refusal { field: Some(path).filter(|p| p != "."), ..Refusal::sentence(sentence) }
    })
}
