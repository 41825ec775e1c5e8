//! The language in which runs are chosen, on the command line, in REST and on the page alike:
//! `melt_rate_m_per_day >= 0.6 and (status = "converged" or status = "collapsed")`. Text in, tree out;
//! knows neither which columns there are nor where the runs are kept.

mod moment;
mod resolve;
mod tokens;

pub use resolve::{Known, Resolved};

use super::refusal::Refusal;
use tokens::{Token, tokens};

/// A condition on a run.
#[derive(Debug, Clone, PartialEq)]
pub enum Filter {
    /// All of them hold.
    And(Vec<Filter>),
    /// At least one of them holds.
    Or(Vec<Filter>),
    /// It does not hold.
    Not(Box<Filter>),
    /// A column's value beside a number or a text.
    Compare {
        /// The column.
        column: String,
        /// How they are compared, the column on the left.
        op: Comparison,
        /// What it is compared with, of the column's kind.
        literal: Literal,
    },
    /// A column's value is one of these.
    In {
        /// The column.
        column: String,
        /// At least one value, all of the column's kind.
        literals: Vec<Literal>,
    },
    /// A column has no value.
    IsNull {
        /// The column.
        column: String,
    },
}

/// How two values are compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Comparison {
    /// `=`
    Equal,
    /// `!=`
    NotEqual,
    /// `<`
    Less,
    /// `<=`
    LessOrEqual,
    /// `>`
    Greater,
    /// `>=`
    GreaterOrEqual,
    /// `~`: the text on the right is part of the one on the left, whatever the case of its letters.
    Contains,
}

impl Comparison {
    /// As it is written.
    pub fn symbol(self) -> &'static str {
        match self {
            Self::Equal => "=",
            Self::NotEqual => "!=",
            Self::Less => "<",
            Self::LessOrEqual => "<=",
            Self::Greater => ">",
            Self::GreaterOrEqual => ">=",
            Self::Contains => "~",
        }
    }

    /// With the sides exchanged.
    fn turned(self) -> Self {
        match self {
            Self::Less => Self::Greater,
            Self::LessOrEqual => Self::GreaterOrEqual,
            Self::Greater => Self::Less,
            Self::GreaterOrEqual => Self::LessOrEqual,
            same => same,
        }
    }

    fn is_upward(self) -> bool {
        matches!(self, Self::Less | Self::LessOrEqual)
    }

    fn is_downward(self) -> bool {
        self.turned().is_upward()
    }
}

/// A value that is written in a filter.
#[derive(Debug, Clone, PartialEq)]
pub enum Literal {
    /// A finite number.
    Number(f64),
    /// A text, without its quotes.
    Text(String),
}

impl Literal {
    /// Whether it can be compared with a column of a kind.
    fn is_of(&self, kind: ColumnKind) -> bool {
        match (self, kind) {
            (Self::Number(_), kind) => kind == ColumnKind::Number,
            (Self::Text(text), ColumnKind::Time) => moment::checked(text).is_some(),
            (Self::Text(_), kind) => kind != ColumnKind::Number,
        }
    }

    /// As it stands in the tree: moments without their zone, which is always UTC.
    fn of(self, kind: ColumnKind) -> Self {
        match (&self, kind) {
            (Self::Text(text), ColumnKind::Time) => {
                moment::checked(text).map_or(self.clone(), |moment| Self::Text(moment.to_owned()))
            }
            _ => self,
        }
    }
}

/// What a column holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ColumnKind {
    /// Numbers.
    Number,
    /// Texts.
    Text,
    /// Moments in UTC, written as in `2026-11-01T12:30:00`. A literal may leave out what follows the year, the
    /// month, the day and so on, and then means all that time: `< "2026-11"` is before November, `= "2026-11"`
    /// within it, `> "2026-11"` after it.
    Time,
    /// Any number of words. `=` means that one of them is it, `!=` that none is.
    Words,
}

impl ColumnKind {
    /// Whether a comparison has a meaning for such a column.
    fn takes(self, op: Comparison) -> bool {
        match self {
            Self::Number | Self::Time => op != Comparison::Contains,
            Self::Text => true,
            Self::Words => {
                matches!(op, Comparison::Equal | Comparison::NotEqual | Comparison::Contains)
            }
        }
    }

    /// The comparisons that have a meaning.
    fn comparisons(self) -> &'static str {
        match self {
            Self::Number | Self::Time => COMPARISONS,
            Self::Text => "one of = != < <= > >= ~",
            Self::Words => "one of = != ~",
        }
    }
}

/// Longest filter, in characters.
pub const MAX_CHARACTERS: usize = 4_000;
/// Deepest nesting of parentheses and `not`.
pub const MAX_DEPTH: usize = 32;

impl Filter {
    /// Reads a filter; `kind_of` tells what a column holds, and nothing for a name that is no column. The
    /// refusal's detail says at which character, counted from 1, and what is permitted there.
    pub fn parse(
        text: &str,
        kind_of: &dyn Fn(&str) -> Option<ColumnKind>,
    ) -> Result<Self, Refusal> {
        let length = text.chars().count();
        if length > MAX_CHARACTERS {
            let permitted = format!("at most {MAX_CHARACTERS} characters");
            return Err(Refusal::value("filter", length, permitted));
        }
        tokens(text).and_then(|tokens| Parser { tokens, next: 0, kind_of }.whole()).map_err(
            |Misfit { at, found, permitted }| Refusal {
                detail: format!(
                    "`filter` is refused at character {at}: found {found}; permitted is {permitted}"
                ),
                field: Some("filter".into()),
                value: Some(text.into()),
                permitted: Some(permitted),
                character: Some(at),
            },
        )
    }
}

/// What does not fit, and where.
struct Misfit {
    at: usize,
    found: String,
    permitted: String,
}

struct Parser<'a> {
    tokens: Vec<(usize, Token)>,
    next: usize,
    kind_of: &'a dyn Fn(&str) -> Option<ColumnKind>,
}

const CONDITION: &str = "a condition: a column, a number, a text, `not` or `(`";
const VALUE: &str = "a number or a text in quotes";

impl Parser<'_> {
    fn whole(mut self) -> Result<Filter, Misfit> {
        let filter = self.any(0)?;
        match self.token() {
            Token::End => Ok(filter),
            _ => Err(self.misfit("`and`, `or` or the end")),
        }
    }

    /// Conditions with `or` between them.
    fn any(&mut self, depth: usize) -> Result<Filter, Misfit> {
        let mut parts = vec![self.all(depth)?];
        while self.took(&Token::Or) {
            parts.push(self.all(depth)?);
        }
        Ok(if parts.len() > 1 { Filter::Or(parts) } else { parts.remove(0) })
    }

    /// Conditions with `and` between them.
    fn all(&mut self, depth: usize) -> Result<Filter, Misfit> {
        let mut parts = vec![self.one(depth)?];
        while self.took(&Token::And) {
            parts.push(self.one(depth)?);
        }
        Ok(if parts.len() > 1 { Filter::And(parts) } else { parts.remove(0) })
    }

    fn one(&mut self, depth: usize) -> Result<Filter, Misfit> {
        if matches!(self.token(), Token::Not | Token::Open) && depth == MAX_DEPTH {
            let permitted = format!("at most {MAX_DEPTH} parentheses and `not` inside each other");
            return Err(self.misfit(&permitted));
        }
        if self.took(&Token::Not) {
            return Ok(Filter::Not(Box::new(self.one(depth + 1)?)));
        }
        if self.took(&Token::Open) {
            let filter = self.any(depth + 1)?;
            if !self.took(&Token::Close) {
                return Err(self.misfit("`and`, `or` or `)`"));
            }
            return Ok(filter);
        }
        match self.token() {
            Token::Literal(_) => self.chain(),
            Token::Name(_) => self.of_column(),
            _ => Err(self.misfit(CONDITION)),
        }
    }

    /// A condition that begins with a value: `0.5 < d_m`, or with bounds on both sides.
    fn chain(&mut self) -> Result<Filter, Misfit> {
        let at = self.next;
        let first = self.literal(None)?;
        let Some(op) = self.took_comparison().filter(|op| *op != Comparison::Contains) else {
            self.next = at + 1;
            return Err(self.misfit(COMPARISONS));
        };
        let (column, kind) = self.column()?;
        if !first.is_of(kind) {
            self.next = at;
            return Err(self.misfit(kind_sentence(&column, kind)));
        }
        if !kind.takes(op) {
            self.next = at + 1;
            return Err(self.misfit(kind.comparisons()));
        }
        let first = first.of(kind);
        let lower = Filter::Compare { column: column.clone(), op: op.turned(), literal: first };
        let Token::Comparison(second) = *self.token() else { return Ok(lower) };
        let is_chain =
            (op.is_upward() && second.is_upward()) || (op.is_downward() && second.is_downward());
        if !is_chain {
            let permitted = match op {
                _ if op.is_upward() => "`<` or `<=`, as on the column's left",
                _ if op.is_downward() => "`>` or `>=`, as on the column's left",
                _ => "`and`, `or` or the end",
            };
            return Err(self.misfit(permitted));
        }
        self.next += 1;
        let literal = self.literal(Some((&column, kind)))?;
        Ok(Filter::And(vec![lower, Filter::Compare { column, op: second, literal }]))
    }

    /// A condition that begins with a column.
    fn of_column(&mut self) -> Result<Filter, Misfit> {
        let (column, kind) = self.column()?;
        if let Some(op) = self.took_comparison() {
            if !kind.takes(op) {
                self.next -= 1;
                return Err(self.misfit(kind.comparisons()));
            }
            let literal = self.literal(Some((&column, kind)))?;
            return Ok(Filter::Compare { column, op, literal });
        }
        if self.took(&Token::Is) {
            let is_not = self.took(&Token::Not);
            if !self.took(&Token::Null) {
                return Err(self.misfit(if is_not { "`null`" } else { "`null` or `not null`" }));
            }
            return Ok(negated(is_not, Filter::IsNull { column }));
        }
        let is_not = self.took(&Token::Not);
        if !self.took(&Token::In) {
            return Err(self.misfit(if is_not { "`in`" } else { AFTER_COLUMN }));
        }
        if !self.took(&Token::Open) {
            return Err(self.misfit("`(` and values"));
        }
        let mut literals = vec![self.literal(Some((&column, kind)))?];
        while self.took(&Token::Comma) {
            literals.push(self.literal(Some((&column, kind)))?);
        }
        if !self.took(&Token::Close) {
            return Err(self.misfit("`,` or `)`"));
        }
        Ok(negated(is_not, Filter::In { column, literals }))
    }

    fn column(&mut self) -> Result<(String, ColumnKind), Misfit> {
        let Token::Name(name) = self.token() else { return Err(self.misfit("a column")) };
        let name = name.clone();
        let Some(kind) = (self.kind_of)(&name) else {
            return Err(
                self.misfit("the name of a column that this list has, such as melt_rate_m_per_day")
            );
        };
        self.next += 1;
        Ok((name, kind))
    }

    /// A value; of the column's kind, if there is one.
    fn literal(&mut self, column: Option<(&str, ColumnKind)>) -> Result<Literal, Misfit> {
        let permitted =
            column.map_or_else(|| VALUE.to_owned(), |(name, kind)| kind_sentence(name, kind));
        let Token::Literal(literal) = self.token() else { return Err(self.misfit(permitted)) };
        if column.is_some_and(|(_, kind)| !literal.is_of(kind)) {
            return Err(self.misfit(permitted));
        }
        let literal = literal.clone();
        self.next += 1;
        Ok(match column {
            Some((_, kind)) => literal.of(kind),
            None => literal,
        })
    }

    fn token(&self) -> &Token {
        &self.tokens[self.next].1
    }

    fn took(&mut self, token: &Token) -> bool {
        let is_it = self.token() == token;
        self.next += usize::from(is_it);
        is_it
    }

    fn took_comparison(&mut self) -> Option<Comparison> {
        let Token::Comparison(op) = *self.token() else { return None };
        self.next += 1;
        Some(op)
    }

    fn misfit(&self, permitted: impl Into<String>) -> Misfit {
        let (at, token) = &self.tokens[self.next];
        Misfit { at: *at, found: token.to_string(), permitted: permitted.into() }
    }
}

const COMPARISONS: &str = "one of = != < <= > >=";
const AFTER_COLUMN: &str = "one of = != < <= > >= ~, `in`, `not in`, `is null` or `is not null`";

fn negated(is_not: bool, filter: Filter) -> Filter {
    if is_not { Filter::Not(Box::new(filter)) } else { filter }
}

fn kind_sentence(column: &str, kind: ColumnKind) -> String {
    match kind {
        ColumnKind::Number => format!("a number, which `{column}` holds"),
        ColumnKind::Text => format!("a text in quotes, which `{column}` holds"),
        ColumnKind::Time => {
            format!("a date in quotes, which `{column}` holds, such as \"2026-11-01\"")
        }
        ColumnKind::Words => format!("a text in quotes, such as `{column}` holds"),
    }
}

#[cfg(test)]
mod tests;
