//! Lists and counts of sweeps larger than what is counted without an index, and than what is sorted from one.

use super::filled::filled;
use super::list::{count, runs};
use super::{Listing, Order, kind_of};
use crate::domain::filter::Filter;
use crate::store::Store;
use serde_json::{Value, json};

/// A store with one sweep of d by b: 400 values of b for each one of d. One in ten runs found no steady
/// state, one in 500 failed; those that failed have no force, nor have the last thousand.
async fn store(runs: i64) -> (tempfile::TempDir, Store) {
    let (d, b) = ("10 + (i / 400) * 0.1", "1e4 + 10.0 * (i % 400)");
    let status = "CASE WHEN i % 500 = 7 THEN 'failed' WHEN i % 10 = 3 THEN 'no_steady_state' ELSE 'converged' END";
    let has_force = format!("i < {} AND i % 500 <> 7", runs - 1000);
    let force = format!("CASE WHEN {has_force} THEN 1e6 + (i * 7919) % 1000 END");
    let columns = [
        ("d_m", d),
        ("axis_1", d),
        ("b", b),
        ("axis_2", b),
        ("status", status),
        ("force_n_per_m", force.as_str()),
    ];
    filled(runs, &columns).await
}

#[tokio::test]
async fn counts_are_exact_where_an_index_tells_and_say_so_where_none_does() {
    let (_folder, store) = store(120_000).await;
    let mut tx = store.read().await.expect("a transaction");
    for (text, total, is_exact) in [
        // d is the first axis, b the second one: their places follow the table of parameters.
        ("d_m < 20", 40_000, true),
        ("10005 <= b <= 10025", 600, true),
        ("force_n_per_m is null", 1_000 + 238, true),
        ("status = 'failed'", 240, true),
        ("status != 'converged'", 12_000 + 240, true),
        ("status = 'overthick'", 0, true),
        // A condition with an index lets few through.
        ("status = 'failed' and iterations = 7", 120, true),
        ("119000 <= run_index and b = 10010", 2, true),
        // Among the first 100,000 runs: a hundred of each number of iterations.
        ("iterations = 17", 100, false),
        ("d_m < 20 and b > 11995", 100 * 200, false),
    ] {
        let filter = Filter::parse(text, &kind_of).expect("it is a filter");
        let order = Order { column: "run_index", descending: false };
        let axes = vec!["d_m", "b"];
        let filter = Some(&filter);
        let listing = Listing { sweep: 1, axes, filter, order, limit: 50, after: None };
        let counted = count(&mut tx, &listing).await.expect("it counts");
        assert_eq!((counted.total, counted.is_exact), (total, is_exact), "{text}");
        let (page, _) = runs(&mut tx, &listing).await.expect("it lists");
        assert_eq!(page.len(), total.min(50) as usize, "{text}");
    }
}

#[tokio::test]
async fn pages_go_on_where_the_last_one_ended_in_every_order() {
    const RUNS: i64 = 6_000;
    let (_folder, store) = store(RUNS).await;
    let mut tx = store.read().await.expect("a transaction");
    for (column, descending) in [("force_n_per_m", false), ("force_n_per_m", true), ("b", true)] {
        let order = Order { column, descending };
        let mut after: Option<(Value, i64)> = None;
        let mut seen = 0;
        let mut last: Option<(f64, i64)> = None;
        loop {
            let axes = vec!["d_m", "b"];
            let listing =
                Listing { sweep: 1, axes, filter: None, order, limit: 300, after: after.take() };
            let (page, next) = runs(&mut tx, &listing).await.expect("it lists");
            for row in &page {
                // Null is lowest.
                let value = row.0[column].as_f64().unwrap_or(f64::NEG_INFINITY);
                let key = (value, row.0["run_index"].as_i64().expect("an index"));
                let is_next = last.is_none_or(|l| if descending { key < l } else { key > l });
                assert!(is_next, "{column}: {key:?} after {last:?}");
                last = Some(key);
            }
            seen += page.len() as i64;
            match next {
                Some(next) => after = Some(next),
                None => break,
            }
        }
        assert_eq!(seen, RUNS, "{column}");
    }
}

/// What a run is listed by here.
struct Plain {
    index: i64,
    status: String,
    iterations: f64,
    d: f64,
    b: f64,
    force: Option<f64>,
}

impl Plain {
    /// The value of a column.
    fn value(&self, column: &str) -> Value {
        match column {
            "run_index" => json!(self.index),
            "status" => json!(self.status),
            "iterations" => json!(self.iterations),
            "d_m" => json!(self.d),
            "force_n_per_m" => json!(self.force),
            "validity" => Value::Null,
            other => panic!("{other} is not sorted by here"),
        }
    }

    /// Where it stands in the order of a column: null is lowest.
    fn key(&self, column: &str) -> (f64, String, i64) {
        let (number, text) = match self.value(column) {
            Value::Null => (f64::NEG_INFINITY, String::new()),
            Value::String(text) => (0.0, text),
            number => (number.as_f64().expect("a number"), String::new()),
        };
        (number, text, self.index)
    }
}

type Lets = fn(&Plain) -> bool;

/// Filters by which runs are found along every index, and what they let through.
const FILTERS: [(&str, Lets); 14] = [
    ("run_index >= 0", |_| true),
    ("status = 'failed'", |r| r.status == "failed"),
    ("status != 'converged'", |r| r.status != "converged"),
    ("status in ('failed', 'converged')", |r| r.status != "no_steady_state"),
    ("status is null", |_| false),
    ("force_n_per_m is null", |r| r.force.is_none()),
    ("1000100 < force_n_per_m", |r| r.force.is_some_and(|f| f > 1_000_100.0)),
    ("status = 'failed' and force_n_per_m > 0", |_| false),
    ("status = 'converged' and force_n_per_m > 1000050", |r| {
        r.status == "converged" && r.force.is_some_and(|f| f > 1_000_050.0)
    }),
    ("11 <= d_m < 12 and (b > 12000 and iterations < 500)", |r| {
        r.d >= 11.0 && r.d < 12.0 && r.b > 12_000.0 && r.iterations < 500.0
    }),
    ("iterations = 17", |r| r.iterations == 17.0),
    ("not (status = 'converged') or b > 13900", |r| r.status != "converged" || r.b > 13_900.0),
    ("run_index < 28000 and status != 'failed'", |r| r.index < 28_000 && r.status != "failed"),
    ("run_id in ('id5', 'id29990', 'none') and run_id != 'id5'", |r| r.index == 29_990),
];

#[tokio::test]
async fn a_page_is_what_looking_at_every_run_would_find() {
    const LIMIT: usize = 20;
    // So many that those that converged are not few.
    let (_folder, store) = store(30_000).await;
    let mut tx = store.read().await.expect("a transaction");
    let rows: Vec<(i64, String, f64, f64, f64, Option<f64>)> = sqlx::query_as(
        "SELECT run_index, status, CAST(iterations AS DOUBLE PRECISION), d_m, b, force_n_per_m FROM runs",
    )
    .fetch_all(&mut *tx)
    .await
    .expect("it reads");
    let mut all: Vec<Plain> = rows
        .into_iter()
        .map(|(index, status, iterations, d, b, force)| Plain {
            index,
            status,
            iterations,
            d,
            b,
            force,
        })
        .collect();
    for sort in ["run_index", "force_n_per_m", "d_m", "status", "iterations", "validity"] {
        let key = |run: &Plain| run.key(sort);
        all.sort_by(|x, y| key(x).partial_cmp(&key(y)).expect("there is no NaN"));
        for (text, lets) in FILTERS {
            let filter = Filter::parse(text, &kind_of).expect("it is a filter");
            let mut found: Vec<&Plain> = all.iter().filter(|run| lets(run)).collect();
            for descending in [false, true] {
                if descending {
                    found.reverse();
                }
                // The first page, one amid, the last one, and one that goes from or to runs without a value.
                let has_value = |run: &&Plain| !run.value(sort).is_null();
                let turn = found.iter().position(|run| has_value(run) != has_value(&found[0]));
                for start in [0, found.len() / 2, found.len().saturating_sub(5)]
                    .into_iter()
                    .chain(turn.map(|turn| turn.saturating_sub(7)))
                {
                    let after = start.checked_sub(1).and_then(|before| found.get(before));
                    let listing = Listing {
                        sweep: 1,
                        axes: vec!["d_m", "b"],
                        filter: Some(&filter),
                        order: Order { column: sort, descending },
                        limit: LIMIT as i64,
                        after: after.map(|run| (run.value(sort), run.index)),
                    };
                    let (page, next) = runs(&mut tx, &listing).await.expect("it lists");
                    let page: Vec<_> = page
                        .iter()
                        .map(|row| row.0["run_index"].as_i64().expect("an index"))
                        .collect();
                    let expected: Vec<i64> =
                        found.iter().skip(start).take(LIMIT).map(|run| run.index).collect();
                    assert_eq!(page, expected, "{text}, {sort}, descending: {descending}, {start}");
                    assert_eq!(next.is_some(), page.len() == LIMIT);
                }
            }
        }
    }
}
