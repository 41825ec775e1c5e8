//! What a sealed ensemble is cited by: title, authors, licence. Pure: knows neither files nor the database.

use super::refusal::Refusal;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// What whoever seals a sweep says of it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SealForm {
    /// Title of the ensemble.
    pub title: String,
    /// Its authors, in the order of the citation.
    pub authors: Vec<Author>,
    /// SPDX id of its licence, such as `CC-BY-4.0`.
    pub licence: String,
    /// What it is, in some sentences.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub description: Option<String>,
}

/// An author.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Author {
    /// `Given Family` or `Family, Given`; a single word is an organisation's name, and so is what stands in braces:
    /// `{University of Oslo}`.
    pub name: String,
    /// ORCID, such as `0000-0002-1825-0097`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub orcid: Option<String>,
    /// Where they work.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub affiliation: Option<String>,
}

/// A seal: what a sweep is cited by, and what holds it together.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct Seal {
    /// When it was sealed, RFC 3339 in UTC.
    pub sealed_at: String,
    /// Who sealed it.
    pub sealed_by: String,
    /// Hash of its data: the same numbers in the same files have the same hash, wherever they are.
    pub content_hash: String,
    /// Version of melange that sealed it.
    pub melange_version: String,
    /// What it is cited by.
    #[serde(flatten)]
    pub form: SealForm,
}

impl Seal {
    /// The day it was sealed, `YYYY-MM-DD`.
    pub fn day(&self) -> &str {
        self.sealed_at.get(..10).unwrap_or(&self.sealed_at)
    }
}

/// A licence that data can have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Licence {
    /// SPDX id.
    pub id: &'static str,
    /// Name.
    pub name: &'static str,
    /// Where it stands.
    pub url: &'static str,
}

/// The licences known.
pub const LICENCES: [Licence; 7] = [
    Licence {
        id: "CC-BY-4.0",
        name: "Creative Commons Attribution 4.0 International",
        url: "https://creativecommons.org/licenses/by/4.0/",
    },
    Licence {
        id: "CC0-1.0",
        name: "Creative Commons Zero v1.0 Universal",
        url: "https://creativecommons.org/publicdomain/zero/1.0/",
    },
    Licence {
        id: "CC-BY-SA-4.0",
        name: "Creative Commons Attribution Share Alike 4.0 International",
        url: "https://creativecommons.org/licenses/by-sa/4.0/",
    },
    Licence {
        id: "CC-BY-NC-4.0",
        name: "Creative Commons Attribution Non Commercial 4.0 International",
        url: "https://creativecommons.org/licenses/by-nc/4.0/",
    },
    Licence {
        id: "ODC-By-1.0",
        name: "Open Data Commons Attribution License v1.0",
        url: "https://opendatacommons.org/licenses/by/1-0/",
    },
    Licence {
        id: "ODbL-1.0",
        name: "Open Data Commons Open Database License v1.0",
        url: "https://opendatacommons.org/licenses/odbl/1-0/",
    },
    Licence {
        id: "PDDL-1.0",
        name: "Open Data Commons Public Domain Dedication & License 1.0",
        url: "https://opendatacommons.org/licenses/pddl/1-0/",
    },
];

/// The licence of an SPDX id.
pub fn licence(id: &str) -> Option<Licence> {
    LICENCES.into_iter().find(|licence| licence.id == id)
}

/// Longest title, name and affiliation, in characters.
const LINE: usize = 300;
/// Longest description, in characters.
const TEXT: usize = 10_000;
/// Most authors.
const AUTHORS: usize = 200;
/// How an ORCID begins when it is written as an address.
pub const ORCID_ADDRESS: &str = "https://orcid.org/";

impl SealForm {
    /// The form with spaces trimmed and ORCIDs bare; refused where it cannot be cited.
    pub fn checked(mut self) -> Result<Self, Refusal> {
        self.title = line("title", &self.title)?;
        if !(1..=AUTHORS).contains(&self.authors.len()) {
            let permitted = format!("from 1 to {AUTHORS} authors");
            return Err(Refusal::value("authors", self.authors.len(), permitted));
        }
        for i in 0..self.authors.len() {
            let author = self.authors[i].checked(&format!("authors[{i}]"))?;
            let known = &self.authors[..i];
            let is_same = |a: &Author| {
                a.name == author.name || (a.orcid.is_some() && a.orcid == author.orcid)
            };
            if known.iter().any(is_same) {
                let field = format!("authors[{i}]");
                return Err(Refusal::value(field, author.name, "each author once"));
            }
            self.authors[i] = author;
        }
        if licence(&self.licence).is_none() {
            let permitted = LICENCES.map(|l| l.id).join(", ");
            return Err(Refusal::value("licence", self.licence, permitted));
        }
        if let Some(text) = &self.description {
            let is_plain = text.chars().all(|c| c == '\n' || !c.is_control());
            if !is_plain || text.chars().count() > TEXT {
                let permitted =
                    format!("at most {TEXT} characters without control characters but line ends");
                return Err(Refusal::value("description", text.chars().count(), permitted));
            }
            let trimmed = text.trim().to_owned();
            self.description = Some(trimmed).filter(|text| !text.is_empty());
        }
        Ok(self)
    }
}

impl Author {
    /// The name of an organisation of several words, which stands in braces: `{University of Oslo}`.
    pub fn organisation(&self) -> Option<&str> {
        self.name.strip_prefix('{')?.strip_suffix('}').map(str::trim)
    }

    fn checked(&self, field: &str) -> Result<Self, Refusal> {
        let name = line(&format!("{field}.name"), &self.name)?;
        let is_organisation = name.starts_with('{') && name.ends_with('}') && name.len() > 2;
        let parts: Vec<&str> = name.split(',').map(str::trim).collect();
        if !is_organisation && name.contains(['{', '}']) {
            let permitted = "braces around the whole name of an organisation, and nowhere else";
            return Err(Refusal::value(format!("{field}.name"), name, permitted));
        }
        if parts.len() > 2 && !is_organisation || parts.iter().any(|part| part.is_empty()) {
            let permitted = "`Given Family` or `Family, Given`";
            return Err(Refusal::value(format!("{field}.name"), name, permitted));
        }
        let affiliation = self.affiliation.as_deref();
        let affiliation = affiliation.map(|a| line(&format!("{field}.affiliation"), a));
        let orcid = self.orcid.as_deref().map(|orcid| {
            let bare = orcid.trim().trim_start_matches(ORCID_ADDRESS);
            if is_orcid(bare) {
                return Ok(bare.to_owned());
            }
            let permitted =
                "an ORCID, such as 0000-0002-1825-0097, whose last digit fits the others";
            Err(Refusal::value(format!("{field}.orcid"), orcid, permitted))
        });
        Ok(Self { name, orcid: orcid.transpose()?, affiliation: affiliation.transpose()? })
    }
}

/// One line of text, trimmed.
fn line(field: &str, text: &str) -> Result<String, Refusal> {
    let trimmed = text.trim();
    let fits = (1..=LINE).contains(&trimmed.chars().count());
    if fits && !trimmed.chars().any(char::is_control) {
        return Ok(trimmed.to_owned());
    }
    let permitted = format!("one line of 1 to {LINE} characters");
    Err(Refusal::value(field, trimmed.chars().take(LINE).collect::<String>(), permitted))
}

/// Whether four groups of four digits end with the check digit of ISO 7064, mod 11-2.
fn is_orcid(text: &str) -> bool {
    let groups: Vec<&str> = text.split('-').collect();
    if groups.len() != 4 || groups.iter().any(|g| g.len() != 4 || !g.is_ascii()) {
        return false;
    }
    let digits: String = groups.concat();
    let (first, last) = digits.split_at(15);
    if !first.bytes().all(|b| b.is_ascii_digit()) {
        return false;
    }
    let sum = first.bytes().fold(0, |sum, b| (sum + u32::from(b - b'0')) * 2 % 11);
    let check = (12 - sum % 11) % 11;
    last == if check == 10 { "X".to_owned() } else { check.to_string() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn form(name: &str, orcid: Option<&str>) -> SealForm {
        let author =
            Author { name: name.into(), orcid: orcid.map(str::to_owned), affiliation: None };
        SealForm {
            title: " Melt ".into(),
            authors: vec![author],
            licence: "CC-BY-4.0".into(),
            description: None,
        }
    }

    fn field(form: SealForm) -> Option<String> {
        form.checked().expect_err("refused").field
    }

    #[test]
    fn orcids_fit_their_check_digit() {
        for orcid in ["0000-0002-1825-0097", "0000-0001-5109-3700", "0000-0002-1694-233X"] {
            assert!(is_orcid(orcid), "{orcid}");
        }
        for orcid in [
            "0000-0002-1825-0098",
            "0000-0002-1694-2330",
            "0000-0002-1694-233x",
            "0000000218250097",
            "0000-0002-1825-009",
            "000a-0002-1825-0097",
            "",
        ] {
            assert!(!is_orcid(orcid), "{orcid}");
        }
        let with_address = form("Ada", Some("https://orcid.org/0000-0002-1825-0097"));
        let checked = with_address.checked().expect("a form");
        assert_eq!(checked.authors[0].orcid.as_deref(), Some("0000-0002-1825-0097"));
        assert_eq!(checked.title, "Melt");
    }

    #[test]
    fn what_cannot_be_cited_is_refused_with_its_field() {
        assert_eq!(field(form("", None)).as_deref(), Some("authors[0].name"));
        assert_eq!(field(form("a, b, c", None)).as_deref(), Some("authors[0].name"));
        assert_eq!(field(form("A\nB", None)).as_deref(), Some("authors[0].name"));
        assert_eq!(field(form("A B", Some("1"))).as_deref(), Some("authors[0].orcid"));
        let nobody = SealForm { authors: Vec::new(), ..form("A B", None) };
        assert_eq!(field(nobody).as_deref(), Some("authors"));
        let twice = form("A B", None);
        let twice = SealForm { authors: vec![twice.authors[0].clone(); 2], ..twice };
        assert_eq!(field(twice).as_deref(), Some("authors[1]"));
        let unlicensed = SealForm { licence: "mine".into(), ..form("A B", None) };
        assert_eq!(field(unlicensed).as_deref(), Some("licence"));
        let untitled = SealForm { title: "  ".into(), ..form("A B", None) };
        assert_eq!(field(untitled).as_deref(), Some("title"));
    }
}
