//! Why an input is refused: the field, the value, and what would be permitted. Knows no transport.

use melange_solver::params::{self, ParameterError};
use serde::Serialize;
use utoipa::ToSchema;

/// A refused input. Problem documents of the REST interface carry the same members.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema, thiserror::Error)]
#[error("{detail}")]
pub struct Refusal {
    /// One sentence.
    pub detail: String,
    /// Path of the field, as in the document sent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub field: Option<String>,
    /// The value found there.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub value: Option<serde_json::Value>,
    /// What would be permitted there.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub permitted: Option<String>,
    /// At which character of the value, counted from 1, if it is a filter.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub character: Option<usize>,
}

impl Refusal {
    /// A sentence about the document as a whole.
    pub fn sentence(detail: impl Into<String>) -> Self {
        Self { detail: detail.into(), field: None, value: None, permitted: None, character: None }
    }

    /// The sentence; below it, if it is about a character of a filter, the filter with a mark under that.
    pub fn pointed(&self) -> String {
        let text = self.value.as_ref().and_then(serde_json::Value::as_str);
        let (Some(text), Some(character)) = (text, self.character) else {
            return self.detail.clone();
        };
        let line: String = text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
        format!("{}\n  {line}\n  {:>character$}", self.detail, '^')
    }

    /// A field whose value is not permitted.
    pub fn value(
        field: impl Into<String>,
        value: impl Into<serde_json::Value>,
        permitted: impl Into<String>,
    ) -> Self {
        let (field, value, permitted) = (field.into(), value.into(), permitted.into());
        Self {
            detail: format!("`{field}` = {value} is refused: {permitted}"),
            field: Some(field),
            value: Some(value),
            permitted: Some(permitted),
            character: None,
        }
    }

    /// A number that is not permitted; JSON has no NaN, so the value is text where it must be.
    pub fn number(field: impl Into<String>, value: f64, permitted: impl Into<String>) -> Self {
        let shown = serde_json::Number::from_f64(value)
            .map_or_else(|| value.to_string().into(), serde_json::Value::Number);
        Self::value(field, shown, permitted)
    }

    /// A field that is not there and has to be.
    pub fn missing(field: &str, why: &str) -> Self {
        Self {
            field: Some(field.to_owned()),
            permitted: Some(why.to_owned()),
            ..Self::sentence(format!("`{field}` is missing: {why}"))
        }
    }

    /// A field that is there and has no place here.
    pub fn out_of_place(field: &str, why: &str) -> Self {
        Self {
            field: Some(field.to_owned()),
            permitted: Some("nothing here".to_owned()),
            ..Self::sentence(format!("`{field}` is refused: {why}"))
        }
    }

    /// A name that is no parameter, with the value given to it.
    pub fn unknown_parameter(path: &str, name: &str, value: f64) -> Self {
        let refusal = Self::number(format!("{path}.{name}"), value, known_parameters());
        let detail = format!(
            "there is no parameter `{name}` (given as {value}); known are {}",
            known_parameters()
        );
        Self { detail, ..refusal }
    }

    fn at(self, field: String, permitted: String) -> Self {
        Self { field: Some(field), permitted: Some(permitted), ..self }
    }

    /// A parameter the solver's table refuses, found at `path`.
    pub fn parameter(path: &str, error: &ParameterError) -> Self {
        match error {
            ParameterError::Unknown { name } => {
                Self::sentence(error.to_string()).at(format!("{path}.{name}"), known_parameters())
            }
            ParameterError::OutOfRange { name, value } => {
                Self::number(format!("{path}.{name}"), *value, params::permitted(name))
            }
            ParameterError::Contradiction { name, value, permitted } => {
                Self::number(format!("{path}.{name}"), *value, permitted.clone())
            }
        }
    }
}

fn known_parameters() -> String {
    params::PARAMETERS.map(|p| p.name).join(", ") + ", calving_flux_m2_per_a"
}
