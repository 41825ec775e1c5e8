//! The members of a scenario or sweep as it is written: names and types, no meaning yet. `reading` reads
//! them; what they mean is checked in `run` and `sweep`.

use super::along::{FjordTable, MeltForm};
use super::branch::{BranchForm, FoldCurveForm};
use super::calibration::CalibrationForm;
use super::entries::Entries;
use super::forcing::{CalvingForm, CourseForm};
use super::sample::SampleForm;
use super::start::Start;
use super::table::TableForm;
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
    /// Words to find the sweep by: up to 20, each of 1 to 50 letters, digits, `_`, `-`, `.` and `:`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub tags: Vec<String>,
    /// Sweeps with a higher one are solved first: a whole number from -100 to 100, 0 if not given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub priority: Option<i64>,
    /// Whether the sweep's runs are solved even if they are stored already.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub force: Option<bool>,
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
    /// What sets the calving rate: `steady_feedback` or a law for a transient, a law for a branch.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<Object>)]
    pub calving_law: Option<CalvingForm>,
    /// Points drawn from ranges, instead of axes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sample: Option<SampleForm>,
    /// Points by rows, instead of axes: `{"columns": [names], "rows": [[cells]]}`.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<Object>)]
    pub table: Option<TableForm>,
    /// L of a quasi-static mélange, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub length_m: Option<f64>,
    /// H₀ of a quasi-static mélange, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub thickness_0_m: Option<f64>,
    /// Volume of a quasi-static mélange, m³.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub volume_m3: Option<f64>,
    /// Along which parameter steady states are followed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub branch: Option<BranchForm>,
    /// Along which parameters a fold is followed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fold_curve: Option<FoldCurveForm>,
    /// Which parameters are found, and from which observations.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub calibration: Option<CalibrationForm>,
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
    /// Steady states along a parameter, around folds, with their stability.
    Branch,
    /// A fold of a branch as a second parameter varies.
    FoldCurve,
    /// The parameters whose steady state agrees best with observations, and how well they are known.
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
    /// Whether a steady state's derivatives by its parameters and by the melt of each cell are stored.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sensitivities: Option<bool>,
    /// Whether the other discrete steady states beside the one that the rule picks are searched for and stored.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub discrete_roots: Option<bool>,
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

/// One axis of a sweep: a parameter or an option and its points, or several that move together.
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
    /// Axes of the same length that move together, instead of everything above.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(no_recursion)]
    pub zip: Option<Vec<Axis>>,
}

impl Document {
    /// The document with the ends of long lists cut off, as JSON, for lists of sweeps; none if it is short.
    pub fn summary(&self, json: &str) -> Option<String> {
        /// Bytes up to which a document is short.
        const SHORT: usize = 8_192;
        /// Items that are left of a long list.
        const ITEMS: usize = 8;
        fn cut_axes(axes: &mut [Axis]) {
            for axis in axes {
                if let Some(values) = &mut axis.values {
                    values.truncate(ITEMS);
                }
                cut_axes(axis.zip.as_deref_mut().unwrap_or_default());
            }
        }
        fn cut(value: &mut Value) {
            match value {
                Value::Array(items) => {
                    items.truncate(ITEMS);
                    items.iter_mut().for_each(cut);
                }
                Value::Object(members) => members.values_mut().for_each(cut),
                _ => {}
            }
        }
        if json.len() <= SHORT {
            return None;
        }
        // What may be very long first, so that it never becomes a tree of values.
        let mut head = Self { table: self.table.as_ref().map(|t| t.head(ITEMS)), ..self.clone() };
        cut_axes(&mut head.axes);
        let mut value = serde_json::to_value(&head).ok()?;
        cut(&mut value);
        Some(value.to_string())
    }
}
