//! Columns of runs beside what the rows say, and the choice among too many, with ids of all kinds.

use super::super::filled::filled;
use super::*;
use crate::store::Store;

/// A store with a sweep of so many runs, whose ids are what an expression of i makes of them. One in ten failed and
/// has no force.
async fn store(runs: i64, id: &str) -> (tempfile::TempDir, Store) {
    let columns = [
        ("run_id", id),
        ("d_m", "10 + i * 0.1"),
        ("axis_1", "10 + i * 0.1"),
        ("status", "CASE WHEN i % 10 = 3 THEN 'failed' ELSE 'converged' END"),
        ("force_n_per_m", "CASE WHEN i % 10 <> 3 THEN 1e6 + i END"),
        ("volume_m3", "9e999"),
        ("iterations", "i % 7"),
    ];
    filled(runs, &columns).await
}

/// Evenly spread like hashes.
const HASH: &str = "printf('%08x%024x', (i * 2654435761 + 12345) % 4294967296, i)";

#[tokio::test]
async fn columns_hold_what_the_rows_say_in_their_order() {
    let (_folder, store) = store(500, HASH).await;
    let mut tx = store.read().await.expect("a transaction");
    let names = vec!["force_n_per_m", "n_cells", "iterations", "regime", "volume_m3", "validity"];
    let extract = Extract { sweep: 1, axes: vec!["d_m"], filter: None, names, most: Some(500) };
    let all = sheet(&mut tx, &extract).await.expect("it reads");
    assert_eq!((all.total, all.run_index.len()), (500, 500));
    assert!(all.run_index.iter().copied().eq(0..500));
    assert_eq!((all.status[3], all.status[4]), ("failed", "converged"));
    let [force, cells, iterations, regime, infinite, none] = &all.columns[..] else { panic!() };
    let Column::Numbers(force) = force else { panic!("{force:?}") };
    assert_eq!((force[3], force[4]), (None, Some(1_000_004.0)));
    assert_eq!(cells, &Column::Whole(vec![Some(50); 500]));
    assert_eq!(iterations, &Column::Whole((0..500).map(|i| Some(i % 7)).collect()));
    assert_eq!(regime, &Column::Texts(vec![Some("steady".into()); 500]));
    // JSON has no infinity, and a fit no use for it.
    assert_eq!(infinite, &Column::Numbers(vec![None; 500]));
    assert_eq!(none, &Column::Texts(vec![None; 500]));
    for (text, expected) in [
        ("status = 'failed'", (0..500).filter(|i| i % 10 == 3).collect::<Vec<i64>>()),
        ("d_m >= 59.95 or run_index = 2", vec![2]),
        ("run_index in (7, 499, 500)", vec![7, 499]),
        ("iterations = 5 and run_index < 20", vec![5, 12, 19]),
        ("force_n_per_m is null and not d_m > 12", vec![3, 13]),
    ] {
        let filter = Filter::parse(text, &kind_of).expect("it is a filter");
        let extract = Extract { filter: Some(&filter), ..extract.clone() };
        let some = sheet(&mut tx, &extract).await.expect("it reads");
        assert_eq!(some.run_index, expected, "{text}");
        assert_eq!(some.total, expected.len() as i64, "{text}");
    }
}

#[tokio::test]
async fn too_many_runs_are_those_of_least_id_whatever_the_ids() {
    // Like hashes; all alike in the beginning; all beyond any hash; the same for many runs.
    for id in [HASH, "'00000000' || (i * 7 % 3001)", "'x' || i", "'' || i % 40"] {
        let (_folder, store) = store(3_000, id).await;
        let mut tx = store.read().await.expect("a transaction");
        for text in [None, Some("d_m < 260"), Some("force_n_per_m is null")] {
            let filter = text.map(|text| Filter::parse(text, &kind_of).expect("it is a filter"));
            let (filter, axes) = (filter.as_ref(), vec!["d_m"]);
            let mut extract = Extract { sweep: 1, axes, filter, names: vec!["run_id"], most: None };
            let all = sheet(&mut tx, &extract).await.expect("it reads");
            let [Column::Texts(ids)] = &all.columns[..] else { panic!("{:?}", all.columns) };
            let mut by_id: Vec<_> = ids.iter().zip(&all.run_index).collect();
            by_id.sort();
            for most in [1, 40, 200, 2_990] {
                let mut expected: Vec<i64> = by_id.iter().take(most).map(|(_, i)| **i).collect();
                expected.sort_unstable();
                extract.most = Some(most as i64);
                let few = sheet(&mut tx, &extract).await.expect("it reads");
                assert_eq!(few.run_index, expected, "{id} {text:?} {most}");
                assert_eq!(few.total, all.total);
            }
        }
    }
}

#[test]
fn the_bound_of_ids_lets_more_than_enough_through_but_not_all() {
    for (most, total) in [(1, 1_000_000), (20_000, 100_000), (5, 1_000)] {
        let bound = id_below_which_are(most, total).expect("not nearly all");
        let share =
            f64::from(u32::from_str_radix(&bound, 16).expect("hex digits")) / 2_f64.powi(32);
        let expected = share * total as f64;
        assert!(expected > most as f64 && expected < most as f64 * 1.1 + 40.0, "{expected}");
    }
    assert_eq!(id_below_which_are(999, 1_000), None);
}

#[tokio::test]
async fn rows_are_counted_before_they_are_read() {
    let (_folder, store) = store(500, HASH).await;
    let mut tx = store.read().await.expect("a transaction");
    let filter = Filter::parse("d_m < 15", &kind_of).expect("a filter");
    for filter in [None, Some(&filter)] {
        let names = vec!["upstream_closure", "regime", "run_id"];
        let extract = Extract { sweep: 1, axes: vec!["d_m"], filter, names, most: None };
        let read = sheet(&mut tx, &extract).await.expect("it reads");
        let rows = sheet_rows(&mut tx, &extract).await.expect("it counts");
        assert_eq!((rows, rows), (read.total, read.run_index.len() as i64));
        assert_eq!(rows, if filter.is_some() { 50 } else { 500 });
        // Texts as numbers: the same for the same.
        let [closure, _, ids] = [0, 1, 2].map(|i| read.columns[i].clone().into_numbers());
        assert!(closure.iter().all(|number| *number == Some(0.0)));
        assert_eq!(ids.last(), Some(&Some(rows as f64 - 1.0)));
    }
}

/// Of a number that is none, such as an overflow, there are no results, and of no sweeps no bytes.
#[tokio::test]
async fn results_are_finite() {
    let (_folder, store) = store(700, HASH).await;
    let mut tx = store.read().await.expect("a transaction");
    let force = crate::archive::catalogue::results(&mut tx, 1, "force_n_per_m").await;
    let force = force.expect("it reads");
    assert_eq!((force.values.len(), force.without["failed"]), (630, 70));
    let none = crate::archive::catalogue::results(&mut tx, 1, "volume_m3").await.expect("it reads");
    assert_eq!((none.values.len(), none.without["converged"]), (0, 630));
    let bytes = crate::archive::catalogue::bytes_of(&mut tx, &[]).await.expect("nothing is asked");
    assert!(bytes.is_empty());
}
