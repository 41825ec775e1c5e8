//! `melange verify` and `melange backup`: whether a data directory is what it says, and a copy of it.

use crate::archive::verify::{Findings, take_out_damaged, verify};
use crate::archive::{backup, catalogue, files};
use crate::queue;
use crate::store::{Holder, Onlooker, Store, holder_of};
use anyhow::bail;
use clap::ValueEnum;
use std::path::PathBuf;
use std::process::ExitCode;

/// Arguments of `melange verify`.
#[derive(Debug, clap::Args)]
pub struct VerifyArguments {
    /// Data directory.
    #[arg(long, default_value = "melange-data")]
    data: PathBuf,
    /// Remove what nobody lists, and queue the runs again that stand in missing or damaged files.
    #[arg(long)]
    repair: bool,
    /// How the findings are printed.
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
}

/// Arguments of `melange backup`.
#[derive(Debug, clap::Args)]
pub struct BackupArguments {
    /// Data directory; it may be in use.
    #[arg(long, default_value = "melange-data")]
    data: PathBuf,
    /// Folder for the copy, which must not exist or be empty.
    #[arg(long)]
    to: PathBuf,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Format {
    Text,
    Json,
}

/// Exit code of a data directory that is not as it should be.
const FOUND: u8 = 1;

/// Verifies a data directory, and repairs it if asked.
pub async fn verify_main(arguments: &VerifyArguments) -> anyhow::Result<ExitCode> {
    let data = &arguments.data;
    if holder_of(data) != Holder::Nobody {
        // What moves while it is looked at would look like damage.
        bail!(
            "the data directory {} is in use: verify it when its service is stopped, or verify a copy \
             made by `melange backup`",
            data.display()
        );
    }
    let findings = if arguments.repair {
        let store = Store::open_existing(data).await?;
        queue::reclaim(&store).await?;
        let findings = verify(&mut *store.read().await?, &store.archive()).await?;
        repair(&store, &findings).await?;
        store.close().await;
        findings
    } else {
        let onlooker = Onlooker::open(data).await?;
        verify(&mut *onlooker.read().await?, &onlooker.archive()).await?
    };
    match arguments.format {
        Format::Json => println!("{}", serde_json::to_string(&findings)?),
        Format::Text => print!("{}", text(&findings, arguments.repair)),
    }
    let is_fine = findings.is_clean()
        || (arguments.repair
            && findings.contradictions.is_empty()
            && findings.unreadable.is_empty());
    Ok(if is_fine { ExitCode::SUCCESS } else { ExitCode::from(FOUND) })
}

fn text(findings: &Findings, repaired: bool) -> String {
    let mut text = format!("{} files, {} bytes\n", findings.files, findings.bytes);
    for (_, sentence) in &findings.damaged {
        let done = if repaired { "; its runs are queued again" } else { "" };
        text += &format!("damaged: {sentence}{done}\n");
    }
    for (_, sentence) in &findings.unreadable {
        text += &format!("cannot be read here: {sentence}\n");
    }
    for path in &findings.orphans {
        let done = if repaired { "; removed" } else { "" };
        text += &format!("listed by nobody: {path}{done}\n");
    }
    for sentence in &findings.contradictions {
        text += &format!("contradiction: {sentence}\n");
    }
    if findings.is_clean() {
        text += "everything is as it should be\n";
    }
    text
}

/// Removes orphans and queues the runs of damaged files again.
async fn repair(store: &Store, findings: &Findings) -> anyhow::Result<()> {
    let mut tx = store.write().await?;
    for lost in take_out_damaged(&mut tx, &findings.damaged).await? {
        queue::requeue(&mut tx, lost.sweep, &lost.taken).await?;
    }
    let unused = catalogue::drop_unused_files(&mut tx).await?;
    tx.commit().await?;
    let paths = unused.iter().chain(&findings.orphans).map(String::as_str);
    files::remove_if_there(&store.archive(), paths);
    Ok(())
}

/// Copies a data directory.
pub async fn backup_main(arguments: &BackupArguments) -> anyhow::Result<ExitCode> {
    let copied = backup::backup(&arguments.data, &arguments.to).await?;
    println!("{} files, {} bytes copied to {}", copied.files, copied.bytes, arguments.to.display());
    Ok(ExitCode::SUCCESS)
}
