//! Steady states of parameters drawn at random, and marches in time against verdicts that there
//! is none. What fails, breaks off, is not finite or contradicts is told. Knows the solver, no file, no
//! queue and no transport.

use super::Numbers;
use melange_solver::error::SolveError;
use melange_solver::observe::Moment;
use melange_solver::params::{ParameterError, Parameters};
use melange_solver::physics::closure::UpstreamClosure;
use melange_solver::state::State;
use melange_solver::steady::SteadyVerdict;
use melange_solver::transient::{Ending, Plan};
use melange_solver::{Model, Solver, diagnostic, force};
use rayon::prelude::*;
use serde::Serialize;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fmt;
use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::{Duration, Instant};

/// What a soak is asked for.
#[derive(Debug, Clone, Copy)]
pub struct Request {
    /// Parameter sets.
    pub count: u64,
    /// Seed of the drawing.
    pub seed: u64,
    /// Verdicts of no steady state that are tried by time.
    pub transients: usize,
}

/// How a parameter is drawn between two bounds.
#[derive(Debug, Clone, Copy)]
enum Spread {
    Even,
    Logarithmic,
    /// Evenly among whole numbers, both bounds among them.
    Whole,
}

/// A draw: the parameters it sets, its bounds, and how it lies between them.
type Draw = (&'static [&'static str], f64, f64, Spread);

/// What is drawn, in this order; one draw may set several parameters.
const DRAWS: [Draw; 9] = [
    (&["melt_rate_m_per_day"], 0.0, 3.0, Spread::Even),
    (&["width_m"], 1_000.0, 20_000.0, Spread::Even),
    (&["width_gradient"], -0.1, 0.1, Spread::Even),
    (&["terminus_velocity_m_per_a", "calving_rate_m_per_a"], 500.0, 20_000.0, Spread::Even),
    (&["terminus_thickness_m"], 100.0, 1_200.0, Spread::Even),
    (&["b"], 1e3, 1e7, Spread::Logarithmic),
    (&["A"], 0.1, 10.0, Spread::Logarithmic),
    (&["mu_s"], 0.1, 0.7, Spread::Even),
    (&["n_cells"], 10.0, 400.0, Spread::Whole),
];
/// Bounds of d in m, which is drawn last; the upper one is H_t where that is less.
const ICEBERGS_M: (f64, f64) = (2.0, 100.0);

/// Cells up to which a solve counts as one of everyday size.
const EVERYDAY_CELLS: usize = 100;
/// How far a march in time goes, a.
const MARCH_A: f64 = 20.0;
/// Last part of it, in which a mélange that has come to rest no longer changes, a.
const REST_A: f64 = 2.0;
/// Relative change of L and H₀ during that part below which the mélange is at rest.
const AT_REST: f64 = 1e-3;
/// Tolerance of the steps.
const TOLERANCE: f64 = 1e-3;
/// Steps after which a march is given up; most take fewer than 200.
const MOST_STEPS: usize = 5_000;
/// Thickness of the mélange that marches, as a share of the way from d to H_t.
const START_SHARE: f64 = 0.3;

/// A parameter set with what is wrong with it.
#[derive(Debug, Clone, Serialize)]
pub struct Finding {
    /// Number of the set.
    pub index: u64,
    /// What happened.
    pub what: String,
    /// The scenario, to be given to `melange run -`.
    pub scenario: Value,
}

/// A solve that took long.
#[derive(Debug, Clone, Copy, Default, Serialize)]
pub struct Slowest {
    /// Number of the set.
    pub index: u64,
    /// Its cells.
    pub n_cells: usize,
    /// Time of the solve, ms.
    pub duration_ms: f64,
}

/// What a soak came to. Times aside, the same for the same request on any machine.
#[derive(Debug, Clone, Serialize)]
pub struct Report {
    /// Parameter sets.
    pub count: u64,
    /// Seed of the drawing.
    pub seed: u64,
    /// How many ended in which way.
    pub endings: BTreeMap<&'static str, u64>,
    /// Solves without an answer.
    pub failed: Vec<Finding>,
    /// Solves that broke off.
    pub panicked: Vec<Finding>,
    /// Steady states with a number that is not finite.
    pub not_finite: Vec<Finding>,
    /// How many verdicts of no steady state were tried by time, and how those tries ended.
    pub marches: BTreeMap<&'static str, u64>,
    /// Verdicts of no steady state of parameters whose mélange came to rest.
    pub contradicted: Vec<Finding>,
    /// Marches without an answer.
    pub marches_failed: Vec<Finding>,
    /// Slowest solve up to 100 cells.
    pub slowest_everyday: Slowest,
    /// Slowest solve.
    pub slowest: Slowest,
    /// Slowest march.
    pub slowest_march: Slowest,
    /// Median time of solves up to 100 cells, ms.
    pub median_everyday_ms: f64,
    /// Median time of all solves, ms.
    pub median_ms: f64,
}

impl Report {
    /// Whether nothing failed and nothing contradicts.
    pub fn is_clean(&self) -> bool {
        self.findings().all(|(_, findings)| findings.is_empty())
    }

    fn findings(&self) -> impl Iterator<Item = (&'static str, &[Finding])> {
        [
            ("failed", self.failed.as_slice()),
            ("panicked", &self.panicked),
            ("not finite", &self.not_finite),
            ("contradicted", &self.contradicted),
            ("marches failed", &self.marches_failed),
        ]
        .into_iter()
    }
}

/// How a set's solve ended, or what was wrong.
struct Solved {
    index: u64,
    parameters: Parameters,
    ending: &'static str,
    what: String,
    duration: Duration,
}

/// Draws, solves and marches, on the threads of the pool it is called in.
pub fn run(request: Request) -> Report {
    let solved: Vec<Solved> =
        (0..request.count).into_par_iter().map(|index| solve(request.seed, index)).collect();
    let told = |ending| {
        let those = solved.iter().filter(move |s| s.ending == ending);
        those.map(|s| finding(s.index, &s.parameters, s.what.clone())).collect()
    };
    let mut report = Report {
        count: request.count,
        seed: request.seed,
        endings: BTreeMap::new(),
        failed: told("failed"),
        panicked: told("panicked"),
        not_finite: told("not_finite"),
        marches: BTreeMap::new(),
        contradicted: Vec::new(),
        marches_failed: Vec::new(),
        slowest_everyday: slowest(&solved, EVERYDAY_CELLS),
        slowest: slowest(&solved, usize::MAX),
        slowest_march: Slowest::default(),
        median_everyday_ms: median_ms(&solved, EVERYDAY_CELLS),
        median_ms: median_ms(&solved, usize::MAX),
    };
    for s in &solved {
        *report.endings.entry(s.ending).or_default() += 1;
    }
    // The sets are random already, so the first of them are a sample.
    let without: Vec<&Solved> =
        solved.iter().filter(|s| s.ending == "no_steady_state").take(request.transients).collect();
    let timed = |s: &Solved| {
        let begin = Instant::now();
        let (ending, what) = march(&s.parameters);
        Solved { index: s.index, parameters: s.parameters, ending, what, duration: begin.elapsed() }
    };
    let marched: Vec<Solved> = without.into_par_iter().map(timed).collect();
    report.slowest_march = slowest(&marched, usize::MAX);
    for Solved { index, parameters, ending, what, .. } in marched {
        *report.marches.entry(ending).or_default() += 1;
        match ending {
            "at_rest" => report.contradicted.push(finding(index, &parameters, what)),
            "failed" => report.marches_failed.push(finding(index, &parameters, what)),
            _ => {}
        }
    }
    report
}

impl Numbers {
    /// Rounded to six digits, so that a scenario is short and does not hang on a machine's logarithm.
    fn between(&mut self, low: f64, high: f64, spread: Spread) -> f64 {
        let share = self.next();
        let value = match spread {
            Spread::Even => low + share * (high - low),
            Spread::Logarithmic => low * (share * (high / low).ln()).exp(),
            Spread::Whole => return low + (share * (high - low + 1.0)).floor(),
        };
        format!("{value:.5e}").parse().expect("a number that was just written")
    }
}

fn draw(seed: u64, index: u64) -> Result<Parameters, ParameterError> {
    let mut numbers = Numbers::new(seed, index);
    let mut parameters = Parameters::default();
    for (names, low, high, spread) in DRAWS {
        let value = numbers.between(low, high, spread);
        for name in names {
            parameters.set(name, value)?;
        }
    }
    let largest_m = ICEBERGS_M.1.min(parameters.terminus_thickness_m);
    parameters.set("d_m", numbers.between(ICEBERGS_M.0, largest_m, Spread::Even))?;
    Ok(parameters)
}

fn solve(seed: u64, index: u64) -> Solved {
    let parameters = draw(seed, index).expect("what is drawn lies within the parameters' ranges");
    let begin = Instant::now();
    let solved = catch_unwind(AssertUnwindSafe(|| steady(parameters)));
    let duration = begin.elapsed();
    let (ending, what) = match solved {
        Ok(Ok(ending)) => ending,
        Ok(Err(error)) => ("failed", error.to_string()),
        Err(_) => ("panicked", "the solver broke off".into()),
    };
    Solved { index, parameters, ending, what, duration }
}

fn steady(parameters: Parameters) -> Result<(&'static str, String), SolveError> {
    let model = Model::new(parameters, UpstreamClosure::default())?;
    Ok(match Solver::new(model).steady(None)? {
        SteadyVerdict::Converged { solution, .. } => match first_not_finite(&solution.state) {
            Some(name) => ("not_finite", name.into()),
            None => ("converged", String::new()),
        },
        SteadyVerdict::NoSteadyState(evidence) => ("no_steady_state", evidence),
        SteadyVerdict::Overthick(evidence) => ("overthick", evidence),
        SteadyVerdict::FjordClosed(evidence) => ("fjord_closed", evidence),
    })
}

fn first_not_finite(s: &State) -> Option<&'static str> {
    let numbers = [
        ("velocity_m_per_a", s.velocity_m_per_a.as_slice()),
        ("mu_w", &s.mu_w),
        ("thickness_m", &s.thickness_m),
        ("fluidity_per_a", &s.fluidity_per_a),
        ("length_m", &[s.length_m]),
        ("force_n_per_m", &[force::force_n_per_m(s)]),
    ];
    numbers.into_iter().find(|(_, v)| v.iter().any(|x| !x.is_finite())).map(|(name, _)| name)
}

/// A march in time from a wedge, and how it ended.
fn march(parameters: &Parameters) -> (&'static str, String) {
    catch_unwind(AssertUnwindSafe(|| try_march(parameters)))
        .unwrap_or_else(|_| Ok(("failed", "the solver broke off".into())))
        .unwrap_or_else(|error| ("failed", error.to_string()))
}

fn try_march(p: &Parameters) -> Result<(&'static str, String), SolveError> {
    let model = Model::new(*p, UpstreamClosure::default())?;
    let thickness_0_m = p.d_m + START_SHARE * (p.terminus_thickness_m - p.d_m);
    let (thickness_m, length_m) = diagnostic::balanced_wedge(&model, thickness_0_m);
    let mut solver = Solver::new(model);
    let start = solver.diagnostic(&thickness_m, length_m)?.state;
    let mut landed = Vec::new();
    let mut keep = |m: Moment<'_>| {
        if m.landing.is_some() {
            landed.push((m.state.length_m, m.state.thickness_0_m()));
        }
        if m.step < MOST_STEPS { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
    };
    let plan = Plan::controlled(TOLERANCE, vec![MARCH_A - REST_A, MARCH_A]);
    let end = match solver.transient(start, &plan, &mut keep) {
        Err(SolveError::Stopped { time_a }) => {
            return Ok(("failed", format!("given up at t = {time_a} a after {MOST_STEPS} steps")));
        }
        end => end?,
    };
    Ok(match (end.ending, landed.as_slice()) {
        (Ending::Completed, [before, after]) => {
            let change = |a: f64, b: f64| (b / a - 1.0).abs();
            let change = change(before.0, after.0).max(change(before.1, after.1));
            let ending = if change < AT_REST { "at_rest" } else { "still_moving" };
            let (length_m, thickness_m) = after;
            let what = format!(
                "at rest after {MARCH_A} a: L = {length_m:.0} m, H0 = {thickness_m:.2} m, \
                 which change by {change:.1e} in {REST_A} a"
            );
            (ending, what)
        }
        (Ending::Collapsed, _) => ("collapsed", String::new()),
        (Ending::Overthick, _) => ("overthick", String::new()),
        (Ending::FjordClosed, _) => ("fjord_closed", String::new()),
        (Ending::Completed, _) => ("failed", "it ended without landing where it should".into()),
    })
}

fn finding(index: u64, parameters: &Parameters, what: String) -> Finding {
    let mut named = serde_json::Map::new();
    for name in DRAWS.iter().flat_map(|(names, ..)| *names).chain(&["d_m"]) {
        let info = melange_solver::params::info(name).expect("what is drawn is a parameter");
        let value = (info.get)(parameters);
        named.insert((*name).into(), if info.whole { json!(value as u64) } else { json!(value) });
    }
    Finding { index, what, scenario: json!({"regime": "steady", "parameters": named}) }
}

fn slowest(solved: &[Solved], most_cells: usize) -> Slowest {
    let those = solved.iter().filter(|s| s.parameters.n_cells <= most_cells);
    those.max_by_key(|s| s.duration).map_or_else(Slowest::default, |s| Slowest {
        index: s.index,
        n_cells: s.parameters.n_cells,
        duration_ms: milliseconds(s.duration),
    })
}

/// The upper of the two in the middle where their number is even; 0 if there is none.
fn median_ms(solved: &[Solved], most_cells: usize) -> f64 {
    let those = solved.iter().filter(|s| s.parameters.n_cells <= most_cells);
    let mut durations: Vec<Duration> = those.map(|s| s.duration).collect();
    durations.sort_unstable();
    durations.get(durations.len() / 2).map_or(0.0, |d| milliseconds(*d))
}

fn milliseconds(duration: Duration) -> f64 {
    duration.as_secs_f64() * 1e3
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let shares = |f: &mut fmt::Formatter<'_>, counts: &BTreeMap<&str, u64>| {
            let total: u64 = counts.values().sum();
            for (ending, count) in counts {
                let percent = 100.0 * *count as f64 / total as f64;
                writeln!(f, "  {ending:<16} {count:>7}  {percent:6.2} %")?;
            }
            Ok(())
        };
        writeln!(f, "{} parameter sets, seed {}", self.count, self.seed)?;
        shares(f, &self.endings)?;
        let slow = |s: &Slowest| {
            format!("slowest {:.0} ms (set {}, N = {})", s.duration_ms, s.index, s.n_cells)
        };
        if !self.marches.is_empty() {
            let slowest = slow(&self.slowest_march);
            writeln!(
                f,
                "marches of {MARCH_A} a where no steady state is said to exist, {slowest}"
            )?;
            shares(f, &self.marches)?;
        }
        writeln!(
            f,
            "N up to {EVERYDAY_CELLS}: median {:.1} ms, {}\nall: median {:.1} ms, {}",
            self.median_everyday_ms,
            slow(&self.slowest_everyday),
            self.median_ms,
            slow(&self.slowest)
        )?;
        for (kind, findings) in self.findings() {
            for Finding { index, what, scenario } in findings {
                writeln!(f, "{kind}: set {index}: {what}\n  echo '{scenario}' | melange run -")?;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a seed draws is a promise: findings are told by seed and number.
    #[test]
    fn a_seed_draws_the_same_on_any_machine() {
        let p = draw(1, 195).expect("in range");
        let drawn = [p.melt_rate_m_per_day, p.width_m, p.width_gradient, p.calving_rate_m_per_a];
        assert_eq!(drawn, [2.04929, 17_851.6, -0.048_126_6, 2_718.83]);
        let drawn = [p.terminus_thickness_m, p.d_m, p.b, p.A, p.mu_s, p.n_cells as f64];
        assert_eq!(drawn, [1_112.41, 5.289_57, 16_281.3, 0.598_035, 0.142_618, 393.0]);
        assert_eq!(p.terminus_velocity_m_per_a, p.calving_rate_m_per_a);
        assert_ne!(draw(2, 195), draw(1, 195));
    }

    #[test]
    fn every_draw_is_a_mélange() {
        for index in 0..20_000 {
            let p = draw(7, index).expect("in range");
            assert!(p.check().is_ok(), "{index}: {p:?}");
        }
    }
}
