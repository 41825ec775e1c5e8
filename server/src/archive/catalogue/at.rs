//! Runs of a sweep by their indices, with where their tables stand.

use super::{Entry, entry, place};
use crate::archive::ArchiveError;
use crate::store::Connection;
use sqlx::{QueryBuilder, Row, Sqlite};
use std::collections::HashMap;
use std::collections::hash_map;

/// The ended runs of a sweep that have these indices, by index.
pub async fn runs_at(
    connection: &mut Connection,
    sweep: i64,
    indices: &[i64],
) -> Result<HashMap<i64, Entry>, ArchiveError> {
    /// Indices per statement.
    const AT_ONCE: usize = 500;
    let mut places = HashMap::new();
    let mut entries = HashMap::with_capacity(indices.len());
    for indices in indices.chunks(AT_ONCE) {
        let mut query = QueryBuilder::<Sqlite>::new("SELECT * FROM runs WHERE sweep = ");
        query.push_bind(sweep).push(" AND run_index IN (");
        let mut list = query.separated(", ");
        indices.iter().for_each(|index| {
            list.push_bind(*index);
        });
        query.push(")");
        for row in query.build().fetch_all(&mut *connection).await? {
            let home: (i64, i64) = (row.get("home_sweep"), row.get("home_chunk"));
            let places = match places.entry(home) {
                hash_map::Entry::Occupied(known) => known.into_mut(),
                hash_map::Entry::Vacant(none) => {
                    none.insert(place::of_home(connection, home.0, home.1).await?)
                }
            };
            entries.insert(row.get("run_index"), entry(&row, places.clone())?);
        }
    }
    Ok(entries)
}
