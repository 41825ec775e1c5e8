//! `melange`, the ensemble service for ice mélange. Rooms in the order data flows through them;
//! ARCHITECTURE.md says who may import whom, and a test keeps it true.

mod domain;
mod worker;
mod cli;

use std::process::ExitCode;

#[tokio::main]
async fn main() -> ExitCode {
    match cli::main().await {
        Ok(code) => code,
        Err(error) => {
            eprintln!("melange: {error:#}");
            ExitCode::FAILURE
        }
    }
}
