//! A filter's text as tokens, each with the character at which it begins.

use super::{Comparison, Literal, Misfit};
use std::fmt;

#[derive(Debug, Clone, PartialEq)]
pub(super) enum Token {
    Name(String),
    Literal(Literal),
    Comparison(Comparison),
    Open,
    Close,
    Comma,
    And,
    Or,
    Not,
    In,
    Is,
    Null,
    End,
}

impl fmt::Display for Token {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Name(name) => write!(f, "`{name}`"),
            Self::Literal(Literal::Number(number)) => write!(f, "the number {number}"),
            Self::Literal(Literal::Text(text)) => write!(f, "the text \"{text}\""),
            Self::Comparison(op) => write!(f, "`{}`", op.symbol()),
            Self::Open => f.write_str("`(`"),
            Self::Close => f.write_str("`)`"),
            Self::Comma => f.write_str("`,`"),
            Self::And => f.write_str("`and`"),
            Self::Or => f.write_str("`or`"),
            Self::Not => f.write_str("`not`"),
            Self::In => f.write_str("`in`"),
            Self::Is => f.write_str("`is`"),
            Self::Null => f.write_str("`null`"),
            Self::End => f.write_str("the end"),
        }
    }
}

const KEYWORDS: [(&str, Token); 6] = [
    ("and", Token::And),
    ("or", Token::Or),
    ("not", Token::Not),
    ("in", Token::In),
    ("is", Token::Is),
    ("null", Token::Null),
];

/// The tokens with the character at which each begins, `End` last.
pub(super) fn tokens(text: &str) -> Result<Vec<(usize, Token)>, Misfit> {
    let characters: Vec<char> = text.chars().collect();
    let mut tokens = Vec::new();
    let mut i = 0;
    while i < characters.len() {
        let rest = &characters[i..];
        let (length, token) = match rest[0] {
            c if c.is_whitespace() => {
                i += 1;
                continue;
            }
            '(' => (1, Token::Open),
            ')' => (1, Token::Close),
            ',' => (1, Token::Comma),
            '=' => (1, Token::Comparison(Comparison::Equal)),
            '~' => (1, Token::Comparison(Comparison::Contains)),
            '!' if rest.get(1) == Some(&'=') => (2, Token::Comparison(Comparison::NotEqual)),
            '<' if rest.get(1) == Some(&'=') => (2, Token::Comparison(Comparison::LessOrEqual)),
            '<' => (1, Token::Comparison(Comparison::Less)),
            '>' if rest.get(1) == Some(&'=') => (2, Token::Comparison(Comparison::GreaterOrEqual)),
            '>' => (1, Token::Comparison(Comparison::Greater)),
            '"' | '\'' => quoted(rest, i + 1)?,
            '0'..='9' | '.' | '+' | '-' => number(rest, i + 1)?,
            c if c.is_alphabetic() || c == '_' => word(rest),
            c => {
                return Err(Misfit {
                    at: i + 1,
                    found: format!("`{c}`"),
                    permitted: "a column, a number, a text in quotes, one of = != < <= > >= ~, a \
                                parenthesis, a comma, or and, or, not, in, is, null"
                        .into(),
                });
            }
        };
        tokens.push((i + 1, token));
        i += length;
    }
    tokens.push((characters.len() + 1, Token::End));
    Ok(tokens)
}

fn word(rest: &[char]) -> (usize, Token) {
    let word: String =
        rest.iter().take_while(|c| c.is_alphanumeric() || **c == '_' || **c == '.').collect();
    let length = word.chars().count();
    let keyword = KEYWORDS.iter().find(|(name, _)| word.eq_ignore_ascii_case(name));
    (length, keyword.map_or_else(|| Token::Name(word), |(_, token)| token.clone()))
}

fn number(rest: &[char], at: usize) -> Result<(usize, Token), Misfit> {
    let is_of_it = |i: usize| {
        let follows_exponent = i > 0 && matches!(rest[i - 1], 'e' | 'E');
        match rest[i] {
            '+' | '-' => i == 0 || follows_exponent,
            c => c.is_alphanumeric() || c == '.' || c == '_',
        }
    };
    let length = (0..rest.len()).take_while(|i| is_of_it(*i)).count();
    let text: String = rest[..length].iter().collect();
    let value = text.parse().ok().filter(|value: &f64| value.is_finite());
    match value {
        Some(value) => Ok((length, Token::Literal(Literal::Number(value)))),
        None => Err(Misfit {
            at,
            found: format!("`{text}`"),
            permitted: "a finite number such as 50, -0.5 or 1e6".into(),
        }),
    }
}

/// A text between quotes, in which a doubled quote stands for itself.
fn quoted(rest: &[char], at: usize) -> Result<(usize, Token), Misfit> {
    let quote = rest[0];
    let mut text = String::new();
    let mut i = 1;
    while i < rest.len() {
        if rest[i] != quote {
            text.push(rest[i]);
            i += 1;
        } else if rest.get(i + 1) == Some(&quote) {
            text.push(quote);
            i += 2;
        } else {
            return Ok((i + 1, Token::Literal(Literal::Text(text))));
        }
    }
    let permitted = format!("a text that ends with {quote} as it begins");
    Err(Misfit { at, found: format!("{quote} that is not closed"), permitted })
}
