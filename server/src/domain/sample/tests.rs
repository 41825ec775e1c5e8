//! Samples: where their points lie, and that they stay there.

use super::*;
use proptest::prelude::*;

fn sample(method: &str, n: u64, seed: u64) -> SampleForm {
    let ranges = r#"{"mu_s": [0.2, 0.5], "b": {"log": [1e4, 1e6]}, "d_m": [10, 50]}"#;
    let text = format!(r#"{{"method": "{method}", "n": {n}, "seed": {seed}, "ranges": {ranges}}}"#);
    serde_json::from_str(&text).expect("a sample")
}

/// Values of the parameters by column, in the order of the table of parameters.
pub fn values(form: &SampleForm) -> Vec<Vec<f64>> {
    let columns = form.columns().expect("points");
    let of = |column: &Column| match column {
        Column::Parameter(_, values) => values.to_vec(),
        Column::Closure(_) => panic!("a sample has no closures"),
    };
    columns.iter().map(of).collect()
}

/// Fractions of the ranges, by columns b, d_m, mu_s.
fn fractions(form: &SampleForm) -> Vec<Vec<f64>> {
    let [b, d_m, mu_s] = values(form).try_into().expect("three columns");
    vec![
        b.iter().map(|b| (b / 1e4).ln() / 100_f64.ln()).collect(),
        d_m.iter().map(|d| (d - 10.0) / 40.0).collect(),
        mu_s.iter().map(|mu| (mu - 0.2) / 0.3).collect(),
    ]
}

fn hits(fractions: &[f64], strata: usize) -> Vec<usize> {
    let mut hits = vec![0; strata];
    for u in fractions {
        hits[((u * strata as f64 + 1e-9) as usize).min(strata - 1)] += 1;
    }
    hits
}

const METHODS: [&str; 4] = ["sobol", "latin_hypercube", "uniform", "log_uniform"];

/// The crate's own iterator without a shift, the first point at 0.
#[test]
fn the_sequence_is_sobols() {
    let dimensions = 13;
    let directions = directions(dimensions);
    let columns: Vec<Vec<f64>> =
        directions.iter().map(|d| shifted_sobol(300, 0, d).collect()).collect();
    let theirs = Sobol::<f64>::new::<u32>(dimensions, &JoeKuoD6::minimal());
    for (i, point) in theirs.take(300).enumerate() {
        let ours: Vec<f64> = columns.iter().map(|column| column[i]).collect();
        assert_eq!(ours, point, "point {i}");
    }
    assert_eq!(columns[1][..4], [0.0, 0.5, 0.25, 0.75]);
    assert_eq!(directions[0].len(), 53, "enough for 2^24 points");
}

#[test]
fn powers_of_two_of_sobols_points_hit_every_stratum_and_cell_once() {
    for k in 0..=10 {
        let fractions = fractions(&sample("sobol", 1 << k, 7));
        for column in &fractions {
            assert!(hits(column, 1 << k).iter().all(|h| *h == 1), "2^{k}");
        }
    }
    // The first two dimensions are a (0, 2)-sequence: elementary boxes of 16 by 16 once each.
    let fractions = fractions(&sample("sobol", 256, 7));
    let mut boxes: Vec<(usize, usize)> = fractions[0]
        .iter()
        .zip(&fractions[1])
        .map(|(u, v)| ((u * 16.0 + 1e-9) as usize, (v * 16.0 + 1e-9) as usize))
        .collect();
    boxes.sort_unstable();
    boxes.dedup();
    assert_eq!(boxes.len(), 256);
}

#[test]
fn each_stratum_of_a_latin_hypercube_is_hit_once() {
    for n in [1_u64, 2, 3, 100, 1000] {
        for column in fractions(&sample("latin_hypercube", n, 3)) {
            assert!(hits(&column, n as usize).iter().all(|h| *h == 1), "{n}");
        }
    }
    let order = |seed| {
        let column = &fractions(&sample("latin_hypercube", 50, seed))[0];
        column.iter().map(|u| (u * 50.0) as usize).collect::<Vec<_>>()
    };
    assert_ne!(order(1), order(2));
}

/// Mean, variance and correlations within five standard errors of what they should be.
#[test]
fn random_points_have_the_moments_of_their_distribution() {
    let n = 10_000;
    for method in ["uniform", "latin_hypercube", "sobol"] {
        let fractions = fractions(&sample(method, n, 11));
        let mean = |values: &[f64]| values.iter().sum::<f64>() / n as f64;
        for (i, u) in fractions.iter().enumerate() {
            let error = 5.0 * (1.0 / 12.0 / n as f64).sqrt();
            assert!((mean(u) - 0.5).abs() < error, "{method}");
            let square: Vec<f64> = u.iter().map(|u| (u - 0.5).powi(2)).collect();
            assert!((mean(&square) - 1.0 / 12.0).abs() < error, "{method}");
            for v in &fractions[..i] {
                let product: Vec<f64> =
                    u.iter().zip(v).map(|(u, v)| (u - 0.5) * (v - 0.5)).collect();
                assert!(mean(&product).abs() < error / 3.0, "{method}");
            }
        }
    }
    let log = &values(&sample("log_uniform", n, 11))[2];
    let below = log.iter().filter(|mu| **mu < 0.1_f64.sqrt()).count() as f64 / n as f64;
    assert!((below - 0.5).abs() < 0.025, "half of them are below the geometric mean: {below}");
}

/// Kept for ever: a sweep is its document, and its points are drawn again from it at every start.
#[test]
fn points_stay_what_they_are() {
    let pinned: [(&str, [[f64; 3]; 2]); 4] = [
        (
            "sobol",
            [
                [631103.3376328642, 21.31613422837966, 0.474986116231447],
                [222318.43520061154, 36.62863422837966, 0.289829866231447],
            ],
        ),
        (
            "latin_hypercube",
            [
                [28556.520874504193, 10.280884518474341, 0.2275813895855099],
                [67511.71164701591, 49.55123423114419, 0.20780268633179366],
            ],
        ),
        (
            "uniform",
            [
                [702548.6384883123, 13.132070975665746, 0.3118438511576018],
                [226093.38752643272, 21.224707190075343, 0.3101236775831656],
            ],
        ),
        (
            "log_uniform",
            [
                [318805.5106383015, 49.009884824596114, 0.37591803737671475],
                [700118.5075802639, 18.389847452057474, 0.238528802980113],
            ],
        ),
    ];
    for (method, points) in pinned {
        let columns = values(&sample(method, 100, 1));
        let drawn = [0, 99].map(|i| [columns[0][i], columns[1][i], columns[2][i]]);
        assert_eq!(drawn, points, "{method}");
    }
}

#[test]
fn the_seed_matters_and_the_order_of_the_ranges_does_not() {
    for method in METHODS {
        let form = sample(method, 37, 1);
        assert_ne!(values(&form), values(&sample(method, 37, 2)), "{method}");
        let mut turned = form.clone();
        turned.ranges.0.reverse();
        assert_eq!(values(&form), values(&turned), "{method}");
        let written = serde_json::to_string(&form).expect("plain data");
        assert_eq!(form, serde_json::from_str(&written).expect("the same"), "{written}");
    }
}

#[test]
fn whole_numbers_have_even_shares() {
    let text = r#"{"method": "sobol", "n": 1024, "ranges": {"n_cells": [20, 27]}}"#;
    let form: SampleForm = serde_json::from_str(text).expect("a sample");
    let cells = &values(&form)[0];
    for n_cells in 20..=27 {
        let share = cells.iter().filter(|v| **v == f64::from(n_cells)).count();
        assert_eq!(share, 128, "{n_cells}");
    }
}

#[test]
fn bad_samples_are_refused_with_their_field() {
    for (ranges, n, field) in [
        (r#"{"b": [1e4, 1e6], "melt": [0, 1]}"#, 8, "sample.ranges.melt"),
        (r#"{"b": [1e6, 1e4]}"#, 8, "sample.ranges.b"),
        (r#"{"b": [1e4, 1e4]}"#, 8, "sample.ranges.b"),
        (r#"{"b": [1e4, 1e13]}"#, 8, "sample.ranges.b"),
        (r#"{"width_gradient": {"log": [0, 0.1]}}"#, 8, "sample.ranges.width_gradient"),
        (r#"{"n_cells": [20, 30.5]}"#, 8, "sample.ranges.n_cells"),
        (r#"{"b": [1e4, 1e6], "b": [1e4, 1e5]}"#, 8, "sample.ranges.b"),
        (r#"{"upstream_closure": [0, 1]}"#, 8, "sample.ranges.upstream_closure"),
        ("{}", 8, "sample.ranges"),
        (r#"{"b": [1e4, 1e6]}"#, 0, "sample.n"),
    ] {
        let text = format!(r#"{{"method": "uniform", "n": {n}, "ranges": {ranges}}}"#);
        let form: SampleForm = serde_json::from_str(&text).expect("a sample");
        let refusal = form.columns().expect_err("it is refused");
        assert_eq!(refusal.field.as_deref(), Some(field), "{refusal}");
        assert!(refusal.value.is_some() && refusal.permitted.is_some(), "{refusal:?}");
    }
}

proptest! {
    #[test]
    fn points_stay_in_their_ranges(n in 1_u64..200, seed: u64, method in 0_usize..4) {
        let form = sample(METHODS[method], n, seed);
        for (column, [first, last]) in
            values(&form).iter().zip([[1e4, 1e6], [10.0, 50.0], [0.2, 0.5]])
        {
            prop_assert_eq!(column.len(), n as usize);
            prop_assert!(column.iter().all(|v| (first..=last).contains(v)));
        }
    }
}
