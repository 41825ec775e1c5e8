//! Figs. 4–6 and the steady part of Fig. 8: glaciers of three sizes, melt rates, widths and gradients.

use super::case::{self, Case, Changes, along, fit, is_rising};
use super::{Broken, Claim, Part};
use crate::analysis::{Fit, Law};

/// Fig. 4: small, medium and large glacier.
pub fn glaciers() -> Vec<(String, Changes)> {
    let glacier = |name: &str, velocity: f64, thickness: f64, width: f64| {
        let changes = vec![
            ("terminus_velocity_m_per_a", velocity),
            ("calving_rate_m_per_a", velocity),
            ("terminus_thickness_m", thickness),
            ("width_m", width),
            ("melt_rate_m_per_day", 0.8),
        ];
        (name.to_owned(), changes)
    };
    vec![
        glacier("small glacier", 6000.0, 600.0, 4000.0),
        glacier("medium glacier", 7000.0, 700.0, 5000.0),
        glacier("large glacier", 8000.0, 800.0, 6000.0),
    ]
}

/// Fig. 5: melt rates.
pub fn melt_rates() -> Vec<(String, Changes)> {
    along("melt_rate_m_per_day", &[0.5, 0.6, 0.7, 0.8, 0.9, 1.0])
}

/// Fig. 6a and b: widths.
pub fn widths() -> Vec<(String, Changes)> {
    along("width_m", &[3000.0, 4000.0, 5000.0, 6000.0, 7000.0])
}

/// Fig. 6c and d: gradients of the width.
pub fn gradients() -> Vec<(String, Changes)> {
    along("width_gradient", &[-0.04, -0.02, 0.0, 0.02, 0.04])
}

/// Runs Figs. 4–6.
pub fn part() -> Result<Part, Broken> {
    let glaciers = case::all_steady(&glaciers())?;
    let melts = case::all_steady(&melt_rates())?;
    let widths = case::all_steady(&widths())?;
    let gradients = case::all_steady(&gradients())?;
    let claims = [
        by_glacier(&glaciers),
        by_melt(&melts),
        by_walls(&widths, &gradients),
        by_stretching(&[&melts[..], &widths, &gradients].concat()),
    ];
    let walls = [widths, gradients].concat();
    Ok(Part {
        claims: claims.concat(),
        tables: Vec::new(),
        figures: vec![
            case::scalars("fig4", &glaciers),
            case::nodes("fig4_profiles_nodes", &glaciers),
            case::cells("fig4_profiles_cells", &glaciers),
            case::transects("fig4_transverse", &glaciers, &[0.5]),
            case::scalars("fig5", &melts),
            case::cells("fig5_profiles", &melts),
            case::scalars("fig6", &walls),
            case::cells("fig6_profiles", &walls),
        ],
    })
}

/// F, or another number, over a parameter.
pub fn over(law: Law, cases: &[Case], parameter: &str, number: fn(&Case) -> f64) -> Fit {
    let info = melange_solver::params::info(parameter).expect("a parameter's name");
    fit(law, cases.iter().map(|c| ((info.get)(c.model.parameters()), number(c))))
}

fn by_glacier(cases: &[Case]) -> Vec<Claim> {
    /// A ratio printed as "100 % larger" lies within half of the last digit that would be printed.
    const DOUBLED: (f64, f64) = (1.95, 2.05);
    let [small, medium, large] = cases else { unreachable!("three glaciers") };
    let thickness = large.thickness_0_m() / small.thickness_0_m();
    let force = large.force_n_per_m() / small.force_n_per_m();
    let needed = {
        let terminus = |c: &Case| c.model.parameters().terminus_thickness_m;
        (terminus(large) / terminus(small)).powi(2)
    };
    vec![
        Claim {
            id: "fig4_grows_with_flux",
            place: "§3.1.2, Fig. 4",
            paper: "the mélange becomes longer and thicker as the glacier's fluxes increase",
            numbers: vec![
                ("length_small_m", small.length_m()),
                ("length_medium_m", medium.length_m()),
                ("length_large_m", large.length_m()),
                ("thickness_0_small_m", small.thickness_0_m()),
                ("thickness_0_medium_m", medium.thickness_0_m()),
                ("thickness_0_large_m", large.thickness_0_m()),
            ],
            holds: is_rising(cases.iter().map(Case::length_m))
                && is_rising(cases.iter().map(Case::thickness_0_m)),
            if_not: "",
        },
        Claim {
            id: "fig4_thickness",
            place: "§3.1.2, Fig. 4b",
            paper: "it is over 40 % thicker in the large-glacier scenario than in the small one",
            numbers: vec![("thickness_0_ratio", thickness)],
            holds: thickness > 1.4,
            if_not: "",
        },
        Claim {
            id: "fig4_force_doubles",
            place: "§3.1.2",
            paper: "the force is 100 % larger",
            numbers: vec![
                ("force_ratio", force),
                (
                    "force_quasi_static_ratio",
                    large.force_quasi_static_n_per_m() / small.force_quasi_static_n_per_m(),
                ),
            ],
            holds: (DOUBLED.0..DOUBLED.1).contains(&force),
            if_not: "",
        },
        Claim {
            id: "fig4_force_outgrows_capsize",
            place: "§3.1.2, §4",
            paper: "the force grows faster than what prevents capsize, H_t² (77 % larger)",
            numbers: vec![("force_ratio", force), ("terminus_thickness_squared_ratio", needed)],
            holds: force > needed,
            if_not: "",
        },
    ]
}

fn by_melt(cases: &[Case]) -> Vec<Claim> {
    /// What rounds to −3.
    const ABOUT_MINUS_3: (f64, f64) = (-3.5, -2.5);
    let falling = |number: fn(&Case) -> f64| is_rising(cases.iter().rev().map(number));
    let power = over(Law::Power, cases, "melt_rate_m_per_day", Case::force_n_per_m);
    let at_rest = over(Law::Power, cases, "melt_rate_m_per_day", Case::force_quasi_static_n_per_m);
    let square = fit(Law::Power, cases.iter().map(|c| (c.thickness_0_m(), c.force_n_per_m())));
    vec![
        Claim {
            id: "fig5_shrinks_with_melt",
            place: "§3.1.2, Fig. 5a",
            paper: "thickness and length are sensitive to melt",
            numbers: vec![
                ("thickness_0_at_0.5_m_per_day_m", cases[0].thickness_0_m()),
                ("thickness_0_at_1.0_m_per_day_m", cases[cases.len() - 1].thickness_0_m()),
                ("length_at_0.5_m_per_day_m", cases[0].length_m()),
                ("length_at_1.0_m_per_day_m", cases[cases.len() - 1].length_m()),
            ],
            holds: falling(Case::thickness_0_m) && falling(Case::length_m),
            if_not: "",
        },
        Claim {
            id: "fig5_exponent",
            place: "§3.1.2, Fig. 5b",
            paper: "the force depends on the melt rate through an inverse power law with an exponent of \
                    about −3",
            numbers: vec![
                ("exponent", power.exponent.estimate),
                ("exponent_ci95_low", power.exponent.ci95[0]),
                ("exponent_ci95_high", power.exponent.ci95[1]),
                ("r_squared", power.r_squared),
                ("exponent_without_stretching", at_rest.exponent.estimate),
            ],
            holds: (ABOUT_MINUS_3.0..ABOUT_MINUS_3.1).contains(&power.exponent.estimate),
            if_not: "",
        },
        Claim {
            id: "fig8_steady_square",
            place: "§3.3, Fig. 8",
            paper: "for parallel-sided fjords the force in the steady-state regime scales with H₀²",
            numbers: vec![
                ("exponent", square.exponent.estimate),
                ("exponent_ci95_low", square.exponent.ci95[0]),
                ("exponent_ci95_high", square.exponent.ci95[1]),
                ("r_squared", square.r_squared),
            ],
            holds: (1.9..2.1).contains(&square.exponent.estimate) && square.r_squared > 0.99,
            if_not: "",
        },
    ]
}

fn by_walls(widths: &[Case], gradients: &[Case]) -> Vec<Claim> {
    /// A decay counts as roughly exponential from this R² of ln F on.
    const EXPONENTIAL: f64 = 0.98;
    let claim = |id, place, paper, cases: &[Case], parameter: &str| {
        let exponential = over(Law::Exponential, cases, parameter, Case::force_n_per_m);
        let slopes: Vec<f64> = cases
            .windows(2)
            .map(|pair| (pair[1].force_n_per_m() / pair[0].force_n_per_m()).ln())
            .collect();
        Claim {
            id,
            place,
            paper,
            numbers: vec![
                ("rate_of_ln_force", exponential.exponent.estimate),
                ("r_squared", exponential.r_squared),
                ("ln_force_first_step", slopes[0]),
                ("ln_force_last_step", slopes[slopes.len() - 1]),
            ],
            holds: slopes.iter().all(|s| *s < 0.0) && exponential.r_squared > EXPONENTIAL,
            if_not: "",
        }
    };
    let straight = &gradients[gradients.len() / 2];
    let mut by_width = claim(
        "fig6_width",
        "§3.1.2, Fig. 6a–b",
        "the force decays roughly exponentially with fjord width",
        widths,
        "width_m",
    );
    let power = over(Law::Power, widths, "width_m", Case::force_n_per_m);
    by_width.numbers.extend([
        ("exponent_of_a_power_law", power.exponent.estimate),
        ("r_squared_of_a_power_law", power.r_squared),
    ]);
    vec![
        by_width,
        claim(
            "fig6_gradient",
            "§3.1.2, Fig. 6c–d",
            "the force decays roughly exponentially with the width gradient",
            gradients,
            "width_gradient",
        ),
        Claim {
            id: "fig6_thinner_when_wide",
            place: "§3.1.2, Fig. 6a",
            paper: "increasing the width makes the mélange thinner",
            numbers: vec![
                ("thickness_0_at_3000_m_m", widths[0].thickness_0_m()),
                ("thickness_0_at_7000_m_m", widths[widths.len() - 1].thickness_0_m()),
            ],
            holds: is_rising(widths.iter().rev().map(Case::thickness_0_m)),
            if_not: "",
        },
        Claim {
            id: "fig6_converging_walls",
            place: "§3.1.2, Fig. 6c",
            paper: "converging walls allow for a thicker mélange",
            numbers: vec![
                ("thickness_0_converging_m", gradients[0].thickness_0_m()),
                ("thickness_0_parallel_m", straight.thickness_0_m()),
            ],
            holds: is_rising(gradients.iter().rev().map(Case::thickness_0_m)),
            if_not: "",
        },
    ]
}

fn by_stretching(cases: &[Case]) -> Vec<Claim> {
    let share: Vec<f64> =
        cases.iter().map(|c| c.force_n_per_m() / c.force_quasi_static_n_per_m()).collect();
    let (least, largest) =
        (case::least(share.iter().copied()), case::largest(share.iter().copied()));
    vec![Claim {
        id: "stretching_lowers_the_force",
        place: "§3.3, Figs. 5 and 6",
        paper: "stretching makes the force less than would be expected from thickness alone",
        numbers: vec![("force_by_static_least", least), ("force_by_static_largest", largest)],
        holds: largest < 1.0,
        if_not: "",
    }]
}
