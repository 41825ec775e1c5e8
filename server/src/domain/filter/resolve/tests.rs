//! What is left of a filter means what the filter meant, for every run that the knowledge is about.

use super::super::ColumnKind;
use super::*;
use proptest::prelude::*;

fn kind_of(name: &str) -> Option<ColumnKind> {
    match name {
        "d_m" | "force_n_per_m" | "total" => Some(ColumnKind::Number),
        "status" | "owner" => Some(ColumnKind::Text),
        "created_at" => Some(ColumnKind::Time),
        "tag" => Some(ColumnKind::Words),
        _ => None,
    }
}

fn parsed(text: &str) -> Filter {
    Filter::parse(text, &kind_of).unwrap_or_else(|refusal| panic!("{refusal}"))
}

/// A run with what its sweep has.
#[derive(Debug, Clone)]
struct Run {
    d_m: f64,
    force: Option<f64>,
    status: &'static str,
}

#[derive(Debug, Clone)]
struct Sweep {
    runs: Vec<Run>,
    owner: Option<&'static str>,
    tags: Vec<String>,
}

const CREATED: &str = "2026-11-22T13:57:00.123Z";

impl Sweep {
    fn known(&self, column: &str) -> Known<'_> {
        let d = || self.runs.iter().map(|run| run.d_m);
        match column {
            "d_m" => Known::Between(
                d().fold(f64::INFINITY, f64::min),
                d().fold(f64::NEG_INFINITY, f64::max),
            ),
            "total" => Known::Number(self.runs.len() as f64),
            "status" => Known::OneOf(self.runs.iter().map(|run| run.status).collect()),
            "owner" => Known::Text(self.owner),
            "created_at" => Known::Time(CREATED),
            "tag" => Known::Words(&self.tags),
            _ => Known::Nothing,
        }
    }

    /// What a filter says of a run, written down once more in the simplest way.
    fn lets(&self, filter: &Filter, run: &Run) -> bool {
        let number = |column: &str| match column {
            "d_m" => Some(run.d_m),
            "total" => Some(self.runs.len() as f64),
            _ => run.force,
        };
        let equal = |column: &str, literal: &Literal| match literal {
            Literal::Number(n) => number(column) == Some(*n),
            Literal::Text(t) => match column {
                "tag" => self.tags.contains(t),
                "created_at" => CREATED.starts_with(t.as_str()),
                "owner" => self.owner == Some(t.as_str()),
                _ => run.status == t,
            },
        };
        match filter {
            Filter::And(all) => all.iter().all(|f| self.lets(f, run)),
            Filter::Or(any) => any.iter().any(|f| self.lets(f, run)),
            Filter::Not(inner) => !self.lets(inner, run),
            Filter::In { column, literals } => literals.iter().any(|l| equal(column, l)),
            Filter::IsNull { column } => match column.as_str() {
                "force_n_per_m" => run.force.is_none(),
                "owner" => self.owner.is_none(),
                "tag" => self.tags.is_empty(),
                _ => false,
            },
            Filter::Compare { column, op, literal } => match (op, literal) {
                (Comparison::Equal, literal) => equal(column, literal),
                (Comparison::NotEqual, literal) => {
                    let is_there = match column.as_str() {
                        "owner" => self.owner.is_some(),
                        "force_n_per_m" => run.force.is_some(),
                        _ => true,
                    };
                    is_there && !equal(column, literal)
                }
                (Comparison::Contains, Literal::Text(part)) => match column.as_str() {
                    "tag" => self.tags.iter().any(|tag| tag.contains(part.as_str())),
                    "owner" => self.owner.is_some_and(|owner| owner.contains(part.as_str())),
                    _ => run.status.contains(part.as_str()),
                },
                (op, Literal::Number(n)) => number(column).is_some_and(|value| match op {
                    Comparison::Less => value < *n,
                    Comparison::LessOrEqual => value <= *n,
                    Comparison::Greater => value > *n,
                    _ => value >= *n,
                }),
                (op, Literal::Text(t)) => {
                    let text = match column.as_str() {
                        "owner" => self.owner,
                        "created_at" => CREATED.get(..t.len()),
                        _ => Some(run.status),
                    };
                    let t = t.as_str();
                    text.is_some_and(|value| match op {
                        Comparison::Less => value < t,
                        Comparison::LessOrEqual => value <= t,
                        Comparison::Greater => value > t,
                        _ => value >= t,
                    })
                }
            },
        }
    }
}

fn runs() -> impl Strategy<Value = Run> {
    let force = prop_oneof![Just(None), (0..4).prop_map(|f| Some(f64::from(f)))];
    let status = prop_oneof![Just("converged"), Just("failed"), Just("overthick")];
    ((0..5).prop_map(f64::from), force, status).prop_map(|(d_m, force, status)| Run {
        d_m,
        force,
        status,
    })
}

fn sweeps() -> impl Strategy<Value = Sweep> {
    let owner = prop_oneof![Just(None), Just(Some("ada")), Just(Some("bo"))];
    let tags =
        prop::collection::vec(prop_oneof![Just("good".to_owned()), Just("old".into())], 0..3);
    (prop::collection::vec(runs(), 1..5), owner, tags).prop_map(|(runs, owner, tags)| Sweep {
        runs,
        owner,
        tags,
    })
}

fn conditions() -> impl Strategy<Value = String> {
    let order = prop_oneof![Just("="), Just("!="), Just("<"), Just("<="), Just(">"), Just(">=")];
    let numbers = prop_oneof![Just("d_m"), Just("force_n_per_m"), Just("total")];
    prop_oneof![
        (numbers.clone(), order.clone(), 0..6).prop_map(|(c, op, n)| format!("{c} {op} {n}")),
        (0..5, numbers.clone(), 0..6).prop_map(|(a, c, b)| format!("{a} < {c} <= {b}")),
        (numbers, 0..6, 0..6).prop_map(|(c, a, b)| format!("{c} in ({a}, {b})")),
        order.clone().prop_map(|op| format!("status {op} 'failed'")),
        order.clone().prop_map(|op| format!("owner {op} 'ada'")),
        (order, prop_oneof![Just("2026"), Just("2026-11-22"), Just("2026-11-23"), Just("2025-12")])
            .prop_map(|(op, t)| format!("created_at {op} '{t}'")),
        prop_oneof![
            Just("tag = 'good'"),
            Just("tag != 'good'"),
            Just("tag ~ 'ol'"),
            Just("tag in ('old', 'none')"),
            Just("tag is null"),
            Just("owner is not null"),
            Just("owner ~ 'd'"),
            Just("status ~ 'ver'"),
            Just("force_n_per_m is null"),
            Just("status not in ('failed', 'overthick')"),
        ]
        .prop_map(str::to_owned),
    ]
}

fn filters() -> impl Strategy<Value = String> {
    conditions().prop_recursive(4, 24, 3, |inner| {
        let parts = prop::collection::vec(inner.clone(), 1..4);
        prop_oneof![
            parts.clone().prop_map(|p| format!("({})", p.join(" and "))),
            parts.prop_map(|p| format!("({})", p.join(" or "))),
            inner.prop_map(|f| format!("not ({f})")),
        ]
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4_000))]
    #[test]
    fn what_is_left_lets_the_same_runs_through(sweep in sweeps(), text in filters()) {
        let filter = parsed(&text);
        let left = filter.resolve(&|column| sweep.known(column));
        for run in &sweep.runs {
            let lets = match &left {
                Resolved::Always => true,
                Resolved::Never => false,
                Resolved::Depends(left) => sweep.lets(left, run),
            };
            prop_assert_eq!(lets, sweep.lets(&filter, run), "{:?}", left);
        }
    }
}

#[test]
fn what_is_known_falls_away() {
    let known = |column: &str| match column {
        "d_m" => Known::Between(10.0, 20.0),
        "owner" => Known::Text(Some("ada")),
        _ => Known::Nothing,
    };
    let left = |text: &str| parsed(text).resolve(&known);
    let depends = |text: &str| Resolved::Depends(parsed(text));
    assert_eq!(left("d_m > 20"), Resolved::Never);
    assert_eq!(left("d_m >= 20"), depends("d_m >= 20"));
    assert_eq!(left("5 < d_m < 21"), Resolved::Always);
    assert_eq!(left("not d_m > 20"), Resolved::Always);
    assert_eq!(left("d_m = 15"), depends("d_m = 15"));
    assert_eq!(left("d_m != 9"), Resolved::Always);
    assert_eq!(left("d_m not in (1, 30)"), Resolved::Always);
    assert_eq!(left("owner = 'ada' and force_n_per_m > 1"), depends("force_n_per_m > 1"));
    assert_eq!(left("owner = 'bo' and force_n_per_m > 1"), Resolved::Never);
    assert_eq!(left("owner = 'bo' or d_m < 12 or total = 1"), depends("d_m < 12 or total = 1"));
    assert_eq!(left("owner ~ 'AD'"), Resolved::Always);
    assert_eq!(parsed("owner ~ 'ÖR'").resolve(&|_| Known::Text(Some("Jörg"))), Resolved::Always);
}
