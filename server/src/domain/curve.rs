//! Branches of steady states and curves of their folds, as stored and as shown: the long table `branches`.

use super::rows::{self, Cell, Column, row};
use serde::ser::{Serialize, Serializer};
use utoipa::openapi::{RefOr, Schema};
use utoipa::{PartialSchema, ToSchema};

row! {
    /// A row of the table; units and meanings in its columns. What a row of its kind does not have is none.
    CurveRow;
    kind: String, "1", "what the row is: point, fold, root (at a value asked for), crossing (a change of stability between two points that no fold explains) or end";
    control: String, "1", "name of the control parameter";
    control_unit: String, "1", "unit of control_value, bracket and, per arclength, control_by_arclength";
    control_value: f64, "see control_unit", "value of the control parameter";
    second: String, "1", "name of the second parameter of a curve of folds";
    second_unit: String, "1", "unit of second_value";
    second_value: f64, "see second_unit", "value of the second parameter";
    segment: i64, "1", "piece of the branch between folds, numbered along the curve from 0";
    arclength: f64, "1", "arclength along the curve from the start, in (length/unit, control/unit)";
    step: f64, "1", "length of the step that led here; 0 at the start";
    iterations: i64, "1", "Newton iterations of the row's state";
    control_by_arclength: f64, "see control_unit", "change of the control parameter per arclength; 0 at a smooth fold";
    stable: bool, "1", "whether every small perturbation decays; null at a fold, where the leading growth rate is 0";
    unstable_count: i64, "1", "number of perturbations that grow";
    growth_rate_re_per_a: Vec<f64>, "a-1", "growth rates of the three fastest growing perturbations, real parts; of a crossing those nearest to 0 before and after";
    growth_rate_im_per_a: Vec<f64>, "a-1", "the same, imaginary parts";
    thickness_0_m: f64, "m", "thickness H_0 at the terminus, extrapolated";
    length_m: f64, "m", "length L of the melange";
    force_n_per_m: f64, "N m-1", "buttressing force per unit width F/W, Eq. 30";
    force_quasi_static_n_per_m: f64, "N m-1", "estimate of F/W that leaves out stretching";
    velocity_end_m_per_a: f64, "m a-1", "velocity U_L at the end, in the terminus frame";
    volume_m3: f64, "m3", "volume of the melange";
    residual_norm: f64, "1", "2-norm of the nondimensional residual";
    has_jumped: bool, "1", "whether the discrete root that the curve came along ends just before, on a kink of the rheology, and the one that takes over is followed from here";
    is_picked: bool, "1", "whether a root is the one that the rule for steady states picks at its value; null with a calving law";
    is_maximum: bool, "1", "whether the control parameter is largest at a fold, on the branch nearby";
    is_on_kink: bool, "1", "whether a fold lies on a kink of the rheology and is bracketed only";
    bracket: Vec<f64>, "see control_unit", "control parameter between which a fold lies, or before and after a crossing";
    arclengths: Vec<f64>, "1", "arclengths before and after a crossing";
    unstable_counts: Vec<f64>, "1", "numbers of growing perturbations before and after a crossing";
    reason: String, "1", "why the curve ends: bound, verdict, closed, most_points or stuck";
    detail: String, "1", "the same in a sentence";
}

/// Whether a column is about the whole curve, which tells it once.
fn is_shared(column: &Column) -> bool {
    ["control", "control_unit", "second", "second_unit"].contains(&column.name.as_str())
}

impl Serialize for CurveRow {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let is_left_out = |column: &Column, cell: &Cell| cell.is_none() || is_shared(column);
        rows::serialize(self, is_left_out, serializer)
    }
}

impl PartialSchema for CurveRow {
    fn schema() -> RefOr<Schema> {
        rows::schema::<Self>(is_shared)
    }
}

impl ToSchema for CurveRow {}

/// A branch of steady states along one parameter: rows of every kind, each kind along the curve.
#[derive(Debug, Clone, PartialEq)]
pub struct BranchCurve(pub Vec<CurveRow>);

/// A fold as a second parameter varies: its folds and its ends.
#[derive(Debug, Clone, PartialEq)]
pub struct FoldCurve(pub Vec<CurveRow>);

/// The rows of a kind.
pub fn of_kind<'a>(rows: &'a [CurveRow], kind: &str) -> Vec<&'a CurveRow> {
    rows.iter().filter(|row| row.kind.as_deref() == Some(kind)).collect()
}

/// A branch as it is shown; each list along the curve.
#[derive(serde::Serialize, ToSchema)]
pub struct Branch<'a> {
    /// The parameter that varies.
    control: Option<&'a String>,
    /// Its unit.
    unit: Option<&'a String>,
    /// Steady states.
    points: Vec<&'a CurveRow>,
    /// Where it turns round.
    folds: Vec<&'a CurveRow>,
    /// Where perturbations begin or cease to grow between two points, and no fold is the reason.
    crossings: Vec<&'a CurveRow>,
    /// Steady states at the values asked for.
    roots: Vec<&'a CurveRow>,
    /// Why it goes no further, at its first and at its last point.
    ends: Vec<&'a CurveRow>,
}

/// A curve of folds as it is shown.
#[derive(serde::Serialize, ToSchema)]
pub struct Folds<'a> {
    /// The branch's parameter, whose thresholds the folds are.
    control: Option<&'a String>,
    /// Its unit.
    unit: Option<&'a String>,
    /// The second parameter.
    second: Option<&'a String>,
    /// Its unit.
    second_unit: Option<&'a String>,
    /// Folds from small to large values of the second parameter.
    points: Vec<&'a CurveRow>,
    /// Why it goes no further, at its first and at its last point.
    ends: Vec<&'a CurveRow>,
}

impl Serialize for BranchCurve {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let (first, of) = (self.0.first(), |kind| of_kind(&self.0, kind));
        let branch = Branch {
            control: first.and_then(|row| row.control.as_ref()),
            unit: first.and_then(|row| row.control_unit.as_ref()),
            points: of("point"),
            folds: of("fold"),
            crossings: of("crossing"),
            roots: of("root"),
            ends: of("end"),
        };
        branch.serialize(serializer)
    }
}

impl Serialize for FoldCurve {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let first = self.0.first();
        let folds = Folds {
            control: first.and_then(|row| row.control.as_ref()),
            unit: first.and_then(|row| row.control_unit.as_ref()),
            second: first.and_then(|row| row.second.as_ref()),
            second_unit: first.and_then(|row| row.second_unit.as_ref()),
            points: of_kind(&self.0, "fold"),
            ends: of_kind(&self.0, "end"),
        };
        folds.serialize(serializer)
    }
}
