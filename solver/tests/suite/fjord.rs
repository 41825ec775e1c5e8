//! The fjord's walls: straight, or from a table whose ends are known.

use melange_solver::fjord::Fjord;
use melange_solver::interpolate::{Axis, Beyond, Monotone};

fn table(width_m: &[f64], beyond: Beyond) -> Fjord {
    let x_m = (0..width_m.len()).map(|i| 5e3 * i as f64).collect();
    let widths = Monotone::new(x_m, width_m.to_vec()).expect("a table");
    Fjord::table(widths, beyond).expect("positive widths")
}

#[test]
fn straight_walls_are_known_everywhere_and_may_meet() {
    let fjord = Fjord::straight(4000.0, -0.1);
    assert_eq!((fjord.width(1e4), fjord.slope(1e4)), (3000.0, -0.1));
    assert_eq!(fjord.closes_at_m(), 4e4);
    assert_eq!(fjord.width(fjord.closes_at_m()), 0.0);
    assert_eq!(fjord.reach(), None);
    assert!(!fjord.is_constant());
    for gradient in [0.0, 0.1] {
        let fjord = Fjord::straight(4000.0, gradient);
        assert_eq!(fjord.closes_at_m(), f64::INFINITY);
        assert_eq!(fjord.is_constant(), gradient == 0.0);
    }
}

#[test]
fn a_table_holds_its_ends_and_says_how_far_it_is_known() {
    for (beyond, reach) in [(Beyond::Refused, Some((0.0, 1e4))), (Beyond::Constant, None)] {
        let fjord = table(&[4000.0, 4600.0, 6000.0], beyond);
        assert_eq!(fjord.reach(), reach);
        assert_eq!(
            [-1.0, 0.0, 5e3, 1e4, 2e4].map(|x| fjord.width(x)),
            [4000.0, 4000.0, 4600.0, 6000.0, 6000.0]
        );
        assert_eq!([-1.0, 1.1e4].map(|x| fjord.slope(x)), [0.0; 2]);
        assert_eq!(fjord.closes_at_m(), f64::INFINITY);
        let difference = (fjord.width(3001.0) - fjord.width(2999.0)) / 2.0;
        assert!((fjord.slope(3000.0) - difference).abs() < 1e-6);
    }
}

#[test]
fn a_table_on_a_straight_wall_is_that_wall() {
    let (straight, table) =
        (Fjord::straight(4000.0, 0.1), table(&[4000.0, 4500.0, 5000.0], Beyond::Refused));
    for x in [0.0, 1234.5, 5e3, 9.9e3] {
        assert!((straight.width(x) - table.width(x)).abs() < 1e-9);
        assert!((straight.slope(x) - table.slope(x)).abs() < 1e-12);
    }
}

#[test]
fn equal_widths_are_constant() {
    assert!(table(&[4000.0; 3], Beyond::Refused).is_constant());
    assert!(!table(&[4000.0, 4000.0, 4000.1], Beyond::Refused).is_constant());
}

#[test]
fn widths_that_are_not_positive_are_refused() {
    for width_m in [0.0, -1.0] {
        let widths = Monotone::new(vec![0.0, 1.0], vec![1.0, width_m]).expect("a table");
        let error = Fjord::table(widths, Beyond::Constant).expect_err("no room");
        assert_eq!(error.place(), (Axis::Y, Some(1), Some(width_m)));
        assert_eq!(error.to_string(), format!("y[1] = {width_m}: widths above 0 m"));
    }
}
