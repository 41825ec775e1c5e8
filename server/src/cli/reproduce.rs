//! `melange reproduce`: the paper's claims beside what comes out.

use crate::reproduce::reproduce;
use anyhow::Context;
use clap::ValueEnum;
use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;

/// Arguments of `melange reproduce`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Folder for the figures' data and the tables, as CSV, and the document.
    #[arg(long)]
    out: Option<PathBuf>,
    /// How the claims are printed.
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Format {
    Text,
    Json,
    Markdown,
}

/// Runs the experiments and prints the claims.
pub async fn main(arguments: &Arguments) -> anyhow::Result<ExitCode> {
    let report = tokio::task::spawn_blocking(reproduce).await??;
    if let Some(folder) = &arguments.out {
        let context = || format!("cannot write to {}", folder.display());
        report.write(folder).with_context(context)?;
    }
    let shown = match arguments.format {
        Format::Text => report.as_text(),
        Format::Json => serde_json::to_string(&report)? + "\n",
        Format::Markdown => report.as_markdown(),
    };
    std::io::stdout().write_all(shown.as_bytes()).context("cannot write the claims")?;
    Ok(ExitCode::SUCCESS)
}
