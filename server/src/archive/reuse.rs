//! How many of a sweep's runs the archive knows already.

use super::{ArchiveError, catalogue};
use crate::domain::sweep::SweepSpec;
use crate::store::Store;
use std::sync::Arc;

/// Runs looked up at once.
const AT_ONCE: usize = 10_000;

/// Runs of a sweep that have a result which did not fail.
pub async fn found(store: &Store, sweep: &Arc<SweepSpec>) -> Result<usize, ArchiveError> {
    let mut found = 0;
    if catalogue::is_empty(&mut *store.read().await?).await? {
        return Ok(0);
    }
    for first in (0..sweep.count()).step_by(AT_ONCE) {
        let spec = sweep.clone();
        let ids: Vec<String> = tokio::task::spawn_blocking(move || {
            (first..spec.count().min(first + AT_ONCE)).map(|i| spec.run(i).id()).collect()
        })
        .await?;
        let known = catalogue::known(&mut *store.read().await?, &ids).await?;
        found += ids.iter().filter(|id| known.contains(*id)).count();
    }
    Ok(found)
}
