//! Newton's method with a line search that holds. Knows no physics and no time.

use crate::error::{NewtonFailure, SolveError};
use crate::linalg::bordered::Singular;

/// The point lies where the equations are not defined.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct OutsideDomain;

/// A matrix that can be factorised in place and then solved with.
pub trait Linear {
    /// Replaces the matrix by its factors.
    fn factorise(&mut self) -> Result<(), Singular>;
    /// Solves for one right-hand side, in place, with the factors.
    fn solve(&self, rhs: &mut [f64]);
    /// Whether the determinant is positive, from the factors.
    fn is_positive(&self) -> bool;
}

/// A square system of nondimensional equations.
pub trait System {
    /// Its Jacobian.
    type Jacobian: Linear;
    /// Number of unknowns.
    fn unknowns(&self) -> usize;
    /// Evaluates the residual at x.
    fn residual(&mut self, x: &[f64], residual: &mut [f64]) -> Result<(), OutsideDomain>;
    /// Evaluates residual and Jacobian at x.
    fn linearise(
        &mut self,
        x: &[f64],
        residual: &mut [f64],
        jacobian: &mut Self::Jacobian,
    ) -> Result<(), OutsideDomain>;
    /// The longest share of `step`, at most 1, that keeps clear of the domain's bounds.
    fn longest_step(&self, x: &[f64], step: &[f64]) -> f64;
}

/// Buffers of an iteration, reused from solve to solve.
#[derive(Debug, Clone)]
pub struct Workspace<J> {
    /// The iterate: start before, root after.
    pub x: Vec<f64>,
    residual: Vec<f64>,
    step: Vec<f64>,
    trial: Vec<f64>,
    correction: Vec<f64>,
    jacobian: J,
    next_jacobian: J,
    history: Vec<f64>,
}

/// When to stop.
#[derive(Debug, Clone, Copy)]
pub struct Limits {
    /// Newton iterations.
    pub iterations: usize,
    /// A full step whose largest component, relative to its unknown, is below this is the last.
    pub step_tolerance: f64,
    /// Shortest share of a Newton step that is tried.
    pub shortest_share: f64,
    /// Whether the residual is evaluated after the last step; else the norm before it is reported.
    pub checks_root: bool,
}

impl Default for Limits {
    /// Convergence is quadratic, so that a last step of 1e-9 leaves only rounding.
    fn default() -> Self {
        Self { iterations: 60, step_tolerance: 1e-9, shortest_share: 1e-5, checks_root: true }
    }
}

impl Limits {
    /// For roots that only lead to others: what is left after a last step of 1e-4 is about 1e-8.
    pub fn loose() -> Self {
        Self { step_tolerance: 1e-4, checks_root: false, ..Self::default() }
    }

    /// For the model itself, or for a smoothed one, whose roots only lead to others.
    pub fn at_smoothing(smoothing: f64) -> Self {
        if smoothing > 0.0 { Self::loose() } else { Self::default() }
    }
}

/// A root was found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Root {
    /// Iterations spent.
    pub iterations: usize,
    /// 2-norm of the residual at the root.
    pub residual_norm: f64,
}

impl<J: Linear + Clone> Workspace<J> {
    /// For n unknowns, with any matrix of their size.
    pub fn new(n: usize, jacobian: J) -> Self {
        Self {
            x: vec![0.0; n],
            residual: vec![0.0; n],
            step: vec![0.0; n],
            trial: vec![0.0; n],
            correction: vec![0.0; n],
            next_jacobian: jacobian.clone(),
            jacobian,
            history: Vec::with_capacity(128),
        }
    }
}

impl<J: Linear> Workspace<J> {
    /// The Jacobian as it was last factorised: near the root, after a solve.
    pub fn jacobian(&self) -> &J {
        &self.jacobian
    }

    /// The trial point a share of the step away.
    fn advance(&mut self, share: f64) {
        for ((trial, x), step) in self.trial.iter_mut().zip(&self.x).zip(&self.step) {
            *trial = x + share * step;
        }
    }

    /// Largest component of the step relative to its unknown.
    fn relative_step(&self) -> f64 {
        /// Unknowns below this are measured against it, in units of their scale.
        const FLOOR: f64 = 1e-3;
        let relative = self.step.iter().zip(&self.x).map(|(s, x)| s.abs() / x.abs().max(FLOOR));
        relative.fold(0.0, f64::max)
    }

    /// Whether a residual of this norm is no more than what changes of the iterate's last digits do to
    /// it: there is then no better root in this arithmetic. The sides follow the Thue–Morse sequence, which
    /// repeats nowhere, since differences of unknowns are what loses digits.
    fn is_noise<S: System>(&mut self, system: &mut S, norm: f64) -> bool {
        /// Multiples of the residual's change that are noise still: several operations are rounded, not one.
        const ROUNDINGS: f64 = 4.0;
        for (i, (trial, x)) in self.trial.iter_mut().zip(&self.x).enumerate() {
            let side = if i.count_ones().is_multiple_of(2) { 1.0 } else { -1.0 };
            *trial = x * (1.0 + side * f64::EPSILON);
        }
        if system.residual(&self.trial, &mut self.correction).is_err() {
            return false;
        }
        for (changed, residual) in self.correction.iter_mut().zip(&self.residual) {
            *changed -= residual;
        }
        norm <= ROUNDINGS * norm2(&self.correction)
    }

    /// Natural monotonicity test (Deuflhard 2011, §3.3). The residual's norm depends on how rows are
    /// scaled; the simplified Newton correction at the trial point does not.
    fn correction_shrinks(&mut self, share: f64) -> bool {
        self.correction.copy_from_slice(&self.residual);
        self.jacobian.solve(&mut self.correction);
        norm2(&self.correction) <= (1.0 - 0.5 * share) * norm2(&self.step)
    }
}

/// Finds a root from `w.x`, which holds it afterwards; on failure `w.x` is the last iterate.
pub fn solve<S: System>(
    system: &mut S,
    w: &mut Workspace<S::Jacobian>,
    limits: Limits,
    stage: &'static str,
) -> Result<Root, SolveError> {
    w.history.clear();
    iterate(system, w, limits).map_err(|reason| SolveError::NotConverged {
        stage,
        iterations: w.history.len(),
        residual_norm: w.history.last().copied().unwrap_or(f64::NAN),
        reason,
        history: w.history.clone(),
    })
}

fn iterate<S: System>(
    system: &mut S,
    w: &mut Workspace<S::Jacobian>,
    limits: Limits,
) -> Result<Root, NewtonFailure> {
    /// Share of the predicted decrease that a step must bring.
    const SUFFICIENT: f64 = 1e-4;
    /// Relative size of steps that may be rounding: the residual's differences of neighbouring
    /// velocities lose up to ten digits in a short mélange.
    const ROUNDING: f64 = 1e-7;
    /// Steps below this, relative, are followed by a look at the noise if twice in a row the residual
    /// has not halved.
    const NEARLY_THERE: f64 = 1e-2;

    debug_assert_eq!(w.x.len(), system.unknowns());
    system
        .linearise(&w.x, &mut w.residual, &mut w.jacobian)
        .map_err(|_| NewtonFailure::OutsideDomain)?;
    let mut last_change = f64::INFINITY;
    let mut stagnations = 0;
    for iteration in 1..=limits.iterations {
        let norm = norm2(&w.residual);
        let stagnates = w.history.last().is_some_and(|last| norm > 0.5 * last);
        stagnations = if stagnates { stagnations + 1 } else { 0 };
        w.history.push(norm);
        if stagnations >= 2 && last_change < NEARLY_THERE && w.is_noise(system, norm) {
            return Ok(Root { iterations: iteration, residual_norm: norm });
        }
        if w.jacobian.factorise().is_err() {
            // A mélange that sticks all over leaves friction at its ends undetermined, and is solved.
            if w.is_noise(system, norm) {
                return Ok(Root { iterations: iteration, residual_norm: norm });
            }
            return Err(NewtonFailure::Singular);
        }
        for (step, residual) in w.step.iter_mut().zip(&w.residual) {
            *step = -residual;
        }
        w.jacobian.solve(&mut w.step);
        if !norm2(&w.step).is_finite() {
            return Err(NewtonFailure::Singular);
        }
        let change = w.relative_step();
        // Full steps this small that no longer shrink are rounding: the root is as good as it gets.
        let is_rounding = change < ROUNDING && change > 0.2 * last_change;
        last_change = change;

        let mut share = system.longest_step(&w.x, &w.step);
        if share == 1.0 && (change < limits.step_tolerance || is_rounding) {
            w.advance(share);
            if !limits.checks_root {
                std::mem::swap(&mut w.x, &mut w.trial);
                return Ok(Root { iterations: iteration, residual_norm: norm });
            }
            if system.residual(&w.trial, &mut w.residual).is_ok() {
                std::mem::swap(&mut w.x, &mut w.trial);
                return Ok(Root { iterations: iteration, residual_norm: norm2(&w.residual) });
            }
        }
        loop {
            w.advance(share);
            // Most steps are accepted at once, so the trial is linearised on the way.
            if system.linearise(&w.trial, &mut w.residual, &mut w.next_jacobian).is_ok() {
                let trial_norm = norm2(&w.residual);
                if trial_norm <= (1.0 - SUFFICIENT * share) * norm
                    || (trial_norm.is_finite() && w.correction_shrinks(share))
                {
                    std::mem::swap(&mut w.x, &mut w.trial);
                    std::mem::swap(&mut w.jacobian, &mut w.next_jacobian);
                    break;
                }
            }
            share *= 0.5;
            if share < limits.shortest_share {
                return Err(NewtonFailure::Stalled);
            }
        }
    }
    Err(NewtonFailure::TooManyIterations)
}

fn norm2(v: &[f64]) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}
