//! Lists of runs: pages in any order, filters, counts.

use super::filter::{Expression, PRIMARY, Served, along, condition, index_of, served};
use super::{RunRow, SOLVE_SECONDS, TEXT_COLUMNS, WHOLE_COLUMNS, run_row};
use crate::domain::filter::{ColumnKind, Filter, Literal};
use crate::domain::outcome::SCALARS;
use crate::domain::parameters::PARAMETERS;
use crate::domain::status::Status;
use crate::store::Connection;
use serde::Serialize;
use serde_json::{Value, json};
use sqlx::{QueryBuilder, Row, Sqlite};
use utoipa::ToSchema;

/// Whether runs can be sorted or fitted by a name.
pub fn is_column(name: &str) -> bool {
    kind_of(name).is_some()
}

/// Whether a column has numbers or texts; none if there is no such column.
pub fn kind_of(name: &str) -> Option<ColumnKind> {
    if TEXT_COLUMNS.contains(&name) {
        Some(ColumnKind::Text)
    } else if WHOLE_COLUMNS.contains(&name) || is_number(name) {
        Some(ColumnKind::Number)
    } else {
        None
    }
}

/// Whether a name is a parameter or a scalar.
pub fn is_number(name: &str) -> bool {
    name == "iterations"
        || name == SOLVE_SECONDS
        || PARAMETERS.iter().any(|p| p.name == name)
        || SCALARS.iter().any(|s| s.name == name)
}

/// The order of a page of runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Order<'a> {
    /// A column that [`is_column`] knows.
    pub column: &'a str,
    /// From high to low.
    pub descending: bool,
}

/// A page of a sweep's runs: which ones, in which order, from where.
#[derive(Debug, Clone)]
pub struct Listing<'a> {
    /// The sweep's number.
    pub sweep: i64,
    /// The parameters it varies, as the catalogue's axes.
    pub axes: Vec<&'a str>,
    /// Which of its runs.
    pub filter: Option<&'a Filter>,
    /// In which order.
    pub order: Order<'a>,
    /// Most runs of the page.
    pub limit: i64,
    /// Value of the order's column and index of the run before the page.
    pub after: Option<(Value, i64)>,
}

/// How many runs a list has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, ToSchema)]
pub struct Total {
    /// The number.
    pub total: i64,
    /// Whether that is all, or as many as were found among the first runs looked at.
    pub is_exact: bool,
}

/// Runs looked at to count what a filter without an index lets through.
pub(super) const LOOKED_AT: i64 = 100_000;

/// Most runs of a condition whose index is walked through for a page in another order.
pub(super) const FEW: i64 = 20_000;

/// A page of a sweep's runs. Pages go on from a run, so that runs stored meanwhile neither shift nor double
/// any.
///
/// Which runs are on the page is found along one index, which `way` names; only those on the page are
/// looked up whole. Where none serves, all runs of the sweep are looked at: to sort by a column without an
/// index, and for a filter of which no condition with an index lets few runs through, if what it lets
/// through is rare in the order of the list.
pub async fn runs(
    connection: &mut Connection,
    listing: &Listing<'_>,
) -> sqlx::Result<(Vec<RunRow>, Option<(Value, i64)>)> {
    let rows: Vec<RunRow> = ask(connection, listing, false).await?.iter().map(run_row).collect();
    let is_full = rows.len() as i64 == listing.limit;
    let last = rows.last().filter(|_| is_full).map(|row| {
        let index = row.0.get("run_index").and_then(Value::as_i64).unwrap_or_default();
        (row.0.get(listing.order.column).cloned().unwrap_or_default(), index)
    });
    Ok((rows, last))
}

/// What [`runs`] lists, by index and the value sorted by only: often an index holds all that is asked for.
pub async fn keys(
    connection: &mut Connection,
    listing: &Listing<'_>,
) -> sqlx::Result<Vec<(Value, i64)>> {
    let column = listing.order.column;
    let rows = ask(connection, listing, true).await?;
    let key = |row: &sqlx::sqlite::SqliteRow| {
        let value = match kind_of(column) {
            Some(ColumnKind::Number) if super::WHOLE_COLUMNS.contains(&column) => {
                row.get::<Option<i64>, _>("sorted_by").into()
            }
            Some(ColumnKind::Number) => row.get::<Option<f64>, _>("sorted_by").into(),
            _ => row.get::<Option<String>, _>("sorted_by").into(),
        };
        (value, row.get("run_index"))
    };
    Ok(rows.iter().map(key).collect())
}

/// The rows of a page of a sweep's runs: whole, or their keys only.
async fn ask(
    connection: &mut Connection,
    listing: &Listing<'_>,
    is_of_keys: bool,
) -> sqlx::Result<Vec<sqlx::sqlite::SqliteRow>> {
    let Order { column, descending } = listing.order;
    assert!(is_column(column), "the caller checks the column");
    let axis = axis_column(column, &listing.axes);
    let sorted_by = format!("\"{}\"", axis.as_deref().unwrap_or(column));
    let direction = if descending { "DESC" } else { "ASC" };
    let order = match column {
        "run_index" => format!(" ORDER BY run_index {direction} "),
        _ => format!(" ORDER BY {sorted_by} {direction}, run_index {direction} "),
    };
    let index = way(connection, listing).await?;
    let mut rows = Vec::new();
    for stretch in stretches(listing, &sorted_by) {
        let missing = listing.limit - rows.len() as i64;
        if missing == 0 {
            break;
        }
        let mut query = QueryBuilder::<Sqlite>::new("SELECT ");
        if is_of_keys {
            query.push("run_index, ").push(&sorted_by).push(" AS sorted_by");
        } else {
            query.push("* FROM ");
            along(&mut query, PRIMARY, listing.sweep);
            query.push(" AND run_index IN (SELECT run_index");
        }
        query.push(" FROM ");
        along(&mut query, &index, listing.sweep);
        if let Some(filter) = listing.filter {
            query.push(" AND (");
            condition(filter, &listing.axes).push_to(&mut query);
            query.push(")");
        }
        query.push(" AND (");
        stretch.push_to(&mut query);
        query.push(")").push(&order).push("LIMIT ").push_bind(missing);
        if !is_of_keys {
            query.push(")").push(&order);
        }
        rows.extend(query.build().fetch_all(&mut *connection).await?);
    }
    Ok(rows)
}

/// The index along which a page is looked for. It is named in the query, because SQLite, which does not
/// know how many runs a condition lets through, chooses others that are a thousand times slower.
///
/// - If the filter is about one column, and the list is sorted by it or by run_index: that column's. It
///   holds all that is asked for, so that even half of a million runs are sorted quickly.
/// - Else, if a condition lets few runs through: that condition's. Those runs are looked up and sorted.
/// - Else that of the order, along which a page of runs that are not rare is soon full; runs in the order
///   of a column without an index are sorted.
async fn way(connection: &mut Connection, listing: &Listing<'_>) -> sqlx::Result<String> {
    let column = listing.order.column;
    let own = index_of(column, &listing.axes);
    let served = listing.filter.map(|filter| served(filter, &listing.axes)).unwrap_or_default();
    if let Some(only) = served.iter().find(|s| s.is_whole)
        && (column == "run_index" || own.as_ref() == Some(&only.index))
    {
        return Ok(only.index.clone());
    }
    let few = index_of_few(connection, listing, &served).await?;
    Ok(few.or(own).unwrap_or_else(|| PRIMARY.to_owned()))
}

/// The index of the conditions that let the fewest runs through, if those are few.
pub(super) async fn index_of_few(
    connection: &mut Connection,
    listing: &Listing<'_>,
    served: &[Served],
) -> sqlx::Result<Option<String>> {
    let mut fewest = FEW + 1;
    let mut index = None;
    for Served { index: its, conditions, .. } in served {
        let mut query = QueryBuilder::<Sqlite>::new("SELECT COUNT(*) FROM (SELECT 1 FROM ");
        along(&mut query, its, listing.sweep);
        query.push(" AND (");
        condition(conditions, &listing.axes).push_to(&mut query);
        query.push(") LIMIT ").push_bind(fewest).push(")");
        let found: i64 = query.build_query_scalar().fetch_one(&mut *connection).await?;
        if found < fewest {
            fewest = found;
            index = Some(its.clone());
        }
    }
    Ok(index)
}

/// What lies beyond the run before the page, as conditions to be asked one after the other: null is
/// lowest, as SQLite sorts it. Each is one range of an index, which a condition with `OR` would not be.
fn stretches(listing: &Listing<'_>, column: &str) -> Vec<Expression> {
    let Some((value, index)) = &listing.after else { return vec![Expression::new("TRUE", [])] };
    let descending = listing.order.descending;
    let beyond = if descending { "<" } else { ">" };
    let index = Literal::Number(*index as f64);
    let of = |text: String, values: Vec<Literal>| Expression::new(&text, values);
    if listing.order.column == "run_index" {
        return vec![of(format!("run_index {beyond} ?"), vec![index])];
    }
    let value = match value {
        Value::Null => None,
        Value::String(text) => Some(Literal::Text(text.clone())),
        number => Some(Literal::Number(number.as_f64().unwrap_or_default())),
    };
    let null = format!("{column} IS NULL");
    match (value, descending) {
        (Some(value), _) => {
            let values = of(format!("({column}, run_index) {beyond} (?, ?)"), vec![value, index]);
            if descending { vec![values, of(null, vec![])] } else { vec![values] }
        }
        (None, true) => vec![of(format!("{null} AND run_index < ?"), vec![index])],
        (None, false) => vec![
            of(format!("{null} AND run_index > ?"), vec![index]),
            of(format!("{column} IS NOT NULL"), vec![]),
        ],
    }
}

/// The indexed column that holds a parameter's values, if the sweep varies it.
pub fn axis_column(name: &str, axes: &[&str]) -> Option<String> {
    let varied = PARAMETERS.iter().map(|p| p.name).filter(|p| axes.contains(p));
    let place = varied.take(super::AXES).position(|p| p == name)?;
    Some(format!("axis_{}", place + 1))
}

/// How many of a sweep's runs a filter lets through: all of them where an index tells, be it that the
/// filter is about its column alone, be it that one of its conditions lets few through; else those among
/// the first 100,000 runs, and it says so.
pub async fn count_filtered(
    connection: &mut Connection,
    listing: &Listing<'_>,
    filter: &Filter,
) -> sqlx::Result<Total> {
    let served = served(filter, &listing.axes);
    let index = match served.iter().find(|s| s.is_whole) {
        Some(only) => Some(only.index.clone()),
        None => index_of_few(connection, listing, &served).await?,
    };
    let stored = count_stored(connection, listing.sweep).await?;
    let is_exact = index.is_some() || stored <= LOOKED_AT;
    let mut query = QueryBuilder::<Sqlite>::new("SELECT COUNT(*) FROM ");
    if is_exact {
        along(&mut query, index.as_deref().unwrap_or(PRIMARY), listing.sweep);
        query.push(" AND (");
    } else {
        query.push("(SELECT * FROM runs WHERE sweep = ").push_bind(listing.sweep);
        query.push(" ORDER BY run_index LIMIT ").push_bind(LOOKED_AT).push(") WHERE (");
    }
    condition(filter, &listing.axes).push_to(&mut query);
    query.push(")");
    let total = query.build_query_scalar().fetch_one(connection).await?;
    Ok(Total { total, is_exact })
}

/// How many runs of a listing there are.
pub async fn count(connection: &mut Connection, listing: &Listing<'_>) -> sqlx::Result<Total> {
    match listing.filter {
        Some(filter) => count_filtered(connection, listing, filter).await,
        None => {
            let total = count_stored(connection, listing.sweep).await?;
            Ok(Total { total, is_exact: true })
        }
    }
}

/// Runs of a sweep that have a result.
pub async fn count_stored(connection: &mut Connection, sweep: i64) -> sqlx::Result<i64> {
    sqlx::query_scalar("SELECT COALESCE(SUM(runs), 0) FROM homes WHERE sweep = $1")
        .bind(sweep)
        .fetch_one(connection)
        .await
}

/// The last failures of a sweep: index, id and reason.
pub async fn failures(
    connection: &mut Connection,
    sweep: i64,
    limit: i64,
) -> sqlx::Result<Vec<Value>> {
    let rows = sqlx::query(
        "SELECT run_index, run_id, detail FROM runs WHERE sweep = $1 AND status = $2 \
         ORDER BY run_index DESC LIMIT $3",
    )
    .bind(sweep)
    .bind(Status::Failed.name())
    .bind(limit)
    .fetch_all(connection)
    .await?;
    let failure = |row: &sqlx::sqlite::SqliteRow| {
        json!({
            "run_index": row.get::<i64, _>("run_index"),
            "run_id": row.get::<&str, _>("run_id"),
            "detail": row.get::<&str, _>("detail"),
        })
    };
    Ok(rows.iter().map(failure).collect())
}
