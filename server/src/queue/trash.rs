//! The trash: deleted sweeps wait there and can be recovered for a time. Their runs stay known meanwhile, so
//! that whoever asks for the same ones gets them.

use super::verbs::move_chunks;
use super::{now_ms, settle};
use crate::domain::person::JANITOR;
use crate::domain::status::{Pending, Phase};
use crate::people;
use crate::store::Connection;
use sqlx::Row;
use std::time::Duration;

/// A sweep in the trash.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Trashed {
    /// Its number.
    pub number: i64,
    /// Its name.
    pub name: String,
    /// Who submitted it.
    pub owner: Option<String>,
}

/// Cancels what has no result yet and puts the sweep into the trash. Its idempotency key is free at once.
pub async fn trash(connection: &mut Connection, sweep: i64) -> sqlx::Result<()> {
    move_chunks(connection, sweep, "queued", Pending::Cancelled).await?;
    move_chunks(connection, sweep, "leased", Pending::Cancelled).await?;
    settle(connection, sweep).await?;
    sqlx::query("UPDATE sweeps SET trashed_ms = $1, idempotency_key = NULL WHERE sweep = $2")
        .bind(now_ms())
        .bind(sweep)
        .execute(connection)
        .await?;
    Ok(())
}

/// A sweep in the trash, by id.
pub async fn trashed(connection: &mut Connection, id: &str) -> sqlx::Result<Option<Trashed>> {
    let row = sqlx::query(
        "SELECT sweep, name, owner FROM sweeps \
         WHERE id = $1 AND trashed_ms IS NOT NULL AND phase <> 'deleted'",
    )
    .bind(id)
    .fetch_optional(connection)
    .await?;
    Ok(row.map(|row| Trashed {
        number: row.get("sweep"),
        name: row.get("name"),
        owner: row.get("owner"),
    }))
}

/// Takes a sweep out of the trash; what was cancelled when it was deleted stays so until it is resumed.
pub async fn recover(connection: &mut Connection, sweep: i64) -> sqlx::Result<()> {
    sqlx::query("UPDATE sweeps SET trashed_ms = NULL WHERE sweep = $1")
        .bind(sweep)
        .execute(connection)
        .await?;
    Ok(())
}

/// Deletes a sweep for good: nobody sees it any more, and what it holds is cleared away.
pub async fn delete(connection: &mut Connection, sweep: i64) -> sqlx::Result<()> {
    trash(connection, sweep).await?;
    super::set_phase(connection, sweep, Phase::Deleted).await
}

/// Deletes for good what has lain in the trash for longer than is kept; how many sweeps that were.
pub async fn empty(connection: &mut Connection, kept: Duration) -> sqlx::Result<usize> {
    let kept_ms = i64::try_from(kept.as_millis()).unwrap_or(i64::MAX);
    let gone: Vec<(String, String)> = sqlx::query_as(
        "UPDATE sweeps SET phase = 'deleted' WHERE trashed_ms <= $1 AND phase <> 'deleted' \
         RETURNING id, name",
    )
    .bind(now_ms().saturating_sub(kept_ms))
    .fetch_all(&mut *connection)
    .await?;
    for (id, name) in &gone {
        people::audit(connection, JANITOR, "delete for good", id, Some(name)).await?;
    }
    Ok(gone.len())
}

/// Whether anything lies in the trash for longer than is kept.
pub async fn is_due(connection: &mut Connection, kept: Duration) -> sqlx::Result<bool> {
    let kept_ms = i64::try_from(kept.as_millis()).unwrap_or(i64::MAX);
    sqlx::query_scalar(
        "SELECT EXISTS (SELECT 1 FROM sweeps WHERE trashed_ms <= $1 AND phase <> 'deleted')",
    )
    .bind(now_ms().saturating_sub(kept_ms))
    .fetch_one(connection)
    .await
}
