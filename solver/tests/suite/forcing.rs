//! Courses in time: values, extremes, kinks, and what no course may do to a parameter.

use melange_solver::forcing::{Course, Forcing, ForcingError};
use melange_solver::interpolate::Linear;
use melange_solver::params::Parameters;
use proptest::prelude::*;

const SEASON: Course =
    Course::Pulse { base: 0.2, peak: 1.4, period_a: 1.0, width_a: 0.4, phase_a: 0.3 };

fn ramp(from: f64, to: f64) -> Course {
    Course::Ramp { from, to, start_a: 1.0, end_a: 3.0 }
}

fn table(time_a: &[f64], value: &[f64]) -> Course {
    Course::Table(Linear::new(time_a.to_vec(), value.to_vec()).expect("a table"))
}

fn forcing<const N: usize>(courses: [(&str, Course); N]) -> Result<Forcing, ForcingError> {
    Forcing::new(courses.map(|(name, course)| (name.to_owned(), course)).to_vec())
}

fn courses() -> impl Strategy<Value = Course> {
    let (value, time) = (0.0..10.0_f64, -3.0..3.0_f64);
    let points = prop::collection::vec((0.01..2.0_f64, value.clone()), 2..8);
    prop_oneof![
        (value.clone(), -5.0..5.0_f64, 0.1..4.0_f64, time.clone()).prop_map(
            |(mean, amplitude, period_a, phase_a)| {
                Course::Sinusoid { mean, amplitude, period_a, phase_a }
            }
        ),
        (value.clone(), value.clone(), time.clone(), 0.01..4.0_f64).prop_map(
            |(from, to, start_a, lasts)| Course::Ramp { from, to, start_a, end_a: start_a + lasts }
        ),
        (value.clone(), value, 0.1..4.0_f64, prop_oneof![Just(1.0), 0.05..1.0_f64], time.clone())
            .prop_map(|(base, peak, period_a, share, phase_a)| {
                Course::Pulse { base, peak, period_a, width_a: share * period_a, phase_a }
            }),
        (points, time).prop_map(|(points, mut t)| {
            let (time_a, value) = points
                .into_iter()
                .map(|(step, value)| {
                    t += step;
                    (t, value)
                })
                .unzip();
            Course::Table(Linear::new(time_a, value).expect("a table"))
        }),
    ]
}

/// Breaks in (a, b], as a solver that steps to each of them meets them.
fn breaks(course: &Course, a: f64, b: f64) -> Vec<f64> {
    std::iter::successors(course.next_break_after(a), |t| course.next_break_after(*t))
        .take_while(|t| *t <= b)
        .collect()
}

#[test]
fn courses_have_the_documented_values() {
    let sine = Course::Sinusoid { mean: 0.7, amplitude: 0.2, period_a: 2.0, phase_a: 0.25 };
    let half = 0.5_f64.sqrt();
    for (course, t, expected) in [
        (&sine, 0.25, 0.7),
        (&sine, 0.75, 0.9),
        (&sine, -0.25, 0.5),
        (&sine, 0.5, 0.7 + 0.2 * half),
        (&ramp(0.4, 0.8), 0.0, 0.4),
        (&ramp(0.4, 0.8), 1.5, 0.5),
        (&ramp(0.4, 0.8), 7.0, 0.8),
        (&SEASON, 0.2, 0.2),
        (&SEASON, 0.5, 1.4),
        (&SEASON, 0.4, 0.2 + 1.2 * half),
        (&SEASON, -3.4, 0.2 + 1.2 * half),
        (&SEASON, 0.8, 0.2),
        (&table(&[0.0, 1.0, 3.0], &[1.0, 2.0, 0.0]), 2.5, 0.5),
        (&table(&[0.0, 1.0, 3.0], &[1.0, 2.0, 0.0]), -1.0, 1.0),
        (&table(&[0.0, 1.0, 3.0], &[1.0, 2.0, 0.0]), 9.0, 0.0),
    ] {
        let got = course.value(t);
        assert!((got - expected).abs() < 1e-14, "{course:?} at {t}: {got} is not {expected}");
    }
}

proptest! {
    #[test]
    fn extremes_bound_every_value_and_are_reached(course in courses()) {
        course.check().expect("permitted");
        let (min, max) = course.extremes();
        let samples = (0..40_000).map(|i| course.value(-20.0 + 1e-3 * f64::from(i)));
        let (lowest, highest) = samples
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        prop_assert!(lowest >= min && highest <= max);
        // The shortest pulse, 0.005, has its top half a sample away, where the sine is 0.95.
        let coarse = 0.06 * (max - min) + 1e-12;
        prop_assert!(lowest - min <= coarse && max - highest <= coarse, "{lowest} {highest}");
    }

    #[test]
    fn the_breaks_are_the_kinks_and_none_is_met_twice(course in courses(), start in -5.0..5.0_f64) {
        let breaks = breaks(&course, start, start + 6.0);
        for pair in breaks.windows(2) {
            prop_assert!(pair[1] > pair[0] + 1e-10, "{pair:?}");
        }
        // Between breaks the second difference goes with the square of the step: no kink.
        let edges: Vec<f64> =
            [start].into_iter().chain(breaks.iter().copied()).chain([start + 6.0]).collect();
        for pair in edges.windows(2) {
            let step = 0.05 * (pair[1] - pair[0]);
            for i in 1..20 {
                let t = pair[0] + step * f64::from(i);
                let kink = course.value(t + step) - 2.0 * course.value(t) + course.value(t - step);
                let fastest = match course {
                    Course::Sinusoid { period_a, .. } => std::f64::consts::TAU / period_a,
                    Course::Pulse { width_a, .. } => std::f64::consts::PI / width_a,
                    _ => 0.0,
                };
                prop_assert!(kink.abs() <= 10.0 * (fastest * step).powi(2) + 1e-9, "{kink} at {t}");
            }
        }
    }
}

#[test]
fn breaks_come_in_order_and_not_again() {
    assert_eq!(breaks(&ramp(0.0, 1.0), 0.0, 9.0), [1.0, 3.0]);
    assert_eq!(breaks(&table(&[0.0, 1.0, 3.0], &[0.0; 3]), -1.0, 9.0), [0.0, 1.0, 3.0]);
    assert_eq!(SEASON.next_break_after(0.0), Some(0.3));
    let close = |got: &[f64], expected: &[f64]| {
        assert_eq!(got.len(), expected.len(), "{got:?}");
        assert!(got.iter().zip(expected).all(|(g, e)| (g - e).abs() < 1e-12), "{got:?}");
    };
    close(&breaks(&SEASON, -0.5, 2.0), &[-0.3, 0.3, 0.7, 1.3, 1.7]);
    let cusps = Course::Pulse { base: 0.0, peak: 1.0, period_a: 0.1, width_a: 0.1, phase_a: 0.0 };
    close(&breaks(&cusps, 0.0, 0.45), &[0.1, 0.2, 0.3, 0.4]);
    assert_eq!(breaks(&cusps, 1000.0, 1010.05).len(), 100);
    let sine = Course::Sinusoid { mean: 0.0, amplitude: 1.0, period_a: 1.0, phase_a: 0.0 };
    assert_eq!(sine.next_break_after(0.0), None);
    // Equal up to rounding.
    assert_eq!(ramp(0.0, 1.0).next_break_after(1.0 - 1e-13), Some(3.0));
    assert_eq!(ramp(0.0, 1.0).next_break_after(1.0 - 1e-11), Some(1.0));
}

#[test]
fn a_forcing_sets_what_it_names_and_nothing_else() {
    let base = Parameters { mu_s: 0.2, ..Parameters::default() };
    let forcing =
        forcing([("melt_rate_m_per_day", SEASON), ("d_m", ramp(20.0, 30.0))]).expect("permitted");
    forcing.check_against(&base).expect("permitted");
    let expected = Parameters { melt_rate_m_per_day: 1.4, d_m: 27.5, ..base };
    let got = forcing.at(&base, 2.5);
    assert!((got.melt_rate_m_per_day - 1.4).abs() < 1e-14);
    assert_eq!(got, Parameters { melt_rate_m_per_day: got.melt_rate_m_per_day, ..expected });
    assert!(forcing.names().eq(["melt_rate_m_per_day", "d_m"]));
    assert!(!forcing.is_empty());
    assert_eq!(forcing.course("d_m"), Some(&ramp(20.0, 30.0)));
    assert_eq!(forcing.next_break_after(0.75), Some(1.0));
    assert_eq!(forcing.next_break_after(1.0), Some(1.3));
    let none = Forcing::default();
    assert_eq!((none.at(&base, 1.0), none.next_break_after(0.0)), (base, None));
    assert!(none.is_empty());
}

/// A course may run along the edge of the range: rounding does not take it past it.
#[test]
fn extremes_on_the_edge_of_the_range_are_permitted_at_all_times() {
    let wave = Course::Sinusoid { mean: 50.0, amplitude: -50.0, period_a: 0.7, phase_a: 0.1 };
    let pulse = Course::Pulse { base: 0.001, peak: 1e3, period_a: 0.7, width_a: 0.7, phase_a: 0.1 };
    let forcing = forcing([("melt_rate_m_per_day", wave), ("A", pulse)]).expect("permitted");
    for i in 0..100_000 {
        let p = forcing.at(&Parameters::default(), 1e-3 * f64::from(i));
        p.check().expect("in range");
    }
}

#[test]
fn courses_that_are_none_are_refused_with_the_field() {
    let nan = f64::NAN;
    for (course, field, permitted) in [
        (
            Course::Sinusoid { mean: nan, amplitude: 0.1, period_a: 1.0, phase_a: 0.0 },
            "sinusoid.mean",
            "a finite number",
        ),
        (
            Course::Sinusoid { mean: 0.5, amplitude: 0.1, period_a: 0.0, phase_a: 0.0 },
            "sinusoid.period_a",
            "above 0 a",
        ),
        (
            Course::Ramp { from: 0.1, to: 0.2, start_a: 2.0, end_a: 2.0 },
            "ramp.end_a",
            "after the start, 2 a",
        ),
        (
            Course::Ramp { from: 0.1, to: f64::INFINITY, start_a: 2.0, end_a: 3.0 },
            "ramp.to",
            "a finite number",
        ),
        (
            Course::Pulse { base: 0.1, peak: 0.2, period_a: 1.0, width_a: 1.1, phase_a: 0.0 },
            "pulse.width_a",
            "above 0 a and up to the period, 1 a",
        ),
        (
            Course::Pulse { base: 0.1, peak: 0.2, period_a: 1.0, width_a: 0.0, phase_a: 0.0 },
            "pulse.width_a",
            "above 0 a and up to the period, 1 a",
        ),
        (
            Course::Pulse { base: 0.1, peak: 0.2, period_a: -1.0, width_a: 0.1, phase_a: 0.0 },
            "pulse.period_a",
            "above 0 a",
        ),
        (
            Course::Pulse { base: 0.1, peak: 0.2, period_a: 1.0, width_a: 0.1, phase_a: nan },
            "pulse.phase_a",
            "a finite number",
        ),
    ] {
        let error = course.check().expect_err("no course");
        assert_eq!((error.field.as_str(), error.permitted.as_str()), (field, permitted));
        let error = forcing([("melt_rate_m_per_day", course)]).expect_err("no course");
        assert_eq!(error.field(), format!("forcing.melt_rate_m_per_day.{field}"));
        assert_eq!(error.permitted(), permitted);
        let text = error.to_string();
        assert!(text.starts_with(&format!("`{}` = ", error.field())), "{text}");
        assert!(text.ends_with(permitted) && error.value().is_some(), "{text}");
    }
}

#[test]
fn a_forcing_of_what_does_not_vary_is_refused() {
    let fixed = ["width_m", "width_gradient", "n_cells"];
    for name in fixed {
        let error = forcing([(name, ramp(20.0, 30.0))]).expect_err("fixed");
        assert_eq!((error.field(), error.value()), (format!("forcing.{name}"), None));
        assert!(error.to_string().contains("cannot vary in time"), "{error}");
        assert!(error.permitted().contains("melt_rate_m_per_day"));
        assert!(!error.permitted().contains(name), "{error}");
    }
    let error = forcing([("melt", ramp(0.1, 0.2))]).expect_err("unknown");
    assert_eq!(error, ForcingError::Unknown { name: "melt".into() });
    assert!(error.to_string().contains("`forcing.melt`"), "{error}");
    let error = forcing([("b", ramp(1e3, 2e3)), ("b", ramp(1e3, 2e3))]).expect_err("twice");
    assert_eq!(error, ForcingError::Twice { name: "b" });
    assert!(error.to_string().contains("`forcing.b` is given twice"), "{error}");
}

#[test]
fn a_course_that_leaves_the_range_is_refused_with_the_extreme() {
    let sine = Course::Sinusoid { mean: 0.5, amplitude: 0.75, period_a: 1.0, phase_a: 0.0 };
    for (course, value) in [(sine, -0.25), (ramp(0.5, 101.0), 101.0)] {
        let error = forcing([("melt_rate_m_per_day", course)]).expect_err("out of range");
        assert_eq!(error, ForcingError::OutOfRange { name: "melt_rate_m_per_day", value });
        assert_eq!(error.permitted(), "a finite number from 0 to 100 m d-1");
        assert_eq!(
            error.to_string(),
            format!(
                "`forcing.melt_rate_m_per_day` gets to {value}, which is out of range: {}",
                error.permitted()
            )
        );
    }
}

#[test]
fn icebergs_must_stay_smaller_than_the_terminus_is_thick() {
    let base = Parameters { d_m: 100.0, terminus_thickness_m: 300.0, ..Parameters::default() };
    let check = |forcing: Result<Forcing, _>| forcing.expect("permitted").check_against(&base);
    let thinning = || ("terminus_thickness_m", ramp(300.0, 90.0));
    let growing = || ("d_m", ramp(50.0, 300.0));
    assert_eq!(check(forcing([])), Ok(()));
    assert_eq!(check(forcing([("d_m", ramp(50.0, 299.0))])), Ok(()));
    assert_eq!(check(forcing([("d_m", ramp(50.0, 80.0)), thinning()])), Ok(()));
    for (given, field, value, other) in [
        (forcing([growing()]), "forcing.d_m", 300.0, "gets down to 300"),
        (forcing([thinning()]), "forcing.terminus_thickness_m", 90.0, "d_m = 100"),
        (forcing([growing(), thinning()]), "forcing.d_m", 300.0, "gets down to 90"),
    ] {
        let error = check(given).expect_err("as thick");
        assert_eq!((error.field().as_str(), error.value()), (field, Some(value)));
        assert!(error.permitted().contains(other) && error.to_string().contains(other), "{error}");
    }
}
