//! Designs as they are drawn, with functions whose indices are known, in place of the model.

use super::*;
use crate::analysis::indices::NoIndices;
use crate::domain::document::Document;
use crate::domain::sweep::Limits;
use std::f64::consts::PI;
use std::task::{Context, Waker};

/// Parameters in alphabetical order, with ranges to draw from.
const RANGES: [(&str, [f64; 2]); 6] = [
    ("b", [1e4, 3e4]),
    ("d_m", [10.0, 50.0]),
    ("melt_rate_m_per_day", [0.2, 0.8]),
    ("mu_s", [0.2, 0.4]),
    ("strain_rate_regularisation_per_a", [0.5, 1.5]),
    ("width_m", [3000.0, 5000.0]),
];

/// Results of a function of numbers from 0 to 1, at the points of a sweep with a design.
fn results(n: usize, seed: u64, dimensions: usize, f: &dyn Fn(&[f64]) -> f64) -> Vec<f64> {
    let ranges: serde_json::Map<_, _> = RANGES[..dimensions]
        .iter()
        .map(|(name, ends)| ((*name).to_owned(), serde_json::json!(ends)))
        .collect();
    let document = serde_json::json!({
        "regime": "steady",
        "sample": {"method": "saltelli", "n": n, "seed": seed, "ranges": ranges},
    });
    let document = Document::parse(&document.to_string()).expect("a document");
    let sweep = document.into_sweep(&Limits::default()).expect("a sweep");
    let json = serde_json::to_string(sweep.document()).expect("plain data");
    let design = Design::of_document(&json).expect("a design");
    assert_eq!(design.runs(), sweep.count());
    let value = |index: usize| {
        let parameters = *sweep.run(index).parameters();
        let fractions = RANGES[..dimensions].iter().map(|(name, [from, to])| {
            let info = crate::domain::parameters::info(name).expect("a parameter");
            ((info.get)(&parameters) - from) / (to - from)
        });
        f(&fractions.collect::<Vec<_>>())
    };
    (0..sweep.count()).map(value).collect()
}

fn told(values: Vec<f64>, dimensions: usize) -> Result<Indices, NoIndices> {
    let parameters: Vec<String> =
        RANGES[..dimensions].iter().map(|(name, _)| (*name).to_owned()).collect();
    let question = Question { y: "y".into(), scale: Scale::Linear, resamples: 200, seed: 0 };
    indices::indices(&parameters, values, question, || true)
}

/// Compares with indices that are known, to a tolerance; returns how many of them the intervals hold.
fn compare(indices: &Indices, first: &[f64], total: &[f64], tolerance: f64) -> usize {
    let firsts = indices.indices.iter().map(|index| index.first).zip(first);
    let totals = indices.indices.iter().map(|index| index.total).zip(total);
    let mut held = 0;
    for (told, known) in firsts.chain(totals) {
        assert!((told.estimate - known).abs() < tolerance, "{told:?} is not {known}");
        held += usize::from(told.ci95[0] <= *known && *known <= told.ci95[1]);
    }
    held
}

/// In what share of designs of n base points the interval of an index holds it, least of all indices.
fn least_share(n: usize, first: &[f64], total: &[f64], f: &dyn Fn(&[f64]) -> f64) -> f64 {
    const DESIGNS: u64 = 40;
    let dimensions = first.len();
    let mut held = vec![0.0; 2 * dimensions];
    for seed in 0..DESIGNS {
        let indices = told(results(n, seed, dimensions, f), dimensions).expect("indices").indices;
        let estimates = indices.iter().map(|i| i.first).chain(indices.iter().map(|i| i.total));
        for (held, (told, known)) in held.iter_mut().zip(estimates.zip(first.iter().chain(total))) {
            *held += f64::from(told.ci95[0] <= *known && *known <= told.ci95[1]);
        }
    }
    held.into_iter().fold(f64::INFINITY, f64::min) / DESIGNS as f64
}

/// Constants of Ishigami's function.
const ISHIGAMI: (f64, f64) = (7.0, 0.1);

fn ishigami(u: &[f64]) -> f64 {
    let (a, b) = ISHIGAMI;
    let x: Vec<f64> = u.iter().map(|u| PI * (2.0 * u - 1.0)).collect();
    x[0].sin() + a * x[1].sin().powi(2) + b * x[2].powi(4) * x[0].sin()
}

/// Its variance, and its indices of first order and total.
fn known_of_ishigami() -> (f64, [f64; 3], [f64; 3]) {
    let (a, b) = ISHIGAMI;
    let of_1 = 0.5 * (1.0 + b * PI.powi(4) / 5.0).powi(2);
    let of_2 = a * a / 8.0;
    let of_13 = b * b * PI.powi(8) * (1.0 / 18.0 - 1.0 / 50.0);
    let variance = of_1 + of_2 + of_13;
    let first = [of_1 / variance, of_2 / variance, 0.0];
    let total = [(of_1 + of_13) / variance, of_2 / variance, of_13 / variance];
    (variance, first, total)
}

/// Ishigami and Homma (1990) with a = 7, b = 0.1; the indices as Sobol and Levitan (1999) derive them.
#[test]
fn the_indices_of_ishigamis_function_are_found() {
    let (f, (variance, first, total)) = (ishigami, known_of_ishigami());
    let mut held = 0;
    for (n, seed, tolerance) in [(1024, 0, 0.04), (1024, 1, 0.04), (4096, 0, 0.02)] {
        let indices = told(results(n, seed, 3, &f), 3).expect("indices");
        held += compare(&indices, &first, &total, tolerance);
        assert!((indices.mean - ISHIGAMI.0 / 2.0).abs() < tolerance, "{}", indices.mean);
        assert!((indices.variance / variance - 1.0).abs() < tolerance, "{}", indices.variance);
        let missing = 1.0 - indices.sum_of_first;
        assert!((missing - total[2]).abs() < tolerance, "{missing}");
    }
    assert!(held >= 17, "the intervals hold {held} of 18");
    // Few base points: wide intervals, which hold what they should.
    let mut held = 0;
    for seed in 0..10 {
        held += compare(&told(results(64, seed, 3, &f), 3).expect("indices"), &first, &total, 0.5);
    }
    assert!(held >= 54, "the intervals hold {held} of 60");
}

/// Sobol's g-function, in which everything plays with everything and most of it hardly matters.
#[test]
fn the_indices_of_sobols_g_function_are_found() {
    let a = [0.0, 0.5, 3.0, 9.0, 99.0, 99.0];
    let f = |u: &[f64]| -> f64 {
        u.iter().zip(a).map(|(u, a)| ((4.0 * u - 2.0).abs() + a) / (1.0 + a)).product()
    };
    let of = a.map(|a| 1.0 / 3.0 / (1.0 + a).powi(2));
    let all: f64 = of.iter().map(|v| 1.0 + v).product();
    let first = of.map(|v| v / (all - 1.0));
    let total = of.map(|v| v * all / (1.0 + v) / (all - 1.0));
    let indices = told(results(2048, 1, 6, &f), 6).expect("indices");
    let held = compare(&indices, &first, &total, 0.02);
    assert!(held >= 11, "the intervals hold {held} of 12");
    assert!((indices.mean - 1.0).abs() < 0.01);
    assert!((indices.variance / (all - 1.0) - 1.0).abs() < 0.02);
}

const WEIGHTS: [f64; 4] = [1.0, 2.0, 3.0, 4.0];

fn weighted_sum(u: &[f64]) -> f64 {
    1e6 + u.iter().zip(WEIGHTS).map(|(u, weight)| u * weight).sum::<f64>()
}

/// What `docs/scenarios.md` says of the intervals.
#[test]
fn intervals_hold_the_indices_as_often_as_is_said() {
    let (_, first, total) = known_of_ishigami();
    let shares = WEIGHTS.map(|weight| weight * weight / 30.0);
    for (n, least) in [(64, 0.85), (256, 0.9)] {
        let of_ishigami = least_share(n, &first, &total, &ishigami);
        let of_sum = least_share(n, &shares, &shares, &weighted_sum);
        assert!(of_ishigami >= least && of_sum >= least, "{n}: {of_ishigami}, {of_sum}");
    }
}

/// Of a sum each parameter's share is that of its own term, and no two play together.
#[test]
fn a_sum_is_shared_out_exactly() {
    let shares = WEIGHTS.map(|weight| weight * weight / 30.0);
    let indices = told(results(1024, 5, 4, &weighted_sum), 4).expect("indices");
    assert_eq!(compare(&indices, &shares, &shares, 2e-3), 8);
    assert!((indices.sum_of_first - 1.0).abs() < 2e-3);
    assert!((indices.variance / (30.0 / 12.0) - 1.0).abs() < 1e-3);
}

#[test]
fn resamples_are_as_many_as_the_sweep_allows() {
    assert_eq!(resamples(None, 1280), Ok(1_000));
    assert_eq!(resamples(Some(10_000), 1280), Ok(10_000));
    assert_eq!(resamples(None, 1 << 24), Ok(119));
    for (asked, runs) in [(99, 1280), (10_001, 1280), (1_000, 1 << 24), (0, 10)] {
        let refusal = resamples(Some(asked), runs).expect_err("refused");
        assert_eq!(refusal.field.as_deref(), Some("resamples"));
    }
}

/// Who goes away leaves the work for a moment, and its turn with it: both are over long before it would be done.
#[tokio::test]
async fn work_that_nobody_waits_for_keeps_its_turn_until_it_is_given_up() {
    static ONE: Semaphore = Semaphore::const_new(1);
    let one = ONE.acquire().await.expect("open");
    let question = Question { y: "y".into(), scale: Scale::Linear, resamples: 1_000_000, seed: 0 };
    let values = (0..400_000).map(|i| f64::from(i % 10_007 * 7919 % 10_007)).collect();
    let parameters = vec!["p".to_owned(), "q".to_owned()];
    let found = Found { name: String::new(), parameters, values, question };
    let mut asked = Box::pin(found.indices(one));
    let mut context = Context::from_waker(Waker::noop());
    assert!(asked.as_mut().poll(&mut context).is_pending());
    drop(asked);
    assert_eq!(ONE.available_permits(), 0, "the work is still under way");
    let next = tokio::time::timeout(std::time::Duration::from_secs(60), ONE.acquire()).await;
    assert!(next.is_ok(), "the work went on");
}
