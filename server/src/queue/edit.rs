//! What people call a sweep by, changed.

use super::verbs::VerbError;
use super::{SweepRow, refuse_if_sealed};
use crate::domain::label::Edit;
use crate::domain::status::Phase;
use crate::store::Connection;

/// Changes name, tags, note and priority of a sweep, within the caller's transaction. The one place where a
/// sweep's state can refuse this.
pub async fn edit(
    connection: &mut Connection,
    sweep: &SweepRow,
    edit: &Edit,
) -> Result<(), VerbError> {
    if sweep.phase == Phase::Deleted {
        return Err(VerbError::State("this sweep is deleted".into()));
    }
    refuse_if_sealed(connection, sweep.number).await?;
    if let Some(name) = &edit.name {
        sqlx::query("UPDATE sweeps SET name = $1 WHERE sweep = $2")
            .bind(name)
            .bind(sweep.number)
            .execute(&mut *connection)
            .await?;
    }
    if let Some(note) = &edit.note {
        sqlx::query("UPDATE sweeps SET note = $1 WHERE sweep = $2")
            .bind(note.as_deref().filter(|note| !note.is_empty()))
            .bind(sweep.number)
            .execute(&mut *connection)
            .await?;
    }
    if let Some(priority) = edit.priority {
        sqlx::query("UPDATE sweeps SET priority = $1 WHERE sweep = $2")
            .bind(priority)
            .bind(sweep.number)
            .execute(&mut *connection)
            .await?;
    }
    if let Some(tags) = &edit.tags {
        sqlx::query("DELETE FROM tags WHERE sweep = $1")
            .bind(sweep.number)
            .execute(&mut *connection)
            .await?;
        for tag in tags {
            sqlx::query("INSERT INTO tags (sweep, tag) VALUES ($1, $2)")
                .bind(sweep.number)
                .bind(tag)
                .execute(&mut *connection)
                .await?;
        }
    }
    Ok(())
}
