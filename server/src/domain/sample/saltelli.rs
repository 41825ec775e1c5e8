//! The design that tells which parameter makes how much of a result's variance: two sets of base points, A
//! and B, and for each parameter a third, which is A with that parameter from B. Knows no results.

use super::{Method, Range, SampleForm, directions};
use crate::domain::axes::{Column, Columns};
use crate::domain::refusal::Refusal;
use serde::Deserialize;
use std::sync::Arc;

/// A sweep's runs as a design of d parameters: base point after base point, each with d + 2 runs. These are
/// the point of A, that of A with the first parameter from B, with the second, and so on, and the point of B.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Design {
    /// Number of base points.
    pub base_points: usize,
    /// What is drawn, in alphabetical order.
    pub parameters: Vec<String>,
}

impl Design {
    /// The design of a sweep's document, given as JSON; none if its points are others.
    pub fn of_document(json: &str) -> Option<Self> {
        #[derive(Deserialize)]
        struct Sampled {
            sample: Option<SampleForm>,
        }
        let sample = serde_json::from_str::<Sampled>(json).ok()?.sample?;
        if sample.method != Method::Saltelli {
            return None;
        }
        let base_points = usize::try_from(sample.n).ok()?;
        let mut parameters: Vec<String> =
            sample.ranges.0.into_iter().map(|(name, _)| name).collect();
        parameters.sort_unstable();
        Some(Self { base_points, parameters })
    }

    /// Number of runs.
    pub fn runs(&self) -> usize {
        runs(self.base_points, self.parameters.len())
    }
}

/// Runs of so many base points in so many parameters.
pub(super) fn runs(base_points: usize, parameters: usize) -> usize {
    base_points.saturating_mul(parameters.saturating_add(2))
}

/// The design of ranges in alphabetical order, a column for each. A and B are the first and the second half of
/// the coordinates of one sequence of Sobol's, each shifted by itself. The first point is no corner, since it is
/// shifted too, and belongs to the net: it is not skipped.
pub(super) fn columns(sample: &SampleForm, ranges: &[Range]) -> Result<Columns, Refusal> {
    if sample.n < 2 {
        let permitted = "at least two base points, since one has no variance";
        return Err(Refusal::value("sample.n", sample.n, permitted));
    }
    if let [only] = ranges {
        let permitted = "at least two parameters' ranges: alone, one makes all of the variance";
        return Err(Refusal::value("sample.ranges", vec![only.name], permitted));
    }
    let directions = directions(2 * ranges.len());
    let (of_a, of_b) = directions.split_at(ranges.len());
    let columns = ranges.iter().enumerate().map(|(place, range)| {
        let a = sample.fractions(range.name, &of_a[place]);
        let b = sample.shifted("shift of B", range.name, &of_b[place]);
        let mut values = Vec::with_capacity(sample.count());
        for (a, b) in a.zip(b) {
            let (a, b) = (range.value(a), range.value(b));
            values.push(a);
            values.extend((0..ranges.len()).map(|other| if other == place { b } else { a }));
            values.push(b);
        }
        Column::Parameter(range.name, Arc::new(values))
    });
    Ok(columns.collect())
}

#[cfg(test)]
mod tests {
    use super::super::tests::values;
    use super::*;

    fn sample(n: u64, seed: u64) -> SampleForm {
        let ranges = r#"{"mu_s": [0.2, 0.5], "b": {"log": [1e4, 1e6]}, "n_cells": [20, 27]}"#;
        let text =
            format!(r#"{{"method": "saltelli", "n": {n}, "seed": {seed}, "ranges": {ranges}}}"#);
        serde_json::from_str(&text).expect("a sample")
    }

    #[test]
    fn each_base_point_has_its_runs_in_the_order_told() {
        let form = sample(16, 3);
        assert_eq!(form.count(), 16 * 5);
        // By column: b, mu_s, n_cells.
        let columns = values(&form);
        for (place, column) in columns.iter().enumerate() {
            assert_eq!(column.len(), form.count());
            for runs in column.chunks(5) {
                let (a, b) = (runs[0], runs[4]);
                for (other, value) in runs[1..4].iter().enumerate() {
                    assert_eq!(*value, if other == place { b } else { a });
                }
            }
        }
        let json = serde_json::json!({"name": "x", "sample": form, "regime": "steady"});
        let design = Design::of_document(&json.to_string()).expect("a design");
        assert_eq!(design.parameters, ["b", "mu_s", "n_cells"]);
        assert_eq!((design.base_points, design.runs()), (16, 80));
        for other in [
            r#"{"sample": {"method": "sobol", "n": 4, "ranges": {"b": [1, 2]}}}"#,
            r#"{"axes": []}"#,
            "null",
        ] {
            assert_eq!(Design::of_document(other), None, "{other}");
        }
    }

    /// A and B each hit every stratum of each range once, and no coordinate is another's copy.
    #[test]
    fn both_sets_are_nets_and_independent() {
        const N: usize = 256;
        let columns = values(&sample(N as u64, 7));
        let fraction = |place: usize, value: f64| match place {
            0 => (value / 1e4).ln() / 100_f64.ln(),
            _ => (value - 0.2) / 0.3,
        };
        let mut coordinates: Vec<Vec<f64>> = Vec::new();
        for (place, column) in columns[..2].iter().enumerate() {
            for set in [0, 4] {
                let drawn = column.iter().skip(set).step_by(5);
                coordinates.push(drawn.map(|value| fraction(place, *value)).collect());
            }
        }
        for u in &coordinates {
            let mut strata: Vec<usize> = u.iter().map(|u| (u * N as f64 + 1e-9) as usize).collect();
            strata.sort_unstable();
            assert_eq!(strata, (0..N).collect::<Vec<_>>());
        }
        for (i, u) in coordinates.iter().enumerate() {
            for v in &coordinates[..i] {
                let product: f64 = u.iter().zip(v).map(|(u, v)| (u - 0.5) * (v - 0.5)).sum();
                assert!((12.0 * product / N as f64).abs() < 0.1, "correlated: {product}");
            }
        }
        // Whole numbers have the same share in both.
        for set in [0, 4] {
            let drawn = || columns[2].iter().skip(set).step_by(5);
            for cells in 20..=27 {
                assert_eq!(drawn().filter(|v| **v == f64::from(cells)).count(), N / 8);
            }
        }
    }

    /// So that a longer design solves only what is new.
    #[test]
    fn the_first_runs_of_a_longer_design_are_those_of_a_shorter() {
        let (short, long) = (values(&sample(8, 1)), values(&sample(21, 1)));
        for (short, long) in short.iter().zip(&long) {
            assert_eq!(short[..], long[..short.len()]);
        }
    }

    /// Kept for ever: a sweep is its document, and its points are drawn again from it at every start.
    #[test]
    fn points_stay_what_they_are() {
        let columns = values(&sample(100, 1));
        let drawn = [0, 499].map(|i| [columns[0][i], columns[1][i], columns[2][i]]);
        let pinned = [
            [16439.591107354103, 0.25223228723025165, 27.0],
            [273549.131334791, 0.3590619003719512, 24.0],
        ];
        assert_eq!(drawn, pinned);
        assert_ne!(columns, values(&sample(100, 2)), "the seed matters");
        let mut turned = sample(100, 1);
        turned.ranges.0.reverse();
        assert_eq!(columns, values(&turned), "the order of the ranges does not");
    }

    #[test]
    fn designs_that_tell_nothing_are_refused() {
        for (n, ranges, field) in [
            (1, r#"{"b": [1e4, 1e6], "d_m": [10, 20]}"#, "sample.n"),
            (0, r#"{"b": [1e4, 1e6], "d_m": [10, 20]}"#, "sample.n"),
            (64, r#"{"b": [1e4, 1e6]}"#, "sample.ranges"),
            (64, "{}", "sample.ranges"),
        ] {
            let text = format!(r#"{{"method": "saltelli", "n": {n}, "ranges": {ranges}}}"#);
            let form: SampleForm = serde_json::from_str(&text).expect("a sample");
            let refusal = form.columns().expect_err("it is refused");
            assert_eq!(refusal.field.as_deref(), Some(field), "{refusal}");
        }
    }

    /// Twice as many dimensions as there are parameters, and all of them have direction numbers.
    #[test]
    fn every_parameter_can_be_drawn_at_once() {
        let most = 2 * (melange_solver::params::PARAMETERS.len() + 1);
        let directions = directions(most);
        assert_eq!(directions.len(), most);
        for i in 0..most {
            assert!((0..i).all(|j| directions[i] != directions[j]), "{i} is another's copy");
        }
    }
}
