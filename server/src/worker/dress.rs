//! What a solve came to, dressed as an outcome: every number of it, read off the state.

use super::record::{Record, profile};
use crate::domain::calibrated::{Calibrated, CalibrationRow};
use crate::domain::curve::{BranchCurve, CurveRow, FoldCurve};
use crate::domain::discrete_root::RootRow;
use crate::domain::document::Regime;
use crate::domain::outcome::{
    EffectiveParameters, GridErrorDetail, GridQuantity, Outcome, Scalars,
};
use crate::domain::run::RunSpec;
use crate::domain::sensitivity::SensitivityRow;
use crate::domain::status::Status;
use crate::domain::stored_state::transect_profile;
use melange_solver::Model;
use melange_solver::diagnose::{
    Budget, Caveat, cfl_time_step_a, inertial_number, strain_rates_per_a,
};
use melange_solver::force;
use melange_solver::grid_error::{Convergence, GridError};
use melange_solver::state::State;

/// What a solve came to.
pub struct Ended {
    /// How it ended.
    pub status: Status,
    /// One sentence on it.
    pub detail: String,
    /// Newton iterations.
    pub iterations: usize,
    /// Residual norm of the last solve.
    pub residual_norm: f64,
    /// Residual norms of a solve that gave up, oldest first.
    pub residual_history: Option<Vec<f64>>,
    /// Attempts made, the last of which gave the answer if there is one.
    pub attempts: u64,
    /// Last state.
    pub state: Option<State>,
    /// The model in force at the end, where it differs from the run's.
    pub model: Option<Model>,
    /// X₀ at the end, m.
    pub terminus_x_m: f64,
    /// Which rule picked the root.
    pub root_evidence: Option<&'static str>,
    /// Time reached and what was recorded, of a transient.
    pub transient: Option<(f64, Record)>,
    /// Rows of a branch or a curve of folds.
    pub curve: Vec<CurveRow>,
    /// Rows of a calibration.
    pub calibrated: Vec<CalibrationRow>,
    /// Derivatives, if asked.
    pub sensitivities: Vec<SensitivityRow>,
    /// Discrete roots, if asked.
    pub discrete_roots: Vec<RootRow>,
    /// What three grids say, if asked, or why they say nothing.
    pub grid_error: Option<Result<GridError, String>>,
}

impl Ended {
    /// Without a state.
    pub fn verdict(status: Status, detail: String) -> Self {
        Self {
            status,
            detail,
            iterations: 0,
            residual_norm: f64::NAN,
            residual_history: None,
            attempts: 1,
            state: None,
            model: None,
            terminus_x_m: 0.0,
            root_evidence: None,
            transient: None,
            curve: Vec::new(),
            calibrated: Vec::new(),
            sensitivities: Vec::new(),
            discrete_roots: Vec::new(),
            grid_error: None,
        }
    }
}

/// The outcome of a run; its numbers are those of the parameters in force at the end.
pub fn outcome(run: &RunSpec, ended: Ended) -> Outcome {
    let model = ended.model.clone().unwrap_or_else(|| run.model.clone());
    let told = ended.grid_error.as_ref().map(|told| told.as_ref().map(grid_error_detail));
    let mut scalars =
        ended.state.as_ref().map_or_else(Scalars::default, |s| scalars(run, &model, &ended, s));
    if let Some(Ok(detail)) = &told {
        let error = |name| detail.quantities.iter().find(|q| q.name == name).map(|q| q.error);
        scalars.grid_error_length_m = error("length_m");
        scalars.grid_error_thickness_0_m = error("thickness_0_m");
        scalars.grid_error_force_n_per_m = error("force_n_per_m");
    }
    scalars.end_time_a = ended.transient.as_ref().map(|(time_a, _)| *time_a);
    let x_m = ended.terminus_x_m;
    let inertial = scalars.inertial_number.unwrap_or_default();
    let of = |s| Caveat::of(model.parameters(), s, inertial);
    let mut caveats = ended.state.as_ref().map_or_else(Vec::new, of);
    let squeezed = |r: &Record| Caveat::compressed(model.parameters(), r.strain_rate_min_per_a);
    if ended.transient.as_ref().is_some_and(|(_, record)| squeezed(record))
        && !caveats.contains(&Caveat::Compression)
    {
        caveats.insert(0, Caveat::Compression);
    }
    let names: Vec<&str> = caveats.into_iter().map(Caveat::name).collect();
    let transects = ended.state.iter().flat_map(|s| {
        run.shared.transects_at_chi.iter().map(|chi| transect_profile(&model, s, x_m, *chi))
    });
    let transects = transects.collect();
    let (series, states) = match ended.transient {
        Some((_, record)) => (Some(record.series), Some(record.states)),
        None => (None, None),
    };
    let finite = |norms: Vec<f64>| norms.into_iter().filter(|norm| norm.is_finite()).collect();
    let residual_history: Option<Vec<f64>> = ended.residual_history.map(finite);
    let curve = Some(ended.curve).filter(|rows| !rows.is_empty());
    let (branch, fold_curve) = match run.shared.regime {
        Regime::FoldCurve => (None, curve.map(FoldCurve)),
        _ => (curve.map(BranchCurve), None),
    };
    Outcome {
        status: ended.status,
        detail: ended.detail,
        parameters: EffectiveParameters(*run.parameters()),
        regime: run.shared.regime.name().to_owned(),
        upstream_closure: run.model.closure().name().to_owned(),
        scalars: scalars.finite(),
        iterations: ended.iterations as u64,
        attempts: ended.attempts,
        residual_history: residual_history.filter(|norms| !norms.is_empty()),
        root_evidence: ended.root_evidence.map(str::to_owned),
        validity: (!names.is_empty()).then(|| names.join(", ")),
        grid_convergence: told.as_ref().map(grid_convergence),
        grid_error: told.and_then(Result::ok),
        profile: ended.state.as_ref().map(profile),
        series,
        states,
        branch,
        fold_curve,
        calibration: Some(ended.calibrated).filter(|rows| !rows.is_empty()).map(Calibrated),
        sensitivities: ended.sensitivities,
        discrete_roots: ended.discrete_roots,
        transects,
        provenance: None,
    }
}

fn scalars(run: &RunSpec, model: &Model, ended: &Ended, s: &State) -> Scalars {
    let x_m = ended.terminus_x_m;
    let budget = Budget::of(model, s, x_m);
    let record = ended.transient.as_ref().map(|(_, record)| record);
    let (smallest, _) = strain_rates_per_a(s);
    Scalars {
        length_m: Some(s.length_m),
        thickness_0_m: Some(s.thickness_0_m()),
        force_n_per_m: Some(force::force_n_per_m(s)),
        force_quasi_static_n_per_m: Some(force::force_quasi_static_n_per_m(s)),
        velocity_end_m_per_a: Some(s.velocity_m_per_a[s.n_cells()]),
        volume_m3: Some(force::volume_m3(model, s, x_m)),
        residual_norm: Some(ended.residual_norm),
        mass_budget_defect: is_steady(run.shared.regime).then(|| budget.steady_defect()),
        yielding_fraction: Some(force::yielding_fraction(model, s)),
        terminus_x_m: record.map(|_| x_m),
        inflow_m3_per_a: Some(budget.inflow_m3_per_a),
        melt_m3_per_a: Some(budget.melt_m3_per_a),
        outflow_m3_per_a: Some(budget.outflow_m3_per_a),
        strain_rate_0_per_a: Some(s.strain_rate_per_a(0)),
        strain_rate_min_per_a: Some(record.map_or(smallest, |r| r.strain_rate_min_per_a)),
        inertial_number: Some(inertial_number(model, s, x_m)),
        cfl_time_step_a: Some(cfl_time_step_a(s)),
        cfl_number: record.map(|r| r.cfl_number),
        ..Scalars::default()
    }
}

/// Whether the state of a result is a steady one.
fn is_steady(regime: Regime) -> bool {
    matches!(regime, Regime::Steady | Regime::Branch | Regime::FoldCurve | Regime::Calibration)
}

fn grid_error_detail(told: &GridError) -> GridErrorDetail {
    let quantity = |name, c: &Convergence| GridQuantity {
        name,
        values: c.values,
        observed_order: c.observed_order,
        extrapolated: c.extrapolated,
        verdict: if c.is_asymptotic() { "asymptotic" } else { "not asymptotic" },
        error: c.error,
    };
    GridErrorDetail {
        n_cells: told.n_cells,
        quantities: vec![
            quantity("length_m", &told.length),
            quantity("thickness_0_m", &told.thickness_0),
            quantity("force_n_per_m", &told.force),
        ],
    }
}

/// One phrase on whether the errors are estimates or spreads.
fn grid_convergence(told: &Result<GridErrorDetail, &String>) -> String {
    let detail = match told {
        Ok(detail) => detail,
        Err(reason) => return format!("unknown: {reason}"),
    };
    let spread: Vec<&str> =
        (detail.quantities.iter()).filter(|q| q.extrapolated.is_none()).map(|q| q.name).collect();
    if spread.is_empty() {
        "asymptotic".into()
    } else {
        format!("not asymptotic: {}", spread.join(", "))
    }
}
