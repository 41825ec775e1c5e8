//! Calibration: which parameters make the steady state agree with what was observed, and how well they
//! are known then. Knows steady states by [`Solver::steady`], and of the equations nothing.
//!
//! | question | here |
//! |---|---|
//! | what is observed, what the model says to it | [`observations`] |
//! | the parameters nearest to the data | [`fit`], by the method of [`descent`] |
//! | what the data tell apart, to first order | [`uncertainty`] |
//! | what they tell apart where first order is not enough | [`posterior`], by the method of [`sampler`] |
//!
//! Parameters are positive and vary over decades, so everything is done in θ = ln p, within bounds. With
//! the observations q_i, their standard errors σ_i and what the model predicts, Q_i(θ),
//!
//! ```text
//!   χ²(θ) = Σ ((Q_i(θ) − q_i)/σ_i)²,   log-likelihood = −χ²/2 + const,
//! ```
//!
//! that is, errors are taken as independent and Gaussian, and the σ_i as known. Where the mélange that
//! parameters describe has no steady state the likelihood is 0.
//!
//! ```
//! use melange_solver::Model;
//! use melange_solver::calibration::fit::{Plan, fit};
//! use melange_solver::calibration::observations::{Observation, Observed};
//! use melange_solver::calibration::{Calibration, Unknown};
//! use melange_solver::control::Control;
//! use melange_solver::params::Parameters;
//! use melange_solver::physics::closure::UpstreamClosure;
//! use melange_solver::sensitivity::Quantity;
//! use std::ops::ControlFlow;
//!
//! let model = Model::new(Parameters::default(), UpstreamClosure::Published)?;
//! let mu_s = Control::named("mu_s").expect("it is a parameter");
//! let unknown = Unknown { control: mu_s, smallest: 0.1, largest: 0.6 };
//! let length = Observation {
//!     observed: Observed::Whole(Quantity::Length),
//!     value: 11_000.0,
//!     standard_error: 100.0,
//! };
//! let calibration = Calibration::new(model, vec![unknown], vec![length])?;
//! let found = fit(&calibration, &Plan::default(), &mut |_| ControlFlow::Continue(()))?;
//! assert!((found.predictions[0].value - 11_000.0).abs() < 1.0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod chain;
pub mod descent;
pub mod fit;
pub mod forward;
pub mod observations;
pub mod posterior;
mod random;
pub mod sampler;
pub mod uncertainty;

use crate::control::{Control, Setting};
use crate::error::SolveError;
use crate::params::ParameterError;
use crate::physics::closure::UpstreamClosure;
use crate::{Model, Solver};
use descent::Bounds;
use observations::Observation;

/// A parameter to be found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unknown {
    /// Which one.
    pub control: Control,
    /// Smallest value it may take, above 0, in the control's unit.
    pub smallest: f64,
    /// Largest value it may take.
    pub largest: f64,
}

/// What is to be found, from what, in which mélange; all checked.
#[derive(Debug, Clone, PartialEq)]
pub struct Calibration {
    setting: Setting,
    unknowns: Vec<Unknown>,
    observations: Vec<Observation>,
}

/// Why a calibration cannot be done, or was not.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum CalibrationError {
    /// A parameter that cannot be varied in this mélange.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// A model that has no steady states to compare with.
    #[error(transparent)]
    Model(#[from] SolveError),
    /// A number that makes no sense where it stands.
    #[error("`{field}` = {value} is out of range: {permitted}")]
    OutOfRange {
        /// The field: `observations[3].x_m`.
        field: String,
        /// Value given.
        value: f64,
        /// What is permitted.
        permitted: String,
    },
    /// A place that a quantity needs and that was not given.
    #[error("`{field}` is missing: `{quantity}` is observed at a place")]
    MissingPlace {
        /// The place's coordinate.
        field: &'static str,
        /// The quantity.
        quantity: String,
    },
    /// A place for a quantity that belongs to the mélange as a whole.
    #[error("`{field}` has no place here: `{quantity}` has no such coordinate")]
    SuperfluousPlace {
        /// The place's coordinate.
        field: &'static str,
        /// The quantity.
        quantity: String,
    },
    /// No such quantity.
    #[error("there is no quantity `{name}` to observe; known are {}", observations::names().join(", "))]
    UnknownQuantity {
        /// The name given.
        name: String,
    },
    /// Parameters that are the same, or that set one another.
    #[error("`{first}` and `{second}` cannot be found together: one sets the other")]
    NotIndependent {
        /// One.
        first: &'static str,
        /// The other.
        second: &'static str,
    },
    /// More unknowns than numbers to find them from, or none at all.
    #[error(
        "{unknowns} parameters cannot be found from {observations} observations: at least one parameter, and as many observations as parameters"
    )]
    TooFewObservations {
        /// Number of parameters.
        unknowns: usize,
        /// Number of observations.
        observations: usize,
    },
    /// No start had a steady state.
    #[error(
        "none of {starts} starts has a steady state to compare with the observations; the last one: {reason}"
    )]
    NoSteadyState {
        /// Number of starts.
        starts: usize,
        /// Evidence at the last one.
        reason: String,
    },
    /// The caller asked to stop.
    #[error("stopped by the caller after {solves} steady solves")]
    Stopped {
        /// Steady solves done.
        solves: usize,
    },
}

impl Calibration {
    /// Checks everything. A parameter's value in `model` is the first start of a fit and must lie between
    /// its bounds; observations are of the steady state with the terminus at X₀ = 0.
    pub fn new(
        model: Model,
        unknowns: Vec<Unknown>,
        observations: Vec<Observation>,
    ) -> Result<Self, CalibrationError> {
        if unknowns.is_empty() || observations.len() < unknowns.len() {
            return Err(CalibrationError::TooFewObservations {
                unknowns: unknowns.len(),
                observations: observations.len(),
            });
        }
        if model.closure() == UpstreamClosure::Printed {
            let closure = model.closure().name();
            return Err(SolveError::ClosureLeavesFamily { closure }.into());
        }
        let setting = Setting { model, law: None };
        for (i, unknown) in unknowns.iter().enumerate() {
            unknown.check(&setting)?;
            unknowns[..i].iter().try_for_each(|other| unknown.check_beside(other))?;
        }
        for (i, observation) in observations.iter().enumerate() {
            observation.check(&format!("observations[{i}]"), &setting.model)?;
        }
        Ok(Self { setting, unknowns, observations })
    }

    /// The mélange, with the parameters as they were given.
    pub fn model(&self) -> &Model {
        &self.setting.model
    }

    /// What is to be found.
    pub fn unknowns(&self) -> &[Unknown] {
        &self.unknowns
    }

    /// What it is found from.
    pub fn observations(&self) -> &[Observation] {
        &self.observations
    }

    /// The parameters as they were given: ln p.
    pub fn given_ln(&self) -> Vec<f64> {
        self.unknowns.iter().map(|u| u.control.value(&self.setting).ln()).collect()
    }

    /// The bounds of ln p.
    pub fn bounds_ln(&self) -> Bounds {
        Bounds {
            smallest: self.unknowns.iter().map(|u| u.smallest.ln()).collect(),
            largest: self.unknowns.iter().map(|u| u.largest.ln()).collect(),
        }
    }

    /// The mélange at ln p, which [`Bounds::contain`]; the parameters are not checked against each other.
    pub fn setting_at(&self, ln_p: &[f64]) -> Setting {
        let mut setting = self.setting.clone();
        for (unknown, ln) in self.unknowns.iter().zip(ln_p) {
            unknown.control.set(&mut setting, unknown.value(*ln));
        }
        setting
    }

    /// A solver for its mélange.
    fn solver(&self) -> Solver {
        Solver::new(self.setting.model.clone())
    }
}

impl Unknown {
    /// The value whose logarithm is given; rounding does not lead out of the bounds.
    pub fn value(&self, ln: f64) -> f64 {
        ln.exp().clamp(self.smallest, self.largest)
    }

    fn check(&self, setting: &Setting) -> Result<(), CalibrationError> {
        self.control.check(setting)?;
        let name = self.control.name();
        let out_of_range = |field: &str, value: f64, permitted: String| {
            let field = format!("unknowns.{name}{field}");
            Err(CalibrationError::OutOfRange { field, value, permitted })
        };
        let (smallest, largest) = self.control.range();
        if !(self.smallest.is_finite() && self.smallest > 0.0 && self.smallest >= smallest) {
            let permitted = match smallest > 0.0 {
                true => format!("a finite number from {smallest} on"),
                false => "a finite number above 0, since the logarithm is what varies".into(),
            };
            return out_of_range(".smallest", self.smallest, permitted);
        }
        if !(self.largest > self.smallest && self.largest <= largest) {
            let permitted = format!("above the smallest, {}, and up to {largest}", self.smallest);
            return out_of_range(".largest", self.largest, permitted);
        }
        let value = self.control.value(setting);
        if !(self.smallest..=self.largest).contains(&value) {
            let permitted = format!(
                "the model's own value between the bounds, {} and {}, as it is the first start",
                self.smallest, self.largest
            );
            return out_of_range("", value, permitted);
        }
        Ok(())
    }

    fn check_beside(&self, other: &Self) -> Result<(), CalibrationError> {
        let (a, b) = (self.control, other.control);
        if !a.is_independent_of(b) {
            return Err(CalibrationError::NotIndependent { first: b.name(), second: a.name() });
        }
        Ok(())
    }
}
