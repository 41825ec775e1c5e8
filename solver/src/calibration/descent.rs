//! Nonlinear least squares within bounds, by the method of Levenberg and Marquardt. Knows nothing of ice.
//!
//! From θ with residuals r and slopes J the step δ minimises the damped model of S = |r|²
//!
//! ```text
//!   m(δ) = |r|² + 2gᵀδ + δᵀAδ + λ|δ|²,   g = Jᵀr, A = JᵀJ,   smallest ≤ θ + δ ≤ largest,
//! ```
//!
//! exactly, the bounds included ([`bounded_step`]). It is taken if S falls; λ follows the ratio of the fall
//! to the one foreseen as in Nielsen (1999, IMM-REP-1999-05). What has no residuals or no slopes counts as
//! no fall, so the method turns back from places where nothing can be evaluated.
//!
//! Residuals may have kinks. The minimum may lie on one, where the slopes of its one side foresee a fall that
//! there is not; the descent then stalls, and that is said.

use faer::linalg::solvers::Solve;
use faer::{Col, Mat, Side};

/// The box that θ stays in.
#[derive(Debug, Clone, PartialEq)]
pub struct Bounds {
    /// Of each component.
    pub smallest: Vec<f64>,
    /// Of each component.
    pub largest: Vec<f64>,
}

/// A bound that a component lies on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Bound {
    /// The smallest value.
    Smallest,
    /// The largest value.
    Largest,
}

/// Residuals that are to become small.
pub trait LeastSquares {
    /// What an evaluation leaves behind, so that slopes can be asked for later.
    type Point;
    /// Evaluates at θ; none where that cannot be done.
    fn at(&mut self, theta: &[f64]) -> Option<Self::Point>;
    /// r.
    fn residuals(point: &Self::Point) -> &[f64];
    /// ∂r/∂θ_k for each k; none where they do not exist.
    fn slopes(&mut self, point: &Self::Point) -> Option<Vec<Vec<f64>>>;
}

/// How a descent ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ending {
    /// S would fall by less than [`CONVERGED`] more, were it quadratic.
    Converged,
    /// No step lowers S, however short, as at a minimum that lies on a kink.
    Stalled,
    /// The limit was reached.
    TooManyIterations,
}

/// Where a descent led.
#[derive(Debug, Clone)]
pub struct Descent<P> {
    /// θ.
    pub theta: Vec<f64>,
    /// What was evaluated there.
    pub point: P,
    /// S.
    pub sum_of_squares: f64,
    /// By how much S would fall, were it quadratic: where S is χ², the distance from the minimum in standard
    /// errors, squared.
    pub decrement: f64,
    /// A = JᵀJ.
    pub information: Mat<f64>,
    /// Bounds that θ lies on and that S falls beyond.
    pub at_bound: Vec<Option<Bound>>,
    /// Steps tried.
    pub iterations: usize,
    /// How it ended.
    pub ending: Ending,
}

/// A descent on its way.
#[derive(Debug, Clone, Copy)]
pub struct Progress<'a> {
    /// Steps tried.
    pub iteration: usize,
    /// θ.
    pub theta: &'a [f64],
    /// S.
    pub sum_of_squares: f64,
}

/// A hundredth of a standard error, squared, where S is χ².
pub const CONVERGED: f64 = 1e-4;
/// Initial λ, as a share of A's largest diagonal element.
const FIRST_DAMPING: f64 = 1e-3;
/// Damping, as a share of A's largest diagonal element, that makes no difference but to a singular A.
const NEGLIGIBLE: f64 = 1e-13;
/// In logarithms, a step that leads nowhere.
const SHORTEST_STEP: f64 = 1e-9;

impl Bounds {
    /// Whether θ lies within them.
    pub fn contain(&self, theta: &[f64]) -> bool {
        let bounds = self.smallest.iter().zip(&self.largest);
        theta.iter().zip(bounds).all(|(x, (smallest, largest))| smallest <= x && x <= largest)
    }

    /// Distances from θ to either bound.
    fn room(&self, theta: &[f64]) -> Self {
        let from = |bound: &[f64]| bound.iter().zip(theta).map(|(b, x)| b - x).collect();
        Self { smallest: from(&self.smallest), largest: from(&self.largest) }
    }
}

/// Residuals' slopes gathered at a point.
struct Local {
    gradient: Vec<f64>,
    information: Mat<f64>,
}

impl Local {
    fn new(residuals: &[f64], slopes: &[Vec<f64>]) -> Self {
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let n = slopes.len();
        Self {
            gradient: slopes.iter().map(|by| dot(by, residuals)).collect(),
            information: Mat::from_fn(n, n, |i, j| dot(&slopes[i], &slopes[j])),
        }
    }

    fn largest(&self) -> f64 {
        let diagonal = (0..self.gradient.len()).map(|i| self.information[(i, i)]);
        diagonal.fold(f64::MIN_POSITIVE, f64::max)
    }

    /// The step and the fall of S that the undamped model foresees.
    fn step(&self, damping: f64, room: &Bounds) -> (Vec<f64>, f64) {
        let n = self.gradient.len();
        let damped = Mat::from_fn(n, n, |i, j| {
            self.information[(i, j)] + if i == j { damping } else { 0.0 }
        });
        let step = bounded_step(&damped, &self.gradient, room);
        let slope = product(&self.information, &step, &self.gradient);
        let fall =
            step.iter().zip(slope.iter().zip(&self.gradient)).map(|(d, (q, g))| -d * (q + g));
        let fall = fall.sum();
        (step, fall)
    }
}

/// Aδ + g.
fn product(a: &Mat<f64>, step: &[f64], g: &[f64]) -> Vec<f64> {
    (0..g.len()).map(|i| g[i] + (0..g.len()).map(|j| a[(i, j)] * step[j]).sum::<f64>()).collect()
}

/// Descends from θ, which lies within the bounds; none if it cannot be evaluated. `observe` is told of each
/// step that is tried; the descent ends early, with none, when it returns false.
pub fn descend<L: LeastSquares>(
    problem: &mut L,
    bounds: &Bounds,
    start: &[f64],
    iterations: usize,
    observe: &mut dyn FnMut(&L, Progress<'_>) -> bool,
) -> Option<Descent<L::Point>> {
    let sum = |point: &L::Point| L::residuals(point).iter().map(|r| r * r).sum::<f64>();
    let mut theta = start.to_vec();
    let mut point = problem.at(&theta)?;
    let mut local = Local::new(L::residuals(&point), &problem.slopes(&point)?);
    let mut sum_of_squares = sum(&point);
    let mut damping = FIRST_DAMPING * local.largest();
    let mut growth = 2.0;
    let mut iteration = 0;
    let (ending, decrement) = loop {
        if !observe(problem, Progress { iteration, theta: &theta, sum_of_squares }) {
            return None;
        }
        let room = bounds.room(&theta);
        let (_, decrement) = local.step(NEGLIGIBLE * local.largest(), &room);
        if decrement < CONVERGED {
            break (Ending::Converged, decrement);
        }
        if iteration == iterations {
            break (Ending::TooManyIterations, decrement);
        }
        iteration += 1;
        let (step, foreseen) = local.step(damping, &room);
        if step.iter().all(|d| d.abs() < SHORTEST_STEP) {
            break (Ending::Stalled, decrement);
        }
        let trial: Vec<f64> = (0..theta.len())
            .map(|k| (theta[k] + step[k]).clamp(bounds.smallest[k], bounds.largest[k]))
            .collect();
        let lower = problem.at(&trial).filter(|found| sum(found) < sum_of_squares);
        match lower.and_then(|found| problem.slopes(&found).map(|slopes| (found, slopes))) {
            Some((found, slopes)) => {
                let ratio = (sum_of_squares - sum(&found)) / foreseen;
                damping *= (1.0 - (2.0 * ratio - 1.0).powi(3)).max(1.0 / 3.0);
                growth = 2.0;
                local = Local::new(L::residuals(&found), &slopes);
                (theta, sum_of_squares, point) = (trial, sum(&found), found);
            }
            None => {
                damping *= growth;
                growth *= 2.0;
            }
        }
    };
    let room = bounds.room(&theta);
    let at_bound = (0..theta.len()).map(|k| holding(&room, k, 0.0, local.gradient[k])).collect();
    let Local { information, .. } = local;
    Some(Descent {
        theta,
        point,
        sum_of_squares,
        decrement,
        information,
        at_bound,
        iterations: iteration,
        ending,
    })
}

/// The bound that holds a component at δ back, where the slope points beyond it.
fn holding(room: &Bounds, k: usize, step: f64, slope: f64) -> Option<Bound> {
    if step <= room.smallest[k] && slope > 0.0 {
        Some(Bound::Smallest)
    } else if step >= room.largest[k] && slope < 0.0 {
        Some(Bound::Largest)
    } else {
        None
    }
}

/// The minimum of 2gᵀδ + δᵀAδ, A positive definite, in a box that contains 0, by active sets (Nocedal and
/// Wright 2006, §16.5): bounds are taken up as they are met, and let go one by one where they hold nothing
/// back.
pub fn bounded_step(a: &Mat<f64>, g: &[f64], room: &Bounds) -> Vec<f64> {
    /// More sets than are ever needed for a dozen components; the last one is then taken.
    const MOST_SETS: usize = 200;
    let n = g.len();
    let mut step = vec![0.0; n];
    let mut is_held: Vec<bool> = (0..n).map(|k| holding(room, k, 0.0, g[k]).is_some()).collect();
    for _ in 0..MOST_SETS {
        let slope = product(a, &step, g);
        let free: Vec<usize> = (0..n).filter(|k| !is_held[*k]).collect();
        let block = Mat::from_fn(free.len(), free.len(), |i, j| a[(free[i], free[j])]);
        let Ok(factors) = block.llt(Side::Lower) else { break };
        let change = factors.solve(Col::from_fn(free.len(), |i| -slope[free[i]]));
        // As far as the first bound in the way.
        let met = free.iter().enumerate().filter_map(|(i, k)| {
            let bound = if change[i] > 0.0 { room.largest[*k] } else { room.smallest[*k] };
            let share = (bound - step[*k]) / change[i];
            (share < 1.0).then_some((share, *k, bound))
        });
        let first = met.min_by(|a, b| a.0.total_cmp(&b.0));
        let share = first.map_or(1.0, |(share, ..)| share.max(0.0));
        for (i, k) in free.iter().enumerate() {
            step[*k] += share * change[i];
        }
        if let Some((_, k, bound)) = first {
            step[k] = bound;
            is_held[k] = true;
            continue;
        }
        let slope = product(a, &step, g);
        let idle =
            (0..n).filter(|k| is_held[*k] && holding(room, *k, step[*k], slope[*k]).is_none());
        match idle.max_by(|i, j| slope[*i].abs().total_cmp(&slope[*j].abs())) {
            Some(k) => is_held[k] = false,
            None => break,
        }
    }
    step
}
