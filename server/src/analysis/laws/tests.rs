//! Laws of groups against exact laws, against the fit of the same runs alone, and counted through.

use super::*;
use crate::analysis::law::fit;
use proptest::prelude::*;

/// Runs with columns of their own, to make tables of.
#[derive(Debug, Default, Clone)]
struct Runs {
    index: Vec<i64>,
    status: Vec<&'static str>,
    x: Vec<Option<f64>>,
    y: Vec<Option<f64>>,
    group: Vec<Option<f64>>,
    other: Vec<Option<f64>>,
    ids: Vec<String>,
}

impl Runs {
    fn push(
        &mut self,
        status: &'static str,
        x: f64,
        y: Option<f64>,
        group: Option<f64>,
        other: f64,
    ) {
        let index = self.index.len() as i64;
        self.index.push(index);
        self.status.push(status);
        self.x.push(Some(x));
        self.y.push(y);
        self.group.push(group);
        self.other.push(Some(other));
        // Far from the order of the runs.
        self.ids.push(format!("{:04}", index * 7919 % 10_007));
    }

    fn laws(&self, law: Law, is_grouped: bool, most: usize) -> Laws {
        let others = [("b", self.other.as_slice())];
        let table = Table {
            run_index: &self.index,
            status: &self.status,
            x: &self.x,
            y: &self.y,
            group_by: is_grouped.then_some(&self.group),
            others: &others,
            ids: Some(&self.ids),
        };
        laws(law, &table, most)
    }
}

/// F = 2 W · x^(−W/1000) for three widths; of one of them another parameter varies too, and some runs have no F.
fn three_widths() -> Runs {
    let mut runs = Runs::default();
    for i in 0..20 {
        for width in [4000.0, 2000.0, 3000.0] {
            let x = 1.0 + f64::from(i);
            let y = 2.0 * width * x.powf(-width / 1000.0);
            let other = if width == 3000.0 { f64::from(i % 2) } else { 7.0 };
            match (i, width) {
                (5, 2000.0) => runs.push("overthick", x, None, Some(width), other),
                (6, 2000.0) => runs.push("converged", x, None, Some(width), other),
                _ => runs.push("converged", x, Some(y), Some(width), other),
            }
        }
    }
    runs
}

#[test]
fn each_group_has_its_exact_law() {
    let found = three_widths().laws(Law::Power, true, 1000);
    assert_eq!((found.grouping, found.shown, found.total), ("each value", 58, 60));
    for (group, width) in found.groups.iter().zip([2000.0, 3000.0, 4000.0]) {
        assert_eq!((group.from, group.to, group.n_runs), (Some(width), Some(width), 20));
        let fit = group.fit.as_ref().expect("it fits");
        assert!((fit.exponent.estimate + width / 1000.0).abs() < 1e-12);
        assert!((fit.prefactor.estimate / (2.0 * width) - 1.0).abs() < 1e-12);
        assert_eq!(fit.left_out, group.left_out);
        let points = &group.points;
        assert_eq!(points.x.len(), fit.n_used);
        assert!(points.residual.iter().all(|r| r.abs() < 1e-12));
        assert!(points.fitted.iter().zip(&points.y).all(|(f, y)| (f / y - 1.0).abs() < 1e-12));
        let exponent = &group.local_exponent.exponent;
        assert!(exponent.iter().all(|n| (n + width / 1000.0).abs() < 1e-10));
        // Of one group neighbours differ in b.
        let why = group.no_local_exponent.as_deref();
        match width {
            3000.0 => {
                assert!(exponent.is_empty() && why.is_some_and(|why| why.contains("agree in b,")))
            }
            _ => assert_eq!((exponent.len(), why), (fit.n_used - 1, None)),
        }
    }
    let also: Vec<_> = found.groups.iter().map(|g| g.also_varies.join(",")).collect();
    assert_eq!(also, ["", "b", ""]);
    let left_out: Vec<_> =
        found.groups[0].left_out.iter().map(|l| (l.reason.as_str(), l.count)).collect();
    assert_eq!(left_out, [("overthick", 1), ("x or y does not exist", 1)]);
}

/// A grid of melt and width where wide mélanges have no result at high melt and narrow ones none at low melt.
#[test]
fn a_grid_with_holes_has_the_slopes_of_its_sets() {
    let mut runs = Runs::default();
    for i in 0..9 {
        for (width, exponent, has) in [(3.0, -3.4, 0..5), (4.0, -3.5, 2..7), (5.0, -3.6, 4..9)] {
            let x = 0.4 + 0.1 * f64::from(i);
            let y = f64::powf(10.0, 2.0 * width) * x.powf(exponent);
            runs.push("converged", x, has.contains(&i).then_some(y), None, width);
        }
    }
    let group = &runs.laws(Law::Power, false, 100).groups[0];
    assert_eq!(
        (group.also_varies.as_slice(), &group.no_local_exponent),
        (&["b".to_owned()][..], &None)
    );
    let fit = group.fit.as_ref().expect("it fits");
    assert!(fit.exponent.estimate > 0.0, "the lumped law goes the wrong way");
    assert_eq!(group.local_exponent.exponent.len(), 8);
    let is_one = |n: &f64| (-3.6 - 1e-9..-3.4 + 1e-9).contains(n);
    assert!(group.local_exponent.exponent.iter().all(is_one), "{:?}", group.local_exponent);
}

#[test]
fn bins_lump_what_they_are_of_and_x_by_another_name_does_not_tell_runs_apart() {
    let mut runs = Runs::default();
    for i in 0..40 {
        let x = 1.0 + f64::from(i % 2);
        runs.push("converged", x, Some(x * x), Some(f64::from(i / 2)), x);
    }
    let grouped = |others: &[(&str, &[Option<f64>])]| {
        let table = Table {
            run_index: &runs.index,
            status: &runs.status,
            x: &runs.x,
            y: &runs.y,
            group_by: Some(&runs.group),
            others,
            ids: None,
        };
        laws(Law::Power, &table, 100)
    };
    let found = grouped(&[("twin_of_x", &runs.other), ("width_m", &runs.group)]);
    assert_eq!((found.grouping, found.groups.len()), ("bins of about equally many runs", 6));
    for group in &found.groups {
        assert_eq!(group.also_varies, ["twin_of_x", "width_m"]);
        let [slope] = group.local_exponent.exponent[..] else { panic!("{group:?}") };
        assert!((slope - 2.0).abs() < 1e-12);
    }
    // Values that differ by rounding vary no more than x that does.
    let mut alike = Runs::default();
    for i in 0..6 {
        let flux = [9010.0, 9009.999999999998][i % 2];
        alike.push("converged", flux, Some(1.0 + i as f64), None, flux);
    }
    let group = &alike.laws(Law::Linear, false, 100).groups[0];
    assert!(group.also_varies.is_empty(), "{:?}", group.also_varies);
    assert!(group.no_fit.as_ref().is_some_and(|why| why.contains("same x")));
    assert!(group.no_local_exponent.as_ref().is_some_and(|why| why.contains("different x")));
}

#[test]
fn residuals_add_up_to_nothing_and_to_what_the_fit_leaves_unexplained() {
    let mut runs = Runs::default();
    for i in 0..50 {
        let x = f64::from(i) * 0.1;
        runs.push("completed", x, Some(3.0 - 2.0 * x + (1.3 * x).sin()), None, 1.0);
    }
    let found = runs.laws(Law::Linear, false, 1000);
    assert_eq!((found.grouping, found.groups.len()), ("one group", 1));
    let group = &found.groups[0];
    assert_eq!((group.from, group.to), (None, None));
    let residual = &group.points.residual;
    assert!(residual.iter().sum::<f64>().abs() < 1e-12);
    let mean = group.points.y.iter().sum::<f64>() / 50.0;
    let all: f64 = group.points.y.iter().map(|y| (y - mean).powi(2)).sum();
    let unexplained = residual.iter().map(|r| r * r).sum::<f64>() / all;
    let fit = group.fit.as_ref().expect("it fits");
    assert!((1.0 - unexplained - fit.r_squared).abs() < 1e-12);
    for ((x, y), r) in group.points.x.iter().zip(&group.points.y).zip(residual) {
        let law = fit.prefactor.estimate + fit.exponent.estimate * x;
        assert!((y - law - r).abs() < 1e-12);
    }
}

#[test]
fn few_points_are_those_of_least_id_and_fits_use_all() {
    let runs = three_widths();
    let all = runs.laws(Law::Power, true, 58);
    let few = runs.laws(Law::Power, true, 10);
    assert_eq!((all.shown, few.shown, few.total), (58, 10, 60));
    for (a, f) in all.groups.iter().zip(&few.groups) {
        assert_eq!((&a.fit, &a.local_exponent), (&f.fit, &f.local_exponent));
        assert!(f.points.run_index.is_sorted());
        // What is told of a run does not depend on how many are.
        for (i, index) in f.points.run_index.iter().enumerate() {
            let at = a.points.run_index.iter().position(|j| j == index).expect("it is used");
            assert_eq!(a.points.residual[at], f.points.residual[i]);
            assert_eq!(a.points.y[at], f.points.y[i]);
        }
    }
    let ids_of = |laws: &Laws| {
        let indices = laws.groups.iter().flat_map(|g| g.points.run_index.clone());
        let mut ids: Vec<_> = indices.map(|i| runs.ids[i as usize].clone()).collect();
        ids.sort();
        ids
    };
    assert_eq!(ids_of(&few), ids_of(&all)[..10]);
}

#[test]
fn a_group_without_law_says_why_and_keeps_its_runs() {
    let mut runs = Runs::default();
    for i in 0..4 {
        runs.push("converged", 2.0, Some(1.0 + f64::from(i)), Some(1.0), 0.0);
        runs.push("no_steady_state", f64::from(i), None, None, 0.0);
    }
    runs.push("converged", 1.0, Some(-1.0), Some(2.0), 0.0);
    let found = runs.laws(Law::Power, true, 100);
    let [same_x, too_few, without] = &found.groups[..] else { panic!("{found:?}") };
    assert_eq!((same_x.fit.as_ref(), same_x.points.x.len()), (None, 4));
    assert!(same_x.no_fit.as_ref().is_some_and(|why| why.contains("same x")));
    assert!(same_x.points.fitted.is_empty() && same_x.points.residual.is_empty());
    assert_eq!(too_few.left_out[0].reason, "y is not positive");
    assert_eq!((without.from, without.n_runs, without.left_out[0].count), (None, 4, 4));
    let empty = Runs::default();
    assert_eq!(empty.laws(Law::Power, true, 100).groups, []);
    assert_eq!(empty.laws(Law::Power, false, 100).groups[0].n_runs, 0);
}

fn a_run() -> impl Strategy<Value = (&'static str, f64, Option<f64>, Option<f64>)> {
    let status = prop::sample::select(vec!["converged", "completed", "failed", "collapsed"]);
    let x = (-3..30_i32).prop_map(f64::from);
    let y = prop::option::weighted(0.9, -1.0..50.0_f64);
    let group = prop::option::weighted(0.9, (0..25_i32).prop_map(f64::from));
    (status, x, y, group)
}

proptest! {
    #[test]
    fn no_run_is_lost_or_counted_twice(
        runs in prop::collection::vec(a_run(), 0..150),
        law in prop::sample::select(vec![Law::Power, Law::Exponential, Law::Linear]),
        most in 1_usize..60,
    ) {
        let mut table = Runs::default();
        for (status, x, y, group) in &runs {
            table.push(status, *x, *y, *group, 0.0);
        }
        let found = table.laws(law, true, most);
        prop_assert_eq!(found.total, runs.len());
        let mut used_in_all = 0;
        for group in &found.groups {
            let left: usize = group.left_out.iter().map(|l| l.count).sum();
            let used = group.n_runs - left;
            used_in_all += used;
            prop_assert_eq!(group.fit.is_some(), group.no_fit.is_none());
            if let Some(fit) = &group.fit {
                prop_assert_eq!(fit.n_used, used);
            }
            // The same runs alone have the same law, bit by bit.
            let is_member = |value: Option<f64>| match (group.from, group.to, value) {
                (Some(from), Some(to), Some(value)) => from <= value && value <= to,
                (None, None, None) => true,
                _ => false,
            };
            let alone: Vec<_> = runs.iter().filter(|r| is_member(r.3)).map(|r| (r.0, Some(r.1), r.2)).collect();
            prop_assert_eq!(alone.len(), group.n_runs);
            match fit(law, &alone) {
                Ok(alone) => prop_assert_eq!(Some(&alone), group.fit.as_ref()),
                Err(e) => prop_assert_eq!(Some(&e.to_string()), group.no_fit.as_ref()),
            }
        }
        prop_assert_eq!(found.shown, used_in_all.min(most));
        let mut seen: Vec<i64> = found.groups.iter().flat_map(|g| g.points.run_index.clone()).collect();
        seen.sort_unstable();
        seen.dedup();
        prop_assert_eq!(seen.len(), found.shown);
    }
}
