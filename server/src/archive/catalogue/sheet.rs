//! Columns of many runs of a sweep at once, for pictures and fits; and all runs that came to no result.

use super::filter::{PRIMARY, along, condition};
use super::list::{Listing, count_stored, index_of_few, kind_of};
use super::{Order, WHOLE_COLUMNS};
use crate::domain::filter::{ColumnKind, Filter};
use crate::domain::parameters::PARAMETERS;
use crate::domain::status::Status;
use crate::store::Connection;
use futures_util::TryStreamExt;
use serde::{Serialize, Serializer};
use sqlx::sqlite::SqliteRow;
use sqlx::{QueryBuilder, Row, Sqlite};
use std::collections::HashMap;

/// Which columns of which of a sweep's runs.
#[derive(Debug, Clone)]
pub struct Extract<'a> {
    /// The sweep's number.
    pub sweep: i64,
    /// The parameters it varies, as the catalogue's axes.
    pub axes: Vec<&'a str>,
    /// Which of its runs.
    pub filter: Option<&'a Filter>,
    /// Columns that [`kind_of`] knows, beside run_index and status, each once.
    pub names: Vec<&'a str>,
    /// At most so many runs; all if it is not given.
    pub most: Option<i64>,
}

/// Columns of runs, in the order of run_index.
#[derive(Debug, Clone, PartialEq)]
pub struct Sheet {
    /// Index of each run.
    pub run_index: Vec<i64>,
    /// How each run ended.
    pub status: Vec<&'static str>,
    /// The columns asked for, in the order of their names.
    pub columns: Vec<Column>,
    /// Runs that the filter lets through; if they are more than those of the sheet, that has the ones of least id.
    pub total: i64,
}

/// A column; what does not exist is none.
#[derive(Debug, Clone, PartialEq)]
pub enum Column {
    /// Numbers, all of them finite.
    Numbers(Vec<Option<f64>>),
    /// Whole numbers.
    Whole(Vec<Option<i64>>),
    /// Texts.
    Texts(Vec<Option<String>>),
}

impl Column {
    /// Its numbers; of texts, the same number for the same text.
    pub fn into_numbers(self) -> Vec<Option<f64>> {
        match self {
            Self::Numbers(numbers) => numbers,
            Self::Whole(whole) => whole.into_iter().map(|n| n.map(|n| n as f64)).collect(),
            Self::Texts(texts) => {
                let mut known: HashMap<String, usize> = HashMap::new();
                let mut number = |text| {
                    let next = known.len();
                    *known.entry(text).or_insert(next) as f64
                };
                texts.into_iter().map(|text| text.map(&mut number)).collect()
            }
        }
    }

    /// An empty one for a column of the catalogue.
    fn of(name: &str) -> Self {
        let is_whole = WHOLE_COLUMNS.contains(&name)
            || PARAMETERS.iter().any(|parameter| parameter.name == name && parameter.whole);
        match kind_of(name) {
            Some(ColumnKind::Number) if is_whole => Self::Whole(Vec::new()),
            Some(ColumnKind::Number) => Self::Numbers(Vec::new()),
            _ => Self::Texts(Vec::new()),
        }
    }

    /// Appends a run's value.
    fn add(&mut self, row: &SqliteRow, at: usize) -> sqlx::Result<()> {
        match self {
            Self::Numbers(numbers) => {
                numbers.push(row.try_get::<Option<f64>, _>(at)?.filter(|n| n.is_finite()));
            }
            // Whole parameters are stored as numbers like the others.
            Self::Whole(whole) => whole.push(row.try_get_unchecked(at)?),
            Self::Texts(texts) => texts.push(row.try_get(at)?),
        }
        Ok(())
    }
}

impl Serialize for Column {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Numbers(numbers) => numbers.serialize(serializer),
            Self::Whole(whole) => whole.serialize(serializer),
            Self::Texts(texts) => texts.serialize(serializer),
        }
    }
}

/// Columns of a sweep's runs. Where there are more than asked for, those of least id: ids are hashes, so that this
/// is a choice by chance, and it is always the same.
pub async fn sheet(connection: &mut Connection, extract: &Extract<'_>) -> sqlx::Result<Sheet> {
    let stored = count_stored(connection, extract.sweep).await?;
    let index = index_for(connection, extract).await?;
    let index = index.as_deref().unwrap_or(PRIMARY);
    let Some(most) = extract.most.filter(|most| *most < stored) else {
        return read(connection, extract, index, None).await;
    };
    let total = let_through(connection, extract, index, stored).await?;
    if total <= most {
        return read(connection, extract, index, None).await;
    }
    // Most runs are told by their id alone to be none of them, without a look at the rest of their rows.
    let mut chosen = Choice { most, below: id_below_which_are(most, total) };
    let mut sheet = read(connection, extract, index, Some(&chosen)).await?;
    if (sheet.run_index.len() as i64) < most {
        chosen.below = None;
        sheet = read(connection, extract, index, Some(&chosen)).await?;
    }
    Ok(Sheet { total, ..sheet })
}

/// How many runs the filter lets through.
pub async fn sheet_rows(connection: &mut Connection, extract: &Extract<'_>) -> sqlx::Result<i64> {
    let stored = count_stored(connection, extract.sweep).await?;
    let index = index_for(connection, extract).await?;
    let_through(connection, extract, index.as_deref().unwrap_or(PRIMARY), stored).await
}

/// An index along which few runs are read, if there is one.
async fn index_for(
    connection: &mut Connection,
    extract: &Extract<'_>,
) -> sqlx::Result<Option<String>> {
    let order = Order { column: "run_index", descending: false };
    let listing = Listing {
        sweep: extract.sweep,
        axes: extract.axes.clone(),
        filter: extract.filter,
        order,
        limit: 0,
        after: None,
    };
    let served =
        extract.filter.map(|f| super::filter::served(f, &extract.axes)).unwrap_or_default();
    index_of_few(connection, &listing, &served).await
}

async fn let_through(
    connection: &mut Connection,
    extract: &Extract<'_>,
    index: &str,
    stored: i64,
) -> sqlx::Result<i64> {
    if extract.filter.is_none() {
        return Ok(stored);
    }
    let mut query = QueryBuilder::new("SELECT COUNT(*)");
    from(&mut query, extract, index);
    query.build_query_scalar().fetch_one(connection).await
}

/// Which runs of too many.
struct Choice {
    /// So many.
    most: i64,
    /// What their ids are surely below, if they are as evenly spread as hashes.
    below: Option<String>,
}

/// A beginning of ids below which more than `most` of `total` runs are, but not many more; none if that is nearly
/// all.
fn id_below_which_are(most: i64, total: i64) -> Option<String> {
    /// Standard deviations by which too few would have to come about.
    const SURE: f64 = 6.0;
    let share = most as f64 / total as f64;
    let share = share + SURE * (share * (1.0 - share) / total as f64).sqrt();
    (share < 1.0).then(|| format!("{:08x}", (share * 2_f64.powi(32)) as u64))
}

/// The rest of a query of all runs asked for.
fn from(query: &mut QueryBuilder<Sqlite>, extract: &Extract<'_>, index: &str) {
    query.push(" FROM ");
    along(query, index, extract.sweep);
    if let Some(filter) = extract.filter {
        query.push(" AND (");
        condition(filter, &extract.axes).push_to(query);
        query.push(")");
    }
}

/// Rows after which other requests get their turn on the thread.
pub(super) const ROWS_AT_ONCE: usize = 500;

async fn read(
    connection: &mut Connection,
    extract: &Extract<'_>,
    index: &str,
    choice: Option<&Choice>,
) -> sqlx::Result<Sheet> {
    let outer = if choice.is_some() { "SELECT * FROM (" } else { "" };
    let mut query = QueryBuilder::<Sqlite>::new(outer);
    query.push("SELECT run_index, status");
    for name in &extract.names {
        assert!(kind_of(name).is_some(), "the caller checks the columns");
        query.push(", \"").push(name).push("\"");
    }
    from(&mut query, extract, index);
    if let Some(Choice { most, below }) = choice {
        if let Some(id) = below {
            query.push(" AND run_id < ").push_bind(id.clone());
        }
        query.push(" ORDER BY run_id, run_index LIMIT ").push_bind(*most).push(") c");
    }
    query.push(" ORDER BY run_index");
    let mut sheet = Sheet {
        run_index: Vec::new(),
        status: Vec::new(),
        columns: extract.names.iter().map(|name| Column::of(name)).collect(),
        total: 0,
    };
    let mut rows = query.build().fetch(&mut *connection);
    while let Some(row) = rows.try_next().await? {
        sheet.run_index.push(row.try_get(0)?);
        let status: &str = row.try_get(1)?;
        let known = Status::from_name(status);
        let known = known.ok_or_else(|| sqlx::Error::Decode("a run of an unknown status".into()));
        sheet.status.push(known?.name());
        for (i, column) in sheet.columns.iter_mut().enumerate() {
            column.add(&row, i + 2)?;
        }
        if sheet.run_index.len().is_multiple_of(ROWS_AT_ONCE) {
            tokio::task::yield_now().await;
        }
    }
    sheet.total = sheet.run_index.len() as i64;
    Ok(sheet)
}

/// A run that came to no result.
#[derive(Debug, Clone, Copy)]
pub struct Unsolved<'a> {
    /// Its index in the sweep.
    pub run_index: i64,
    /// Its id.
    pub run_id: &'a str,
    /// How it ended.
    pub status: &'a str,
    /// What it says of that.
    pub detail: &'a str,
}

/// Hands over all runs of a sweep that are neither converged nor completed, by status and index.
pub async fn unsolved(
    connection: &mut Connection,
    sweep: i64,
    mut take: impl FnMut(Unsolved<'_>),
) -> sqlx::Result<()> {
    let mut query = QueryBuilder::<Sqlite>::new("SELECT run_index, run_id, status, detail FROM ");
    along(&mut query, "runs_by_status", sweep);
    query.push(" AND status IN (");
    let mut list = query.separated(", ");
    for status in Status::STORED {
        if !matches!(status, Status::Converged | Status::Completed) {
            list.push_bind(status.name());
        }
    }
    query.push(") ORDER BY status, run_index");
    let mut rows = query.build().fetch(connection);
    let mut taken = 0_usize;
    while let Some(row) = rows.try_next().await? {
        take(Unsolved {
            run_index: row.try_get(0)?,
            run_id: row.try_get(1)?,
            status: row.try_get(2)?,
            detail: row.try_get(3)?,
        });
        taken += 1;
        if taken.is_multiple_of(ROWS_AT_ONCE) {
            tokio::task::yield_now().await;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests;
