//! The result of one run, as stored and as shown. Numbers that do not exist are `None`, never NaN.

use super::calibrated::{Calibrated, Calibration, CalibrationRow};
use super::curve::{Branch, BranchCurve, CurveRow, FoldCurve, Folds};
use super::discrete_root::RootRow;
use super::provenance::Provenance;
use super::sensitivity::SensitivityRow;
use super::status::Status;
use melange_solver::params::{PARAMETERS, Parameters};
use serde::Serialize;
use serde::ser::{SerializeMap, Serializer};
use utoipa::ToSchema;

/// A run's result.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Outcome {
    /// How it ended.
    pub status: Status,
    /// One sentence on it.
    pub detail: String,
    /// All parameters, effective.
    #[schema(value_type = std::collections::BTreeMap<String, f64>)]
    pub parameters: EffectiveParameters,
    /// The regime solved in.
    pub regime: String,
    /// The closure at the terminus.
    pub upstream_closure: String,
    /// The numbers of the last state.
    #[serde(flatten)]
    pub scalars: Scalars,
    /// Newton iterations.
    pub iterations: u64,
    /// Attempts made: 1 if the first gave the answer, else the last did, and `detail` says how; a failed run
    /// has none that did.
    pub attempts: u64,
    /// Nondimensional residual norms of the last solve of a failed run, oldest first; null if it tells none.
    pub residual_history: Option<Vec<f64>>,
    /// Which rule picked the root.
    pub root_evidence: Option<String>,
    /// What the state does that the model is not made for: `compression` (of any step of a transient),
    /// `thin` (H₀ < 2d), `inertial` (inertial number above 0.1).
    pub validity: Option<String>,
    /// What three grids say of the errors, if asked: `asymptotic`, or the quantities that are `not
    /// asymptotic`.
    pub grid_convergence: Option<String>,
    /// The three grids in detail, if asked.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<Object>)]
    pub grid_error: Option<GridErrorDetail>,
    /// Last state.
    pub profile: Option<Profile>,
    /// Time series; only of a transient.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub series: Option<Series>,
    /// Stored states; only of a transient.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub states: Option<Vec<StoredState>>,
    /// A branch of steady states: `control`, `unit`, and `points`, `folds`, `crossings`, `roots` and `ends`, whose
    /// members are the columns of the table `branches`.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<Branch>)]
    pub branch: Option<BranchCurve>,
    /// A curve of folds: `control`, `unit`, `second`, `second_unit`, and `points` and `ends` with members as
    /// those of a branch.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<Folds>)]
    pub fold_curve: Option<FoldCurve>,
    /// A calibration: `fit`, `estimates`, `identifiability`, `residuals`, `starts` and, if asked, `mcmc`, whose members
    /// are the columns of the table `calibrations`. The numbers of the result are those of the fitted state.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<Calibration>)]
    pub calibration: Option<Calibrated>,
    /// Derivatives of the steady state's numbers, a member for each quantity, if asked: the columns of the table
    /// `sensitivities`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub sensitivities: Vec<SensitivityRow>,
    /// The discrete steady states, if asked, the one that the rule picks first: the columns of the table `roots`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub discrete_roots: Vec<RootRow>,
    /// Speed and fluidity across the fjord, where asked for.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub transects: Vec<TransectProfile>,
    /// Where the numbers come from.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub provenance: Option<Provenance>,
}

impl Outcome {
    /// How a run ended, with nothing more to tell.
    pub fn bare(
        status: Status,
        parameters: Parameters,
        regime: &str,
        upstream_closure: &str,
    ) -> Self {
        Self {
            status,
            detail: String::new(),
            parameters: EffectiveParameters(parameters),
            regime: regime.to_owned(),
            upstream_closure: upstream_closure.to_owned(),
            scalars: Scalars::default(),
            iterations: 0,
            attempts: 1,
            residual_history: None,
            root_evidence: None,
            validity: None,
            grid_convergence: None,
            grid_error: None,
            profile: None,
            series: None,
            states: None,
            branch: None,
            fold_curve: None,
            calibration: None,
            sensitivities: Vec::new(),
            discrete_roots: Vec::new(),
            transects: Vec::new(),
            provenance: None,
        }
    }

    /// The rows of its branch or curve of folds.
    pub fn curve_rows(&self) -> &[CurveRow] {
        let branch = self.branch.as_ref().map(|branch| branch.0.as_slice());
        branch.or(self.fold_curve.as_ref().map(|curve| curve.0.as_slice())).unwrap_or_default()
    }

    /// The rows of its calibration.
    pub fn calibration_rows(&self) -> &[CalibrationRow] {
        self.calibration.as_ref().map(|calibrated| calibrated.0.as_slice()).unwrap_or_default()
    }

    /// Lets go of everything but the numbers and texts of the run.
    pub fn drop_tables(&mut self) {
        (self.profile, self.series, self.states) = (None, None, None);
        (self.branch, self.fold_curve, self.calibration) = (None, None, None);
        (self.sensitivities, self.transects) = (Vec::new(), Vec::new());
        self.discrete_roots = Vec::new();
    }
}

/// A transect from the wall to the centre of the fjord.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct TransectProfile {
    /// χ, share of the mélange's length.
    pub chi: f64,
    /// x from the terminus, m.
    pub x_m: f64,
    /// W, m.
    pub width_m: f64,
    /// μ_w.
    pub mu_w: f64,
    /// y from the wall, m.
    pub y_m: Vec<f64>,
    /// u relative to the walls, m a⁻¹.
    pub velocity_m_per_a: Vec<f64>,
    /// g^y, a⁻¹.
    pub fluidity_per_a: Vec<f64>,
}

/// A steady state on three grids.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct GridErrorDetail {
    /// Cells of the three grids.
    pub n_cells: [usize; 3],
    /// Each quantity, by its name among a result's numbers.
    pub quantities: Vec<GridQuantity>,
}

/// One number on three grids.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct GridQuantity {
    /// Its name.
    pub name: &'static str,
    /// Its values, from the coarsest grid to the finest.
    pub values: [f64; 3],
    /// Observed order; none where the differences change sign.
    pub observed_order: Option<f64>,
    /// Value for infinitely many cells; none where the grids are not asymptotic.
    pub extrapolated: Option<f64>,
    /// `asymptotic` or `not asymptotic`.
    pub verdict: &'static str,
    /// Distance of the run's number from the extrapolated one, or the spread of all four numbers.
    pub error: f64,
}

/// Parameters, written by the solver's table.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EffectiveParameters(pub Parameters);

impl Serialize for EffectiveParameters {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(PARAMETERS.len()))?;
        for info in &PARAMETERS {
            let value = (info.get)(&self.0);
            if info.whole {
                map.serialize_entry(info.name, &(value as u64))?;
            } else {
                map.serialize_entry(info.name, &value)?;
            }
        }
        map.end()
    }
}

macro_rules! scalars {
    ($($field:ident: $unit:literal, $meaning:literal;)*) => {
        /// The numbers of a result; units and meanings in [`SCALARS`].
        #[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, ToSchema)]
        pub struct Scalars {
            $(#[doc = $meaning] pub $field: Option<f64>,)*
        }

        /// Name, unit and meaning of each number of a result, in stored order.
        pub const SCALARS: &[ScalarInfo] = &[
            $(ScalarInfo {
                name: stringify!($field),
                unit: $unit,
                meaning: $meaning,
                get: |s| s.$field,
                set: |s, v| s.$field = v,
            },)*
        ];
    };
}

/// One number of a result.
#[derive(Debug, Clone, Copy)]
pub struct ScalarInfo {
    /// Name at every boundary.
    pub name: &'static str,
    /// Unit, "1" for dimensionless.
    pub unit: &'static str,
    /// Meaning, with the paper's symbol.
    pub meaning: &'static str,
    /// Reads it.
    pub get: fn(&Scalars) -> Option<f64>,
    /// Writes it.
    pub set: fn(&mut Scalars, Option<f64>),
}

scalars! {
    length_m: "m", "length L of the melange";
    thickness_0_m: "m", "thickness H_0 at the terminus, extrapolated";
    force_n_per_m: "N m-1", "buttressing force per unit width F/W, Eq. 30";
    force_quasi_static_n_per_m: "N m-1", "estimate of F/W that leaves out stretching";
    velocity_end_m_per_a: "m a-1", "velocity U_L at the end, in the terminus frame";
    volume_m3: "m3", "volume of the melange";
    residual_norm: "1", "2-norm of the nondimensional residual";
    mass_budget_defect: "1", "relative defect of the steady mass budget";
    yielding_fraction: "1", "share of interior cells with mu > mu_s";
    end_time_a: "a", "time at which a transient ended";
    terminus_x_m: "m", "position X_0 of the terminus along the bedrock at the end of a transient";
    inflow_m3_per_a: "m3 a-1", "ice that enters, U_c H_t W_0";
    melt_m3_per_a: "m3 a-1", "ice that melts";
    outflow_m3_per_a: "m3 a-1", "ice that leaves at the end, U_L d W_L";
    strain_rate_0_per_a: "a-1", "strain rate du/dx at the terminus";
    strain_rate_min_per_a: "a-1", "smallest strain rate of any cell but the last; of all steps of a transient";
    inertial_number: "1", "largest inertial number, along and across the fjord";
    cfl_time_step_a: "a", "time step of Courant number 1, Eq. 28";
    cfl_number: "1", "largest Courant number of a transient's steps";
    grid_error_length_m: "m", "error of length_m from three grids, or the spread where they do not converge";
    grid_error_thickness_0_m: "m", "the same of thickness_0_m";
    grid_error_force_n_per_m: "N m-1", "the same of force_n_per_m";
}

impl Scalars {
    /// Replaces numbers that are not finite by none.
    pub fn finite(mut self) -> Self {
        for info in SCALARS {
            if (info.get)(&self).is_some_and(|v| !v.is_finite()) {
                (info.set)(&mut self, None);
            }
        }
        self
    }
}

/// A state on the grid. Node arrays have N + 1 values, cell arrays N.
#[derive(Debug, Clone, Default, PartialEq, Serialize, ToSchema)]
pub struct Profile {
    /// Positions of the nodes, m from the terminus.
    pub node_x_m: Vec<f64>,
    /// U at nodes, m a⁻¹, in the terminus frame.
    pub velocity_m_per_a: Vec<f64>,
    /// μ_w at nodes.
    pub mu_w: Vec<f64>,
    /// Positions of the cells' centres, m from the terminus.
    pub cell_x_m: Vec<f64>,
    /// H in cells, m.
    pub thickness_m: Vec<f64>,
    /// g^x in cells, a⁻¹.
    pub fluidity_per_a: Vec<f64>,
}

/// One array of a profile.
#[derive(Debug, Clone, Copy)]
pub struct ProfileInfo {
    /// Name at every boundary.
    pub name: &'static str,
    /// Unit.
    pub unit: &'static str,
    /// Meaning.
    pub meaning: &'static str,
    /// Reads it.
    pub get: fn(&Profile) -> &Vec<f64>,
    /// Writes it.
    pub set: fn(&mut Profile, Vec<f64>),
}

macro_rules! profile_info {
    ($field:ident, $unit:literal, $meaning:literal) => {
        ProfileInfo {
            name: stringify!($field),
            unit: $unit,
            meaning: $meaning,
            get: |p| &p.$field,
            set: |p, v| p.$field = v,
        }
    };
}

/// The arrays of a profile, in stored order.
pub const PROFILE: [ProfileInfo; 6] = [
    profile_info!(node_x_m, "m", "positions of the nodes from the terminus"),
    profile_info!(velocity_m_per_a, "m a-1", "velocity U at the nodes, in the terminus frame"),
    profile_info!(mu_w, "1", "friction coefficient mu_w at the walls, at the nodes"),
    profile_info!(cell_x_m, "m", "positions of the cells' centres from the terminus"),
    profile_info!(thickness_m, "m", "thickness H in the cells"),
    profile_info!(fluidity_per_a, "a-1", "longitudinal granular fluidity g^x in the cells"),
];

/// A state of a transient.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct StoredState {
    /// Time since the start, a.
    pub time_a: f64,
    /// The state.
    pub profile: Profile,
}

macro_rules! series {
    ($($field:ident: $unit:literal, $meaning:literal;)*) => {
        /// Time series of a transient; all arrays have the same length.
        #[derive(Debug, Clone, Default, PartialEq, Serialize, ToSchema)]
        pub struct Series {
            $(#[doc = $meaning] pub $field: Vec<f64>,)*
        }

        /// The arrays of a series, in stored order.
        pub const SERIES: &[SeriesInfo] = &[
            $(SeriesInfo {
                name: stringify!($field),
                unit: $unit,
                meaning: $meaning,
                get: |s| &s.$field,
                get_mut: |s| &mut s.$field,
            },)*
        ];
    };
}

/// One array of a series.
#[derive(Debug, Clone, Copy)]
pub struct SeriesInfo {
    /// Name at every boundary.
    pub name: &'static str,
    /// Unit.
    pub unit: &'static str,
    /// Meaning.
    pub meaning: &'static str,
    /// Reads it.
    pub get: fn(&Series) -> &Vec<f64>,
    /// Writes it.
    pub get_mut: fn(&mut Series) -> &mut Vec<f64>,
}

series! {
    time_a: "a", "time since the start";
    length_m: "m", "length L of the melange";
    thickness_0_m: "m", "thickness H_0 at the terminus, extrapolated";
    force_n_per_m: "N m-1", "buttressing force per unit width F/W, Eq. 30";
    force_quasi_static_n_per_m: "N m-1", "estimate of F/W that leaves out stretching";
    velocity_end_m_per_a: "m a-1", "velocity U_L at the end, in the terminus frame";
    volume_m3: "m3", "volume of the melange";
    melt_rate_m_per_day: "m d-1", "melt rate in force";
    calving_rate_m_per_a: "m a-1", "calving rate in force";
    terminus_x_m: "m", "position X_0 of the terminus along the bedrock";
}

/// The outcome of bad input, which is shown and never stored.
pub fn refused(refusal: &super::refusal::Refusal) -> serde_json::Value {
    let mut value = serde_json::to_value(refusal).unwrap_or_default();
    value["status"] = Status::Refused.name().into();
    value
}
