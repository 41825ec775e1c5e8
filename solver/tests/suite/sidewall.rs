//! The transverse solver against a plain one written from Eqs. C5 and C6, and that one against its
//! own refinement.

use crate::assert_close;
use melange_solver::params::{GRAVITY, ICE_DENSITY, Parameters, SECONDS_PER_YEAR, WATER_DENSITY};
use melange_solver::physics::sidewall::{MeanSpeed, Section, friction_for, mean_speeds};

/// Mean speed of a transect with M intervals over the half width, equation by equation.
fn plain_mean_speed(p: &Parameters, s: Section, intervals: usize) -> f64 {
    let m_max = intervals;
    let dy = s.width_m / (2.0 * m_max as f64);
    let mu = |m: usize| s.mu_w * (1.0 - m as f64 / m_max as f64);
    let pressure =
        0.5 * ICE_DENSITY * GRAVITY * (1.0 - ICE_DENSITY / WATER_DENSITY) * s.thickness_m;
    let local = |m: usize| {
        if mu(m) > p.mu_s {
            (pressure / ICE_DENSITY).sqrt() / p.d_m * (mu(m) - p.mu_s) / (mu(m) * p.b)
                * SECONDS_PER_YEAR
        } else {
            0.0
        }
    };
    // Thomas algorithm with the end rows g_1 − g_0 = 0 and g_M − g_{M−1} = 0 as they stand.
    let (mut upper, mut value) = (vec![0.0; m_max + 1], vec![0.0; m_max + 1]);
    (upper[0], value[0]) = (-1.0, 0.0);
    for m in 1..=m_max {
        let (below, diagonal, above, rhs) = if m == m_max {
            (-1.0, 1.0, 0.0, 0.0)
        } else {
            let k = dy * dy * (mu(m) - p.mu_s).abs() / (p.A * p.d_m).powi(2);
            (1.0, -2.0 - k, 1.0, -k * local(m))
        };
        let pivot = diagonal - below * upper[m - 1];
        upper[m] = above / pivot;
        value[m] = (rhs - below * value[m - 1]) / pivot;
    }
    let mut g = value;
    for m in (0..m_max).rev() {
        g[m] -= upper[m] * g[m + 1];
    }
    let mut u = vec![0.0; m_max + 1];
    for m in (1..m_max).step_by(2) {
        u[m + 1] = u[m - 1] + 4.0 * dy * mu(m) * g[m];
    }
    u[m_max - 1] = u[m_max];
    for m in (2..m_max).rev().filter(|m| m % 2 == 0) {
        u[m - 1] = u[m + 1] - 4.0 * dy * mu(m) * g[m];
    }
    let simpson: f64 = (0..=m_max)
        .map(|m| {
            u[m] * if m == 0 || m == m_max {
                1.0
            } else if m % 2 == 1 {
                4.0
            } else {
                2.0
            }
        })
        .sum();
    simpson / (3.0 * m_max as f64)
}

fn sections() -> Vec<Section> {
    let mut sections = Vec::new();
    for mu_w in [0.305, 0.32, 0.35, 0.41, 0.61, 1.7] {
        for (thickness_m, width_m) in [(30.0, 2000.0), (150.0, 4000.0), (400.0, 9000.0)] {
            sections.push(Section { mu_w, thickness_m, width_m });
        }
    }
    sections
}

fn speeds(p: &Parameters, sections: &[Section]) -> Vec<MeanSpeed> {
    let mut out = vec![MeanSpeed::default(); sections.len()];
    mean_speeds(p, 0.0, sections, &mut out);
    out
}

#[test]
fn mean_speed_equals_the_plain_solution() {
    for a in [0.1, 0.5, 5.0] {
        let p = Parameters { A: a, ..Parameters::default() };
        let sections = sections();
        for (section, got) in sections.iter().zip(speeds(&p, &sections)) {
            let expected = plain_mean_speed(&p, *section, 100);
            assert_close(&format!("{section:?}"), got.speed, expected, 1e-10);
        }
    }
}

#[test]
fn slopes_equal_differences() {
    let p = Parameters::default();
    let sections = sections();
    for (section, got) in sections.iter().zip(speeds(&p, &sections)) {
        let difference = |by: fn(&mut Section) -> &mut f64| {
            let mut moved = [*section; 2];
            let step = 1e-6 * *by(&mut moved[0]);
            *by(&mut moved[0]) += step;
            *by(&mut moved[1]) -= step;
            let ends = speeds(&p, &moved);
            (ends[0].speed - ends[1].speed) / (2.0 * step)
        };
        assert_close("by mu_w", got.by_mu, difference(|s| &mut s.mu_w), 1e-6);
        assert_close("by H", got.by_h, difference(|s| &mut s.thickness_m), 1e-6);
        assert_close("by W", got.by_w, difference(|s| &mut s.width_m), 1e-6);
    }
}

#[test]
fn the_discretisation_converges_to_its_own_limit() {
    let p = Parameters::default();
    let section = Section { mu_w: 0.41, thickness_m: 150.0, width_m: 4000.0 };
    let limit = plain_mean_speed(&p, section, 12_800);
    let error = |m: usize| (plain_mean_speed(&p, section, m) - limit).abs();
    // The one-sided end rows make the scheme first order.
    let order = (error(200) / error(800)).log2() / 2.0;
    assert!((0.9..1.6).contains(&order), "observed order {order:.2}");
}

#[test]
fn friction_gives_the_speed_back_and_is_odd_in_it() {
    let p = Parameters::default();
    let wanted = [12.0, -12.0, 3e3, 6e4, -6e4];
    let mut sections = wanted.map(|_| Section { mu_w: 0.0, thickness_m: 80.0, width_m: 4000.0 });
    friction_for(&p, &wanted, &mut sections);
    for (speed, wanted) in speeds(&p, &sections).iter().zip(wanted) {
        assert_close("speed", speed.speed, wanted, 1e-8);
    }
    assert_eq!(sections[3].mu_w, -sections[4].mu_w);
}

/// A transect's layer between flow and rest is here thinner than Δy: the model's own ū(μ_w) falls in
/// places, the rounded one does not, and rounding ends in the model.
#[test]
fn rounding_makes_the_speed_of_an_unresolved_transect_increase_with_its_friction() {
    let p = Parameters { A: 0.01, ..Parameters::default() };
    let sections: Vec<Section> = (0..4000)
        .map(|i| Section {
            mu_w: p.mu_s * (1.02 + 0.5 * i as f64 / 4000.0),
            thickness_m: 100.0,
            width_m: 4000.0,
        })
        .collect();
    let falls = |smoothing: f64| {
        let mut out = vec![MeanSpeed::default(); sections.len()];
        mean_speeds(&p, smoothing, &sections, &mut out);
        let count = out.windows(2).filter(|pair| pair[1].speed < pair[0].speed).count();
        assert_eq!(count > 0, out.iter().any(|s| s.by_mu < 0.0), "slopes tell the same");
        (count, out)
    };
    let (unrounded, limit) = falls(0.0);
    assert!(unrounded > 0);
    assert_eq!(falls(3e-2).0, 0);
    for (near, limit) in falls(1e-9).1.iter().zip(&limit) {
        assert_close("speed", near.speed, limit.speed, 1e-4);
    }
}
