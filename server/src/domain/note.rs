//! Notes: Markdown as it was written, HTML as it is shown. Whoever writes a note is not trusted: what is shown
//! has no scripts, no styles, no pictures and nothing that is fetched from elsewhere.

use ammonia::Builder;
use pulldown_cmark::{CowStr, Event, HeadingLevel, Options, Parser, Tag, TagEnd, html};
use std::sync::LazyLock;

/// Lists, quotations and the like within each other; what is deeper is shown without its frame.
const MAX_DEPTH: usize = 16;

/// What may be shown.
static CLEANER: LazyLock<Builder<'static>> = LazyLock::new(|| {
    let mut builder = Builder::empty();
    builder
        .add_tags([
            "a",
            "blockquote",
            "br",
            "code",
            "del",
            "em",
            "h3",
            "h4",
            "h5",
            "h6",
            "hr",
            "li",
            "ol",
            "p",
            "pre",
            "strong",
            "table",
            "tbody",
            "td",
            "th",
            "thead",
            "tr",
            "ul",
        ])
        .add_tag_attributes("a", ["href", "title"])
        .add_tag_attributes("ol", ["start"])
        .add_url_schemes(["http", "https", "mailto"])
        .url_relative(ammonia::UrlRelative::Deny)
        .link_rel(Some("nofollow noopener"));
    builder
});

/// A note as HTML to be shown within a page. HTML that is written in it is shown as text, a picture as a link to
/// it, headings below those of a page.
pub fn html(markdown: &str) -> String {
    let options = Options::ENABLE_TABLES | Options::ENABLE_STRIKETHROUGH;
    let mut depth = 0_usize;
    let events = Parser::new_ext(markdown, options).filter_map(|event| match event {
        Event::Html(text) | Event::InlineHtml(text) => Some(Event::Text(text)),
        Event::Start(tag) => {
            depth += 1;
            (depth <= MAX_DEPTH).then(|| Event::Start(shown(tag)))
        }
        Event::End(tag) => {
            let is_shown = depth <= MAX_DEPTH;
            depth = depth.saturating_sub(1);
            is_shown.then(|| Event::End(shown_end(tag)))
        }
        event => Some(event),
    });
    let mut text = String::with_capacity(markdown.len() * 3 / 2);
    html::push_html(&mut text, events);
    CLEANER.clean(&text).to_string()
}

fn shown(tag: Tag<'_>) -> Tag<'_> {
    match tag {
        Tag::Heading { level, .. } => {
            Tag::Heading { level: lower(level), id: None, classes: Vec::new(), attrs: Vec::new() }
        }
        Tag::Image { link_type, dest_url, title, .. } => {
            Tag::Link { link_type, dest_url, title, id: CowStr::Borrowed("") }
        }
        // Raw HTML stands in a block of its own.
        Tag::HtmlBlock => Tag::Paragraph,
        tag => tag,
    }
}

fn shown_end(tag: TagEnd) -> TagEnd {
    match tag {
        TagEnd::Heading(level) => TagEnd::Heading(lower(level)),
        TagEnd::Image => TagEnd::Link,
        TagEnd::HtmlBlock => TagEnd::Paragraph,
        tag => tag,
    }
}

/// Two levels lower: a page has its own first and second.
fn lower(level: HeadingLevel) -> HeadingLevel {
    match level {
        HeadingLevel::H1 => HeadingLevel::H3,
        HeadingLevel::H2 => HeadingLevel::H4,
        HeadingLevel::H3 => HeadingLevel::H5,
        _ => HeadingLevel::H6,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Instant;

    #[test]
    fn markdown_becomes_html() {
        let shown = html(
            "# Head\n\nSome *text* in **bold**, `code` and ~~gone~~.\n\n- a\n- b\n\n3. c\n\n| x | y |\n|---|---|\n| 1 | 2 |\n",
        );
        for part in [
            "<h3>Head</h3>",
            "<em>text</em>",
            "<strong>bold</strong>",
            "<code>code</code>",
            "<del>gone</del>",
            "<li>a</li>",
            "<ol start=\"3\">",
            "<td>1</td>",
        ] {
            assert!(shown.contains(part), "{part}: {shown}");
        }
        let shown = html("[the paper](https://example.org/a?b=1&c=2 \"title\")");
        assert!(shown.contains("href=\"https://example.org/a?b=1&amp;c=2\""), "{shown}");
        assert!(shown.contains("rel=\"nofollow noopener\""), "{shown}");
    }

    #[test]
    fn hostile_notes_are_shown_harmlessly() {
        for hostile in [
            "<script>alert(1)</script>",
            "text <script>alert(1)</script> text",
            "<img src=x onerror=alert(1)>",
            "a <img src=x onerror=alert(1)> b",
            "<svg onload=alert(1)><a xlink:href=\"javascript:alert(1)\"></svg>",
            "<iframe src=\"//elsewhere\"></iframe>",
            "<style>* { display: none }</style>",
            "<a href=\"javascript:alert(1)\" onclick=\"alert(1)\">x</a>",
            "[x](javascript:alert(1))",
            "[x](JaVaScRiPt:alert(1))",
            "[x](  java\nscript:alert(1))",
            "[x](&#106;avascript:alert(1))",
            "[x](javascript&colon;alert(1))",
            "[x](data:text/html;base64,PHNjcmlwdD4=)",
            "[x](vbscript:x)",
            "[x](file:///etc/passwd)",
            "[x](//elsewhere/x)",
            "[x](/api/v1/sweeps)",
            "<javascript:alert(1)>",
            "![x](https://elsewhere/x.png)",
            "![x](data:image/svg+xml;base64,PHN2Zz4=)",
            "![x](javascript:alert(1))",
            "[x]: javascript:alert(1)\n\n[x]",
            "[x](https://e.org \"\\\" onmouseover=alert(1) x=\\\"\")",
            "`<script>`</code><script>alert(1)</script>",
            "```html\" onload=\"alert(1)\n</code></pre><script>alert(1)</script>\n```",
            "| <script> |\n|---|\n| <b onclick=x> |",
            "<!-- --><script>alert(1)</script>",
            "<![CDATA[<script>alert(1)</script>]]>",
            "<math><mtext><table><mglyph><style><img src=x onerror=alert(1)>",
        ] {
            check(&html(hostile), hostile);
        }
        let shown = html("![a picture](https://example.org/x.png)");
        assert!(shown.contains("<a href=\"https://example.org/x.png\""), "{shown}");
    }

    /// Every tag and attribute in what is shown is one of those that are permitted.
    fn check(shown: &str, written: &str) {
        let mut rest = shown;
        while let Some(at) = rest.find('<') {
            let end = at + rest[at..].find('>').expect("tags are closed");
            let tag = &rest[at + 1..end];
            rest = &rest[end + 1..];
            let name: String = tag
                .trim_start_matches('/')
                .chars()
                .take_while(char::is_ascii_alphanumeric)
                .collect();
            assert!(CLEANER.clone_tags().contains(&name.as_str()), "{written}: {shown}");
            let attributes = tag.trim_start_matches('/')[name.len()..].trim();
            if attributes.is_empty() {
                continue;
            }
            match name.as_str() {
                "a" => assert!(
                    attributes.starts_with("href=\"https://")
                        || attributes.starts_with("title=")
                        || attributes.starts_with("rel="),
                    "{written}: {shown}"
                ),
                "ol" => assert!(attributes.starts_with("start=")),
                _ => panic!("{written}: {shown}"),
            }
            let outside: String = attributes.split('"').step_by(2).collect();
            assert!(!outside.contains("on"), "{written}: {shown}");
        }
    }

    #[test]
    fn what_is_nested_very_deeply_is_shown_flat_and_soon() {
        let begin = Instant::now();
        for hostile in [
            ">".repeat(20_000),
            "[".repeat(20_000),
            "*a ".repeat(6_000),
            "- ".repeat(10_000),
            "`".repeat(20_000),
            "<div>".repeat(4_000),
            "![".repeat(10_000),
            "_a*_".repeat(5_000),
            "[a](".repeat(5_000),
            "|a\n|-\n".to_owned() + &"|".repeat(19_000),
            (0..140).map(|i| format!("{}- a\n", "  ".repeat(i))).collect(),
        ] {
            let shown = html(&hostile);
            check(&shown, "much");
            let deepest = shown.split("<blockquote>").count() - 1;
            assert!(deepest <= MAX_DEPTH, "{deepest}");
        }
        assert!(begin.elapsed().as_secs() < 20, "{:?}", begin.elapsed());
    }
}
