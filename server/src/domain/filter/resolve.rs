//! What is left of a filter once some columns are known: of a sweep, its own columns and the ranges of its runs'
//! parameters. A sweep that this rules out has no run that the filter lets through.
//!
//! A comparison with a value that is missing does not hold, and its opposite does.

use super::{Comparison, Filter, Literal};
use std::cmp::Ordering;

/// What is known of a column, for all runs of a sweep together.
#[derive(Debug, Clone, PartialEq)]
pub enum Known<'a> {
    /// Nothing.
    Nothing,
    /// A number.
    Number(f64),
    /// A number between these two, which are among its values or beyond them.
    Between(f64, f64),
    /// A text, or that there is none.
    Text(Option<&'a str>),
    /// A text that is one of these.
    OneOf(Vec<&'a str>),
    /// A moment.
    Time(&'a str),
    /// Words.
    Words(&'a [String]),
}

/// What is left of a filter.
#[derive(Debug, Clone, PartialEq)]
pub enum Resolved {
    /// It lets everything through.
    Always,
    /// It lets nothing through.
    Never,
    /// It depends on this.
    Depends(Filter),
}

impl Resolved {
    fn known(holds: Option<bool>, otherwise: impl FnOnce() -> Filter) -> Self {
        match holds {
            Some(true) => Self::Always,
            Some(false) => Self::Never,
            None => Self::Depends(otherwise()),
        }
    }
}

impl Filter {
    /// What is left of the filter, `known` told of a column.
    pub fn resolve<'a>(&self, known: &dyn Fn(&str) -> Known<'a>) -> Resolved {
        match self {
            Self::And(all) => joined(all, known, &Resolved::Always, &Resolved::Never, Self::And),
            Self::Or(any) => joined(any, known, &Resolved::Never, &Resolved::Always, Self::Or),
            Self::Not(inner) => match inner.resolve(known) {
                Resolved::Always => Resolved::Never,
                Resolved::Never => Resolved::Always,
                Resolved::Depends(left) => Resolved::Depends(Self::Not(Box::new(left))),
            },
            Self::Compare { column, op, literal } => {
                Resolved::known(compare(&known(column), *op, literal), || self.clone())
            }
            Self::In { column, literals } => {
                let holds = one_of(&known(column), literals);
                Resolved::known(holds, || self.clone())
            }
            Self::IsNull { column } => {
                let holds = match known(column) {
                    Known::Nothing => None,
                    Known::Text(text) => Some(text.is_none()),
                    Known::Words(words) => Some(words.is_empty()),
                    _ => Some(false),
                };
                Resolved::known(holds, || self.clone())
            }
        }
    }

    /// Whether it asks for a column.
    pub fn mentions(&self, name: &str) -> bool {
        match self {
            Self::And(parts) | Self::Or(parts) => parts.iter().any(|part| part.mentions(name)),
            Self::Not(inner) => inner.mentions(name),
            Self::Compare { column, .. } | Self::In { column, .. } | Self::IsNull { column } => {
                column == name
            }
        }
    }
}

/// Parts joined: those that are `neutral` fall away, and one that is `decisive` decides.
fn joined<'a>(
    parts: &[Filter],
    known: &dyn Fn(&str) -> Known<'a>,
    neutral: &Resolved,
    decisive: &Resolved,
    join: fn(Vec<Filter>) -> Filter,
) -> Resolved {
    let mut left = Vec::new();
    for part in parts {
        match part.resolve(known) {
            Resolved::Depends(filter) => left.push(filter),
            told if told == *decisive => return told,
            _ => {}
        }
    }
    match left.len() {
        0 => neutral.clone(),
        1 => Resolved::Depends(left.remove(0)),
        _ => Resolved::Depends(join(left)),
    }
}

/// Whether a comparison holds; none if that is not known.
fn compare(known: &Known<'_>, op: Comparison, literal: &Literal) -> Option<bool> {
    match (known, literal) {
        (Known::Number(value), Literal::Number(number)) => {
            Some(value.partial_cmp(number).is_some_and(|order| holds(op, order)))
        }
        (Known::Between(low, high), Literal::Number(number)) => between(*low, *high, op, *number),
        (Known::Text(None), _) => Some(false),
        (Known::Text(Some(text)), Literal::Text(literal)) => Some(text_holds(text, op, literal)),
        (Known::OneOf(texts), Literal::Text(literal)) => {
            let holding = texts.iter().filter(|text| text_holds(text, op, literal)).count();
            match holding {
                0 => Some(false),
                n if n == texts.len() => Some(true),
                _ => None,
            }
        }
        (Known::Time(moment), Literal::Text(literal)) => {
            let begin = moment.get(..literal.len()).unwrap_or(moment);
            Some(holds(op, begin.cmp(literal)))
        }
        (Known::Words(words), Literal::Text(literal)) => Some(match op {
            Comparison::NotEqual => !words.contains(literal),
            op => words.iter().any(|word| text_holds(word, op, literal)),
        }),
        _ => None,
    }
}

/// Whether a value is one of several; none if that is not known.
fn one_of(known: &Known<'_>, literals: &[Literal]) -> Option<bool> {
    if let Known::OneOf(texts) = known {
        let is_one = |text: &&&str| {
            literals.iter().any(|l| matches!(l, Literal::Text(literal) if literal == **text))
        };
        return match texts.iter().filter(is_one).count() {
            0 => Some(false),
            n if n == texts.len() => Some(true),
            _ => None,
        };
    }
    let mut is_unknown = false;
    for literal in literals {
        match compare(known, Comparison::Equal, literal) {
            Some(true) => return Some(true),
            Some(false) => {}
            None => is_unknown = true,
        }
    }
    if is_unknown { None } else { Some(false) }
}

fn between(low: f64, high: f64, op: Comparison, number: f64) -> Option<bool> {
    let all = holds(op, low.partial_cmp(&number)?) && holds(op, high.partial_cmp(&number)?);
    let is_inside = low <= number && number <= high;
    match op {
        Comparison::Equal if !is_inside => Some(false),
        Comparison::Equal => all.then_some(true),
        Comparison::NotEqual if !is_inside => Some(true),
        Comparison::NotEqual => (low == high).then_some(false),
        // What holds at both ends holds between them, and so does what holds at neither.
        op => {
            let none =
                !holds(op, low.partial_cmp(&number)?) && !holds(op, high.partial_cmp(&number)?);
            if all { Some(true) } else { none.then_some(false) }
        }
    }
}

fn holds(op: Comparison, order: Ordering) -> bool {
    match op {
        Comparison::Equal => order.is_eq(),
        Comparison::NotEqual => order.is_ne(),
        Comparison::Less => order.is_lt(),
        Comparison::LessOrEqual => order.is_le(),
        Comparison::Greater => order.is_gt(),
        Comparison::GreaterOrEqual => order.is_ge(),
        Comparison::Contains => false,
    }
}

fn text_holds(text: &str, op: Comparison, literal: &str) -> bool {
    match op {
        Comparison::Contains => text.to_lowercase().contains(&literal.to_lowercase()),
        op => holds(op, text.cmp(literal)),
    }
}

#[cfg(test)]
mod tests;
