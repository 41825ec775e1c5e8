//! Lists of the runs of many sweeps, and the nearest of them, beside what looking at every run finds.

use super::super::{kind_of, nearest};
use super::*;
use crate::domain::filter::Resolved;
use crate::domain::nearness::Nearness;
use crate::domain::parameters::PARAMETERS;
use crate::domain::status::{Counts, Status, SweepState};
use crate::store::Store;
use sqlx::AssertSqlSafe;

/// A run as it is made for these tests.
#[derive(Debug, Clone)]
struct Plain {
    sweep: i64,
    index: i64,
    id: String,
    status: Status,
    melt: f64,
    width: f64,
    d: f64,
    force: Option<f64>,
}

/// Numbers that look like random ones and are always the same.
struct Numbers(u64);

impl Numbers {
    fn below(&mut self, n: u64) -> u64 {
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % n
    }
}

/// Sweeps of one to three parameters, on grids and off, some with points of others, one of a single point many
/// times, and one whose ranges nobody knows.
fn plain() -> Vec<Plain> {
    let mut numbers = Numbers(7);
    let mut runs: Vec<Plain> = Vec::new();
    for sweep in 1..=14 {
        let count = [1, 7, 30, 90][numbers.below(4) as usize];
        let varies = if sweep == 5 { 0 } else { 1 + numbers.below(7) };
        let origin = numbers.below(5) as f64;
        for index in 0..count {
            let mut place = |bit: u64| match varies & bit {
                0 => origin,
                _ if sweep % 3 == 0 => numbers.below(1_000) as f64 / 100.0,
                _ => numbers.below(6) as f64,
            };
            let (melt, width, d) =
                (0.5 + 0.1 * place(1), 3000.0 + 250.0 * place(2), 10.0 + 5.0 * place(4));
            let failed = numbers.below(9) == 0;
            let status = match numbers.below(3) {
                _ if failed => Status::Failed,
                0 => Status::NoSteadyState,
                _ => Status::Converged,
            };
            let force = (status == Status::Converged).then(|| numbers.below(50) as f64);
            // What is the same has the same id, as in the archive.
            let id = format!("{melt} {width} {d}");
            runs.push(Plain { sweep, index, id, status, melt, width, d, force });
        }
    }
    runs
}

async fn store(runs: &[Plain]) -> (tempfile::TempDir, Store) {
    let folder = tempfile::tempdir().expect("a folder");
    let store = Store::open(folder.path()).await.expect("a store");
    let mut tx = store.write().await.expect("a transaction");
    let names: String = PARAMETERS.iter().map(|p| format!(", \"{}\"", p.name)).collect();
    for run in runs {
        let values: String = PARAMETERS
            .iter()
            .map(|p| match p.name {
                "melt_rate_m_per_day" => format!(", {:?}", run.melt),
                "width_m" => format!(", {:?}", run.width),
                "d_m" => format!(", {:?}", run.d),
                _ => format!(", {:?}", p.default),
            })
            .collect();
        let axis = |i: usize| match axes(runs, run.sweep).get(i).copied() {
            Some("melt_rate_m_per_day") => format!("{:?}", run.melt),
            Some("width_m") => format!("{:?}", run.width),
            Some(_) => format!("{:?}", run.d),
            None => "NULL".into(),
        };
        let sql = format!(
            "INSERT INTO runs (sweep, run_index, run_id, chunk, home_sweep, home_chunk, status, detail, regime, \
             upstream_closure, iterations, axis_1, axis_2, axis_3, force_n_per_m{names}) \
             VALUES ({}, {}, '{}', 0, {}, 0, '{}', '50% DONE', 'steady', 'published', {}, {}, {}, {}, {}{values})",
            run.sweep,
            run.index,
            run.id,
            run.sweep,
            run.status.name(),
            run.index % 5,
            axis(0),
            axis(1),
            axis(2),
            run.force.map_or("NULL".into(), |force| format!("{force:?}")),
        );
        sqlx::query(AssertSqlSafe(sql)).execute(&mut *tx).await.expect("the row fits the schema");
    }
    for facts in facts(runs) {
        let sql = "INSERT INTO homes VALUES ($1, 0, $1, 0, $2, 0, $2, 0)";
        let home = sqlx::query(sql).bind(facts.number).bind(facts.stored());
        home.execute(&mut *tx).await.expect("the row fits the schema");
    }
    tx.commit().await.expect("it commits");
    (folder, store)
}

type Get = fn(&Plain) -> f64;
/// In the order of the table of parameters.
const VARIED: [(&str, Get); 3] =
    [("melt_rate_m_per_day", |r| r.melt), ("width_m", |r| r.width), ("d_m", |r| r.d)];

fn of_sweep(runs: &[Plain], sweep: i64) -> impl Iterator<Item = &Plain> + Clone {
    runs.iter().filter(move |run| run.sweep == sweep)
}

fn range(runs: &[Plain], sweep: i64, get: Get) -> (f64, f64) {
    let values = of_sweep(runs, sweep).map(get);
    (values.clone().fold(f64::INFINITY, f64::min), values.fold(f64::NEG_INFINITY, f64::max))
}

fn axes(runs: &[Plain], sweep: i64) -> Vec<&'static str> {
    let varies = |get: Get| range(runs, sweep, get).0 < range(runs, sweep, get).1;
    VARIED.into_iter().filter(|(_, get)| varies(*get)).map(|(name, _)| name).collect()
}

/// The newest first.
fn facts(runs: &[Plain]) -> Vec<SweepFacts> {
    let newest = runs.iter().map(|run| run.sweep).max().expect("a sweep");
    let facts = |number: i64| {
        let mut counts = Counts::default();
        of_sweep(runs, number).for_each(|run| counts.add(run.status, 1));
        counts.total = of_sweep(runs, number).count() as i64;
        let known = VARIED.into_iter().filter(|_| number != 9);
        SweepFacts {
            number,
            id: format!("s{number}"),
            name: format!("sweep {number}"),
            owner: Some(if number % 2 == 0 { "ada" } else { "bo" }.into()),
            note: None,
            tags: Vec::new(),
            created_at: "2026-11-22T13:57:00.123Z".into(),
            regime: Some("steady".into()),
            state: SweepState::Complete,
            priority: 0,
            reused: 0,
            counts,
            axes: axes(runs, number).into_iter().map(str::to_owned).collect(),
            ranges: known
                .map(|(name, get)| {
                    let (low, high) = range(runs, number, get);
                    (name.to_owned(), low, high)
                })
                .collect(),
        }
    };
    (1..=newest).rev().map(facts).collect()
}

fn candidates<'a>(facts: &'a [SweepFacts], text: &str) -> Vec<Candidate<'a>> {
    let kind =
        |name: &str| kind_of(name).or_else(|| crate::domain::found::kind_of_sweeps_column(name));
    let filter = Filter::parse(text, &kind).expect("it is a filter");
    let candidate = |facts: &'a SweepFacts| {
        let filter = match filter.resolve(&|column| facts.of_runs(column)) {
            Resolved::Always => None,
            Resolved::Never => return None,
            Resolved::Depends(left) => Some(left),
        };
        Some(Candidate { facts, filter })
    };
    facts.iter().filter_map(candidate).collect()
}

type Lets = fn(&Plain) -> bool;

const FILTERS: [(&str, Lets); 10] = [
    ("run_index >= 0", |_| true),
    ("owner = 'ada' and melt_rate_m_per_day < 0.7", |r| r.sweep % 2 == 0 && r.melt < 0.7),
    ("not (status = 'failed' or width_m > 3500)", |r| {
        r.status != Status::Failed && r.width <= 3500.0
    }),
    ("force_n_per_m > 40 or sweep_id in ('s3', 's5')", |r| {
        r.force.is_some_and(|f| f > 40.0) || [3, 5].contains(&r.sweep)
    }),
    ("iterations = 3 and d_m = 20", |r| r.index % 5 == 3 && r.d == 20.0),
    ("status ~ 'STEADY' and detail ~ '50% d' and not detail ~ '5_%'", |r| {
        r.status == Status::NoSteadyState
    }),
    ("force_n_per_m is null and d_m >= 15", |r| r.force.is_none() && r.d >= 15.0),
    ("melt_rate_m_per_day > 100", |_| false),
    ("run_id = '0.5 3000 10' and run_index < 10", |r| r.id == "0.5 3000 10" && r.index < 10),
    ("created_at = '2026-11' and sweep_name ~ 'SWEEP 1' and d_m != 10", |r| {
        (r.sweep == 1 || r.sweep >= 10) && r.d != 10.0
    }),
];

/// Where a run stands in an order: null is lowest, of equals those of newer sweeps come first.
fn compare(sort: Option<&str>, descending: bool, a: &Plain, b: &Plain) -> Ordering {
    let number = |run: &Plain| match sort {
        Some("melt_rate_m_per_day") => run.melt,
        Some("width_m") => run.width,
        Some("force_n_per_m") => run.force.unwrap_or(f64::NEG_INFINITY),
        Some("run_index") => run.index as f64,
        Some("iterations") => (run.index % 5) as f64,
        _ => 0.0,
    };
    let text = |run: &Plain| if sort == Some("status") { run.status.name() } else { "" };
    let directed = |order: Ordering| if descending { order.reverse() } else { order };
    directed(number(a).total_cmp(&number(b)).then_with(|| text(a).cmp(text(b))))
        .then_with(|| b.sweep.cmp(&a.sweep))
        .then_with(|| directed(a.index.cmp(&b.index)))
}

#[tokio::test]
async fn pages_of_all_sweeps_are_what_looking_at_every_run_finds() {
    let runs = plain();
    let (_folder, store) = store(&runs).await;
    let facts = facts(&runs);
    let mut tx = store.read().await.expect("a transaction");
    let sorts =
        ["melt_rate_m_per_day", "width_m", "force_n_per_m", "status", "run_index", "iterations"];
    let orders = sorts.into_iter().flat_map(|sort| [(Some(sort), false), (Some(sort), true)]);
    for (sort, descending) in std::iter::once((None, false)).chain(orders) {
        for (text, lets) in FILTERS {
            let mut expected: Vec<&Plain> = runs.iter().filter(|run| lets(run)).collect();
            expected.sort_by(|a, b| compare(sort, descending, a, b));
            let expected: Vec<(i64, i64)> = expected.iter().map(|r| (r.sweep, r.index)).collect();
            let candidates = candidates(&facts, text);
            for limit in [17, 1_000] {
                let mut found = Vec::new();
                let mut after = None;
                loop {
                    let order = sort.map(|column| Order { column, descending });
                    let across = Across { candidates: &candidates, order, limit, after };
                    let (page, end) = runs_across(&mut tx, &across).await.expect("it lists");
                    found.extend(page.iter().map(|(sweep, row)| {
                        (*sweep, row.0["run_index"].as_i64().expect("an index"))
                    }));
                    assert!(found.len() <= expected.len(), "{text}, {sort:?}: some twice");
                    after = end;
                    if after.is_none() {
                        break;
                    }
                }
                assert_eq!(found, expected, "{text}, {sort:?}, descending: {descending}, {limit}");
            }
            let counted = count_across(&mut tx, &candidates).await.expect("it counts");
            assert_eq!((counted.total, counted.is_exact), (expected.len() as i64, true), "{text}");
        }
    }
}

#[tokio::test]
async fn the_nearest_runs_are_those_that_looking_at_every_run_finds() {
    let runs = plain();
    let (_folder, store) = store(&runs).await;
    let facts = facts(&runs);
    let mut tx = store.read().await.expect("a transaction");
    let mut numbers = Numbers(11);
    for case in 0..200 {
        let mut given: Vec<(&str, Get, f64)> = Vec::new();
        let which = 1 + numbers.below(7);
        for (bit, (name, get)) in VARIED.into_iter().enumerate() {
            // On the grid, between its points, and far outside.
            let at = match numbers.below(3) {
                0 => numbers.below(6) as f64,
                1 => numbers.below(600) as f64 / 100.0,
                _ => numbers.below(4_000) as f64 / 100.0,
            };
            let value = [0.5 + 0.1 * at, 3000.0 + 250.0 * at, 10.0 + 5.0 * at][bit];
            if which & (1 << bit) != 0 {
                given.push((name, get, value));
            }
        }
        let near = Nearness::new(given.iter().map(|(name, _, value)| (*name, *value)))
            .expect("they are parameters");
        let most = [1, 3, 10, 100][numbers.below(4) as usize];
        let (text, lets) = FILTERS[numbers.below(FILTERS.len() as u64) as usize];
        let distance = |run: &Plain| {
            let values: Vec<f64> = given.iter().map(|(_, get, _)| get(run)).collect();
            near.distance(&values)
        };
        let mut all: Vec<(f64, &Plain)> =
            runs.iter().filter(|run| lets(run)).map(|run| (distance(run), run)).collect();
        all.sort_by(|a, b| a.0.total_cmp(&b.0).then_with(|| compare(None, false, a.1, b.1)));
        let mut ids = HashSet::new();
        all.retain(|(_, run)| ids.insert(&run.id));
        let expected: Vec<_> = all.iter().take(most).map(|(d, r)| (*d, r.sweep, r.index)).collect();

        let found =
            nearest(&mut tx, &candidates(&facts, text), &near, most).await.expect("it finds");
        let found: Vec<_> = found
            .iter()
            .map(|n| (n.distance, n.sweep, n.row.0["run_index"].as_i64().expect("an index")))
            .collect();
        assert_eq!(found, expected, "{case}: {:?}, {most}, {text}", near.wanted());
    }
}

#[tokio::test]
async fn what_would_take_long_to_count_says_so_and_long_pages_end_early() {
    let runs = plain();
    let (_folder, store) = store(&runs).await;
    let mut facts = facts(&runs);
    // As if the newest sweeps were very long ones.
    for facts in &mut facts[..2] {
        facts.counts.converged += 600_000;
    }
    let candidates = candidates(&facts, "iterations >= 0");
    let mut tx = store.read().await.expect("a transaction");
    let counted = count_across(&mut tx, &candidates).await.expect("it counts");
    assert!(!counted.is_exact && counted.total > 0 && counted.total < runs.len() as i64);
    let across = |after| Across { candidates: &candidates, order: None, limit: 10_000, after };
    let (first, end) = runs_across(&mut tx, &across(None)).await.expect("it lists");
    let end = end.expect("it goes on");
    assert_eq!((end.sweep, end.index), (facts[2].number + 1, None));
    let (rest, end) = runs_across(&mut tx, &across(Some(end))).await.expect("it lists");
    assert_eq!((first.len() + rest.len(), end), (runs.len(), None));
}
