//! Whether a stored run can be the start of a sweep's runs.

use super::{ArchiveError, catalogue};
use crate::domain::refusal::Refusal;
use crate::domain::start::Start;
use crate::domain::sweep::SweepSpec;
use crate::store::Store;
use std::sync::Arc;

/// Refuses a start that names no stored run, or one whose state does not fit every run of the sweep.
pub async fn check(
    store: &Store,
    sweep: &Arc<SweepSpec>,
) -> Result<Result<(), Refusal>, ArchiveError> {
    let Some(Start::Run(id)) = &sweep.document().start else { return Ok(Ok(())) };
    let refusal = {
        let id = id.clone();
        move |permitted: String| Refusal::value("start.run", id.clone(), permitted)
    };
    let entry = catalogue::run(&mut *store.read().await?, id).await?;
    let Some(entry) = entry else {
        return Ok(Err(refusal("the id of a stored run".into())));
    };
    let (Some(length_m), Some(h0)) = (entry.scalars.length_m, entry.scalars.thickness_0_m) else {
        let status = entry.row.text("status");
        return Ok(Err(refusal(format!("a run with a state; this one ended {status}"))));
    };
    let p = &entry.parameters;
    let n_cells = p.n_cells;
    let terminus_x_m = entry.scalars.terminus_x_m.unwrap_or(0.0);
    let sweep = sweep.clone();
    let misfit = tokio::task::spawn_blocking(move || {
        (0..sweep.count()).map(|i| sweep.run(i).model).find_map(|model| {
            let p = model.parameters();
            let ends = [0.0, length_m].map(|x| model.fjord().width(terminus_x_m + x));
            if p.n_cells != n_cells {
                Some(format!("a run with n_cells = {}, and it has {n_cells}", p.n_cells))
            } else if !(h0 > p.d_m && h0 < p.terminus_thickness_m) {
                let (d, terminus) = (p.d_m, p.terminus_thickness_m);
                Some(format!("a run with H0 between {d} and {terminus} m, and its H0 is {h0} m"))
            } else if ends.iter().any(|width_m| *width_m <= 0.0) {
                Some(format!("a run in an open fjord, which at its end, {length_m} m, is closed"))
            } else {
                model.check_reach(terminus_x_m, length_m).err().map(|e| e.to_string())
            }
        })
    })
    .await?;
    Ok(misfit.map_or(Ok(()), |permitted| Err(refusal(permitted))))
}
