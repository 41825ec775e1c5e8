//! Calibrations: as they are written, and what they come to.

use super::entries::Entries;
use super::refusal::Refusal;
use super::run::RunSpec;
use melange_solver::calibration::fit;
use melange_solver::calibration::observations::{Observation, Observed, names};
use melange_solver::calibration::sampler::{self, SamplerError};
use melange_solver::calibration::{Calibration, CalibrationError, Unknown};
use melange_solver::control::{Control, Setting};
use melange_solver::params::ParameterError;
use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer};
use serde::de::{Deserializer, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Serialize};
use std::fmt;
use utoipa::ToSchema;

/// A calibration, as it is written. It starts at the parameters' own values.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct CalibrationForm {
    /// The parameters to be found by name, each with its smallest and largest value, above 0.
    #[schema(value_type = std::collections::BTreeMap<String, Vec<f64>>)]
    pub parameters: Entries<(f64, f64)>,
    /// What they are found from: rows, or columns of the same names.
    #[schema(value_type = Vec<ObservationForm>)]
    pub observations: ObservationsForm,
    /// Number of starts: the parameters as given, and others between the bounds; 6 if not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub starts: Option<u64>,
    /// Another seed gives other starts; 0 if not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seed: Option<u64>,
    /// How the posterior is sampled; it is not if this is not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mcmc: Option<McmcForm>,
}

/// An observation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ObservationForm {
    /// `thickness_m`, `velocity_m_per_a`, `velocity_across_m_per_a`, or a number of a steady state.
    pub quantity: String,
    /// Distance from the terminus, m, of what has a place.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub x_m: Option<f64>,
    /// Distance from a wall, m, of a velocity across the fjord.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub y_m: Option<f64>,
    /// The observed number, in the unit of the quantity's name.
    pub value: f64,
    /// Its standard error, in the same unit.
    pub standard_error: f64,
}

/// Observations, written as rows or as columns.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(transparent)]
pub struct ObservationsForm(pub Vec<ObservationForm>);

/// How a posterior is sampled: an ensemble of walkers.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct McmcForm {
    /// Walkers, an even number; 32 if not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub walkers: Option<u64>,
    /// Steps of each, discarded ones included; 2000 if not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub steps: Option<u64>,
    /// Steps discarded at the beginning; a quarter of the steps if not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub burn_in: Option<u64>,
    /// Of the others every so many-th is kept; 1 if not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub thin: Option<u64>,
    /// Another seed gives other samples; 0 if not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seed: Option<u64>,
}

/// What is found and how, checked as far as it depends on no run.
#[derive(Debug, Clone, PartialEq)]
pub struct Calibrating {
    /// The parameters.
    pub unknowns: Vec<Unknown>,
    /// What they are found from.
    pub observations: Vec<Observation>,
    /// How they are fitted.
    pub fit: fit::Plan,
    /// How the posterior is sampled.
    pub mcmc: Option<sampler::Plan>,
}

/// Most starts of a fit.
const MOST_STARTS: u64 = 1_000;
/// Most observations.
const MOST_OBSERVATIONS: usize = 10_000;
/// Most steps of all walkers together: each is a steady solve.
const MOST_STEPS: u64 = 10_000_000;
/// Most samples that are kept: a row of the table each.
const MOST_SAMPLES: usize = 100_000;
/// Steady solves that a start takes as a rule.
const SOLVES: usize = 20;

impl<'de> Deserialize<'de> for ObservationsForm {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Columns {
            quantity: Vec<String>,
            #[serde(default)]
            x_m: Vec<Option<f64>>,
            #[serde(default)]
            y_m: Vec<Option<f64>>,
            value: Vec<f64>,
            standard_error: Vec<f64>,
        }
        struct Forms;
        impl<'de> Visitor<'de> for Forms {
            type Value = ObservationsForm;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a list of observations, or columns of one length by name")
            }

            fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<ObservationsForm, A::Error> {
                Vec::deserialize(SeqAccessDeserializer::new(seq)).map(ObservationsForm)
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<ObservationsForm, A::Error> {
                let columns = Columns::deserialize(MapAccessDeserializer::new(map))?;
                let rows = columns.quantity.len();
                let optional = [columns.x_m.len(), columns.y_m.len()];
                let lengths = [columns.value.len(), columns.standard_error.len()];
                if lengths.iter().any(|n| *n != rows)
                    || optional.iter().any(|n| ![0, rows].contains(n))
                {
                    let message = format!("columns of different lengths; expected {rows} in each");
                    return Err(serde::de::Error::custom(message));
                }
                // TOML has no null; a place that is no number is none.
                let place = |column: &[Option<f64>], row: usize| {
                    column.get(row).copied().flatten().filter(|place| !place.is_nan())
                };
                let row = |(i, quantity): (usize, String)| ObservationForm {
                    quantity,
                    x_m: place(&columns.x_m, i),
                    y_m: place(&columns.y_m, i),
                    value: columns.value[i],
                    standard_error: columns.standard_error[i],
                };
                let rows = columns.quantity.into_iter().enumerate().map(row);
                Ok(ObservationsForm(rows.collect()))
            }
        }
        deserializer.deserialize_any(Forms)
    }
}

impl CalibrationForm {
    /// What is found and how.
    pub fn calibrating(&self) -> Result<Calibrating, Refusal> {
        let unknown = |(name, (smallest, largest)): &(String, (f64, f64))| {
            let known = || format!("one of {}", Control::names().join(", "));
            let control = Control::named(name)
                .ok_or_else(|| Refusal::value("calibration.parameters", name.as_str(), known()))?;
            Ok(Unknown { control, smallest: *smallest, largest: *largest })
        };
        let rows = &self.observations.0;
        if rows.len() > MOST_OBSERVATIONS {
            let permitted = format!("at most {MOST_OBSERVATIONS} observations");
            return Err(Refusal::value("calibration.observations", rows.len(), permitted));
        }
        let defaults = fit::Plan::default();
        let starts = self.starts.unwrap_or(defaults.starts as u64);
        if !(1..=MOST_STARTS).contains(&starts) {
            let permitted = format!("a whole number from 1 to {MOST_STARTS}");
            return Err(Refusal::value("calibration.starts", starts, permitted));
        }
        let unknowns: Vec<Unknown> =
            self.parameters.0.iter().map(unknown).collect::<Result<_, Refusal>>()?;
        let mcmc = self.mcmc.as_ref().map(|mcmc| mcmc.plan(unknowns.len())).transpose()?;
        Ok(Calibrating {
            observations: rows.iter().enumerate().map(observation).collect::<Result<_, _>>()?,
            unknowns,
            fit: fit::Plan { starts: starts as usize, seed: self.seed.unwrap_or(0), ..defaults },
            mcmc,
        })
    }
}

fn observation((i, row): (usize, &ObservationForm)) -> Result<Observation, Refusal> {
    let field = format!("calibration.observations[{i}]");
    let observed = Observed::named(&row.quantity, row.x_m, row.y_m).map_err(|e| match e {
        CalibrationError::MissingPlace { field: place, .. } => {
            let why = format!("`{}` is observed at a place", row.quantity);
            Refusal::missing(&format!("{field}.{place}"), &why)
        }
        CalibrationError::SuperfluousPlace { field: place, .. } => {
            let why = format!("`{}` has no such coordinate", row.quantity);
            Refusal::out_of_place(&format!("{field}.{place}"), &why)
        }
        _ => {
            let known = format!("one of {}", names().join(", "));
            Refusal::value(format!("{field}.quantity"), row.quantity.as_str(), known)
        }
    })?;
    Ok(Observation { observed, value: row.value, standard_error: row.standard_error })
}

impl McmcForm {
    fn plan(&self, parameters: usize) -> Result<sampler::Plan, Refusal> {
        let defaults = sampler::Plan::default();
        let steps = self.steps.unwrap_or(defaults.steps as u64);
        let walkers = self.walkers.unwrap_or(defaults.walkers as u64);
        if steps.saturating_mul(walkers.max(1)) > MOST_STEPS {
            let permitted = format!("at most {MOST_STEPS} steps of all walkers together");
            return Err(Refusal::value("calibration.mcmc.steps", steps, permitted));
        }
        let plan = sampler::Plan {
            walkers: walkers as usize,
            steps: steps as usize,
            burn_in: self.burn_in.unwrap_or(steps / 4).min(MOST_STEPS) as usize,
            thinning: self.thin.unwrap_or(defaults.thinning as u64).min(MOST_STEPS) as usize,
            seed: self.seed.unwrap_or(0),
        };
        plan.check(parameters).map_err(|e| match e {
            SamplerError::OutOfRange { field, value, permitted } => {
                let field = if field == "thinning" { "thin" } else { field };
                Refusal::value(format!("calibration.mcmc.{field}"), value, permitted)
            }
            e => Refusal::sentence(e.to_string()),
        })?;
        let kept = samples(&plan);
        if kept > MOST_SAMPLES {
            let permitted = format!(
                "enough that at most {MOST_SAMPLES} samples are kept, and they would be {kept}"
            );
            return Err(Refusal::value("calibration.mcmc.thin", plan.thinning, permitted));
        }
        Ok(plan)
    }
}

/// Samples that a plan keeps.
fn samples(plan: &sampler::Plan) -> usize {
    plan.walkers * (plan.steps.saturating_sub(plan.burn_in) / plan.thinning.max(1))
}

impl Calibrating {
    /// Numbers that are stored.
    pub fn stored_numbers(&self) -> usize {
        let n = self.unknowns.len();
        let samples = self.mcmc.as_ref().map_or(0, samples);
        8 * self.observations.len()
            + n * (20 + 3 * n)
            + self.fit.starts * (2 * n + 6)
            + samples * (n + 1)
    }

    /// Steady solves.
    pub fn solves(&self) -> f64 {
        let sampled = self.mcmc.as_ref().map_or(0, |plan| plan.walkers * plan.steps);
        (self.fit.starts * SOLVES + sampled) as f64
    }
}

impl RunSpec {
    /// The calibration of this run's mélange.
    pub fn calibration(&self, what: &Calibrating) -> Result<Calibration, CalibrationError> {
        Calibration::new(self.model.clone(), what.unknowns.clone(), what.observations.clone())
    }

    /// Refuses what cannot be found, or not from that.
    pub(super) fn check_calibration(&self) -> Result<(), Refusal> {
        let Some(what) = &self.shared.calibrating else { return Ok(()) };
        self.calibration(what).map_err(|e| refusal(&e))?;
        // A terminus that moves has no steady state everywhere.
        for unknown in &what.unknowns {
            for (i, value) in [unknown.smallest, unknown.largest].into_iter().enumerate() {
                let mut there = Setting { model: self.model.clone(), law: None };
                unknown.control.set(&mut there, value);
                there.model.check_steady().map_err(|e| {
                    let field = format!("calibration.parameters.{}[{i}]", unknown.control.name());
                    Refusal::number(field, value, format!("no value at which {e}"))
                })?;
            }
        }
        Ok(())
    }
}

/// The refusal of a calibration that cannot be done.
fn refusal(e: &CalibrationError) -> Refusal {
    let about = |field: &str| Refusal {
        field: Some(format!("calibration.{field}")),
        ..Refusal::sentence(e.to_string())
    };
    match e {
        CalibrationError::OutOfRange { field, value, permitted } => {
            let field = match field.strip_prefix("unknowns.") {
                None => format!("calibration.{field}"),
                Some(name) => {
                    if let Some(name) = name.strip_suffix(".smallest") {
                        format!("calibration.parameters.{name}[0]")
                    } else if let Some(name) = name.strip_suffix(".largest") {
                        format!("calibration.parameters.{name}[1]")
                    } else {
                        format!("parameters.{name}")
                    }
                }
            };
            Refusal::number(field, *value, permitted.as_str())
        }
        CalibrationError::Parameter(ParameterError::Contradiction { name, permitted, .. }) => {
            Refusal::value("calibration.parameters", *name, permitted.as_str())
        }
        CalibrationError::NotIndependent { .. } => about("parameters"),
        CalibrationError::TooFewObservations { .. } => about("observations"),
        _ => Refusal::sentence(e.to_string()),
    }
}
