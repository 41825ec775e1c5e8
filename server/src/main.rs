//! `melange`, the ensemble service for ice mélange. Rooms in the order data flows through them;
//! ARCHITECTURE.md says who may import whom, and a test keeps it true.

mod analysis;
mod archive;
mod cli;
mod client;
mod domain;
mod faults;
mod http;
mod people;
mod queue;
mod reproduce;
mod soak;
mod store;
mod telemetry;
mod worker;

use std::process::ExitCode;

/// Exit code of input or surroundings that cannot be used.
const UNUSABLE: u8 = 2;

fn main() -> ExitCode {
    let runtime = match tokio::runtime::Runtime::new() {
        Ok(runtime) => runtime,
        Err(error) => {
            eprintln!("melange: cannot start its threads: {error}");
            return ExitCode::from(UNUSABLE);
        }
    };
    let ended = runtime.block_on(cli::main());
    // A table that is still put together for a client who was cut off is not waited for.
    runtime.shutdown_background();
    match ended {
        Ok(code) => code,
        Err(error) => {
            eprintln!("melange: {error:#}");
            ExitCode::from(UNUSABLE)
        }
    }
}
