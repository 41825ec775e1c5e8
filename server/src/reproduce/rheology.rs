//! Fig. 3: the rheology's parameters, one at a time, and a low yield coefficient with a b that makes up
//! for it.

use super::case::{self, Case, Changes, along};
use super::{Broken, Claim, Part};
use melange_solver::physics::closure::UpstreamClosure;
use melange_solver::steady::SteadyVerdict;
use melange_solver::{Model, Solver};
use rayon::prelude::*;

/// Yield coefficient of Fig. 3 below the default.
const LOW_YIELD: f64 = 0.2;

/// Place of Fig. 3e, as a fraction χ of the length.
const MIDPOINT: f64 = 0.5;

/// Fig. 3: the parameters that are varied, one at a time.
pub fn one_at_a_time() -> Vec<(String, Changes)> {
    let changes = [("d_m", 10.0), ("b", 5e4), ("A", 5.0), ("mu_s", LOW_YIELD)];
    changes.iter().flat_map(|(name, value)| along(name, &[*value])).collect()
}

/// Runs Fig. 3.
pub fn part() -> Result<Part, Broken> {
    let mut cases = vec![case::steady("base case", &[])?];
    cases.extend(case::all_steady(&one_at_a_time())?);
    let alike: Vec<Case> = [Case::length_m, Case::thickness_0_m]
        .par_iter()
        .map(|number| with_number_of(&cases[0], *number))
        .collect::<Result<_, _>>()?;
    let claims = claims(&cases, &alike);
    cases.extend(alike);
    Ok(Part {
        claims,
        tables: Vec::new(),
        figures: vec![
            case::scalars("fig3", &cases),
            case::nodes("fig3_profiles_nodes", &cases),
            case::cells("fig3_profiles_cells", &cases),
            case::transects("fig3_transverse", &cases, &[MIDPOINT]),
        ],
    })
}

/// The steady state at μ_s = 0.2 with the b that gives it a number of the base case, which grows with
/// b: bisection in ln b.
fn with_number_of(base: &Case, number: fn(&Case) -> f64) -> Result<Case, Broken> {
    /// Where b is sought.
    const B: (f64, f64) = (1e4, 1e6);
    /// Halvings: b to nine digits.
    const HALVINGS: usize = 30;
    let (mut low, mut high) = (f64::ln(B.0), f64::ln(B.1));
    for _ in 0..HALVINGS {
        let b = 0.5 * (low + high);
        let changes = [("mu_s", LOW_YIELD), ("b", b.exp())];
        let model = case::model(&changes, UpstreamClosure::Published)?;
        let is_below = match try_steady(&model)? {
            Some(case) => number(&case) < number(base),
            None => false,
        };
        if is_below {
            low = b;
        } else {
            high = b;
        }
    }
    let b = low.exp();
    case::steady(&format!("mu_s = {LOW_YIELD}, b = {b:.5}"), &[("mu_s", LOW_YIELD), ("b", b)])
}

/// A steady state; none where the mélange would be as thick as the glacier.
fn try_steady(model: &Model) -> Result<Option<Case>, Broken> {
    let name = "search for b";
    match Solver::new(model.clone()).steady(None).map_err(case::failed(name))? {
        SteadyVerdict::Converged { solution, .. } => {
            Ok(Some(Case { name: name.into(), model: model.clone(), state: solution.state }))
        }
        SteadyVerdict::Overthick(_) => Ok(None),
        SteadyVerdict::NoSteadyState(evidence) | SteadyVerdict::FjordClosed(evidence) => {
            Err(Broken::Ended { case: name.into(), ending: evidence })
        }
    }
}

/// A case's numbers by those of the base case.
#[derive(Debug, Clone, Copy)]
struct Ratios {
    thickness: f64,
    length: f64,
    velocity: f64,
    fluidity: f64,
    force: f64,
}

impl Ratios {
    fn new(case: &Case, base: &Case) -> Self {
        Self {
            thickness: case.thickness_0_m() / base.thickness_0_m(),
            length: case.length_m() / base.length_m(),
            velocity: case.velocity_mean_m_per_a() / base.velocity_mean_m_per_a(),
            fluidity: case.fluidity_mean_per_a() / base.fluidity_mean_per_a(),
            force: case.force_n_per_m() / base.force_n_per_m(),
        }
    }

    fn numbers(&self) -> Vec<(&'static str, f64)> {
        vec![
            ("fluidity_mean_ratio", self.fluidity),
            ("velocity_mean_ratio", self.velocity),
            ("thickness_0_ratio", self.thickness),
            ("length_ratio", self.length),
            ("force_ratio", self.force),
        ]
    }
}

/// How far from the wall the speed at the midpoint reaches half of what it has in the middle, by the half
/// width: 0.5 for a straight profile, near 0 for plug flow between thin sheared margins.
fn half_speed_at(case: &Case) -> f64 {
    let t = case.transect(MIDPOINT);
    let half = 0.5 * t.velocity_m_per_a[t.velocity_m_per_a.len() - 1];
    let at = t.velocity_m_per_a.iter().position(|u| *u >= half).expect("it grows from 0");
    let (y, u) = (&t.y_m, &t.velocity_m_per_a);
    let reached = y[at - 1] + (y[at] - y[at - 1]) * (half - u[at - 1]) / (u[at] - u[at - 1]);
    reached / (0.5 * t.width_m)
}

fn claims(cases: &[Case], alike: &[Case]) -> Vec<Claim> {
    /// "Not much impact": less than this share.
    const NOT_MUCH: f64 = 0.1;
    /// "Similar profiles": within this share.
    const SIMILAR: f64 = 0.1;
    let base = &cases[0];
    let ratio = |index: usize| Ratios::new(&cases[index], base);
    let [d, b, a, mu_s] = [1, 2, 3, 4].map(ratio);
    let [same_length, same_thickness] = [0, 1].map(|i: usize| Ratios::new(&alike[i], base));
    let [sheared_base, sheared] = [base, &cases[3]].map(half_speed_at);
    let off = |ratios: Ratios| {
        case::largest([ratios.thickness, ratios.length, ratios.velocity].map(|r| (r - 1.0).abs()))
    };
    vec![
        Claim {
            id: "fig3_iceberg_size",
            place: "§3.1.1, Fig. 3",
            paper: "a smaller iceberg size (d = 10 m) leads to weaker (more fluid), faster, thinner and \
                    longer mélange",
            numbers: d.numbers(),
            holds: d.fluidity > 1.0 && d.velocity > 1.0 && d.thickness < 1.0 && d.length > 1.0,
            if_not: "",
        },
        Claim {
            id: "fig3_b",
            place: "§3.1.1, Fig. 3",
            paper: "increasing b (5 × 10⁴) makes the mélange stiffer (less fluid), thicker, longer and slower",
            numbers: b.numbers(),
            holds: b.fluidity < 1.0 && b.velocity < 1.0 && b.thickness > 1.0 && b.length > 1.0,
            if_not: "",
        },
        Claim {
            id: "fig3_a",
            place: "§3.1.1, Fig. 3",
            paper: "changing A (5) does not have much impact other than on the curvature of u(y)",
            numbers: [
                a.numbers(),
                vec![
                    ("half_speed_at_share_of_half_width", sheared),
                    ("half_speed_at_share_of_half_width_base", sheared_base),
                ],
            ]
            .concat(),
            holds: off(a) < NOT_MUCH,
            if_not: "",
        },
        Claim {
            id: "fig3_yield_coefficient",
            place: "§3.1.1, Fig. 3",
            paper: "a lower yield coefficient (μ_s = 0.2) makes it deform more easily (more fluid), thinner \
                    and shorter",
            numbers: mu_s.numbers(),
            holds: mu_s.fluidity > 1.0 && mu_s.thickness < 1.0 && mu_s.length < 1.0,
            if_not: "",
        },
        Claim {
            id: "fig3_similar_by_length",
            place: "§3.1.1",
            paper: "a lower yield coefficient with an appropriately larger b gives similar profiles (b at \
                    μ_s = 0.2 for the base case's length)",
            numbers: [vec![("b", alike[0].model.parameters().b)], same_length.numbers()].concat(),
            holds: off(same_length) < SIMILAR,
            if_not: "",
        },
        Claim {
            id: "fig3_similar_by_thickness",
            place: "§3.1.1",
            paper: "the same, with the b that gives the base case's thickness at the terminus",
            numbers: [vec![("b", alike[1].model.parameters().b)], same_thickness.numbers()]
                .concat(),
            holds: off(same_thickness) < SIMILAR,
            if_not: "",
        },
    ]
}
