//! What a filter means, and where one that is wrong is wrong.

use super::*;
use proptest::prelude::*;

fn kind_of(name: &str) -> Option<ColumnKind> {
    match name {
        "d_m" | "A" | "force_n_per_m" | "melt_rate_m_per_day" => Some(ColumnKind::Number),
        "status" | "run_id" => Some(ColumnKind::Text),
        "created_at" => Some(ColumnKind::Time),
        "tag" => Some(ColumnKind::Words),
        _ => None,
    }
}

fn parsed(text: &str) -> Filter {
    Filter::parse(text, &kind_of).unwrap_or_else(|refusal| panic!("{refusal}"))
}

fn compare(column: &str, op: Comparison, literal: impl Into<Literal>) -> Filter {
    Filter::Compare { column: column.into(), op, literal: literal.into() }
}

impl From<f64> for Literal {
    fn from(value: f64) -> Self {
        Self::Number(value)
    }
}

impl From<&str> for Literal {
    fn from(text: &str) -> Self {
        Self::Text(text.to_owned())
    }
}

use Comparison::{Equal, Greater, GreaterOrEqual, Less, LessOrEqual, NotEqual};

#[test]
fn conditions_are_joined_as_in_sql() {
    let text = "melt_rate_m_per_day >= 0.6 and (status = \"converged\" or status = 'collapsed') \
                AND NOT force_n_per_m < 1e6";
    assert_eq!(
        parsed(text),
        Filter::And(vec![
            compare("melt_rate_m_per_day", GreaterOrEqual, 0.6),
            Filter::Or(vec![
                compare("status", Equal, "converged"),
                compare("status", Equal, "collapsed"),
            ]),
            Filter::Not(Box::new(compare("force_n_per_m", Less, 1e6))),
        ])
    );
    let (a, b, c) =
        (compare("A", Less, 1.0), compare("d_m", Greater, 2.0), compare("A", Equal, 3.0));
    let either = Filter::Or(vec![a, Filter::And(vec![b, c])]);
    assert_eq!(parsed("A<1 or d_m>2 and A=3"), either, "`and` binds closer");
}

#[test]
fn values_have_all_their_forms() {
    for (text, value) in [("-1.5e-3", -1.5e-3), ("+.5", 0.5), ("5.", 5.0), ("1E6", 1e6), ("0", 0.0)]
    {
        assert_eq!(parsed(&format!("d_m != {text}")), compare("d_m", NotEqual, value));
    }
    assert_eq!(parsed("status='it''s \"so\"'"), compare("status", Equal, "it's \"so\""));
    assert_eq!(parsed("status=\"\"\"ü\"\"\""), compare("status", Equal, "\"ü\""));
    let column = || "status".to_owned();
    let literals = vec!["a".into(), "b".into()];
    let among = Filter::In { column: column(), literals };
    assert_eq!(parsed("status in ('a', \"b\")"), among);
    assert_eq!(parsed("status not in ('a', \"b\")"), Filter::Not(Box::new(among)));
    let null = Filter::IsNull { column: column() };
    assert_eq!(parsed("status Is Null"), null);
    assert_eq!(parsed("status is not null"), Filter::Not(Box::new(null)));
}

#[test]
fn bounds_may_stand_on_both_sides() {
    let between = Filter::And(vec![compare("d_m", GreaterOrEqual, 0.5), compare("d_m", Less, 0.7)]);
    assert_eq!(parsed("0.5 <= d_m < 0.7"), between);
    let downward =
        Filter::And(vec![compare("d_m", Less, 0.7), compare("d_m", GreaterOrEqual, 0.5)]);
    assert_eq!(parsed("0.7 > d_m >= 0.5"), downward);
    assert_eq!(parsed("30 >= d_m"), compare("d_m", LessOrEqual, 30.0));
}

#[test]
fn what_is_wrong_is_told_with_its_place() {
    for (text, at, permitted) in [
        ("", 1, "a condition"),
        ("melt >= 1", 1, "the name of a column"),
        ("d_m ~ 1", 5, "one of = != < <= > >="),
        ("d_m", 4, "`in`"),
        ("d_m is 3", 8, "`null` or `not null`"),
        ("d_m not 3", 9, "`in`"),
        ("d_m in 3", 8, "`(`"),
        ("d_m in ()", 9, "a number"),
        ("d_m in (1 2)", 11, "`,` or `)`"),
        ("d_m = 'x'", 7, "a number, which `d_m` holds"),
        ("status = 1", 10, "a text in quotes, which `status` holds"),
        ("1 = status", 1, "a text in quotes, which `status` holds"),
        ("d_m in (1, 'x')", 12, "a number"),
        ("d_m = A", 7, "a number"),
        ("1 < d_m > 3", 9, "`<` or `<=`"),
        ("3 > d_m = 3", 9, "`>` or `>=`"),
        ("3 = d_m < 3", 9, "`and`"),
        ("1 < 2", 5, "a column"),
        ("1 d_m", 3, "one of"),
        ("(d_m = 1", 9, "`)`"),
        ("d_m = 1)", 8, "`and`, `or` or the end"),
        ("d_m = 1 d_m = 2", 9, "`and`, `or` or the end"),
        ("d_m = 1 and", 12, "a condition"),
        ("d_m = 1e999", 7, "a finite number"),
        ("d_m = 1_000", 7, "a finite number"),
        ("d_m = -inf", 7, "a finite number"),
        ("d_m == 1", 6, "a number"),
        ("status = 'éé' & A", 15, "a column"),
        ("status = 'x", 10, "a text that ends"),
    ] {
        let refusal = Filter::parse(text, &kind_of).expect_err(text);
        assert_eq!(refusal.field.as_deref(), Some("filter"));
        assert_eq!(refusal.value, Some(text.into()));
        assert!(refusal.detail.contains(&format!("at character {at}: ")), "{text}: {refusal}");
        let told = refusal.permitted.expect("what is permitted");
        assert!(told.contains(permitted) && refusal.detail.contains(&told), "{text}: {told}");
    }
}

#[test]
fn length_and_depth_have_limits() {
    let nested = |n: usize| format!("{}A = 1{}", "(".repeat(n), ")".repeat(n));
    parsed(&nested(MAX_DEPTH));
    parsed(&format!("{}A = 1", "not ".repeat(MAX_DEPTH)));
    for text in [nested(MAX_DEPTH + 1), format!("{}A = 1", "not ".repeat(MAX_DEPTH + 1))] {
        let refusal = Filter::parse(&text, &kind_of).expect_err("too deep");
        assert!(refusal.detail.contains("at most 32"), "{refusal}");
    }
    let long = |n: usize| format!("A = 1{}", " ".repeat(n - 5));
    parsed(&long(MAX_CHARACTERS));
    let refusal = Filter::parse(&long(MAX_CHARACTERS + 1), &kind_of).expect_err("too long");
    assert_eq!(refusal.value, Some(4_001.into()));
    parsed(&vec!["A=1"; 400].join(" and "));
}

proptest! {
    #[test]
    fn no_text_panics(text in "\\PC*") {
        let _ = Filter::parse(&text, &kind_of);
    }

    #[test]
    fn no_tokens_in_any_order_panic(
        parts in prop::collection::vec(
            prop::sample::select(vec![
                "d_m", "status", "x", "1", "-", "1e", "'a'", "'", "=", "!", "<", "<=", ">", "(", ")",
                ",", "and", "or", "not", "in", "is", "null", "é",
            ]),
            0..30,
        ),
        gap in prop::sample::select(vec!["", " "]),
    ) {
        let text = parts.join(gap);
        if let Err(refusal) = Filter::parse(&text, &kind_of) {
            prop_assert!(refusal.permitted.is_some() && refusal.value.is_some());
        }
    }
}

#[test]
fn each_kind_of_column_takes_the_comparisons_that_have_a_meaning() {
    assert_eq!(parsed("status ~ 'Fail'"), compare("status", Comparison::Contains, "Fail"));
    assert_eq!(parsed("tag~'x'"), compare("tag", Comparison::Contains, "x"));
    assert_eq!(
        parsed("created_at > '2026-11-01T12:30:00Z'"),
        compare("created_at", Greater, "2026-11-01T12:30:00")
    );
    assert_eq!(
        parsed("'2026' <= created_at < '2027-02'"),
        Filter::And(vec![
            compare("created_at", GreaterOrEqual, "2026"),
            compare("created_at", Less, "2027-02"),
        ])
    );
    for (text, at) in [
        ("d_m ~ 3", 5),
        ("tag < 'x'", 5),
        ("'x' > tag", 5),
        ("'x' ~ status", 5),
        ("tag = 3", 7),
        ("created_at ~ '2026'", 12),
        ("created_at = 2026", 14),
        ("created_at = '2026-13'", 14),
        ("created_at in ('2026', 'soon')", 24),
        ("'soon' < created_at", 1),
        ("status ~ 5", 10),
    ] {
        let refusal = Filter::parse(text, &kind_of).expect_err(text);
        assert_eq!(refusal.character, Some(at), "{text}: {refusal}");
        assert!(refusal.pointed().ends_with(&format!("\n  {text}\n  {}^", " ".repeat(at - 1))));
    }
}
