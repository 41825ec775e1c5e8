//! States over REST: transects of a run's, and the profiles of many runs at once.

use super::Service;
use super::error::Problem;
use super::extract::{Asked, Place};
use crate::archive::catalogue::{self, Entry};
use crate::archive::{ArchiveError, read, states};
use crate::domain::document::{Document, Regime};
use crate::domain::outcome::{EffectiveParameters, Outcome, Profile, TransectProfile};
use crate::domain::refusal::Refusal;
use crate::domain::run::RunSpec;
use crate::domain::stored_state::{StoredRun, Unread};
use crate::queue;
use crate::store::Store;
use axum::Json;
use axum::extract::State;
use axum::http::header::CONTENT_TYPE;
use axum::response::{IntoResponse, Response};
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::sync::Arc;
use utoipa::{IntoParams, ToSchema};

/// Most transects of a run.
const MOST_TRANSECTS: usize = 100;
/// Most runs whose profiles are asked for at once.
const MOST_RUNS: usize = 100;
/// Most transects of each of these.
const MOST_EACH: usize = 8;

/// Where across the fjord, and when.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct TransectsQuery {
    /// Up to 100 places, as shares of the mélange's length from 0 to 1, with commas between: `0.25,0.5`.
    chi: String,
    /// Time of a stored state of a transient, a; its last state if not given.
    time_a: Option<f64>,
}

/// Transects of a state.
#[derive(Debug, Serialize, ToSchema)]
pub struct TransectsAnswer {
    /// When, a; null if the state has no time.
    time_a: Option<f64>,
    /// One for each χ, in the order asked for.
    items: Vec<TransectProfile>,
}

/// Speed and fluidity across the fjord in a stored state, as a run with `options.transects_at_chi` tells them of its
/// last state: the same numbers, of parameters that vary in time to rounding. 409 where there is no state, or where
/// the fjord's width varies and the terminus' place in a state between the rows of the series is not stored.
#[utoipa::path(
    get, path = "/runs/{id}/transects", params(("id" = String, Path,), TransectsQuery),
    responses(
        (status = 200, body = TransectsAnswer), (status = 400, body = Problem), (status = 404, body = Problem),
        (status = 409, body = Problem), (status = 422, body = Problem),
    )
)]
pub async fn transects(
    State(service): State<Service>,
    Place(id): Place<String>,
    Asked(asked): Asked<TransectsQuery>,
) -> Result<Json<TransectsAnswer>, Problem> {
    let chi = shares("chi", &asked.chi, MOST_TRANSECTS)?;
    let outcome = read::stored(&service.store, &id).await?;
    let outcome = outcome.ok_or_else(|| Problem::not_found("run", &id))?;
    let run = run_of(&service.store, &id, &outcome).await?;
    let start_x_m = match run.stands_where() {
        Some(start) => terminus_of(&service.store, start).await?,
        None => None,
    };
    let read = tokio::task::spawn_blocking(move || {
        StoredRun { run: &run, outcome: &outcome, start_x_m }.transects(asked.time_a, &chi)
    });
    let read = read.await??;
    Ok(Json(TransectsAnswer { time_a: read.time_a, items: read.items }))
}

/// Which runs, and where across the fjord.
#[derive(Debug, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct ProfilesQuery {
    /// Up to 100 indices of runs that have ended, with commas between: `0,5,9`.
    runs: String,
    /// Up to 8 places of transects, as in `/runs/{id}/transects`; none if not given.
    chi: Option<String>,
}

/// The states of some runs.
#[derive(Debug, Serialize, ToSchema)]
pub struct ProfilesAnswer {
    /// In the order asked for.
    items: Vec<RunProfile>,
}

/// A run with its last state.
#[derive(Debug, Serialize, ToSchema)]
pub struct RunProfile {
    run_index: i64,
    run_id: String,
    status: String,
    regime: String,
    /// All parameters, effective.
    #[schema(value_type = std::collections::BTreeMap<String, f64>)]
    parameters: EffectiveParameters,
    length_m: Option<f64>,
    thickness_0_m: Option<f64>,
    force_n_per_m: Option<f64>,
    force_quasi_static_n_per_m: Option<f64>,
    /// Last state; null if the run has none.
    profile: Option<Profile>,
    /// One for each χ asked for; none of a run without a state.
    transects: Vec<TransectProfile>,
}

/// The last states of some runs of a sweep, with transects if asked for.
#[utoipa::path(
    get, path = "/sweeps/{id}/profiles", params(("id" = String, Path,), ProfilesQuery),
    responses(
        (status = 200, body = ProfilesAnswer), (status = 400, body = Problem), (status = 404, body = Problem),
        (status = 409, body = Problem, description = "A run has not ended, or its transects are not known"),
        (status = 422, body = Problem),
    )
)]
pub async fn profiles(
    State(service): State<Service>,
    Place(id): Place<String>,
    Asked(asked): Asked<ProfilesQuery>,
) -> Result<Response, Problem> {
    let indices = indices("runs", &asked.runs)?;
    let chi = asked.chi.as_deref().map(|text| shares("chi", text, MOST_EACH)).transpose()?;
    let chi = chi.unwrap_or_default();
    let in_use = service.store.files_in_use().await;
    let mut tx = service.store.read().await?;
    let sweep = queue::sweep_in_brief(&mut tx, &id).await?;
    let sweep = sweep.ok_or_else(|| Problem::not_found("sweep", &id))?;
    if let Some(beyond) = indices.iter().find(|index| **index >= sweep.counts.total) {
        let permitted = format!("indices of runs, from 0 to {}", sweep.counts.total - 1);
        return Err(Refusal::value("runs", *beyond, permitted).into());
    }
    let found = catalogue::runs_at(&mut tx, sweep.number, &indices).await?;
    drop(tx);
    let mut entries = Vec::with_capacity(indices.len());
    for index in &indices {
        let entry = found.get(index).cloned();
        let no_result = || Problem::conflict(format!("run {index} of the sweep has not ended"));
        entries.push((*index, entry.ok_or_else(no_result)?));
    }
    let archive = service.store.archive();
    let wants_transects = !chi.is_empty();
    let read = tokio::task::spawn_blocking(move || {
        let _in_use = in_use;
        stored(&archive, entries, wants_transects)
    });
    let stored = read.await??;
    // Of runs that have the same start, as those of a sweep do, it is looked at once.
    let (mut document, mut starts) = (None, HashMap::new());
    let mut ready = Vec::with_capacity(stored.len());
    for Stored { index, run_id, outcome, options } in stored {
        let mut of_start = None;
        let options = match options {
            None if wants_transects && outcome.profile.is_some() => {
                if document.is_none() {
                    document = Some(options_of_sweep(&service.store, sweep.number).await?);
                }
                document.clone().flatten()
            }
            options => options,
        };
        let run = options.filter(|_| wants_transects).and_then(|text| outcome.run(&text));
        if let Some(start) = run.as_ref().and_then(RunSpec::stands_where) {
            if !starts.contains_key(start) {
                starts.insert(start.to_owned(), terminus_of(&service.store, start).await?);
            }
            of_start = starts.get(start).copied().flatten();
        }
        ready.push((index, run_id, outcome, run, of_start));
    }
    let told = tokio::task::spawn_blocking(move || {
        let items = ready.into_iter().map(|(index, run_id, outcome, run, start_x_m)| {
            let items = match (&outcome.profile, &run) {
                (Some(_), Some(run)) => {
                    let read = StoredRun { run, outcome: &outcome, start_x_m };
                    read.transects(None, &chi)
                        .map(|read| read.items)
                        .map_err(|e| Problem::conflict(format!("run {index}: {e}")))?
                }
                (Some(_), None) if wants_transects => {
                    return Err(Problem::conflict(format!(
                        "run {index}: {}",
                        Unread::UnknownModel
                    )));
                }
                _ => Vec::new(),
            };
            Ok(RunProfile::new(index, run_id, outcome, items))
        });
        let answer = ProfilesAnswer { items: items.collect::<Result<_, Problem>>()? };
        serde_json::to_vec(&answer).map_err(|e| Problem::inner(&e))
    });
    let body = told.await??;
    Ok(([(CONTENT_TYPE, "application/json")], body).into_response())
}

impl RunProfile {
    fn new(
        run_index: i64,
        run_id: String,
        outcome: Outcome,
        transects: Vec<TransectProfile>,
    ) -> Self {
        let scalars = outcome.scalars;
        Self {
            run_index,
            run_id,
            status: outcome.status.name().to_owned(),
            regime: outcome.regime,
            parameters: outcome.parameters,
            length_m: scalars.length_m,
            thickness_0_m: scalars.thickness_0_m,
            force_n_per_m: scalars.force_n_per_m,
            force_quasi_static_n_per_m: scalars.force_quasi_static_n_per_m,
            profile: outcome.profile,
            transects,
        }
    }
}

/// A run of a sweep as far as its files tell.
struct Stored {
    index: i64,
    run_id: String,
    outcome: Outcome,
    options: Option<Arc<str>>,
}

/// Reads runs with their last states; for transects, also what identifies them, and what has found their model.
fn stored(
    archive: &std::path::Path,
    entries: Vec<(i64, Entry)>,
    wants_transects: bool,
) -> Result<Vec<Stored>, ArchiveError> {
    let (indices, entries): (Vec<i64>, Vec<Entry>) = entries.into_iter().unzip();
    let profiles = states::last_states(archive, &entries)?;
    let options = match wants_transects {
        true => states::options(archive, &entries)?,
        false => vec![None; entries.len()],
    };
    let finds_its_model = |regime: &str| {
        [Regime::Branch, Regime::FoldCurve, Regime::Calibration].iter().any(|r| r.name() == regime)
    };
    let mut stored = Vec::with_capacity(entries.len());
    for (((index, entry), profile), options) in
        indices.into_iter().zip(entries).zip(profiles).zip(options)
    {
        let run_id = entry.row.text("run_id").to_owned();
        let outcome = if wants_transects && finds_its_model(entry.row.text("regime")) {
            read::outcome(archive, &entry)?
        } else {
            Outcome { profile, ..read::without_tables(&entry)? }
        };
        stored.push(Stored { index, run_id, outcome, options });
    }
    Ok(stored)
}

/// The run of which something is the result, as it was asked for.
pub(super) async fn run_of(
    store: &Store,
    run_id: &str,
    outcome: &Outcome,
) -> Result<RunSpec, Problem> {
    let in_row = outcome.provenance.as_ref().and_then(|p| p.options.clone());
    let options = match in_row {
        Some(options) => Some(options),
        None => {
            let address = catalogue::address(&mut *store.read().await?, run_id).await?;
            match address {
                Some(address) => options_of_sweep(store, address.sweep).await?,
                None => None,
            }
        }
    };
    let run = options.and_then(|options| outcome.run(&options));
    run.ok_or_else(|| Problem::conflict("what the run was asked for is not stored any more"))
}

/// What identifies a sweep's runs beside parameters and closure, by its document.
async fn options_of_sweep(store: &Store, sweep: i64) -> Result<Option<Arc<str>>, Problem> {
    let text = queue::document(&mut *store.read().await?, sweep).await?;
    let Some(text) = text else { return Ok(None) };
    let read = move || Document::parse(&text).ok()?.options_of_any_length();
    Ok(tokio::task::spawn_blocking(read).await?)
}

/// X₀ in the last state of a stored run, m, as runs that start from it take it; none if it is not stored.
async fn terminus_of(store: &Store, run_id: &str) -> Result<Option<f64>, Problem> {
    let entry = catalogue::run(&mut *store.read().await?, run_id).await?;
    Ok(entry.map(|entry| entry.scalars.terminus_x_m.unwrap_or(0.0)))
}

impl From<Unread> for Problem {
    fn from(error: Unread) -> Self {
        match error {
            Unread::NoSuchTime(refusal) => refusal.into(),
            error => Self::conflict(error.to_string()),
        }
    }
}

/// Shares of a length, from 0 to 1.
fn shares(field: &str, text: &str, most: usize) -> Result<Vec<f64>, Refusal> {
    let permitted = || format!("up to {most} numbers from 0 to 1, with commas between");
    let read = |text: &str| text.trim().parse().ok().filter(|chi| (0.0..=1.0).contains(chi));
    list(text, most, read).ok_or_else(|| Refusal::value(field, text, permitted()))
}

/// Indices of runs.
fn indices(field: &str, text: &str) -> Result<Vec<i64>, Refusal> {
    let permitted = || format!("up to {MOST_RUNS} indices of runs, with commas between");
    let read = |text: &str| text.trim().parse().ok().filter(|index| *index >= 0);
    list(text, MOST_RUNS, read).ok_or_else(|| Refusal::value(field, text, permitted()))
}

/// What stands between commas; none if anything is not as it should be, or there are too many.
fn list<T>(text: &str, most: usize, read: impl Fn(&str) -> Option<T>) -> Option<Vec<T>> {
    let items: Option<Vec<T>> = text.split(',').take(most + 1).map(read).collect();
    items.filter(|items| items.len() <= most)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_are_read_whole_or_refused() {
        assert_eq!(shares("chi", "0, 0.5,1", 3), Ok(vec![0.0, 0.5, 1.0]));
        assert_eq!(indices("runs", "7,0,7"), Ok(vec![7, 0, 7]));
        for text in ["", "0.5,", "1.01", "-0.1", "NaN", "a", "0,0,0,0"] {
            let refusal = shares("chi", text, 3).expect_err(text);
            assert_eq!(refusal.field.as_deref(), Some("chi"));
        }
        let many = vec!["1"; MOST_RUNS + 1].join(",");
        for text in ["", "1.5", "-1", "1;2", "99999999999999999999", &many] {
            assert_eq!(indices("runs", text).expect_err(text).field.as_deref(), Some("runs"));
        }
    }
}
