//! How commands reach a data directory: through the service that holds it, with the token that it leaves in
//! the directory for them, or by themselves.

use crate::client::{Client, Refused};
use crate::store::{self, Holder};
use std::path::Path;
use std::process::ExitCode;

/// Exit code of what is refused.
pub const REFUSED: u8 = 2;
/// Where a token is taken from if the directory does not show it.
const TOKEN: &str = "MELANGE_TOKEN";

/// The way to a data directory.
#[derive(Debug)]
pub enum Reach {
    /// A service holds it.
    Service(Client),
    /// Nobody who answers does.
    Directory,
}

impl Reach {
    /// The way to a data directory.
    pub fn of(data: &Path) -> Self {
        match store::holder_of(data) {
            Holder::Service(address) => {
                let client = Client::new(address);
                let token = store::operator_token(data).or_else(|| std::env::var(TOKEN).ok());
                Self::Service(match token {
                    Some(token) => client.with_token(token),
                    None => client,
                })
            }
            Holder::Nobody | Holder::Command => Self::Directory,
        }
    }
}

/// Asks a service, off the threads that must not wait.
pub async fn ask<T: Send + 'static>(
    asking: impl FnOnce() -> anyhow::Result<T> + Send + 'static,
) -> anyhow::Result<T> {
    tokio::task::spawn_blocking(asking).await?
}

/// Prints what was told; a refusal is printed as such, with an exit code of its own.
pub fn told<T>(told: anyhow::Result<T>, print: impl FnOnce(T)) -> anyhow::Result<ExitCode> {
    use crate::people::Unfit;
    match told {
        Ok(told) => {
            print(told);
            Ok(ExitCode::SUCCESS)
        }
        Err(error) => {
            let is_refusal = error.is::<Refused>()
                || error.downcast_ref::<Unfit>().is_some_and(|e| !matches!(e, Unfit::Database(_)));
            if !is_refusal {
                return Err(error);
            }
            eprintln!("refused: {error}");
            Ok(ExitCode::from(REFUSED))
        }
    }
}
