//! `melange seal` and `melange export`: a sweep that never changes again and can be cited, and sweeps as an
//! archive that travels.

use super::reach::{self, Reach, ask};
use crate::archive::ensemble::export;
use crate::client::Refused;
use crate::domain::person::Actor;
use crate::domain::seal::{Author, SealForm};
use crate::http::ensembles;
use crate::http::error::Problem;
use crate::http::travel;
use crate::store::{Onlooker, Store};
use anyhow::{Context, anyhow, ensure};
use serde_json::Value;
use std::fs::Permissions;
use std::io::Write;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use tempfile::Builder;

/// Arguments of `melange seal`.
#[derive(Debug, clap::Args)]
pub struct SealArguments {
    /// The sweep's id.
    id: String,
    /// Title of the ensemble.
    #[arg(long)]
    title: String,
    /// An author, `Name`, `Name <ORCID>` or `Name <ORCID> (affiliation)`; once for each, in the order of the
    /// citation.
    #[arg(long = "author", required = true, value_parser = author)]
    authors: Vec<Author>,
    /// SPDX id of its licence, such as CC-BY-4.0.
    #[arg(long)]
    licence: String,
    /// What it is, in some sentences.
    #[arg(long)]
    description: Option<String>,
    /// Data directory.
    #[arg(long, default_value = "melange-data")]
    data: PathBuf,
}

/// Arguments of `melange export`.
#[derive(Debug, clap::Args)]
pub struct ExportArguments {
    /// Ids of the sweeps.
    #[arg(required = true)]
    ids: Vec<String>,
    /// The archive, which must not exist.
    #[arg(long)]
    to: PathBuf,
    /// Data directory; it may be in use.
    #[arg(long, default_value = "melange-data")]
    data: PathBuf,
}

/// `Name`, `Name <ORCID>`, `Name (affiliation)` or all of it.
fn author(text: &str) -> Result<Author, String> {
    let (rest, affiliation) = match text.trim().strip_suffix(')').and_then(|t| t.rsplit_once('(')) {
        Some((rest, affiliation)) => (rest.trim(), Some(affiliation.trim().to_owned())),
        None => (text.trim(), None),
    };
    let (name, orcid) = match rest.strip_suffix('>').and_then(|t| t.rsplit_once('<')) {
        Some((name, orcid)) => (name.trim(), Some(orcid.trim().to_owned())),
        None => (rest, None),
    };
    if name.is_empty() || name.contains(['<', '>']) {
        return Err("an author is `Name`, `Name <ORCID>` or `Name <ORCID> (affiliation)`".into());
    }
    Ok(Author { name: name.to_owned(), orcid, affiliation })
}

/// Seals a sweep and prints its content hash.
pub async fn seal_main(arguments: &SealArguments) -> anyhow::Result<ExitCode> {
    let SealArguments { id, title, authors, licence, description, data } = arguments;
    let form = SealForm {
        title: title.clone(),
        authors: authors.clone(),
        licence: licence.clone(),
        description: description.clone(),
    };
    let told = match Reach::of(data) {
        Reach::Service(client) => {
            let path = format!("/sweeps/{id}/seal");
            let body = serde_json::to_vec(&form)?;
            ask(move || client.post(&path, &body)).await
        }
        Reach::Directory => {
            let store = Store::open_existing(data).await?;
            let sealed = ensembles::close(&store, &Actor::operator(), id, form).await;
            store.close().await;
            sealed.map_err(refused_by).and_then(|sweep| Ok(serde_json::to_value(sweep)?))
        }
    };
    answer(told, |sweep| {
        let seal = &sweep["sealed"];
        let (hash, title) = (seal["content_hash"].as_str(), seal["title"].as_str());
        let failed = match sweep["counts"]["failed"].as_i64() {
            Some(failed) if failed > 0 => format!(" ({failed} of its runs failed, and stay so)"),
            _ => String::new(),
        };
        let (hash, title) = (hash.unwrap_or_default(), title.unwrap_or_default());
        format!("{id} sealed as {hash}  {title}{failed}")
    })
}

/// What a handler refuses, as a command's error.
pub fn refused_by(problem: Problem) -> anyhow::Error {
    anyhow!(Refused(problem.sentence().to_owned()))
}

/// Prints an answer, or why there is none.
pub fn answer(
    told: anyhow::Result<Value>,
    line: impl FnOnce(&Value) -> String,
) -> anyhow::Result<ExitCode> {
    reach::told(told, |value| println!("{}", line(&value)))
}

/// Looks at the catalogue that are tried: files may be put together while they are opened.
const TRIES: usize = 5;

/// Writes sweeps into an archive.
pub async fn export_main(arguments: &ExportArguments) -> anyhow::Result<ExitCode> {
    let ExportArguments { ids, to, data } = arguments;
    ensure!(!to.exists(), "{} is there already: an export overwrites nothing", to.display());
    let onlooker = Onlooker::open(data).await?;
    let mut tries = 1;
    let folders = loop {
        match gather(&onlooker, ids).await? {
            Ok(folders) => break folders,
            Err(Moved) if tries < TRIES => tries += 1,
            Err(Moved) => anyhow::bail!("the files of these sweeps keep moving; try again"),
        }
    };
    let folders = match folders {
        Ok(folders) => folders,
        Err(problem) => return answer(Err(refused_by(problem)), |_| String::new()),
    };
    let target = to.clone();
    let bytes = tokio::task::spawn_blocking(move || write(folders, &target)).await??;
    println!("{} sweeps, {bytes} bytes written to {}", ids.len(), to.display());
    Ok(ExitCode::SUCCESS)
}

/// Files have moved between the look at the catalogue and their opening.
struct Moved;

type Gathered = Result<Vec<export::Folder>, Problem>;

async fn gather(onlooker: &Onlooker, ids: &[String]) -> anyhow::Result<Result<Gathered, Moved>> {
    let mut folders = Vec::with_capacity(ids.len());
    for (i, id) in ids.iter().enumerate() {
        ensure!(!ids[..i].contains(id), "the sweep {id} is given twice");
        let subject = match travel::subject(&mut *onlooker.read().await?, id).await {
            Ok(subject) => subject,
            Err(problem) => return Ok(Ok(Err(problem))),
        };
        let archive = onlooker.archive();
        let gathered =
            tokio::task::spawn_blocking(move || export::Folder::gather(&archive, subject)).await?;
        match gathered {
            Ok(folder) => folders.push(folder),
            Err(crate::archive::ArchiveError::File { source, .. })
                if source.kind() == std::io::ErrorKind::NotFound =>
            {
                return Ok(Err(Moved));
            }
            Err(error) => return Err(error.into()),
        }
    }
    Ok(Ok(Ok(folders)))
}

/// Writes the archive under a temporary name, which it keeps only if it is whole.
fn write(folders: Vec<export::Folder>, to: &Path) -> anyhow::Result<u64> {
    let folder = to.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let cannot = || format!("cannot write {}", to.display());
    // As readable as any other file that is written here.
    let permissions = Permissions::from_mode(0o666);
    let file = Builder::new().permissions(permissions).tempfile_in(folder).with_context(cannot)?;
    let mut file = export::write(folders, std::io::BufWriter::new(file)).with_context(cannot)?;
    file.flush().with_context(cannot)?;
    let file = file.into_inner().map_err(|e| e.into_error()).with_context(cannot)?;
    file.as_file().sync_all().with_context(cannot)?;
    let bytes = file.as_file().metadata().with_context(cannot)?.len();
    file.persist_noclobber(to).map_err(|e| e.error).with_context(cannot)?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn authors_are_read_with_orcid_and_affiliation() {
        let told = author("Ada Lovelace <0000-0002-1825-0097> (ETH Zürich)").expect("an author");
        assert_eq!(told.name, "Ada Lovelace");
        assert_eq!(told.orcid.as_deref(), Some("0000-0002-1825-0097"));
        assert_eq!(told.affiliation.as_deref(), Some("ETH Zürich"));
        assert_eq!(author("Ada").expect("an author").orcid, None);
        for text in ["", "<0000-0002-1825-0097>", "a <b> c"] {
            assert!(author(text).is_err(), "{text}");
        }
    }
}
