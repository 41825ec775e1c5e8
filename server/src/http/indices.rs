//! Sensitivity indices over REST: which parameter makes how much of a result's variance.

use super::Service;
use super::error::Problem;
use super::extract::{Asked, Place};
use crate::analysis::indices::{self, Indices, Question, Scale};
use crate::archive::catalogue;
use crate::domain::refusal::Refusal;
use crate::domain::sample::Design;
use crate::domain::status::Pending;
use crate::queue;
use crate::store::Connection;
use axum::Json;
use axum::extract::State;
use serde::Deserialize;
use tokio::sync::Semaphore;
use tokio_util::sync::CancellationToken;
use utoipa::IntoParams;

/// Which indices.
#[derive(Debug, Clone, Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub struct IndicesQuery {
    /// Parameter or scalar whose variance is shared out.
    pub y: String,
    /// `log` takes the variance of ln y.
    #[serde(default)]
    pub scale: Scale,
    /// Resamples for the intervals, from 100 to 10000; 1000 if not given, or fewer where the sweep has more than two
    /// million runs: runs times resamples are at most 2·10⁹.
    pub resamples: Option<u64>,
    /// Seed of the resamples.
    #[serde(default)]
    pub seed: u64,
}

/// Sobol's indices of a design's parameters, of first order and total, with intervals. The sweep's points must be a
/// sample of method `saltelli`, and every run must have a result.
#[utoipa::path(
    get, path = "/sweeps/{id}/indices", params(("id" = String, Path,), IndicesQuery),
    responses(
        (status = 200, body = Indices), (status = 400, body = Problem), (status = 404, body = Problem),
        (status = 409, body = Problem, description = "Its points are no such design, runs have not ended or have no y, or y does not vary"),
        (status = 422, body = Problem),
    )
)]
pub async fn of_sweep(
    State(service): State<Service>,
    Place(id): Place<String>,
    Asked(query): Asked<IndicesQuery>,
) -> Result<Json<Indices>, Problem> {
    /// One at a time: a large design takes memory and seconds.
    static ONE: Semaphore = Semaphore::const_new(1);
    let one = ONE.acquire().await.ok();
    let turn = service.store.long_read().await?;
    let mut tx = service.store.read().await?;
    let found = Found::look(&mut tx, &id, query).await?;
    drop((tx, turn));
    found.indices(one).await.map(Json)
}

/// A design with its results.
#[derive(Debug)]
pub struct Found {
    /// Name of the sweep.
    pub name: String,
    parameters: Vec<String>,
    values: Vec<f64>,
    question: Question,
}

/// Resamples that can be asked for.
const RESAMPLES: [u64; 2] = [100, 10_000];
/// Resamples if nobody asks for a number of them.
const USUAL: u64 = 1_000;
/// Most runs times resamples: 3 to 9 s on a busy core, with optimisation (measured: 1 to 5 s for each 10⁹).
const MOST_WORK: u64 = 2_000_000_000;

/// Resamples of a design of so many runs, checked.
fn resamples(asked: Option<u64>, runs: usize) -> Result<usize, Refusal> {
    let [least, most] = RESAMPLES;
    let most = most.min(MOST_WORK / (runs as u64).max(1)).max(least);
    let resamples = asked.unwrap_or(USUAL.min(most));
    if !(least..=most).contains(&resamples) {
        let permitted = format!("from {least} to {most} for a sweep of {runs} runs");
        return Err(Refusal::value("resamples", resamples, permitted));
    }
    Ok(resamples as usize)
}

impl Found {
    /// Looks for a sweep's design and its results; refused with a sentence unless all of them are there.
    pub async fn look(
        connection: &mut Connection,
        id: &str,
        query: IndicesQuery,
    ) -> Result<Self, Problem> {
        let IndicesQuery { y, scale, resamples: asked, seed } = query;
        if !catalogue::is_number(&y) {
            let permitted = "a parameter or a number of the result";
            return Err(Refusal::value("y", y, permitted).into());
        }
        let sweep = queue::sweep_in_brief(connection, id).await?;
        let sweep = sweep.ok_or_else(|| Problem::not_found("sweep", id))?;
        let design = Design::of_document(&sweep.document).ok_or_else(|| {
            Problem::conflict(
                "the sweep's points are no design for indices: they need a sample of method `saltelli`",
            )
        })?;
        let total = design.runs();
        let resamples = resamples(asked, total)?;
        let stored = catalogue::count_stored(connection, sweep.number).await?;
        let missing = (total as i64).saturating_sub(stored);
        if missing != 0 {
            let pending = Pending::ALL.iter().map(|pending| pending.name());
            let pending = pending.filter_map(|name| Some((name, sweep.counts.named(name)?)));
            let waiting = told(pending.filter(|(_, count)| *count > 0));
            return Err(Problem::conflict(format!(
                "{missing} of {total} runs have no result yet ({waiting}), and the indices need all of them"
            )));
        }
        let results = catalogue::results(connection, sweep.number, &y).await?;
        if results.values.len() != total {
            let without = total - results.values.len().min(total);
            let by_status = told(results.without.iter().map(|(name, count)| (name, *count as i64)));
            return Err(Problem::conflict(format!(
                "{without} of {total} runs have no `{y}` ({by_status}), and the indices need that of every \
                 run: submit narrower ranges, within which each has one"
            )));
        }
        let question = Question { y, scale, resamples, seed };
        Ok(Self {
            name: sweep.name,
            parameters: design.parameters,
            values: results.values,
            question,
        })
    }

    /// The indices, computed off the threads that must not wait. Who gives up waiting ends the work soon, and what is
    /// held for it is held until then.
    pub async fn indices(self, held: impl Send + 'static) -> Result<Indices, Problem> {
        let Self { parameters, values, question, .. } = self;
        let given_up = CancellationToken::new();
        let _waiting = given_up.clone().drop_guard();
        let told = tokio::task::spawn_blocking(move || {
            let _held = held;
            indices::indices(&parameters, values, question, || !given_up.is_cancelled())
        });
        told.await?.map_err(|e| Problem::conflict(e.to_string()))
    }
}

/// Counts by name, as part of a sentence.
fn told<T: std::fmt::Display>(counts: impl Iterator<Item = (T, i64)>) -> String {
    counts.map(|(name, count)| format!("{count} {name}")).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests;
