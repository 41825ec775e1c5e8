//! Runs told apart by the values of columns: which of them agree in all of these. Knows no law.

use crate::domain::same::same_if_any;
use std::collections::HashMap;

/// Whether a column differs among runs, given by their places.
pub fn differs(places: &[usize], column: &[Option<f64>]) -> bool {
    let mut values = places.iter().map(|place| column[*place]);
    values.next().is_some_and(|first| values.any(|other| !same_if_any(other, first)))
}

/// A number for each of the runs, the same for those that agree in all columns.
pub fn sets(places: &[usize], columns: &[&[Option<f64>]]) -> Vec<u32> {
    let mut sets = vec![0; places.len()];
    for column in columns {
        let mut numbers: HashMap<(u32, u32), u32> = HashMap::new();
        for (set, kind) in sets.iter_mut().zip(kinds(places, column)) {
            let next = numbers.len() as u32;
            *set = *numbers.entry((*set, kind)).or_insert(next);
        }
    }
    sets
}

/// The same for one column.
fn kinds(places: &[usize], column: &[Option<f64>]) -> Vec<u32> {
    let mut order: Vec<usize> = (0..places.len()).collect();
    let value = |i: usize| column[places[i]];
    let key = |i: usize| value(i).map_or((true, 0.0), |v| (false, v));
    order.sort_unstable_by(|a, b| {
        let (a, b) = (key(*a), key(*b));
        a.0.cmp(&b.0).then_with(|| a.1.total_cmp(&b.1))
    });
    let (mut kinds, mut kind) = (vec![0; places.len()], 0);
    for pair in order.windows(2) {
        kind += u32::from(!same_if_any(value(pair[0]), value(pair[1])));
        kinds[pair[1]] = kind;
    }
    kinds
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_that_agree_in_all_columns_are_a_set() {
        let width = [2.0, 4.0, 2.0, 4.0, 2.0].map(Some);
        let b = [Some(0.3), Some(0.3), Some(0.1 + 0.2), None, Some(-1.0)];
        assert_eq!(sets(&[0, 1, 2, 3, 4], &[&width, &b]), [0, 1, 0, 2, 3]);
        assert_eq!(sets(&[4, 2, 0], &[&width, &b]), [0, 1, 1]);
        assert_eq!(sets(&[4, 2, 0], &[]), [0, 0, 0]);
        assert!(!differs(&[0, 2, 4], &width) && !differs(&[0, 1, 2], &b));
        assert!(differs(&[0, 1], &width) && differs(&[1, 3], &b) && !differs(&[], &b));
    }
}
