//! What is done beside the solving: deleted sweeps are cleared away, the files of sweeps that have ended
//! are put together. All of it can be killed at any moment and goes on at the next start.

use crate::archive::{catalogue, compact, files};
use crate::queue;
use crate::store::Store;
use std::collections::HashSet;
use std::time::Duration;
use tokio_util::sync::CancellationToken;

/// Pause after a change, so that a sweep's end is answered before its files are put together.
const AFTER_A_CHANGE: Duration = Duration::from_millis(500);
/// Longest that nobody looks into the trash.
const LONGEST_SLEEP: Duration = Duration::from_secs(600);
/// Pause after trouble.
const AFTER_TROUBLE: Duration = Duration::from_secs(10);
/// Runs removed in one transaction: others write in between.
const RUNS_AT_ONCE: i64 = 5_000;

/// Works until told to stop; deleted sweeps are kept for a time.
pub async fn work(store: &Store, kept: Duration, stop: &CancellationToken) {
    let mut changes = store.changes();
    // Sweeps whose files cannot be put together, since one is damaged; tried again at the next start.
    let mut given_up = HashSet::new();
    while !stop.is_cancelled() {
        changes.mark_unchanged();
        let pause = match tidy(store, kept, stop, &mut given_up).await {
            Ok(()) => AFTER_A_CHANGE,
            Err(error) => {
                tracing::error!("cannot clear up: {error:#}");
                AFTER_TROUBLE
            }
        };
        let changed = async {
            if pause == AFTER_A_CHANGE {
                // What lies in the trash comes of age without a change.
                tokio::time::timeout(LONGEST_SLEEP, changes.changed()).await.ok();
            }
            tokio::time::sleep(pause).await;
        };
        tokio::select! {
            () = stop.cancelled() => {}
            () = changed => {}
        }
    }
}

async fn tidy(
    store: &Store,
    kept: Duration,
    stop: &CancellationToken,
    given_up: &mut HashSet<i64>,
) -> anyhow::Result<()> {
    if queue::is_due(&mut *store.read().await?, kept).await? {
        let mut tx = store.write().await?;
        let sweeps = queue::empty(&mut tx, kept).await?;
        tx.commit().await?;
        tracing::info!(sweeps, "the trash was emptied of what lay there long enough");
    }
    let deleted = queue::deleted(&mut *store.read().await?).await?;
    for (sweep, id) in deleted {
        let mut tx = store.read().await?;
        let waits = catalogue::guests_of(&mut tx, sweep).await?
            && catalogue::count_stored(&mut tx, sweep).await? == 0;
        drop(tx);
        if !waits {
            clear_away(store, stop, sweep, &id).await?;
        }
    }
    let waiting = catalogue::waiting_for_compaction(&mut *store.read().await?).await?;
    let mut trouble = Ok(());
    for (sweep, id) in waiting {
        if stop.is_cancelled() {
            break;
        }
        if given_up.contains(&sweep) {
            continue;
        }
        match compact::compact(store, sweep, &id).await {
            Ok(0) => {}
            Ok(fewer) => tracing::info!(sweep = id, fewer, "put the sweep's files together"),
            // What is lost stays so; other trouble may pass.
            Err(error) if error.is_loss() => {
                tracing::error!(sweep = id, "cannot put the sweep's files together: {error}");
                given_up.insert(sweep);
            }
            Err(error) => trouble = Err(error.into()),
        }
    }
    trouble
}

/// Removes a deleted sweep's runs, and its files when no other sweep's runs live in them.
async fn clear_away(
    store: &Store,
    stop: &CancellationToken,
    sweep: i64,
    id: &str,
) -> anyhow::Result<()> {
    loop {
        if stop.is_cancelled() {
            return Ok(());
        }
        let mut tx = store.write().await?;
        let removed = catalogue::clear_runs(&mut tx, sweep, RUNS_AT_ONCE).await?;
        if removed > 0 {
            tx.commit().await?;
            continue;
        }
        if catalogue::guests_of(&mut tx, sweep).await? {
            tx.commit().await?;
            return Ok(());
        }
        catalogue::drop_homes(&mut tx, sweep).await?;
        let unused = catalogue::drop_unused_files(&mut tx).await?;
        queue::forget(&mut tx, sweep).await?;
        tx.commit().await?;
        tracing::info!(sweep = id, files = unused.len(), "clears a deleted sweep away");
        let alone = store.files_to_remove().await;
        let (archive, id) = (store.archive(), id.to_owned());
        tokio::task::spawn_blocking(move || {
            let _alone = alone;
            files::remove(&archive, unused.iter().map(String::as_str));
            files::remove_folder(&archive, &id);
        })
        .await?;
        return Ok(());
    }
}
