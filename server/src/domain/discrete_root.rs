//! The discrete steady states of a run, as stored and as shown: the long table `roots`.

use super::rows::{self, Row, row};
use serde::ser::{Serialize, Serializer};
use utoipa::openapi::{RefOr, Schema};
use utoipa::{PartialSchema, ToSchema};

row! {
    /// A row of the table; units and meanings in its columns.
    RootRow;
    root: i64, "1", "number of the root in its run: 0 is the one that the rule picks, the others follow from thick to thin";
    is_picked: bool, "1", "whether it is the one that the rule picks, whose numbers are the run's";
    cells_at_rest: Vec<i64>, "1", "interior cells that are not above yield, counted from 0 at the terminus";
    stable: bool, "1", "whether every small perturbation decays; null if the growth rates are not known";
    growth_rate_re_per_a: f64, "a-1", "growth rate of the fastest growing perturbation, real part";
    thickness_0_m: f64, "m", "thickness H_0 at the terminus, extrapolated";
    length_m: f64, "m", "length L of the melange";
    force_n_per_m: f64, "N m-1", "buttressing force per unit width F/W, Eq. 30";
    force_quasi_static_n_per_m: f64, "N m-1", "estimate of F/W that leaves out stretching";
    velocity_end_m_per_a: f64, "m a-1", "velocity U_L at the end, in the terminus frame";
    volume_m3: f64, "m3", "volume of the melange";
    residual_norm: f64, "1", "2-norm of the nondimensional residual";
}

/// Roots that a run usually has, at most; more only make it dearer than foreseen.
const USUAL_ROOTS: usize = 4;
/// Work of the search beside that of the steady state: 34 times with 20 cells, 90 with 50, up to 220 with 100.
const SEARCH: f64 = 100.0;
/// Cells at which growth rates take as long as a point of a branch.
const EVEN: f64 = 25.0;

impl RootRow {
    /// Numbers that a run usually stores.
    pub fn usual_numbers() -> usize {
        USUAL_ROOTS * Self::columns().len()
    }

    /// Work of a run beside that of its steady state alone: solves from cells near yield, and growth rates of
    /// each root.
    pub fn work(n_cells: usize) -> f64 {
        1.0 + SEARCH + USUAL_ROOTS as f64 * n_cells as f64 / EVEN
    }
}

impl PartialSchema for RootRow {
    fn schema() -> RefOr<Schema> {
        rows::schema::<Self>(|_| false)
    }
}

impl ToSchema for RootRow {}

impl Serialize for RootRow {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        rows::serialize(self, |_, _| false, serializer)
    }
}
