//! How like two runs' rows of a table are: bit by bit, and by the largest relative difference of a number.

use super::provenance;
use super::schema::Kind;
use arrow_array::cast::AsArray;
use arrow_array::types::{Float64Type, Int64Type};
use arrow_array::{Array, ArrayRef, RecordBatch};
use serde::Serialize;

/// What differs between what is stored of a run and what comes out now.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Likeness {
    /// The number that differs most, relative to its scale; none if all have the same bits.
    pub largest: Option<Difference>,
    /// What differs and has no tolerance: rows, names, counts, missing numbers.
    pub other: Option<String>,
    /// What differs of how the solver got there, such as its iterations, which another processor may change.
    pub way: Option<String>,
}

/// A number that differs.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Difference {
    /// Table and column.
    pub name: String,
    /// The stored number.
    pub stored: f64,
    /// The number now.
    pub now: f64,
    /// Their difference, relative to their scale.
    pub relative: f64,
}

/// Columns that tell the solver's way, and not what it found.
const WAY: [&str; 6] =
    ["detail", "iterations", "attempts", "residual_history", "solves", "without_state"];
/// Numbers of order 1 by what they are made of, near 0 if all is well.
const OF_ORDER_ONE: [&str; 3] = ["residual_norm", "mass_budget_defect", "yielding_fraction"];
/// Numbers that are differences, each with the number whose size is its scale if that is larger.
const SCALES: [(&str, &str); 5] = [
    ("force_n_per_m", "force_quasi_static_n_per_m"),
    ("terminus_x_m", "length_m"),
    ("grid_error_length_m", "length_m"),
    ("grid_error_thickness_0_m", "thickness_0_m"),
    ("grid_error_force_n_per_m", "force_n_per_m"),
];

/// Strain rates are differences of velocities: their scale is at least that of the whole mélange, U_L/L.
const STRAIN_RATES: [&str; 2] = ["strain_rate_0_per_a", "strain_rate_min_per_a"];

impl Likeness {
    /// Whether everything has the same bits.
    pub fn is_bitwise(&self) -> bool {
        *self == Self::default()
    }

    /// Whether all numbers agree to a relative tolerance, and all else does.
    pub fn is_within(&self, tolerance: f64) -> bool {
        self.other.is_none() && self.largest.as_ref().is_none_or(|d| d.relative <= tolerance)
    }

    /// Compares a run's rows of a table; a column that the file does not have yet says nothing.
    pub fn compare(&mut self, kind: Kind, stored: &RecordBatch, now: &RecordBatch) {
        if stored.num_rows() != now.num_rows() {
            let (before, after) = (stored.num_rows(), now.num_rows());
            let other = format!("{}: {before} rows stored, {after} now", kind.name());
            self.other.get_or_insert(other);
            return;
        }
        for field in stored.schema().fields() {
            let name = field.name().as_str();
            if name == "run_index" || provenance::is_column(name) {
                continue;
            }
            let columns = (stored.column_by_name(name), now.column_by_name(name));
            let (Some(before), Some(after)) = columns else { continue };
            let path = format!("{}.{name}", kind.name());
            match (numbers(before), numbers(after)) {
                (Some(before), Some(after)) if !WAY.contains(&name) => {
                    let floors = floors(name, stored);
                    self.compare_numbers(kind, &path, &before, &after, &floors);
                }
                _ => self.compare_others(&path, WAY.contains(&name), before, after),
            }
        }
    }

    /// Compares numbers by row. The scale of a table whose rows follow each other along the fjord, in time or along a curve is the largest
    /// number of the column; of other tables, whose rows are of different kinds, that of the row.
    fn compare_numbers(
        &mut self,
        kind: Kind,
        path: &str,
        before: &[Vec<f64>],
        after: &[Vec<f64>],
        floors: &[f64],
    ) {
        let largest =
            |row: &[f64]| row.iter().map(|v| v.abs()).filter(|v| v.is_finite()).fold(0.0, f64::max);
        let is_one_quantity =
            matches!(kind, Kind::Profiles | Kind::Series | Kind::Branches | Kind::Roots);
        let all = if is_one_quantity {
            before.iter().map(|row| largest(row)).fold(0.0, f64::max)
        } else {
            0.0
        };
        for ((before, after), floor) in before.iter().zip(after).zip(floors) {
            if before.len() != after.len() {
                let (stored, now) = (before.len(), after.len());
                self.other.get_or_insert(format!("{path}: {stored} numbers stored, {now} now"));
                return;
            }
            let scale = largest(before).max(largest(after)).max(all).max(*floor);
            for (stored, now) in before.iter().zip(after) {
                if stored.to_bits() == now.to_bits() || (stored.is_nan() && now.is_nan()) {
                    continue;
                }
                if stored.is_nan() || now.is_nan() {
                    let told = |v: &f64| if v.is_nan() { "none".into() } else { format!("{v}") };
                    let (stored, now) = (told(stored), told(now));
                    self.other.get_or_insert(format!("{path}: {stored} stored, {now} now"));
                    continue;
                }
                // Of two zeros that differ in sign the scale may be 0.
                let distance = (stored - now).abs();
                let relative = if distance == 0.0 { 0.0 } else { distance / scale };
                if self.largest.as_ref().is_none_or(|found| relative > found.relative) {
                    let (name, stored, now) = (path.to_owned(), *stored, *now);
                    self.largest = Some(Difference { name, stored, now, relative });
                }
            }
        }
    }

    fn compare_others(&mut self, path: &str, is_way: bool, before: &ArrayRef, after: &ArrayRef) {
        // A file of an older version that was put together anew has nulls for what it does not tell.
        let differs = (0..before.len()).find(|row| {
            !(is_way && before.is_null(*row)) && before.slice(*row, 1) != after.slice(*row, 1)
        });
        let Some(row) = differs else { return };
        let told = |column: &ArrayRef| {
            let text = column.as_string_opt::<i32>().map(|c| format!("`{}`", c.value(row)));
            let whole = column.as_primitive_opt::<Int64Type>().map(|c| c.value(row).to_string());
            let flag = column.as_boolean_opt().map(|c| c.value(row).to_string());
            let value = text.or(whole).or(flag).unwrap_or_else(|| "others".into());
            if column.is_null(row) { "none".into() } else { value }
        };
        let sentence = format!("{path}: {} stored, {} now", told(before), told(after));
        let place = if is_way { &mut self.way } else { &mut self.other };
        place.get_or_insert(sentence);
    }
}

/// The numbers of a column by row, none as NaN; none if the column has others than numbers.
fn numbers(column: &ArrayRef) -> Option<Vec<Vec<f64>>> {
    let reals = |column: &dyn Array| -> Option<Vec<f64>> {
        let numbers = column.as_primitive_opt::<Float64Type>()?;
        Some(numbers.iter().map(|v| v.unwrap_or(f64::NAN)).collect())
    };
    if let Some(numbers) = reals(column) {
        return Some(numbers.into_iter().map(|v| vec![v]).collect());
    }
    let lists = column.as_list_opt::<i32>()?;
    (0..lists.len())
        .map(|row| if lists.is_null(row) { Some(Vec::new()) } else { reals(&lists.value(row)) })
        .collect()
}

/// The least scale of each row's number in a column.
fn floors(name: &str, table: &RecordBatch) -> Vec<f64> {
    if OF_ORDER_ONE.contains(&name) {
        return vec![1.0; table.num_rows()];
    }
    let sizes = |name: &str| {
        let rows = numbers(table.column_by_name(name)?)?;
        let size = |row: Vec<f64>| row.into_iter().map(f64::abs).fold(0.0, f64::max);
        Some(rows.into_iter().map(size).collect::<Vec<f64>>())
    };
    let floors = if STRAIN_RATES.contains(&name) {
        let ends = sizes("velocity_end_m_per_a").zip(sizes("length_m"));
        ends.map(|(speeds, lengths)| speeds.iter().zip(lengths).map(|(u, l)| u / l).collect())
    } else {
        SCALES.iter().find(|(of, _)| *of == name).and_then(|(_, beside)| sizes(beside))
    };
    // A missing number leaves the scale to the others.
    let finite = |floor: f64| if floor.is_finite() { floor } else { 0.0 };
    let floors = floors.unwrap_or_else(|| vec![0.0; table.num_rows()]);
    floors.into_iter().map(finite).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use arrow_array::{Float64Array, Int64Array, StringArray};
    use std::sync::Arc;

    fn table(force: f64, residual: f64, iterations: i64, status: &str) -> RecordBatch {
        let columns: Vec<(&str, ArrayRef)> = vec![
            ("status", Arc::new(StringArray::from(vec![status]))),
            ("force_n_per_m", Arc::new(Float64Array::from(vec![force]))),
            ("residual_norm", Arc::new(Float64Array::from(vec![residual]))),
            ("iterations", Arc::new(Int64Array::from(vec![iterations]))),
        ];
        RecordBatch::try_from_iter(columns).expect("columns of one length")
    }

    fn likeness(now: &RecordBatch) -> Likeness {
        let mut likeness = Likeness::default();
        likeness.compare(Kind::Runs, &table(8e6, 1e-12, 9, "converged"), now);
        likeness
    }

    #[test]
    fn the_same_bits_are_told_from_small_and_large_differences() {
        assert!(likeness(&table(8e6, 1e-12, 9, "converged")).is_bitwise());
        let near = likeness(&table(8e6 + 1e-4, 1e-12, 9, "converged"));
        assert!(!near.is_bitwise() && near.is_within(1e-9) && !near.is_within(1e-12));
        let largest = near.largest.expect("a difference");
        assert_eq!((largest.name.as_str(), largest.now), ("runs.force_n_per_m", 8e6 + 1e-4));
        let far = likeness(&table(8e6 + 1.0, 1e-12, 9, "converged"));
        assert!(!far.is_within(1e-9));
        let none = likeness(&table(f64::NAN, 1e-12, 9, "converged"));
        assert!(none.other.is_some() && !none.is_within(1.0));
    }

    #[test]
    fn a_residual_is_measured_in_ones_and_a_way_may_be_another() {
        let other = likeness(&table(8e6, 3e-11, 10, "converged"));
        assert!(!other.is_bitwise() && other.is_within(1e-9), "{other:?}");
        assert!(other.way.is_some_and(|way| way.contains("9 stored, 10 now")));
    }

    #[test]
    fn another_verdict_is_never_within() {
        let other = likeness(&table(8e6, 1e-12, 9, "failed"));
        assert!(!other.is_within(f64::INFINITY));
        assert!(other.other.is_some_and(|what| what.contains("`converged` stored, `failed` now")));
    }
}
