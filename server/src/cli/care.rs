//! `melange verify`, `melange backup` and `melange restore`: whether a data directory is what it says, a copy of it, and
//! a data directory of the copy.

use crate::archive::verify::{Findings, take_out_damaged, verify};
use crate::archive::{backup, catalogue, files, restore};
use crate::domain::person::Actor;
use crate::people;
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

/// Arguments of `melange restore`.
#[derive(Debug, clap::Args)]
pub struct RestoreArguments {
    /// Folder that `melange backup` made.
    #[arg(long)]
    from: PathBuf,
    /// Data directory to make, which must not exist or be empty.
    #[arg(long)]
    data: PathBuf,
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
    let mut sealed = Vec::new();
    let findings = if arguments.repair {
        let store = Store::open_existing(data).await?;
        queue::reclaim(&store).await?;
        let findings = verify(&mut *store.read().await?, &store.archive()).await?;
        sealed = repair(&store, &findings).await?;
        store.close().await;
        findings
    } else {
        let onlooker = Onlooker::open(data).await?;
        verify(&mut *onlooker.read().await?, &onlooker.archive()).await?
    };
    match arguments.format {
        Format::Json => println!("{}", serde_json::to_string(&findings)?),
        Format::Text => print!("{}", text(&findings, arguments.repair, &sealed)),
    }
    let is_fine = findings.is_clean()
        || (arguments.repair
            && findings.contradictions.is_empty()
            && findings.unreadable.is_empty()
            && sealed.is_empty());
    Ok(if is_fine { ExitCode::SUCCESS } else { ExitCode::from(FOUND) })
}

fn text(findings: &Findings, repaired: bool, sealed: &[String]) -> String {
    let mut text = format!("{} files, {} bytes\n", findings.files, findings.bytes);
    for (path, sentence) in &findings.damaged {
        let done = match repaired {
            _ if sealed.contains(path) => {
                "; it is sealed and is not solved again: put it back from a backup, or from an export, whose \
                 table of the same name has the same bytes"
            }
            true => "; its runs are queued again",
            false => "",
        };
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

/// Removes orphans and queues the runs of damaged files again; tells the damaged files that are sealed.
async fn repair(store: &Store, findings: &Findings) -> anyhow::Result<Vec<String>> {
    let mut tx = store.write().await?;
    let taken_out = take_out_damaged(&mut tx, &findings.damaged).await?;
    for lost in &taken_out.lost {
        queue::requeue(&mut tx, lost.sweep, &lost.taken).await?;
        let runs: i64 = lost.taken.statuses.iter().map(|(_, runs)| runs).sum();
        let detail = format!("{runs} runs of damaged files queued again");
        for row in queue::numbered(&mut tx, &[lost.sweep]).await? {
            let who = Actor::operator().name;
            people::audit(&mut tx, &who, "repair", &row.id, Some(&detail)).await?;
        }
    }
    let unused = catalogue::drop_unused_files(&mut tx).await?;
    tx.commit().await?;
    let paths = unused.iter().chain(&findings.orphans).map(String::as_str);
    files::remove_if_there(&store.archive(), paths);
    Ok(taken_out.sealed)
}

/// Copies a data directory.
pub async fn backup_main(arguments: &BackupArguments) -> anyhow::Result<ExitCode> {
    let copied = backup::backup(&arguments.data, &arguments.to).await?;
    println!("{} files, {} bytes copied to {}", copied.files, copied.bytes, arguments.to.display());
    Ok(ExitCode::SUCCESS)
}

/// Makes a data directory of a backup.
pub async fn restore_main(arguments: &RestoreArguments) -> anyhow::Result<ExitCode> {
    let restored = restore::restore(&arguments.from, &arguments.data).await?;
    println!(
        "{} files, {} bytes restored to {}, as they were at {}",
        restored.copied.files,
        restored.copied.bytes,
        arguments.data.display(),
        restored.made_at
    );
    Ok(ExitCode::SUCCESS)
}
