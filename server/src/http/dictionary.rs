//! The names of the interface over REST: parameters, results, and every column of every table.

use super::extract::NothingAsked;
use crate::archive::columns::{self, TableEntry};
use crate::domain::dictionary::Dictionary;
use axum::Json;
use serde::Serialize;
use utoipa::ToSchema;

/// All names.
#[derive(Debug, Serialize, ToSchema)]
pub struct Names {
    #[serde(flatten)]
    dictionary: Dictionary,
    /// The tables of a sweep and their columns.
    tables: Vec<TableEntry>,
}

/// Names, units, meanings and ranges of parameters and results, and the columns of all tables.
#[utoipa::path(get, path = "/dictionary", responses((status = 200, body = Names), (status = 400, body = super::error::Problem)))]
pub async fn dictionary(_: NothingAsked) -> Json<Names> {
    Json(Names { dictionary: Dictionary::new(), tables: columns::tables() })
}
