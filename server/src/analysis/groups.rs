//! Runs put into groups by the value of a column: each value a group, or stretches of values with about equally
//! many runs. Knows no law.

use crate::domain::same::same;

/// Most different values that have a group each.
const MOST_VALUES: usize = 12;
/// Groups of runs with more values.
const BINS: usize = 6;

/// How runs are grouped.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Grouping {
    /// All of them together.
    One,
    /// By each value.
    EachValue,
    /// By stretches of values.
    Bins,
}

impl Grouping {
    /// As it is told.
    pub fn name(self) -> &'static str {
        match self {
            Self::One => "one group",
            Self::EachValue => "each value",
            Self::Bins => "bins of about equally many runs",
        }
    }
}

/// A group of runs.
#[derive(Debug, Clone, PartialEq)]
pub struct Members {
    /// The least and the greatest value; none for runs that have no value, and without grouping.
    pub range: Option<(f64, f64)>,
    /// Which runs, by their place, in its order.
    pub places: Vec<usize>,
}

/// All runs as one group.
pub fn one(runs: usize) -> (Grouping, Vec<Members>) {
    (Grouping::One, vec![Members { range: None, places: (0..runs).collect() }])
}

/// Runs by their value, ascending; last those that have none. Each run is in one group. Bins have equally many of
/// the runs that are used; others are in the bin that their value falls in. Runs of equal value are in the same
/// bin, so that they have equally many only as nearly as that permits, and there are fewer if one value has many.
pub fn by_value(values: &[Option<f64>], is_used: &[bool]) -> (Grouping, Vec<Members>) {
    let mut sorted: Vec<(f64, bool)> =
        values.iter().zip(is_used).filter_map(|(v, is_used)| Some(((*v)?, *is_used))).collect();
    sorted.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    let used = |runs: &[(f64, bool)]| runs.iter().filter(|(_, is_used)| *is_used).count();
    let all_used = used(&sorted).max(1);
    // Each value's least and greatest form, with how many of its runs are used.
    let of_each: Vec<(f64, f64, usize)> = sorted
        .chunk_by(|a, b| same(a.0, b.0))
        .map(|equal| (equal[0].0, equal[equal.len() - 1].0, used(equal)))
        .collect();
    let is_each = of_each.len() <= MOST_VALUES;
    let grouping = if is_each { Grouping::EachValue } else { Grouping::Bins };
    let mut groups: Vec<Members> = Vec::new();
    let mut number_of_last = None;
    let mut group_of = Vec::with_capacity(of_each.len());
    let mut before = 0;
    for (i, &(least, greatest, runs)) in of_each.iter().enumerate() {
        // The bin in which the middle one of the runs of this value falls.
        let middle = (2 * before + runs) * BINS / (2 * all_used);
        let number = if is_each { i } else { middle.min(BINS - 1) };
        before += runs;
        match groups.last_mut().filter(|_| number_of_last == Some(number)) {
            Some(group) => group.range = group.range.map(|(low, _)| (low, greatest)),
            None => groups.push(Members { range: Some((least, greatest)), places: Vec::new() }),
        }
        number_of_last = Some(number);
        group_of.push(groups.len() - 1);
    }
    let mut without = Vec::new();
    for (place, value) in values.iter().enumerate() {
        match value {
            Some(value) => {
                let which = of_each.partition_point(|(_, greatest, _)| greatest < value);
                groups[group_of[which]].places.push(place);
            }
            None => without.push(place),
        }
    }
    if !without.is_empty() {
        groups.push(Members { range: None, places: without });
    }
    (grouping, groups)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn few_values_have_a_group_each_and_runs_without_one_come_last() {
        let values = [Some(3.0), None, Some(-0.0), Some(3.0), Some(0.0), Some(-1.0)];
        let (grouping, groups) = by_value(&values, &[true; 6]);
        assert_eq!(grouping.name(), "each value");
        let told: Vec<_> = groups.iter().map(|g| (g.range, g.places.as_slice())).collect();
        let expected: [(_, &[usize]); 4] = [
            (Some((-1.0, -1.0)), &[5]),
            (Some((0.0, 0.0)), &[2, 4]),
            (Some((3.0, 3.0)), &[0, 3]),
            (None, &[1]),
        ];
        assert_eq!(told, expected);
    }

    #[test]
    fn many_values_make_six_bins_of_equally_many_runs() {
        for runs in [13, 60, 1000, 1001] {
            let values: Vec<_> = (0..runs).map(|i| Some(f64::from(i * 7919 % runs))).collect();
            let (grouping, groups) = by_value(&values, &vec![true; values.len()]);
            assert_eq!(grouping, Grouping::Bins);
            assert_eq!(groups.len(), 6);
            let sizes: Vec<usize> = groups.iter().map(|g| g.places.len()).collect();
            let (least, most) = (sizes.iter().min(), sizes.iter().max());
            assert!(most <= least.map(|n| n + 1).as_ref(), "{sizes:?}");
        }
    }

    #[test]
    fn a_value_of_most_runs_is_not_torn_apart() {
        let values: Vec<_> = (0..100).map(|i| Some(f64::from(i.max(80)))).collect();
        let (grouping, groups) = by_value(&values, &[true; 100]);
        assert_eq!(grouping, Grouping::Bins);
        let sizes: Vec<usize> = groups.iter().map(|g| g.places.len()).collect();
        assert_eq!(sizes, [81, 2, 17]);
        assert_eq!(groups[0].range, Some((80.0, 80.0)));
    }

    /// As iterations are 0 of runs without a result: half of all.
    #[test]
    fn bins_are_made_of_the_runs_used() {
        let values: Vec<_> = (0..120).map(|i| Some(f64::from(i - 60).max(0.0))).collect();
        let is_used: Vec<bool> = (0..120).map(|i| i >= 60).collect();
        let (_, groups) = by_value(&values, &is_used);
        let used = |g: &Members| g.places.iter().filter(|place| is_used[**place]).count();
        assert_eq!(groups.iter().map(used).collect::<Vec<_>>(), [10; 6]);
        assert_eq!((groups[0].places.len(), groups[0].range), (70, Some((0.0, 9.0))));
        // Nothing that is used, and what lies beyond it.
        let (_, groups) = by_value(&values, &[false; 120]);
        assert_eq!(groups.len(), 1);
        let (_, groups) = by_value(&values, &is_used.iter().map(|used| !used).collect::<Vec<_>>());
        assert_eq!(groups.iter().map(|g| g.places.len()).sum::<usize>(), 120);
    }

    #[test]
    fn values_that_differ_by_rounding_are_one() {
        let values = [9010.0, 9009.999999999998, 5.0, 9010.0].map(Some);
        let (_, groups) = by_value(&values, &[true; 4]);
        assert_eq!(groups.len(), 2);
        assert_eq!(groups[1].range, Some((9009.999999999998, 9010.0)));
        assert_eq!(groups[1].places, [0, 1, 3]);
    }

    proptest! {
        #[test]
        fn each_run_is_in_one_group_whose_range_holds_its_value(
            runs in prop::collection::vec((prop::option::of((0..40_i32).prop_map(f64::from)), any::<bool>()), 0..200),
        ) {
            let (values, is_used): (Vec<_>, Vec<_>) = runs.into_iter().unzip();
            let (_, groups) = by_value(&values, &is_used);
            let mut seen = vec![0; values.len()];
            for group in &groups {
                prop_assert!(group.places.is_sorted() && !group.places.is_empty());
                for &place in &group.places {
                    seen[place] += 1;
                    match (values[place], group.range) {
                        (Some(value), Some((low, high))) => prop_assert!(low <= value && value <= high),
                        (value, range) => prop_assert!(value.is_none() && range.is_none()),
                    }
                }
            }
            prop_assert!(seen.iter().all(|n| *n == 1));
            let ranges: Vec<_> = groups.iter().filter_map(|g| g.range).collect();
            prop_assert!(ranges.windows(2).all(|w| w[0].1 < w[1].0), "{:?}", ranges);
        }
    }
}
