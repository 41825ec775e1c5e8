//! `melange health`: whether a service is up, for containers and supervisors that have nothing else to ask with.

use crate::client::Client;
use std::process::ExitCode;
use std::time::Duration;

/// Arguments of `melange health`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Address of the service.
    #[arg(long, default_value = "http://127.0.0.1:8080")]
    url: String,
    /// Seconds within which it is to answer.
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=600))]
    timeout_s: u32,
}

/// Exit code of a service that is not up.
const DOWN: u8 = 1;

/// Asks the service.
pub async fn main(arguments: Arguments) -> anyhow::Result<ExitCode> {
    let Arguments { url, timeout_s } = arguments;
    let longest = Duration::from_secs(timeout_s.into());
    let address = url.trim_end_matches('/').to_owned();
    let asked = tokio::task::spawn_blocking(move || Client::impatient(address, longest).health());
    match asked.await? {
        Ok(health) if health["status"] == "ok" => {
            let told = |name: &str| health[name].to_string().replace('"', "");
            println!("up: version {}, {} sweeps", told("version"), told("sweeps"));
            Ok(ExitCode::SUCCESS)
        }
        Ok(_) => {
            eprintln!("down: what answers at {url} is no melange");
            Ok(ExitCode::from(DOWN))
        }
        Err(error) => {
            eprintln!("down: {error:#}");
            Ok(ExitCode::from(DOWN))
        }
    }
}
