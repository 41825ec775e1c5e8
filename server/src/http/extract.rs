//! What handlers take from a request, refused as a problem document where it cannot be read.

use super::error::Problem;
use crate::domain::refusal::Refusal;
use axum::extract::{FromRequestParts, Path, Query};
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
