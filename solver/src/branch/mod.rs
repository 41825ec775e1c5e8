//! Branches of steady states along a control parameter, around folds, with the stability of every point.
//!
//! | step | here |
//! |---|---|
//! | predict along the tangent, correct on a line across it, control the step | `trace` |
//! | the bordered system on that line | `continued` |
//! | the root that the smoothing of kinks leads to | `chain` |
//! | growth rates | [`stability`] |
//! | folds | `fold`; as a second parameter varies: [`fold_curve`] |
//!
//! Arclength is that of the curve (L/\[L\], p/unit), with [`BranchPlan::unit`] for p: near a fold p stands
//! still, but L does not.

mod chain;
mod continued;
mod fold;
pub mod fold_curve;
mod join;
mod plan;
pub mod stability;
mod trace;

pub use plan::BranchPlan;

use crate::state::State;
use crate::steady::SteadyVerdict;
use stability::{GrowthRate, Spectrum};
use std::ops::ControlFlow;

/// A steady state of a branch.
#[derive(Debug, Clone, PartialEq)]
pub struct BranchPoint {
    /// Which piece between folds it lies on, numbered along the curve from 0.
    pub segment: usize,
    /// Arclength from the start, negative on the way that begins towards smaller values of p.
    pub arclength: f64,
    /// Length of the step that led here; 0 at the start.
    pub step: f64,
    /// Newton iterations of the point, all levels of smoothing together.
    pub iterations: usize,
    /// p.
    pub control: f64,
    /// dp/ds along the curve, in units of p.
    pub control_by_arclength: f64,
    /// The state.
    pub state: State,
    /// 2-norm of the nondimensional residual.
    pub residual_norm: f64,
    /// Whether the discrete root that the branch came along ends just before, on a kink of the rheology, and
    /// the one that takes over is followed from here. Stability may change with it.
    pub has_jumped: bool,
    /// Growth rates, if they are wanted.
    pub spectrum: Option<Spectrum>,
}

/// Where a branch turns round.
#[derive(Debug, Clone, PartialEq)]
pub struct Fold {
    /// The steady state at the fold, where it lies on the curve and whence.
    pub point: BranchPoint,
    /// Whether p is largest here on the branch nearby, and not smallest.
    pub is_maximum: bool,
    /// Interval of p that the fold lies in.
    pub bracket: (f64, f64),
    /// Whether the branch turns by a sudden change of direction, on a kink of the rheology, and no point with
    /// dp/ds = 0 was found: the fold is then bracketed only.
    pub is_on_kink: bool,
}

/// Where perturbations begin or cease to grow between two points, and no fold is the reason: a rate or a pair
/// of them passes 0, or, in a mélange close to collapse, infinity; or another discrete root took over.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Crossing {
    /// The control parameter at the points before and after.
    pub bracket: (f64, f64),
    /// Their arclengths.
    pub arclengths: (f64, f64),
    /// Numbers of growing perturbations before and after.
    pub unstable: (usize, usize),
    /// The growth rates nearest to 0 before and after.
    pub rates: (GrowthRate, GrowthRate),
    /// Whether another discrete root took over between the points.
    pub is_at_jump: bool,
}

/// Why a branch goes no further.
#[derive(Debug, Clone, PartialEq)]
pub enum End {
    /// The control parameter reaches a bound.
    Bound,
    /// The state is no mélange any more: one sentence.
    Verdict(String),
    /// It comes back to where it began.
    Closed,
    /// As many points as were asked for.
    MostPoints,
    /// No step, however short, leads on: the last error, in a sentence.
    Stuck(String),
    /// The caller asked to stop.
    Stopped,
}

/// What a search for a branch led to.
#[derive(Debug, Clone, PartialEq)]
pub enum Traced {
    /// The branch.
    Branch(Box<Branch>),
    /// There is no steady state to begin with.
    NoStart(SteadyVerdict),
}

/// A branch.
#[derive(Debug, Clone, PartialEq)]
pub struct Branch {
    /// Its points, along the curve.
    pub points: Vec<BranchPoint>,
    /// Its folds, along the curve.
    pub folds: Vec<Fold>,
    /// Changes of stability elsewhere.
    pub crossings: Vec<Crossing>,
    /// The roots at the values asked for, value by value and along the curve. A piece of the curve that
    /// leads past a value by a jump has none there.
    pub roots: Vec<BranchPoint>,
    /// Why it ends, at its first and at its last point.
    pub ends: (End, End),
}

/// Receives every point as it is found, in the order of the search; `Break` ends it.
pub trait PointObserver: FnMut(&BranchPoint) -> ControlFlow<()> {}
impl<F: FnMut(&BranchPoint) -> ControlFlow<()>> PointObserver for F {}
