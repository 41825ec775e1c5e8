//! People, and what shows who they are: tokens and the sessions that browsers open with them. Of both only
//! hashes are kept. Tokens carry 256 random bits, so that a plain hash is enough: there is nothing to guess
//! that a slow one would protect.

use super::{Unfit, now};
use crate::domain::person::{Actor, Role, check_name};
use crate::domain::refusal::Refusal;
use crate::store::Connection;
use serde::{Deserialize, Serialize};
use sqlx::Row;
use sqlx::sqlite::SqliteRow;
use std::time::{Duration, SystemTime};
use utoipa::ToSchema;

/// How long a browser stays logged in.
pub const SESSION: Duration = Duration::from_secs(30 * 24 * 3600);
/// How a token begins, so that it is known for what it is where it should not be.
const PREFIX: &str = "melange_";

/// What a person may have.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct Quota {
    /// Most runs of all their sweeps together, but for those in the trash; null for no limit.
    pub most_runs: Option<i64>,
    /// Most runs of theirs that wait or are under way; null for no limit.
    pub most_pending_runs: Option<i64>,
}

impl Quota {
    /// Whether its numbers are permitted.
    pub fn check(&self) -> Result<(), Refusal> {
        for (field, limit) in
            [("most_runs", self.most_runs), ("most_pending_runs", self.most_pending_runs)]
        {
            if let Some(limit) = limit.filter(|limit| *limit < 0) {
                return Err(Refusal::value(field, limit, "0 or more; null for no limit"));
            }
        }
        Ok(())
    }
}

/// A person.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
pub struct Person {
    /// Their name.
    pub name: String,
    /// What they may do.
    pub role: Role,
    /// What they may have.
    #[serde(flatten)]
    pub quota: Quota,
    /// When they were added, RFC 3339 in UTC.
    pub created_at: String,
    /// Since when their token is no longer taken; null if it is.
    pub revoked_at: Option<String>,
}

/// A secret of 256 random bits.
pub fn secret() -> String {
    let mut bits = [0; 32];
    getrandom::fill(&mut bits).expect("the system has random numbers");
    bits.iter().fold(PREFIX.to_owned(), |text, byte| text + &format!("{byte:02x}"))
}

/// What is kept of a secret.
pub fn hash(secret: &str) -> String {
    blake3::Hasher::new_derive_key("melange 2026 tokens and sessions")
        .update(secret.as_bytes())
        .finalize()
        .to_hex()
        .to_string()
}

/// Whether there are or were people: then nobody is let in without a token.
pub async fn exist(connection: &mut Connection) -> sqlx::Result<bool> {
    sqlx::query_scalar("SELECT EXISTS (SELECT 1 FROM people)").fetch_one(connection).await
}

/// Adds a person and returns their token, which is nowhere to be found afterwards.
pub async fn add(
    connection: &mut Connection,
    name: &str,
    role: Role,
    quota: Quota,
) -> Result<String, Unfit> {
    check_name(name)?;
    quota.check()?;
    if one(connection, name).await?.is_some() {
        let sentence =
            format!("there is a person `{name}` already; a new token lets them in again");
        return Err(Unfit::State(sentence));
    }
    if role != Role::Admin && !exist(connection).await? {
        let permitted = "admin: the first person must be able to add the others";
        return Err(Refusal::value("role", role.name(), permitted).into());
    }
    let token = secret();
    sqlx::query(
        "INSERT INTO people (name, role, token_hash, created_at, most_runs, most_pending_runs) \
         VALUES ($1, $2, $3, $4, $5, $6)",
    )
    .bind(name)
    .bind(role.name())
    .bind(hash(&token))
    .bind(now())
    .bind(quota.most_runs)
    .bind(quota.most_pending_runs)
    .execute(connection)
    .await?;
    Ok(token)
}

/// Gives a person a new token in the place of the old one, also if that was revoked.
pub async fn renew(connection: &mut Connection, name: &str) -> Result<String, Unfit> {
    let token = secret();
    shut_out(connection, name).await?;
    sqlx::query("UPDATE people SET token_hash = $1, revoked_at = NULL WHERE name = $2")
        .bind(hash(&token))
        .bind(name)
        .execute(connection)
        .await?;
    Ok(token)
}

/// Takes a person's token and sessions; what they own stays theirs.
pub async fn revoke(connection: &mut Connection, name: &str) -> Result<(), Unfit> {
    shut_out(connection, name).await
}

async fn shut_out(connection: &mut Connection, name: &str) -> Result<(), Unfit> {
    sqlx::query("DELETE FROM sessions WHERE name = $1")
        .bind(name)
        .execute(&mut *connection)
        .await?;
    let changed = sqlx::query(
        "UPDATE people SET token_hash = NULL, revoked_at = COALESCE(revoked_at, $1) WHERE name = $2",
    )
    .bind(now())
    .bind(name)
    .execute(connection)
    .await?;
    if changed.rows_affected() == 0 { Err(Unfit::Nobody(name.to_owned())) } else { Ok(()) }
}

/// Says anew what a person may do and have.
pub async fn set(
    connection: &mut Connection,
    name: &str,
    role: Role,
    quota: Quota,
) -> Result<(), Unfit> {
    quota.check()?;
    let changed = sqlx::query(
        "UPDATE people SET role = $1, most_runs = $2, most_pending_runs = $3 WHERE name = $4",
    )
    .bind(role.name())
    .bind(quota.most_runs)
    .bind(quota.most_pending_runs)
    .bind(name)
    .execute(connection)
    .await?;
    if changed.rows_affected() == 0 { Err(Unfit::Nobody(name.to_owned())) } else { Ok(()) }
}

/// All people by name, those whose token was revoked among them.
pub async fn all(connection: &mut Connection) -> sqlx::Result<Vec<Person>> {
    let rows = sqlx::query("SELECT * FROM people ORDER BY name").fetch_all(connection).await?;
    Ok(rows.iter().map(person).collect())
}

/// A person by name.
pub async fn one(connection: &mut Connection, name: &str) -> sqlx::Result<Option<Person>> {
    let row = sqlx::query("SELECT * FROM people WHERE name = $1")
        .bind(name)
        .fetch_optional(connection)
        .await?;
    Ok(row.as_ref().map(person))
}

fn person(row: &SqliteRow) -> Person {
    Person {
        name: row.get("name"),
        role: role(row),
        quota: Quota {
            most_runs: row.get("most_runs"),
            most_pending_runs: row.get("most_pending_runs"),
        },
        created_at: row.get("created_at"),
        revoked_at: row.get("revoked_at"),
    }
}

/// The database lets no other names in; one that were there all the same would be that of who may least.
fn role(row: &SqliteRow) -> Role {
    Role::from_name(row.get("role")).unwrap_or(Role::Reader)
}

/// Whose token has this hash.
pub async fn of_token(connection: &mut Connection, hash: &str) -> sqlx::Result<Option<Actor>> {
    let row = sqlx::query("SELECT name, role FROM people WHERE token_hash = $1")
        .bind(hash)
        .fetch_optional(connection)
        .await?;
    Ok(row.map(|row| Actor { role: role(&row), name: row.get("name") }))
}

/// Whose session has this hash.
pub async fn of_session(connection: &mut Connection, hash: &str) -> sqlx::Result<Option<Actor>> {
    let row = sqlx::query(
        "SELECT p.name, p.role FROM sessions s JOIN people p ON p.name = s.name \
         WHERE s.session_hash = $1 AND s.expires_ms > $2 AND p.token_hash IS NOT NULL",
    )
    .bind(hash)
    .bind(ms(SystemTime::now()))
    .fetch_optional(connection)
    .await?;
    Ok(row.map(|row| Actor { role: role(&row), name: row.get("name") }))
}

/// Opens a session for a person and returns its secret; those that have expired are cleared away.
pub async fn open_session(connection: &mut Connection, name: &str) -> sqlx::Result<String> {
    let now = SystemTime::now();
    sqlx::query("DELETE FROM sessions WHERE expires_ms <= $1")
        .bind(ms(now))
        .execute(&mut *connection)
        .await?;
    let secret = secret();
    sqlx::query("INSERT INTO sessions (session_hash, name, expires_ms) VALUES ($1, $2, $3)")
        .bind(hash(&secret))
        .bind(name)
        .bind(ms(now + SESSION))
        .execute(connection)
        .await?;
    Ok(secret)
}

/// Ends a session; whose it was.
pub async fn close_session(
    connection: &mut Connection,
    hash: &str,
) -> sqlx::Result<Option<String>> {
    sqlx::query_scalar("DELETE FROM sessions WHERE session_hash = $1 RETURNING name")
        .bind(hash)
        .fetch_optional(connection)
        .await
}

/// Ends all sessions.
pub async fn close_all_sessions(connection: &mut Connection) -> sqlx::Result<()> {
    sqlx::query("DELETE FROM sessions").execute(connection).await?;
    Ok(())
}

/// What a person may do and have, in a line for the audit trail.
pub fn detail(role: Role, quota: Quota) -> String {
    let limit = |runs: Option<i64>| runs.map_or_else(|| "any".to_owned(), |runs| runs.to_string());
    let (runs, pending) = (limit(quota.most_runs), limit(quota.most_pending_runs));
    format!("{}, {runs} runs, {pending} pending", role.name())
}

fn ms(time: SystemTime) -> i64 {
    let since = time.duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
    i64::try_from(since.as_millis()).unwrap_or(i64::MAX)
}
