//! People: who they are, what shows who they are, and what they changed. All SQL about people stands in this
//! folder. Knows neither sweeps nor transport.

mod audit;
mod tokens;

pub use audit::{Change, Which, audit, changes};
pub use tokens::{
    Person, Quota, SESSION, add, all, close_all_sessions, close_session, detail, exist, hash,
    of_session, of_token, one, open_session, renew, revoke, secret, set,
};

use crate::domain::refusal::Refusal;

/// What cannot be done with a person.
#[derive(Debug, thiserror::Error)]
pub enum Unfit {
    /// The database refused.
    #[error("people cannot be written: {0}")]
    Database(#[from] sqlx::Error),
    /// Bad input.
    #[error("{0}")]
    Refused(#[from] Refusal),
    /// There is nobody of this name.
    #[error("there is no person `{0}`")]
    Nobody(String),
    /// What is there does not allow it.
    #[error("{0}")]
    State(String),
}

/// Now, RFC 3339 in UTC.
fn now() -> String {
    humantime::format_rfc3339_millis(std::time::SystemTime::now()).to_string()
}
