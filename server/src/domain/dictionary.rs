//! The names of the interface, with units, meanings and ranges, for whoever draws or fills in a form.

use super::outcome::SCALARS;
use melange_solver::params::PARAMETERS;
use serde::Serialize;
use utoipa::ToSchema;

/// All parameters and all numbers of a result.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct Dictionary {
    /// Parameters of a run.
    pub parameters: Vec<ParameterEntry>,
    /// Numbers of a result.
    pub scalars: Vec<ScalarEntry>,
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
        Self { parameters: parameters.collect(), scalars: scalars.collect() }
    }
}
