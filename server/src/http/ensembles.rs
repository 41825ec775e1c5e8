//! Sealed ensembles over REST: seal, cite, describe, find by hash.

use super::Service;
use super::error::Problem;
use super::extract::{Asked, NothingAsked, Place, json_of};
use super::sweeps::Sweep;
use crate::archive::catalogue::{self, StoredSeal};
use crate::archive::ensemble::export;
use crate::archive::ensemble::manifest::{Manifest, SweepEntry};
use crate::archive::ensemble::research_object;
use crate::archive::ensemble::seal::{Subject, prepare};
use crate::archive::files;
use crate::domain::citation::{self as citations, CitationFormat};
use crate::domain::person::Actor;
use crate::domain::seal::SealForm;
use crate::domain::status::Phase;
use crate::people;
use crate::queue::{self, SweepRow};
use crate::store::Store;
use axum::Json;
use axum::body::Bytes;
use axum::extract::State;
use axum::http::header;
use axum::response::{IntoResponse, Response};
use serde::Deserialize;
use utoipa::IntoParams;

/// Seal a sweep whose every run has a result: from then on it never changes and cannot be deleted, has a content
/// hash, and can be cited. Failed runs stay in it as failed. There is no way back.
#[utoipa::path(
    post, path = "/sweeps/{id}/seal", params(("id" = String, Path,)), request_body = SealForm,
    responses(
        (status = 200, body = Sweep), (status = 400, body = Problem), (status = 403, body = Problem),
        (status = 404, body = Problem),
        (status = 409, body = Problem, description = "It has not ended, has cancelled runs, or is sealed already"),
        (status = 413, body = Problem), (status = 422, body = Problem),
        (status = 507, body = Problem, description = "The disk is full"),
    )
)]
pub async fn seal(
    State(service): State<Service>,
    actor: Actor,
    Place(id): Place<String>,
    _: NothingAsked,
    body: Result<Bytes, axum::extract::rejection::BytesRejection>,
) -> Result<Json<Sweep>, Problem> {
    let form: SealForm = json_of(&body?)?;
    // Goes on even if whoever asks hangs up: files half-gathered help nobody.
    let sealing = tokio::spawn(async move { close(&service.store, &actor, &id, form).await });
    Ok(Json(sealing.await??))
}

/// Seals a sweep, and tells what it is then.
pub async fn close(
    store: &Store,
    actor: &Actor,
    id: &str,
    form: SealForm,
) -> Result<Sweep, Problem> {
    let form = form.checked()?;
    let mut tx = store.read().await?;
    let row = found(&mut tx, id).await?;
    actor.may_change(row.owner.as_deref())?;
    queue::refuse_if_sealed(&mut tx, row.number).await?;
    drop(tx);
    check_state(&row)?;
    let subject = Subject { sweep: row.number, id: id.to_owned(), document: row.document };
    let prepared = prepare(store, subject).await?;
    let sealed = async {
        let mut tx = store.write().await?;
        let row = found(&mut tx, id).await?;
        queue::refuse_if_sealed(&mut tx, row.number).await?;
        check_state(&row)?;
        let title = form.title.clone();
        let Some((seal, unused)) =
            prepared.commit(&mut tx, entry_of(&row), form, &actor.name).await?
        else {
            return Err(Problem::conflict("this sweep has changed while it was sealed; try again"));
        };
        let detail = format!("{title}, {}", seal.content_hash);
        people::audit(&mut tx, &actor.name, "seal", id, Some(&detail)).await?;
        tx.commit().await?;
        tracing::info!(sweep = id, content_hash = seal.content_hash, "sealed a sweep");
        Ok(unused)
    };
    let (unused, done) = match sealed.await {
        Ok(unused) => (unused, Ok(())),
        Err(problem) => (not_listed(store, prepared.paths()).await, Err(problem)),
    };
    let (alone, archive) = (store.files_to_remove().await, store.archive());
    tokio::task::spawn_blocking(move || {
        let _alone = alone;
        files::remove_if_there(&archive, unused.iter().map(String::as_str));
    })
    .await?;
    done?;
    let mut tx = store.read().await?;
    let row = found(&mut tx, id).await?;
    Ok(Sweep::brief(&mut tx, row).await?)
}

/// Those files that the catalogue does not list; none if it cannot be asked: a commit that failed may have
/// happened.
pub async fn not_listed(store: &Store, paths: Vec<String>) -> Vec<String> {
    let Ok(mut tx) = store.read().await else { return Vec::new() };
    match catalogue::all_files(&mut tx).await {
        Ok(listed) => {
            paths.into_iter().filter(|path| listed.iter().all(|l| l.path != *path)).collect()
        }
        Err(_) => Vec::new(),
    }
}

fn check_state(row: &SweepRow) -> Result<(), Problem> {
    if row.phase != Phase::Ended {
        return Err(Problem::conflict(
            "this sweep has not ended: what may change cannot be sealed",
        ));
    }
    if row.counts.cancelled > 0 {
        let sentence = format!(
            "{} runs of this sweep were cancelled: resume it, so that every run has a result",
            row.counts.cancelled
        );
        return Err(Problem::conflict(sentence));
    }
    Ok(())
}

async fn found(tx: &mut crate::store::Connection, id: &str) -> Result<SweepRow, Problem> {
    queue::sweep(tx, id).await?.ok_or_else(|| Problem::not_found("sweep", id))
}

/// A sweep as its manifest tells it.
pub fn entry_of(row: &SweepRow) -> SweepEntry {
    SweepEntry {
        id: row.id.clone(),
        name: row.name.clone(),
        tags: row.tags.clone(),
        note: row.note.clone(),
        created_at: row.created_at.clone(),
        owner: row.owner.clone(),
        counts: row.counts,
    }
}

/// The seal of a sweep, which has to have one.
async fn seal_of(service: &Service, id: &str) -> Result<StoredSeal, Problem> {
    let mut tx = service.store.read().await?;
    let row = queue::sweep_in_brief(&mut tx, id).await?;
    let row = row.ok_or_else(|| Problem::not_found("sweep", id))?;
    catalogue::stored_seal(&mut tx, row.number).await?.ok_or_else(|| {
        Problem::conflict("this sweep is not sealed: it may still change, and cannot be cited")
    })
}

/// How a citation is asked for.
#[derive(Debug, Default, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct CitationQuery {
    /// `bibtex` if not given.
    #[serde(default)]
    #[param(inline)]
    format: CitationFormat,
}

/// The citation of a sealed sweep and of the model's paper.
#[utoipa::path(
    get, path = "/sweeps/{id}/citation", params(("id" = String, Path,), CitationQuery),
    responses(
        (status = 200, description = "The citation", content((String = "application/x-bibtex"), (Object = "application/vnd.citationstyles.csl+json"), (String = "text/plain"))),
        (status = 400, body = Problem), (status = 404, body = Problem),
        (status = 409, body = Problem, description = "It is not sealed"),
    )
)]
pub async fn citation(
    State(service): State<Service>,
    Place(id): Place<String>,
    Asked(query): Asked<CitationQuery>,
) -> Result<Response, Problem> {
    let stored = seal_of(&service, &id).await?;
    let seal = stored.manifest.seal.ok_or_else(|| Problem::not_found("seal", &id))?;
    let text = citations::citation(&seal, query.format);
    Ok(([(header::CONTENT_TYPE, query.format.media_type())], text).into_response())
}

/// The RO-Crate metadata of a sealed sweep, as its export has them.
#[utoipa::path(
    get, path = "/sweeps/{id}/ro-crate-metadata.json", params(("id" = String, Path,)),
    responses(
        (status = 200, description = "JSON-LD", body = Object, content_type = "application/ld+json"),
        (status = 400, body = Problem), (status = 404, body = Problem),
        (status = 409, body = Problem, description = "It is not sealed"),
    )
)]
pub async fn ro_crate(
    State(service): State<Service>,
    Place(id): Place<String>,
    _: NothingAsked,
) -> Result<Response, Problem> {
    let stored = seal_of(&service, &id).await?;
    let beside = export::beside(&stored.manifest);
    let text = research_object::metadata(&stored.manifest, &beside).to_string();
    Ok(([(header::CONTENT_TYPE, "application/ld+json")], text).into_response())
}

/// The manifest of a sealed sweep: its files with their hashes.
#[utoipa::path(
    get, path = "/sweeps/{id}/manifest", params(("id" = String, Path,)),
    responses(
        (status = 200, body = Manifest), (status = 400, body = Problem), (status = 404, body = Problem),
        (status = 409, body = Problem, description = "It is not sealed"),
    )
)]
pub async fn manifest(
    State(service): State<Service>,
    Place(id): Place<String>,
    _: NothingAsked,
) -> Result<Json<Manifest>, Problem> {
    Ok(Json(seal_of(&service, &id).await?.manifest))
}

/// The sealed sweep of a content hash.
#[utoipa::path(
    get, path = "/ensembles/{content_hash}", params(("content_hash" = String, Path,)),
    responses((status = 200, body = Sweep), (status = 400, body = Problem), (status = 404, body = Problem))
)]
pub async fn resolve(
    State(service): State<Service>,
    Place(hash): Place<String>,
    _: NothingAsked,
) -> Result<Json<Sweep>, Problem> {
    let mut tx = service.store.read().await?;
    let id = catalogue::sealed_as(&mut tx, &hash).await?;
    let id = id.ok_or_else(|| Problem::not_found("sealed ensemble", &hash))?;
    let row = found(&mut tx, &id).await?;
    Ok(Json(Sweep::brief(&mut tx, row).await?))
}
