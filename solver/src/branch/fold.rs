//! Where a branch turns round: the steady equations together with dp/ds = 0. Knows no equation.

use super::chain::Shift;
use super::continued::Plane;
use super::trace::{Stand, Tracer};
use crate::error::SolveError;

/// Most evaluations of dp/ds.
const EVALUATIONS: usize = 60;
/// |dp/ds| of a smooth fold, in units of arclength: p is then known to about the square of it.
const TURNED: f64 = 1e-8;
/// Shares of the way between two points that are too close to tell them apart.
const SAME_PLACE: f64 = 1e-11;

/// What is known of a fold besides its place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Turn {
    pub(super) is_maximum: bool,
    pub(super) bracket: (f64, f64),
    pub(super) is_on_kink: bool,
}

/// The fold between two points at which dp/ds has different signs.
///
/// dp/ds is det(∂F/∂x) over the determinant of the bordered matrix (Cramer's rule), so that dp/ds = 0 is the
/// test function of the minimally augmented system for folds (Govaerts 2000, §4.1). Its root along the
/// curve is found by the secant method kept within the bracket (Illinois), each evaluation being a
/// corrected point of the branch. On a kink dp/ds jumps across 0 and the bracket closes without it.
pub(super) fn between(tracer: &mut Tracer, a: &Stand, b: &Stand) -> Stand {
    let slope = |stand: &Stand| stand.tangent.at.control;
    let with_stability = std::mem::take(&mut tracer.with_stability);
    let (mut low, mut high) = ((0.0, a.clone()), (1.0, b.clone()));
    let (mut f_low, mut f_high) = (slope(a), slope(b));
    let mut best = if f_low.abs() < f_high.abs() { a.clone() } else { b.clone() };
    for _ in 0..EVALUATIONS {
        let width = high.0 - low.0;
        if width < SAME_PLACE || slope(&best).abs() < TURNED {
            break;
        }
        let share = (low.0 - f_low * width / (f_high - f_low))
            .clamp(low.0 + 1e-3 * width, high.0 - 1e-3 * width);
        let shares = [share, 0.5 * (low.0 + high.0), low.0 + 0.3 * width, low.0 + 0.7 * width];
        let mut found = shares.into_iter().map(|share| (share, at_share(tracer, a, b, share)));
        let Some((share, stand)) = found.find_map(|(share, stand)| Some((share, stand.ok()?)))
        else {
            break;
        };
        let f = slope(&stand);
        if f.abs() < slope(&best).abs() {
            best = stand.clone();
        }
        if (f > 0.0) == (slope(a) > 0.0) {
            (low, f_low) = ((share, stand), f);
            f_high *= 0.5;
        } else {
            (high, f_high) = ((share, stand), f);
            f_low *= 0.5;
        }
        if f_high.abs() < 0.4 * slope(&high.1).abs() && f_low.abs() < 0.4 * slope(&low.1).abs() {
            (f_low, f_high) = (slope(&low.1), slope(&high.1));
        }
    }
    let is_on_kink = slope(&best).abs() >= TURNED;
    let is_maximum = slope(a) > 0.0;
    let bracket = if is_on_kink {
        reach(tracer.course.unit, &low.1, &high.1, is_maximum)
    } else {
        (best.point.control, best.point.control)
    };
    tracer.with_stability = with_stability;
    // Growth rates are wanted at the fold alone.
    let best = tracer.stand(best.chain.clone(), chord(a, b)).unwrap_or(best);
    Stand { fold: Some(Turn { is_maximum, bracket, is_on_kink }), ..best }
}

/// The values of p that an extremum between two points may have: from the farther of both to what their slopes
/// reach over the distance between them.
fn reach(unit: f64, low: &Stand, high: &Stand, is_maximum: bool) -> (f64, f64) {
    let run = high.chain.root.at.minus(low.chain.root.at).norm();
    let ends = [low, high].map(|stand| {
        let beyond = stand.tangent.at.control.abs() * run * unit;
        (stand.point.control, stand.point.control + if is_maximum { beyond } else { -beyond })
    });
    let [(a, a_beyond), (b, b_beyond)] = ends;
    if is_maximum { (a.max(b), a_beyond.max(b_beyond)) } else { (a_beyond.min(b_beyond), a.min(b)) }
}

/// The direction from one point to another.
fn chord(a: &Stand, b: &Stand) -> Plane {
    let way = b.chain.root.at.minus(a.chain.root.at);
    way.scaled(1.0 / way.norm())
}

/// The point of the branch on the line across the way between two others, at a share of it.
fn at_share(tracer: &mut Tracer, a: &Stand, b: &Stand, share: f64) -> Result<Stand, SolveError> {
    let (near, far) = if share < 0.5 { (a, b) } else { (b, a) };
    let share = if share < 0.5 { share } else { 1.0 - share };
    let way = far.chain.root.at.minus(near.chain.root.at);
    let x: Vec<f64> = far.chain.root.x.iter().zip(&near.chain.root.x).map(|(b, a)| b - a).collect();
    let through = near.chain.root.at.moved(share, way);
    let shift = Shift { x: &x, at: way, share };
    let ahead = chord(a, b);
    let chain = tracer.beside(&near.chain, shift, through, ahead.across())?;
    let found = tracer.stand(chain, ahead)?;
    if found.is_positive == a.is_positive {
        Ok(found)
    } else {
        Err(SolveError::UnusableState { what: "it lies on another branch".into() })
    }
}
