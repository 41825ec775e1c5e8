//! Columns of a sweep's runs over REST, for pictures of the whole ensemble.

use super::Service;
use super::error::Problem;
use super::extract::{Asked, Place};
use crate::archive::catalogue::{self, Column, Extract, Sheet};
use crate::domain::filter::Filter;
use crate::domain::refusal::Refusal;
use crate::queue;
use axum::extract::State;
use axum::http::header;
use axum::response::{IntoResponse, Response};
use serde::{Deserialize, Serialize, Serializer};
use utoipa::openapi::schema::{ArrayBuilder, ObjectBuilder, SchemaType, Type};
use utoipa::openapi::{RefOr, Schema};
use utoipa::{IntoParams, ToSchema};

/// Most runs that are told one by one, if nothing is said.
const DEFAULT_MOST: i64 = 20_000;
/// Most runs that are told one by one.
const MOST: i64 = 200_000;

/// Most columns times runs of an answer: some ten MB of numbers.
const MOST_CELLS: i64 = 2_000_000;

/// Which columns of which runs.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct ColumnsQuery {
    /// Columns with commas between, of any that a filter of runs may name; `run_index` and `status` are there in any
    /// case.
    #[serde(default)]
    names: String,
    /// Which runs, such as `0.5 <= melt_rate_m_per_day < 0.7 and status = "converged"`.
    filter: Option<String>,
    /// At most so many runs, from 1 to 200000; 20000 if not given. Names times runs are at most two million.
    most: Option<i64>,
}

/// Columns of runs, in the order of run_index.
#[derive(Debug, Serialize, ToSchema)]
pub struct Columns {
    /// The columns by name: numbers or texts, null where there is none.
    #[schema(schema_with = columns_schema)]
    columns: Named,
    /// Runs in the columns.
    shown: usize,
    /// Ended runs that the filter lets through.
    total: i64,
    /// Whether these are all of them.
    choice: Choice,
}

/// Which runs are shown.
#[derive(Debug, Clone, Copy, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
enum Choice {
    /// All.
    All,
    /// The `most` runs of least id, which is a hash: a choice by chance that is always the same.
    Random,
}

/// Columns by name, in the order asked for.
#[derive(Debug)]
struct Named(Vec<(String, Column)>);

impl Serialize for Named {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.iter().map(|(name, column)| (name, column)))
    }
}

fn columns_schema() -> RefOr<Schema> {
    let value = SchemaType::from_iter([Type::Number, Type::String, Type::Null]);
    let column = ArrayBuilder::new().items(ObjectBuilder::new().schema_type(value));
    let columns = ObjectBuilder::new().additional_properties(Some(column));
    let columns = columns
        .description(Some("The columns by name: numbers or texts, null where there is none."));
    columns.build().into()
}

/// Columns of a sweep's ended runs, in the order of run_index. Where the filter lets more than `most` runs through,
/// the ones of least id are shown, and `choice` says so.
#[utoipa::path(
    get, path = "/sweeps/{id}/columns", params(("id" = String, Path,), ColumnsQuery),
    responses(
        (status = 200, body = Columns), (status = 400, body = Problem), (status = 404, body = Problem),
        (status = 422, body = Problem),
    )
)]
pub async fn columns(
    State(service): State<Service>,
    Place(id): Place<String>,
    Asked(query): Asked<ColumnsQuery>,
) -> Result<Response, Problem> {
    let names = names(&query.names)?;
    let filter = filter(query.filter.as_deref())?;
    let most = most(query.most)?;
    let turn = service.store.long_read().await?;
    let mut tx = service.store.read().await?;
    let row = queue::sweep_in_brief(&mut tx, &id).await?;
    let row = row.ok_or_else(|| Problem::not_found("sweep", &id))?;
    let stored = catalogue::count_stored(&mut tx, row.number).await?;
    check_cells(names.len(), most, stored)?;
    let extract = Extract {
        sweep: row.number,
        axes: row.axes(),
        filter: filter.as_ref(),
        names: names.clone(),
        most: Some(most),
    };
    let Sheet { run_index, status, columns, total } = catalogue::sheet(&mut tx, &extract).await?;
    drop(tx);
    let shown = run_index.len();
    let run_index = Column::Whole(run_index.into_iter().map(Some).collect());
    let status = Column::Texts(status.into_iter().map(|name| Some(name.to_owned())).collect());
    let mut named = vec![("run_index".to_owned(), run_index), ("status".to_owned(), status)];
    named.extend(names.into_iter().map(str::to_owned).zip(columns));
    let choice = if shown as i64 == total { Choice::All } else { Choice::Random };
    let columns = Columns { columns: Named(named), shown, total, choice };
    let answer = tokio::task::spawn_blocking(move || {
        let _turn = turn;
        json(&columns)
    });
    answer.await?
}

/// Refuses answers that are too large: so many columns of at most so many of the runs there are.
fn check_cells(names: usize, most: i64, stored: i64) -> Result<(), Refusal> {
    let names = (names as i64).max(1);
    if most.min(stored) * names <= MOST_CELLS {
        return Ok(());
    }
    let permitted = format!(
        "from 1 to {} with {names} columns of {stored} runs: names times runs are at most {MOST_CELLS}",
        MOST_CELLS / names
    );
    Err(Refusal::value("most", most, permitted))
}

/// The columns asked for beside run_index and status, each once.
fn names(asked: &str) -> Result<Vec<&str>, Refusal> {
    let mut names: Vec<&str> = Vec::new();
    for name in asked.split(',').filter(|_| !asked.is_empty()) {
        if !catalogue::is_column(name) {
            let permitted = "columns of the runs, as filters name them, with commas between";
            return Err(Refusal::value("names", name, permitted));
        }
        if !["run_index", "status"].contains(&name) && !names.contains(&name) {
            names.push(name);
        }
    }
    Ok(names)
}

/// A filter of runs.
pub fn filter(asked: Option<&str>) -> Result<Option<Filter>, Refusal> {
    asked.map(|text| Filter::parse(text, &catalogue::kind_of)).transpose()
}

/// How many runs are told one by one.
pub fn most(asked: Option<i64>) -> Result<i64, Refusal> {
    let most = asked.unwrap_or(DEFAULT_MOST);
    if (1..=MOST).contains(&most) {
        return Ok(most);
    }
    Err(Refusal::value("most", most, format!("from 1 to {MOST}")))
}

/// An answer that is long: written where nobody waits for it.
pub fn json(answer: &impl Serialize) -> Result<Response, Problem> {
    let bytes = serde_json::to_vec(answer).map_err(|e| Problem::inner(&e))?;
    Ok(([(header::CONTENT_TYPE, "application/json")], bytes).into_response())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_answer_has_so_many_cells_and_no_more() {
        for (names, most, stored) in
            [(0, MOST, MOST), (10, MOST, MOST), (80, DEFAULT_MOST, 1 << 24), (80, MOST, 20_000)]
        {
            assert_eq!(check_cells(names, most, stored), Ok(()), "{names} {most} {stored}");
        }
        let refusal = check_cells(11, MOST, 300_000).expect_err("too many");
        assert_eq!(refusal.field.as_deref(), Some("most"));
        let permitted = refusal.permitted.expect("what is permitted");
        assert!(permitted.starts_with("from 1 to 181818 with 11 columns"), "{permitted}");
    }
}
