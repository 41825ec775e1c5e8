//! A scenario or sweep as it is written, in JSON or TOML: names and types, no meaning yet. An unknown
//! or doubled name is an error here; what the names mean is checked in `run` and `sweep`.

use super::refusal::Refusal;
use serde::de::{Deserializer, Error, MapAccess, Visitor, value::MapAccessDeserializer};
use serde::{Deserialize, Serialize, Serializer};
use serde_json::Value;
use std::fmt;
use utoipa::ToSchema;

/// Every member a scenario or a sweep may have.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Document {
    /// Name of the sweep.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// What is solved for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub regime: Option<Regime>,
    /// Parameters by name; what is not given has the default.
    #[serde(default, skip_serializing_if = "Entries::is_empty")]
    #[schema(value_type = std::collections::BTreeMap<String, f64>)]
    pub parameters: Entries,
    /// Where a diagnostic or transient run starts.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<Object>)]
    pub start: Option<Start>,
    /// Steps and outputs of a transient run.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time: Option<Time>,
    /// Numerical options.
    #[serde(default, skip_serializing_if = "Options::is_empty")]
    pub options: Options,
    /// The axes of a sweep; their grid, the last one fastest.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub axes: Vec<Axis>,
    /// `uniform`; other shapes are not there yet.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub melt_shape: Option<Value>,
    /// Not there yet.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fjord: Option<Value>,
    /// Not there yet.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub forcing: Option<Value>,
    /// Not there yet.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub calving_law: Option<Value>,
    /// Not there yet.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sample: Option<Value>,
    /// Not there yet.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub table: Option<Value>,
    /// Not there yet (quasi-static).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub length_m: Option<Value>,
    /// Not there yet (quasi-static).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub thickness_0_m: Option<Value>,
    /// Not there yet (quasi-static).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub volume_m3: Option<Value>,
}

/// What is solved for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Regime {
    /// The steady state.
    Steady,
    /// Velocity, fluidity and friction at given geometry.
    Diagnostic,
    /// Evolution in time.
    Transient,
    /// Not there yet.
    QuasiStatic,
    /// Not there yet.
    Branch,
    /// Not there yet.
    FoldCurve,
    /// Not there yet.
    Calibration,
}

impl Regime {
    /// Name at every boundary.
    pub fn name(self) -> &'static str {
        match self {
            Self::Steady => "steady",
            Self::Diagnostic => "diagnostic",
            Self::Transient => "transient",
            Self::QuasiStatic => "quasi_static",
            Self::Branch => "branch",
            Self::FoldCurve => "fold_curve",
            Self::Calibration => "calibration",
        }
    }
}

/// Names and numbers in the order written, doubled names included, so that they can be refused.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Entries(pub Vec<(String, f64)>);

impl Entries {
    /// Whether nothing was written.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

impl Serialize for Entries {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.iter().map(|(name, value)| (name, value)))
    }
}

impl<'de> Deserialize<'de> for Entries {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Pairs;
        impl<'de> Visitor<'de> for Pairs {
            type Value = Entries;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("parameters by name, each a number")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Entries, A::Error> {
                let mut entries = Vec::new();
                while let Some(name) = map.next_key::<String>()? {
                    let value =
                        map.next_value().map_err(|e| A::Error::custom(format!("`{name}`: {e}")))?;
                    entries.push((name, value));
                }
                Ok(Entries(entries))
            }
        }
        deserializer.deserialize_map(Pairs)
    }
}

/// Where a run starts.
#[derive(Debug, Clone, PartialEq)]
pub enum Start {
    /// The steady state of the run's parameters.
    Steady,
    /// H linear from `thickness_0_m` at x = 0 to d at x = L.
    Wedge(Wedge),
    /// The last state of a stored run.
    Run(String),
}

/// A wedge to start from.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Wedge {
    /// L, m.
    pub length_m: f64,
    /// H₀, m.
    pub thickness_0_m: f64,
}

impl Serialize for Start {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Start::Steady => serializer.serialize_str("steady"),
            Start::Wedge(wedge) => wedge.serialize(serializer),
            Start::Run(id) => serializer.collect_map([("run", id)]),
        }
    }
}

impl<'de> Deserialize<'de> for Start {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Members {
            length_m: Option<f64>,
            thickness_0_m: Option<f64>,
            run: Option<String>,
        }
        const FORMS: &str = r#""steady", {"length_m": …, "thickness_0_m": …} or {"run": "<id>"}"#;
        struct Forms;
        impl<'de> Visitor<'de> for Forms {
            type Value = Start;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(FORMS)
            }

            fn visit_str<E: Error>(self, text: &str) -> Result<Start, E> {
                if text == "steady" {
                    Ok(Start::Steady)
                } else {
                    Err(E::custom(format!("\"{text}\" is no start; permitted are {FORMS}")))
                }
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Start, A::Error> {
                let members = Members::deserialize(MapAccessDeserializer::new(map))?;
                match (members.length_m, members.thickness_0_m, members.run) {
                    (Some(length_m), Some(thickness_0_m), None) => {
                        Ok(Start::Wedge(Wedge { length_m, thickness_0_m }))
                    }
                    (None, None, Some(id)) => Ok(Start::Run(id)),
                    _ => Err(A::Error::custom(format!("permitted are {FORMS}"))),
                }
            }
        }
        deserializer.deserialize_any(Forms)
    }
}

/// Steps and outputs of a transient run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Time {
    /// Duration, a.
    pub duration_a: f64,
    /// Fixed time step Δt, a.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fixed_dt_a: Option<f64>,
    /// Error-controlled steps: not there yet.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tolerance: Option<f64>,
    /// Interval between rows of the series, a; every step if not given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub output_every_a: Option<f64>,
    /// Times at which profiles are stored, a.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub profiles_at_a: Vec<f64>,
}

/// Numerical options.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Options {
    /// `published`, `printed` or `no_stretching`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub upstream_closure: Option<String>,
    /// Not there yet.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lagged: Option<bool>,
    /// Not there yet.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub transects_at_chi: Option<Vec<f64>>,
}

impl Options {
    /// Whether nothing was written.
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }
}

/// One axis of a sweep: a parameter or an option, and its points.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Axis {
    /// Parameter's name.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub parameter: Option<String>,
    /// Option's name: `upstream_closure`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub option: Option<String>,
    /// First point, last point, number of points.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<Vec<f64>>)]
    pub linspace: Option<(f64, f64, u64)>,
    /// The same, evenly spaced in the logarithm.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<Vec<f64>>)]
    pub logspace: Option<(f64, f64, u64)>,
    /// The points themselves: numbers, or names for an option.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub values: Option<Vec<Value>>,
    /// Not there yet.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub zip: Option<Value>,
}

impl Document {
    /// Reads JSON if the first character is `{`, else TOML.
    pub fn parse(text: &str) -> Result<Self, Refusal> {
        if text.trim_start().starts_with('{') {
            let sentence = |e: serde_json::Error| Refusal::sentence(e.to_string());
            // Read twice: the first time for the value at the place of an error in the second.
            let written: Value = serde_json::from_str(text).map_err(sentence)?;
            let mut json = serde_json::Deserializer::from_str(text);
            let document = serde_path_to_error::deserialize(&mut json)
                .map_err(|e| located(&written, &e.path().to_string(), &e.inner().to_string()))?;
            check_forms(&written)?;
            Ok(document)
        } else {
            let sentence = |e: toml::de::Error| Refusal::sentence(e.to_string());
            let written: Value = toml::from_str(text).map_err(sentence)?;
            let toml = toml::Deserializer::parse(text).map_err(sentence)?;
            let document = serde_path_to_error::deserialize(toml)
                .map_err(|e| located(&written, &e.path().to_string(), e.inner().message()))?;
            check_forms(&written)?;
            Ok(document)
        }
    }
}

/// A member that does not fit, with the value found there; what is permitted is what the deserialiser
/// expected.
fn located(written: &Value, path: &str, message: &str) -> Refusal {
    let permitted = message.split_once("expected ").map(|(_, expected)| {
        expected.split_once(" at line ").map_or(expected, |(form, _)| form).to_owned()
    });
    if [".", "?"].contains(&path) {
        return Refusal { permitted, ..Refusal::sentence(message) };
    }
    let pointer = format!("/{}", path.replace(['.', '['], "/").replace(']', ""));
    let value = written.pointer(&pointer).cloned();
    let given = value.as_ref().map_or_else(String::new, |v| format!(" = {v}"));
    let detail = format!("`{path}`{given} is refused: {message}");
    Refusal { detail, field: Some(path.to_owned()), value, permitted }
}

/// The deserialiser would also take a list for a structure and a table for a name; documents are not
/// written so.
fn check_forms(written: &Value) -> Result<(), Refusal> {
    let refuse = |field: String, value: &Value, form: &str| {
        Err(Refusal::value(field, value.clone(), format!("to be written as {form}")))
    };
    for member in ["time", "options", "parameters"] {
        if let Some(value) = written.get(member).filter(|v| v.is_array()) {
            return refuse(member.into(), value, "members by name");
        }
    }
    if let Some(value) = written.get("regime").filter(|v| !v.is_string()) {
        return refuse("regime".into(), value, "a name");
    }
    let axes = written.get("axes").and_then(Value::as_array);
    for (i, axis) in axes.into_iter().flatten().enumerate() {
        if !axis.is_object() {
            return refuse(format!("axes[{i}]"), axis, "members by name");
        }
    }
    Ok(())
}
