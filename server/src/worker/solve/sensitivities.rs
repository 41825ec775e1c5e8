//! Derivatives of a steady state's numbers, put into rows.

use crate::domain::sensitivity::SensitivityRow;
use melange_solver::Model;
use melange_solver::control::Setting;
use melange_solver::error::SolveError;
use melange_solver::physics::given::Given;
use melange_solver::sensitivity::{Linearised, Quantity, Sensitivity};
use melange_solver::state::State;

/// All quantities of a steady state by everything: one factorisation, and one solve for each quantity.
pub fn sensitivities(model: &Model, state: &State) -> Result<Vec<SensitivityRow>, SolveError> {
    let setting = Setting { model: model.clone(), law: None };
    let mut linearised = Linearised::at(&setting, state)?;
    let of = |quantity| linearised.sensitivity(quantity).map(|told| row(model, &told));
    Quantity::ALL.into_iter().map(of).collect()
}

fn row(model: &Model, told: &Sensitivity) -> SensitivityRow {
    let finite = |number: f64| Some(number).filter(|number| number.is_finite());
    let by_log = |given: Given| {
        let is_width = matches!(given, Given::Width | Given::WidthGradient);
        let p = (given.info().get)(model.parameters());
        let is_one = !is_width || model.fjord().is_straight();
        let is_told = is_one && p != 0.0 && told.value != 0.0;
        is_told.then(|| p / told.value * told.by[given as usize]).and_then(finite)
    };
    SensitivityRow {
        quantity: told.quantity.name().to_owned(),
        value: finite(told.value),
        by: told.by.map(finite),
        log_by: Given::ALL.map(by_log),
        by_melt: Some(told.by_melt.clone()).filter(|by| by.iter().all(|n| n.is_finite())),
    }
}
