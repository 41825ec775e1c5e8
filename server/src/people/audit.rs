//! The audit trail: every change, written in the transaction of the change itself.

use super::now;
use crate::store::Connection;
use serde::Serialize;
use sqlx::{QueryBuilder, Row, Sqlite};
use utoipa::ToSchema;

/// A change.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
pub struct Change {
    /// Its number, ascending in time.
    pub entry: i64,
    /// When, RFC 3339 in UTC.
    pub changed_at: String,
    /// Who.
    pub who: String,
    /// What was done, such as `submit`.
    pub action: String,
    /// On what, such as a sweep's id.
    pub subject: String,
    /// More about it.
    pub detail: Option<String>,
}

/// Which changes.
#[derive(Debug, Clone, Copy, Default)]
pub struct Which<'a> {
    /// Those on this subject.
    pub subject: Option<&'a str>,
    /// Those by this person.
    pub who: Option<&'a str>,
    /// Those before this entry.
    pub before: Option<i64>,
    /// At most so many.
    pub limit: i64,
}

/// Writes down a change, within the caller's transaction.
pub async fn audit(
    connection: &mut Connection,
    who: &str,
    action: &str,
    subject: &str,
    detail: Option<&str>,
) -> sqlx::Result<()> {
    sqlx::query(
        "INSERT INTO audit (entry, changed_at, who, action, subject, detail) \
         SELECT COALESCE(MAX(entry), 0) + 1, $1, $2, $3, $4, $5 FROM audit",
    )
    .bind(now())
    .bind(who)
    .bind(action)
    .bind(subject)
    .bind(detail)
    .execute(connection)
    .await?;
    Ok(())
}

/// Changes, the newest first.
pub async fn changes(connection: &mut Connection, which: Which<'_>) -> sqlx::Result<Vec<Change>> {
    let mut query = QueryBuilder::<Sqlite>::new(
        "SELECT entry, changed_at, who, action, subject, detail FROM audit WHERE entry < ",
    );
    query.push_bind(which.before.unwrap_or(i64::MAX));
    if let Some(subject) = which.subject {
        query.push(" AND subject = ").push_bind(subject.to_owned());
    }
    if let Some(who) = which.who {
        query.push(" AND who = ").push_bind(who.to_owned());
    }
    query.push(" ORDER BY entry DESC LIMIT ").push_bind(which.limit);
    let rows = query.build().fetch_all(connection).await?;
    let change = |row: &sqlx::sqlite::SqliteRow| Change {
        entry: row.get("entry"),
        changed_at: row.get("changed_at"),
        who: row.get("who"),
        action: row.get("action"),
        subject: row.get("subject"),
        detail: row.get("detail"),
    };
    Ok(rows.iter().map(change).collect())
}
