//! Who solved a chunk and when; and which runs are to be solved again for comparison.

use super::{Entry, Place, entry};
use crate::archive::ArchiveError;
use crate::archive::schema::Kind;
use crate::domain::provenance::Provenance;
use crate::store::Connection;
use sqlx::{QueryBuilder, Row, Sqlite};
use std::time::SystemTime;

/// Says that a chunk's runs come from the program and host of one of them.
pub async fn insert_solved(
    connection: &mut Connection,
    sweep: i64,
    chunk: i64,
    of: &Provenance,
) -> sqlx::Result<()> {
    let (Some(model), Some(program), Some(host)) =
        (&of.model_version, &of.program_version, &of.host_class)
    else {
        return Ok(());
    };
    // Nearly always it is known.
    let find = "SELECT number FROM provenances \
                WHERE model_version = $1 AND program_version = $2 AND host_class = $3";
    let find = || sqlx::query_scalar::<_, i64>(find).bind(model).bind(program).bind(host);
    let number = match find().fetch_optional(&mut *connection).await? {
        Some(number) => number,
        None => {
            sqlx::query(
                "INSERT INTO provenances (number, model_version, program_version, host_class) \
                 SELECT COALESCE(MAX(number), 0) + 1, $1, $2, $3 FROM provenances",
            )
            .bind(model)
            .bind(program)
            .bind(host)
            .execute(&mut *connection)
            .await?;
            find().fetch_one(&mut *connection).await?
        }
    };
    let solved_at = humantime::format_rfc3339_millis(SystemTime::now()).to_string();
    sqlx::query(
        "INSERT INTO solved (sweep, chunk, provenance, solved_at) VALUES ($1, $2, $3, $4) \
         ON CONFLICT (sweep, chunk) DO UPDATE SET provenance = $3, solved_at = $4",
    )
    .bind(sweep)
    .bind(chunk)
    .bind(number)
    .bind(solved_at)
    .execute(connection)
    .await?;
    Ok(())
}

/// What is known of who solved the runs of a chunk.
pub async fn solved_by(
    connection: &mut Connection,
    home: (i64, i64),
) -> sqlx::Result<Option<Provenance>> {
    let row = sqlx::query(
        "SELECT p.model_version, p.program_version, p.host_class, s.solved_at \
         FROM solved s JOIN provenances p ON p.number = s.provenance \
         WHERE s.sweep = $1 AND s.chunk = $2",
    )
    .bind(home.0)
    .bind(home.1)
    .fetch_optional(connection)
    .await?;
    Ok(row.map(|row| Provenance {
        model_version: row.get("model_version"),
        program_version: row.get("program_version"),
        host_class: row.get("host_class"),
        solved_at: row.get("solved_at"),
        ..Provenance::default()
    }))
}

/// A run's place in a sweep, and the chunk whose files hold its tables.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Address {
    /// Sweep and chunk whose files hold its tables.
    pub home: (i64, i64),
    /// Number of a sweep that it is a run of.
    pub sweep: i64,
    /// Its index there.
    pub run_index: i64,
}

/// Whether the database tells who solved what; an older one is brought up to date by whoever holds it.
pub async fn tells_provenance(connection: &mut Connection) -> bool {
    sqlx::query("SELECT 1 FROM solved LIMIT 1").fetch_optional(connection).await.is_ok()
}

/// Where a run is that [`super::run`] finds.
pub async fn address(connection: &mut Connection, run_id: &str) -> sqlx::Result<Option<Address>> {
    let row: Option<(i64, i64, i64, i64)> = sqlx::query_as(
        "SELECT home_sweep, home_chunk, sweep, run_index FROM runs WHERE run_id = $1 \
         ORDER BY status = 'failed', home_sweep DESC, home_chunk DESC LIMIT 1",
    )
    .bind(run_id)
    .fetch_optional(connection)
    .await?;
    Ok(row.map(|(sweep, chunk, of, run_index)| Address {
        home: (sweep, chunk),
        sweep: of,
        run_index,
    }))
}

/// Where all of a sweep's runs are, by home.
pub async fn addresses(connection: &mut Connection, sweep: i64) -> sqlx::Result<Vec<Address>> {
    let rows: Vec<(i64, i64, i64)> = sqlx::query_as(
        "SELECT home_sweep, home_chunk, run_index FROM runs WHERE sweep = $1 ORDER BY run_index",
    )
    .bind(sweep)
    .fetch_all(connection)
    .await?;
    let address = |(home_sweep, home_chunk, run_index)| Address {
        home: (home_sweep, home_chunk),
        sweep,
        run_index,
    };
    let mut addresses: Vec<Address> = rows.into_iter().map(address).collect();
    addresses.sort_unstable();
    Ok(addresses)
}

/// Where the tables of a chunk's runs stand.
pub async fn places_of(
    connection: &mut Connection,
    home: (i64, i64),
) -> sqlx::Result<Vec<(Kind, Place)>> {
    super::place::of_home(connection, home.0, home.1).await
}

/// Chunks of a sweep's own in whose files some of its runs are.
pub async fn chunks_of(
    connection: &mut Connection,
    sweep: i64,
    run_ids: &[String],
) -> sqlx::Result<Vec<i64>> {
    /// Ids per statement.
    const AT_ONCE: usize = 500;
    let mut chunks = Vec::new();
    for ids in run_ids.chunks(AT_ONCE) {
        let mut query =
            QueryBuilder::<Sqlite>::new("SELECT DISTINCT home_chunk FROM runs WHERE sweep = ");
        query.push_bind(sweep).push(" AND home_sweep = ").push_bind(sweep);
        query.push(" AND run_id IN (");
        let mut list = query.separated(", ");
        ids.iter().for_each(|id| {
            list.push_bind(id.clone());
        });
        query.push(")");
        chunks.extend(query.build_query_scalar::<i64>().fetch_all(&mut *connection).await?);
    }
    Ok(chunks)
}

/// Runs of one home, by index, with where their tables stand.
pub async fn entries(
    connection: &mut Connection,
    addresses: &[Address],
) -> Result<Vec<Entry>, ArchiveError> {
    /// Indices per statement.
    const AT_ONCE: usize = 500;
    let Some(first) = addresses.first() else { return Ok(Vec::new()) };
    let places = super::place::of_home(connection, first.home.0, first.home.1).await?;
    let mut entries = Vec::with_capacity(addresses.len());
    for addresses in addresses.chunks(AT_ONCE) {
        let mut query = QueryBuilder::<Sqlite>::new("SELECT * FROM runs WHERE sweep = ");
        query.push_bind(first.sweep).push(" AND run_index IN (");
        let mut list = query.separated(", ");
        for address in addresses {
            list.push_bind(address.run_index);
        }
        query.push(") ORDER BY run_index");
        for row in query.build().fetch_all(&mut *connection).await? {
            entries.push(entry(&row, places.clone())?);
        }
    }
    Ok(entries)
}
