//! `melange`, the ensemble service for ice mélange. Rooms in the order data flows through them;
//! ARCHITECTURE.md says who may import whom, and a test keeps it true.

mod analysis;
mod archive;
mod cli;
mod client;
mod domain;
mod faults;
mod http;
mod queue;
mod reproduce;
mod soak;
mod store;
mod worker;

use std::process::ExitCode;

/// Exit code of input or surroundings that cannot be used.
const UNUSABLE: u8 = 2;

#[tokio::main]
async fn main() -> ExitCode {
    match cli::main().await {
        Ok(code) => code,
        Err(error) => {
            eprintln!("melange: {error:#}");
            ExitCode::from(UNUSABLE)
        }
    }
}
