//! Puts the many files of a sweep that has ended together: one file per table. Readers see the old files or
//! the new one, never half of it.

use super::catalogue::{self, Place};
use super::files::{self, Written};
use super::schema::Kind;
use super::{ArchiveError, bulk};
use crate::store::Store;
use uuid::Uuid;

/// A table put together: the new file, and each chunk with its place before and its first row now.
struct Table {
    written: Written,
    chunks: Vec<(i64, Place, i64)>,
}

/// Puts a sweep's files together; how many files fewer there are. What a chunk that ended meanwhile
/// changes is left for the next time.
pub async fn compact(store: &Store, sweep: i64, sweep_id: &str) -> Result<usize, ArchiveError> {
    let in_use = store.files_in_use().await;
    let mut plan = Vec::new();
    let mut tx = store.read().await?;
    for kind in Kind::ALL {
        let parts = catalogue::parts(&mut tx, sweep, kind).await?;
        let is_one = parts.windows(2).all(|w| w[0].1.file.path == w[1].1.file.path);
        if !is_one {
            plan.push((kind, parts));
        }
    }
    drop(tx);
    let archive = store.archive();
    let id = sweep_id.to_owned();
    let tables = tokio::task::spawn_blocking(move || {
        let _in_use = in_use;
        let token = Uuid::now_v7().simple().to_string();
        let mut tables: Vec<Table> = Vec::with_capacity(plan.len());
        for (kind, parts) in plan {
            let path = files::path_of(&id, "all", &token, kind);
            let (chunks, places): (Vec<i64>, Vec<Place>) = parts.into_iter().unzip();
            match bulk::put_together(&archive, &path, kind, &places) {
                Ok((written, first_rows)) => {
                    let chunks = chunks.into_iter().zip(places).zip(first_rows);
                    let chunks = chunks.map(|((chunk, place), first)| (chunk, place, first));
                    tables.push(Table { written, chunks: chunks.collect() });
                }
                Err(error) => {
                    files::remove(&archive, tables.iter().map(|t| t.written.path.as_str()));
                    return Err(error);
                }
            }
        }
        Ok(tables)
    })
    .await??;
    let unused = list(store, sweep, &tables).await;
    let written = || tables.iter().map(|t| t.written.path.clone());
    let paths: Vec<String> = match &unused {
        Ok(Some(paths)) => paths.clone(),
        // The sweep has changed.
        Ok(None) => written().collect(),
        // A commit that failed may have happened. What is not known stays until the next start.
        Err(_) => match catalogue::all_files(&mut *store.read().await?).await {
            Ok(listed) => written().filter(|w| listed.iter().all(|l| l.path != *w)).collect(),
            Err(_) => Vec::new(),
        },
    };
    let (alone, archive) = (store.files_to_remove().await, store.archive());
    tokio::task::spawn_blocking(move || {
        let _alone = alone;
        files::remove(&archive, paths.iter().map(String::as_str));
    })
    .await?;
    Ok(unused?.map_or(0, |paths| paths.len().saturating_sub(tables.len())))
}

/// Lists the new files in place of the old ones; the paths that are not used any more, or none if the sweep
/// has other parts than those that were put together.
async fn list(
    store: &Store,
    sweep: i64,
    tables: &[Table],
) -> Result<Option<Vec<String>>, ArchiveError> {
    let mut tx = store.write().await?;
    for Table { written, chunks } in tables {
        let now = catalogue::parts(&mut tx, sweep, written.kind).await?;
        let before = chunks.iter().map(|(chunk, place, _)| (*chunk, place));
        if !now.iter().map(|(chunk, place)| (*chunk, place)).eq(before) {
            return Ok(None);
        }
        catalogue::insert_file(&mut tx, written).await?;
        for (chunk, place, first_row) in chunks {
            catalogue::place_in(&mut tx, sweep, *chunk, written, *first_row, place.row_count)
                .await?;
        }
    }
    let unused = catalogue::drop_unused_files(&mut tx).await?;
    catalogue::compacted(&mut tx, sweep).await?;
    tx.commit().await?;
    Ok(Some(unused))
}
