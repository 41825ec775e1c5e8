//! The names of the interface, with units, meanings and ranges, for whoever draws or fills in a form.

use super::outcome::{PROFILE, SCALARS, SERIES};
use super::provenance;
use melange_solver::control::Control;
use melange_solver::force::static_force_n_per_m;
use melange_solver::params::{DAYS_PER_YEAR, GRAVITY, ICE_DENSITY, PARAMETERS, WATER_DENSITY};
use serde::Serialize;
use utoipa::ToSchema;

/// All parameters, all numbers of a result and all controls of a branch.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Dictionary {
    /// Parameters of a run.
    pub parameters: Vec<ParameterEntry>,
    /// Numbers of a result.
    pub scalars: Vec<ScalarEntry>,
    /// What a branch may be followed along.
    pub controls: Vec<ControlEntry>,
    /// What the table of runs tells of where they come from.
    pub provenance: Vec<ScalarEntry>,
    /// Numbers of the model that no run changes.
    pub constants: Vec<ConstantEntry>,
    /// Columns of a transient's series.
    pub series: Vec<ScalarEntry>,
    /// Arrays of a profile.
    pub profile: Vec<ScalarEntry>,
}

/// A parameter.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct ParameterEntry {
    name: &'static str,
    unit: &'static str,
    meaning: &'static str,
    default: f64,
    min: f64,
    max: f64,
}

/// A number of a result.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct ScalarEntry {
    name: &'static str,
    unit: &'static str,
    meaning: &'static str,
}

/// A constant.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct ConstantEntry {
    name: &'static str,
    value: f64,
    unit: &'static str,
    meaning: &'static str,
}

/// The constants.
fn constants() -> Vec<ConstantEntry> {
    let constant = |name, value, unit, meaning| ConstantEntry { name, value, unit, meaning };
    vec![
        constant("ice_density", ICE_DENSITY, "kg m-3", "density of the melange"),
        constant("water_density", WATER_DENSITY, "kg m-3", "density of the water"),
        constant("gravity", GRAVITY, "m s-2", "acceleration of gravity"),
        constant("days_per_year", DAYS_PER_YEAR, "d a-1", "days in a, the Julian year"),
        constant(
            "static_force_pa",
            static_force_n_per_m(1.0),
            "N m-3",
            "c in F/W = c H_0^2, the buttressing force without stretching",
        ),
    ]
}

/// A control parameter.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct ControlEntry {
    name: &'static str,
    unit: &'static str,
    min: f64,
    max: f64,
}

impl Dictionary {
    /// From the tables of the solver and of the results.
    pub fn new() -> Self {
        let parameters = PARAMETERS.iter().map(|p| ParameterEntry {
            name: p.name,
            unit: p.unit,
            meaning: p.meaning,
            default: p.default,
            min: p.min,
            max: p.max,
        });
        let scalars =
            SCALARS.iter().map(|s| ScalarEntry { name: s.name, unit: s.unit, meaning: s.meaning });
        let controls = Control::names().into_iter().filter_map(Control::named).map(|control| {
            let (min, max) = control.range();
            ControlEntry { name: control.name(), unit: control.unit(), min, max }
        });
        let columns = provenance::COLUMNS.iter();
        let provenance =
            columns.map(|c| ScalarEntry { name: c.name, unit: c.unit, meaning: c.meaning });
        Self {
            parameters: parameters.collect(),
            scalars: scalars.collect(),
            controls: controls.collect(),
            provenance: provenance.collect(),
            constants: constants(),
            series: SERIES
                .iter()
                .map(|s| ScalarEntry { name: s.name, unit: s.unit, meaning: s.meaning })
                .collect(),
            profile: PROFILE
                .iter()
                .map(|p| ScalarEntry { name: p.name, unit: p.unit, meaning: p.meaning })
                .collect(),
        }
    }
}
