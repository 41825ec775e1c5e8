//! Both ways from a start as one curve, and what is special about it. Looks for roots between points it is
//! given; knows no equation.

use super::stability::GrowthRate;
use super::trace::{Stand, Tracer, Way};
use super::{Branch, BranchPlan, BranchPoint, Crossing, Fold};

/// The branch of two ways, the first of which goes backwards.
pub(super) fn joined(tracer: &mut Tracer, plan: &BranchPlan, ways: [Way; 2]) -> Branch {
    let [mut back, forth] = ways;
    // A jump lies between its point and the one before, which on the way back comes after.
    let jumps: Vec<bool> = back.stands.iter().map(|stand| stand.point.has_jumped).collect();
    for (k, stand) in back.stands.iter_mut().enumerate() {
        stand.turn_by(-1.0);
        stand.point.arclength *= -1.0;
        stand.point.has_jumped = jumps.get(k + 1).copied().unwrap_or(false);
    }
    let start_jumped = back.stands[0].point.has_jumped;
    let mut stands: Vec<Stand> = back.stands.into_iter().skip(1).rev().collect();
    let first = stands.len();
    stands.extend(forth.stands);
    stands[first].point.has_jumped = start_jumped;
    let mut segment = 0;
    for stand in &mut stands {
        stand.point.segment = segment;
        segment += usize::from(stand.fold.is_some());
    }
    let roots = plan.roots_at.iter().flat_map(|value| roots_at(tracer, &stands, *value)).collect();
    let folds = stands.iter().filter_map(|stand| {
        let turn = stand.fold.as_ref()?;
        Some(Fold {
            point: stand.point.clone(),
            is_maximum: turn.is_maximum,
            bracket: turn.bracket,
            is_on_kink: turn.is_on_kink,
        })
    });
    let folds: Vec<Fold> = folds.collect();
    let points: Vec<BranchPoint> =
        stands.into_iter().filter(|s| s.fold.is_none()).map(|s| s.point).collect();
    let crossings = points.windows(2).filter_map(|pair| crossing(&pair[0], &pair[1])).collect();
    Branch { points, folds, crossings, roots, ends: (back.end, forth.end) }
}

/// The roots at a value of p, one on every piece of the curve that passes it. Between folds p is monotone.
fn roots_at(tracer: &mut Tracer, stands: &[Stand], value: f64) -> Vec<BranchPoint> {
    let mut roots = Vec::new();
    let first = stands.first().filter(|stand| stand.point.control == value);
    roots.extend(first.map(|stand| stand.point.clone()));
    for pair in stands.windows(2) {
        let [a, b] = pair else { unreachable!("windows of two") };
        let (from, to) = (a.point.control - value, b.point.control - value);
        if to == 0.0 {
            roots.push(b.point.clone());
        } else if from * to < 0.0
            && let Ok(found) = tracer.root_between(a, b, value)
        {
            let run = found.chain.root.at.minus(a.chain.root.at).norm();
            roots.push(BranchPoint {
                segment: if a.fold.is_some() { b.point.segment } else { a.point.segment },
                arclength: a.point.arclength + run,
                step: run,
                ..found.point
            });
        }
    }
    roots
}

/// A change of the number of growing perturbations that a fold does not explain.
fn crossing(a: &BranchPoint, b: &BranchPoint) -> Option<Crossing> {
    let (before, after) = (a.spectrum.as_ref()?, b.spectrum.as_ref()?);
    let unstable = (before.unstable(), after.unstable());
    let by_folds = b.segment - a.segment;
    if unstable.0.abs_diff(unstable.1) <= by_folds {
        return None;
    }
    let nearest = |rates: &[GrowthRate]| {
        rates.iter().copied().min_by(|a, b| a.re_per_a.abs().total_cmp(&b.re_per_a.abs()))
    };
    Some(Crossing {
        bracket: (a.control, b.control),
        arclengths: (a.arclength, b.arclength),
        unstable,
        rates: (nearest(&before.rates)?, nearest(&after.rates)?),
        is_at_jump: b.has_jumped,
    })
}
