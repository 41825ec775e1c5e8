//! Time steps of controlled error: the two-step backward differentiation formula with variable step,
//! its error by Milne's device from a quadratic predictor (Hairer, Nørsett & Wanner 1993, §III.5–6),
//! started, after every kink of the forcing, by backward Euler with step doubling. Knows no equation.

use crate::Solver;
use crate::error::SolveError;
use crate::physics::continuity::Before;
use crate::state::{State, scale};
use crate::transient::{Ending, Evolution};

/// First step tried, a.
const FIRST_STEP_A: f64 = 1e-3;
/// The step that makes a start consistent, a: a wedge need not satisfy the closure at the terminus or
/// H_L = d, which the first implicit step then sees to, however short it is. It counts as no time.
const SETTLING_STEP_A: f64 = 1e-9;
/// A shorter step than this is given up, a.
const SHORTEST_STEP_A: f64 = 1e-10;
/// The tolerance is spent over this time, the paper's time scale (Appendix B), so that the error of a result
/// is about the tolerance, however many steps there are; longer steps may spend it at once. a.
const SPENT_OVER_A: f64 = scale::LENGTH / scale::VELOCITY;
/// Least share of the tolerance that a step may spend: where a cell crosses a kink the discrete root
/// jumps by 1e-7 or so, however short the step.
const LEAST_SHARE: f64 = 1e-3;
/// Share of the step that the error would allow.
const SAFETY: f64 = 0.85;
/// Least and most that a step is of the one before; the formula is stable up to 1 + √2.
const CHANGE: (f64, f64) = (0.2, 2.0);
/// Times closer than this are one, a: a kink of the forcing and a landing may differ by rounding.
const SAME_TIME_A: f64 = 1e-9;
/// A step that has no solution is tried again with this share of its length.
const AFTER_FAILURE: f64 = 0.25;

/// A state that the past consists of.
#[derive(Debug, Clone)]
struct Past {
    time_a: f64,
    state: State,
    terminus_x_m: f64,
}

/// A step tried: its error in units of the tolerance, or none if there is no solution.
type Tried = Result<f64, SolveError>;

impl Solver {
    pub(crate) fn evolve_controlled(
        &mut self,
        run: &mut Evolution<'_>,
        tolerance: f64,
        land_on_a: &[f64],
    ) -> Result<(), SolveError> {
        let mut next = usize::from(land_on_a.first() == Some(&0.0));
        run.report(0.0, (next == 1).then_some(0))?;
        if run.end.ending == Ending::Completed {
            // A start that cannot be made consistent is tried as it is.
            let start = run.now();
            self.euler(run, &start, SETTLING_STEP_A, SETTLING_STEP_A).ok();
        }
        let mut past: Vec<Past> = Vec::with_capacity(4);
        let mut wanted_a = FIRST_STEP_A;
        while next < land_on_a.len() && run.end.ending == Ending::Completed {
            let from_a = run.end.time_a;
            let landing_a = land_on_a[next];
            if landing_a - from_a <= SAME_TIME_A {
                run.end.time_a = landing_a;
                run.report(0.0, Some(next))?;
                next += 1;
                continue;
            }
            let kink_a = run.plan.forcing.next_break_after(from_a + SAME_TIME_A);
            let kink_a = kink_a.unwrap_or(f64::INFINITY);
            let is_kink = kink_a <= landing_a + SAME_TIME_A;
            let is_landing = landing_a <= kink_a + SAME_TIME_A;
            let target_a = if is_landing { landing_a } else { kink_a };
            let remaining_a = target_a - from_a;
            if let [_, old, last] = &past[..] {
                wanted_a = wanted_a.min(CHANGE.1 * (last.time_a - old.time_a));
            }
            // Two steps rather than a long and a tiny one.
            let is_last = wanted_a >= remaining_a;
            let dt_a = if is_last { remaining_a } else { wanted_a.min(0.5 * remaining_a) };
            let to_a = if is_last { target_a } else { from_a + dt_a };
            if past.is_empty() {
                past.push(run.now());
            }
            let kept = run.end.clone();
            // Of the error over the step's share of the tolerance.
            let order = if past.len() < 3 { 1.0 } else { 2.0 };
            let tolerance = tolerance * (dt_a / SPENT_OVER_A).clamp(LEAST_SHARE, 1.0);
            let tried = if past.len() < 3 {
                self.start_by_doubling(run, &mut past, dt_a, to_a, tolerance)
            } else {
                self.two_step(run, &past, dt_a, to_a, tolerance)
            };
            let no_number = SolveError::NoStepShortEnough { time_a: from_a };
            let tried = tried.and_then(|e| if e.is_nan() { Err(no_number) } else { Ok(e) });
            match tried {
                Ok(error) if error <= 1.0 => {
                    run.end.steps += 1;
                    run.end.time_a = to_a;
                    past.push(run.now());
                    past.drain(..past.len().saturating_sub(3));
                    let change = (SAFETY * error.powf(-1.0 / order)).clamp(CHANGE.0, CHANGE.1);
                    // A step cut short by a landing says little about how long it could have been.
                    wanted_a = if is_last { wanted_a.max(dt_a * change) } else { dt_a * change };
                    self.model.check_reach(run.end.terminus_x_m, run.end.state.length_m)?;
                    run.end.ending = self.ending(&run.end);
                    run.count_stopped_calving();
                    let has_landed = is_last && is_landing;
                    run.report(dt_a, has_landed.then_some(next))?;
                    next += usize::from(has_landed);
                    if is_last && is_kink {
                        past.clear();
                        wanted_a = wanted_a.min(FIRST_STEP_A);
                    }
                }
                tried => {
                    let repeated_steps = kept.repeated_steps + 1;
                    run.end = crate::transient::TransientEnd { repeated_steps, ..kept };
                    wanted_a = match &tried {
                        Ok(error) => {
                            let change = SAFETY * error.powf(-1.0 / order);
                            dt_a * change.clamp(CHANGE.0, SAFETY)
                        }
                        Err(_) => AFTER_FAILURE * dt_a,
                    };
                    if tried.is_err() {
                        past.clear();
                    }
                    if wanted_a < SHORTEST_STEP_A {
                        let Some(ending) = self.stopped_by_what(&run.end) else {
                            return Err(tried
                                .err()
                                .unwrap_or(SolveError::NoStepShortEnough { time_a: from_a }));
                        };
                        run.end.ending = ending;
                        run.report(0.0, None)?;
                    }
                }
            }
        }
        Ok(())
    }

    /// Backward Euler over the whole step and over its halves; the halves are kept, with the middle in
    /// the past, and differ from the truth by about as much as from the whole.
    fn start_by_doubling(
        &mut self,
        run: &mut Evolution<'_>,
        past: &mut Vec<Past>,
        dt_a: f64,
        to_a: f64,
        tolerance: f64,
    ) -> Tried {
        past.truncate(1);
        let start = past[0].clone();
        self.euler(run, &start, dt_a, to_a)?;
        let whole = run.end.state.clone();
        let middle_a = start.time_a + 0.5 * dt_a;
        self.euler(run, &start, 0.5 * dt_a, middle_a)?;
        let middle = Past { time_a: middle_a, ..run.now() };
        self.euler(run, &middle, 0.5 * dt_a, to_a)?;
        past.push(middle);
        let now = &run.end.state;
        let by_length = (now.length_m - whole.length_m).abs() / now.length_m;
        let by_thickness =
            (now.thickness_0_m() - whole.thickness_0_m()).abs() / now.thickness_0_m();
        Ok(by_length.max(by_thickness) / tolerance)
    }

    fn euler(
        &mut self,
        run: &mut Evolution<'_>,
        from: &Past,
        dt_a: f64,
        to_a: f64,
    ) -> Result<(), SolveError> {
        self.set_parameters(run, to_a);
        let before = Before {
            per_step: 1.0 / dt_a,
            thickness_m: &from.state.thickness_m,
            length_m: from.state.length_m,
        };
        let advance = self.moving_from(run, from.terminus_x_m, dt_a);
        let root = self.step(&from.state, before, advance)?;
        self.accept(run, root, from.terminus_x_m, dt_a);
        Ok(())
    }

    /// With r = Δt/Δt_before: y′ = ((1 + 2r)y − ((1 + r)²y₁ − r²y₂))/((1 + r)Δt), y₁ and y₂ being the
    /// last two states. Its local error is y‴/6·Δt(Δt + Δt₁)/a, a = (1 + 2r)/((1 + r)Δt), and that of
    /// the quadratic through the last three states y‴/6·Δt(Δt + Δt₁)(Δt + Δt₁ + Δt₂), of other sign.
    fn two_step(
        &mut self,
        run: &mut Evolution<'_>,
        past: &[Past],
        dt_a: f64,
        to_a: f64,
        tolerance: f64,
    ) -> Tried {
        let [oldest, old, last] = past else { unreachable!("three states are kept") };
        let (dt1_a, dt2_a) = (last.time_a - old.time_a, old.time_a - oldest.time_a);
        let r = dt_a / dt1_a;
        let per_step = (1.0 + 2.0 * r) / ((1.0 + r) * dt_a);
        let weight = [(1.0 + r).powi(2) / (1.0 + 2.0 * r), r * r / (1.0 + 2.0 * r)];
        let mean = |[y1, y2]: [f64; 2]| weight[0] * y1 - weight[1] * y2;
        let past = State::combined([&last.state, &old.state], mean);
        let before = Before { per_step, thickness_m: &past.thickness_m, length_m: past.length_m };
        let from_x_m = mean([last.terminus_x_m, old.terminus_x_m]);

        // Newton's form of the quadratic through the past, at the new time.
        let predictor =
            State::combined([&last.state, &old.state, &oldest.state], |[y0, y1, y2]| {
                let (slope1, slope2) = ((y0 - y1) / dt1_a, (y1 - y2) / dt2_a);
                y0 + dt_a * (slope1 + (dt_a + dt1_a) * (slope1 - slope2) / (dt1_a + dt2_a))
            });
        self.set_parameters(run, to_a);
        let advance = self.moving_from(run, from_x_m, 1.0 / per_step);
        let is_state = predictor.check(predictor.n_cells()).is_ok();
        let guess = if is_state { &predictor } else { &last.state };
        let root = self.step(guess, before, advance)?;
        self.accept(run, root, from_x_m, 1.0 / per_step);
        let share = 1.0 / (1.0 + per_step * (dt_a + dt1_a + dt2_a));
        let error = |y: fn(&State) -> f64| {
            let now = y(&run.end.state);
            share * (now - y(&predictor)).abs() / now.abs()
        };
        Ok(error(|s| s.length_m).max(error(State::thickness_0_m)) / tolerance)
    }
}

impl Evolution<'_> {
    fn now(&self) -> Past {
        Past {
            time_a: self.end.time_a,
            state: self.end.state.clone(),
            terminus_x_m: self.end.terminus_x_m,
        }
    }
}
