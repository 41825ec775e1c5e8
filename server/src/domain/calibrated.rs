//! What a calibration found, as stored and as shown: the long table `calibrations`.

use super::rows::{self, Cell, Column, row};
use serde::ser::{Serialize, Serializer};
use utoipa::openapi::{RefOr, Schema};
use utoipa::{PartialSchema, ToSchema};

row! {
    /// A row of the table; units and meanings in its columns. What a row of its kind does not have is none.
    CalibrationRow;
    kind: String, "1", "what the row is: fit, estimate, direction, residual, start, sampling, marginal or sample";
    parameter: String, "1", "name of a parameter p that was found";
    unit: String, "1", "unit of the row's value, bounds, ci95 and quantiles; of an observation, that of its quantity";
    value: f64, "see unit", "the estimate; of a residual, the observed number";
    bounds: Vec<f64>, "see unit", "smallest and largest value that the parameter may take";
    at_bound: String, "1", "the bound that the estimate was stopped by, smallest or largest";
    standard_error_ln: f64, "1", "standard error of ln p, or of the logarithm of a direction's product; null at a bound, or where the data do not determine it";
    ci95: Vec<f64>, "see unit", "interval of 95 % about the estimate, normal in ln p, within the bounds";
    covariance_ln: Vec<f64>, "1", "covariance of ln p with ln p of each parameter, in the order of the estimates; 0 with one at a bound, which is taken as known";
    correlation: Vec<f64>, "1", "the same as correlation; of a marginal, from the samples";
    product: String, "1", "a combination of parameters that is known independently of the others";
    exponents: Vec<f64>, "1", "its exponents, in the order of the estimates, of length 1";
    quantity: String, "1", "name of an observed quantity";
    x_m: f64, "m", "distance of the observation from the terminus";
    y_m: f64, "m", "distance of the observation from the wall";
    standard_error: f64, "see unit", "standard error of the observation, or to first order of the estimate";
    prediction: f64, "see unit", "what the fitted model says";
    residual: f64, "1", "(prediction - value)/standard_error";
    is_beyond: bool, "1", "whether the observation lies beyond the fitted melange's end";
    start: i64, "1", "number of a start; 0 is the parameters as given";
    from: Vec<f64>, "1", "parameters that a start began with, in the order and units of the estimates";
    to: Vec<f64>, "1", "parameters that it led to";
    chi2: f64, "1", "sum of the residuals' squares";
    ending: String, "1", "how a descent ended: converged, stalled (as on a kink of the rheology), too_many_iterations or no_steady_state";
    iterations: i64, "1", "steps tried by a descent";
    minimum: i64, "1", "number of the minimum that a start led to, from 0, the lowest, on";
    degrees_of_freedom: i64, "1", "number of observations less that of parameters at no bound";
    condition_number: f64, "1", "ratio of the largest to the smallest eigenvalue of the information matrix; null if some combination is not determined";
    best_start: i64, "1", "start that led to the estimates";
    minima: i64, "1", "number of distinct minima found";
    beyond: i64, "1", "number of observations beyond the fitted melange's end";
    solves: i64, "1", "steady solves";
    without_state: i64, "1", "those of them without a steady state";
    acceptance: f64, "1", "share of the sampler's proposals that were taken";
    is_long_enough: bool, "1", "whether the chain is 50 autocorrelation times long in every parameter";
    mean_ln: f64, "1", "mean of ln p over the samples";
    standard_deviation_ln: f64, "1", "standard deviation of ln p over the samples";
    quantiles: Vec<f64>, "see unit", "quantiles of the samples at 2.5, 50 and 97.5 %";
    autocorrelation_steps: f64, "1", "steps after which a walker has forgotten where it was";
    effective_samples: f64, "1", "number of independent samples that say as much";
    parameters: Vec<f64>, "1", "a sample: the parameters, in the order and units of the estimates";
    detail: String, "1", "a sentence on the row";
}

impl Serialize for CalibrationRow {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let is_left_out = |column: &Column, cell: &Cell| column.name == "kind" || cell.is_none();
        rows::serialize(self, is_left_out, serializer)
    }
}

impl PartialSchema for CalibrationRow {
    fn schema() -> RefOr<Schema> {
        rows::schema::<Self>(|column| column.name == "kind")
    }
}

impl ToSchema for CalibrationRow {}

/// A calibration: rows of every kind.
#[derive(Debug, Clone, PartialEq)]
pub struct Calibrated(pub Vec<CalibrationRow>);

impl Calibrated {
    /// The rows of a kind.
    pub fn of_kind(&self, kind: &str) -> Vec<&CalibrationRow> {
        self.0.iter().filter(|row| row.kind.as_deref() == Some(kind)).collect()
    }
}

/// A calibration as it is shown.
#[derive(serde::Serialize, ToSchema)]
pub struct Calibration<'a> {
    /// How well the model agrees with the observations.
    fit: Option<&'a CalibrationRow>,
    /// The parameters found.
    estimates: Vec<&'a CalibrationRow>,
    /// Combinations of them that are known independently, the least known first.
    identifiability: Vec<&'a CalibrationRow>,
    /// The model beside each observation.
    residuals: Vec<&'a CalibrationRow>,
    /// What became of each start.
    starts: Vec<&'a CalibrationRow>,
    /// What the samples say, if asked; they themselves are in the table only.
    #[serde(skip_serializing_if = "Option::is_none")]
    mcmc: Option<Sampled<'a>>,
}

/// What samples of a posterior say.
#[derive(serde::Serialize, ToSchema)]
pub struct Sampled<'a> {
    /// How they were drawn.
    sampling: &'a CalibrationRow,
    /// The distribution of each parameter.
    marginals: Vec<&'a CalibrationRow>,
}

impl Serialize for Calibrated {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let first = |kind| self.of_kind(kind).first().copied();
        let calibration = Calibration {
            fit: first("fit"),
            estimates: self.of_kind("estimate"),
            identifiability: self.of_kind("direction"),
            residuals: self.of_kind("residual"),
            starts: self.of_kind("start"),
            mcmc: first("sampling")
                .map(|sampling| Sampled { sampling, marginals: self.of_kind("marginal") }),
        };
        calibration.serialize(serializer)
    }
}
