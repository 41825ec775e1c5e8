//! Calibrations: fitted, sampled if that is asked for, and put into rows.

use super::super::dress::Ended;
use super::SMOOTHING_LIMIT;
use crate::domain::calibrated::CalibrationRow;
use crate::domain::calibration::Calibrating;
use crate::domain::outcome::SCALARS;
use crate::domain::run::RunSpec;
use crate::domain::status::Status;
use melange_solver::calibration::descent::{Bound, Ending};
use melange_solver::calibration::fit::{self, Fit, Outcome, Start};
use melange_solver::calibration::observations::Observed;
use melange_solver::calibration::posterior::{self, Posterior, PosteriorError};
use melange_solver::calibration::{Calibration, CalibrationError};
use std::ops::ControlFlow;

/// Fits the run's calibration, and samples its posterior; `None` if `stop` said so on the way.
pub fn calibrated(run: &RunSpec, what: &Calibrating, stop: &dyn Fn() -> bool) -> Option<Ended> {
    let go_on = || if stop() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) };
    let failed = |detail: String| Some(Ended::verdict(Status::Failed, detail));
    let calibration = match run.calibration(what) {
        Ok(calibration) => calibration,
        Err(e) => return failed(e.to_string()),
    };
    let found = match fit::fit(&calibration, &what.fit, &mut |_| go_on()) {
        Ok(found) => found,
        Err(CalibrationError::Stopped { .. }) => return None,
        Err(e @ CalibrationError::NoSteadyState { .. }) => {
            return Some(Ended::verdict(Status::NoSteadyState, e.to_string()));
        }
        Err(e) => return failed(e.to_string()),
    };
    let mut detail = told(&found);
    let mut rows = fitted(&calibration, &found);
    if let Some(plan) = &what.mcmc {
        let sampled = posterior::sample(&calibration, &found, plan, &mut |_| go_on());
        if stop() {
            return None;
        }
        match sampled {
            Ok(posterior) => {
                detail += if posterior.chain.is_long_enough() {
                    "; the samples are enough to be believed"
                } else {
                    "; the chain is shorter than 50 autocorrelation times, so that its quantiles are rough"
                };
                rows.extend(sampled_rows(&calibration, &posterior));
            }
            Err(PosteriorError::Calibration(CalibrationError::Stopped { .. })) => return None,
            // It takes nothing from the fit.
            Err(e) => detail += &format!("; no samples: {e}"),
        }
    }
    let ln_p: Vec<f64> = found.estimates.iter().map(|estimate| estimate.value.ln()).collect();
    let status = match found.ending {
        Ending::Converged | Ending::Stalled => Status::Converged,
        Ending::TooManyIterations => Status::Failed,
    };
    Some(Ended {
        iterations: found.solves,
        state: Some(found.state),
        model: Some(calibration.setting_at(&ln_p).model),
        root_evidence: Some(SMOOTHING_LIMIT),
        calibrated: rows,
        ..Ended::verdict(status, detail)
    })
}

fn told(found: &Fit) -> String {
    let mut detail =
        format!("chi2 = {:.4} with {} degrees of freedom", found.chi2, found.degrees_of_freedom);
    if found.ending == Ending::TooManyIterations {
        detail += "; the best descent did not end within its steps";
    }
    if found.minima > 1 {
        detail += &format!("; the starts led to {} minima", found.minima);
    }
    if found.beyond > 0 {
        detail += &format!("; {} observations lie beyond the fitted mélange's end", found.beyond);
    }
    format!("{detail}; {}", found.uncertainty.weakest())
}

fn of_kind(kind: &str) -> CalibrationRow {
    CalibrationRow { kind: Some(kind.to_owned()), ..CalibrationRow::default() }
}

fn fitted(calibration: &Calibration, found: &Fit) -> Vec<CalibrationRow> {
    let known = &found.uncertainty;
    let unknowns = calibration.unknowns();
    // The place of each parameter among those at no bound, to which uncertainties are about.
    let places: Vec<Option<usize>> = (unknowns.iter())
        .map(|unknown| known.free.iter().position(|free| *free == unknown.control))
        .collect();
    let row_of = |matrix: &Option<Vec<Vec<f64>>>, k: usize| -> Option<Vec<f64>> {
        let row = &matrix.as_ref()?[places[k]?];
        Some(places.iter().map(|place| place.map_or(0.0, |place| row[place])).collect())
    };
    let mut rows = vec![CalibrationRow {
        chi2: Some(found.chi2),
        ending: Some(name_of(found.ending).to_owned()),
        degrees_of_freedom: Some(found.degrees_of_freedom as i64),
        condition_number: Some(known.condition_number()),
        best_start: Some(found.best_start as i64),
        minima: Some(found.minima as i64),
        beyond: Some(found.beyond as i64),
        solves: Some(found.solves as i64),
        without_state: Some(found.without_state as i64),
        detail: Some(known.weakest()),
        ..of_kind("fit")
    }];
    for (k, (estimate, unknown)) in found.estimates.iter().zip(unknowns).enumerate() {
        let bound = |bound| match bound {
            Bound::Smallest => "smallest".to_owned(),
            Bound::Largest => "largest".to_owned(),
        };
        rows.push(CalibrationRow {
            parameter: Some(estimate.control.name().to_owned()),
            unit: Some(estimate.control.unit().to_owned()),
            value: Some(estimate.value),
            bounds: Some(vec![unknown.smallest, unknown.largest]),
            at_bound: estimate.at_bound.map(bound),
            standard_error: estimate.standard_error_ln.map(|ln| ln * estimate.value),
            standard_error_ln: estimate.standard_error_ln,
            ci95: estimate.interval_95.map(Vec::from),
            covariance_ln: row_of(&known.covariance_ln, k),
            correlation: row_of(&known.correlation, k),
            ..of_kind("estimate")
        });
    }
    for direction in &known.directions {
        let exponent = |place: &Option<usize>| place.map_or(0.0, |p| direction.exponents[p]);
        rows.push(CalibrationRow {
            product: Some(direction.product(&known.free)),
            exponents: Some(places.iter().map(exponent).collect()),
            standard_error_ln: Some(direction.standard_error_ln),
            ..of_kind("direction")
        });
    }
    for (observation, prediction) in calibration.observations().iter().zip(&found.predictions) {
        rows.push(CalibrationRow {
            quantity: Some(observation.observed.name().to_owned()),
            unit: Some(unit_of(observation.observed).to_owned()),
            x_m: observation.observed.x_m(),
            y_m: observation.observed.y_m(),
            value: Some(observation.value),
            standard_error: Some(observation.standard_error),
            prediction: Some(prediction.value),
            residual: Some(prediction.residual),
            is_beyond: Some(prediction.is_beyond),
            ..of_kind("residual")
        });
    }
    rows.extend(found.starts.iter().enumerate().map(|(k, start)| start_row(k, start)));
    rows
}

fn start_row(k: usize, start: &Start) -> CalibrationRow {
    let row = CalibrationRow {
        start: Some(k as i64),
        from: Some(start.from.clone()),
        ..of_kind("start")
    };
    match &start.outcome {
        Outcome::Arrived { to, chi2, iterations, ending, minimum, .. } => CalibrationRow {
            to: Some(to.clone()),
            chi2: Some(*chi2),
            iterations: Some(*iterations as i64),
            ending: Some(name_of(*ending).to_owned()),
            minimum: minimum.map(|minimum| minimum as i64),
            ..row
        },
        Outcome::NoSteadyState { reason } => CalibrationRow {
            ending: Some("no_steady_state".to_owned()),
            detail: Some(reason.clone()),
            ..row
        },
    }
}

fn sampled_rows(calibration: &Calibration, posterior: &Posterior) -> Vec<CalibrationRow> {
    let chain = &posterior.chain;
    let mut rows = vec![CalibrationRow {
        acceptance: Some(chain.acceptance()),
        is_long_enough: Some(chain.is_long_enough()),
        iterations: Some(chain.steps() as i64),
        solves: Some(posterior.solves as i64),
        without_state: Some(posterior.without_state as i64),
        ..of_kind("sampling")
    }];
    for (marginal, correlation) in posterior.marginals.iter().zip(&posterior.correlation) {
        rows.push(CalibrationRow {
            parameter: Some(marginal.control.name().to_owned()),
            unit: Some(marginal.control.unit().to_owned()),
            mean_ln: Some(marginal.mean_ln),
            standard_deviation_ln: Some(marginal.standard_deviation_ln),
            quantiles: Some(marginal.quantiles.to_vec()),
            correlation: Some(correlation.clone()),
            autocorrelation_steps: Some(marginal.autocorrelation_steps),
            effective_samples: Some(marginal.effective_samples),
            ..of_kind("marginal")
        });
    }
    let unknowns = calibration.unknowns();
    for (ln_p, log_density) in chain.samples().zip(chain.log_densities()) {
        let values = unknowns.iter().zip(ln_p).map(|(unknown, ln)| unknown.value(*ln));
        rows.push(CalibrationRow {
            parameters: Some(values.collect()),
            chi2: Some(-2.0 * log_density),
            ..of_kind("sample")
        });
    }
    rows
}

fn name_of(ending: Ending) -> &'static str {
    match ending {
        Ending::Converged => "converged",
        Ending::Stalled => "stalled",
        Ending::TooManyIterations => "too_many_iterations",
    }
}

fn unit_of(observed: Observed) -> &'static str {
    match observed {
        Observed::Thickness { .. } => "m",
        Observed::Velocity { .. } | Observed::VelocityAcross { .. } => "m a-1",
        Observed::Whole(quantity) => {
            SCALARS.iter().find(|info| info.name == quantity.name()).map_or("1", |info| info.unit)
        }
    }
}
