//! Sweeps that leave and come, over REST.

use super::Service;
use super::ensembles::entry_of;
use super::error::Problem;
use super::extract::{Asked, NothingAsked, Place};
use crate::archive::catalogue;
use crate::archive::ensemble::check::Checked;
use crate::archive::ensemble::export::{self, Folder};
use crate::archive::ensemble::import::{self as imports, Arrivals, Comparison};
use crate::archive::ensemble::manifest::Manifest;
use crate::archive::ensemble::{ImportError, unpack};
use crate::archive::files::{self, Written};
use crate::archive::schema::Kind;
use crate::domain::person::Actor;
use crate::domain::refusal::Refusal;
use crate::domain::sweep::Limits;
use crate::people;
use crate::queue::{self, Admission};
use crate::store::{Connection, Store};
use axum::Json;
use axum::body::Body;
use axum::extract::{Request, State};
use axum::http::header;
use axum::response::{IntoResponse, Response};
use futures_util::StreamExt;
use serde::{Deserialize, Serialize};
use std::fs::File;
use std::io::{Seek, Write};
use std::sync::Arc;
use tokio_util::io::{ReaderStream, SyncIoBridge};
use utoipa::{IntoParams, ToSchema};
use uuid::Uuid;

/// Media type of an archive.
pub const ARCHIVE_TYPE: &str = "application/zstd";

/// A sweep with everything that its export needs.
pub async fn subject(tx: &mut Connection, id: &str) -> Result<export::Subject, Problem> {
    let row = queue::sweep(tx, id).await?.ok_or_else(|| Problem::not_found("sweep", id))?;
    let seal = catalogue::stored_seal(tx, row.number).await?;
    let mut layouts = Vec::with_capacity(Kind::ALL.len());
    for kind in Kind::ALL {
        let layout = match seal {
            Some(_) => catalogue::layout(tx, row.number, kind).await?,
            None => catalogue::layout_by_run(tx, row.number, kind).await?,
        };
        layouts.push((kind, layout));
    }
    let entry = entry_of(&row);
    Ok(export::Subject { entry, document: row.document, layouts, seal })
}

/// A sweep as an archive: tables, manifest, citation and RO-Crate metadata in one folder, a tar compressed by
/// zstd. A sweep that is not sealed is exported as it is now, and its manifest says so.
#[utoipa::path(
    get, path = "/sweeps/{id}/export.tar.zst", params(("id" = String, Path,)),
    responses(
        (status = 200, content_type = "application/zstd"), (status = 400, body = Problem),
        (status = 404, body = Problem), (status = 507, body = Problem, description = "The disk is full"),
    )
)]
pub async fn export(
    State(service): State<Service>,
    Place(id): Place<String>,
    _: NothingAsked,
) -> Result<Response, Problem> {
    let in_use = service.store.files_in_use().await;
    let subject = subject(&mut *service.store.read().await?, &id).await?;
    let archive = service.store.archive();
    // Files that are open stay readable, whoever removes their names.
    let folder = tokio::task::spawn_blocking(move || {
        let _in_use = in_use;
        Folder::gather(&archive, subject)
    })
    .await??;
    /// Bytes on their way at most.
    const UNDER_WAY: usize = 1 << 20;
    let (writer, reader) = tokio::io::duplex(UNDER_WAY);
    let name = id.clone();
    tokio::task::spawn_blocking(move || {
        let mut bridge = SyncIoBridge::new(writer);
        // A client that hangs up is no trouble; an archive that breaks off is not whole, which its end shows.
        match export::write(vec![folder], std::io::BufWriter::new(&mut bridge)) {
            Ok(mut buffered) => drop(std::io::Write::flush(&mut buffered)),
            Err(e) => tracing::info!(sweep = name, "an export broke off: {e}"),
        }
    });
    let headers = [
        (header::CONTENT_TYPE, ARCHIVE_TYPE.to_owned()),
        (header::CONTENT_DISPOSITION, format!("attachment; filename=\"melange-{id}.tar.zst\"")),
    ];
    let body = Body::from_stream(ReaderStream::with_capacity(reader, 1 << 18));
    Ok((headers, body).into_response())
}

/// How an archive is taken.
#[derive(Debug, Clone, Copy, Default, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct Importing {
    /// Only tell what would be taken.
    #[serde(default)]
    pub dry_run: bool,
    /// Take it even if it has other numbers of runs that are here; both are kept.
    #[serde(default)]
    pub accept_conflicts: bool,
}

/// What became of an archive.
#[derive(Debug, Serialize, ToSchema)]
pub struct Imported {
    /// Its ensembles.
    ensembles: Vec<Arrival>,
}

/// What became of an ensemble.
#[derive(Debug, Serialize, ToSchema)]
pub struct Arrival {
    /// Its id where it comes from.
    source_id: String,
    /// The sweep that it is here; null for what would be one.
    id: Option<String>,
    /// What became of it.
    outcome: ArrivalOutcome,
    /// Hash of its data.
    content_hash: String,
    /// Whether it is sealed.
    sealed: bool,
    /// Its runs that have a result.
    runs: usize,
    /// How they stand to the runs that were here.
    #[serde(flatten)]
    comparison: Comparison,
}

/// What became of an ensemble.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ArrivalOutcome {
    /// It is a sweep of this data directory now.
    Imported,
    /// It was one already; nothing changed.
    AlreadyHere,
    /// It would be one.
    WouldBeImported,
}

/// Import an archive that an export wrote: the body. Everything is checked before anything is believed; either all
/// its ensembles are taken or none. Sealed ones stay sealed and keep their id, where it is free; the importer is
/// the owner. Runs with other numbers than here are conflicts, and refused unless they are accepted.
#[utoipa::path(
    post, path = "/import", params(Importing),
    request_body(content((Vec<u8> = "application/zstd"), (Vec<u8> = "application/octet-stream"))),
    responses(
        (status = 200, body = Imported), (status = 400, body = Problem), (status = 403, body = Problem),
        (status = 409, body = Problem, description = "It has other numbers of runs that are here"),
        (status = 413, body = Problem), (status = 422, body = Problem, description = "It is not what an export is"),
        (status = 507, body = Problem, description = "The disk is full"),
    )
)]
pub async fn import(
    State(service): State<Service>,
    actor: Actor,
    Asked(asked): Asked<Importing>,
    request: Request,
) -> Result<Json<Imported>, Problem> {
    actor.may_submit()?;
    let file = receive(&service, request).await?;
    let (store, limits) = (service.store.clone(), service.limits);
    // Goes on if whoever asks hangs up: an import is whole or not at all.
    let taking = tokio::spawn(async move { take_in(&store, &actor, file, asked, limits).await });
    Ok(Json(taking.await??))
}

/// The body in a nameless file.
async fn receive(service: &Service, request: Request) -> Result<File, Problem> {
    let fault = |source| {
        let error = crate::archive::ArchiveError::File {
            path: "an archive on its way".into(),
            doing: "written",
            source,
        };
        Problem::from(error)
    };
    let mut file = tempfile::tempfile_in(service.store.archive()).map_err(fault)?;
    let mut stream = request.into_body().into_data_stream();
    let mut bytes = 0_u64;
    while let Some(part) = stream.next().await {
        let part = part.map_err(|e| Refusal::sentence(format!("the body broke off: {e}")))?;
        bytes += part.len() as u64;
        if bytes > service.most_archive_bytes {
            return Err(Problem::archive_too_large(service.most_archive_bytes));
        }
        file = tokio::task::spawn_blocking(move || file.write_all(&part).map(|()| file))
            .await?
            .map_err(fault)?;
    }
    file.rewind().map_err(fault)?;
    Ok(file)
}

/// Takes an archive in, or tells what would be taken.
pub async fn take_in(
    store: &Store,
    actor: &Actor,
    file: File,
    asked: Importing,
    limits: Limits,
) -> Result<Imported, Problem> {
    actor.may_submit()?;
    let archive = store.archive();
    let received = tokio::task::spawn_blocking(move || {
        imports::receive(&archive, file, unpack::Limits::default(), &limits)
    });
    // A reader that broke off met what nobody has written.
    let received = received.await.map_err(|e| {
        tracing::warn!("an import broke off: {e}");
        ImportError::Refused("a table in it cannot be read".into())
    })?;
    let arrivals = received?;
    let taken = take_all(store, actor, &arrivals, asked).await;
    tokio::task::spawn_blocking(move || arrivals.close()).await?;
    taken
}

async fn take_all(
    store: &Store,
    actor: &Actor,
    arrivals: &Arrivals,
    asked: Importing,
) -> Result<Imported, Problem> {
    let mut told = Vec::with_capacity(arrivals.ensembles.len());
    let mut coming = Vec::new();
    let mut tx = store.read().await?;
    for ensemble in &arrivals.ensembles {
        let manifest = &ensemble.staged.manifest;
        let here = here(&mut tx, manifest).await?;
        let comparison = imports::compare(&mut tx, ensemble).await?;
        let mut arrival = Arrival {
            source_id: manifest.sweep.id.clone(),
            id: here,
            outcome: ArrivalOutcome::AlreadyHere,
            content_hash: manifest.content_hash.clone(),
            sealed: manifest.seal.is_some(),
            runs: ensemble.runs.ids.len(),
            comparison,
        };
        let taken = !queue::is_id_free(&mut tx, &arrival.source_id).await?;
        // One that lies in the trash, or is being cleared away, is not here.
        let is_here = queue::sweep_in_brief(&mut tx, &arrival.source_id).await?.is_some();
        let is_whole = ensemble.missing.is_empty() && manifest.sweep.counts.failed == 0;
        if manifest.seal.is_none()
            && is_here
            && is_whole
            && arrival.comparison.identical == arrival.runs
        {
            arrival.id = Some(arrival.source_id.clone());
        }
        if arrival.id.is_none() {
            arrival.outcome = ArrivalOutcome::WouldBeImported;
            let id = if taken { new_id() } else { arrival.source_id.clone() };
            coming.push((told.len(), id, ensemble));
        }
        told.push(arrival);
    }
    drop(tx);
    if asked.dry_run || coming.is_empty() {
        return Ok(Imported { ensembles: told });
    }
    if !asked.accept_conflicts {
        refuse_conflicts(coming.iter().map(|(i, _, _)| &told[*i]))?;
    }
    let mut placed: Vec<Vec<Written>> = Vec::with_capacity(coming.len());
    let done = async {
        for (_, id, ensemble) in &coming {
            let (archive, id, ensemble) = (store.archive(), id.clone(), Arc::clone(ensemble));
            let moved =
                tokio::task::spawn_blocking(move || imports::place(&archive, &id, &ensemble));
            placed.push(moved.await??);
        }
        let mut tx = store.write().await?;
        for ((_, id, ensemble), placed) in coming.iter().zip(&placed) {
            admit(&mut tx, store, actor, id, ensemble, placed).await?;
        }
        tx.commit().await?;
        Ok::<(), Problem>(())
    };
    if let Err(problem) = done.await {
        let paths = placed.iter().flatten().map(|written| written.path.clone()).collect();
        let unlisted = super::ensembles::not_listed(store, paths).await;
        let ids: Vec<String> = coming.iter().map(|(_, id, _)| id.clone()).collect();
        let archive = store.archive();
        tokio::task::spawn_blocking(move || {
            files::remove_if_there(&archive, unlisted.iter().map(String::as_str));
            ids.iter().for_each(|id| files::remove_folder_if_empty(&archive, id));
        })
        .await?;
        return Err(problem);
    }
    for (i, id, _) in coming {
        tracing::info!(sweep = id, source = told[i].source_id, "imported a sweep");
        told[i].outcome = ArrivalOutcome::Imported;
        told[i].id = Some(id);
    }
    Ok(Imported { ensembles: told })
}

/// Id of the sweep that an ensemble is here, if it is.
async fn here(tx: &mut Connection, manifest: &Manifest) -> sqlx::Result<Option<String>> {
    match manifest.seal {
        Some(_) => catalogue::sealed_as(tx, &manifest.content_hash).await,
        None => catalogue::imported_as(tx, &manifest.content_hash).await,
    }
}

fn new_id() -> String {
    Uuid::now_v7().simple().to_string()
}

/// Adds one ensemble, within the transaction of all.
async fn admit(
    tx: &mut Connection,
    store: &Store,
    actor: &Actor,
    id: &str,
    ensemble: &Arc<Checked>,
    placed: &[Written],
) -> Result<(), Problem> {
    if !queue::is_id_free(tx, id).await? {
        return Err(Problem::conflict("a sweep with the same id has come meanwhile; try again"));
    }
    let manifest = &ensemble.staged.manifest;
    if here(tx, manifest).await?.is_some() {
        return Err(Problem::conflict("the same ensemble has come meanwhile; ask again"));
    }
    let done: Vec<_> = ensemble.stretches.iter().map(|s| s.first..s.end).collect();
    let admission = Admission {
        id,
        sweep: &ensemble.sweep,
        name: &manifest.sweep.name,
        tags: &manifest.sweep.tags,
        note: manifest.sweep.note.as_deref(),
        owner: &actor.name,
        created_at: &manifest.sweep.created_at,
        content_hash: &manifest.content_hash,
        source_id: &manifest.sweep.id,
        source_owner: manifest.sweep.owner.as_deref(),
        ended: ensemble.ended.clone(),
        done: &done,
        missing: &ensemble.missing,
    };
    queue::check_quota(tx, &actor.name, ensemble.sweep.count() as i64, 0).await?;
    let number = queue::admit(tx, &admission).await?;
    imports::list(tx, &store.archive(), number, ensemble, placed).await?;
    let detail = format!("{}, {}", manifest.sweep.id, manifest.content_hash);
    people::audit(tx, &actor.name, "import", id, Some(&detail)).await?;
    Ok(())
}

/// Refuses ensembles with conflicts, and names the first of them.
fn refuse_conflicts<'a>(arrivals: impl Iterator<Item = &'a Arrival>) -> Result<(), ImportError> {
    let mut sentence = String::new();
    let mut conflicts = 0;
    for arrival in arrivals {
        conflicts += arrival.comparison.conflicts;
        for conflict in &arrival.comparison.named {
            let imports::Conflict { run_id, column, here, there } = conflict;
            sentence += &format!("; run {run_id}: {column} is {here} here and {there} there");
        }
    }
    if conflicts == 0 {
        return Ok(());
    }
    Err(ImportError::Conflict(format!(
        "nothing was taken: {conflicts} runs have other numbers than here, so that other code has solved them or \
         somebody has changed them (accept the conflicts to keep both){sentence}"
    )))
}
