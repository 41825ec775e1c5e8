//! What is tried when a solve found nothing: the way from the nearest of the steady states found before, or
//! from another geometry, by halving the distance. Knows no queue, no archive and no equation.

use melange_solver::diagnostic::{self, Geometry};
use melange_solver::error::SolveError;
use melange_solver::fjord::Fjord;
use melange_solver::params::{PARAMETERS, Parameters};
use melange_solver::state::State;
use melange_solver::steady::SteadyVerdict;
use melange_solver::trail::Trail;
use melange_solver::{Model, Solution, Solver};
use std::collections::VecDeque;

/// Steady states that are remembered.
const REMEMBERED: usize = 8;
/// Halvings of the distance: no step is shorter than 1/64 of it.
const HALVINGS: u32 = 6;
/// Solves on the way.
const SOLVES: usize = 40;
/// Accuracies that a transient tries in turn, as shares of the tolerance asked for.
pub const FINER: [f64; 2] = [1e-1, 1e-2];
/// Steps after which such a try is given up: what no step is short enough for can take any number of them.
pub const FINER_STEPS: usize = 20_000;

/// How many attempts were made, and how the later ones went about it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Attempts {
    /// Their number; the last one gave the answer if there is one.
    pub made: u64,
    /// What was tried after the first.
    tried: Vec<String>,
    /// What of it led on.
    led: Vec<String>,
}

impl Default for Attempts {
    fn default() -> Self {
        Self { made: 1, tried: Vec::new(), led: Vec::new() }
    }
}

impl Attempts {
    /// Counts another one, that led nowhere.
    pub fn in_vain(&mut self, how: String) {
        self.made += 1;
        self.tried.push(how);
    }

    /// Counts another one, that led on.
    pub fn led(&mut self, how: String) {
        self.led.push(how.clone());
        self.in_vain(how);
    }

    /// The end of a sentence on how a run ended; empty if there was but one attempt.
    pub fn told(&self, has_failed: bool) -> String {
        let ordinal = match self.made {
            1 => return String::new(),
            _ if has_failed => return format!("; tried again {}", self.tried.join(" and ")),
            2 => "second".to_owned(),
            3 => "third".to_owned(),
            made => format!("{made}th"),
        };
        format!("; found at the {ordinal} attempt, {}", self.led.join(" and "))
    }
}

/// "in 1 step", "in 3 steps".
pub fn in_steps(steps: usize) -> String {
    format!("in {steps} {}", if steps == 1 { "step" } else { "steps" })
}

/// Whether another way may lead where this one did not.
pub fn another_may_help(error: &SolveError) -> bool {
    match error {
        SolveError::NotConverged { .. }
        | SolveError::NoStepShortEnough { .. }
        | SolveError::BreaksUp { .. } => true,
        SolveError::Parameters(_)
        | SolveError::UnusableState { .. }
        | SolveError::BeyondTable { .. }
        | SolveError::ClosureLeavesFamily { .. }
        | SolveError::Stopped { .. } => false,
    }
}

/// A steady state that was found.
#[derive(Debug, Clone)]
pub struct Way {
    /// Of what.
    pub model: Model,
    /// How.
    pub trail: Trail,
    /// By which of a walker's solves.
    pub solve: usize,
}

/// The steady states found last, the newest at the end.
#[derive(Debug, Default)]
pub struct Found(VecDeque<Way>);

impl Found {
    /// Remembers one, and forgets the oldest if there are many.
    pub fn remember(&mut self, way: Way) {
        if self.0.len() == REMEMBERED {
            self.0.pop_front();
        }
        self.0.push_back(way);
    }

    /// The newest.
    pub fn newest(&self) -> Option<&Way> {
        self.0.back()
    }

    /// The one nearest to a model of its kind: same grid, closure, shape of the melt and kind of fjord.
    pub fn nearest(&self, to: &Model) -> Option<&Way> {
        let distance = |way: &Way| distance(way.model.parameters(), to.parameters());
        let of_its_kind = self.0.iter().filter(|way| is_of_a_kind(&way.model, to));
        of_its_kind.min_by(|a, b| distance(a).total_cmp(&distance(b)))
    }
}

fn is_of_a_kind(a: &Model, b: &Model) -> bool {
    a.parameters().n_cells == b.parameters().n_cells
        && a.closure() == b.closure()
        && a.melt_shape() == b.melt_shape()
        && (a.fjord() == b.fjord() || (is_straight(a) && is_straight(b)))
}

/// Whether the fjord is what the parameters say, and not a table.
fn is_straight(model: &Model) -> bool {
    let p = model.parameters();
    *model.fjord() == Fjord::straight(p.width_m, p.width_gradient)
}

/// Sum of the squares of the parameters' differences, each relative to the parameter.
fn distance(a: &Parameters, b: &Parameters) -> f64 {
    let squares = PARAMETERS.iter().map(|info| {
        let (a, b) = ((info.get)(a), (info.get)(b));
        if a == b { 0.0 } else { ((a - b) / (a.abs() + b.abs())).powi(2) }
    });
    squares.sum()
}

/// The model a share of the way from one to another of its kind, every parameter in proportion. None if
/// the parameters on the way exclude each other.
fn between(from: &Model, to: &Model, share: f64) -> Option<Model> {
    let mut parameters = *to.parameters();
    for info in PARAMETERS.iter().filter(|info| !info.whole) {
        let (a, b) = ((info.get)(from.parameters()), (info.get)(to.parameters()));
        let value = if a == b { a } else { a + share * (b - a) };
        parameters.set(info.name, value).ok()?;
    }
    parameters.check().ok()?;
    Some(if is_straight(to) {
        let straight = Model::new(parameters, to.closure()).ok()?;
        straight.with_melt_shape(to.melt_shape().clone())
    } else {
        to.with_parameters(parameters)
    })
}

/// The verdict on a model's steady state, found by continuation from the nearest that is remembered, and the
/// steps that led there; none if they led nowhere. It is the verdict of the steady state itself, whatever the
/// neighbour: only that there is one may hang on what is remembered.
pub fn continued(
    solver: &mut Solver,
    found: &Found,
    to: &Model,
    stop: &dyn Fn() -> bool,
) -> Option<(SteadyVerdict, usize)> {
    let Way { model: from, trail, .. } = found.nearest(to)?;
    let mut spent = 0;
    let mut last = None;
    let step = |near: &Trail, share: f64| {
        let model = if share == 1.0 { to.clone() } else { between(from, to, share)? };
        solver.retarget(model);
        match solver.steady_along(near).ok()?? {
            SteadyVerdict::Converged { solution, trail } => {
                spent += solution.iterations;
                last = Some(Solution { iterations: spent, ..solution });
                Some(trail)
            }
            _ => None,
        }
    };
    let arrival = by_halving(trail.clone(), step, stop);
    solver.retarget(to.clone());
    let (solution, Arrival { place: trail, steps }) = (last?, arrival?);
    Some((SteadyVerdict::Converged { solution, trail }, steps))
}

/// Velocity, fluidity and friction at a geometry, by way of geometries between it and a mélange that stands by
/// friction at its walls alone, and the steps that led there. The answer does not depend on the way.
pub fn by_way_of_a_wedge(
    solver: &mut Solver,
    to: Geometry<'_>,
    stop: &dyn Fn() -> bool,
) -> Option<(Solution, usize)> {
    /// Thickness of that mélange at the terminus, as a share of the way from d to the glacier's.
    const SHARE: f64 = 0.2;
    let p = *solver.model().parameters();
    if p.terminus_velocity_m_per_a == 0.0 && p.calving_rate_m_per_a == 0.0 {
        // Nothing slides, and no friction holds a wedge.
        return None;
    }
    let thickness_0_m = p.d_m + SHARE * (p.terminus_thickness_m - p.d_m);
    let (thickness_m, length_m) = diagnostic::balanced_wedge(solver.model(), thickness_0_m);
    let wedge = Geometry { thickness_m: &thickness_m, length_m, ..to };
    let first = solver.diagnostic_in(wedge).ok()?;
    let mut spent = first.iterations;
    let mut last = None;
    let step = |near: &State, share: f64| {
        // Thickness and length vary by factors.
        let mean = |from: f64, to: f64| from.powf(1.0 - share) * to.powf(share);
        let heights = thickness_m.iter().zip(to.thickness_m).map(|(from, to)| mean(*from, *to));
        let heights: Vec<f64> = heights.collect();
        let between =
            Geometry { thickness_m: &heights, length_m: mean(length_m, to.length_m), ..to };
        let there = if share == 1.0 { to } else { between };
        let solution = solver.diagnostic_near(there, near).ok()?;
        spent += solution.iterations;
        let state = solution.state.clone();
        last = Some(Solution { iterations: spent, ..solution });
        Some(state)
    };
    let arrival = by_halving(first.state, step, stop)?;
    Some((last?, arrival.steps))
}

/// The end of a way.
#[derive(Debug, Clone, PartialEq)]
struct Arrival<P> {
    /// What was found there.
    place: P,
    /// Steps that led there.
    steps: usize,
}

/// Goes from a place to the whole of the way, 1: a step that leads nowhere is halved, and two of a length
/// that lead on are followed by one of twice the length. `step` is given the last place and the share of
/// the way to go to. None after too many halvings or solves, or when `stop` says so.
fn by_halving<P>(
    from: P,
    mut step: impl FnMut(&P, f64) -> Option<P>,
    stop: &dyn Fn() -> bool,
) -> Option<Arrival<P>> {
    let shortest = 0.5_f64.powi(HALVINGS as i32);
    let (mut place, mut reached, mut length, mut steps) = (from, 0.0, 1.0, 0);
    let mut in_a_row = 0;
    for _ in 0..SOLVES {
        if stop() {
            return None;
        }
        let share = f64::min(reached + length, 1.0);
        match step(&place, share) {
            Some(next) => {
                (place, reached) = (next, share);
                steps += 1;
                if reached == 1.0 {
                    return Some(Arrival { place, steps });
                }
                in_a_row += 1;
                if in_a_row == 2 {
                    (length, in_a_row) = (2.0 * length, 0);
                }
            }
            None => {
                // What was to go to lies no further than the end.
                length = 0.5 * (share - reached);
                in_a_row = 0;
                if length < shortest {
                    return None;
                }
            }
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use melange_solver::physics::closure::UpstreamClosure;

    #[test]
    fn an_end_tells_which_attempt_led_there() {
        let mut attempts = Attempts::default();
        assert_eq!((attempts.told(false), attempts.told(true)), (String::new(), String::new()));
        attempts.led("by continuation in 3 steps".into());
        let found = "; found at the second attempt, by continuation in 3 steps";
        assert_eq!(attempts.told(false), found);
        attempts.in_vain("with steps of 1e-5".into());
        attempts.led("with steps of 1e-6".into());
        assert_eq!(attempts.made, 4);
        let found = "; found at the 4th attempt, by continuation in 3 steps and with steps of 1e-6";
        assert_eq!(attempts.told(false), found);
        let tried = "; tried again by continuation in 3 steps and with steps of 1e-5 and with steps of 1e-6";
        assert_eq!(attempts.told(true), tried);
    }

    /// Steps up to a length lead on; the places are the shares passed.
    fn walk(longest: f64) -> (Option<Arrival<Vec<f64>>>, usize) {
        let mut solves = 0;
        let step = |from: &Vec<f64>, share: f64| {
            solves += 1;
            let last = from.last().copied().unwrap_or(0.0);
            (share - last <= longest).then(|| [from.as_slice(), &[share]].concat())
        };
        (by_halving(Vec::new(), step, &|| false), solves)
    }

    #[test]
    fn the_whole_distance_comes_first() {
        let (arrival, solves) = walk(1.0);
        assert_eq!(arrival, Some(Arrival { place: vec![1.0], steps: 1 }));
        assert_eq!(solves, 1);
    }

    #[test]
    fn steps_that_lead_nowhere_are_halved() {
        let (arrival, solves) = walk(0.3);
        let arrival = arrival.expect("quarters lead on");
        assert_eq!(arrival.place, [0.25, 0.5, 0.75, 1.0]);
        assert_eq!(arrival.steps, 4);
        // 1, ½, ¼ ✓, ¼ ✓, ½, ¼ ✓, ¼ ✓.
        assert_eq!(solves, 7);
    }

    #[test]
    fn a_way_that_leads_nowhere_is_given_up() {
        let (arrival, solves) = walk(0.0);
        assert_eq!((arrival, solves), (None, HALVINGS as usize + 1));
        let (arrival, solves) = walk(1.0 / 64.0);
        assert_eq!((arrival, solves), (None, SOLVES));
    }

    #[test]
    fn a_stop_is_heard_between_solves() {
        let solves = std::cell::Cell::new(0);
        let step = |_: &(), _| {
            solves.set(solves.get() + 1);
            None
        };
        assert_eq!(by_halving((), step, &|| solves.get() == 2), None);
        assert_eq!(solves.get(), 2);
    }

    fn model(melt_rate_m_per_day: f64, width_m: f64, n_cells: usize) -> Model {
        let parameters =
            Parameters { melt_rate_m_per_day, width_m, n_cells, ..Parameters::default() };
        Model::new(parameters, UpstreamClosure::default()).expect("parameters in range")
    }

    #[test]
    fn models_on_the_way_have_parameters_in_proportion() {
        let (from, to) = (model(0.5, 4000.0, 20), model(0.7, 6000.0, 20));
        let quarter = between(&from, &to, 0.25).expect("in range");
        assert!((quarter.parameters().melt_rate_m_per_day - 0.55).abs() < 1e-15);
        assert_eq!(quarter.parameters().width_m, 4500.0);
        assert_eq!(quarter.fjord().width(1e4), 4500.0);
        let end = between(&from, &to, 1.0).expect("in range");
        assert_eq!(end.parameters().width_m, 6000.0);
    }

    fn steady(model: &Model) -> (Solution, Trail) {
        match Solver::new(model.clone()).steady(None) {
            Ok(SteadyVerdict::Converged { solution, trail }) => (solution, trail),
            other => panic!("{other:?}"),
        }
    }

    /// From afar it takes several steps, and the state is the one that a solve of its own finds.
    #[test]
    fn continuation_finds_the_steady_state_itself() {
        let (from, to) = (model(0.4, 3500.0, 30), model(0.8, 5000.0, 30));
        let mut found = Found::default();
        found.remember(Way { model: from.clone(), trail: steady(&from).1, solve: 0 });
        let mut solver = Solver::new(to.clone());
        let (verdict, steps) = continued(&mut solver, &found, &to, &|| false).expect("a way");
        let SteadyVerdict::Converged { solution, .. } = verdict else { panic!("{verdict:?}") };
        let own = steady(&to).0;
        assert!(steps > 1, "{steps}");
        assert!((solution.state.length_m / own.state.length_m - 1.0).abs() < 1e-9);
        let (h0, own_h0) = (solution.state.thickness_0_m(), own.state.thickness_0_m());
        assert!((h0 / own_h0 - 1.0).abs() < 1e-9, "{h0} {own_h0}");
        assert_eq!(solver.model(), &to);
        assert_eq!(continued(&mut solver, &found, &to, &|| true), None);
    }

    #[test]
    fn the_nearest_is_of_the_same_kind() {
        let mut found = Found::default();
        for (melt, n_cells) in [(0.5, 20), (0.6, 20), (0.8, 20), (0.7, 24)] {
            let model = model(melt, 4000.0, n_cells);
            let trail = steady(&model).1;
            found.remember(Way { model, trail, solve: 0 });
        }
        let melt = |to: &Model| {
            let nearest = found.nearest(to);
            nearest.map(|way| way.model.parameters().melt_rate_m_per_day)
        };
        assert_eq!(melt(&model(0.69, 4000.0, 20)), Some(0.6));
        assert_eq!(melt(&model(0.69, 4000.0, 24)), Some(0.7));
        assert_eq!(melt(&model(0.69, 4000.0, 30)), None);
    }
}
