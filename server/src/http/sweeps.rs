//! Sweeps over REST: list, look at.

use super::Service;
use super::error::Problem;
use super::extract::{Asked, NothingAsked, Place};
use crate::archive::catalogue;
use crate::domain::document::Document;
use crate::domain::filter::{Comparison, Filter, Literal, Resolved};
use crate::domain::found;
use crate::domain::note;
use crate::domain::refusal::Refusal;
use crate::domain::seal::Seal;
use crate::domain::status::{Counts, SweepState};
use crate::queue::{self, Imported, SweepRow, Varied};
use crate::store::Connection;
use axum::Json;
use axum::extract::State;
use serde::{Deserialize, Serialize};
use serde_json::value::RawValue;
use std::time::{Duration, SystemTime};
use utoipa::{IntoParams, ToSchema};

/// A sweep and how far it is.
#[derive(Debug, Serialize, ToSchema)]
pub struct Sweep {
    id: String,
    name: String,
    state: SweepState,
    counts: Counts,
    /// Runs that were there already and are not solved again, so far.
    reused: i64,
    /// Higher ones go first.
    priority: i64,
    tags: Vec<String>,
    /// Its note in Markdown, as it was written; in lists its first 200 characters.
    note: Option<String>,
    /// Whether `note` leaves something out, as in lists.
    note_is_cut: bool,
    /// The note as harmless HTML; null where there is none, and in lists.
    note_html: Option<String>,
    created_at: String,
    /// Who submitted it; null for a sweep from before there were owners.
    owner: Option<String>,
    /// Since when it lies in the trash, RFC 3339 in UTC; null if it does not.
    deleted_at: Option<String>,
    /// What it is cited by; null if it is not sealed. A sealed sweep never changes again.
    sealed: Option<Seal>,
    /// Where it came from; null if it was submitted here.
    imported: Option<Imported>,
    /// Bytes of the Parquet files that hold what it solved, of a file with other rows too the share of its rows.
    /// Runs that it took over from other sweeps lie in the files of those and do not count. Changes once more when its
    /// files are put together, shortly after its end.
    bytes: i64,
    /// Parameters that differ among its runs, those not ended included, in the order of their names. Empty also for
    /// an older sweep of which no ranges are stored.
    varies: Vec<Varied>,
    /// What was submitted.
    #[schema(value_type = Document)]
    spec: Box<RawValue>,
    /// Whether `spec` leaves the ends of long lists out, as in lists of sweeps.
    spec_is_cut: bool,
}

impl Sweep {
    fn of(row: SweepRow, bytes: i64, varies: Vec<Varied>) -> Self {
        Self {
            state: row.state(),
            // It was written by this service; what is not JSON is shown as nothing.
            spec: RawValue::from_string(row.document).unwrap_or_else(|_| RawValue::NULL.to_owned()),
            spec_is_cut: row.is_cut,
            id: row.id,
            name: row.name,
            counts: row.counts,
            reused: row.reused,
            priority: row.priority,
            tags: row.tags,
            note: row.note,
            note_is_cut: row.note_is_cut,
            note_html: None,
            created_at: row.created_at,
            owner: row.owner,
            deleted_at: row.trashed_ms.map(rfc3339),
            sealed: row.seal,
            imported: row.imported,
            bytes,
            varies,
        }
    }

    /// Sweeps as they are listed, with what else is stored of them: a query of each kind for all of them.
    pub async fn all(connection: &mut Connection, rows: Vec<SweepRow>) -> sqlx::Result<Vec<Self>> {
        let numbers: Vec<i64> = rows.iter().map(|row| row.number).collect();
        let mut bytes = catalogue::bytes_of(connection, &numbers).await?;
        let mut varied = queue::varied(connection, &numbers).await?;
        let sweep = |row: SweepRow| {
            let number = row.number;
            let bytes = bytes.remove(&number).unwrap_or_default();
            Self::of(row, bytes, varied.remove(&number).unwrap_or_default())
        };
        Ok(rows.into_iter().map(sweep).collect())
    }

    /// A sweep as it is listed.
    pub async fn brief(connection: &mut Connection, row: SweepRow) -> sqlx::Result<Self> {
        let bytes = catalogue::bytes_of(connection, &[row.number]).await?.remove(&row.number);
        let varied = queue::varied(connection, &[row.number]).await?.remove(&row.number);
        Ok(Self::of(row, bytes.unwrap_or_default(), varied.unwrap_or_default()))
    }

    /// A sweep that is told whole, with its note as HTML.
    pub async fn whole(mut self) -> Result<Self, Problem> {
        if let Some(markdown) = self.note.clone() {
            let html = tokio::task::spawn_blocking(move || note::html(&markdown)).await?;
            self.note_html = Some(html);
        }
        Ok(self)
    }
}

fn rfc3339(ms: i64) -> String {
    let since = Duration::from_millis(u64::try_from(ms).unwrap_or_default());
    humantime::format_rfc3339_millis(SystemTime::UNIX_EPOCH + since).to_string()
}

/// A page of a list.
#[derive(Debug, Serialize, ToSchema)]
pub struct Page<T> {
    pub items: Vec<T>,
    /// Cursor of the next page; null at the end.
    pub next: Option<String>,
    /// All items.
    pub total: i64,
}

/// The limit of a page, checked.
pub fn page_limit(limit: Option<i64>) -> Result<i64, Problem> {
    const DEFAULT: i64 = 100;
    const MOST: i64 = 1000;
    let limit = limit.unwrap_or(DEFAULT);
    if (1..=MOST).contains(&limit) {
        Ok(limit)
    } else {
        Err(Refusal::value("limit", limit, format!("from 1 to {MOST}")).into())
    }
}

/// Limit and offset, checked.
fn window(limit: Option<i64>, cursor: Option<&str>) -> Result<(i64, i64), Problem> {
    let limit = page_limit(limit)?;
    let offset = match cursor {
        None => 0,
        Some(text) => text
            .parse()
            .ok()
            .filter(|offset| *offset >= 0)
            .ok_or_else(|| Refusal::value("cursor", text, "the `next` of the page before"))?,
    };
    Ok((limit, offset))
}

impl<T> Page<T> {
    /// The items, where the next page starts, and how many there are in all.
    pub fn new(items: Vec<T>, next: Option<String>, total: i64) -> Self {
        Self { items, next, total }
    }
}

/// Which sweeps.
#[derive(Debug, Default, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct Listing {
    /// Items of the page, from 1 to 1000; 100 if not given.
    pub limit: Option<i64>,
    /// The `next` of the page before.
    pub cursor: Option<String>,
    /// Only sweeps with this tag.
    pub tag: Option<String>,
    /// Which sweeps, such as `owner = "ada" and failed > 0 and melt_rate_m_per_day = 0.7`.
    pub filter: Option<String>,
    /// Sweeps in the trash, in place of the others; they are not filtered.
    #[serde(default)]
    pub trash: bool,
}

/// List sweeps, the newest first. A condition of the filter on a parameter holds for a sweep if the ranges of its
/// runs' parameters leave it possible that one of its runs fulfils the filter.
#[utoipa::path(
    get, path = "/sweeps", params(Listing),
    responses((status = 200, body = Page<Sweep>), (status = 400, body = Problem), (status = 422, body = Problem))
)]
pub async fn list(
    State(service): State<Service>,
    Asked(listing): Asked<Listing>,
) -> Result<Json<Page<Sweep>>, Problem> {
    Ok(Json(page(&mut *service.store.read().await?, &listing).await?))
}

/// A page of sweeps.
pub async fn page(connection: &mut Connection, listing: &Listing) -> Result<Page<Sweep>, Problem> {
    let (limit, offset) = window(listing.limit, listing.cursor.as_deref())?;
    let filter = listing.filter.as_deref();
    let filter = filter.map(|text| Filter::parse(text, &found::kind_in_sweeps)).transpose()?;
    let tagged = listing.tag.as_ref().map(|tag| Filter::Compare {
        column: "tag".into(),
        op: Comparison::Equal,
        literal: Literal::Text(tag.clone()),
    });
    let (rows, total) = match filter.into_iter().chain(tagged).collect::<Vec<_>>() {
        none if none.is_empty() => {
            queue::sweeps(connection, queue::Which { is_trash: listing.trash, limit, offset })
                .await?
        }
        _ if listing.trash => {
            let permitted = "no filter and no tag where the trash is listed";
            return Err(Refusal::value("trash", true, permitted).into());
        }
        all => {
            let filter = Filter::And(all);
            let mut facts = queue::facts(connection, Some(&filter), &[]).await?;
            facts.retain(|facts| {
                filter.resolve(&|column| facts.of_sweep(column)) != Resolved::Never
            });
            let numbers = facts.iter().map(|facts| facts.number);
            let shown: Vec<i64> = numbers.skip(offset as usize).take(limit as usize).collect();
            (queue::numbered(connection, &shown).await?, facts.len() as i64)
        }
    };
    let next =
        Some(offset.saturating_add(limit)).filter(|next| *next < total).map(|n| n.to_string());
    Ok(Page::new(Sweep::all(connection, rows).await?, next, total))
}

/// One sweep.
#[utoipa::path(
    get, path = "/sweeps/{id}", params(("id" = String, Path,)),
    responses((status = 200, body = Sweep), (status = 400, body = Problem), (status = 404, body = Problem))
)]
pub async fn one(
    State(service): State<Service>,
    Place(id): Place<String>,
    _: NothingAsked,
) -> Result<Json<Sweep>, Problem> {
    let mut tx = service.store.read().await?;
    let row = queue::sweep(&mut tx, &id).await?;
    let row = row.ok_or_else(|| Problem::not_found("sweep", &id))?;
    let sweep = Sweep::brief(&mut tx, row).await?;
    drop(tx);
    Ok(Json(sweep.whole().await?))
}
