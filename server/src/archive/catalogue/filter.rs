//! Filters as SQL. Columns are quoted names of the catalogue's own tables, values are bound.

use super::list::axis_column;
use crate::domain::filter::{Comparison, Filter, Literal};
use sqlx::{QueryBuilder, Sqlite};

/// An SQL expression, in parts.
pub struct Expression(Vec<Part>);

/// A part of an SQL expression.
pub enum Part {
    /// As it stands.
    Text(String),
    /// A value to bind.
    Value(Literal),
}

impl Expression {
    /// A text in which values take the places of question marks, in their order.
    pub fn new(text: &str, values: impl IntoIterator<Item = Literal>) -> Self {
        let mut values = values.into_iter().map(Part::Value);
        let texts = text.split('?').map(|text| Part::Text(text.to_owned()));
        Self(texts.flat_map(|text| [Some(text), values.next()]).flatten().collect())
    }

    /// Appends the expression to a query.
    pub fn push_to(&self, query: &mut QueryBuilder<Sqlite>) {
        for part in &self.0 {
            match part {
                Part::Text(text) => query.push(text),
                Part::Value(Literal::Number(number)) => query.push_bind(*number),
                Part::Value(Literal::Text(text)) => query.push_bind(text.clone()),
            };
        }
    }
}

/// A filter on the runs of a sweep that varies the parameters `axes`.
pub fn condition(filter: &Filter, axes: &[&str]) -> Expression {
    let mut parts = Vec::new();
    write(filter, axes, &mut parts);
    Expression(parts)
}

/// The index of the primary key, sweep and run_index, by the name that SQLite documents for it.
pub const PRIMARY: &str = "sqlite_autoindex_runs_1";

/// The index that holds a sweep's runs in the order of a column and then of run_index, if there is one.
pub fn index_of(column: &str, axes: &[&str]) -> Option<String> {
    match column {
        "run_index" => Some(PRIMARY.to_owned()),
        "status" => Some("runs_by_status".to_owned()),
        "force_n_per_m" => Some("runs_by_force".to_owned()),
        _ => axis_column(column, axes).map(|axis| format!("runs_by_{axis}")),
    }
}

/// A sweep's runs along an index, as the beginning of a condition. The index of an axis has no runs of sweeps
/// without such an axis, and is taken only by who says that they want none.
pub fn along(query: &mut QueryBuilder<Sqlite>, index: &str, sweep: i64) {
    query.push("runs INDEXED BY ").push(index).push(" WHERE sweep = ").push_bind(sweep);
    if let Some(axis) = index.strip_prefix("runs_by_axis_") {
        query.push(" AND axis_").push(axis).push(" IS NOT NULL");
    }
}

/// Conditions of a filter that one index serves.
pub struct Served {
    /// The index.
    pub index: String,
    /// All of the filter's conditions that it serves.
    pub conditions: Filter,
    /// Whether the filter has no others.
    pub is_whole: bool,
}

/// The conditions of a filter that must all hold, by the indices that serve them.
pub fn served(filter: &Filter, axes: &[&str]) -> Vec<Served> {
    let mut conjuncts = Vec::new();
    flatten(filter, &mut conjuncts);
    let mut indices: Vec<(String, Vec<Filter>)> = Vec::new();
    for conjunct in &conjuncts {
        let Some(index) = index_for(conjunct, axes) else { continue };
        match indices.iter_mut().find(|(known, _)| *known == index) {
            Some((_, conditions)) => conditions.push((*conjunct).clone()),
            None => indices.push((index, vec![(*conjunct).clone()])),
        }
    }
    let served = indices.into_iter().map(|(index, conditions)| {
        let is_whole = conditions.len() == conjuncts.len();
        Served { index, conditions: Filter::And(conditions), is_whole }
    });
    served.collect()
}

fn flatten<'a>(filter: &'a Filter, conjuncts: &mut Vec<&'a Filter>) {
    match filter {
        Filter::And(all) => all.iter().for_each(|f| flatten(f, conjuncts)),
        one => conjuncts.push(one),
    }
}

fn index_for(conjunct: &Filter, axes: &[&str]) -> Option<String> {
    match conjunct {
        // The index of ids knows no sweeps and is of use only where it is told the id.
        Filter::Compare { column, op: Comparison::Equal, .. } | Filter::In { column, .. }
            if column == "run_id" =>
        {
            Some("runs_by_id".to_owned())
        }
        Filter::Compare { column, .. } | Filter::In { column, .. } | Filter::IsNull { column } => {
            index_of(column, axes)
        }
        Filter::And(_) | Filter::Or(_) | Filter::Not(_) => None,
    }
}

fn write(filter: &Filter, axes: &[&str], parts: &mut Vec<Part>) {
    let name = |column: &str| {
        let stored = axis_column(column, axes);
        format!("\"{}\"", stored.as_deref().unwrap_or(column))
    };
    let text = |parts: &mut Vec<Part>, text: &str| parts.push(Part::Text(text.to_owned()));
    let mut joined = |all: &[Filter], with: &str| {
        for (i, filter) in all.iter().enumerate() {
            text(parts, if i == 0 { "(" } else { with });
            write(filter, axes, parts);
        }
        text(parts, ")");
    };
    match filter {
        Filter::And(all) => joined(all, " AND "),
        Filter::Or(any) => joined(any, " OR "),
        // What is unknown because there is no value does not hold, so that its opposite does.
        Filter::Not(inner) => {
            text(parts, "NOT COALESCE(");
            write(inner, axes, parts);
            text(parts, ", FALSE)");
        }
        // In letters without accents, the case does not matter.
        Filter::Compare { column, op: Comparison::Contains, literal } => {
            parts.push(Part::Text(format!("LOWER({}) LIKE ", name(column))));
            parts.push(Part::Value(pattern(literal)));
            text(parts, " ESCAPE '\\'");
        }
        Filter::Compare { column, op, literal } => {
            let op = if *op == Comparison::NotEqual { "<>" } else { op.symbol() };
            parts.push(Part::Text(format!("{} {op} ", name(column))));
            parts.push(Part::Value(literal.clone()));
        }
        Filter::In { column, literals } => {
            parts.push(Part::Text(format!("{} IN (", name(column))));
            for (i, literal) in literals.iter().enumerate() {
                if i > 0 {
                    text(parts, ", ");
                }
                parts.push(Part::Value(literal.clone()));
            }
            text(parts, ")");
        }
        Filter::IsNull { column } => {
            parts.push(Part::Text(format!("{} IS NULL", name(column))));
        }
    }
}

/// The pattern of texts that contain a literal.
fn pattern(literal: &Literal) -> Literal {
    let Literal::Text(text) = literal else { return literal.clone() };
    let mut pattern = String::from("%");
    for c in text.chars() {
        if matches!(c, '%' | '_' | '\\') {
            pattern.push('\\');
        }
        pattern.push(c.to_ascii_lowercase());
    }
    pattern.push('%');
    Literal::Text(pattern)
}

/// The only ids that runs can have which a filter lets through; none if it names none.
pub fn ids(filter: &Filter) -> Option<Vec<&str>> {
    let mut conjuncts = Vec::new();
    flatten(filter, &mut conjuncts);
    conjuncts.into_iter().find_map(|conjunct| {
        let literals = match conjunct {
            Filter::Compare { column, op: Comparison::Equal, literal } if column == "run_id" => {
                std::slice::from_ref(literal)
            }
            Filter::In { column, literals } if column == "run_id" => literals.as_slice(),
            _ => return None,
        };
        let texts = literals.iter().filter_map(|literal| match literal {
            Literal::Text(text) => Some(text.as_str()),
            Literal::Number(_) => None,
        });
        Some(texts.collect())
    })
}
