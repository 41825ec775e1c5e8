//! `melange reproduce`: the paper's claims beside what comes out, and its figures, drawn from an archive that
//! the command fills.

use super::serve::threads;
use super::sweep::work_off;
use crate::archive::{read, reuse};
use crate::domain::document::Document;
use crate::domain::outcome::{Outcome, Profile, Series};
use crate::domain::person::Actor;
use crate::domain::status::{Status, SweepState, Verb};
use crate::domain::sweep::{Limits, SweepSpec};
use crate::http::verbs;
use crate::queue::{self, Submission};
use crate::reproduce::experiments::{self, Experiment, Instant, Solved};
use crate::reproduce::pictures::{self, Picture};
use crate::reproduce::{Broken, Report, State, reproduce};
use crate::store::Store;
use anyhow::{Context, anyhow, bail};
use clap::ValueEnum;
use serde_json::Value;
use std::collections::BTreeMap;
use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;

/// Arguments of `melange reproduce`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Folder for the document with its pictures, and for the figures' data and the tables as CSV.
    #[arg(long)]
    out: Option<PathBuf>,
    /// Data directory of the figures' runs, where what is solved already is not solved again; `archive` in the
    /// folder if not given.
    #[arg(long, requires = "out")]
    data: Option<PathBuf>,
    /// Threads that solve the figures' runs; all of the machine's if not given.
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..=1024))]
    workers: Option<u16>,
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
    print(arguments, reproduce).await
}

/// The archive is opened before the claims are made, which takes longer: that somebody else uses it is told at once.
async fn print(
    arguments: &Arguments,
    claims: impl FnOnce() -> Result<Report, Broken> + Send + 'static,
) -> anyhow::Result<ExitCode> {
    let store = match &arguments.out {
        None => None,
        Some(folder) => {
            let data = arguments.data.clone().unwrap_or_else(|| folder.join("archive"));
            Some(Store::open(&data).await?)
        }
    };
    let made = make(store.as_ref(), claims, threads(arguments.workers)).await;
    if let Some(store) = store {
        store.close().await;
    }
    let (report, pictures) = made?;
    let report = Arc::new(report);
    if let Some(folder) = &arguments.out {
        let (report, folder) = (report.clone(), folder.clone());
        let writing = move || {
            let context = || format!("cannot write to {}", folder.display());
            report.write(&folder, &pictures).with_context(context)
        };
        tokio::task::spawn_blocking(writing).await??;
    }
    let shown = match arguments.format {
        Format::Text => report.as_text(),
        Format::Json => serde_json::to_string(&*report)? + "\n",
        Format::Markdown => report.as_markdown(),
    };
    std::io::stdout().write_all(shown.as_bytes()).context("cannot write the claims")?;
    Ok(ExitCode::SUCCESS)
}

/// The claims, and with an archive the figures.
async fn make(
    store: Option<&Store>,
    claims: impl FnOnce() -> Result<Report, Broken> + Send + 'static,
    threads: usize,
) -> anyhow::Result<(Report, Vec<Picture>)> {
    let report = tokio::task::spawn_blocking(claims).await??;
    let pictures = match store {
        Some(store) => draw(store, threads).await?,
        None => Vec::new(),
    };
    Ok((report, pictures))
}

/// Draws the figures from an archive, in which their runs are solved if need be.
async fn draw(store: &Store, threads: usize) -> anyhow::Result<Vec<Picture>> {
    let mut runs = solved(store, experiments::documents(), threads).await?;
    let relaxed = runs.get(&Experiment::Relaxation).and_then(|runs| runs.first());
    let limit = experiments::limit(relaxed.context("nothing came to rest")?)?;
    runs.extend(solved(store, vec![limit], threads).await?);
    Ok(tokio::task::spawn_blocking(move || pictures::draw(&runs)).await??)
}

/// Sweeps with their ids, which are queued unless they are there.
async fn submitted(
    store: &Store,
    documents: Vec<(Experiment, Value)>,
    threads: usize,
) -> anyhow::Result<(Vec<(Experiment, Arc<SweepSpec>)>, Vec<String>)> {
    let (mut sweeps, mut ids) = (Vec::new(), Vec::new());
    for (experiment, document) in documents {
        let sweep =
            Document::parse(&document.to_string()).and_then(|d| d.into_sweep(&Limits::MOST));
        let sweep = Arc::new(sweep.map_err(|refusal| anyhow!("{experiment:?}: {refusal}"))?);
        let submission = Submission {
            workers: threads,
            found: reuse::found(store, &sweep).await?,
            owner: Actor::operator().name,
            idempotency: Some((key(&sweep), String::new())),
        };
        ids.push(queue::enqueue(store, &sweep, submission).await?.id);
        sweeps.push((experiment, sweep));
    }
    Ok((sweeps, ids))
}

/// The runs of sweeps, which are solved unless they are there.
async fn solved(
    store: &Store,
    documents: Vec<(Experiment, Value)>,
    threads: usize,
) -> anyhow::Result<BTreeMap<Experiment, Vec<Solved>>> {
    let (sweeps, ids) = submitted(store, documents, threads).await?;
    for id in &ids {
        go_on(store, id).await?;
    }
    work_off(store, &ids, threads).await?;
    let mut runs = BTreeMap::new();
    for (experiment, sweep) in sweeps {
        let mut of_sweep = Vec::with_capacity(sweep.count());
        for index in 0..sweep.count() {
            let place = || format!("run {index} of `{}`", sweep.name());
            let outcome = read::stored(store, &sweep.run(index).id()).await?;
            let outcome = outcome.with_context(|| format!("{} has no result", place()))?;
            if !matches!(outcome.status, Status::Converged | Status::Completed) {
                bail!("{} ended {}: {}", place(), outcome.status.name(), outcome.detail);
            }
            of_sweep.push(plain(outcome).with_context(|| format!("{} has no state", place()))?);
        }
        runs.insert(experiment, of_sweep);
    }
    Ok(runs)
}

/// Has a sweep that was submitted before go on if it is held up or was given up, and its failed runs solved again.
async fn go_on(store: &Store, id: &str) -> anyhow::Result<()> {
    let row = queue::sweep_in_brief(&mut *store.read().await?, id).await?;
    let row = row.context("the sweep is gone from the data directory")?;
    let state = row.state();
    let is_held_up =
        matches!(state, SweepState::Paused | SweepState::Stopping | SweepState::Cancelled);
    let failed = row.counts.failed;
    for (verb, is_due, what) in [
        (Verb::Resume, is_held_up, format!("is {}: it goes on", state.name())),
        (Verb::Retry, failed > 0, format!("has {failed} failed runs: they are solved again")),
    ] {
        if is_due {
            let told = verbs::act(store, &Actor::operator(), id, verb).await;
            told.map_err(|p| anyhow!("the sweep `{}` cannot go on: {}", row.name, p.sentence()))?;
            eprintln!("the sweep `{}` {what}", row.name);
        }
    }
    Ok(())
}

/// The same sweep of the same model is submitted once, however often the command is given; it is again when it was
/// deleted, or when a run's identity has changed.
fn key(sweep: &SweepSpec) -> String {
    let mut hash = blake3::Hasher::new();
    for index in 0..sweep.count() {
        hash.update(sweep.run(index).id().as_bytes());
    }
    format!("melange reproduce: {}, {}", sweep.name(), hash.finalize().to_hex())
}

/// What is drawn of a run.
fn plain(outcome: Outcome) -> Option<Solved> {
    Some(Solved {
        parameters: outcome.parameters.0,
        state: state(outcome.profile?)?,
        states: outcome
            .states
            .unwrap_or_default()
            .into_iter()
            .map(|stored| Some((stored.time_a, state(stored.profile)?)))
            .collect::<Option<_>>()?,
        series: outcome.series.map(|series| instants(&series)).unwrap_or_default(),
    })
}

fn state(profile: Profile) -> Option<State> {
    Some(State {
        length_m: *profile.node_x_m.last()?,
        velocity_m_per_a: profile.velocity_m_per_a,
        mu_w: profile.mu_w,
        thickness_m: profile.thickness_m,
        fluidity_per_a: profile.fluidity_per_a,
    })
}

fn instants(s: &Series) -> Vec<Instant> {
    let instant = |i: usize| Instant {
        time_a: s.time_a[i],
        melt_m_per_day: s.melt_rate_m_per_day[i],
        calving_m_per_a: s.calving_rate_m_per_a[i],
        thickness_0_m: s.thickness_0_m[i],
        force_n_per_m: s.force_n_per_m[i],
    };
    (0..s.time_a.len()).map(instant).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    async fn state(store: &Store, id: &str) -> SweepState {
        let mut tx = store.read().await.expect("a connection");
        let row = queue::sweep_in_brief(&mut tx, id).await;
        row.expect("it is read").expect("it is there").state()
    }

    #[tokio::test]
    async fn a_sweep_that_was_given_up_or_held_up_goes_on() {
        let folder = tempfile::tempdir().expect("a folder");
        let store = Store::open(folder.path()).await.expect("a store");
        for (n_cells, verbs, then) in [
            (20, &[Verb::Cancel][..], SweepState::Cancelled),
            (21, &[Verb::Pause], SweepState::Paused),
            (22, &[Verb::Stop], SweepState::Cancelled),
            (23, &[], SweepState::Queued),
        ] {
            let document = json!({"name": "two melts", "regime": "steady", "parameters": {"n_cells": n_cells},
                "axes": [{"parameter": "melt_rate_m_per_day", "values": [0.8, 0.9]}]});
            let document = || vec![(Experiment::Melts, document.clone())];
            let (_, ids) = submitted(&store, document(), 1).await.expect("it is submitted");
            for verb in verbs {
                let told = verbs::act(&store, &Actor::operator(), &ids[0], *verb).await;
                assert!(told.is_ok(), "{verb:?}");
            }
            assert_eq!(state(&store, &ids[0]).await, then);
            let runs = solved(&store, document(), 1).await.expect("it is solved");
            assert_eq!(runs[&Experiment::Melts].len(), 2);
            assert_eq!(state(&store, &ids[0]).await, SweepState::Complete);
            let (_, again) = submitted(&store, document(), 1).await.expect("it is known");
            assert_eq!(again, ids, "{then:?}");
        }
        store.close().await;
    }

    #[tokio::test]
    async fn an_archive_in_use_is_told_before_anything_is_solved() {
        let folder = tempfile::tempdir().expect("a folder");
        let store = Store::open(&folder.path().join("archive")).await.expect("a store");
        let out = Some(folder.path().to_owned());
        let arguments = Arguments { out, data: None, workers: Some(1), format: Format::Text };
        let error = print(&arguments, || panic!("it is solved")).await.expect_err("it is in use");
        assert!(error.to_string().contains("in use"), "{error}");
        store.close().await;
    }
}
