//! Curves through tables: exact where they can be, monotone, smooth, and refused with the place.

use melange_solver::interpolate::{Axis, Linear, Monotone, TableError};
use proptest::prelude::*;

/// x from steps of very different lengths, with any y.
fn points() -> impl Strategy<Value = (Vec<f64>, Vec<f64>)> {
    let point = (-1.0..2.0_f64, prop_oneof![Just(0.0), -1e3..1e3_f64]);
    prop::collection::vec(point, 2..12).prop_map(|steps| {
        let mut x = -7.0;
        let ascend = |(step, y): (f64, f64)| {
            x += 10_f64.powf(step);
            (x, y)
        };
        steps.into_iter().map(ascend).unzip()
    })
}

/// n + 1 places from a to b.
fn places(a: f64, b: f64, n: usize) -> impl Iterator<Item = f64> {
    (0..=n).map(move |i| (a + (b - a) * i as f64 / n as f64).min(b))
}

proptest! {
    #[test]
    fn linear_data_are_met_exactly(
        (x, _) in points(),
        (offset, slope) in (-1e3..1e3_f64, -1e3..1e3_f64),
    ) {
        let y: Vec<f64> = x.iter().map(|x| offset + slope * x).collect();
        let monotone = Monotone::new(x.clone(), y.clone()).expect("a table");
        let linear = Linear::new(x.clone(), y).expect("a table");
        let (first, last) = linear.range();
        for at in places(first, last, 50) {
            let expected = offset + slope * at;
            let rounding = 1e-12 * (offset.abs() + slope.abs() * first.abs().max(last));
            prop_assert!((monotone.value(at) - expected).abs() <= rounding);
            prop_assert!((linear.value(at) - expected).abs() <= rounding);
            // Rounding of the data over the shortest step, 0.1.
            prop_assert!((monotone.slope(at) - slope).abs() <= 1e2 * rounding);
            prop_assert!((linear.slope(at) - slope).abs() <= 1e2 * rounding);
        }
        let middle = offset + slope * 0.5 * (first + last);
        prop_assert!((linear.mean() - middle).abs() <= 1e-11 * (offset.abs() + slope.abs() * last.abs().max(7.0)));
    }

    #[test]
    fn both_go_through_their_points_and_stay_between_neighbours((x, y) in points()) {
        let monotone = Monotone::new(x.clone(), y.clone()).expect("a table");
        let linear = Linear::new(x.clone(), y.clone()).expect("a table");
        for i in 0..x.len() {
            prop_assert_eq!(monotone.value(x[i]), y[i]);
            prop_assert_eq!(linear.value(x[i]), y[i]);
        }
        for i in 1..x.len() {
            let rise = y[i] - y[i - 1];
            let rounding = 1e-12 * (y[i].abs() + y[i - 1].abs());
            for curve in [&|x| monotone.value(x), &|x| linear.value(x)] as [&dyn Fn(f64) -> f64; 2] {
                let values: Vec<f64> = places(x[i - 1], x[i], 40).map(curve).collect();
                for pair in values.windows(2) {
                    prop_assert!((pair[1] - pair[0]) * rise.signum() >= -rounding);
                }
                for value in values {
                    prop_assert!(value >= y[i].min(y[i - 1]) && value <= y[i].max(y[i - 1]));
                    prop_assert!(value >= monotone.minimum() && value <= linear.maximum());
                }
            }
            for at in places(x[i - 1], x[i], 40) {
                let slope = monotone.slope(at);
                prop_assert!(slope * rise.signum() >= -1e-12 * rise.abs() / (x[i] - x[i - 1]));
            }
        }
    }

    #[test]
    fn slopes_are_those_of_differences_and_continuous((x, y) in points()) {
        let monotone = Monotone::new(x.clone(), y.clone()).expect("a table");
        let linear = Linear::new(x.clone(), y.clone()).expect("a table");
        for i in 1..x.len() {
            let h = x[i] - x[i - 1];
            let steepest = ((y[i] - y[i - 1]) / h).abs();
            // Differences are exact for a parabola; what is left of the cubic is h²y'''/24.
            let (step, tolerance) = (1e-4 * h, 1e-6 * steepest + 1e-8 * (1.0 + y[i].abs() + y[i - 1].abs()) / h);
            for at in places(x[i - 1] + step, x[i] - step, 10) {
                for (value, slope) in [
                    (&|x| monotone.value(x) as _, monotone.slope(at)),
                    (&|x| linear.value(x) as _, linear.slope(at)),
                ] as [(&dyn Fn(f64) -> f64, f64); 2] {
                    let difference = (value(at + 0.5 * step) - value(at - 0.5 * step)) / step;
                    prop_assert!((difference - slope).abs() <= tolerance, "{difference} {slope}");
                }
            }
            // C¹: y' varies by no more than y'' allows, on both sides of a point.
            let close = 1e-9 * h;
            let jump = monotone.slope(x[i - 1] + close) - monotone.slope(x[i - 1]);
            prop_assert!(jump.abs() <= 1e-6 * steepest, "{jump}");
            let jump = monotone.slope(x[i] - close) - monotone.slope(x[i]);
            prop_assert!(jump.abs() <= 1e-6 * steepest + 1e-12, "{jump}");
        }
    }

    #[test]
    fn the_mean_is_that_of_quadrature((x, y) in points()) {
        let table = Linear::new(x.clone(), y.clone()).expect("a table");
        let (first, last) = table.range();
        // The midpoint rule is exact on each piece.
        let integral: f64 =
            x.windows(2).map(|p| table.value(0.5 * (p[0] + p[1])) * (p[1] - p[0])).sum();
        prop_assert!((table.mean() - integral / (last - first)).abs() <= 1e-9);
    }

    #[test]
    fn the_ends_hold_beyond_the_table((x, y) in points(), far in 1e-6..1e6_f64) {
        let monotone = Monotone::new(x.clone(), y.clone()).expect("a table");
        let linear = Linear::new(x.clone(), y.clone()).expect("a table");
        let (first, last) = monotone.range();
        prop_assert_eq!((first, last), (x[0], x[x.len() - 1]));
        for (at, end) in [(first - far, y[0]), (last + far, y[y.len() - 1])] {
            prop_assert_eq!([monotone.value(at), linear.value(at)], [end; 2]);
            prop_assert_eq!([monotone.slope(at), linear.slope(at)], [0.0; 2]);
        }
    }
}

/// On an even grid the harmonic mean's slopes err in second order, so the curve does in third.
#[test]
fn a_smooth_monotone_function_is_met_better_on_a_finer_grid() {
    let error = |n: usize| {
        let (x, y) = places(0.0, 1.0, n).map(|x| (x, x.exp())).unzip();
        let curve = Monotone::new(x, y).expect("a table");
        places(0.0, 1.0, 1001).map(|x| (curve.value(x) - x.exp()).abs()).fold(0.0, f64::max)
    };
    let order = (error(20) / error(40)).log2();
    assert!(order > 2.8, "order {order}");
}

#[test]
fn equal_values_give_exactly_that_value() {
    let y = 4123.456789;
    let curve = Monotone::new(vec![0.0, 0.1, 7.0], vec![y; 3]).expect("a table");
    assert!(places(-1.0, 8.0, 1000).all(|x| curve.value(x) == y && curve.slope(x) == 0.0));
}

#[test]
fn no_number_is_passed_through() {
    let curve = Monotone::new(vec![0.0, 1.0], vec![0.0, 1.0]).expect("a table");
    let linear = Linear::new(vec![0.0, 1.0], vec![0.0, 1.0]).expect("a table");
    assert!(curve.value(f64::NAN).is_nan() && linear.value(f64::NAN).is_nan());
}

#[test]
fn tables_that_are_no_curve_are_refused_with_the_place() {
    use TableError::*;
    let inf = f64::INFINITY;
    let cases = [
        (vec![0.0, 1.0], vec![1.0], LengthsDiffer { x: 2, y: 1 }),
        (vec![0.0], vec![1.0], TooFewPoints { points: 1 }),
        (vec![], vec![], TooFewPoints { points: 0 }),
        (vec![0.0, inf], vec![1.0; 2], NotFinite { axis: Axis::X, index: 1, value: inf }),
        (vec![0.0, 1.0], vec![-inf, 1.0], NotFinite { axis: Axis::Y, index: 0, value: -inf }),
        (vec![0.0, 2.0, 2.0], vec![1.0; 3], NotAscending { index: 2, value: 2.0, previous: 2.0 }),
        (vec![0.0, -1.0], vec![1.0; 2], NotAscending { index: 1, value: -1.0, previous: 0.0 }),
        (vec![0.0, 5e-324], vec![0.0, 3.0], TooSteep { index: 1, value: 3.0 }),
        (vec![-1e308, 1e308], vec![3.0; 2], TooSteep { index: 1, value: 3.0 }),
    ];
    for (x, y, expected) in cases {
        assert_eq!(Linear::new(x.clone(), y.clone()), Err(expected.clone()));
        assert_eq!(Monotone::new(x, y), Err(expected.clone()));
        let (axis, index, value) = expected.place();
        let text = expected.to_string();
        assert!(text.contains(&expected.permitted()) && !text.is_empty(), "{text}");
        if let (Some(index), Some(value)) = (index, value) {
            assert!(text.starts_with(&format!("{axis}[{index}] = {value}")), "{text}");
        }
    }
    let error = Linear::new(vec![0.0, f64::NAN], vec![0.0; 2]).expect_err("no number");
    assert!(error.to_string().starts_with("x[1] = NaN: finite numbers"), "{error}");
}
