//! `melange columns`: every column of every table, as the schema has it.

use crate::archive::columns::{markdown, tables};
use clap::ValueEnum;
use std::process::ExitCode;

/// Arguments of `melange columns`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// How they are printed; `docs/columns.md` is the former.
    #[arg(long, value_enum, default_value_t = Format::Markdown)]
    format: Format,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Format {
    Markdown,
    Json,
}

/// Prints the dictionary.
pub fn main(arguments: &Arguments) -> anyhow::Result<ExitCode> {
    match arguments.format {
        Format::Markdown => print!("{}", markdown()),
        Format::Json => println!("{}", serde_json::to_string_pretty(&tables())?),
    }
    Ok(ExitCode::SUCCESS)
}
