//! The slope of a law from place to place, from the runs alone: whether one exponent is enough. Knows no fit.

use super::law::Law;
use crate::domain::same::same;
use serde::Serialize;
use utoipa::ToSchema;

/// Slopes between neighbouring x, in the coordinates in which the law is a line: of a power law, the exponent there.
#[derive(Debug, Clone, Default, PartialEq, Serialize, ToSchema)]
pub struct LocalExponent {
    /// The middle between two neighbouring x, in those coordinates.
    pub x: Vec<f64>,
    /// The slope between them: of two runs that agree in all other parameters which vary, the mean over all such
    /// pairs.
    pub exponent: Vec<f64>,
}

/// A run as it counts here.
#[derive(Debug, Clone, Copy)]
pub struct Placed {
    /// Its abscissa.
    pub x: f64,
    /// Its place in the coordinates of the law.
    pub at: (f64, f64),
    /// The set of runs that agree in everything else.
    pub set: u32,
}

/// Most places that are told one by one.
const MOST_PLACES: usize = 1000;
/// Places at which more of them are put together.
const FEW_PLACES: usize = 200;

/// What the runs of all sets say of the law between an x and the next one.
#[derive(Debug, Clone, Copy, Default)]
struct Gap {
    pairs: f64,
    rise: f64,
    ends: (f64, f64),
}

/// The local exponent. Slopes are taken within each set: where some of its runs have no result, means over those of
/// all sets that have one would tell the sets apart, not the slope.
pub fn local_exponent(law: Law, mut runs: Vec<Placed>) -> LocalExponent {
    runs.sort_by(|a, b| a.x.total_cmp(&b.x));
    let mut places: Vec<f64> = Vec::new();
    let mut last = f64::NAN;
    // From here on, x is the number of the place.
    for run in &mut runs {
        if places.is_empty() || !same(last, run.x) {
            places.push(run.at.0);
            last = run.x;
        }
        run.x = (places.len() - 1) as f64;
    }
    let mut gaps: Vec<Gap> =
        places.windows(2).map(|p| Gap { ends: (p[0], p[1]), ..Gap::default() }).collect();
    runs.sort_by(|a, b| a.set.cmp(&b.set).then_with(|| a.x.total_cmp(&b.x)));
    for set in runs.chunk_by(|a, b| a.set == b.set) {
        let mut before: Option<(usize, f64)> = None;
        for equal in set.chunk_by(|a, b| a.x == b.x) {
            let here = equal[0].x as usize;
            let y = equal.iter().map(|run| run.at.1).sum::<f64>() / equal.len() as f64;
            if let Some((_, of_last)) = before.filter(|(place, _)| place + 1 == here) {
                gaps[here - 1].pairs += 1.0;
                gaps[here - 1].rise += y - of_last;
            }
            before = Some((here, y));
        }
    }
    gaps.retain(|gap| gap.pairs > 0.0);
    let together = if gaps.len() < MOST_PLACES { 1 } else { gaps.len().div_ceil(FEW_PLACES) };
    let mut found = LocalExponent::default();
    for gaps in gaps.chunks(together) {
        let sum = |f: &dyn Fn(&Gap) -> f64| gaps.iter().map(f).sum::<f64>();
        let run = |gap: &Gap| gap.pairs * (gap.ends.1 - gap.ends.0);
        let all = sum(&run);
        let middle = sum(&|gap| run(gap) * 0.5 * (gap.ends.0 + gap.ends.1)) / all;
        let (x, slope) = (law.x_back(middle), sum(&|gap| gap.rise) / all);
        if x.is_finite() && slope.is_finite() {
            found.x.push(x);
            found.exponent.push(slope);
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(got: f64, expected: f64) {
        assert!((got - expected).abs() < 1e-9 * expected.abs(), "{got} is not {expected}");
    }

    /// Runs of a set, by x and y.
    fn set(law: Law, set: u32, points: &[(f64, f64)]) -> Vec<Placed> {
        let at = |(x, y): (f64, f64)| match law {
            Law::Power => (x.ln(), y.ln()),
            Law::Exponential => (x, y.ln()),
            Law::Linear => (x, y),
        };
        points.iter().map(|point| Placed { x: point.0, at: at(*point), set }).collect()
    }

    #[test]
    fn a_power_law_has_its_exponent_everywhere_whatever_the_order() {
        let points = [4.0, 1.0, 2.0, 9.0, 3.0].map(|x: f64| (x, 7.0 * x.powf(-3.1)));
        let local = local_exponent(Law::Power, set(Law::Power, 0, &points));
        assert_eq!(local.x.len(), 4);
        for (x, expected) in local.x.iter().zip([2.0, 6.0, 12.0, 36.0]) {
            close(*x, f64::sqrt(expected));
        }
        local.exponent.iter().for_each(|n| close(*n, -3.1));
    }

    #[test]
    fn runs_of_equal_x_count_as_their_mean() {
        let points = [(1.0, 2.0), (3.0, 5.0), (1.0, 4.0), (3.0, 9.0), (4.0, 7.0)];
        let local = local_exponent(Law::Linear, set(Law::Linear, 0, &points));
        assert_eq!(local, LocalExponent { x: vec![2.0, 3.5], exponent: vec![2.0, 0.0] });
        // What differs by rounding is no neighbour.
        let rounded = [(9009.999999999998, 2.0), (9010.0, 4.0), (9012.0, 5.0)];
        let local = local_exponent(Law::Linear, set(Law::Linear, 0, &rounded));
        assert_eq!(local.x.len(), 1);
        close(local.exponent[0], 1.0);
    }

    /// Of wide mélanges the runs at high melt have no result, of narrow ones those at low melt: means over what is
    /// left would rise, and every set falls.
    #[test]
    fn sets_with_holes_do_not_make_up_a_slope() {
        let mut runs = Vec::new();
        for (number, (factor, exponent, has)) in
            [(1.0, -3.4, 0..4), (1e3, -3.5, 2..6), (1e6, -3.6, 3..8)].into_iter().enumerate()
        {
            let points: Vec<_> = has
                .map(|i| {
                    let x = 1.0 + f64::from(i);
                    (x, factor * x.powf(exponent))
                })
                .collect();
            runs.extend(set(Law::Power, number as u32, &points));
        }
        let local = local_exponent(Law::Power, runs);
        assert_eq!(local.x.len(), 7);
        let expected = [-3.4, -3.4, -3.45, -3.55, -3.55, -3.6, -3.6];
        local.exponent.iter().zip(expected).for_each(|(n, expected)| close(*n, expected));
    }

    #[test]
    fn a_slope_over_a_hole_is_none() {
        let mut runs = set(Law::Linear, 0, &[(1.0, 1.0), (3.0, 5.0)]);
        runs.extend(set(Law::Linear, 1, &[(2.0, 70.0), (4.0, 90.0)]));
        assert_eq!(local_exponent(Law::Linear, runs), LocalExponent::default());
    }

    #[test]
    fn many_different_x_are_put_together_and_none_is_lost() {
        let line = |x: f64| (x, 3.0 * x - 1.0);
        let points: Vec<_> = (0..10_007).map(|i| line(f64::from(i * 7919 % 10_007))).collect();
        let local = local_exponent(Law::Linear, set(Law::Linear, 0, &points));
        assert!((FEW_PLACES - 10..=FEW_PLACES).contains(&local.x.len()), "{}", local.x.len());
        assert!(local.x.is_sorted() && local.x[0] > 10.0);
        local.exponent.iter().for_each(|n| close(*n, 3.0));
        // Of 1000 different x nothing is put together.
        let exact = local_exponent(Law::Linear, set(Law::Linear, 0, &points[..MOST_PLACES]));
        assert_eq!(exact.x.len(), MOST_PLACES - 1);
    }

    #[test]
    fn one_place_or_none_has_no_slope() {
        for points in [vec![], vec![(1.0, 2.0)], vec![(1.0, 2.0), (1.0, 3.0)]] {
            let none = local_exponent(Law::Exponential, set(Law::Exponential, 0, &points));
            assert_eq!(none, LocalExponent::default());
        }
    }
}
