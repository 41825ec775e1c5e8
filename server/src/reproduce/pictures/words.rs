//! Words with symbols: `*U*` slants, `_0_` is lowered, `^2^` is raised.

use svg::Node;
use svg::node::Blob;
use svg::node::element::{Element, TSpan};

/// Size of what is raised or lowered, by that of the words.
const SMALL: &str = "72%";

#[derive(Clone, Copy, PartialEq)]
enum Manner {
    Plain,
    Slanted,
    Lowered,
    Raised,
}

/// A text of words and symbols. An opened mark is closed by the same mark.
pub fn words(content: &str) -> Element {
    let mut parts = Vec::new();
    let (mut manner, mut part) = (Manner::Plain, String::new());
    for letter in content.chars() {
        let mark = match letter {
            '*' => Manner::Slanted,
            '_' => Manner::Lowered,
            '^' => Manner::Raised,
            letter => {
                part.push(letter);
                continue;
            }
        };
        parts.push((manner, std::mem::take(&mut part)));
        manner = if manner == mark { Manner::Plain } else { mark };
    }
    parts.push((manner, part));
    // How far below the line the last part stood.
    let mut below = 0;
    // In one piece: a line's end between two spans would be shown as a space.
    let mut spans = String::new();
    for (manner, part) in parts.into_iter().filter(|(_, part)| !part.is_empty()) {
        let mut span = TSpan::new(part);
        let (depth, is_small) = match manner {
            Manner::Lowered => (3, true),
            Manner::Raised => (-4, true),
            _ => (0, false),
        };
        if is_small {
            span.assign("font-size", SMALL);
        }
        if manner == Manner::Slanted {
            span.assign("font-style", "italic");
        }
        if depth != below {
            span.assign("dy", depth - below);
            below = depth;
        }
        spans += &span.to_string();
    }
    let mut text = Element::new("text");
    text.append(Blob::new(spans));
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn symbols_are_set_and_the_line_is_found_again() {
        let set = words("*H*_0_ (m a^\u{2212}1^)").to_string();
        let plain: String = set.split('<').filter_map(|part| part.split('>').nth(1)).collect();
        assert_eq!(plain.replace('\n', ""), "H0 (m a\u{2212}1)");
        let moves: i32 = set
            .match_indices("dy=\"")
            .map(|(at, mark)| set[at + mark.len()..].split('"').next().expect("a quote"))
            .map(|number| number.parse::<i32>().expect("a number"))
            .sum();
        assert_eq!(moves, 0, "{set}");
        assert!(set.contains("italic"), "{set}");
    }
}
