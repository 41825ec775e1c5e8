//! Sweeps as documents: their points, what is refused, how they are cut and walked through.

use super::*;
use crate::domain::table::TableForm;
use proptest::prelude::*;
use serde_json::{Value, json};

fn sweep(document: &Value) -> SweepSpec {
    read(document).unwrap_or_else(|refusal| panic!("{document}: {refusal}"))
}

fn read(document: &Value) -> Result<SweepSpec, Refusal> {
    Document::parse(&document.to_string())?.into_sweep(&Limits::default())
}

/// A steady sweep with more members.
fn steady(members: Value) -> Value {
    let mut document = json!({"regime": "steady"});
    let all = document.as_object_mut().expect("members");
    all.extend(members.as_object().expect("members").clone());
    document
}

fn table(columns: &Value, rows: &Value) -> Value {
    steady(json!({"table": {"columns": columns, "rows": rows}}))
}

#[test]
fn a_zip_moves_its_axes_together() {
    let zip = json!([
        {"parameter": "terminus_thickness_m", "values": [400, 600, 600]},
        {"parameter": "width_m", "linspace": [3000, 5000, 3]},
        {"option": "upstream_closure", "values": ["published", "published", "no_stretching"]},
    ]);
    let axes = json!([{"zip": zip}, {"parameter": "melt_rate_m_per_day", "values": [0.7, 0.5]}]);
    let sweep = sweep(&steady(json!({"axes": axes})));
    assert_eq!(sweep.count(), 6);
    let point = |index: usize| {
        let run = sweep.run(index);
        let p = *run.parameters();
        (p.terminus_thickness_m, p.width_m, run.model.closure().name(), p.melt_rate_m_per_day)
    };
    assert_eq!(point(0), (400.0, 3000.0, "published", 0.7));
    assert_eq!(point(3), (600.0, 4000.0, "published", 0.5));
    assert_eq!(point(4), (600.0, 5000.0, "no_stretching", 0.7));
}

#[test]
fn a_table_has_a_run_for_each_row() {
    let columns = json!(["upstream_closure", "calving_flux_m2_per_a", "b"]);
    let rows =
        json!([["no_stretching", 3e6, 1e4], ["published", 3.6e6, 2e4], ["published", 3.6e6, 2e4]]);
    let document = table(&columns, &rows);
    let sweep = sweep(&document);
    assert_eq!(sweep.count(), 3);
    let run = sweep.run(0);
    assert_eq!(run.model.closure().name(), "no_stretching");
    assert_eq!((run.parameters().calving_rate_m_per_a, run.parameters().b), (5000.0, 1e4));
    assert_eq!(sweep.run(1).id(), sweep.run(2).id(), "a row may come again");
    // As it is stored, and with the members in another order.
    let written = serde_json::to_value(sweep.document()).expect("plain data");
    assert_eq!(written["table"]["columns"], columns);
    assert_eq!(written["table"]["rows"][1], json!(["published", 3.6e6, 2e4]));
    let turned =
        format!(r#"{{"regime": "steady", "table": {{"rows": {rows}, "columns": {columns}}}}}"#);
    assert_eq!(Document::parse(&turned).as_ref(), Ok(sweep.document()));
    let toml = "regime = \"steady\"\n[table]\ncolumns = [\"b\"]\nrows = [[1e4], [2]]";
    let from_toml = Document::parse(toml).expect("TOML");
    let csv = TableForm::from_csv("\u{feff}b\n1e4\n 2 \n".as_bytes()).expect("CSV");
    assert_eq!(from_toml.table, Some(csv));
}

#[test]
fn bad_points_are_refused_with_field_value_and_what_is_permitted() {
    let melt = json!({"parameter": "melt_rate_m_per_day", "values": [0.5, 0.6]});
    let zip = |members: Value| steady(json!({"axes": [{"zip": members}]}));
    let sample = json!({"method": "sobol", "n": 8, "ranges": {"b": [1e4, 1e5]}});
    for (document, field, words) in [
        (
            zip(json!([melt, {"parameter": "b", "values": [1e4]}])),
            "axes[0].zip[1]",
            "zip[0] has, 2",
        ),
        (zip(json!([melt, melt])), "axes[0].zip[1]", "each name"),
        (zip(json!([{"zip": [melt]}])), "axes[0].zip[0].zip", "one parameter"),
        (zip(json!([])), "axes[0].zip", "at least one"),
        (zip(json!([["b", null, null, null, [1], null]])), "axes[0].zip[0]", "by name"),
        (steady(json!({"axes": [melt, {"zip": [melt]}]})), "axes[1].zip[0]", "each name"),
        (steady(json!({"axes": [{"zip": [melt], "values": [1]}]})), "axes[0]", "a zip"),
        (steady(json!({"axes": [melt], "sample": sample})), "sample", "`axes` is given too"),
        (table(&json!(["b"]), &json!([[1e4, 1.0]])), "table.rows[0]", "1 cells in row 1"),
        (
            table(&json!(["b", "d_m"]), &json!([[1e4, 25], [1e4]])),
            "table.rows[1]",
            "2 cells in row 2",
        ),
        (table(&json!(["b"]), &json!([[1e4], [null]])), "table.rows[1][0]", "in row 2, column `b`"),
        (table(&json!(["b"]), &json!([["x"]])), "table.rows[0][0]", "a finite number in row 1"),
        (
            table(&json!(["upstream_closure"]), &json!([[1]])),
            "table.rows[0][0]",
            "no_stretching in row 1",
        ),
        (table(&json!(["upstream_closure"]), &json!([["x"]])), "table.rows[0][0]", "no_stretching"),
        (table(&json!(["b"]), &json!([1e4])), "table.rows[0]", "1 cells in row 1"),
        (table(&json!(["c"]), &json!([[1e4]])), "table.columns[0]", "melt_rate_m_per_day"),
        (table(&json!(["b", "b"]), &json!([[1e4, 1e4]])), "table.columns[1]", "each column once"),
        (table(&json!(["b"]), &json!([])), "table.rows", "at least one row"),
        (table(&json!([]), &json!([])), "table.columns", "at least one name"),
        (table(&json!(["b"]), &json!([[1e4], [-1]])), "parameters.b", "(row 2 of the table)"),
        (steady(json!({"table": [["b"], [[1e4]]]})), "table", ""),
        (steady(json!({"table": {"columns": ["b"]}})), "table", "rows"),
        (steady(json!({"sample": ["sobol", 8, 1, {"b": [1, 2]}]})), "sample", "by name"),
        (
            steady(json!({"sample": {"method": "sobol", "n": 8, "ranges": {"b": [1]}}})),
            "sample.ranges.b",
            "largest",
        ),
        (
            steady(json!({"sample": {"method": "sobol", "n": 8, "ranges": {"b": {"ln": [1, 2]}}}})),
            "sample.ranges.b",
            "log",
        ),
        (
            steady(json!({"sample": {"method": "halton", "n": 8, "ranges": {}}})),
            "sample.method",
            "latin_hypercube",
        ),
        (steady(json!({"sample": {"method": "sobol", "n": 8.5, "ranges": {}}})), "sample.n", ""),
        (
            steady(json!({"sample": sample, "parameters": {"b": 1e4}})),
            "parameters.b",
            "more than once",
        ),
        (
            steady(json!({"table": {"columns": ["calving_flux_m2_per_a"], "rows": [[3e6]]},
                          "parameters": {"calving_rate_m_per_a": 5000}})),
            "parameters.calving_flux_m2_per_a",
            "not together",
        ),
        (steady(json!({"tags": ["a", "a"]})), "tags[1]", "each tag once"),
        (steady(json!({"tags": ["a b"]})), "tags[0]", "letters"),
        (steady(json!({"tags": [""]})), "tags[0]", "1 to 50"),
        (steady(json!({"tags": vec!["x"; 21]})), "tags", "at most 20"),
        (steady(json!({"priority": 101})), "priority", "-100 to 100"),
        (steady(json!({"priority": 1.5})), "priority", "whole number"),
        (steady(json!({"force": 1})), "force", "boolean"),
    ] {
        let refusal = read(&document).expect_err("it is refused");
        assert_eq!(refusal.field.as_deref(), Some(field), "{document}: {refusal}");
        let told = format!("{refusal} {}", refusal.permitted.clone().unwrap_or_default());
        assert!(told.contains(words), "{document}: {told}");
    }
    let doubled = r#"{"regime": "steady", "table": {"columns": [], "columns": []}}"#;
    assert_eq!(Document::parse(doubled).expect_err("doubled").field.as_deref(), Some("table"));
}

#[test]
fn csv_that_is_no_table_is_refused() {
    for (csv, field, words) in [
        ("b,d_m\n1e4,25\n1e4\n", "table.rows[1]", "2 cells in row 2"),
        ("b\n1e4,3\n", "table.rows[0]", "1 cells in row 1"),
        ("b,d_m\n1e4,\n", "table.rows[0][1]", "a finite number in row 1, column `d_m`"),
        ("b\nNaN\n", "table.rows[0][0]", "a finite number"),
        ("upstream_closure\npublish\n", "table.rows[0][0]", "no_stretching in row 1"),
    ] {
        let refusal = TableForm::from_csv(csv.as_bytes()).expect_err(csv);
        assert_eq!(refusal.field.as_deref(), Some(field), "{refusal}");
        assert!(refusal.permitted.expect("what is permitted").contains(words), "{csv}");
    }
    let refusal = TableForm::from_csv(b"b\n\xff\n").expect_err("not UTF-8");
    assert_eq!(refusal.field.as_deref(), Some("table"));
    assert!(TableForm::from_csv(b"").expect("nothing").lanes().is_err());
}

#[test]
fn the_operator_limits_what_is_laid_out() {
    let sample = |n: u64| json!({"sample": {"method": "uniform", "n": n, "ranges": {"b": [1, 2]}}});
    let axis = json!({"parameter": "b", "linspace": [1, 2, 11]});
    let rows: Vec<[f64; 1]> = (0..11).map(|i| [1e4 + f64::from(i)]).collect();
    let design = |n: u64| json!({"sample": {"method": "saltelli", "n": n, "ranges": {"b": [1e4, 2e4], "d_m": [20, 30]}}});
    for (document, field) in [
        (steady(sample(11)), "sample.n"),
        (steady(design(3)), "sample.n"),
        (steady(design(u64::MAX)), "sample.n"),
        (steady(sample(u64::MAX)), "sample.n"),
        (steady(json!({"axes": [axis]})), "axes"),
        (steady(json!({"axes": [{"zip": [axis]}]})), "axes"),
        (table(&json!(["b"]), &json!(rows)), "table.rows"),
    ] {
        let limited = |max_runs| {
            let document = Document::parse(&document.to_string()).expect("a document");
            document.into_sweep(&Limits { max_runs }).map(|sweep| sweep.count())
        };
        let refusal = limited(10).expect_err("too many");
        assert_eq!(refusal.field.as_deref(), Some(field));
        assert!(refusal.permitted.expect("how many").contains("at most 10 runs"));
        if field != "sample.n" {
            assert_eq!(limited(11), Ok(11));
        }
        assert!(limited(usize::MAX).is_ok() || field == "sample.n", "never more than 2^24");
    }
}

#[test]
fn tags_priority_and_force_are_no_part_of_a_run() {
    let label =
        json!({"tags": ["spring", "2025:b-1_x."], "priority": -3, "force": true, "name": "n"});
    let labelled = sweep(&steady(label));
    assert_eq!(labelled.tags(), ["spring", "2025:b-1_x."]);
    assert_eq!((labelled.priority(), labelled.is_forced()), (-3, true));
    let plain = sweep(&json!({"regime": "steady"}));
    assert_eq!((plain.tags().len(), plain.priority(), plain.is_forced()), (0, 0, false));
    assert_eq!(labelled.run(0).id(), plain.run(0).id());
    for (member, value) in [
        ("tags", json!(["a"])),
        ("priority", json!(0)),
        ("force", json!(false)),
        ("table", json!({"columns": ["b"], "rows": [[1e4]]})),
        ("sample", json!({"method": "sobol", "n": 1, "ranges": {"b": [1, 2]}})),
    ] {
        let document = Document::parse(&steady(json!({member: value})).to_string());
        let refusal = document.and_then(Document::into_run).expect_err("a single run");
        assert_eq!(refusal.field.as_deref(), Some(member));
    }
}

/// The index vectors of a grid of 4 × 3 × 5 with unsorted axes, as ranks.
fn grid() -> (SweepSpec, impl Fn(usize) -> [i64; 3]) {
    let axes = json!([
        {"parameter": "b", "values": [3e4, 1e4, 4e4, 2e4]},
        {"option": "upstream_closure", "values": ["no_stretching", "published"]},
        {"parameter": "d_m", "values": [30, 10, 50, 20, 40]},
    ]);
    let ranks = |i: usize| [[2, 0, 3, 1][i / 10], [1, 0][i / 5 % 2], [2, 0, 4, 1, 3][i % 5]];
    (sweep(&steady(json!({"axes": axes}))), ranks)
}

fn is_permutation(mut order: Vec<usize>, stretch: Range<usize>) -> bool {
    order.sort_unstable();
    order.into_iter().eq(stretch)
}

#[test]
fn a_grid_is_walked_through_in_steps_of_one() {
    let (sweep, ranks) = grid();
    let order = sweep.visiting_order(0..40);
    for pair in order.windows(2) {
        let (from, to) = (ranks(pair[0]), ranks(pair[1]));
        let step: i64 = from.iter().zip(to).map(|(a, b)| (a - b).abs()).sum();
        assert_eq!(step, 1, "{from:?} to {to:?}");
    }
    assert!(is_permutation(order, 0..40));
}

#[test]
fn scattered_points_are_walked_through_from_neighbour_to_neighbour() {
    let ranges = json!({"b": {"log": [1e4, 1e6]}, "d_m": [10, 50], "mu_s": [0.2, 0.5]});
    let sample = json!({"method": "sobol", "n": 3000, "ranges": ranges});
    let sweep = sweep(&steady(json!({"sample": sample})));
    let length = |order: &[usize]| {
        let at = |i: usize| {
            let p = *sweep.run(i).parameters();
            [(p.b / 1e4).ln() / 100_f64.ln(), (p.d_m - 10.0) / 40.0, (p.mu_s - 0.2) / 0.3]
        };
        let step = |pair: &[usize]| {
            let squares = at(pair[0]).iter().zip(at(pair[1])).map(|(x, y)| (x - y).powi(2)).sum();
            f64::sqrt(squares)
        };
        order.windows(2).map(step).sum::<f64>()
    };
    let order = sweep.visiting_order(500..1000);
    let (walked, straight) = (length(&order), length(&(500..1000).collect::<Vec<_>>()));
    assert!(walked < 0.2 * straight, "{walked} of {straight}");
    assert!(is_permutation(order, 500..1000));
    let whole = sweep.visiting_order(0..3000);
    assert!(
        whole.windows(2).all(|w| sweep.run(w[0]).parameters().b <= sweep.run(w[1]).parameters().b)
    );
    assert!(is_permutation(whole, 0..3000));
}

#[test]
fn stretches_hold_as_much_work_as_they_may() {
    let axis = json!({"parameter": "b", "linspace": [1e4, 2e4, 10]});
    let even = sweep(&steady(json!({"axes": [axis]})));
    assert_eq!(even.stretches(150.0, 500), [0..3, 3..6, 6..9, 9..10]);
    assert_eq!(even.stretches(1.0, 500).len(), 10);
    assert_eq!(even.stretches(1e9, 4), [0..4, 4..8, 8..10]);
    let cells = json!({"parameter": "n_cells", "values": [20, 100]});
    let uneven = sweep(&steady(json!({"axes": [cells, axis]})));
    assert_eq!(uneven.stretches(200.0, 500)[..2], [0..10, 10..12]);
    let alternating = sweep(&steady(json!({"axes": [axis, cells]})));
    assert_eq!(
        alternating.stretches(240.0, 500),
        (0..5).map(|i| 4 * i..4 * i + 4).collect::<Vec<_>>()
    );
}

#[test]
fn the_value_of_a_refused_member_is_told_wherever_it_stands() {
    let document = r#"{"regime": "steady", "axes": [{"parameter": "b", "values": [1]},
        {"zip": [{"parameter": "d_m", "linspace": [1, "x", 3]}]}]}"#;
    let refusal = Document::parse(document).expect_err("no number");
    assert_eq!(refusal.field.as_deref(), Some("axes[1].zip[0].linspace[1]"));
    assert_eq!(refusal.value, Some(json!("x")));
    let toml = "regime = \"steady\"\n[sample]\nmethod = \"sobol\"\nn = -1\nranges = {}";
    let refusal = Document::parse(toml).expect_err("negative");
    assert_eq!((refusal.field.as_deref(), refusal.value), (Some("sample.n"), Some(json!(-1))));
}

proptest! {
    #[test]
    fn every_walk_is_a_permutation(
        lengths in prop::collection::vec(1_usize..6, 1..4),
        zipped: bool,
        ends in (0_usize..200, 0_usize..200),
    ) {
        let axis = |name: &str, n: usize| {
            let values: Vec<f64> = (0..n).map(|i| 1.0 + ((i * 7) % 5) as f64 / 10.0).collect();
            json!({"parameter": name, "values": values})
        };
        let names = ["d_m", "mu_s", "A"];
        let mut axes: Vec<Value> =
            lengths.iter().zip(names).map(|(n, name)| axis(name, *n)).collect();
        if zipped {
            axes[0] = json!({"zip": [axes[0], axis("b", lengths[0])]});
        }
        let spec = sweep(&steady(json!({"axes": axes})));
        let (first, last) = (ends.0.min(spec.count()), ends.1.min(spec.count()));
        let stretch = first.min(last)..first.max(last);
        prop_assert!(is_permutation(spec.visiting_order(stretch.clone()), stretch));
    }
}

#[test]
fn ranges_are_those_of_all_runs_also_of_what_a_flux_sets() {
    let sweep = sweep(&steady(json!({
        "parameters": {"d_m": 30},
        "axes": [
            {"parameter": "calving_flux_m2_per_a", "values": [3e6, 1.2e6]},
            {"zip": [
                {"parameter": "terminus_thickness_m", "values": [600, 400]},
                {"parameter": "b", "values": [1e4, 2e4]},
            ]},
        ],
    })));
    let range = |wanted: &str| {
        let (_, low, high) =
            sweep.ranges().find(|(name, ..)| *name == wanted).expect("a parameter");
        (low, high)
    };
    assert_eq!(range("calving_rate_m_per_a"), (1.2e6 / 600.0, 3e6 / 400.0));
    assert_eq!(range("terminus_velocity_m_per_a"), (1.2e6 / 600.0, 3e6 / 400.0));
    assert_eq!((range("b"), range("d_m")), ((1e4, 2e4), (30.0, 30.0)));
    assert_eq!(sweep.ranges().count(), PARAMETERS.len());
}
