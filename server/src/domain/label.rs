//! What people call a sweep by: its name, its tags, its note, and how urgent it is. No run depends on it.

use super::refusal::Refusal;
use serde::{Deserialize, Deserializer};
use utoipa::ToSchema;

/// Longest name of a sweep, in characters.
const MAX_NAME: usize = 200;
/// Most tags of a sweep.
const MAX_TAGS: usize = 20;
/// Longest tag, in characters.
const MAX_TAG: usize = 50;
/// Largest priority, and the smallest with the other sign.
const MAX_PRIORITY: i64 = 100;
/// Longest note, in characters.
const MAX_NOTE: usize = 20_000;

/// What is to be changed of a sweep; what is not given stays as it is.
#[derive(Debug, Clone, Default, PartialEq, Eq, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Edit {
    /// Its name, of up to 200 characters.
    #[serde(default, deserialize_with = "given")]
    #[schema(nullable = false)]
    pub name: Option<String>,
    /// All its tags.
    #[serde(default, deserialize_with = "given")]
    #[schema(nullable = false)]
    pub tags: Option<Vec<String>>,
    /// Tags to add to those there are, in place of `tags`.
    #[serde(default, deserialize_with = "given")]
    #[schema(nullable = false)]
    pub add_tags: Option<Vec<String>>,
    /// Tags to take away from those there are, in place of `tags`.
    #[serde(default, deserialize_with = "given")]
    #[schema(nullable = false)]
    pub remove_tags: Option<Vec<String>>,
    /// A note in Markdown, of up to 20,000 characters; an empty one or null takes it away.
    #[serde(default, deserialize_with = "given")]
    #[schema(value_type = Option<String>)]
    pub note: Option<Option<String>>,
    /// Sweeps with a higher one are solved first: a whole number from -100 to 100.
    #[serde(default, deserialize_with = "given")]
    #[schema(nullable = false)]
    pub priority: Option<i64>,
}

/// What is there is given, also null, which only a note may be.
fn given<'de, T: Deserialize<'de>, D: Deserializer<'de>>(d: D) -> Result<Option<T>, D::Error> {
    T::deserialize(d).map(Some)
}

impl Edit {
    /// Reads and checks an edit, JSON.
    pub fn parse(text: &[u8]) -> Result<Self, Refusal> {
        // A list would be taken for the members in their order.
        if text.trim_ascii_start().first().is_some_and(|first| *first != b'{') {
            return Err(Refusal::sentence("an edit is an object, such as {\"tags\": [\"paper\"]}"));
        }
        let mut json = serde_json::Deserializer::from_slice(text);
        let edit: Self = serde_path_to_error::deserialize(&mut json).map_err(|e| {
            let (path, inner) = (e.path().to_string(), e.inner().to_string());
            let field = Some(path).filter(|path| ![".", "?"].contains(&path.as_str()));
            Refusal { field, ..Refusal::sentence(inner) }
        })?;
        json.end().map_err(|e| Refusal::sentence(e.to_string()))?;
        edit.check()?;
        Ok(edit)
    }

    /// Checks every member that is given.
    pub fn check(&self) -> Result<(), Refusal> {
        self.name.as_deref().map_or(Ok(()), check_name)?;
        self.tags.as_deref().map_or(Ok(()), check_tags)?;
        for (field, tags) in [("add_tags", &self.add_tags), ("remove_tags", &self.remove_tags)] {
            if self.tags.is_some() && tags.is_some() {
                return Err(Refusal::out_of_place(field, "`tags` says them all"));
            }
            tags.as_deref().map_or(Ok(()), check_tags)?;
        }
        self.priority.map_or(Ok(()), check_priority)?;
        let note = self.note.iter().flatten().map(|note| note.chars().count()).max();
        match note.filter(|length| *length > MAX_NOTE) {
            Some(length) => {
                Err(Refusal::value("note", length, format!("at most {MAX_NOTE} characters")))
            }
            None => Ok(()),
        }
    }

    /// Whether it changes nothing.
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    /// The same for a sweep that has these tags: with all that it is to have.
    pub fn on(&self, tags: &[String]) -> Result<Self, Refusal> {
        let (add, remove) = (self.add_tags.as_deref(), self.remove_tags.as_deref());
        if add.is_none() && remove.is_none() {
            return Ok(self.clone());
        }
        let (add, remove) = (add.unwrap_or_default(), remove.unwrap_or_default());
        let kept = tags.iter().filter(|tag| !add.contains(tag)).chain(add);
        let tags: Vec<String> = kept.filter(|tag| !remove.contains(tag)).cloned().collect();
        check_tags(&tags)?;
        Ok(Self { tags: Some(tags), add_tags: None, remove_tags: None, ..self.clone() })
    }

    /// Whether it does nothing but add tags to those there are.
    pub fn only_adds_to(&self, tags: &[String]) -> bool {
        let rest = Self { tags: None, ..self.clone() };
        let kept = self.tags.as_ref().is_some_and(|now| tags.iter().all(|tag| now.contains(tag)));
        rest.is_empty() && kept
    }

    /// What it changes, in a line for the audit trail.
    pub fn sentence(&self) -> String {
        let note = self.note.as_ref().map(|note| match note.as_deref().unwrap_or_default() {
            "" => "note taken away".to_owned(),
            note => format!("note of {} characters", note.chars().count()),
        });
        let parts = [
            self.name.as_ref().map(|name| format!("name {name:?}")),
            self.tags.as_ref().map(|tags| match tags.as_slice() {
                [] => "no tags".to_owned(),
                tags => format!("tags {}", tags.join(" ")),
            }),
            note,
            self.priority.map(|priority| format!("priority {priority}")),
        ];
        parts.into_iter().flatten().collect::<Vec<_>>().join(", ")
    }
}

/// Checks the name of a sweep.
pub fn check_name(name: &str) -> Result<(), Refusal> {
    let length = name.chars().count();
    if length > MAX_NAME {
        let permitted = format!("at most {MAX_NAME} characters");
        return Err(Refusal::value("name", length, permitted));
    }
    if name.chars().any(char::is_control) {
        let permitted = "one line, without control characters";
        return Err(Refusal::value("name", name, permitted));
    }
    Ok(())
}

/// Checks the tags of a sweep.
pub fn check_tags(tags: &[String]) -> Result<(), Refusal> {
    if tags.len() > MAX_TAGS {
        let permitted = format!("at most {MAX_TAGS} tags");
        return Err(Refusal::value("tags", tags.len(), permitted));
    }
    for (i, tag) in tags.iter().enumerate() {
        let field = format!("tags[{i}]");
        let is_plain = tag.chars().all(|c| c.is_alphanumeric() || "_-.:".contains(c));
        if !is_plain || !(1..=MAX_TAG).contains(&tag.chars().count()) {
            let permitted = format!("1 to {MAX_TAG} letters, digits, `_`, `-`, `.` and `:`");
            return Err(Refusal::value(field, tag.as_str(), permitted));
        }
        if tags[..i].contains(tag) {
            return Err(Refusal::value(field, tag.as_str(), "each tag once"));
        }
    }
    Ok(())
}

/// Checks the priority of a sweep.
pub fn check_priority(priority: i64) -> Result<(), Refusal> {
    if (-MAX_PRIORITY..=MAX_PRIORITY).contains(&priority) {
        return Ok(());
    }
    let permitted = format!("a whole number from -{MAX_PRIORITY} to {MAX_PRIORITY}");
    Err(Refusal::value("priority", priority, permitted))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_edit_says_what_it_changes_and_refuses_the_rest() {
        let edit = Edit::parse(br#"{"tags": ["good"], "note": null, "priority": 3}"#).expect("one");
        assert_eq!(edit.sentence(), "tags good, note taken away, priority 3");
        assert_eq!(edit.note, Some(None));
        assert!(Edit::parse(b"{}").expect("one").is_empty());
        for (text, field) in [
            (r#"{"owner": "bo"}"#, Some("owner")),
            (r#"{"name": null}"#, Some("name")),
            (r#"{"tags": ["a b"]}"#, Some("tags[0]")),
            (r#"{"tags": ["a", "a"]}"#, Some("tags[1]")),
            (r#"{"priority": 101}"#, Some("priority")),
            (r#"{"priority": 1.5}"#, Some("priority")),
            (r#"{"name": "x"} {"#, None),
            ("", None),
            ("[]", None),
        ] {
            let refusal = Edit::parse(text.as_bytes()).expect_err(text);
            assert_eq!(refusal.field.as_deref(), field, "{text}: {refusal}");
        }
        let tags = |text: &str| Edit::parse(text.as_bytes()).expect("one");
        assert!(tags(r#"{"tags": ["a", "b"]}"#).only_adds_to(&["a".into()]));
        assert!(!tags(r#"{"tags": ["b"]}"#).only_adds_to(&["a".into()]));
        assert!(!tags(r#"{"tags": ["a"], "name": "x"}"#).only_adds_to(&["a".into()]));
        assert!(!tags("{}").only_adds_to(&[]));
        let long = format!(r#"{{"note": "{}"}}"#, "é".repeat(MAX_NOTE + 1));
        assert_eq!(Edit::parse(long.as_bytes()).expect_err("long").field.as_deref(), Some("note"));
    }
}
