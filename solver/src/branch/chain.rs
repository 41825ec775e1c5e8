//! A root of the model on a line across a branch, with the smoothed roots on the same line that lead to it:
//! the rule of [`crate::steady`] that picks among discrete roots, applied where the control parameter is
//! free. Knows no equation.

use super::continued::{Course, OnLine, Plane};
use crate::error::SolveError;
use crate::newton::{self, Limits, Root, Workspace};
use crate::params::Parameters;
use crate::physics::fluidity::Relaxation;
use crate::physics::jacobian::Jacobian;
use crate::smoothing::{DIVISIONS, LEVELS, Ladder};
use crate::state::State;
use crate::trail::{STEPPING_STONES, Trail};

/// What is being done, for errors.
const STAGE: &str = "following a branch of steady states";

/// Of the roots at the first level, which lie on a smooth branch, so that a step may be long.
const FIRST: Limits =
    Limits { iterations: 8, step_tolerance: 1e-3, shortest_share: 0.1, checks_root: false };
/// Of the smoothed roots below it, which lie beside those of the point before.
const BESIDE: Limits =
    Limits { iterations: 6, step_tolerance: 1e-3, shortest_share: 0.1, checks_root: false };

/// A packed root and its place in the plane; L stands in its slot.
#[derive(Debug, Clone)]
pub(super) struct Rung {
    level: f64,
    pub(super) x: Vec<f64>,
    pub(super) at: Plane,
    /// 1 − μ_s/μ of the interior cells.
    excess: Vec<f64>,
}

impl Rung {
    /// Where it is expected to go.
    fn moved(&self, shift: Shift<'_>) -> Self {
        Self {
            x: self.x.iter().zip(shift.x).map(|(x, by)| x + shift.share * by).collect(),
            at: self.at.moved(shift.share, shift.at),
            ..self.clone()
        }
    }
}

/// The model's root, and the smoothed ones above it, the most smoothed first.
#[derive(Debug, Clone)]
pub(super) struct Chain {
    pub(super) root: Rung,
    smoothed: Vec<Rung>,
    pub(super) iterations: usize,
    /// Of the first level alone, which tell how good the prediction was.
    pub(super) first_iterations: usize,
    pub(super) residual_norm: f64,
    /// Whether the root beside the last one's ended on the way down, and another took over.
    pub(super) has_jumped: bool,
}

/// How the roots of one chain are expected to move to the next.
#[derive(Debug, Clone, Copy)]
pub(super) struct Shift<'a> {
    pub(super) x: &'a [f64],
    pub(super) at: Plane,
    pub(super) share: f64,
}

impl Chain {
    /// Of a steady state, as its trail leads to it.
    pub(super) fn of(trail: &Trail, length_slot: usize, control: f64) -> Self {
        let rung = |(level, x, excess): (f64, &[f64], &[f64])| Rung {
            level,
            x: x.to_vec(),
            at: Plane { length: x[length_slot], control },
            excess: excess.to_vec(),
        };
        let roots: Vec<_> = trail.roots().collect();
        let root = rung(*roots.last().expect("a trail begins with a root"));
        let is_stone = |root: &(f64, &[f64], &[f64])| STEPPING_STONES.contains(&root.0);
        let smoothed = roots.into_iter().filter(is_stone).map(rung).collect();
        Self { root, smoothed, ..Self::alone(Vec::new(), Plane { length: 0.0, control }) }
    }

    /// Of a root whose smoothed ones are not known.
    pub(super) fn alone(x: Vec<f64>, at: Plane) -> Self {
        let root = Rung { level: 0.0, x, at, excess: Vec::new() };
        Self {
            root,
            smoothed: Vec::new(),
            iterations: 0,
            first_iterations: 0,
            residual_norm: 0.0,
            has_jumped: false,
        }
    }
}

/// Whether a root's cells move otherwise from level to level than its neighbour's do, by more than a share of
/// ε: one of both has ended on the way, and another was taken.
fn jumps(here: [&[f64]; 2], there: [&[f64]; 2], level: f64) -> bool {
    const SHARE: f64 = 0.75;
    let [a, b] = here;
    let [c, d] = there;
    let differences =
        a.iter().zip(b).zip(c.iter().zip(d)).map(|((a, b), (c, d))| (b - a) - (d - c));
    differences.map(f64::abs).fold(0.0, f64::max) > SHARE * level
}

/// What is tried before there is said to be no root.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Patience {
    /// Little, for who can take a shorter step.
    Little,
    /// The whole way down from the first level, in short steps.
    Enough,
    /// And where the root ends on the way, the one that takes over.
    ToJump,
}

/// Newton's method on one line, at any level.
pub(super) struct Climber<'a> {
    pub(super) line: OnLine<'a>,
    pub(super) newton: &'a mut Workspace<Jacobian>,
    iterations: usize,
    first_iterations: usize,
    has_jumped: bool,
}

impl<'a> Climber<'a> {
    pub(super) fn new(
        course: &'a mut Course,
        newton: &'a mut Workspace<Jacobian>,
        through: Plane,
        along: Plane,
    ) -> Self {
        Self {
            line: OnLine { course, through, along, relaxation: None },
            newton,
            iterations: 0,
            first_iterations: 0,
            has_jumped: false,
        }
    }

    /// The iterate as a rung.
    fn rung(&mut self, level: f64) -> Rung {
        let at = self.line.place(&self.newton.x);
        let mut x = self.newton.x.clone();
        x[self.line.course.slot()] = at.length;
        let excess = self.yield_excesses();
        Rung { level, x, at, excess }
    }

    /// Where a rung is expected on this line, σ in the slot.
    fn guess(&self, rung: &Rung, shift: Shift<'_>) -> Vec<f64> {
        let Rung { mut x, at, .. } = rung.moved(shift);
        x[self.line.course.slot()] = at.minus(self.line.through).dot(self.line.along);
        x
    }

    /// The chain on this line beside another one: along its smoothed roots as long as they lead on, else down
    /// from the first; where that root ends on the way, and the caller lets it, on to the root that takes over.
    pub(super) fn chain(
        mut self,
        near: &Chain,
        shift: Shift<'_>,
        patience: Patience,
    ) -> Result<Chain, SolveError> {
        if near.smoothed.is_empty() {
            return self.upwards(near, shift);
        }
        let mut smoothed: Vec<Rung> = Vec::with_capacity(3);
        let model_guess = self.guess(&near.root, shift);
        let mut root = match self.beside(near, shift, &mut smoothed) {
            Ok(Some(root)) => return Ok(self.finish(root, smoothed)),
            // A last root that lies beside its neighbour's and leads nowhere may be none: near where a root
            // ends a short step of Newton's method tells little. Its own way down is that from the first.
            Ok(None) if patience == Patience::Little => {
                self.descend_from_last(&mut smoothed, patience)
            }
            Ok(None) => self.descend_from_last(&mut smoothed, Patience::Enough).or_else(|_| {
                smoothed.truncate(1);
                self.descend_from_last(&mut smoothed, patience)
            }),
            Err(error) => Err(error),
        };
        if root.is_err() && patience == Patience::ToJump {
            // The smoothed roots may lie on another branch by now.
            self.newton.x = model_guess;
            root = self.relax(0.0);
            self.has_jumped = true;
            smoothed = near.smoothed.iter().map(|rung| rung.moved(shift)).collect();
        }
        Ok(self.finish(root?, smoothed))
    }

    fn descend_from_last(
        &mut self,
        smoothed: &mut Vec<Rung>,
        patience: Patience,
    ) -> Result<Root, SolveError> {
        let last = smoothed.last().expect("the first level was solved");
        let mut x = last.x.clone();
        x[self.line.course.slot()] = last.at.minus(self.line.through).dot(self.line.along);
        self.newton.x = x;
        self.descend(smoothed, patience)
    }

    /// The roots at the stepping stones beside another chain's, each sought where the one before suggests,
    /// and the model's if it can be reached from one of them; an error where there is not even the first.
    fn beside(
        &mut self,
        near: &Chain,
        shift: Shift<'_>,
        smoothed: &mut Vec<Rung>,
    ) -> Result<Option<Root>, SolveError> {
        let mut moved = vec![0.0; shift.x.len()];
        let model_guess = self.guess(&near.root, shift);
        let plus =
            |a: &[f64], b: &[f64]| -> Vec<f64> { a.iter().zip(b).map(|(a, b)| a + b).collect() };
        for (k, rung) in near.smoothed.iter().enumerate() {
            let expected = self.guess(rung, shift);
            self.newton.x = plus(&expected, &moved);
            let found = self.solve_at(rung.level, if k == 0 { FIRST } else { BESIDE });
            if k == 0 {
                self.first_iterations = found?.iterations;
            } else {
                let (here, there) = (&smoothed[k - 1], &near.smoothed[k - 1]);
                let excess = self.yield_excesses();
                let cells = [[&here.excess[..], &excess], [&there.excess, &rung.excess]];
                if found.is_err() || jumps(cells[0], cells[1], here.level) {
                    return Ok(None);
                }
            }
            moved = self.newton.x.iter().zip(&expected).map(|(x, e)| x - e).collect();
            smoothed.push(self.rung(rung.level));
            let guess = plus(&model_guess, &moved);
            if let Some(root) = self.leap(rung.level, Some(&guess)) {
                return Ok(Some(root));
            }
        }
        Ok(None)
    }

    /// Where no smoothed root is known, the first level is sought from the model's root, smoothed little by
    /// little.
    fn upwards(mut self, near: &Chain, shift: Shift<'_>) -> Result<Chain, SolveError> {
        self.newton.x = self.guess(&near.root, shift);
        for level in STEPPING_STONES.into_iter().rev() {
            self.solve_at(level, FIRST)?;
        }
        let mut smoothed = vec![self.rung(LEVELS[0])];
        let root = self.descend(&mut smoothed, Patience::ToJump)?;
        Ok(self.finish(root, smoothed))
    }

    /// From the last of the smoothed roots, which is in the iterate, to the model; where a root ends, the
    /// fluidity relaxes to the one that takes over, or there is none.
    fn descend(
        &mut self,
        smoothed: &mut Vec<Rung>,
        patience: Patience,
    ) -> Result<Root, SolveError> {
        let mut last = smoothed.last().expect("the first level was solved").level;
        let mut root = None;
        for level in LEVELS.into_iter().filter(move |level| *level < last) {
            let divisions = if patience == Patience::Little { 0 } else { DIVISIONS };
            let lowered = self.lower(last, level, divisions);
            let relaxes = patience == Patience::ToJump;
            root = Some(match lowered {
                Ok(found) => found,
                Err(_) if relaxes => {
                    self.has_jumped = true;
                    self.relax(level)?
                }
                Err(error) => return Err(error),
            });
            if STEPPING_STONES.contains(&level) {
                smoothed.push(self.rung(level));
            }
            if let Some(root) = self.leap(level, None) {
                return Ok(root);
            }
            last = level;
        }
        Ok(root.expect("the last level, 0, is below any other"))
    }

    /// The model's root alone, by Newton's method from where it is expected; the smoothed roots go along
    /// unsolved.
    pub(super) fn alone(mut self, near: &Chain, shift: Shift<'_>) -> Result<Chain, SolveError> {
        self.newton.x = self.guess(&near.root, shift);
        let root = self.solve_at(0.0, Limits { iterations: 8, ..Limits::default() })?;
        let smoothed = near.smoothed.iter().map(|rung| rung.moved(shift)).collect();
        Ok(self.finish(root, smoothed))
    }

    fn finish(mut self, root: Root, smoothed: Vec<Rung>) -> Chain {
        let rung = self.rung(0.0);
        Chain {
            root: rung,
            smoothed,
            iterations: self.iterations,
            first_iterations: self.first_iterations,
            residual_norm: root.residual_norm,
            has_jumped: self.has_jumped,
        }
    }
}

impl Ladder for Climber<'_> {
    fn solve_relaxing(
        &mut self,
        level: f64,
        relaxation: Option<Relaxation<'_>>,
        limits: Limits,
    ) -> Result<Root, SolveError> {
        let OnLine { course, through, along, .. } = &mut self.line;
        course.smoothing = level;
        let mut line = OnLine { course, through: *through, along: *along, relaxation };
        let outcome = newton::solve(&mut line, self.newton, limits, STAGE);
        self.iterations += match &outcome {
            Ok(root) => root.iterations,
            Err(SolveError::NotConverged { iterations, .. }) => *iterations,
            Err(_) => 0,
        };
        outcome
    }

    fn iterate(&mut self) -> &mut Vec<f64> {
        &mut self.newton.x
    }

    fn state(&mut self) -> State {
        let at = self.line.place(&self.newton.x);
        self.line.course.state(&self.newton.x, at)
    }

    fn parameters(&self) -> Parameters {
        *self.line.course.setting.model.parameters()
    }
}
