//! How melt is spread: means by quadrature, slopes by differences, tables in their frames.

use melange_solver::interpolate::{Axis, Beyond, Linear};
use melange_solver::melt::{Frame, MeltShape, Place};
use proptest::prelude::*;

fn at_chi(chi: f64) -> Place {
    Place { chi, x_m: 1e4 * chi, terminus_x_m: 0.0 }
}

/// Mean over χ by Gauss–Legendre with five points on each of n pieces, exact to the ninth power.
fn mean(shape: &MeltShape, n: usize) -> f64 {
    let nodes = [0.0, 0.538469310105683, 0.906179845938664];
    let weights = [0.568888888888889, 0.478628670499366, 0.236926885056189];
    let piece = |i: usize| {
        let f = |t: f64| shape.factor(at_chi((i as f64 + 0.5 + 0.5 * t) / n as f64));
        let pair = |k: usize| 0.5 * weights[k] * (f(nodes[k]) + f(-nodes[k]));
        (0.5 * weights[0] * f(0.0) + pair(1) + pair(2)) / n as f64
    };
    (0..n).map(piece).sum()
}

fn table(x: &[f64], y: &[f64]) -> Linear {
    Linear::new(x.to_vec(), y.to_vec()).expect("a table")
}

#[test]
fn named_shapes_have_mean_one_and_their_names() {
    for name in MeltShape::names() {
        let shape = MeltShape::named(name).expect("known");
        assert_eq!(shape.name(), Some(name));
        assert!((mean(&shape, 1) - 1.0).abs() < 1e-13, "{name}: {}", mean(&shape, 1));
        assert_eq!(shape.reach(0.0), None);
        assert_eq!(shape.slope_by_x(at_chi(0.3)), 0.0);
        assert!(!shape.depends_on_bedrock());
    }
    assert_eq!(MeltShape::named("round"), None);
    assert_eq!(MeltShape::default().name(), Some("uniform"));
}

#[test]
fn named_shapes_are_the_documented_ones() {
    let ratio = |name, chi| {
        let shape = MeltShape::named(name).expect("known");
        shape.factor(at_chi(chi)) / shape.factor(at_chi(0.0))
    };
    for (name, chi, expected) in [
        ("uniform", 0.7, 1.0),
        ("linear", 1.0, 0.2 / 0.6),
        ("less_linear", 1.0, 0.3 / 0.5),
        ("u_shaped", 0.5, 0.5 / (0.5 + 50.0 / 64.0)),
        ("u_shaped", 1.0, 1.0),
    ] {
        assert!((ratio(name, chi) - expected).abs() < 1e-14, "{name}");
    }
}

proptest! {
    #[test]
    fn tables_over_chi_have_mean_one(factors in prop::collection::vec(0.0..5.0_f64, 2..9)) {
        prop_assume!(factors.iter().any(|f| *f > 0.1));
        let pieces = factors.len() - 1;
        let chi: Vec<f64> = (0..=pieces).map(|i| i as f64 / pieces as f64).collect();
        let shape = MeltShape::over_chi(table(&chi, &factors)).expect("permitted");
        prop_assert!((mean(&shape, pieces) - 1.0).abs() < 1e-12);
        prop_assert_eq!(shape.name(), None);
        prop_assert_eq!(shape.slope_by_x(at_chi(0.3)), 0.0);
        let place = Place { x_m: 7.0, terminus_x_m: 8.0, ..at_chi(0.3) };
        prop_assert_eq!(shape.factor(place), shape.factor(at_chi(0.3)));
    }
}

#[test]
fn tables_over_x_are_taken_as_they_are_in_their_frame() {
    let factors = table(&[0.0, 1e4, 2e4], &[1.0, 3.0, 2.0]);
    let place = Place { chi: 0.5, x_m: 4e3, terminus_x_m: 5e3 };
    for (frame, factor, reach) in
        [(Frame::Terminus, 1.8, (0.0, 2e4)), (Frame::Bedrock, 2.8, (-5e3, 1.5e4))]
    {
        let shape = MeltShape::over_x(factors.clone(), frame, Beyond::Refused).expect("permitted");
        assert!((shape.factor(place) - factor).abs() < 1e-14);
        assert_eq!(shape.reach(place.terminus_x_m), Some(reach));
        assert_eq!(shape.depends_on_bedrock(), frame == Frame::Bedrock);
        let moved = |x_m| shape.factor(Place { x_m, ..place });
        let difference = (moved(4e3 + 1.0) - moved(4e3 - 1.0)) / 2.0;
        assert!((shape.slope_by_x(place) - difference).abs() < 1e-12);
        let beyond = Place { x_m: 3e4, ..place };
        assert_eq!((shape.factor(beyond), shape.slope_by_x(beyond)), (2.0, 0.0));
    }
}

#[test]
fn a_table_that_goes_on_is_known_everywhere_and_an_even_one_knows_no_bedrock() {
    let even = table(&[0.0, 1e4], &[0.5; 2]);
    let shape = MeltShape::over_x(even, Frame::Bedrock, Beyond::Constant).expect("permitted");
    assert_eq!(shape.reach(3e3), None);
    assert!(!shape.depends_on_bedrock());
    assert_eq!(shape.factor(at_chi(0.2)), 0.5);
}

#[test]
fn unfit_tables_are_refused_with_the_place() {
    for (chi, factors, place, permitted) in [
        ([0.1, 1.0], [1.0, 1.0], (Axis::X, Some(0), Some(0.1)), "from 0"),
        ([0.0, 0.9], [1.0, 1.0], (Axis::X, Some(1), Some(0.9)), "up to 1"),
        ([0.0, 1.0], [1.0, -0.1], (Axis::Y, Some(1), Some(-0.1)), "factors of 0 or more"),
        ([0.0, 1.0], [0.0, 0.0], (Axis::Y, None, Some(0.0)), "factors whose mean is"),
    ] {
        let error = MeltShape::over_chi(table(&chi, &factors)).expect_err("unfit");
        assert_eq!(error.place(), place);
        assert!(error.permitted().starts_with(permitted), "{error}");
        assert!(error.to_string().contains(permitted), "{error}");
    }
    let negative = table(&[0.0, 1.0], &[-1.0, 1.0]);
    let error =
        MeltShape::over_x(negative, Frame::Terminus, Beyond::Constant).expect_err("negative");
    assert_eq!(error.place(), (Axis::Y, Some(0), Some(-1.0)));
}
