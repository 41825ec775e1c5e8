//! A scenario or sweep as it is written, in JSON or TOML: names and types, no meaning yet. An unknown
//! or doubled name is an error here; what the names mean is checked in `run` and `sweep`.

use super::along::{FjordTable, MeltForm};
use super::entries::Entries;
use super::forcing::{CalvingForm, CourseForm};
use super::refusal::Refusal;
use super::start::Start;
use super::time::Time;
use serde::{Deserialize, Serialize};
use serde_json::Value;
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
    pub parameters: Entries<f64>,
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
    /// How the melt rate is spread: a name, factors over χ, or factors over x.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<Object>)]
    pub melt_shape: Option<MeltForm>,
    /// Widths along the fjord, instead of `width_m` and `width_gradient`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fjord: Option<FjordTable>,
    /// Courses in time by parameter; only for a transient.
    #[serde(default, skip_serializing_if = "Entries::is_empty")]
    #[schema(value_type = std::collections::BTreeMap<String, CourseForm>)]
    pub forcing: Entries<CourseForm>,
    /// What sets the calving rate: `steady_feedback` or a law; only for a transient.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<Object>)]
    pub calving_law: Option<CalvingForm>,
    /// Not there yet.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sample: Option<Value>,
    /// Not there yet.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub table: Option<Value>,
    /// L of a quasi-static mélange, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub length_m: Option<f64>,
    /// H₀ of a quasi-static mélange, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub thickness_0_m: Option<f64>,
    /// Volume of a quasi-static mélange, m³.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub volume_m3: Option<f64>,
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
    /// A mélange at rest in front of a terminus that pushes it along.
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

/// Numerical options.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Options {
    /// `published`, `printed` or `no_stretching`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub upstream_closure: Option<String>,
    /// Forcing and calving law are taken at the start of each step, as the paper's scripts do it; needs
    /// fixed steps.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lagged: Option<bool>,
    /// Whether a steady state's error of the grid is estimated from three finer grids.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub grid_error: Option<bool>,
    /// Places, 0 to 1, at which speed and fluidity across the fjord are told; only for a single run.
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
        // Some editors begin a file with a mark of its byte order.
        let text = text.trim_start_matches('\u{feff}');
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
    for member in ["time", "options", "parameters", "forcing", "fjord", "melt_shape", "calving_law"]
    {
        if let Some(value) = written.get(member).filter(|v| v.is_array()) {
            return refuse(member.into(), value, "members by name");
        }
    }
    if let Some(value) = written.get("regime").filter(|v| !v.is_string()) {
        return refuse("regime".into(), value, "a name");
    }
    let courses = written.get("forcing").and_then(Value::as_object);
    for (name, course) in courses.into_iter().flatten() {
        for (kind, numbers) in course.as_object().into_iter().flatten() {
            if !numbers.is_object() {
                return refuse(format!("forcing.{name}.{kind}"), numbers, "members by name");
            }
        }
    }
    let axes = written.get("axes").and_then(Value::as_array);
    for (i, axis) in axes.into_iter().flatten().enumerate() {
        if !axis.is_object() {
            return refuse(format!("axes[{i}]"), axis, "members by name");
        }
    }
    Ok(())
}
