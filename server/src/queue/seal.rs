//! Seals, as the queue sees them: a sealed sweep never changes again.

use super::VerbError;
use crate::store::Connection;

/// Refuses to change a sealed sweep. Whatever changes a sweep asks here first, within its own transaction.
pub async fn refuse_if_sealed(connection: &mut Connection, sweep: i64) -> Result<(), VerbError> {
    let sealed: Option<String> =
        sqlx::query_scalar("SELECT content_hash FROM seals WHERE sweep = $1")
            .bind(sweep)
            .fetch_optional(connection)
            .await?;
    match sealed {
        None => Ok(()),
        Some(hash) => Err(VerbError::State(format!(
            "this sweep is sealed as {hash}, and a sealed sweep never changes again"
        ))),
    }
}
