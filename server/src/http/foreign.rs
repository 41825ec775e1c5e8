//! Tables of somebody's earlier results over REST: bring, look at, compare with runs of this model.

use super::Service;
use super::error::Problem;
use super::extract::{Asked, NothingAsked, Place};
use super::sweeps::{Page, page_limit};
use crate::archive::catalogue::{self, Counterpart, Foreign};
use crate::domain::foreign::{
    Beside, ColumnMap, ForeignRow, ForeignTable, Index, Spread, is_plain, line, spread,
};
use crate::domain::person::Actor;
use crate::domain::refusal::Refusal;
use crate::people;
use crate::store::{Connection, Store};
use axum::Json;
use axum::body::Bytes;
use axum::extract::State;
use axum::extract::multipart::{Multipart, MultipartRejection};
use axum::http::StatusCode;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use utoipa::{IntoParams, ToSchema};
use uuid::Uuid;

/// A table that was brought.
#[derive(Debug, Serialize, ToSchema)]
pub struct Brought {
    #[serde(flatten)]
    table: Foreign,
    /// Columns that the map does not name.
    ignored: Vec<String>,
}

/// Bring a table of somebody's earlier results, for comparison: a form with `table` (CSV), `map` (TOML or JSON:
/// source, and where each parameter and result stands) and `name`. It is never taken for runs of this model.
#[utoipa::path(
    post, path = "/foreign", request_body(content = Object, content_type = "multipart/form-data"),
    responses(
        (status = 201, body = Brought), (status = 400, body = Problem), (status = 403, body = Problem),
        (status = 413, body = Problem), (status = 422, body = Problem),
        (status = 507, body = Problem, description = "The disk is full"),
    )
)]
pub async fn bring(
    State(service): State<Service>,
    actor: Actor,
    _: NothingAsked,
    form: Result<Multipart, MultipartRejection>,
) -> Result<(StatusCode, Json<Brought>), Problem> {
    actor.may_submit()?;
    let mut form = form?;
    let mut parts: BTreeMap<String, Bytes> = BTreeMap::new();
    while let Some(field) = form.next_field().await? {
        let name = field.name().unwrap_or_default().to_owned();
        if !["table", "map", "name"].contains(&name.as_str()) || parts.contains_key(&name) {
            let permitted = "a form has the fields `table`, `map` and `name`, each once";
            return Err(Refusal::value(name, "", permitted).into());
        }
        parts.insert(name, field.bytes().await?);
    }
    let bytes: usize = parts.values().map(Bytes::len).sum();
    if bytes > service.most_bytes {
        return Err(Problem::too_large(bytes, service.most_bytes));
    }
    let mut part =
        |name: &str| parts.remove(name).ok_or_else(|| Refusal::missing(name, "a form has it"));
    let (table, map, name) = (part("table")?, part("map")?, part("name")?);
    Ok((StatusCode::CREATED, Json(keep(&service.store, &actor, &name, &map, table).await?)))
}

/// Reads a table by its map and keeps it.
pub async fn keep(
    store: &Store,
    actor: &Actor,
    name: &[u8],
    map: &[u8],
    table: Bytes,
) -> Result<Brought, Problem> {
    actor.may_submit()?;
    let text = |field: &str, bytes: &[u8]| {
        String::from_utf8(bytes.to_vec()).map_err(|_| Refusal {
            field: Some(field.to_owned()),
            ..Refusal::sentence(format!("`{field}` is no UTF-8"))
        })
    };
    let name = line("name", &text("name", name)?)?;
    let mut hasher = blake3::Hasher::new();
    for part in [map, &table] {
        hasher.update(&(part.len() as u64).to_le_bytes());
        hasher.update(part);
    }
    let map = ColumnMap::parse(&text("map", map)?)?;
    let read = tokio::task::spawn_blocking(move || map.read(&table)).await??;
    let ForeignTable { map, rows, ignored } = read;
    let table = Foreign {
        id: format!("foreign-{}", Uuid::now_v7().simple()),
        name,
        source: map.source.clone(),
        owner: actor.name.clone(),
        created_at: humantime::format_rfc3339_millis(std::time::SystemTime::now()).to_string(),
        digest: hasher.finalize().to_hex().to_string(),
        assumed: map.assumed(),
        map,
        row_count: rows.len() as i64,
    };
    let mut tx = store.write().await?;
    catalogue::insert_foreign(&mut tx, &table, &rows).await?;
    people::audit(&mut tx, &actor.name, "import-table", &table.id, Some(&table.name)).await?;
    tx.commit().await?;
    Ok(Brought { table, ignored })
}

/// List the tables of earlier results, the newest first.
#[utoipa::path(
    get, path = "/foreign",
    responses((status = 200, body = Page<Foreign>), (status = 400, body = Problem))
)]
pub async fn list(
    State(service): State<Service>,
    _: NothingAsked,
) -> Result<Json<Page<Foreign>>, Problem> {
    let tables = catalogue::foreign_tables(&mut *service.store.read().await?).await?;
    let total = tables.len() as i64;
    Ok(Json(Page::new(tables, None, total)))
}

/// One table of earlier results.
#[utoipa::path(
    get, path = "/foreign/{id}", params(("id" = String, Path,)),
    responses((status = 200, body = Foreign), (status = 400, body = Problem), (status = 404, body = Problem))
)]
pub async fn one(
    State(service): State<Service>,
    Place(id): Place<String>,
    _: NothingAsked,
) -> Result<Json<Foreign>, Problem> {
    Ok(Json(found(&mut *service.store.read().await?, &id).await?))
}

async fn found(tx: &mut Connection, id: &str) -> Result<Foreign, Problem> {
    let table = catalogue::foreign_table(tx, id).await?;
    table.ok_or_else(|| Problem::not_found("table of earlier results", id))
}

/// Delete a table of earlier results.
#[utoipa::path(
    delete, path = "/foreign/{id}", params(("id" = String, Path,)),
    responses(
        (status = 204, description = "Deleted"), (status = 400, body = Problem), (status = 403, body = Problem),
        (status = 404, body = Problem), (status = 507, body = Problem),
    )
)]
pub async fn delete(
    State(service): State<Service>,
    actor: Actor,
    Place(id): Place<String>,
    _: NothingAsked,
) -> Result<StatusCode, Problem> {
    let mut tx = service.store.write().await?;
    let table = found(&mut tx, &id).await?;
    actor.may_change(Some(&table.owner)).map_err(|_| {
        let owner = &table.owner;
        Problem::forbidden(format!("this table is {owner}'s: only they and an admin may delete it"))
    })?;
    catalogue::remove_foreign(&mut tx, &id).await?;
    people::audit(&mut tx, &actor.name, "delete-table", &id, Some(&table.name)).await?;
    tx.commit().await?;
    Ok(StatusCode::NO_CONTENT)
}

/// Which rows.
#[derive(Debug, Default, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct Rows {
    /// Items of the page, from 1 to 1000; 100 if not given.
    limit: Option<i64>,
    /// The `next` of the page before.
    cursor: Option<String>,
}

impl Rows {
    /// Limit and first row, checked.
    fn window(&self) -> Result<(i64, i64), Problem> {
        let from = match &self.cursor {
            None => Some(0),
            Some(text) => text.parse().ok().filter(|from| *from >= 0),
        };
        let from = from.ok_or_else(|| {
            let cursor = self.cursor.clone().unwrap_or_default();
            Refusal::value("cursor", cursor, "the `next` of the page before")
        })?;
        Ok((page_limit(self.limit)?, from))
    }
}

/// Rows of a table of earlier results.
#[utoipa::path(
    get, path = "/foreign/{id}/rows", params(("id" = String, Path,), Rows),
    responses(
        (status = 200, body = Page<ForeignRow>), (status = 400, body = Problem), (status = 404, body = Problem),
        (status = 422, body = Problem),
    )
)]
pub async fn rows(
    State(service): State<Service>,
    Place(id): Place<String>,
    Asked(asked): Asked<Rows>,
) -> Result<Json<Page<ForeignRow>>, Problem> {
    let (limit, from) = asked.window()?;
    let mut tx = service.store.read().await?;
    let table = found(&mut tx, &id).await?;
    let rows = catalogue::foreign_rows(&mut tx, &id, from, limit).await?;
    let next = Some(from.saturating_add(limit))
        .filter(|next| *next < table.row_count)
        .map(|n| n.to_string());
    Ok(Json(Page::new(rows, next, table.row_count)))
}

/// A table of earlier results beside runs of this model.
#[derive(Debug, Serialize, ToSchema)]
pub struct CompareResult {
    /// Rows of the table.
    rows: usize,
    /// Rows at whose parameters there is a run.
    matched: usize,
    /// How far results lie apart, by their names.
    summary: BTreeMap<String, Spread>,
    /// Parameters that the map does not name, and the defaults that are taken for them.
    assumed: BTreeMap<String, f64>,
    /// A page of rows that have a run.
    items: Vec<Compared>,
    /// Cursor of the next page; null at the end.
    next: Option<String>,
}

/// A row beside the run at its parameters.
#[derive(Debug, Serialize, ToSchema)]
pub struct Compared {
    /// The row.
    row_index: usize,
    /// The run: the plain steady state at the same parameters.
    run_id: String,
    /// How the run ended.
    status: String,
    /// Results of the row beside those of the run.
    results: BTreeMap<String, Beside>,
}

/// Compare a table of earlier results with this model: each row with the steady state at its parameters, if that
/// was solved.
#[utoipa::path(
    get, path = "/foreign/{id}/compare", params(("id" = String, Path,), Rows),
    responses(
        (status = 200, body = CompareResult), (status = 400, body = Problem), (status = 404, body = Problem),
        (status = 422, body = Problem),
    )
)]
pub async fn compare(
    State(service): State<Service>,
    Place(id): Place<String>,
    Asked(asked): Asked<Rows>,
) -> Result<Json<CompareResult>, Problem> {
    let (limit, from) = asked.window()?;
    let mut tx = service.store.read().await?;
    Ok(Json(compared(&mut tx, &id, from as usize, limit as usize).await?))
}

/// A table beside runs of this model; `limit` of the rows from one on.
pub async fn compared(
    tx: &mut Connection,
    id: &str,
    from: usize,
    limit: usize,
) -> Result<CompareResult, Problem> {
    let table = found(tx, id).await?;
    let rows = catalogue::foreign_rows(tx, id, 0, table.row_count).await?;
    let index = Index::new(&rows);
    let closure = table.map.upstream_closure.as_str();
    let ranges = ranges(&rows);
    let mut matches: Vec<Option<Counterpart>> = vec![None; rows.len()];
    let mut place = Some((0, -1));
    while let Some(after) = place {
        let (candidates, next) = catalogue::candidates(tx, closure, &ranges, after).await?;
        for candidate in candidates {
            let at: Vec<usize> = index.at(&rows, &candidate.parameters).collect();
            // The last one is kept: the newest result of a run that was solved again.
            if !at.is_empty() && is_plain(&candidate.run_id, &candidate.parameters, closure) {
                at.into_iter().for_each(|i| matches[i] = Some(candidate.clone()));
            }
        }
        place = next;
    }
    let mut differences: BTreeMap<String, Vec<(usize, f64)>> = BTreeMap::new();
    let mut all = Vec::new();
    for (row_index, (row, run)) in rows.iter().zip(matches).enumerate() {
        let Some(run) = run else { continue };
        let beside = |(name, value): (&String, &f64)| {
            (name.clone(), Beside::new(*value, run.results.get(name).copied()))
        };
        let results: BTreeMap<String, Beside> = row.results.iter().map(beside).collect();
        for (name, beside) in &results {
            if let Some(relative) = beside.relative {
                differences.entry(name.clone()).or_default().push((row_index, relative));
            }
        }
        let (run_id, status) = (run.run_id.clone(), run.status.clone());
        all.push(Compared { row_index, run_id, status, results });
    }
    let summary = differences.into_iter().filter_map(|(name, d)| Some((name, spread(d)?)));
    let matched = all.len();
    let next =
        Some(from.saturating_add(limit)).filter(|next| *next < matched).map(|n| n.to_string());
    Ok(CompareResult {
        rows: rows.len(),
        matched,
        summary: summary.collect(),
        assumed: table.assumed,
        items: all.into_iter().skip(from).take(limit).collect(),
        next,
    })
}

/// Least and largest value of each parameter, a little widened.
fn ranges(rows: &[ForeignRow]) -> BTreeMap<String, (f64, f64)> {
    /// More than the difference of two numbers that are the same.
    const WIDER: f64 = 1e-8;
    let mut ranges: BTreeMap<String, (f64, f64)> = BTreeMap::new();
    for (name, value) in rows.iter().flat_map(|row| &row.parameters) {
        let (low, high) = (value - value.abs() * WIDER, value + value.abs() * WIDER);
        let range = ranges.entry(name.clone()).or_insert((low, high));
        *range = (range.0.min(low), range.1.max(high));
    }
    ranges
}
