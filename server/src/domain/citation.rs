//! How a sealed ensemble is cited: BibTeX, CSL-JSON and one sentence, each with the paper of the model beside
//! it. Pure.

use super::seal::{Author, Seal, licence};
use serde::Deserialize;
use serde_json::{Value, json};
use utoipa::ToSchema;

/// How a citation is written.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum CitationFormat {
    /// BibTeX, in UTF-8; `@dataset` is BibLaTeX's, which others read as `@misc`.
    #[default]
    Bibtex,
    /// CSL-JSON.
    Csl,
    /// One sentence each.
    Text,
}

impl CitationFormat {
    /// Its media type.
    pub fn media_type(self) -> &'static str {
        match self {
            Self::Bibtex => "application/x-bibtex; charset=utf-8",
            Self::Csl => "application/vnd.citationstyles.csl+json",
            Self::Text => "text/plain; charset=utf-8",
        }
    }
}

/// The paper of the model.
pub mod paper {
    /// Its title.
    pub const TITLE: &str = "A quasi-one-dimensional ice mélange flow model based on continuum descriptions of \
                             granular materials";
    /// Its authors: given and family names.
    pub const AUTHORS: [(&str, &str); 4] = [
        ("Jason M.", "Amundson"),
        ("Alexander A.", "Robel"),
        ("Justin C.", "Burton"),
        ("Kavinda", "Nissanka"),
    ];
    /// Where it was printed.
    pub const JOURNAL: &str = "The Cryosphere";
    /// Volume.
    pub const VOLUME: &str = "19";
    /// Year.
    pub const YEAR: u16 = 2025;
    /// First and last page.
    pub const PAGES: (&str, &str) = ("19", "35");
    /// DOI.
    pub const DOI: &str = "10.5194/tc-19-19-2025";
}

/// The citation of a sealed ensemble and of the paper.
pub fn citation(seal: &Seal, format: CitationFormat) -> String {
    match format {
        CitationFormat::Bibtex => format!("{}\n{}", bibtex(seal), bibtex_of_paper()),
        CitationFormat::Csl => {
            let items = json!([csl(seal), csl_of_paper()]);
            serde_json::to_string_pretty(&items).unwrap_or_default() + "\n"
        }
        CitationFormat::Text => format!("{}\n{}\n", text(seal), text_of_paper()),
    }
}

/// A name in its parts.
#[derive(Debug, Clone, PartialEq, Eq)]
enum Name<'a> {
    Person { particle: String, family: String, given: &'a str },
    Organisation(&'a str),
}

/// `Family, Given`, or `Given Family` where words that begin with a small letter before the last word belong
/// to the family's name.
fn parts(author: &Author) -> Name<'_> {
    if let Some(name) = author.organisation() {
        return Name::Organisation(name);
    }
    let name = author.name.as_str();
    let (given, family) = match name.split_once(',') {
        Some((family, given)) => (given.trim(), family.trim()),
        None => {
            let words: Vec<(usize, &str)> = name
                .split_whitespace()
                .map(|w| (w.as_ptr() as usize - name.as_ptr() as usize, w))
                .collect();
            let Some((last, _)) = words.last().filter(|_| words.len() > 1) else {
                return Name::Organisation(name);
            };
            let first_particle = words[1..words.len() - 1]
                .iter()
                .find(|(_, word)| is_particle(word))
                .map_or(*last, |(at, _)| *at);
            (name[..first_particle].trim(), name[first_particle..].trim())
        }
    };
    let words: Vec<&str> = family.split_whitespace().collect();
    let particles = words.iter().take(words.len() - 1).take_while(|w| is_particle(w)).count();
    let (particle, family) = (words[..particles].join(" "), words[particles..].join(" "));
    Name::Person { particle, family, given }
}

fn is_particle(word: &str) -> bool {
    // `and` is never part of a name of one person.
    word != "and" && word.chars().next().is_some_and(char::is_lowercase)
}

/// A text as TeX prints it. Braces are named, since BibTeX counts them even behind a backslash.
fn tex(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' | '%' | '$' | '#' | '_' => {
                escaped.push('\\');
                escaped.push(c);
            }
            '\\' => escaped.push_str("\\textbackslash{}"),
            '{' => escaped.push_str("\\textbraceleft{}"),
            '}' => escaped.push_str("\\textbraceright{}"),
            '~' => escaped.push_str("\\textasciitilde{}"),
            '^' => escaped.push_str("\\textasciicircum{}"),
            '<' => escaped.push_str("\\textless{}"),
            '>' => escaped.push_str("\\textgreater{}"),
            '|' => escaped.push_str("\\textbar{}"),
            '"' => escaped.push_str("\\textquotedbl{}"),
            c => escaped.push(c),
        }
    }
    escaped
}

fn bibtex_name(author: &Author) -> String {
    match parts(author) {
        Name::Organisation(name) => format!("{{{}}}", tex(name)),
        Name::Person { particle, family, given } => {
            // A lone `and` or a comma would part names; braces keep them.
            let guarded = |text: &str| {
                let is_odd = text.split_whitespace().any(|w| w.eq_ignore_ascii_case("and"));
                if is_odd { format!("{{{}}}", tex(text)) } else { tex(text) }
            };
            let space = if particle.is_empty() { "" } else { " " };
            format!("{}{space}{}, {}", guarded(&particle), guarded(&family), guarded(given))
        }
    }
}

/// The first characters of the content hash, for keys and versions.
fn short_hash(seal: &Seal) -> &str {
    seal.content_hash.get(..12).unwrap_or(&seal.content_hash)
}

/// Key of the entry: plain letters of the first family name, year and hash.
fn key(seal: &Seal) -> String {
    let first = seal.form.authors.first().map(|author| match parts(author) {
        Name::Person { family, .. } => family,
        Name::Organisation(name) => name.to_owned(),
    });
    let plain: String =
        first.unwrap_or_default().chars().filter(char::is_ascii_alphabetic).collect();
    let name = if plain.is_empty() { "melange".to_owned() } else { plain.to_lowercase() };
    format!("{name}{}_{}", &seal.day()[..4.min(seal.day().len())], short_hash(seal))
}

fn note(seal: &Seal) -> String {
    let licence = &seal.form.licence;
    let (version, hash) = (&seal.melange_version, &seal.content_hash);
    format!(
        "Ensemble computed with melange {version}; content hash (BLAKE3) {hash}; licence {licence}"
    )
}

fn entry(kind: &str, key: &str, fields: &[(&str, String)]) -> String {
    let mut text = format!("@{kind}{{{key},\n");
    for (name, value) in fields {
        text += &format!("  {name} = {{{value}}},\n");
    }
    text + "}\n"
}

fn bibtex(seal: &Seal) -> String {
    let authors: Vec<String> = seal.form.authors.iter().map(bibtex_name).collect();
    let (year, month) = (seal.day().get(..4), seal.day().get(5..7));
    let fields = [
        ("author", authors.join(" and ")),
        // Its capitals stay.
        ("title", format!("{{{}}}", tex(&seal.form.title))),
        ("year", year.unwrap_or_default().to_owned()),
        ("month", month.unwrap_or_default().trim_start_matches('0').to_owned()),
        ("version", short_hash(seal).to_owned()),
        ("note", tex(&note(seal))),
    ];
    entry("dataset", &key(seal), &fields)
}

fn bibtex_of_paper() -> String {
    let authors = paper::AUTHORS.map(|(given, family)| format!("{family}, {given}"));
    let fields = [
        ("author", authors.join(" and ")),
        ("title", tex(paper::TITLE)),
        ("journal", paper::JOURNAL.to_owned()),
        ("volume", paper::VOLUME.to_owned()),
        ("pages", format!("{}--{}", paper::PAGES.0, paper::PAGES.1)),
        ("year", paper::YEAR.to_string()),
        ("doi", paper::DOI.to_owned()),
    ];
    entry("article", "amundson2025", &fields)
}

fn csl_name(author: &Author) -> Value {
    match parts(author) {
        Name::Organisation(name) => json!({ "literal": name }),
        Name::Person { particle, family, given } if particle.is_empty() => {
            json!({ "family": family, "given": given })
        }
        Name::Person { particle, family, given } => {
            json!({ "family": family, "given": given, "non-dropping-particle": particle })
        }
    }
}

fn csl(seal: &Seal) -> Value {
    let day: Vec<u16> = seal.day().split('-').filter_map(|part| part.parse().ok()).collect();
    let mut item = json!({
        "id": key(seal),
        "type": "dataset",
        "title": seal.form.title,
        "author": seal.form.authors.iter().map(csl_name).collect::<Vec<Value>>(),
        "issued": { "date-parts": [day] },
        "version": short_hash(seal),
        "note": note(seal),
    });
    if let Some(description) = &seal.form.description {
        item["abstract"] = description.as_str().into();
    }
    item
}

fn csl_of_paper() -> Value {
    let authors = paper::AUTHORS.map(|(given, family)| json!({ "family": family, "given": given }));
    json!({
        "id": "amundson2025",
        "type": "article-journal",
        "title": paper::TITLE,
        "author": authors,
        "container-title": paper::JOURNAL,
        "volume": paper::VOLUME,
        "page": format!("{}-{}", paper::PAGES.0, paper::PAGES.1),
        "issued": { "date-parts": [[paper::YEAR]] },
        "DOI": paper::DOI,
    })
}

fn text(seal: &Seal) -> String {
    let name = |author: &Author| match parts(author) {
        Name::Organisation(name) => name.to_owned(),
        Name::Person { particle, family, given } => {
            let space = if particle.is_empty() { "" } else { " " };
            format!("{particle}{space}{family}, {given}")
        }
    };
    let authors: Vec<String> = seal.form.authors.iter().map(name).collect();
    let year = seal.day().get(..4).unwrap_or_default();
    let known = licence(&seal.form.licence).map_or("", |licence| licence.id);
    format!(
        "{} ({year}): {} [data set], computed with melange {}, licence {known}, BLAKE3 {}.",
        authors.join("; "),
        seal.form.title,
        seal.melange_version,
        seal.content_hash
    )
}

fn text_of_paper() -> String {
    let authors = paper::AUTHORS.map(|(given, family)| format!("{family}, {given}"));
    format!(
        "{} ({}): {}, {}, {}, {}–{}, https://doi.org/{}.",
        authors.join("; "),
        paper::YEAR,
        paper::TITLE,
        paper::JOURNAL,
        paper::VOLUME,
        paper::PAGES.0,
        paper::PAGES.1,
        paper::DOI
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::seal::SealForm;

    fn seal(names: &[&str], title: &str) -> Seal {
        let author = |name: &&str| Author {
            name: (*name).to_owned(),
            orcid: Some("0000-0002-1825-0097".into()),
            affiliation: None,
        };
        Seal {
            sealed_at: "2026-03-04T05:06:07.000Z".into(),
            sealed_by: "ada".into(),
            content_hash: "0123456789abcdef".repeat(4),
            melange_version: "0.1.0".into(),
            form: SealForm {
                title: title.into(),
                authors: names.iter().map(author).collect(),
                licence: "CC-BY-4.0".into(),
                description: None,
            },
        }
    }

    #[test]
    fn names_have_their_parts() {
        let told = |name: &str| {
            let author = Author { name: name.into(), orcid: None, affiliation: None };
            bibtex_name(&author)
        };
        for (name, expected) in [
            ("Ada Lovelace", "Lovelace, Ada"),
            ("Lovelace, Ada", "Lovelace, Ada"),
            ("Roderik S. W. van de Wal", "van de Wal, Roderik S. W."),
            ("van de Wal, Roderik", "van de Wal, Roderik"),
            ("Óscar Núñez Álvarez", "Álvarez, Óscar Núñez"),
            ("Núñez Álvarez, Óscar", "Núñez Álvarez, Óscar"),
            ("ETH", "{ETH}"),
            ("{University of Oslo}", "{University of Oslo}"),
            ("Smith and Jones", "Jones, {Smith and}"),
            ("Lamb & Co", "Co, Lamb \\&"),
            ("Smith and Sons, The", "{Smith and Sons}, The"),
            ("Łukasz Żuk-Ω", "Żuk-Ω, Łukasz"),
        ] {
            assert_eq!(told(name), expected);
        }
    }

    #[test]
    fn tex_is_escaped_and_its_braces_balance() {
        let wild = r#"50 % of $x_1 & {y} \ ~^#"<|>"#;
        let told = tex(wild);
        let expected = concat!(
            r"50 \% of \$x\_1 \& \textbraceleft{}y\textbraceright{} \textbackslash{} ",
            r"\textasciitilde{}\textasciicircum{}\#\textquotedbl{}\textless{}\textbar{}\textgreater{}"
        );
        assert_eq!(told, expected);
        let text = citation(&seal(&["A {B"], wild), CitationFormat::Bibtex);
        let mut depth = 0_i32;
        for c in text.chars() {
            depth += i32::from(c == '{') - i32::from(c == '}');
            assert!(depth >= 0, "{text}");
        }
        assert_eq!(depth, 0, "{text}");
    }

    #[test]
    fn a_bibtex_entry_has_what_it_needs() {
        let text =
            citation(&seal(&["Ada Lovelace", "Li Wei"], "Melt sweep"), CitationFormat::Bibtex);
        let expected = "@dataset{lovelace2026_0123456789ab,\n  author = {Lovelace, Ada and Wei, Li},\n  \
                        title = {{Melt sweep}},\n  year = {2026},\n  month = {3},\n  version = {0123456789ab},\n";
        assert!(text.starts_with(expected), "{text}");
        assert!(text.contains("doi = {10.5194/tc-19-19-2025}"), "{text}");
    }

    #[test]
    fn csl_is_json_with_typed_names_and_dates() {
        let text = citation(&seal(&["Jan van der Berg", "ETH"], "T"), CitationFormat::Csl);
        let items: Value = serde_json::from_str(&text).expect("JSON");
        let authors = &items[0]["author"];
        assert_eq!(authors[0]["family"], "Berg");
        assert_eq!(authors[0]["non-dropping-particle"], "van der");
        assert_eq!(authors[0]["given"], "Jan");
        assert_eq!(authors[1]["literal"], "ETH");
        assert_eq!(items[0]["issued"]["date-parts"][0], json!([2026, 3, 4]));
        assert_eq!(items[1]["DOI"], paper::DOI);
    }
}
