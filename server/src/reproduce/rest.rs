//! Fig. 2: the steady base case, and what becomes of it with calving and melt turned off, by time and
//! straight at the limit.

use super::case::{self, Case, failed, fit, is_rising, largest, least, mean};
use super::table::{Cell, Table};
use super::{Broken, Claim, Part};
use crate::analysis::Law;
use melange_solver::forcing::{Course, Forcing};
use melange_solver::observe::Moment;
use melange_solver::physics::fluidity::yield_excess;
use melange_solver::quasi_static::{Given, QuasiStaticVerdict};
use melange_solver::transient::{Ending, Plan};
use melange_solver::{Solver, force};
use rayon::prelude::*;
use std::ops::ControlFlow;

/// Tolerance of the steps to rest.
pub const TOLERANCE: f64 = 1e-4;
/// Time to come to rest, a. After 5 a nothing changes any more in four digits; after 15 a a grid of 50
/// cells begins to drift, which the table shows.
pub const DURATION_A: f64 = 10.0;
/// Times kept on the way, a.
pub const KEPT_A: [f64; 7] = [0.0, 0.25, 0.5, 1.0, 2.0, 5.0, DURATION_A];
/// How long the drift is watched, a.
const WATCHED_A: f64 = 100.0;
/// Grids whose drift is watched.
const GRIDS: [f64; 3] = [50.0, 100.0, 200.0];

/// Places of Fig. 2e, as fractions χ of the length.
pub const FRACTIONS: [f64; 5] = [0.0, 0.25, 0.5, 0.75, 1.0];

/// Runs Fig. 2.
pub fn part() -> Result<Part, Broken> {
    let steady = case::steady("steady", &[])?;
    let way = without_ice(&steady, &KEPT_A)?;
    let at_end = way.last().expect("the end is kept").case.clone();
    let rest = limit(&at_end)?;
    let claims = claims(&steady, &at_end, &rest);
    let cases = [steady, at_end, rest];
    let columns = ["time_a", "length_m", "thickness_0_m", "force_n_per_m", "volume_m3"];
    let row = |kept: &Kept| -> Vec<Cell> {
        let case = &kept.case;
        let numbers =
            [case.length_m(), case.thickness_0_m(), case.force_n_per_m(), case.volume_m3()];
        [vec![kept.time_a.into()], numbers.map(Cell::from).to_vec()].concat()
    };
    Ok(Part {
        claims,
        tables: vec![drift()?],
        figures: vec![
            case::scalars("fig2", &cases),
            case::nodes("fig2_profiles_nodes", &cases),
            case::cells("fig2_profiles_cells", &cases),
            case::transects("fig2_transverse", &cases, &FRACTIONS),
            Table::data("fig2_series", &columns, way.iter().map(row).collect()),
        ],
    })
}

/// The mélange at a time.
struct Kept {
    time_a: f64,
    case: Case,
}

/// What becomes of a mélange without calving and melt, in front of a terminus that advances at U_t.
fn without_ice(steady: &Case, kept_a: &[f64]) -> Result<Vec<Kept>, Broken> {
    let name = "quasi-static, by time";
    let off = |name: &str| {
        (name.to_owned(), Course::Ramp { from: 0.0, to: 0.0, start_a: 0.0, end_a: 1.0 })
    };
    let forcing = Forcing::new(vec![off("melt_rate_m_per_day"), off("calving_rate_m_per_a")])
        .expect("nothing is within the ranges");
    let plan = Plan { forcing, ..Plan::controlled(TOLERANCE, kept_a.to_vec()) };
    let model = steady.model.at_rest();
    let mut kept = Vec::new();
    let mut keep = |m: Moment<'_>| {
        if m.landing.is_some() {
            let case = Case { name: name.into(), model: model.clone(), state: m.state.clone() };
            kept.push(Kept { time_a: m.time_a, case });
        }
        ControlFlow::Continue(())
    };
    let end = Solver::new(steady.model.clone())
        .transient(steady.state.clone(), &plan, &mut keep)
        .map_err(failed(name))?;
    if end.ending != Ending::Completed {
        return Err(Broken::Ended { case: name.into(), ending: format!("{:?}", end.ending) });
    }
    Ok(kept)
}

/// What the scheme does to a mélange at rest when it is left alone for long.
fn drift() -> Result<Table, Broken> {
    let row = |n_cells: &f64| -> Result<Vec<Cell>, Broken> {
        let steady = case::steady("steady", &[("n_cells", *n_cells)])?;
        let way = without_ice(&steady, &[DURATION_A, WATCHED_A])?;
        let [rest, late] = [&way[0].case, &way[1].case];
        Ok([
            *n_cells,
            rest.length_m(),
            rounded(late.length_m(), 10.0),
            rest.volume_m3() / steady.volume_m3() - 1.0,
            rounded(late.volume_m3() / rest.volume_m3() - 1.0, DRIFT_DIGIT),
        ]
        .map(Cell::from)
        .to_vec())
    };
    let rows = GRIDS.par_iter().map(row).collect::<Result<_, _>>()?;
    let columns = [
        "n_cells",
        "length_after_10_a_m",
        "length_after_100_a_m",
        "volume_change_until_10_a",
        "volume_change_10_to_100_a",
    ];
    Ok(Table {
        title: "At rest, and left alone for long",
        caption: "Without calving and melt nothing enters or leaves, so that the volume should stay. The first cell \
                  conserves nothing, which costs a percent on the way to rest; and on a coarse grid the fluidity of the \
                  mélange at rest falls, in decades, into a pattern of every other cell, after which ice seeps in at its end.",
        ..Table::data("rest_drift", &columns, rows)
    })
}

/// What grows from rounding is told to this digit, and a length to 10 m.
const DRIFT_DIGIT: f64 = 1e-3;

fn rounded(value: f64, digit: f64) -> f64 {
    (value / digit).round() * digit
}

/// The limit itself, at the volume that is left.
fn limit(at_end: &Case) -> Result<Case, Broken> {
    let name = "quasi-static, limit";
    let given = Given::Volume(at_end.volume_m3());
    let verdict = Solver::new(at_end.model.clone()).quasi_static(given).map_err(failed(name))?;
    match verdict {
        QuasiStaticVerdict::Converged(solution) => {
            Ok(Case { name: name.into(), model: at_end.model.clone(), state: solution.state })
        }
        QuasiStaticVerdict::Overthick(evidence) => {
            Err(Broken::Ended { case: name.into(), ending: evidence })
        }
    }
}

/// Largest less smallest μ_w, by their mean.
fn friction_spread(case: &Case) -> f64 {
    let mu = &case.state.mu_w;
    (largest(mu.iter().copied()) - least(mu.iter().copied())) / mean(mu)
}

/// R² of a line through ln H over x.
fn exponential_r_squared(case: &Case) -> f64 {
    let s = &case.state;
    fit(Law::Exponential, s.cell_x_m().into_iter().zip(s.thickness_m.iter().copied())).r_squared
}

/// Speeds relative to the walls, m a⁻¹.
fn wall_speeds_m_per_a(case: &Case) -> impl Iterator<Item = f64> {
    let p = case.model.parameters();
    let walls = p.terminus_velocity_m_per_a - p.calving_rate_m_per_a;
    case.state.velocity_m_per_a.iter().map(move |u| u + walls)
}

/// Shear along both walls by width, ρg(1 − ρ/ρ_w) ∫ H²μ_w/W dx (last term of Eq. 21), N m⁻¹.
fn lateral_shear_n_per_m(case: &Case) -> f64 {
    let s = &case.state;
    let shear = |(cell, h): (usize, &f64)| {
        let mu_w = 0.5 * (s.mu_w[cell] + s.mu_w[cell + 1]);
        2.0 * force::static_force_n_per_m(*h) * mu_w * s.dx_m() / case.model.parameters().width_m
    };
    s.thickness_m.iter().enumerate().map(shear).sum()
}

/// ξ = A d/√|μ − μ_s| (Eq. 18) of the inner cells, ascending, m.
fn cooperativity_lengths_m(case: &Case) -> Vec<f64> {
    let p = case.model.parameters();
    let length = |cell| {
        // 1 − μ_s/μ is what the solver tells.
        let share = yield_excess(p, &case.state, cell);
        p.A * p.d_m / (p.mu_s * share / (1.0 - share)).abs().sqrt()
    };
    let mut lengths: Vec<f64> = (1..case.state.n_cells() - 1).map(length).collect();
    lengths.sort_by(f64::total_cmp);
    lengths
}

fn claims(steady: &Case, at_end: &Case, rest: &Case) -> Vec<Claim> {
    /// A profile counts as roughly exponential from this R² of ln H over x on.
    const EXPONENTIAL: f64 = 0.99;
    /// μ_w counts as constant below this spread.
    const CONSTANT: f64 = 0.01;
    /// Two states agree when L and H₀ do to this share.
    const AGREE: f64 = 0.01;
    /// Hughes's drag of the water, its largest (§2.1), N m⁻¹.
    const DRAG_N_PER_M: f64 = 1e4;
    let [least_steady, largest_rest] =
        [least(wall_speeds_m_per_a(steady)), largest(wall_speeds_m_per_a(rest))];
    let [mu_before, mu_after] = [steady, rest].map(|c| mean(&c.state.mu_w));
    let [spread_before, spread_after] = [steady, rest].map(friction_spread);
    let [r2_before, r2_after] = [steady, rest].map(exponential_r_squared);
    let volumes = [steady, at_end].map(Case::volume_m3);
    let miss_length = at_end.length_m() / rest.length_m() - 1.0;
    let miss_thickness = at_end.thickness_0_m() / rest.thickness_0_m() - 1.0;
    let shear_by_drag = lateral_shear_n_per_m(steady) / DRAG_N_PER_M;
    let cooperativity_m = cooperativity_lengths_m(steady);
    let median_m = cooperativity_m[cooperativity_m.len() / 2];
    let inner = steady.state.n_cells();
    vec![
        Claim {
            id: "fig2_velocity_rises",
            place: "§3.1, Fig. 2a",
            paper: "velocities increase in the down-fjord direction in the steady state",
            numbers: vec![
                ("velocity_0_m_per_a", steady.state.velocity_m_per_a[0]),
                ("velocity_end_m_per_a", steady.state.velocity_m_per_a[inner]),
            ],
            holds: is_rising(steady.state.velocity_m_per_a[..inner].iter().copied()),
            if_not: "",
        },
        Claim {
            id: "fig2_friction_rises",
            place: "§3.1, Fig. 2d",
            paper: "the extensional flow is associated with an increase in μ_w down-fjord",
            numbers: vec![("mu_w_0", steady.state.mu_w[0]), ("mu_w_end", steady.state.mu_w[inner])],
            holds: is_rising(steady.state.mu_w.iter().copied()),
            if_not: "",
        },
        Claim {
            id: "fig2_time_leads_to_the_limit",
            place: "§3.1, Fig. 2",
            paper: "once calving and melting are turned off, the mélange evolves toward the \
                    quasi-static limit",
            numbers: vec![
                ("time_a", DURATION_A),
                ("length_ratio_to_limit", 1.0 + miss_length),
                ("thickness_0_ratio_to_limit", 1.0 + miss_thickness),
                ("volume_change", volumes[1] / volumes[0] - 1.0),
            ],
            holds: miss_length.abs() < AGREE && miss_thickness.abs() < AGREE,
            if_not: "",
        },
        Claim {
            id: "fig2_velocity_drops",
            place: "§3.1, Fig. 2a",
            paper: "the velocities drop: the icebergs are simply pushed at the rate of terminus advance",
            numbers: vec![
                ("wall_speed_least_steady_m_per_a", least_steady),
                ("wall_speed_largest_at_rest_m_per_a", largest_rest),
            ],
            holds: largest_rest < least_steady,
            if_not: "",
        },
        Claim {
            id: "fig2_friction_drops",
            place: "§3.1, Fig. 2d",
            paper: "the shear stresses decrease, which is reflected in a decrease in μ_w",
            numbers: vec![("mu_w_mean_steady", mu_before), ("mu_w_mean_at_rest", mu_after)],
            holds: mu_after < mu_before,
            if_not: "",
        },
        Claim {
            id: "fig2_spreads",
            place: "§3.1, Fig. 2b",
            paper: "the mélange thins and spreads outward",
            numbers: vec![
                ("thickness_0_steady_m", steady.thickness_0_m()),
                ("thickness_0_at_rest_m", rest.thickness_0_m()),
                ("length_steady_m", steady.length_m()),
                ("length_at_rest_m", rest.length_m()),
            ],
            holds: rest.thickness_0_m() < steady.thickness_0_m()
                && rest.length_m() > steady.length_m(),
            if_not: "",
        },
        Claim {
            id: "fig2_exponential_profile",
            place: "§3.1, Fig. 2b",
            paper: "at the quasi-static limit the thickness profile is roughly exponential",
            numbers: vec![
                ("r_squared_of_ln_h_steady", r2_before),
                ("r_squared_of_ln_h_at_rest", r2_after),
            ],
            holds: r2_after > EXPONENTIAL,
            if_not: "",
        },
        Claim {
            id: "fig2_friction_constant",
            place: "§3.1, Fig. 2d",
            paper: "at the quasi-static limit μ_w is spatially constant",
            numbers: vec![
                ("mu_w_relative_spread_steady", spread_before),
                ("mu_w_relative_spread_at_rest", spread_after),
            ],
            holds: spread_after < CONSTANT,
            if_not: "nearly: at one speed relative to the walls μ_w still depends on the thickness, through √P̃ in \
                     g_loc; the spread is a fifth of the steady state's",
        },
        Claim {
            id: "drag_is_small",
            place: "§2.1",
            paper: "the water's drag, 1–10 kN m⁻¹, is 1 to 2 orders of magnitude smaller than the \
                    forces of lateral shear",
            numbers: vec![
                ("lateral_shear_n_per_m", lateral_shear_n_per_m(steady)),
                ("orders_above_10_kn_per_m", shear_by_drag.log10()),
                ("orders_above_1_kn_per_m", shear_by_drag.log10() + 1.0),
            ],
            holds: shear_by_drag.log10() + 1.0 <= 2.5,
            if_not: "it is 3 to 4 orders smaller in the base case, which makes leaving it out the safer; the paper \
                     does not say which mélange it compares with",
        },
        Claim {
            id: "cooperativity_length",
            place: "§3.1.1",
            paper: "A = 0.5 gives cooperativity lengths of a few kilometres in the longitudinal direction",
            numbers: vec![
                ("cooperativity_length_least_m", cooperativity_m[0]),
                ("cooperativity_length_median_m", median_m),
                ("cooperativity_length_largest_m", cooperativity_m[cooperativity_m.len() - 1]),
            ],
            holds: (1e3..1e4).contains(&median_m),
            if_not: "in the base case μ exceeds μ_s by 0.002 to 0.004, which gives 200 to 300 m; kilometres \
                     would need an excess of 2 × 10⁻⁵",
        },
    ]
}
