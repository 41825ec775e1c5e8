//! From parameters to residuals and their slopes, by way of a steady state sought beside the last one
//! found. Knows neither who asks nor what for.

use super::Calibration;
use super::descent::LeastSquares;
use super::observations::slopes_by_ln;
use crate::Solver;
use crate::control::Setting;
use crate::sensitivity::Linearised;
use crate::state::State;
use crate::steady::SteadyVerdict;
use crate::trail::Trail;

/// Solves a calibration's steady states; what it has found before saves time and changes no answer. One
/// serves one thread.
#[derive(Debug, Clone)]
pub struct Forward<'a> {
    calibration: &'a Calibration,
    solver: Solver,
    near: Option<Trail>,
    /// Steady solves done.
    pub solves: usize,
    /// Those that found no steady state.
    pub without_state: usize,
    /// Evidence at the last of these, or of the last state that could not be differentiated.
    pub reason: String,
}

/// A steady state beside the observations.
#[derive(Debug, Clone, PartialEq)]
pub struct Compared {
    /// The mélange.
    pub setting: Setting,
    /// Its steady state.
    pub state: State,
    /// What the model predicts, in the order and the units of the observations.
    pub predictions: Vec<f64>,
    /// (prediction − value)/standard error of each observation.
    pub residuals: Vec<f64>,
}

impl Compared {
    /// χ², the sum of the residuals' squares.
    pub fn chi2(&self) -> f64 {
        self.residuals.iter().map(|r| r * r).sum()
    }
}

impl<'a> Forward<'a> {
    /// For a calibration, with nothing found yet.
    pub fn new(calibration: &'a Calibration) -> Self {
        Self {
            calibration,
            solver: calibration.solver(),
            near: None,
            solves: 0,
            without_state: 0,
            reason: String::new(),
        }
    }

    /// The same, which has found what this one has and done nothing for it.
    pub(crate) fn uncounted(&self) -> Self {
        Self { solves: 0, without_state: 0, ..self.clone() }
    }

    /// The steady state at ln p, which lies within the bounds; none where the mélange has none, or where
    /// the solver finds none.
    pub fn compare(&mut self, ln_p: &[f64]) -> Option<Compared> {
        self.solves += 1;
        let compared = self.compared(self.calibration.setting_at(ln_p));
        compared
            .map_err(|reason| (self.without_state, self.reason) = (self.without_state + 1, reason))
            .ok()
    }

    fn compared(&mut self, setting: Setting) -> Result<Compared, String> {
        setting.model.parameters().check().map_err(|error| error.to_string())?;
        self.solver.retarget(setting.model.clone());
        let verdict = self.solver.steady(self.near.as_ref()).map_err(|error| error.to_string())?;
        let state = match verdict {
            SteadyVerdict::Converged { solution, trail } => {
                self.near = Some(trail);
                solution.state
            }
            SteadyVerdict::NoSteadyState(evidence)
            | SteadyVerdict::Overthick(evidence)
            | SteadyVerdict::FjordClosed(evidence) => return Err(evidence),
        };
        let observations = self.calibration.observations();
        let predictions: Vec<f64> =
            observations.iter().map(|o| o.observed.prediction(&setting, &state)).collect();
        let residuals: Vec<f64> =
            observations.iter().zip(&predictions).map(|(o, q)| o.residual(*q)).collect();
        if let Some(i) = residuals.iter().position(|r| !r.is_finite()) {
            return Err(format!("the prediction of observations[{i}] is {}", predictions[i]));
        }
        Ok(Compared { setting, state, predictions, residuals })
    }

    /// −χ²/2 at ln p; −∞ beyond the bounds and where there is no steady state.
    pub fn log_likelihood(&mut self, ln_p: &[f64]) -> f64 {
        if !self.calibration.bounds_ln().contain(ln_p) {
            return f64::NEG_INFINITY;
        }
        self.compare(ln_p).map_or(f64::NEG_INFINITY, |compared| -0.5 * compared.chi2())
    }
}

impl LeastSquares for Forward<'_> {
    type Point = Compared;

    fn at(&mut self, ln_p: &[f64]) -> Option<Compared> {
        self.compare(ln_p)
    }

    fn residuals(point: &Compared) -> &[f64] {
        &point.residuals
    }

    fn slopes(&mut self, point: &Compared) -> Option<Vec<Vec<f64>>> {
        let Compared { setting, state, .. } = point;
        let observations = self.calibration.observations();
        let linearised = Linearised::at(setting, state);
        let mut linearised = linearised.map_err(|error| self.reason = error.to_string()).ok()?;
        let by_unknown = self.calibration.unknowns().iter().map(|unknown| {
            let tangent = linearised.tangent(unknown.control).ok()?;
            let slopes = slopes_by_ln(observations, setting, state, unknown.control, &tangent);
            Some(observations.iter().zip(slopes).map(|(o, by)| by / o.standard_error).collect())
        });
        by_unknown.collect()
    }
}
