//! The discrete steady states beside the one that the rule picks, put into rows.

use crate::domain::discrete_root::RootRow;
use melange_solver::control::Setting;
use melange_solver::roots::DiscreteRoot;
use melange_solver::sensitivity::Linearised;
use melange_solver::{Model, Solution, Solver, force};

/// All discrete roots that are found from the picked one, which is the first of them; and a phrase on them, if
/// there are several.
pub fn discrete_roots(model: &Model, picked: &Solution) -> (Vec<RootRow>, Option<String>) {
    // A solver of its own: the walk through the runs goes on as if there were no others.
    let roots = Solver::new(model.clone()).discrete_roots_beside(picked);
    let setting = Setting { model: model.clone(), law: None };
    let rows = roots.iter().enumerate().map(|(i, root)| row(&setting, i, root)).collect();
    let phrase = (roots.len() > 1).then(|| {
        let which = match roots[0].cells_at_rest.as_slice() {
            [] => "no cell at rest".to_owned(),
            [cell] => format!("cell {cell} at rest"),
            cells => format!("{} cells at rest", cells.len()),
        };
        format!(
            "one of {} discrete roots found; the rule picks the one with H_0 = {:.6} m and {which}",
            roots.len(),
            picked.state.thickness_0_m(),
        )
    });
    (rows, phrase)
}

fn row(setting: &Setting, number: usize, root: &DiscreteRoot) -> RootRow {
    let s = &root.state;
    let spectrum = Linearised::at(setting, s).ok().and_then(|linearised| linearised.spectrum());
    RootRow {
        root: Some(number as i64),
        is_picked: Some(root.is_picked),
        cells_at_rest: Some(root.cells_at_rest.iter().map(|cell| *cell as i64).collect()),
        stable: spectrum.as_ref().map(|spectrum| spectrum.is_stable()),
        growth_rate_re_per_a: spectrum
            .as_ref()
            .and_then(|spectrum| spectrum.rates.first())
            .map(|rate| rate.re_per_a),
        thickness_0_m: Some(s.thickness_0_m()),
        length_m: Some(s.length_m),
        force_n_per_m: Some(force::force_n_per_m(s)),
        force_quasi_static_n_per_m: Some(force::force_quasi_static_n_per_m(s)),
        velocity_end_m_per_a: Some(s.velocity_m_per_a[s.n_cells()]),
        volume_m3: Some(force::volume_m3(&setting.model, s, 0.0)),
        residual_norm: Some(root.residual_norm),
    }
}
