//! How a document is read from JSON or TOML, and how an error in it gets its place and its value. A
//! table of a million rows is never held as a tree of values.

use super::document::Document;
use super::refusal::Refusal;
use serde::Deserialize;
use serde::de::{DeserializeSeed, Deserializer, Error, IgnoredAny, MapAccess, SeqAccess, Visitor};
use serde_json::Value;
use serde_path_to_error::{Path, Segment};
use std::fmt;

impl Document {
    /// Reads JSON if the first character is `{`, else TOML.
    pub fn parse(text: &str) -> Result<Self, Refusal> {
        // Some editors begin a file with a mark of its byte order.
        let text = text.trim_start_matches('\u{feff}');
        if text.trim_start().starts_with('{') { from_json(text) } else { from_toml(text) }
    }
}

fn from_json(text: &str) -> Result<Document, Refusal> {
    let sentence = |e: serde_json::Error| Refusal::sentence(e.to_string());
    let mut json = serde_json::Deserializer::from_str(text);
    let document: Document = serde_path_to_error::deserialize(&mut json).map_err(|e| {
        // Text that is no JSON has no members that an error could be in.
        if let Err(error) = serde_json::from_str::<IgnoredAny>(text) {
            return sentence(error);
        }
        let mut again = serde_json::Deserializer::from_str(text);
        located(e.path(), &e.inner().to_string(), found(e.path(), &mut again))
    })?;
    json.end().map_err(sentence)?;
    let written: Written = serde_json::from_str(text).map_err(sentence)?;
    check_forms(&written.0)?;
    Ok(document)
}

fn from_toml(text: &str) -> Result<Document, Refusal> {
    let sentence = |e: toml::de::Error| Refusal::sentence(e.to_string());
    let toml = toml::Deserializer::parse(text).map_err(sentence)?;
    let document: Document = serde_path_to_error::deserialize(toml).map_err(|e| {
        let value = toml::Deserializer::parse(text).ok().and_then(|again| found(e.path(), again));
        located(e.path(), e.inner().message(), value)
    })?;
    let written: Written = toml::from_str(text).map_err(sentence)?;
    check_forms(&written.0)?;
    Ok(document)
}

/// A member that does not fit, with the value found there; what is permitted is what the deserialiser
/// expected.
fn located(path: &Path, message: &str, value: Option<Value>) -> Refusal {
    let permitted = message.split_once("expected ").map(|(_, expected)| {
        let form = expected.split_once(" at line ").map_or(expected, |(form, _)| form);
        if ["i64", "u64"].contains(&form) { "a whole number" } else { form }.to_owned()
    });
    let path = path.to_string();
    if [".", "?"].contains(&path.as_str()) {
        return Refusal { permitted, ..Refusal::sentence(message) };
    }
    let given = value.as_ref().map_or_else(String::new, |v| format!(" = {v}"));
    let detail = format!("`{path}`{given} is refused: {message}");
    Refusal { detail, field: Some(path), value, permitted, character: None }
}

/// The value at a path of the text that `deserializer` reads, if there is one.
fn found<'de, D: Deserializer<'de>>(path: &Path, deserializer: D) -> Option<Value> {
    let steps: Vec<&Segment> = path.iter().collect();
    Pluck(&steps).deserialize(deserializer).ok().flatten()
}

/// Walks down a path and keeps nothing else.
struct Pluck<'a>(&'a [&'a Segment]);

impl<'de> DeserializeSeed<'de> for Pluck<'_> {
    type Value = Option<Value>;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Self::Value, D::Error> {
        if self.0.is_empty() {
            Value::deserialize(deserializer).map(Some)
        } else {
            deserializer.deserialize_any(self)
        }
    }
}

impl<'de> Visitor<'de> for Pluck<'_> {
    type Value = Option<Value>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("members or elements")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self::Value, A::Error> {
        let mut plucked = None;
        while let Some(name) = map.next_key::<String>()? {
            match self.0[0] {
                Segment::Map { key } if *key == name => {
                    plucked = map.next_value_seed(Pluck(&self.0[1..]))?;
                }
                _ => {
                    map.next_value::<IgnoredAny>()?;
                }
            }
        }
        Ok(plucked)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut elements: A) -> Result<Self::Value, A::Error> {
        let Segment::Seq { index } = self.0[0] else {
            return Err(A::Error::custom("the path leads to a member, and these are elements"));
        };
        for _ in 0..*index {
            elements.next_element::<IgnoredAny>()?;
        }
        let plucked = elements.next_element_seed(Pluck(&self.0[1..]))?.flatten();
        while elements.next_element::<IgnoredAny>()?.is_some() {}
        Ok(plucked)
    }
}

/// A document as it is written, without its table, whose form its own type checks.
struct Written(Value);

impl<'de> Deserialize<'de> for Written {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Members;
        impl<'de> Visitor<'de> for Members {
            type Value = Written;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("members by name")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Written, A::Error> {
                let mut members = serde_json::Map::new();
                while let Some(name) = map.next_key::<String>()? {
                    if name == "table" {
                        map.next_value::<IgnoredAny>()?;
                    } else {
                        let value = map.next_value()?;
                        members.insert(name, value);
                    }
                }
                Ok(Written(Value::Object(members)))
            }
        }
        deserializer.deserialize_map(Members)
    }
}

/// The deserialiser would also take a list for a structure and a table for a name; documents are not
/// written so.
fn check_forms(written: &Value) -> Result<(), Refusal> {
    for member in [
        "time",
        "options",
        "parameters",
        "forcing",
        "fjord",
        "melt_shape",
        "calving_law",
        "sample",
        "branch",
        "fold_curve",
        "calibration",
    ] {
        if let Some(value) = written.get(member).filter(|v| v.is_array()) {
            return refuse_form(member, value, "members by name");
        }
    }
    if let Some(value) = written.get("regime").filter(|v| !v.is_string()) {
        return refuse_form("regime", value, "a name");
    }
    if let Some(value) = written.pointer("/sample/method").filter(|v| !v.is_string()) {
        return refuse_form("sample.method", value, "a name");
    }
    let courses = written.get("forcing").and_then(Value::as_object);
    for (name, course) in courses.into_iter().flatten() {
        for (kind, numbers) in course.as_object().into_iter().flatten() {
            if !numbers.is_object() {
                let field = format!("forcing.{name}.{kind}");
                return refuse_form(&field, numbers, "members by name");
            }
        }
    }
    let axes = written.get("axes").and_then(Value::as_array);
    for (i, axis) in axes.into_iter().flatten().enumerate() {
        if !axis.is_object() {
            return refuse_form(&format!("axes[{i}]"), axis, "members by name");
        }
        let zipped = axis.get("zip").and_then(Value::as_array);
        for (j, axis) in zipped.into_iter().flatten().enumerate() {
            if !axis.is_object() {
                return refuse_form(&format!("axes[{i}].zip[{j}]"), axis, "members by name");
            }
        }
    }
    Ok(())
}

fn refuse_form(field: &str, value: &Value, form: &str) -> Result<(), Refusal> {
    Err(Refusal::value(field, value.clone(), format!("to be written as {form}")))
}
