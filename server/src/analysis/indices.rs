//! Sobol's sensitivity indices of a design of Saltelli's, with intervals. Numbers only: no sweep, no transport.

use crate::domain::same::same;
use rand::rngs::ChaCha8Rng;
use rand::{Rng, SeedableRng};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// In which scale a result's variance is taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Scale {
    /// Of y itself.
    #[default]
    Linear,
    /// Of ln y.
    Log,
}

/// What is asked of a design's results.
#[derive(Debug, Clone, PartialEq)]
pub struct Question {
    /// Name of the result.
    pub y: String,
    /// Scale of its variance.
    pub scale: Scale,
    /// Resamples for the intervals.
    pub resamples: usize,
    /// Another seed gives other resamples.
    pub seed: u64,
}

/// An index estimated from a design.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, ToSchema)]
pub struct IndexEstimate {
    /// From all base points. It has an error, so that a small one may come out negative.
    pub estimate: f64,
    /// 95 % interval.
    pub ci95: [f64; 2],
}

/// The indices of a parameter.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct ParameterIndices {
    /// Its name.
    pub parameter: String,
    /// Share of the variance that this parameter makes by itself.
    pub first: IndexEstimate,
    /// Share that it makes by itself and together with others.
    pub total: IndexEstimate,
}

/// How much of a result's variance over the ranges each parameter makes.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Indices {
    /// Name of the result.
    pub y: String,
    /// Scale in which its variance is taken.
    pub scale: Scale,
    /// Base points of the design.
    pub n: usize,
    /// Mean of y, or of ln y, over the 2 n independent points.
    pub mean: f64,
    /// Variance of y, or of ln y, over them.
    pub variance: f64,
    /// By parameter, in alphabetical order.
    pub indices: Vec<ParameterIndices>,
    /// Sum of the first-order indices: what is missing to 1 is made by parameters together.
    pub sum_of_first: f64,
    /// Resamples for the intervals.
    pub resamples: usize,
    /// Their seed.
    pub seed: u64,
    /// Estimators with their sources, and what the intervals are.
    pub method: &'static str,
}

/// Why there are no indices.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum NoIndices {
    /// Some results have no logarithm.
    #[error("{count} of {total} runs have a {y} that is not positive, so that it has no logarithm")]
    NotPositive {
        /// The result.
        y: String,
        /// How many.
        count: usize,
        /// Of how many.
        total: usize,
    },
    /// All results are the same.
    #[error("{y} is the same in all runs: there is no variance to be shared out")]
    NoVariance {
        /// The result.
        y: String,
    },
    /// Nearly all results are the same.
    #[error(
        "{y} is the same at nearly all base points: among some resamples of them it does not vary at all, \
         so that no interval is determined"
    )]
    HardlyAny {
        /// The result.
        y: String,
    },
    /// Nobody waits for them any more.
    #[error("nobody waits for the indices any more")]
    GivenUp,
}

const METHOD: &str = "first: Saltelli et al. (2010, doi:10.1016/j.cpc.2009.09.018), total: Jansen (1999, \
     doi:10.1016/S0010-4655(98)00154-4), both over the variance of the 2 n points of A and B, after y is centred by its \
     mean over all runs; ci95: the middle 95 % of the same estimates over base points drawn again with replacement \
     (percentile bootstrap), which takes base points as independent, and Sobol's points are usually better than that; \
     parameters vary independently and evenly over the ranges of the design, in the logarithm where a range is logarithmic";

/// A resample has no variance if it is below this share of all base points' variance.
const NO_SHARE: f64 = 1e-12;
/// The interval's ends among sorted estimates.
const TAILS: [f64; 2] = [0.025, 0.975];

/// The indices of parameters from the results of a design's runs, which stand base point by base point: A, then for
/// each parameter A with that one from B, then B. Before each resample it is asked whether anybody waits for them.
pub fn indices(
    parameters: &[String],
    mut values: Vec<f64>,
    question: Question,
    is_awaited: impl Fn() -> bool,
) -> Result<Indices, NoIndices> {
    let Question { y, scale, resamples, seed } = question;
    let runs = parameters.len() + 2;
    assert_eq!(values.len() % runs, 0, "every base point has all its runs");
    if scale == Scale::Log {
        let count = values.iter().filter(|v| v.is_nan() || **v <= 0.0).count();
        if count > 0 {
            return Err(NoIndices::NotPositive { y, count, total: values.len() });
        }
    }
    // Before the logarithm, which may be near 0 and there differ by much of its size.
    let (low, high) = independent(&values, runs)
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
    if same(low, high) {
        return Err(NoIndices::NoVariance { y });
    }
    if scale == Scale::Log {
        values.iter_mut().for_each(|v| *v = v.ln());
    }
    let n = values.len() / runs;
    let mean = independent(&values, runs).sum::<f64>() / (2 * n) as f64;
    let centre = values.iter().sum::<f64>() / values.len() as f64;
    values.iter_mut().for_each(|v| *v -= centre);

    let terms = Terms::new(&values, parameters.len());
    let all = terms.sums(&vec![1; n]);
    let whole = all.estimates();
    let variance = all.variance();
    let mut resampled = vec![Vec::with_capacity(resamples); whole.len()];
    let mut times = vec![0_u32; n];
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    for _ in 0..resamples {
        if !is_awaited() {
            return Err(NoIndices::GivenUp);
        }
        // First how often each is drawn, then all in their order: jumps over much memory take most of the time.
        times.fill(0);
        (0..n).for_each(|_| times[below(&mut random, n)] += 1);
        let drawn = terms.sums(&times);
        if drawn.variance() <= NO_SHARE * variance {
            return Err(NoIndices::HardlyAny { y });
        }
        for (list, estimate) in resampled.iter_mut().zip(drawn.estimates()) {
            list.push(estimate);
        }
    }
    let mut estimates = whole.into_iter().zip(resampled).map(|(estimate, mut list)| {
        list.sort_unstable_by(f64::total_cmp);
        IndexEstimate { estimate, ci95: TAILS.map(|share| quantile(&list, share)) }
    });
    let mut of_each = || estimates.by_ref().take(parameters.len()).collect::<Vec<_>>();
    let (first, total) = (of_each(), of_each());
    let sum_of_first = first.iter().map(|index| index.estimate).sum();
    let indices = parameters.iter().zip(first).zip(total).map(|((parameter, first), total)| {
        ParameterIndices { parameter: parameter.clone(), first, total }
    });
    let indices = indices.collect();
    Ok(Indices {
        y,
        scale,
        n,
        mean,
        variance,
        indices,
        sum_of_first,
        resamples,
        seed,
        method: METHOD,
    })
}

/// Results at A and B, of base points of so many runs.
fn independent(values: &[f64], runs: usize) -> impl Iterator<Item = f64> {
    values.chunks_exact(runs).flat_map(move |p| [p[0], p[runs - 1]])
}

/// What each base point adds to the estimators, which are ratios of sums: f(A) + f(B), f(A)² + f(B)², then for each
/// parameter f(B)·(f(A_B) − f(A)), then for each (f(A) − f(A_B))².
struct Terms {
    width: usize,
    terms: Vec<f64>,
}

/// Sums of [`Terms`] over so many base points.
struct Sums {
    count: f64,
    sums: Vec<f64>,
}

/// Terms before those of the parameters.
const COMMON: usize = 2;

impl Terms {
    /// Of centred results.
    fn new(values: &[f64], parameters: usize) -> Self {
        let width = COMMON + 2 * parameters;
        let runs = parameters + 2;
        let mut terms = Vec::with_capacity(values.len() / runs * width);
        for point in values.chunks_exact(runs) {
            let (a, b, mixed) = (point[0], point[runs - 1], &point[1..runs - 1]);
            terms.extend([a + b, a * a + b * b]);
            terms.extend(mixed.iter().map(|mixed| b * (mixed - a)));
            terms.extend(mixed.iter().map(|mixed| (a - mixed).powi(2)));
        }
        Self { width, terms }
    }

    /// Of each base point so many times.
    fn sums(&self, times: &[u32]) -> Sums {
        let (mut count, mut sums) = (0.0, vec![0.0; self.width]);
        for (terms, times) in self.terms.chunks_exact(self.width).zip(times) {
            let weight = f64::from(*times);
            count += weight;
            sums.iter_mut().zip(terms).for_each(|(sum, term)| *sum += weight * term);
        }
        Sums { count, sums }
    }
}

impl Sums {
    fn variance(&self) -> f64 {
        let points = 2.0 * self.count;
        self.sums[1] / points - (self.sums[0] / points).powi(2)
    }

    /// First-order indices, V_i = Σ f(B)·(f(A_B) − f(A)) / n, then total ones, Σ (f(A) − f(A_B))² / 2n, over the variance.
    fn estimates(&self) -> Vec<f64> {
        let of_parameters = &self.sums[COMMON..];
        let (first, total) = of_parameters.split_at(of_parameters.len() / 2);
        let scale = 1.0 / (self.count * self.variance());
        let first = first.iter().map(|sum| sum * scale);
        first.chain(total.iter().map(|sum| 0.5 * sum * scale)).collect()
    }
}

/// A random whole number below n.
fn below(random: &mut ChaCha8Rng, n: usize) -> usize {
    ((u128::from(random.next_u64()) * n as u128) >> u64::BITS) as usize
}

/// The quantile of sorted numbers, linear between them.
fn quantile(sorted: &[f64], share: f64) -> f64 {
    let place = share * (sorted.len() - 1) as f64;
    let (below, part) = (place.floor() as usize, place.fract());
    let above = (below + 1).min(sorted.len() - 1);
    sorted[below] + part * (sorted[above] - sorted[below])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn question(resamples: usize, seed: u64) -> Question {
        Question { y: "y".into(), scale: Scale::Linear, resamples, seed }
    }

    fn named(names: &[&str]) -> Vec<String> {
        names.iter().map(|name| (*name).to_owned()).collect()
    }

    /// y = p + 2q on the corners of a square, each pair of which comes once: as by hand.
    #[test]
    fn the_estimators_are_those_of_the_papers() {
        let corners = [(0.0, 0.0), (0.0, 1.0), (1.0, 0.0), (1.0, 1.0)];
        let f = |p: f64, q: f64| p + 2.0 * q + 10.0;
        let mut values = Vec::new();
        for a in corners {
            for b in corners {
                values.extend([f(a.0, a.1), f(b.0, a.1), f(a.0, b.1), f(b.0, b.1)]);
            }
        }
        let told =
            indices(&named(&["p", "q"]), values, question(100, 0), || true).expect("indices");
        assert_eq!((told.n, told.mean), (16, 11.5));
        assert!((told.variance - 1.25).abs() < 1e-14);
        for (index, share) in told.indices.iter().zip([0.2, 0.8]) {
            assert!((index.first.estimate - share).abs() < 1e-14, "{index:?}");
            assert!((index.total.estimate - share).abs() < 1e-14, "{index:?}");
        }
        assert!((told.sum_of_first - 1.0).abs() < 1e-14);
    }

    #[test]
    fn the_seed_makes_the_interval_and_nothing_else() {
        let values = || (0..64).map(|i| f64::from(i * i * 7919 % 101)).collect::<Vec<_>>();
        let of = |seed| {
            indices(&named(&["p", "q"]), values(), question(200, seed), || true).expect("them")
        };
        assert_eq!(of(1), of(1));
        let (one, other) = (of(1), of(2));
        for (one, other) in one.indices.iter().zip(&other.indices) {
            assert_eq!(one.first.estimate, other.first.estimate);
            assert_ne!(one.first.ci95, other.first.ci95);
            let [low, high] = one.total.ci95;
            assert!(low < one.total.estimate && one.total.estimate < high, "{one:?}");
        }
    }

    #[test]
    fn what_has_no_variance_or_no_logarithm_has_no_indices() {
        let of = |values: Vec<f64>, scale| {
            let question = Question { scale, ..question(100, 0) };
            indices(&named(&["p", "q"]), values, question, || true)
        };
        // One tenth has no end in binary, so that a mean of tenths is not one exactly.
        let none = Err(NoIndices::NoVariance { y: "y".into() });
        assert_eq!(of(vec![0.1; 40], Scale::Linear), none);
        assert_eq!(of(vec![0.1; 40], Scale::Log), none);
        assert_eq!(of(vec![0.0; 40], Scale::Linear), none);
        // Numbers about 1, of which the logarithms are about 0.
        let rounded = [1.0, 1.0 + 2.0 * f64::EPSILON].repeat(20);
        assert_eq!(of(rounded, Scale::Log), none);
        // Only parameters' runs differ, not those that tell the variance.
        assert_eq!(of([1.0, 2.0, 3.0, 1.0].repeat(10), Scale::Linear), none);
        let mut nearly = vec![1.0; 40];
        nearly[0] = 2.0;
        assert_eq!(of(nearly, Scale::Linear), Err(NoIndices::HardlyAny { y: "y".into() }));
        let mut values: Vec<f64> = (1..=40).map(f64::from).collect();
        assert!(of(values.clone(), Scale::Log).is_ok());
        values[3] = 0.0;
        values[7] = -1.0;
        let told = of(values, Scale::Log).expect_err("no logarithm");
        assert_eq!(told, NoIndices::NotPositive { y: "y".into(), count: 2, total: 40 });
    }

    #[test]
    fn what_nobody_waits_for_is_given_up() {
        let values = || (1..=40).map(f64::from).collect();
        let asked = std::cell::Cell::new(0);
        let is_awaited = || {
            asked.set(asked.get() + 1);
            asked.get() < 5
        };
        let told = indices(&named(&["p", "q"]), values(), question(100, 0), is_awaited);
        assert_eq!((told, asked.get()), (Err(NoIndices::GivenUp), 5));
    }

    #[test]
    fn quantiles_are_linear_between_numbers() {
        let sorted = [1.0, 2.0, 4.0];
        let of = |share| quantile(&sorted, share);
        assert_eq!([of(0.0), of(0.25), of(0.5), of(0.75), of(1.0)], [1.0, 1.5, 2.0, 3.0, 4.0]);
    }
}
