//! Steady states, by the one rule that picks among the discrete roots. Knows no equation.
//!
//! The discrete problem has several roots; the right one is the limit of the smoothed problem (see the
//! modules `smoothing` and `trail`). Its first level is reached by pseudo-transient steps whose length
//! grows until Newton's method on the steady equations takes over, so that the start does not matter.

use crate::diagnostic::{self, Geometry};
use crate::error::SolveError;
use crate::newton::{Limits, Root};
use crate::params::ParameterError;
use crate::physics::closure::UpstreamClosure;
use crate::physics::continuity::{Before, MassBalance};
use crate::smoothing::LEVELS;
use crate::state::State;
use crate::trail::Trail;
use crate::{Model, Solution, Solver, Task};

/// A mélange counts as collapsed when H₀ falls below this multiple of d, its thickness at the end …
pub const COLLAPSE_THICKNESS_RATIO: f64 = 1.02;
/// … or, being thinner than this multiple of d, …
pub const COLLAPSE_SHORT_THICKNESS_RATIO: f64 = 1.5;
/// … is shorter than this one: a dozen icebergs in a row are no continuum.
pub const COLLAPSE_LENGTH_RATIO: f64 = 12.0;
/// A mélange that is thinner than this multiple of d between its ends is none: it ends where H = d first,
/// not at L. (Solutions that go through such a trough and rise to H_L = d are well below: of 1,600 drawn
/// at random with the paper's melt shapes none lay between 0.8 and 1.)
pub const TROUGH_RATIO: f64 = 0.9;
/// A mélange that cannot be solved any further is overthick above this share of H_t: where the
/// glacier retreats, the velocity relative to the walls vanishes as H₀ reaches H_t.
pub const NEARLY_OVERTHICK: f64 = 0.95;
/// Walls count as met where the fjord is narrower than this share of its width at the terminus and
/// the mélange cannot be solved any further.
pub const NEARLY_CLOSED: f64 = 0.02;

/// How the search for a steady state ended. Every text is evidence in one sentence.
#[derive(Debug, Clone, PartialEq)]
pub enum SteadyVerdict {
    /// The steady state, and the way to it, beside which a neighbour's is found sooner.
    Converged {
        /// The root the rule picks.
        solution: Solution,
        /// The roots at the levels of smoothing.
        trail: Trail,
    },
    /// There is none: the mélange runs away to the size of its icebergs, or breaks up between its ends.
    NoSteadyState(String),
    /// The mélange would be at least as thick as the glacier.
    Overthick(String),
    /// The walls meet within the mélange.
    FjordClosed(String),
}

/// How a pseudo-transient march ended.
pub(crate) enum March {
    Settled(Root),
    Ended(Box<SteadyVerdict>),
}

/// Starts, tried in turn: thickness at the terminus as a share of the way from d to H_t, in
/// [`diagnostic::balanced_wedge`].
const STARTS: [f64; 4] = [0.2, 0.5, 0.08, 0.03];

/// Thickness at the terminus and length, in d, of the start that a collapse is checked by: a little above
/// what counts as collapsed.
const BELOW: (f64, f64) = (1.2, 40.0);

/// First pseudo-transient step, a.
pub(crate) const FIRST_STEP_A: f64 = 0.02;
/// Steps longer than this hand over to Newton's method on the steady equations, a.
const LONGEST_STEP_A: f64 = 10.0;
/// Shorter steps than this mean that the march is stuck, a.
const SHORTEST_STEP_A: f64 = 1e-9;
/// The same for a mélange that is thinner than its icebergs between its ends: H_L = d then holds in more
/// than one place, and its end is about to jump to the nearest, a.
const BREAKING_A: f64 = 1e-6;
/// Growth of the step after a success.
const GROWTH: f64 = 2.0;
/// Most steps of a march.
const MARCH_STEPS: usize = 400;
/// A march whose H₀ exceeds this multiple of H_t is given up as overthick.
const RUNAWAY_THICKNESS_RATIO: f64 = 1.5;

impl Model {
    /// Whether a terminus that moves meets other walls or other melt.
    pub fn depends_on_place(&self) -> bool {
        !self.fjord().is_constant() || self.melt_shape().depends_on_bedrock()
    }

    /// Refuses what has no steady state by construction.
    pub fn check_steady(&self) -> Result<(), ParameterError> {
        let p = self.parameters();
        if p.terminus_velocity_m_per_a != p.calving_rate_m_per_a && self.depends_on_place() {
            return Err(ParameterError::Contradiction {
                name: "calving_rate_m_per_a",
                value: p.calving_rate_m_per_a,
                permitted: format!(
                    "the terminus velocity ({} m a-1): a terminus that moves through a fjord of varying \
                     width, or past melt that is fixed to the bedrock, has no steady state",
                    p.terminus_velocity_m_per_a
                ),
            });
        }
        Ok(())
    }
}

impl Solver {
    /// The steady state; `near` is the way to a neighbour's, which saves time and does not change the
    /// answer.
    pub fn steady(&mut self, near: Option<&Trail>) -> Result<SteadyVerdict, SolveError> {
        if let Some(verdict) = self.steady_by_construction()? {
            return Ok(verdict);
        }
        let near = near.filter(|near| near.n_cells() == self.model.parameters.n_cells);
        match near.and_then(|near| self.steady_beside(near)) {
            Some(verdict) => Ok(verdict),
            // A neighbour that leads nowhere says nothing about this mélange.
            None => self.steady_cold(),
        }
    }

    /// The steady state beside a neighbour's and nowhere else, for steps of a continuation, which had better
    /// be shortened than begun afresh; none if the neighbour is not near enough. What is found is what
    /// [`Solver::steady`] finds.
    pub fn steady_along(&mut self, near: &Trail) -> Result<Option<SteadyVerdict>, SolveError> {
        if let Some(verdict) = self.steady_by_construction()? {
            return Ok(Some(verdict));
        }
        let is_fitting = near.n_cells() == self.model.parameters.n_cells;
        Ok(if is_fitting { self.steady_beside(near) } else { None })
    }

    /// The steady state, sought first from a geometry: H (\[N\] m) and L (m). It does not change the
    /// answer.
    pub fn steady_from(
        &mut self,
        thickness_m: &[f64],
        length_m: f64,
    ) -> Result<SteadyVerdict, SolveError> {
        let geometry = Geometry { thickness_m, length_m, terminus_x_m: 0.0 };
        self.guess(geometry)?;
        if let Some(verdict) = self.steady_by_construction()? {
            return Ok(verdict);
        }
        if let Ok(start) = self.smoothed_diagnostic(geometry, &LEVELS[..1])
            && let Ok(March::Settled(_)) = self.march(start, FIRST_STEP_A, LEVELS[0])
            && let Ok(verdict @ SteadyVerdict::Converged { .. }) = self.descend_from(LEVELS[0])
        {
            return Ok(verdict);
        }
        // A start that leads nowhere says nothing about this mélange, so that the regular ones follow.
        self.steady_cold()
    }

    /// Refuses what has no one steady state; the verdict where there can be none.
    fn steady_by_construction(&mut self) -> Result<Option<SteadyVerdict>, SolveError> {
        self.model.check_steady()?;
        if self.model.closure == UpstreamClosure::Printed {
            return Err(SolveError::ClosureLeavesFamily { closure: self.model.closure.name() });
        }
        self.iterations = 0;
        let evidence = "no ice enters (calving rate 0), so the mélange has no steady length";
        Ok((self.model.parameters.calving_flux_m2_per_a() == 0.0)
            .then(|| SteadyVerdict::NoSteadyState(evidence.into())))
    }

    fn steady_cold(&mut self) -> Result<SteadyVerdict, SolveError> {
        let mut failure = None;
        let mut collapses = 0;
        let mut broken = Vec::new();
        for share in STARTS {
            match self.steady_from_wedge(share) {
                // Collapse is believed when it happens from a thicker start too: an unstable state
                // may lie between the first start and the steady one.
                Ok(verdict @ SteadyVerdict::NoSteadyState(_)) => {
                    collapses += 1;
                    if collapses == 2 {
                        return Ok(self.steady_from_below().unwrap_or(verdict));
                    }
                }
                Ok(verdict) => return Ok(verdict),
                Err(error) => {
                    if let SolveError::BreaksUp { .. } = error {
                        broken.push(error.to_string());
                    }
                    failure = failure.or(Some(error));
                }
            }
        }
        // Where no start leads to a steady state, a march that breaks up counts like one that collapses.
        if let Some(evidence) = broken.pop()
            && collapses + broken.len() >= 1
        {
            let verdict = SteadyVerdict::NoSteadyState(evidence);
            return Ok(self.steady_from_below().unwrap_or(verdict));
        }
        Err(failure.expect("a start that neither ends nor fails twice does not exist"))
    }

    /// The steady state that a march from a mélange hardly thicker than its icebergs leads to: one that
    /// thins towards a short mélange may, in passing, look collapsed.
    fn steady_from_below(&mut self) -> Option<SteadyVerdict> {
        let d_m = self.model.parameters.d_m;
        let thickness_m = diagnostic::wedge(&self.model, BELOW.0 * d_m);
        let geometry =
            Geometry { thickness_m: &thickness_m, length_m: BELOW.1 * d_m, terminus_x_m: 0.0 };
        let start = self.smoothed_diagnostic(geometry, &LEVELS[..1]).ok()?;
        let March::Settled(_) = self.march(start, FIRST_STEP_A, LEVELS[0]).ok()? else {
            return None;
        };
        let verdict = self.descend_from(LEVELS[0]).ok()?;
        matches!(verdict, SteadyVerdict::Converged { .. }).then_some(verdict)
    }

    fn steady_from_wedge(&mut self, share: f64) -> Result<SteadyVerdict, SolveError> {
        let p = self.model.parameters;
        let thickness_0_m = p.d_m + share * (p.terminus_thickness_m - p.d_m);
        let (thickness_m, length_m) = diagnostic::balanced_wedge(&self.model, thickness_0_m);
        let geometry = Geometry { thickness_m: &thickness_m, length_m, terminus_x_m: 0.0 };
        // A collapse of the smoothed mélange is believed only if a less smoothed one collapses too.
        let mut last = None;
        for reached in [1, 2] {
            let levels = &LEVELS[..reached];
            let start = self.smoothed_diagnostic(geometry, levels)?;
            let smoothing = levels[reached - 1];
            match self.march(start, FIRST_STEP_A, smoothing)? {
                March::Settled(_) => return self.descend_from(smoothing),
                March::Ended(verdict) if matches!(*verdict, SteadyVerdict::NoSteadyState(_)) => {
                    last = Some(*verdict);
                }
                March::Ended(verdict) => return Ok(*verdict),
            }
        }
        Ok(last.expect("the loop ran"))
    }

    /// Pseudo-transient steps at one level of smoothing, until Newton's method on the steady
    /// equations settles from where they lead; the iterate is then its root.
    pub(crate) fn march(
        &mut self,
        start: State,
        first_dt_a: f64,
        smoothing: f64,
    ) -> Result<March, SolveError> {
        let stage = "marching towards the steady state";
        let limits = Limits { iterations: 15, ..Limits::at_smoothing(smoothing) };
        let mut state = start;
        let mut dt_a = first_dt_a;
        let mut time_a = 0.0;
        let mut failure = None;
        // Steps that fail however short they are lack a root nearby in the fluidity, not in time.
        let mut careful = false;
        for _ in 0..MARCH_STEPS {
            state.pack(&mut self.newton.x);
            let balance = if dt_a > LONGEST_STEP_A {
                MassBalance::Steady
            } else {
                MassBalance::Step(Before {
                    per_step: 1.0 / dt_a,
                    thickness_m: &state.thickness_m,
                    length_m: state.length_m,
                })
            };
            let task = Task::new(balance).smoothed(smoothing);
            let outcome = if careful && dt_a <= LONGEST_STEP_A {
                self.solve_or_relax(task, stage)
            } else {
                self.solve_from_iterate(task, limits, stage)
            };
            match outcome {
                Ok(root) if matches!(balance, MassBalance::Steady) => {
                    return Ok(March::Settled(root));
                }
                Ok(_) => {
                    state.unpack(&self.newton.x);
                    time_a += dt_a;
                    dt_a *= GROWTH;
                    if let Some(verdict) = self.runaway(&state, time_a) {
                        return Ok(March::Ended(Box::new(verdict)));
                    }
                }
                Err(error) => {
                    dt_a = 0.25 * dt_a.min(LONGEST_STEP_A);
                    careful |= dt_a < first_dt_a;
                    failure = Some(error);
                    let shortest_a =
                        if is_broken(&self.model, &state) { BREAKING_A } else { SHORTEST_STEP_A };
                    if dt_a < shortest_a {
                        break;
                    }
                }
            }
        }
        if let Some(verdict) = self.stopped_by(&state) {
            return Ok(March::Ended(Box::new(verdict)));
        }
        if is_broken(&self.model, &state) {
            return Err(SolveError::BreaksUp { time_a, length_m: state.length_m });
        }
        Err(failure.unwrap_or(SolveError::NotConverged {
            stage,
            iterations: self.iterations,
            residual_norm: f64::NAN,
            reason: crate::error::NewtonFailure::TooManyIterations,
            history: Vec::new(),
        }))
    }

    /// Whether a march has left what can become a steady state.
    fn runaway(&self, s: &State, time_a: f64) -> Option<SteadyVerdict> {
        let p = &self.model.parameters;
        let h0 = s.thickness_0_m();
        let is_collapsed = collapsed(&self.model, s);
        let ratio = if is_collapsed { 1.0 } else { RUNAWAY_THICKNESS_RATIO };
        if h0 >= ratio * p.terminus_thickness_m {
            return Some(SteadyVerdict::Overthick(format!(
                "the mélange grows past {h0:.0} m at the terminus, which is {} m thick",
                p.terminus_thickness_m
            )));
        }
        is_collapsed.then(|| {
            SteadyVerdict::NoSteadyState(format!(
                "every march collapses; the last one within {time_a:.3} a, at L = {:.0} m and H0 = {h0:.2} m",
                s.length_m
            ))
        })
    }

    /// What stands in the way of a march that cannot go on.
    fn stopped_by(&self, s: &State) -> Option<SteadyVerdict> {
        /// Share of the fjord that a mélange fills when it is said to reach its end.
        const FILLED: f64 = 0.8;
        let (h0, terminus) = (s.thickness_0_m(), self.model.parameters.terminus_thickness_m);
        if h0 > NEARLY_OVERTHICK * terminus {
            return Some(SteadyVerdict::Overthick(format!(
                "the mélange grows to {h0:.0} m at the terminus, which is {terminus} m thick, and no further"
            )));
        }
        let closes_at_m = self.model.fjord.closes_at_m();
        (s.length_m > FILLED * closes_at_m).then(|| {
            SteadyVerdict::FjordClosed(format!(
                "the mélange grows to {:.0} m, where the walls, which meet at {closes_at_m:.0} m, stop it",
                s.length_m
            ))
        })
    }
}

/// Whether a state is thinner than its icebergs between its ends.
pub fn has_trough(model: &Model, s: &State) -> bool {
    s.thickness_m.iter().any(|h| *h < TROUGH_RATIO * model.parameters().d_m)
}

/// Whether a state that cannot go on is about to break up: between its ends it is thinner than its
/// icebergs, and H_L = d holds in more than one place.
pub(crate) fn is_broken(model: &Model, s: &State) -> bool {
    s.thickness_m.iter().any(|h| *h < model.parameters().d_m)
}

/// Whether a state counts as collapsed.
pub fn collapsed(model: &Model, s: &State) -> bool {
    let d = model.parameters().d_m;
    let h0 = s.thickness_0_m();
    h0 <= COLLAPSE_THICKNESS_RATIO * d
        || (s.length_m <= COLLAPSE_LENGTH_RATIO * d && h0 <= COLLAPSE_SHORT_THICKNESS_RATIO * d)
}
